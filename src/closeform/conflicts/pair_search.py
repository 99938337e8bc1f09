"""Certified march over pairs of paths: their conflicts and closest approaches, as rows of floats."""

from collections.abc import Callable
from math import inf, nan
from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.conflicts.quick_rejection import FEW, coasts_apart, count_near, interval, is_clear, mark_near
from closeform.kernel_loans import borrowed, stack_matrix
from closeform.motion.arc import END, START
from closeform.motion.certified_march import (
    LESS_PATIENCE,
    PATIENCE,
    bounds,
    locate,
    relative_state,
    taylor_step,
    window,
    window_end,
)
from closeform.motion.extrema import minimum_norm
from closeform.zones.shapes import (
    CYLINDER,
    FACES,
    FORM,
    inside_flat,
    inside_step,
    norm,
    outside_step,
    rank,
)

# A norm within 1e-12 of 1 is on the surface. A search from outside ends at ENTERED, one from inside only at
# LEFT, so that rounding cannot make the two alternate forever; each aims slightly further.
TOUCH = 1e-12
ENTRY_AIM, ENTERED, LEFT, EXIT_AIM = 1 + 0.08 * TOUCH, 1 + 0.16 * TOUCH, 1 + 0.4 * TOUCH, 1 + 0.5 * TOUCH
COLUMNS = 5  # of a row of conflicts: pair, start, end, time, ratio
# Types of arguments: two batches and the indices of pairs in them; and those of a search after these.
PAIRS = (*(float64[:, ::1], int64[::1]) * 2, *(int64[::1],) * 2)
SEARCH = (int64, FORM, float64[::1], *(float64[:, :, ::1],) * 2, float64[:, ::1], int64[::1])


@kernel()
def cross(shape, faces, q, order, n, t, stop, inside, patience):
    """March through a window until the norm changes sides; return the time reached and True if it did."""
    ax, ay, az, a, speed = bounds(q, order, n, stop)
    axes = rank(shape, 0)
    if axes > 1 and patience == LESS_PATIENCE and t == 0.0:
        t = taylor_step(axes, q, order, n, stop, EXIT_AIM if inside else ENTRY_AIM, inside)
        if inside and shape == CYLINDER:  # bound of leaving through an end
            t = min(t, inside_flat(q[0, 2], q[1, 2], az, EXIT_AIM))
    for _ in range(patience):
        x, y, z, vx, vy, vz = relative_state(q, order, n, t)
        s = norm(shape, faces, x, y, z)
        if (inside and s > LEFT) or (not inside and s <= ENTERED):
            return t, True
        if t >= stop:
            return stop, False
        if inside:
            h = inside_step(shape, faces, x, y, z, vx, vy, vz, ax, ay, az, a, speed, EXIT_AIM)
        else:
            h = outside_step(shape, faces, x, y, z, vx, vy, vz, ax, ay, az, a, ENTRY_AIM)
        t = min(stop, max(t + h, t * (1.0 + 2.3e-16)))
    return t, False


@kernel()
def closest(arcs, i, i_end, others, j, j_end, start, end, form, q):
    """Return the minimum norm over [start, end] between one path's arcs and another's, and its time."""
    shape, matrix, faces = form
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
        stop = window_end(arcs[i], others[j], t, end)
        order, n = window(arcs[i], others[j], t, matrix, q)
        least, when, reached = minimum_norm(shape, faces, q, order, n, 0.0, stop - t, patience, best, nan)
        if least < best:
            best, best_time = least, min(t + when, stop)  # t + (stop - t) may round above it
        if reached < stop - t:
            patience = LESS_PATIENCE
            t += reached
        else:
            t = stop
        if t >= end or (best == 0.0 and shape != FACES):
            return best, best_time


@kernel()
def append(rows, count, pair, start, end):
    """Store a conflict if there is space; return the new count."""
    if count < len(rows):
        rows[count, 0], rows[count, 1], rows[count, 2] = pair, start, end
    return count + 1


