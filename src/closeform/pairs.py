"""The march over pairs of paths: their conflicts and closest approaches, as rows of floats."""

from math import inf, nan, sqrt

import numpy as np
from numba import bool_, float64, int64, void

from closeform.arc import END, START
from closeform.compiled import kernel
from closeform.extrema import lowest
from closeform.march import (
    LESS_PATIENCE,
    PATIENCE,
    along,
    bounds,
    inside_step,
    locate,
    norm,
    outside_step,
    taylor_step,
    window,
)

# A norm within 1e-12 of 1 is on the surface.  Outside ends at ENTERED, inside only at LEFT, so
# that rounding cannot make the two searches chase each other; each aims a little further.
TOUCH = 1e-12
ENTRY_AIM, ENTERED, LEFT, EXIT_AIM = 1 + 0.08 * TOUCH, 1 + 0.16 * TOUCH, 1 + 0.4 * TOUCH, 1 + 0.5 * TOUCH
COLUMNS = 5  # of a row of conflicts: pair, start, end, time, ratio


@kernel()
def cross(box, q, order, n, t, stop, inside, patience):
    """March through a window until the norm changes sides: (time reached, whether it did)."""
    ax, ay, az, a, speed = bounds(q, order, n, stop)
    if not box and patience == LESS_PATIENCE and t == 0.0:
        t = taylor_step(q, order, n, stop, EXIT_AIM if inside else ENTRY_AIM, inside)
    for _ in range(patience):
        x, y, z, vx, vy, vz = along(q, order, n, t)
        s = norm(box, x, y, z)
        if (inside and s > LEFT) or (not inside and s <= ENTERED):
            return t, True
        if t >= stop:
            return stop, False
        if inside:
            h = inside_step(box, x, y, z, vx, vy, vz, ax, ay, az, a, speed, EXIT_AIM)
        else:
            h = outside_step(box, x, y, z, vx, vy, vz, ax, ay, az, a, ENTRY_AIM)
        t = min(stop, max(t + h, t * (1.0 + 2.3e-16)))
    return t, False


@kernel()
def closest(arcs, i, i_end, others, j, j_end, start, end, box, matrix, q):
    """Least norm over [start, end] and its time, between one path's arcs and another's."""
    best, best_time = inf, nan
    i = locate(arcs, i, i_end, start)
    j = locate(others, j, j_end, start)
    t = start
    patience = PATIENCE
    while True:
        while i + 1 < i_end and arcs[i, END] <= t:
            i += 1
        while j + 1 < j_end and others[j, END] <= t:
            j += 1
        order, n, stop = window(arcs, i, others, j, t, end, matrix, q)
        least, when, reached = lowest(box, q, order, n, 0.0, stop - t, patience, best, nan)
        if least < best:
            best, best_time = least, t + when
        if reached < stop - t:
            patience = LESS_PATIENCE
            t += reached
        else:
            t = stop
        if t >= end or best == 0.0:
            return best, best_time


@kernel()
def stays_apart(q, n, h):
    """Whether natural motion keeps two craft apart along some axis of the zone over [0, h].

    Along an axis it is centre + drift t + an oscillation: SP11's radial test and its last time
    of contact (SP11 eq. 15, theory 6) for any zone, and the first time of contact too.
    """
    square = 1.0 / (n * n)
    for axis in range(3):
        first = q[0, axis] + q[2, axis] * square
        last = first + (q[1, axis] + q[3, axis] * square) * h
        clear = 1.0 + 1e-9 + sqrt(q[2, axis] ** 2 + q[3, axis] ** 2 * square) * square * (1.0 + 1e-12)
        if (first > clear and last > clear) or (first < -clear and last < -clear):
            return True
    return False


@kernel()
def pair_conflicts(arcs, i, i_end, others, j, j_end, box, matrix, q, pair, rows, count):
    """Append the conflicts of one pair to `rows`; the new count, beyond len(rows) if they do not fit."""
    start = max(arcs[i, START], others[j, START])
    end = min(arcs[i_end - 1, END], others[j_end - 1, END])
    if not start <= end:
        return count
    i = locate(arcs, i, i_end, start)
    j = locate(others, j, j_end, start)
    inside = False
    entry = start
    patience = PATIENCE
    t = start
    while True:
        while i + 1 < i_end and arcs[i, END] <= t:
            i += 1
        while j + 1 < j_end and others[j, END] <= t:
            j += 1
        order, n, stop = window(arcs, i, others, j, t, end, matrix, q)
        if order == 4 and n > 0.0 and not inside and stop == end and stays_apart(q, n, stop - t):
            return count
        local = 0.0
        while True:
            local, crossed = cross(box, q, order, n, local, stop - t, inside, patience)
            if not crossed:
                break
            inside = not inside
            if inside:
                entry = t + local
            else:
                if count < len(rows):
                    rows[count, 0], rows[count, 1], rows[count, 2] = pair, entry, t + local
                count += 1
        if local < stop - t:
            patience = LESS_PATIENCE
            t += local
        else:
            t = stop
        if t >= end:
            break
    if inside:
        if count < len(rows):
            rows[count, 0], rows[count, 1], rows[count, 2] = pair, entry, end
        count += 1
    return count


@kernel(
    int64(
        float64[:, ::1],
        int64[::1],
        float64[:, ::1],
        int64[::1],
        int64[::1],
        int64[::1],
        int64,
        bool_,
        float64[:, ::1],
        float64[:, ::1],
        int64[::1],
    )
)
def conflicts_of_pairs(arcs, offsets, others, other_offsets, first, second, pair, box, matrix, rows, done):
    """Conflicts of pairs (first[k], second[k]) from k = `pair` on, as many as fit in `rows`.

    Returns how many rows were filled; `done` gets the pair to go on with.
    """
    q = np.empty((8, 3))
    count = 0
    while pair < len(first):
        i, i_end = offsets[first[pair]], offsets[first[pair] + 1]
        j, j_end = other_offsets[second[pair]], other_offsets[second[pair] + 1]
        total = pair_conflicts(arcs, i, i_end, others, j, j_end, box, matrix, q, pair, rows, count)
        if total > len(rows):
            done[1] = total - count
            break
        for k in range(count, total):
            ratio, when = closest(arcs, i, i_end, others, j, j_end, rows[k, 1], rows[k, 2], box, matrix, q)
            rows[k, 3], rows[k, 4] = when, ratio
        count = total
        pair += 1
    done[0] = pair
    return count


@kernel(
    void(
        float64[:, ::1],
        int64[::1],
        float64[:, ::1],
        int64[::1],
        int64[::1],
        int64[::1],
        bool_,
        float64[:, ::1],
        float64[:, ::1],
    )
)
def approaches_of_pairs(arcs, offsets, others, other_offsets, first, second, box, matrix, out):
    """Time and least norm of every pair over its common time."""
    q = np.empty((8, 3))
    for pair in range(len(first)):
        i, i_end = offsets[first[pair]], offsets[first[pair] + 1]
        j, j_end = other_offsets[second[pair]], other_offsets[second[pair] + 1]
        start = max(arcs[i, START], others[j, START])
        end = min(arcs[i_end - 1, END], others[j_end - 1, END])
        out[pair, 0], out[pair, 1] = nan, inf
        if start <= end:
            ratio, when = closest(arcs, i, i_end, others, j, j_end, start, end, box, matrix, q)
            out[pair, 0], out[pair, 1] = when, ratio
