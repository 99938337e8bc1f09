"""The Hill frame that several ephemerides have in common: that of the first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closeform.arrays import Floats, number, sequence
from closeform.exchange.ephemeris import SAME_EPOCH, Ephemeris
from closeform.exchange.epochs import seconds_of
from closeform.motion.frames import AlongTrack, relative_from_inertial
from closeform.motion.mean_motion import EARTH_MU, mean_motion_from_semi_major_axis

# Frames of CCSDS 502.0-B annex B (and the usual J2000) that do not turn with the Earth.  TOD, MOD
# and TEME follow its pole: below 1e-11 rad/s, nothing beside a mean motion.
INERTIAL = ("EME2000", "GCRF", "ICRF", "J2000", "MCI", "MOD", "TEME", "TOD")


@dataclass(frozen=True, eq=False)
class CommonFrame:
    """Ephemerides of N objects in the Hill frame of the first, made by `common_frame`.

    Attributes
    ----------
    names : tuple of str
        The objects', the chief's first.
    epoch : str
        The ISO time of time 0 in `time_system`: the chief's own.
    time_system : str
        The one that all have.
    times : array of shape (T,) [s]
        Since `epoch`.
    states : array of shape (N, T, 6) [m, m/s]
        In the chief's Hill frame; zero for the chief.
    mean_motion : float [rad/s]
        Of the circle that the chief's orbit is taken for.
    radius : float [m]
        Of that circle.
    """

    names: tuple[str, ...]
    epoch: str
    time_system: str
    times: Floats
    states: Floats
    mean_motion: float
    radius: float


def common_frame(
    ephemerides: Sequence[Ephemeris], along_track: AlongTrack = "arc", mu: float = EARTH_MU
) -> CommonFrame:
    """The motion of several objects in the Hill frame of the first, at the epochs that all share.

    No state is interpolated.  The chief's orbit is taken for a circle of the mean, over the common
    epochs, of its osculating semi-major axis.

    Parameters
    ----------
    ephemerides : sequence of Ephemeris
        Two or more, the chief's first.
    along_track : "straight" or "arc", default "arc"
        As in `relative_from_inertial`; arcs are measured on the chief's circle.
    mu : float [m^3/s^2], default that of the Earth
        Gravitational parameter of the body.

    Returns
    -------
    CommonFrame
        Times, states and the chief's circle.

    Raises
    ------
    ValueError
        If there are fewer than two, equal names, different centres, frames or time systems, a frame that
        turns with the Earth, fewer than two common epochs, an open orbit, or a `mu` that is not positive;
        naming the objects.

    References
    ----------
    Kepler's third law; docs/ephemerides.md and docs/validity.md.
    """
    ephemerides = tuple(sequence("ephemerides", ephemerides, Ephemeris))
    if not (number("mu", mu) > 0.0 and np.isfinite(mu)):
        raise ValueError(f"mu: must be positive and finite, got {mu:g} m^3/s^2")
    _comparable(ephemerides)
    chief = ephemerides[0]
    offsets = seconds_of([each.epoch for each in ephemerides], chief.time_system)
    shared = np.ones(len(chief.times), dtype=bool)
    nearest = []
    for each, offset in zip(ephemerides, offsets, strict=True):
        times = each.times + offset
        after = np.clip(np.searchsorted(times, chief.times), 1, len(times) - 1)
        index = after - (chief.times - times[after - 1] < times[after] - chief.times)
        shared &= np.abs(times[index] - chief.times) <= SAME_EPOCH
        nearest.append(index)
    if shared.sum() < 2:
        names = ", ".join(each.name for each in ephemerides)
        raise ValueError(f"{names}: fewer than two common epochs; sample them at the same times")
    pairs = zip(ephemerides, nearest, strict=True)
    inertial = np.stack([each.states[index[shared]] for each, index in pairs])
    speed_squared = (inertial[0, :, 3:] ** 2).sum(-1)
    inverse = 2.0 / np.linalg.norm(inertial[0, :, :3], axis=-1) - speed_squared / mu
    if not (inverse > 0.0).all():
        raise ValueError(f"{chief.name}: not on a closed orbit about {chief.center} with mu = {mu:g} m^3/s^2")
    radius = float((1.0 / inverse).mean())
    circle = radius if along_track == "arc" else None
    states = relative_from_inertial(inertial[0], inertial, along_track, circle)
    states[0] = 0.0
    return CommonFrame(
        names=tuple(each.name for each in ephemerides),
        epoch=chief.epoch,
        time_system=chief.time_system,
        times=chief.times[shared],
        states=states,
        mean_motion=float(mean_motion_from_semi_major_axis(radius, mu)),
        radius=radius,
    )


def _comparable(ephemerides: tuple[Ephemeris, ...]) -> None:
    if len(ephemerides) < 2:
        raise ValueError(f"ephemerides: at least two are needed, got {len(ephemerides)}")
    chief = ephemerides[0]
    if chief.frame.upper() not in INERTIAL:
        what = f"REF_FRAME {chief.frame} turns with the Earth or is unknown"
        raise ValueError(f"{chief.name}: {what}; convert to one of {', '.join(INERTIAL)}")
    names = set()
    for each in ephemerides:
        for keyword, mine, first in (
            ("CENTER_NAME", each.center, chief.center),
            ("REF_FRAME", each.frame, chief.frame),
            ("TIME_SYSTEM", each.time_system, chief.time_system),
        ):
            if mine.upper() != first.upper():
                what = f"{keyword} {mine} differs from {first} of {chief.name}"
                raise ValueError(f"{each.name}: {what}; convert one of them")
        if each.name in names:
            raise ValueError(f"{each.name}: two ephemerides have this OBJECT_NAME; give each its own")
        names.add(each.name)