@kernel(inline=True)
def march_window(load, cross_zone, scene, i, j, t, stop, inside, entry, pair, rows, count):
    """March arcs i and j from t to `stop`; return if inside at the end, since when, and the count of rows.

    `load(scene, i, j, t, span)` returns a window of both arcs from t on. `cross_zone(scene, window, t, span,
    inside, patience)` marches in it until the gap to the zone changes sign; it returns the time reached and
    True if it did.
    """
    patience = PATIENCE
    while True:
        loaded = load(scene, i, j, t, stop - t)
        local = 0.0
        while True:
            local, crossed = cross_zone(scene, loaded, local, stop - t, inside, patience)
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
def pair_conflicts(
    load, cross_zone, scene, arcs, i, i_end, others, j, j_end, start, end, times, near, k, pair, rows, count
):
    """Append the conflicts of one pair to `rows`; return the new count, above len(rows) if they do not fit.

    `near` marks the intervals of `times` to search, from index k on; it is empty for all. The windows, and so
    the times found, do not depend on it.
    """
    inside = False
    entry = start
    t = start
    while True:
        while i + 1 < i_end and arcs[i, END] <= t:
            i += 1
        while j + 1 < j_end and others[j, END] <= t:
            j += 1
        stop = window_end(arcs[i], others[j], t, end)
        while k + 1 < len(near) and times[k + 1] <= t:
            k += 1
        if len(near) == 0 or not is_clear(times, near, k, stop):
            inside, entry, count = march_window(
                load, cross_zone, scene, i, j, t, stop, inside, entry, pair, rows, count
            )
        t = stop
        if t >= end:
            break
    return append(rows, count, pair, entry, end) if inside else count


@kernel()
def load_window(scene, i, j, t, _):
    """Fill the derivatives of the relative position at t; return their order and the mean motion."""
    arcs, others, form, q = scene
    return window(arcs[i], others[j], t, form[1], q)


@kernel()
def cross_norm(scene, loaded, t, span, inside, patience):
    """March until the norm of the relative position crosses 1."""
    _, _, form, q = scene
    return cross(form[0], form[2], q, loaded[0], loaded[1], t, span, inside, patience)


@kernel(void(*PAIRS, FORM, float64[:, ::1]))
def approaches_of_pairs(arcs, offsets, others, other_offsets, first, second, form, out):
    """Fill `out` (P, 2) with the time and the minimum norm of every pair over its common time."""
    arcs, others = borrowed(arcs), borrowed(others)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    q = stack_matrix(8, 3)
    for pair in range(len(first)):
        i, i_end = offsets[first[pair]], offsets[first[pair] + 1]
        j, j_end = other_offsets[second[pair]], other_offsets[second[pair] + 1]
        start = max(arcs[i, START], others[j, START])
        end = min(arcs[i_end - 1, END], others[j_end - 1, END])
        out[pair, 0], out[pair, 1] = nan, inf
        if start <= end:
            ratio, when = closest(arcs, i, i_end, others, j, j_end, start, end, form, q)
            out[pair, 0], out[pair, 1] = when, ratio


@kernel(inline=True)
def conflicts_from(meet, search, nearest, scene, first, second, pair, rows, done):
    """Fill `rows` with the conflicts of pairs (first[k], second[k]) from k = `pair` onward, as many as fit.

    `meet(scene, one, two)` returns False for a pair that is never close, and the start of its search.
    `search(scene, begin, k, rows, count)` appends its conflicts, and `nearest(scene, begin, row)` completes
    one. Returns the number of rows; `done` receives the next pair, and the number of rows that it needs if
    they do not fit.
    """
    count = 0
    for k in range(pair, len(first)):
        near, begin = meet(scene, first[k], second[k])
        if not near:
            continue
        total = search(scene, begin, k, rows, count)
        if total > len(rows):
            done[0], done[1] = k, total - count
            return count
        for m in range(count, total):
            nearest(scene, begin, rows[m])
        count = total
    done[0] = len(first)
    return count


