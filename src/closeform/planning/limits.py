"""What engines and tanks allow: shortest transfers and longer plans under a thrust limit, propellant."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite, nan, sqrt
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, instance, numbers
from closeform.fuel.falling_mass import STANDARD_GRAVITY
from closeform.motion.duration import SHORTEST
from closeform.motion.mean_motion import checked
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path

REACH = 10.0  # orbits: no longer transfer is looked for
FAR = 100.0  # times the duration, which is what is looked for in deep space
SHARE, ANGLE = 0.02, 0.05  # steps of the scan: of the duration itself, and in n T
CHUNK = 128
FINE = 1e-13  # of the duration
LEAST_STEP, LARGEST_STEP = 1.02, 2.0  # by which durations are stretched at a time to respect a thrust limit
STRETCHINGS = 16  # times at most
HALVINGS = 5  # and how often the last stretch is halved
FULL = 1 + 1e-9  # of a limit

Planned = TypeVar("Planned")
Peak = Callable[[Floats], Floats]


def shortest_transfer(
    orbit: Orbit,
    initial: ArrayLike,
    final: ArrayLike,
    max_acceleration: ArrayLike,
    start: ArrayLike = 0.0,
) -> Path:
    """The shortest energy-optimal path between two states within a thrust limit.

    Parameters
    ----------
    orbit : Orbit
        In whose rotating frame the states are.
    initial : array_like of shape (..., 6) [m, m/s]
        In the rotating frame.
    final : array_like of shape (..., 6) [m, m/s]
        In the rotating frame, the same for every duration.
    max_acceleration : array_like of shape (...) [m/s^2]
        Of the thrust.
    start : array_like of shape (...) [s], default 0
        Of the path; all arguments broadcast.

    Returns
    -------
    Path
        Of the broadcast shape; the duration of each craft is the least T for which `orbit.transfer` has a
        peak thrust of at most the limit.

    Raises
    ------
    ValueError
        If the two states of a craft are the same, which needs no time at all, no duration of up to 10 orbits
        keeps the limit (in deep space there always is one), shapes do not fit, a number is not finite, or a
        limit is not positive.

    Notes
    -----
    From rest to rest over a distance L in deep space T is sqrt(6 L / max_acceleration).  In an orbit the
    peak does not fall steadily with T: longer transfers may exceed the limit again.

    What is certain: the path keeps the limit to 1e-9, and durations before the scan's first are
    excluded by a bound.  The scan goes up in steps of 2 % of T, at most 0.05 of n T, and looks
    into every dip between its samples; the peak varies over T and 1/n, many times as long.

    References
    ----------
    Palmer, J. Guidance, Control, and Dynamics 30(5), 1542-1546, 2007, asks which states a limited thrust
    can reach; docs/theory.md section 2.
    """
    instance("orbit", orbit, Orbit).transfer(initial, final, 1.0, start)  # raises for what no transfer takes
    begins, ends = numbers("initial", initial), numbers("final", final)
    limits = np.asarray(checked("max_acceleration", max_acceleration, positive=True))
    shape = broadcast(initial=begins.shape[:-1], final=ends.shape[:-1], max_acceleration=limits.shape)
    begins, ends = (np.broadcast_to(states, (*shape, 6)).reshape(-1, 6) for states in (begins, ends))
    limits = np.broadcast_to(limits, shape).ravel()
    durations = np.empty(len(limits))
    for k, (begin, end, limit) in enumerate(zip(begins, ends, limits, strict=True)):
        craft = f"craft {', '.join(map(str, np.unravel_index(k, shape)))}: " if shape else ""
        if (begin == end).all():
            raise ValueError(f"final: {craft}the same state as initial, which takes no time; leave it out")
        durations[k] = _shortest(orbit, begin, end, float(limit), craft)
    return orbit.transfer(initial, final, durations.reshape(shape), start)


def propellant(mass: ArrayLike, delta_v: ArrayLike, specific_impulse: ArrayLike) -> Any:
    """Propellant that a craft burns for a velocity change, by Tsiolkovsky's equation.

    Parameters
    ----------
    mass : array_like of shape (...) [kg]
        Before the burns, propellant included.
    delta_v : array_like of shape (...) [m/s]
        At least 0.
    specific_impulse : array_like of shape (...) [s]
        Times 9.80665 m/s^2 the exhaust speed; all arguments broadcast.

    Returns
    -------
    float or array of shape (...) [kg]
        mass (1 - exp(-delta_v / exhaust speed)).

    Raises
    ------
    ValueError
        If a mass or a specific impulse is not positive, a delta-v is negative, or a number is not finite.

    References
    ----------
    Tsiolkovsky's equation; standard gravity of the CGPM, 1901.
    """
    wet = checked("mass", mass, positive=True)
    exhaust = STANDARD_GRAVITY * checked("specific_impulse", specific_impulse, positive=True)
    spent = checked("delta_v", delta_v)
    if np.any(np.less(spent, 0.0)):
        raise ValueError(f"delta_v: must be at least 0, got {np.min(spent):g} m/s")
    return -wet * np.expm1(-spent / exhaust)


def longest(orbit: Orbit, duration: float) -> float:
    """The longest duration [s] that is tried for a thrust limit where a `duration` [s] was asked for.

    Ten orbits, or twice the duration; in deep space a hundred times, where thrust falls to a ten-thousandth.
    """
    if not orbit.mean_motion:
        return FAR * duration
    return max(REACH * orbit.period, LARGEST_STEP * duration)


class Stretched(NamedTuple, Generic[Planned]):
    """What was found at a `factor` of all durations, or None; `excess` (N,): thrust over its limit."""

    factor: float
    found: Planned | None
    excess: Floats

    @property
    def measure(self) -> str:
        """What was tried, and what came of it."""
        if self.found is None:
            return f"longer, up to {self.factor:.4g} times the duration: the thrust limit is not kept"
        return f"longer, {self.factor:.6g} times the duration: the thrust limit is kept"


def stretched(
    excess: Floats,
    free: Callable[[float], Floats],
    attempt: Callable[[float], tuple[Planned, Floats] | None],
    most: float,
) -> Stretched[Planned]:
    """The shortest stretch of all durations that was found to keep thrust limits, of `most` at most.

    `excess` (N,) is peak thrust over its limit of what was planned without one, `free` (N,) that of
    the direct paths at a factor, and `attempt` plans at a factor: None where it finds no clear plan.
    """
    short = long = weak = 1.0
    found = None
    for _ in range(STRETCHINGS):
        if long >= most:
            break
        short = long
        step = np.clip(np.sqrt(excess.max()), LEAST_STEP, LARGEST_STEP)  # thrust: as 1 / time^2
        long = min(long * float(step), most)
        peaks = free(long)
        if peaks.max() <= FULL:
            planned = attempt(long)
            if planned is None:
                continue
            found, peaks = planned
            if peaks.max() <= FULL:
                break
            found = None
        weak, excess = long, peaks
    if found is None:
        return Stretched(weak, None, excess)
    for _ in range(HALVINGS):
        middle = 0.5 * (short + long)
        planned = attempt(middle)
        if planned is not None and planned[1].max() <= FULL:
            found, long = planned[0], middle
        else:
            short = middle
    return Stretched(long, found, excess)


def _shortest(orbit: Orbit, begin: Floats, end: Floats, limit: float, craft: str) -> float:
    def peak(times: Floats) -> Floats:
        return np.asarray(orbit.transfer(begin, end, times).peak_thrust)

    reach = REACH * orbit.period if orbit.mean_motion else surely_enough(begin, end, limit)
    soonest = surely_too_short(orbit.mean_motion, begin, end, limit, reach)
    if soonest < SHORTEST:
        raise ValueError(
            f"max_acceleration: {craft}{limit:g} m/s^2 may take less than {SHORTEST:g} s; give less of it"
        )
    times = _scan(orbit.mean_motion, soonest, reach)
    least, least_time = inf, nan
    for first in range(0, len(times) - 2, CHUNK):
        chunk = times[first : first + CHUNK + 2]  # two more, so that every sample is once in a middle
        values = peak(chunk)
        for k in range(1, len(chunk)):
            dips = k < len(chunk) - 1 and values[k] <= min(values[k - 1], values[k + 1])
            if dips or values[k] <= limit:
                found = _first(peak, chunk[k - 1], chunk[k + dips], limit)
                if isfinite(found):
                    return found
        if values.min() < least:
            least, least_time = float(values.min()), float(chunk[values.argmin()])
    raise ValueError(
        f"max_acceleration: {craft}{limit:g} m/s^2 is too little for any transfer of up to {reach:.6g} s "
        f"({REACH:g} orbits); about {least:.3g} m/s^2 is enough in {least_time:.6g} s"
    )


def surely_enough(begin: Floats, end: Floats, limit: float) -> float:
    """A duration that keeps the limit in deep space, where |u| <= 6 |L| / T^2 + |p| / T.

    Thrust is linear in time and so greatest at one end: 6 L / T^2 - p / T with L the distance
    and p = 4 v0 + 2 v1, or its opposite with p = 2 v0 + 4 v1.
    """
    distance = float(np.linalg.norm(end[:3] - begin[:3]))
    swing = max(
        float(np.linalg.norm(4.0 * begin[3:] + 2.0 * end[3:])),
        float(np.linalg.norm(2.0 * begin[3:] + 4.0 * end[3:])),
    )
    return 1.001 * (swing + sqrt(swing * swing + 24.0 * limit * distance)) / (2.0 * limit)


def surely_too_short(n: float, begin: Floats, end: Floats, limit: float, reach: float) -> float:
    """A duration up to which no thrust within the limit makes the transfer, optimal or not.

    With a greatest speed V and offset R = R0 + V T across the track, |v'| <= 3 n^2 R + 2 n V + limit,
    so V (1 - 2 n T - 3 n^2 T^2) <= V0 + 3 n^2 T R0 + limit T; both changes must be within that.
    """
    distance, change = np.linalg.norm(end[:3] - begin[:3]), np.linalg.norm(end[3:] - begin[3:])
    offset, speed = np.hypot(begin[0], begin[2]), np.linalg.norm(begin[3:])
    time = min(reach, 0.2 / n) if n else reach
    while True:
        time *= 0.5
        angle = n * time
        fastest = (speed + 3.0 * n * angle * offset + limit * time) / (1.0 - 2.0 * angle - 3.0 * angle**2)
        gained = time * (3.0 * n * n * (offset + fastest * time) + 2.0 * n * fastest + limit)
        if fastest * time < distance or gained < change:
            return time


def _scan(n: float, first: float, last: float) -> Floats:
    """Times from `first` to `last` in steps of 2 % of the time, at most 0.05 / n."""
    knee = min(last, max(first, ANGLE / SHARE / n)) if n else last
    times = np.geomspace(first, knee, int(np.log(knee / first) / SHARE) + 3)
    if knee < last:
        times = np.append(times, np.linspace(knee, last, int((last - knee) * n / ANGLE) + 2)[1:])
    return times


def _first(peak: Peak, low: float, high: float, limit: float) -> float:
    """First time after `low` at which the peak keeps the limit: a crossing, or in a dip; nan if none."""
    found = nan
    while high - low > FINE * high:
        times = np.linspace(low, high, 33)
        values = peak(times)
        kept = np.flatnonzero(values <= limit)
        if kept.size:
            k = max(int(kept[0]), 1)
            low, high = float(times[k - 1]), float(times[k])
            found = high
        else:
            k = min(max(int(values.argmin()), 1), len(times) - 2)
            low, high = float(times[k - 1]), float(times[k + 1])
            rise = max(values[k - 1], values[k + 1]) - values[k]
            if values[k] - 2.0 * rise > limit:  # between samples a dip falls no deeper than it rises beside
                break
    return found
