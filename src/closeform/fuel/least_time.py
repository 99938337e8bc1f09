"""Minimum time under a thrust limit: shorter durations are excluded by proofs that each cover an interval.

A primer p with g.c > U integral of |p| proves that no thrust within U makes a transfer in T.  Extended
as a natural motion, it proves the same for all durations up to the root of

    m(T) = g(T).c - U integral of |p| over [0, T]                                        # theory (34)

as m'' is bounded.  There a new best primer is computed, until there is none.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Literal

import numpy as np
from numba import float64, void
from numpy.typing import ArrayLike

from closeform._jit import kernel
from closeform.arrays import Floats, broadcast, numbers, shown
from closeform.fuel.shortest import REACH, shortest_transfer, surely_too_short
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import END, MEAN_MOTION, START, STATE, WIDTH, acceleration
from closeform.motion.costates import FREE, sum_up
from closeform.motion.duration import SHORTEST
from closeform.motion.elements.mean_motion import checked
from closeform.motion.hill import coast, costate
from closeform.motion.linear import dot
from closeform.motion.minimum_delta_v.ascent import IMPOSSIBLE, climb, downhill, least_limit
from closeform.motion.minimum_delta_v.saturated import worth
from closeform.motion.orbit import Orbit, circular_orbit
from closeform.motion.path import Path, path_of

SETTLED = 1e-10  # of the duration: shorter steps end the search
BETTER = 0.05  # share of a primer's margin to which the best one is computed
WINDOW = 0.2  # in n T, over which m'' is bounded at once
LATER = (1e-8, 1e-7, 1e-6, 1e-5)  # relative excess over the minimum time that arcs of saturated thrust need


@kernel()
def length(x, y, z):
    return sqrt(x * x + y * y + z * z)


@kernel()
def proved_step(n, t, c, final, limit, margin):
    """Return the length of the interval after t, where m is `margin`, without any possible transfer.

    m'' is bounded by bounds on natural motion over a window.
    """
    x, y, z, vx, vy, vz = coast(n, t, c[0], c[1], c[2], c[3], c[4], c[5])
    ax, ay, az = acceleration(n, x, z, vx, vy)
    lx, ly, lz = costate(n, vx, vy, vz, ax, ay, az)  # the rate of the position's costate
    slope = lx * final[0] + ly * final[1] + lz * final[2] + vx * final[3] + vy * final[4] + vz * final[5]
    slope -= limit * length(x, y, z)
    window = WINDOW / n if n > 0.0 else inf
    fastest, second, third = length(vx, vy, vz), 0.0, 0.0
    if n > 0.0:
        nn, size = n * n, length(x, y, z)
        fastest = (fastest + 3.0 * nn * window * size) / (1.0 - 2.0 * WINDOW - 3.0 * WINDOW * WINDOW)
        second = 3.0 * nn * (size + fastest * window) + 2.0 * n * fastest
        third = 3.0 * nn * fastest + 2.0 * n * second
    bend = (2.0 * n * second + third) * length(final[0], final[1], final[2])
    bend += second * length(final[3], final[4], final[5]) + limit * fastest
    root = sqrt(slope * slope + 2.0 * bend * margin)
    return min(2.0 * margin / (root - slope), window)  # of margin + slope h - bend h^2 / 2


@kernel()
def exclude(n, arc, final, limit, c, g, reach, gained, hessian):
    """Extend the proof of `c` from the end of `arc`, which moves to the end of the proof.

    Returns the length of the extension.
    """
    begin = arc[END]
    for _ in range(200):
        t = arc[END]
        margin = dot(g, c) - limit * sum_up(n, t, c, 0.0, 1.0, limit, gained, hessian)[1]
        if not margin > 0.0:
            break
        arc[END] = min(t + proved_step(n, t, c, final, limit, margin), reach)
        worth(n, arc, final, g)
        if arc[END] - t <= SETTLED * t or arc[END] == reach:
            break
    return arc[END] - begin


@kernel(void(float64, float64[:, ::1], float64[:, ::1], float64[::1], float64, float64[::1]))
def prove_times(n, arcs, finals, limits, reach, enough):
    """Move the ends of `arcs` (P, 30) to durations before which no thrust within `limits` suffices.

    `enough` (P,) is 0 or, if the proof extends beyond `reach`, a limit that suffices in that time.
    """
    g, c, scale, nothing = stack_vector(6), stack_vector(6), stack_vector(6), stack_vector(6)
    gained, hessian, work = stack_vector(6), stack_matrix(6, 6), stack_matrix(6, 6)
    for p in range(len(arcs)):
        arc, limit = arcs[p], limits[p]
        enough[p] = 0.0
        for k in range(6):
            c[k], nothing[k] = 1.0, 0.0
        for _ in range(100):
            duration = arc[END]
            worth(n, arc, finals[p], g)
            sum_up(n, duration, c, 0.0, 1.0, FREE, gained, hessian)
            for k in range(6):
                scale[k] = hessian[k, k]
            downhill(g, nothing, hessian, scale, work, c)
            status, _, _, size = climb(n, duration, g, scale, c, 0.0, 1.0, limit, gained, hessian)
            if status != IMPOSSIBLE:
                break
            least = dot(g, c) / size
            close = max(BETTER * (least / limit - 1.0), SETTLED) if duration < reach else 1e-6
            _, most = least_limit(n, duration, g, scale, c, least, min(close, 0.5))
            if duration >= reach:
                enough[p] = most
                break
            if exclude(n, arc, finals[p], limit, c, g, reach, gained, hessian) <= SETTLED * duration:
                break


def least_time(
    orbit: Orbit,
    initial: ArrayLike,
    final: ArrayLike,
    max_acceleration: ArrayLike,
    profile: Literal["least time", "energy"] = "least time",
    start: ArrayLike = 0.0,
) -> Path:
    """Return the path of minimum duration between two states within a thrust limit.

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
    profile : {"least time", "energy"}, default "least time"
        Form of the thrust: at the limit in any direction, or as in an energy-optimal path without a limit
        (`shortest_transfer`).
    start : array_like of shape (...) [s], default 0
        Start time of the path; all arguments broadcast.

    Returns
    -------
    Path
        Path of the broadcast shape.  No thrust within the limit achieves the transfer in a duration that is
        shorter by more than a relative 1e-5; nearly always by more than 1e-8.

    Raises
    ------
    ValueError
        If the two states of a spacecraft are equal, which requires no time; no duration of up to 10
        orbits suffices (the message gives a sufficient limit); shapes do not fit, a number is not
        finite, a limit is not positive, or `profile` is neither of the two.

    Notes
    -----
    From rest to rest over a distance L in deep space the duration is 2 sqrt(L / max_acceleration).  A longer
    duration may be infeasible again, where a spacecraft has to return to a state that it would pass.

    References
    ----------
    docs/theory.md (33) and docs/theory.md (34).
    """
    if not isinstance(profile, str) or profile not in ("least time", "energy"):
        raise ValueError(f'profile: expected "least time" or "energy", got {shown(profile)}')
    if profile == "energy":
        return shortest_transfer(orbit, initial, final, max_acceleration, start)
    circular_orbit("orbit", orbit).transfer(initial, final, 1.0, start)  # raises for invalid arguments
    limits = np.asarray(checked("max_acceleration", max_acceleration, positive=True))
    given = numbers("initial", initial), numbers("final", final), numbers("start", start)
    shape = broadcast(
        initial=given[0].shape[:-1],
        final=given[1].shape[:-1],
        max_acceleration=limits.shape,
        start=given[2].shape,
    )
    begins, ends = (np.broadcast_to(states, (*shape, 6)).reshape(-1, 6) for states in given[:2])
    starts, limits = (np.broadcast_to(values, shape).ravel() for values in (given[2], limits))
    durations = _proved(orbit, begins, ends.copy(), limits.copy(), shape)
    paths = [_soon_after(orbit, *task) for task in zip(begins, ends, durations, starts, limits, strict=True)]
    counts = np.array([len(path.arcs) for path in paths], dtype=np.int64)
    rows = np.concatenate([np.empty((0, WIDTH)), *(path.arcs for path in paths)])
    return path_of(orbit, rows, np.concatenate([[0], np.cumsum(counts)]).astype(np.int64), shape)


def _proved(orbit: Orbit, begins: Floats, ends: Floats, limits: Floats, shape: tuple[int, ...]) -> Floats:
    """Return durations (P,) before which no thrust within the limits suffices."""
    n = orbit.mean_motion
    reach = REACH * orbit.period if n else 1e60
    arcs, enough = np.zeros((len(limits), WIDTH)), np.zeros(len(limits))
    arcs[:, MEAN_MOTION], arcs[:, STATE : STATE + 6] = n, begins
    names = [
        f"craft {', '.join(map(str, np.unravel_index(k, shape)))}: " * bool(shape) for k in range(len(limits))
    ]
    for k, (begin, end, limit) in enumerate(zip(begins, ends, limits, strict=True)):
        if (begin == end).all():
            raise ValueError(f"final: {names[k]}equals initial, which requires no transfer; leave it out")
        arcs[k, END] = surely_too_short(n, begin, end, float(limit), reach)
        if arcs[k, END] < SHORTEST:
            raise ValueError(
                f"max_acceleration: {names[k]}{limit:g} m/s^2 allows a duration below {SHORTEST:g} s; "
                "reduce it"
            )
    prove_times(n, arcs, ends, limits, reach, enough)
    for k in map(int, np.flatnonzero(enough)):
        raise ValueError(
            f"max_acceleration: {names[k]}no thrust within {limits[k]:g} m/s^2 achieves the transfer in up "
            f"to {reach:.6g} s ({REACH:g} orbits); {enough[k]:.4g} m/s^2 is enough"
        )
    return np.asarray(arcs[:, END] - arcs[:, START])


def _soon_after(
    orbit: Orbit, begin: Floats, end: Floats, duration: float, start: float, limit: float
) -> Path:
    """Return a path within the limit that is little longer than a proven minimum duration."""
    for more in LATER[:-1]:
        try:
            return orbit.transfer(begin, end, duration * (1.0 + more), start, limit)
        except ValueError:
            continue
    return orbit.transfer(begin, end, duration * (1.0 + LATER[-1]), start, limit)