@kernel(inline=True)
def meet_arcs(scene, one, two):
    """Return False for paths of arcs that are never close, and the arcs and times of the search's start."""
    arcs, offsets, others, other_offsets, form, q, times, tracks, other_tracks, near = scene
    i, i_end, j, j_end = offsets[one], offsets[one + 1], other_offsets[two], other_offsets[two + 1]
    start = max(arcs[i, START], others[j, START])
    end = min(arcs[i_end - 1, END], others[j_end - 1, END])
    k, last = 0, 0
    if not start <= end:
        return False, (i, i_end, j, j_end, start, end, k)
    if len(near) > 0:
        k, last = interval(times, start), interval(times, end) + 1
    begin = i, i_end, j, j_end, start, end, k
    few = 0 < last - k <= FEW  # intervals that cost less than the bound of an ellipse
    if few and count_near(tracks, one, other_tracks, two, k, last) == 0:
        return False, begin
    i, j = locate(arcs, i, i_end, start), locate(others, j, j_end, start)
    if not few and coasts_apart(arcs[i], others[j], start, end, form, q):
        return False, begin
    if last - k > FEW and count_near(tracks, one, other_tracks, two, k, last) == 0:
        return False, begin
    mark_near(tracks, one, other_tracks, two, k, last, near)
    return True, (i, i_end, j, j_end, start, end, k)


@kernel()
def search_arcs(scene, begin, pair, rows, count):
    """Append the conflicts of a pair; return the new count."""
    arcs, _, others, _, form, q, times, _, _, near = scene
    i, i_end, j, j_end, start, end, k = begin
    search = arcs, i, i_end, others, j, j_end, start, end, times, near, k, pair, rows, count
    return pair_conflicts(load_window, cross_norm, (arcs, others, form, q), *search)


@kernel()
def nearest_arcs(scene, begin, row):
    """Write the time of the minimum norm in a conflict, and the minimum."""
    arcs, _, others, _, form, q, _, _, _, _ = scene
    i, i_end, j, j_end, _, _, _ = begin
    row[4], row[3] = closest(arcs, i, i_end, others, j, j_end, row[1], row[2], form, q)


@kernel(int64(*PAIRS, *SEARCH))
def conflicts_of_pairs(
    arcs, offsets, others, other_offsets, first, second, pair, form, times, tracks, other_tracks, rows, done
):
    """Fill `rows` with conflicts of pairs, as `conflicts_from`; times and tracks are those of `Tracks`."""
    arcs, others, rows, times = borrowed(arcs), borrowed(others), borrowed(rows), borrowed(times)
    tracks, other_tracks = borrowed(tracks), borrowed(other_tracks)
    offsets, other_offsets = borrowed(offsets), borrowed(other_offsets)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    near = np.empty(max(0, len(times) - 1), dtype=np.bool_)
    scene = (
        *(arcs, offsets, others, other_offsets, form, stack_matrix(8, 3)),
        *(times, tracks, other_tracks, borrowed(near)),
    )
    count = conflicts_from(meet_arcs, search_arcs, nearest_arcs, scene, first, second, pair, rows, done)
    near[:] = False  # a counted use: the loan ends here
    return count


def all_rows(search: Callable[[int, Floats, Any], int], pairs: int, space: int) -> Floats:
    """Return the rows (M, 5) of all pairs by a search from a pair onward, which fills as many rows as fit.

    `search(pair, rows, done)` returns the number of rows and fills `done` as `conflicts_of_pairs` does.
    `space` is the initial number of rows.
    """
    rows, done, found = np.empty((space, COLUMNS)), np.zeros(2, dtype=np.int64), []
    while done[0] < pairs:
        before = int(done[0])
        count = search(before, rows, done)
        found.append(rows[:count].copy())
        if done[0] == before:  # one pair has more conflicts than there are rows
            rows = np.empty((done[1], COLUMNS))
    return np.concatenate([rows[:0], *found]) if len(found) != 1 else found[0]
