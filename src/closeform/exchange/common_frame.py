"""Common Hill frame of several ephemerides: that of the first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, numbers, positive, sequence, shown
from closeform.exchange.ephemerides.ephemeris import SAME_EPOCH, Ephemeris
from closeform.exchange.ephemerides.interpolation import nearest
from closeform.exchange.ephemerides.propagated_covariance import covariance_at
from closeform.exchange.ephemerides.spans import Spans
from closeform.exchange.epochs import seconds_of
from closeform.motion.elements.frames import AlongTrack, relative_from_inertial, relative_jacobian
from closeform.motion.elements.mean_motion import EARTH_MU, mean_motion_from_semi_major_axis
from closeform.result import Result

if TYPE_CHECKING:
    from closeform.motion.path import Path
    from closeform.uncertainty.errors import Uncertainty

# Frames of CCSDS 502.0-B annex B (and the usual J2000) that do not rotate with the Earth. TOD, MOD and TEME
# follow its pole: below 1e-11 rad/s, negligible against a mean motion.
INERTIAL = ("EME2000", "GCRF", "ICRF", "J2000", "MCI", "MOD", "TEME", "TOD")


@dataclass(frozen=True, eq=False, repr=False)
class CommonFrame(Result):
    """Ephemerides of N objects in the Hill frame of the first, made by `common_frame`.

    Attributes
    ----------
    names : tuple of str
        Names of the objects, the chief's first.
    epoch : str
        ISO epoch of time 0 in `time_system`: the chief's own.
    time_system : str
        Time system of all ephemerides.
    times : array of shape (T,) [s]
        Times since `epoch`.
    states : array of shape (N, T, 6) [m, m/s]
        States in the chief's Hill frame; zero for the chief.
    mean_motion : float [rad/s]
        Mean motion of the circle that approximates the chief's orbit.
    radius : float [m]
        Radius of that circle.
    covariances : tuple of array of shape (6, 6) [m^2, m^2/s, m^2/s^2] or None, of N
        Covariance of each state at the first of `times`, in the chief's Hill frame; None if there is none.
    ages : tuple of float [s] or None, of N
        Time over which each was propagated to that time by Hill's equations, negative if backwards, or None.
    interpolation_errors : array of shape (N,) [m]
        Estimated position errors due to interpolation; 0 without interpolation.
    arrivals : array of shape (N, T, 6) [m, m/s]
        States in the same frame: equal to `states`, except before manoeuvres.
    manoeuvres : tuple of tuple of tuple of float [s, m/s], of N
        For each object the times of velocity jumps since `epoch`, and their sizes.
    ephemerides : tuple of tuple of Ephemeris, of N
        The segments of each object, as given.
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
    arrivals: Floats
    manoeuvres: tuple[tuple[tuple[float, float], ...], ...]
    ephemerides: tuple[tuple[Ephemeris, ...], ...] = field(repr=False)

    def inertial_states(self, name: str, times: ArrayLike) -> Floats:
        """Return the inertial states of one object, interpolated in its own ephemeris.

        Parameters
        ----------
        name : str
            One of `names`.
        times : array_like of shape (T,) [s]
            Since `epoch`, from the first to the last of `times`.

        Returns
        -------
        array of shape (T, 6) [m, m/s]
            In the frame of the ephemerides; at a manoeuvre the state after it.

        Raises
        ------
        ValueError
            If no object has this name, or a time is outside of the common time.

        References
        ----------
        docs/ephemerides.md.
        """
        if instance("name", name, str) not in self.names:
            raise ValueError(f"name: no ephemeris of {shown(name)}; use one of {', '.join(self.names)}")
        wanted, (first, last) = numbers("times", times), self.times[[0, -1]]
        fits = (wanted >= first - SAME_EPOCH) & (wanted <= last + SAME_EPOCH)
        if wanted.ndim != 1 or not fits.all():
            raise ValueError(f"times: expected shape (T,), from {first:g} to {last:g} s, the common time")
        k = self.names.index(name)
        return self._spans[k].states(wanted - self._offsets[k])[0]

    def _starts(self, k: int) -> list[float]:
        """Return time 0 of each segment of object k [s], since `epoch`."""
        return [float(self._offsets[k]) + start for start in self._spans[k].starts]

    @cached_property
    def _spans(self) -> tuple[Spans, ...]:
        return tuple(Spans.of(one) for one in self.ephemerides)

    @cached_property
    def _offsets(self) -> Floats:
        """Time 0 of each ephemeris (N,) [s], since `epoch`."""
        return seconds_of([one[0].epoch for one in self.ephemerides], self.time_system)

    @property
    def paths(self) -> Path:
        """Paths (N,) through all states, in Hill's frame of the circle; manoeuvres are impulses."""
        from closeform.motion.orbit import Orbit  # imported here: states alone need no kernels

        return Orbit(self.mean_motion)._through(self.times, self.states, self.arrivals)

    def columns(self) -> dict[str, Any]:
        """Return the states as columns, from which pandas, polars and pyarrow make a data frame.

        Returns
        -------
        dict of str to array of shape (N T,) [s, m, m/s, or no unit, as the names say]
            One row for each object and time, object by object, in the chief's Hill frame.

        References
        ----------
        docs/results.md.
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
    def errors(self) -> tuple[Uncertainty | None, ...]:
        """Errors of each path from the first of `times` on, from its covariance, or None."""
        from closeform.uncertainty.errors import Uncertainty  # imported here: states alone need no kernels

        return tuple(None if held is None else Uncertainty(held) for held in self.covariances)


def common_frame(
    ephemerides: Sequence[Ephemeris | Sequence[Ephemeris]],
    along_track: AlongTrack = "arc",
    mu: float = EARTH_MU,
    interpolate: float | None = None,
) -> CommonFrame:
    """Return the motion of several objects in the Hill frame of the first, at their common epochs.

    States are interpolated only if allowed.  The chief's orbit is approximated by a circle of the mean,
    over the common epochs, of its osculating semi-major axis.

    Parameters
    ----------
    ephemerides : sequence of Ephemeris, or of sequences of Ephemeris
        Two or more, the chief's first; an object with manoeuvres is given by segments, as from
        `read_oem_segments`.
    along_track : "straight" or "arc", default "arc"
        Convention of `relative_from_inertial`; arcs are measured on the chief's circle.
    mu : float [m^3/s^2], default that of the Earth
        Gravitational parameter of the body.
    interpolate : float [m], optional
        Accepted estimated position error if states are interpolated to the epochs of the densest ephemeris,
        by polynomials of degree 11 through six positions and velocities (Hermite), never
        across the edges of segments.

    Returns
    -------
    CommonFrame
        Times, states and the chief's circle; covariances at the first time if ephemerides have any.

    Raises
    ------
    ValueError
        If there are fewer than two, equal names, different centres, frames or time systems, a frame
        that rotates with the Earth, fewer than two common epochs, states too far apart to
        interpolate, gaps or position jumps between segments, an open orbit, or a `mu` that is not
        positive; the message names objects.

    References
    ----------
    Kepler's third law; docs/ephemerides.md and docs/models.md.
    """
    spans = _spans(ephemerides)
    positive("mu", mu, " m^3/s^2")
    if interpolate is not None and not number("interpolate", interpolate) >= 0.0:
        raise ValueError(f"interpolate: must be 0 m or more, got {interpolate:g} m")
    _comparable([each.first for each in spans])
    chief = spans[0].first
    offsets = seconds_of([each.first.epoch for each in spans], chief.time_system)
    times = _shared(spans, offsets) if interpolate is None else _densest(spans, offsets)
    inertial, before, errors = _states(spans, offsets, times, interpolate)
    speed_squared = (inertial[0, :, 3:] ** 2).sum(-1)
    inverse = 2.0 / np.linalg.norm(inertial[0, :, :3], axis=-1) - speed_squared / mu
    if not (inverse > 0.0).all():
        raise ValueError(f"{chief.name}: not on a closed orbit about {chief.center} with mu = {mu:g} m^3/s^2")
    radius = float((1.0 / inverse).mean())
    circle = radius if isinstance(along_track, str) and along_track == "arc" else None
    states = relative_from_inertial(inertial[0], inertial, along_track, circle)
    fires = any(each.manoeuvres for each in spans)
    arrivals = relative_from_inertial(before[0], before, along_track, circle) if fires else states.copy()
    states[0] = arrivals[0] = 0.0
    covariances, ages = [], []
    for each, offset, state in zip(spans, offsets, inertial[:, 0], strict=True):
        found = covariance_at(each.first, times[0] - offset, mu)
        if found is not None:
            turn = relative_jacobian(inertial[0, 0], state, along_track, circle)
            found = turn @ found[0] @ turn.T, found[1]
        covariances.append(found and found[0])
        ages.append(found and found[1])
    return CommonFrame(
        names=tuple(each.name for each in spans),
        epoch=chief.epoch,
        time_system=chief.time_system,
        times=times,
        states=states,
        mean_motion=float(mean_motion_from_semi_major_axis(radius, mu)),
        radius=radius,
        covariances=tuple(covariances),
        ages=tuple(ages),
        interpolation_errors=errors,
        arrivals=arrivals,
        manoeuvres=tuple(_fired(each, offset, times) for each, offset in zip(spans, offsets, strict=True)),
        ephemerides=tuple(each.segments for each in spans),
    )


def _spans(given: Sequence[Ephemeris | Sequence[Ephemeris]]) -> tuple[Spans, ...]:
    """Return the segments of each object; raise ValueError for another type."""
    each = [
        one if isinstance(one, Ephemeris) else tuple(sequence("ephemerides", one, Ephemeris))
        for one in sequence("ephemerides", given, Ephemeris, Sequence)
    ]
    if any(isinstance(one, tuple) and not one for one in each):
        raise ValueError("ephemerides: an object has no segments; leave it out")
    return tuple(Spans.of(one) for one in each)


def _fired(spans: Spans, offset: float, times: Floats) -> tuple[tuple[float, float], ...]:
    """Return the manoeuvres of an object within the common time, since the chief's epoch."""
    moved = [(when + float(offset), size) for when, size in spans.manoeuvres]
    return tuple((when, size) for when, size in moved if times[0] <= when <= times[-1])


