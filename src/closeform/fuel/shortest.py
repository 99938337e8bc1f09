"""Shortest energy-optimal transfers within a thrust limit."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite, nan, sqrt

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, numbers
from closeform.motion.duration import SHORTEST
from closeform.motion.elements.mean_motion import checked
from closeform.motion.orbit import Orbit, circular_orbit
from closeform.motion.path import Path

REACH = 10.0  # orbits: longer transfers are not searched
SHARE, ANGLE = 0.02, 0.05  # steps of the scan: share of the duration, and in n T
CHUNK = 128
FINE = 1e-13  # of the duration

Peak = Callable[[Floats], Floats]


def shortest_transfer(
    orbit: Orbit,
    initial: ArrayLike,
    final: ArrayLike,
    max_acceleration: ArrayLike,
    start: ArrayLike = 0.0,
) -> Path:
    """Return the shortest energy-optimal path between two states within a thrust limit.

    Parameters
    ----------
    orbit : Orbit
        Orbit that defines the rotating frame.
    initial : array_like of shape (..., 6) [m, m/s]
        State at the start, in the rotating frame.
    final : array_like of shape (..., 6) [m, m/s]
        State at the end, in the rotating frame, the same for every duration.
    max_acceleration : array_like of shape (...) [m/s^2]
        Limit of the thrust.
    start : array_like of shape (...) [s], default 0
        Start time of the path; all arguments broadcast.

    Returns
    -------
    Path
        Path of the broadcast shape; the duration of each spacecraft is the smallest T for which
        `orbit.transfer` has a peak thrust of at most the limit.

    Raises
    ------
    ValueError
        If the two states of a spacecraft are equal, which requires no time; no duration of up to 10 orbits
        respects the limit (in deep space there always is one); shapes do not fit, a number is not finite, or
        a limit is not positive.

    Notes
    -----
    From rest to rest over a distance L in deep space T is sqrt(6 L / max_acceleration).  In an orbit the
    peak does not fall steadily with T: longer transfers may exceed the limit again.

    Certified: the path respects the limit to 1e-9, and durations before the start of the scan are
    excluded by a bound.  The scan increases T in steps of 2 %, at most 0.05 of n T, and searches
    every dip between its samples; the peak varies on the scales of T and 1/n, many times longer.

    References
    ----------
    Palmer, J. Guidance, Control, and Dynamics 30(5), 1542-1546, 2007, asks which states a limited thrust
    can reach; docs/theory.md section 2.
    """
    circular_orbit("orbit", orbit).transfer(initial, final, 1.0, start)  # raises for invalid arguments
    begins, ends = numbers("initial", initial), numbers("final", final)
    limits = np.asarray(checked("max_acceleration", max_acceleration, positive=True))
    shape = broadcast(initial=begins.shape[:-1], final=ends.shape[:-1], max_acceleration=limits.shape)
    begins, ends = (np.broadcast_to(states, (*shape, 6)).reshape(-1, 6) for states in (begins, ends))
    limits = np.broadcast_to(limits, shape).ravel()
    durations = np.empty(len(limits))
    for k, (begin, end, limit) in enumerate(zip(begins, ends, limits, strict=True)):
        craft = f"craft {', '.join(map(str, np.unravel_index(k, shape)))}: " if shape else ""
        if (begin == end).all():
            raise ValueError(f"final: {craft}equals initial, which requires no transfer; leave it out")
        durations[k] = _shortest(orbit, begin, end, float(limit), craft)
    return orbit.transfer(initial, final, durations.reshape(shape), start)


def _shortest(orbit: Orbit, begin: Floats, end: Floats, limit: float, craft: str) -> float:
    def peak(times: Floats) -> Floats:
        return np.asarray(orbit.transfer(begin, end, times).peak_thrust)

    reach = REACH * orbit.period if orbit.mean_motion else surely_enough(begin, end, limit)
    soonest = surely_too_short(orbit.mean_motion, begin, end, limit, reach)
    if soonest < SHORTEST:
        raise ValueError(
            f"max_acceleration: {craft}{limit:g} m/s^2 allows a duration below {SHORTEST:g} s; reduce it"
        )
    times = _scan(orbit.mean_motion, soonest, reach)
    least, least_time = inf, nan
    for first in range(0, len(times) - 2, CHUNK):
        chunk = times[first : first + CHUNK + 2]  # overlap by two: every sample is inside once
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
        f"max_acceleration: {craft}{limit:g} m/s^2 is too low for any transfer of up to {reach:.6g} s "
        f"({REACH:g} orbits); about {least:.3g} m/s^2 is enough in {least_time:.6g} s"
    )


def surely_enough(begin: Floats, end: Floats, limit: float) -> float:
    """Return a duration that respects the limit in deep space, where |u| <= 6 |L| / T^2 + |p| / T.

    Thrust is linear in time and so largest at one end: 6 L / T^2 - p / T with L the distance and p = 4 v0 +
    2 v1, or its opposite with p = 2 v0 + 4 v1.
    """
    distance = float(np.linalg.norm(end[:3] - begin[:3]))
    swing = max(
        float(np.linalg.norm(4.0 * begin[3:] + 2.0 * end[3:])),
        float(np.linalg.norm(2.0 * begin[3:] + 4.0 * end[3:])),
    )
    return 1.001 * (swing + sqrt(swing * swing + 24.0 * limit * distance)) / (2.0 * limit)


def surely_too_short(n: float, begin: Floats, end: Floats, limit: float, reach: float) -> float:
    """Return a duration up to which no thrust within the limit achieves the transfer, optimal or not.

    With a largest speed V and cross-track offset R = R0 + V T, |v'| <= 3 n^2 R + 2 n V + limit, so V (1 - 2
    n T - 3 n^2 T^2) <= V0 + 3 n^2 T R0 + limit T; both changes must be within that.
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
    """Return times from `first` to `last` in steps of 2 % of the time, at most 0.05 / n."""
    knee = min(last, max(first, ANGLE / SHARE / n)) if n else last
    times = np.geomspace(first, knee, int(np.log(knee / first) / SHARE) + 3)
    if knee < last:
        times = np.append(times, np.linspace(knee, last, int((last - knee) * n / ANGLE) + 2)[1:])
    return times


def _first(peak: Peak, low: float, high: float, limit: float) -> float:
    """Return the first time after `low` at which the peak respects the limit, even in a dip; or nan."""
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
            if values[k] - 2.0 * rise > limit:  # between samples a dip is at most as deep as its rise
                break
    return found
