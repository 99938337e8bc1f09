"""Sigma levels: the sigmas, or the scale of zone and sigmas, at contact, and their minimum along a pair."""

from math import inf, nan

from numba import float64, int64, void

from closeform._jit import kernel
from closeform.kernel_loans import lent
from closeform.motion.arc import END, START
from closeform.motion.certified_march import LESS_PATIENCE, PATIENCE, locate, window_end
from closeform.uncertainty.covariance_propagation import ERRORS_TYPE, NOISE
from closeform.uncertainty.sigmas.moving_planes import count_stalls, moving_plane_time, reset_stalls
from closeform.uncertainty.sigmas.tube import (
    HINT,
    MEAN_RATE,
    NEVER,
    NOISY,
    TUBE,
    evaluate_tube,
    gap_at_sigmas,
    level,
    level_of_plane,
    level_rate,
    load_tube,
    plane_time,
)

PRECISION = 1e-10  # relative accuracy of the minimum level
SLACK = 1e-13  # of the zone: rounding
LACKING = 1e-11  # difference between equivalent planes at one time
TURN_ANGLE = 0.3  # in n t: maximum step of the search for a local minimum
SAMPLE_ANGLE, SAMPLES = 0.5, 8  # in n t, between samples; or number of samples in a window in deep space


@kernel()
def descend(tube, t, span, k, s):
    """Return a local minimum reached from level s at t, where `level` was last, and its time."""
    low = level_rate(tube, k, s)
    best, best_time = s, t
    if low >= 0.0 or t >= span:
        return best, best_time
    longest = (span - t) / 16.0
    if tube.mean_motion > 0.0:
        longest = min(longest, TURN_ANGLE / tube.mean_motion)
    step = max(min(longest, -0.25 * s / low), 1e-12 * span)
    before = t
    while True:
        after = min(before + step, span)
        found = level(tube, after, k, 0.0, NEVER, True)  # it may be far below, for poor planes
        lower = found < best
        if lower:
            best, best_time = found, after
        if best <= 0.0:
            return best, best_time
        high = level_rate(tube, k, found) if found < inf else 1.0
        if high >= 0.0 or not lower:  # past a minimum, or past several
            break
        if after >= span:
            return best, best_time
        before, low = after, high
        step = min(1.5 * step, longest)
    high = high if high > 0.0 else -low
    left, right = low, high  # halved while the other end moves (Illinois method)
    for m in range(100):
        width = after - before
        if min(-low, high) * width <= 1e-12 * best or width <= 1e-15 * span:
            break
        middle = before + 0.5 * width if m % 8 == 7 else before - width * left / (right - left)
        found = level(tube, middle, k, best, NEVER, True)
        lower = found < best
        if lower:
            best, best_time = found, middle
        if best <= 0.0:
            break
        rate = level_rate(tube, k, found) if found < inf else 1.0
        if rate < 0.0 and lower:
            before, low, left, right = middle, rate, rate, 0.5 * right
        else:
            after, high = middle, rate if rate > 0.0 else -low
            left, right = 0.5 * left, high
    return best, best_time


@kernel(inline=True)
def gap_at(tube, t, k, s):
    """Return the gap at time t between the zone and k sigmas, both at level s."""
    scale = 1.0 if k < 0.0 else s
    gap = evaluate_tube(tube, t) - scale
    if gap > 0.0:
        gap = gap_at_sigmas(tube, s if k < 0.0 else k * s, scale) - scale
    return gap


@kernel(inline=True)
def least_in_window(tube, span, k, best, best_time, patience):
    """Return the minimum level of the window, if below `best`, its time, and the time reached.

    The level is 0 if the mean enters the zone.
    """
    t = 0.0
    for _ in range(patience):
        aim = min(best * (1.0 - PRECISION), NEVER)
        gap = gap_at(tube, t, k, aim) if best < inf else 0.0
        if not gap > 0.0:
            s = level(tube, t, k, aim if best < inf else 0.0, NEVER, True)
            if s < best:
                best, best_time = s, t
                if s > 0.0:
                    best, best_time = descend(tube, t, span, k, s)
                if best <= 0.0:
                    return 0.0, best_time, t
            aim = min(best * (1.0 - PRECISION), NEVER)
            gap = gap_at(tube, t, k, aim)
            if gap < -LACKING:  # a plane worse than that of the level; its own level is certified
                best, best_time = min(best, level_of_plane(tube, k)), t
                aim, gap = best * (1.0 - PRECISION), 0.0
        if not t < span:
            return best, best_time, span
        sigmas = aim if k < 0.0 else k * aim
        h = plane_time(tube, sigmas, max(gap, SLACK))
        if t == 0.0 and patience == LESS_PATIENCE:
            target = (1.0 if k < 0.0 else aim) - max(SLACK - gap, 0.0)
            h = max(h, moving_plane_time(tube, sigmas, target, span))
            many = count_stalls(tube, h, span)
            if many > 0.0:  # the planes are not accurate enough: certify a slightly lower level
                best = aim * (1.0 - min(0.5, PRECISION * 2.0**many))
        t = min(span, max(t + h, t * (1.0 + 2.3e-16)))
    return best, best_time, t