def _shared(spans: tuple[Spans, ...], offsets: Floats) -> Floats:
    """Return times (T,) [s] after the chief's epoch at which all objects have states."""
    chief = spans[0]
    shared = np.ones(len(chief.times), dtype=bool)
    for each, offset in zip(spans, offsets, strict=True):
        times = each.times + offset
        shared &= np.abs(times[nearest(times, chief.times)] - chief.times) <= SAME_EPOCH
    if shared.sum() < 2:
        start, stop = _common_span(spans, offsets)
        names = ", ".join(each.name for each in spans)
        remedy = 'allow it with interpolate=1.0 (m), or screen --interpolate "1 m"'
        how = f"states between them can be interpolated: {remedy}"
        if stop <= start:
            how = "they have no time in common; give files that overlap"
        raise ValueError(f"{names}: fewer than two common epochs; {how}")
    times = chief.times[shared]
    for each, offset in zip(spans, offsets, strict=True):
        for when, _ in each.manoeuvres:
            apart = float(np.abs(times - when - offset).min())
            if apart > SAME_EPOCH and times[0] < when + offset < times[-1]:
                what = f"has a manoeuvre {apart:.3g} s from the nearest common epoch"
                raise ValueError(
                    f'{each.name}: {what}; allow interpolation, as with screen --interpolate "1 m"'
                )
    return times


