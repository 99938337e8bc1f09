"""The Hill frame that several ephemerides have in common: that of the first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats, number, sequence
from closeform.exchange.carried_covariance import covariance_at
from closeform.exchange.ephemeris import SAME_EPOCH, Ephemeris
from closeform.exchange.epochs import seconds_of
from closeform.exchange.interpolation import interpolated
from closeform.motion.frames import AlongTrack, relative_from_inertial, relative_jacobian
from closeform.motion.mean_motion import EARTH_MU, mean_motion_from_semi_major_axis
from closeform.result import Result

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Errors

# Frames of CCSDS 502.0-B annex B (and the usual J2000) that do not turn with the Earth.  TOD, MOD
# and TEME follow its pole: below 1e-11 rad/s, nothing beside a mean motion.
INERTIAL = ("EME2000", "GCRF", "ICRF", "J2000", "MCI", "MOD", "TEME", "TOD")


@dataclass(frozen=True, eq=False, repr=False)
class CommonFrame(Result):
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
    covariances : tuple of array of shape (6, 6) [m^2, m^2/s, m^2/s^2] or None, of N
        Of each state at the first of `times`, in the chief's Hill frame; None of who has none.
    ages : tuple of float [s] or None, of N
        How long each was carried to that time by Hill's equations, below 0 backwards; None of who has none.
    interpolation_errors : array of shape (N,) [m]
        By how much positions may be off, by estimate, as states were interpolated; 0 if none was.
    """

    names: tuple[str, ...]
    epoch: str
    time_system: str
    times: Floats
    states: Floats
    mean_motion: float
    radius: float
    covariances: tuple[Floats | None, ...]
    ages: tuple[float | None, ...]
    interpolation_errors: Floats

    def columns(self) -> dict[str, Any]:
        """The states as columns, which pandas, polars and pyarrow make a data frame of.

        Returns
        -------
        dict of str to array of shape (N T,) [s, m, m/s, or no unit, as the names say]
            Object by object a row for each of `times`, in the chief's Hill frame.

        References
        ----------
        docs/python.md.
        """
        many = len(self.times)
        states = zip(
            ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s"), self.states.reshape(-1, 6).T, strict=True
        )
        return {
            "name": np.repeat(self.names, many),
            "time_s": np.tile(self.times, len(self.names)),
            **dict(states),
        }

    @property
    def errors(self) -> tuple[Errors | None, ...]:
        """Of each path from the first of `times` on, by its covariance; None of who has none."""
        from closeform.uncertainty.errors import Errors  # with kernels, which states alone can spare

        return tuple(None if held is None else Errors(held) for held in self.covariances)


def common_frame(
    ephemerides: Sequence[Ephemeris],
    along_track: AlongTrack = "arc",
    mu: float = EARTH_MU,
    interpolate: float | None = None,
) -> CommonFrame:
    """The motion of several objects in the Hill frame of the first, at the epochs that all share.

    Unless that is allowed no state is interpolated.  The chief's orbit is taken for a circle of the mean,
    over the common epochs, of its osculating semi-major axis.

    Parameters
    ----------
    ephemerides : sequence of Ephemeris
        Two or more, the chief's first.
    along_track : "straight" or "arc", default "arc"
        As in `relative_from_inertial`; arcs are measured on the chief's circle.
    mu : float [m^3/s^2], default that of the Earth
        Gravitational parameter of the body.
    interpolate : float [m], optional
        By how much positions may be off, by estimate, if states are interpolated to the epochs of whose are
        densest: by polynomials through six positions and velocities (Hermite's), of degree 11.

    Returns
    -------
    CommonFrame
        Times, states and the chief's circle; covariances at the first time where ephemerides have some.

    Raises
    ------
    ValueError
        If there are fewer than two, equal names, different centres, frames or time systems, a frame that
        turns with the Earth, fewer than two common epochs, states too far apart to interpolate, an open
        orbit, or a `mu` that is not positive; naming the objects.

    References
    ----------
    Kepler's third law; docs/ephemerides.md and docs/validity.md.
    """
    ephemerides = tuple(sequence("ephemerides", ephemerides, Ephemeris))
    if not (number("mu", mu) > 0.0 and np.isfinite(mu)):
        raise ValueError(f"mu: must be positive and finite, got {mu:g} m^3/s^2")
    if interpolate is not None and not number("interpolate", interpolate) >= 0.0:
        raise ValueError(f"interpolate: by how much states may be off, 0 or more, got {interpolate:g} m")
    _comparable(ephemerides)
    chief = ephemerides[0]
    offsets = seconds_of([each.epoch for each in ephemerides], chief.time_system)
    if interpolate is None:
        times, inertial = _shared(ephemerides, offsets)
        errors = np.zeros(len(ephemerides))
    else:
        times, inertial, errors = _interpolated(ephemerides, offsets, interpolate)
    speed_squared = (inertial[0, :, 3:] ** 2).sum(-1)
    inverse = 2.0 / np.linalg.norm(inertial[0, :, :3], axis=-1) - speed_squared / mu
    if not (inverse > 0.0).all():
        raise ValueError(f"{chief.name}: not on a closed orbit about {chief.center} with mu = {mu:g} m^3/s^2")
    radius = float((1.0 / inverse).mean())
    circle = radius if isinstance(along_track, str) and along_track == "arc" else None
    states = relative_from_inertial(inertial[0], inertial, along_track, circle)
    states[0] = 0.0
    covariances, ages = [], []
    for each, offset, state in zip(ephemerides, offsets, inertial[:, 0], strict=True):
        found = covariance_at(each, times[0] - offset, mu)
        if found is not None:
            turn = relative_jacobian(inertial[0, 0], state, along_track, circle)
            found = turn @ found[0] @ turn.T, found[1]
        covariances.append(found and found[0])
        ages.append(found and found[1])
    return CommonFrame(
        names=tuple(each.name for each in ephemerides),
        epoch=chief.epoch,
        time_system=chief.time_system,
        times=times,
        states=states,
        mean_motion=float(mean_motion_from_semi_major_axis(radius, mu)),
        radius=radius,
        covariances=tuple(covariances),
        ages=tuple(ages),
        interpolation_errors=errors,
    )


