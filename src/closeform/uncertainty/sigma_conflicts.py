"""Conflicts of k-sigma tubes: the intervals in which k sigmas reach the zone, as rows of floats."""

from math import inf, nan, sqrt

import numpy as np
from numba import float64, int64

from closeform._jit import kernel
from closeform.conflicts.pair_search import append
from closeform.conflicts.quick_rejection import count_near, interval, is_clear, mark_near
from closeform.kernel_loans import borrowed, lent, stack_vector
from closeform.motion.arc import END
from closeform.motion.certified_march import LESS_PATIENCE, PATIENCE, locate, window_end
from closeform.uncertainty.moving import (
    HALVINGS,
    STALLED,
    begin_count,
    beyond_for,
    brief,
    errors_of_point,
    first_try,
    stalled,
    stays_inside,
)
from closeform.uncertainty.planes import room
from closeform.uncertainty.sigma_levels import begin_pair, least_of_pair
from closeform.uncertainty.spread import SPREAD
from closeform.uncertainty.tube import (
    HINT,
    STALLS,
    TUBE,
    WIDTH,
    clear_for,
    column_bound,
    look,
    room_at,
    see_tube,
)
from closeform.zones.shapes import inside_step

# As in `conflicts.pair_search`, with the accuracy of covariances and planes.
TOUCH = 1e-11
ENTRY_AIM, ENTERED, LEFT, EXIT_AIM = 1 + 0.08 * TOUCH, 1 + 0.16 * TOUCH, 1 + 0.4 * TOUCH, 1 + 0.5 * TOUCH
DEEP, SHALLOW = 0.5, 0.75  # norms of a position well inside: the target, and the accepted value


@kernel()
def enter(tube, t, span, k, patience):
    """March outside until k sigmas reach the zone, or may do so: (time reached, True if so)."""
    for _ in range(patience):
        norm = look(tube, t)
        g = room_at(tube, k, ENTRY_AIM) if norm > ENTERED else norm
        if not g > ENTERED:
            return t, True
        if not t < span:
            return t, False
        h = clear_for(tube, k, g - ENTRY_AIM)
        if t == 0.0 and patience == LESS_PATIENCE:
            h = max(h, beyond_for(tube, k, ENTRY_AIM, span))
            if stalled(tube, h, span) > 0.0:
                return t, True
        t = min(span, max(t + h, t * (1.0 + 2.3e-16)))
    return t, False


@kernel()
def position_inside(tube, norm, k):
    """Return the sigmas of a position well inside the zone, or of the deepest one, and its norm."""
    if norm <= DEEP:
        return 0.0, norm
    used = 0.0
    while True:
        g = room_at(tube, used, inf)
        if g <= SHALLOW or used >= k:
            return used, g
        best, place = tube.best, tube.place
        ahead = best[0] * place[0] + best[1] * place[1] + best[2] * place[2]
        wide = sqrt(tube.along[0])
        more = (ahead - DEEP) / wide if wide > 0.0 else k
        used = min(k, max(more, 1.01 * used))


@kernel()
def within_for(tube, k, longest):
    """Return how long moving errors certainly keep a position inside, from the window's start."""
    xi, eta = stack_vector(14), stack_vector(14)
    used, _ = position_inside(tube, look(tube, 0.0), k)
    errors_of_point(tube, used, xi)
    h = first_try(tube, longest)
    for _ in range(HALVINGS):
        used, g = position_inside(tube, look(tube, h), k)
        if g < EXIT_AIM:
            errors_of_point(tube, used, eta)
            if stays_inside(tube, xi, eta, h, EXIT_AIM):
                tube.seen[HINT] = h
                return h
        h *= 0.5
    return 0.0


@kernel()
def inside_for(tube, used, span):
    """Return for how long the errors that were found last certainly keep a position inside."""
    place, best, at, bounds = tube.place, tube.best, tube.at, tube.bounds
    x, y, z, vx, vy, vz = place[0], place[1], place[2], place[3], place[4], place[5]
    if used > 0.0 and tube.along[0] > 0.0:
        share = used / sqrt(tube.along[0])
        _, x, y, z = room(place, tube.square, used, best[0], best[1], best[2])
        for j in range(0, int(tube.seen[WIDTH]), 3):
            length = best[0] * at[0, j] + best[1] * at[0, j + 1] + best[2] * at[0, j + 2]
            vx -= share * length * at[1, j]
            vy -= share * length * at[1, j + 1]
            vz -= share * length * at[1, j + 2]
    ax = bounds[0] + used * column_bound(tube, 1.0, 0.0, 0.0)
    ay = bounds[1] + used * column_bound(tube, 0.0, 1.0, 0.0)
    az = bounds[2] + used * column_bound(tube, 0.0, 0.0, 1.0)
    a = sqrt(ax * ax + ay * ay + az * az)
    speed = sqrt(vx * vx + vy * vy + vz * vz) + a * span
    return inside_step(tube.shape, tube.faces, x, y, z, vx, vy, vz, ax, ay, az, a, speed, EXIT_AIM)