def _densest(spans: tuple[Spans, ...], offsets: Floats) -> Floats:
    """Return the epochs (T,) [s] of the densest ephemeris in the common time, and all edges of segments."""
    start, stop = _common_span(spans, offsets)

    def inside(times: Floats) -> Floats:
        return times[(times >= start - SAME_EPOCH) & (times <= stop + SAME_EPOCH)]

    pairs = list(zip(spans, offsets, strict=True))
    times = max((inside(each.times + offset) for each, offset in pairs), key=len)
    if len(times) < 2:
        names = ", ".join(each.name for each in spans)
        raise ValueError(f"{names}: fewer than two epochs in common time; give files that overlap")
    edges = inside(np.concatenate([each.edges[2::2] + offset for each, offset in pairs]))
    both = np.union1d(times, edges)
    return both[np.diff(both, prepend=-np.inf) > SAME_EPOCH]


def _states(
    spans: tuple[Spans, ...], offsets: Floats, times: Floats, allowed: float | None
) -> tuple[Floats, Floats, Floats]:
    """Return states (N, T, 6), the same before manoeuvres, and their estimated errors (N,) [m]."""
    after, before, errors = [], [], []
    for each, offset in zip(spans, offsets, strict=True):
        found, off = each.states(times - offset)
        if (worst := float(off.max())) > (allowed or 0.0):
            what = f"interpolated states may be off by {worst:.3g} m, more than {allowed or 0.0:g} m"
            raise ValueError(f"{each.name}: {what}; give states closer in time, or a larger interpolate")
        after.append(found)
        before.append(each.states(times - offset, before=True)[0] if each.manoeuvres else found)
        errors.append(worst)
    return np.stack(after), np.stack(before), np.array(errors)


def _common_span(spans: tuple[Spans, ...], offsets: Floats) -> tuple[float, float]:
    """Return the start and the end of the common time [s]."""
    pairs = list(zip(spans, offsets, strict=True))
    begins = max(float(each.times[0] + offset) for each, offset in pairs)
    return begins, min(float(each.times[-1] + offset) for each, offset in pairs)


def _comparable(ephemerides: Sequence[Ephemeris]) -> None:
    if len(ephemerides) < 2:
        raise ValueError(f"ephemerides: at least two are needed, got {len(ephemerides)}")
    chief = ephemerides[0]
    if chief.frame.upper() not in INERTIAL:
        what = f"REF_FRAME {chief.frame} rotates with the Earth or is unknown"
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