def _shared(ephemerides: tuple[Ephemeris, ...], offsets: Floats) -> tuple[Floats, Floats]:
    """Times (T,) [s] at which all have states, after the chief's epoch, and these states (N, T, 6)."""
    chief = ephemerides[0]
    shared = np.ones(len(chief.times), dtype=bool)
    nearest = []
    for each, offset in zip(ephemerides, offsets, strict=True):
        times = each.times + offset
        after = np.clip(np.searchsorted(times, chief.times), 1, len(times) - 1)
        index = after - (chief.times - times[after - 1] < times[after] - chief.times)
        shared &= np.abs(times[index] - chief.times) <= SAME_EPOCH
        nearest.append(index)
    if shared.sum() < 2:
        start, stop = _common_span(ephemerides, offsets)
        names = ", ".join(each.name for each in ephemerides)
        remedy = 'allow it with interpolate=1.0 (m), or screen --interpolate "1 m"'
        how = f"states between them can be interpolated: {remedy}"
        if stop <= start:
            how = "they have no time in common; give files that overlap"
        raise ValueError(f"{names}: fewer than two common epochs; {how}")
    pairs = zip(ephemerides, nearest, strict=True)
    return chief.times[shared], np.stack([each.states[index[shared]] for each, index in pairs])


def _interpolated(
    ephemerides: tuple[Ephemeris, ...], offsets: Floats, allowed: float
) -> tuple[Floats, Floats, Floats]:
    """The epochs (T,) [s] of whose are densest, the states (N, T, 6) of all then, and errors (N,) [m]."""
    start, stop = _common_span(ephemerides, offsets)
    choices = [each.times + offset for each, offset in zip(ephemerides, offsets, strict=True)]
    inside = [times[(times >= start - SAME_EPOCH) & (times <= stop + SAME_EPOCH)] for times in choices]
    times = max(inside, key=len)
    if len(times) < 2:
        names = ", ".join(each.name for each in ephemerides)
        raise ValueError(f"{names}: they have less than two epochs in common time; give files that overlap")
    states, errors = [], []
    for each, offset in zip(ephemerides, offsets, strict=True):
        found, off = interpolated(each, times - offset)
        if (worst := float(off.max())) > allowed:
            what = f"interpolated states may be off by {worst:.3g} m, more than {allowed:g} m"
            raise ValueError(f"{each.name}: {what}; give states closer in time, or allow so much")
        states.append(found)
        errors.append(worst)
    return times, np.stack(states), np.array(errors)


def _common_span(ephemerides: tuple[Ephemeris, ...], offsets: Floats) -> tuple[float, float]:
    """From when until when all have states [s]."""
    pairs = list(zip(ephemerides, offsets, strict=True))
    begins = max(float(each.times[0] + offset) for each, offset in pairs)
    return begins, min(float(each.times[-1] + offset) for each, offset in pairs)


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