@kernel()
def is_doubtful(tube, k, span):
    """Return True if k sigmas are outside but not certain to stay there for a while."""
    return not clear_for(tube, k, room_at(tube, k, inf) - ENTRY_AIM) > brief(tube, span)


@kernel()
def leave(tube, t, span, k, patience):
    """March inside with one position that is inside at each step: (time reached, True if none is).

    After too many short steps, k sigmas count as inside until they are clear for longer than such a step.
    """
    for _ in range(patience):
        used, g = position_inside(tube, look(tube, t), k)
        doubtful = tube.seen[STALLS] >= STALLED
        if g > LEFT and not (doubtful and is_doubtful(tube, k, span)):
            return t, True
        if not t < span:
            return t, False
        h = inside_for(tube, used, span - t) if not g > LEFT else 0.0
        if t == 0.0 and patience == LESS_PATIENCE:
            h = max(h, within_for(tube, k, span))
            stalled(tube, h, span)
        if doubtful:
            h = max(h, brief(tube, span))
        t = min(span, max(t + h, t * (1.0 + 2.3e-16)))
    return t, False


@kernel()
def search_window(tube, one, i, first, two, j, second, t, stop, k, inside, entry, pair, rows, count):
    """March a pair's arcs from t to `stop`; return whether inside then, since when, and the row count."""
    patience = PATIENCE
    while True:
        see_tube(tube, one, i, first, two, j, second, t, stop - t)
        local = 0.0
        while True:
            if inside:
                local, crossed = leave(tube, local, stop - t, k, patience)
            else:
                local, crossed = enter(tube, local, stop - t, k, patience)
            if not crossed:
                break
            inside = not inside
            if inside:
                entry = min(t + local, stop)
            else:
                count = append(rows, count, pair, entry, min(t + local, stop))
        if local >= stop - t:
            return inside, entry, count
        t = max(t + local, t + 2.3e-16 * abs(t))
        patience = LESS_PATIENCE


@kernel()
def sigma_conflicts_of_pair(tube, one, first, two, second, start, end, k, times, near, m, pair, rows, count):
    """Append the conflicts of one pair to `rows`; return the count, above len(rows) if they do not fit.

    `near` marks the intervals of `times` to be searched, from the m-th on; empty for all.
    """
    i_end, j_end = one.offsets[first + 1], two.offsets[second + 1]
    i = locate(one.arcs, one.offsets[first], i_end, start)
    j = locate(two.arcs, two.offsets[second], j_end, start)
    inside, entry = False, start
    begin_count(tube)
    t = start
    while True:
        while i + 1 < i_end and one.arcs[i, END] <= t:
            i += 1
        while j + 1 < j_end and two.arcs[j, END] <= t:
            j += 1
        stop = window_end(one.arcs[i], two.arcs[j], t, end)
        while m + 1 < len(near) and times[m + 1] <= t:
            m += 1
        if len(near) == 0 or not is_clear(times, near, m, stop):
            inside, entry, count = search_window(
                tube, one, i, first, two, j, second, t, stop, k, inside, entry, pair, rows, count
            )
        t = stop
        if t >= end:
            break
    return append(rows, count, pair, entry, end) if inside else count


@kernel(
    int64(
        SPREAD,
        SPREAD,
        int64[::1],
        int64[::1],
        int64,
        TUBE,
        float64,
        float64[::1],
        float64[:, :, ::1],
        float64[:, :, ::1],
        float64[:, ::1],
        int64[::1],
    )
)
def sigma_conflicts_of_pairs(one, two, first, second, pair, tube, k, times, tracks, other_tracks, rows, done):
    """Write the conflicts of pairs from `pair` on: pair, start, end, time and level of the minimum."""
    one, two, tube = lent(one), lent(two), lent(tube)
    times, tracks, other_tracks = borrowed(times), borrowed(tracks), borrowed(other_tracks)
    near = np.empty(max(0, len(times) - 1), dtype=np.bool_)
    count = 0
    for p in range(pair, len(first)):
        start, end = begin_pair(tube, one, first[p], two, second[p])
        if not start <= end:
            continue
        m = 0
        if len(near) > 0:
            m, last = interval(times, start), interval(times, end) + 1
            if count_near(tracks, first[p], other_tracks, second[p], m, last) == 0:
                continue
            mark_near(tracks, first[p], other_tracks, second[p], m, last, near)
        total = sigma_conflicts_of_pair(
            tube, one, first[p], two, second[p], start, end, k, times, near, m, p, rows, count
        )
        if total > len(rows):
            done[0], done[1] = p, total - count
            return count
        for r in range(count, total):
            begin, leaves = rows[r, 1], rows[r, 2]
            ratio, when = least_of_pair(tube, one, first[p], two, second[p], begin, leaves, k, inf, nan)
            rows[r, 3], rows[r, 4] = when, ratio
        count = total
    done[0] = len(first)
    return count