@kernel(inline=True)
def sample_window(tube, span, k, best, best_time):
    """Return the lowest approximate level at given times of the window, if below `best`, and its time."""
    n = max(tube.mean_motion, tube.state[MEAN_RATE])
    count = int(n * span / SAMPLE_ANGLE) + 1 if n > 0.0 else SAMPLES
    for m in range(count + 1):
        s = level(tube, span * m / count, k, 0.0, best, False)
        if s < best:
            best, best_time = s, span * m / count
    return best, best_time


@kernel()
def sampled_level(tube, one, first, two, second, start, end, k):
    """Return a level of the pair and its time, usually the lowest, which saves work in the march."""
    best, begin, t = NEVER, nan, start
    while t < end and best > 0.0:
        stop = load_at(tube, one, first, two, second, t, end)
        best, when = sample_window(tube, stop - t, k, best, nan)
        if when == when:
            n = max(tube.mean_motion, tube.state[MEAN_RATE])
            step = SAMPLE_ANGLE / n if n > 0.0 else (stop - t) / SAMPLES
            begin = max(start, t + when - step)
        t = stop
    if begin != begin:
        return inf, nan
    stop = load_at(tube, one, first, two, second, begin, end)
    best, when = level(tube, 0.0, k, 0.0, NEVER, True), 0.0
    if 0.0 < best < inf:
        best, when = descend(tube, when, stop - begin, k, best)
    return best, min(begin + when, stop)


@kernel()
def load_at(tube, one, first, two, second, t, end):
    """Load the arcs of a pair from time t on, until `end` at most; return the time until which they hold."""
    i = locate(one.arcs, one.offsets[first], one.offsets[first + 1], t)
    j = locate(two.arcs, two.offsets[second], two.offsets[second + 1], t)
    stop = window_end(one.arcs[i], two.arcs[j], t, end)
    load_tube(tube, one, i, first, two, j, second, t, stop - t)
    return stop


@kernel()
def least_of_pair(tube, one, first, two, second, start, end, k, best, best_time):
    """Return the minimum level over [start, end] and its time; nan if no error results in a conflict.

    The search starts from a known level and its time, or from inf and nan.
    """
    reset_stalls(tube)
    t, patience = start, PATIENCE
    while True:
        stop = load_at(tube, one, first, two, second, t, end)
        least, when, reached = least_in_window(tube, stop - t, k, best, nan, patience)
        if least < best:
            best, best_time = least, min(t + when, stop) if when == when else best_time
        patience = LESS_PATIENCE if reached < stop - t else PATIENCE
        t = max(t + reached, t + 2.3e-16 * abs(t)) if reached < stop - t else stop
        if t >= end or best <= 0.0:
            return best, best_time


@kernel()
def begin_pair(tube, one, first, two, second):
    """Reset the tube for a pair and return the start and end of its common time."""
    tube.state[HINT] = inf
    tube.state[NOISY] = one.execution[first, NOISE] + two.execution[second, NOISE]
    start = max(one.arcs[one.offsets[first], START], two.arcs[two.offsets[second], START])
    return start, min(one.arcs[one.offsets[first + 1] - 1, END], two.arcs[two.offsets[second + 1] - 1, END])


@kernel(void(ERRORS_TYPE, ERRORS_TYPE, int64[::1], int64[::1], TUBE, float64, float64[:, ::1]))
def least_of_pairs(one, two, first, second, tube, k, out):
    """Write time and minimum level of pairs over their common times, by sigmas (k < 0) or by scale."""
    one, two, tube = lent(one), lent(two), lent(tube)
    for p in range(len(first)):
        start, end = begin_pair(tube, one, first[p], two, second[p])
        out[p, 0], out[p, 1] = nan, inf
        if start <= end:
            pair = tube, one, first[p], two, second[p], start, end, k
            out[p, 1], out[p, 0] = least_of_pair(*pair, *sampled_level(*pair))
