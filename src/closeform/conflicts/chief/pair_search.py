"""Certified search of pairs about any chief, window by window of its table.

Two segments in one window differ by one polynomial (see `motion.chief.segments`), whose signs decide
(`sign_changes`).  Times are angles of the table's clock until a conflict is complete.
"""

from math import inf, nan

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.conflicts.chief.minimum_norm import DEEP, minimum
from closeform.conflicts.chief.sign_changes import DEPTH, excluded, window_changes
from closeform.conflicts.pair_search import PAIRS, SEARCH, conflicts_from
from closeform.conflicts.quick_rejection import count_near, mark_near
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
from closeform.motion.chief.bernstein import SQUARE, TERMS
from closeform.motion.chief.clock import time_at
from closeform.motion.chief.positions import keep, polynomial, slack
from closeform.motion.chief.segments import (
    BEGIN,
    COLUMN,
    FINISH,
    FIRST,
    LAST,
    ORIGIN,
    TABLE,
    WINDOW,
    columns_at,
    share,
)
from closeform.motion.chief.table import COLUMNS, COSTATE
from closeform.zones.shapes import FORM

SAME = 1e-12  # [rad]: conflicts that follow each other so soon are one


@kernel()
def subtract(a, b, z):
    """Fill `z` (15,) with the columns of a minus those of b; return the number of nonzero columns."""
    count = COSTATE
    for j in range(COLUMNS):
        z[j] = a[COLUMN + j] - b[COLUMN + j]
        if z[j] != 0.0 and j >= count:
            count = COLUMNS
    return count


@kernel()
def at_once(table, a, b, matrix, z, c, s):
    """Fill `c` with the constant relative position at an angle."""
    joints, rows = table[1], table[3]
    one, two, basis = np.empty(COLUMNS), np.empty(COLUMNS), np.empty(TERMS)
    columns_at(rows, int(a[WINDOW]), share(joints, int(a[WINDOW]), a[ORIGIN], s), a[COLUMN:], one, basis)
    columns_at(rows, int(b[WINDOW]), share(joints, int(b[WINDOW]), b[ORIGIN], s), b[COLUMN:], two, basis)
    for axis in range(3):
        total = 0.0
        for other in range(3):
            total += matrix[axis, other] * (one[other] - two[other])
        for m in range(TERMS):
            c[axis, m] = total


@kernel()
def meet(table, errors, a, b, matrix, z, p, c, off, low, high):
    """Fill `c` with the polynomial of a less b over angles [low, high], and `off` with its error."""
    joints, rows = table[1], table[3]
    k = int(a[WINDOW])
    if b[WINDOW] != a[WINDOW]:  # the instant between two windows
        at_once(table, a, b, matrix, z, c, low)
        off[:] = 0.0
        return
    count = subtract(a, b, z)
    polynomial(rows, k, z, count, matrix, p, c)
    slack(errors, k, z, count, matrix, c, off)
    first, last = share(joints, k, a[ORIGIN], low), share(joints, k, a[ORIGIN], high)
    if first > 0.0 or last < 1.0:
        keep(c, first, last, p[0])


@kernel()
def near_between(angles, near, low, high):
    """Return True if any marked piece overlaps angles [low, high]."""
    first, last = 0, len(angles) - 1
    while last - first > 1:
        middle = (first + last) // 2
        if angles[middle] <= low:
            first = middle
        else:
            last = middle
    while first < len(near) and angles[first] < high:
        if near[first]:
            return True
        first += 1
    return False


@kernel()
def append(rows, count, first, pair, start, end):
    """Store a conflict [start, end] in angles, or extend the one before; return the new count."""
    if count > first and count <= len(rows) and start - rows[count - 1, 2] <= SAME:
        rows[count - 1, 2] = max(end, rows[count - 1, 2])
        return count
    if count < len(rows):
        rows[count, 0], rows[count, 1], rows[count, 2] = pair, start, end
    return count + 1


@kernel()
def pair_conflicts(
    table, errors, segs, i, i_end, others, j, j_end, form, angles, near, work, pair, rows, count
):
    """Append the conflicts of one pair in angles; return the new count, even if they do not fit."""
    shape, matrix, faces = form
    z, p, c, off, stack, ends, places, outs = work
    begin = max(segs[i, FIRST], others[j, FIRST])
    finish = min(segs[i_end - 1, LAST], others[j_end - 1, LAST])
    first, inside, entry = count, False, begin
    while i < i_end and j < j_end:
        low, high = max(segs[i, FIRST], others[j, FIRST]), min(segs[i, LAST], others[j, LAST])
        if low < high or (low == high and begin == finish):
            if not inside and len(near) > 0 and not near_between(angles, near, low, high):
                clear = True
            else:
                meet(table, errors, segs[i], others[j], matrix, z, p, c, off, low, high)
                clear = excluded(shape, faces, c, off, stack[0])
            if clear:
                if inside:
                    count = append(rows, count, first, pair, entry, low)
                    inside = False
            else:
                number, out = window_changes(shape, faces, c, off, stack, ends, places, outs)
                if inside and out > 0:
                    count = append(rows, count, first, pair, entry, low)
                elif not inside and out == 0:
                    entry = low
                inside = out == 0
                for m in range(number):
                    out += outs[m]
                    if (out == 0) != inside:
                        at = low + places[m] * (high - low)
                        if inside:
                            count = append(rows, count, first, pair, entry, at)
                        else:
                            entry = at
                        inside = not inside
        a_last, b_last = segs[i, LAST], others[j, LAST]
        i += 1 if a_last <= b_last else 0
        j += 1 if b_last <= a_last else 0
    if inside:
        count = append(rows, count, first, pair, entry, finish)
    return count


@kernel()
def closest(table, errors, segs, i, i_end, others, j, j_end, form, since, until, work, pieces):
    """Return the minimum norm of a pair over angles [since, until], and its angle."""
    shape, matrix, faces = form
    z, p, c, off, f, ends = work
    best, at = inf, nan
    while i < i_end and j < j_end:
        low = max(segs[i, FIRST], others[j, FIRST], since)
        high = min(segs[i, LAST], others[j, LAST], until)
        if low < high or (low == high and since == until and at != at):
            meet(table, errors, segs[i], others[j], matrix, z, p, c, off, low, high)
            least, u = minimum(shape, faces, c, pieces, ends, f, best, nan)
            if least < best:
                best, at = least, low + u * (high - low)
        if low > until:
            break
        a_last, b_last = segs[i, LAST], others[j, LAST]
        i += 1 if a_last <= b_last else 0
        j += 1 if b_last <= a_last else 0
    return best, at


@kernel()
def common(segs, i, i_end, others, j, j_end):
    """Return the common times of two paths; the second is before the first if there is none."""
    start = max(segs[i, BEGIN], others[j, BEGIN])
    return start, min(segs[i_end - 1, FINISH], others[j_end - 1, FINISH])


@kernel()
def reaches(segs, first, last, s):
    """Return the first segment in [first, last) that ends at or after an angle."""
    low, high = first, last - 1
    while low < high:
        middle = (low + high) // 2
        if segs[middle, LAST] < s:
            low = middle + 1
        else:
            high = middle
    return low


@kernel()
def instant(clock, s, first, last, start, end):
    """Return the time of an angle in [first, last], which are those of `start` and `end`."""
    if s <= first:
        return start
    return end if s >= last else min(max(time_at(clock, s), start), end)


@kernel(inline=True)
def meet_segments(scene, one, two):
    """Return False for a pair that is never close, and the segments and angles at which the search begins."""
    _, _, segs, firsts, others, other_firsts, _, angles, tracks, other_tracks, near, _, _, _ = scene
    i, i_end, j, j_end = firsts[one], firsts[one + 1], other_firsts[two], other_firsts[two + 1]
    start, end = common(segs, i, i_end, others, j, j_end)
    since = max(segs[i, FIRST], others[j, FIRST])
    until = min(segs[i_end - 1, LAST], others[j_end - 1, LAST])
    begin = i, i_end, j, j_end, start, end, since, until
    if not start <= end:
        return False, begin
    if len(near) > 0:
        low, high = 0, len(near)
        while low + 1 < high and angles[low + 1] <= since:
            low += 1
        while high > low + 1 and angles[high - 1] >= until:
            high -= 1
        if count_near(tracks, one, other_tracks, two, low, high) == 0:
            return False, begin
        mark_near(tracks, one, other_tracks, two, low, high, near)
    return True, begin


@kernel()
def search_segments(scene, begin, pair, rows, count):
    """Append the conflicts of a pair in angles; return the new count."""
    table, errors, segs, _, others, _, form, angles, _, _, near, work, _, _ = scene
    i, i_end, j, j_end, _, _, since, _ = begin
    i, j = reaches(segs, i, i_end, since), reaches(others, j, j_end, since)
    pairs = segs, i, i_end, others, j, j_end
    return pair_conflicts(table, errors, *pairs, form, angles, near, work, pair, rows, count)


@kernel()
def nearest_segments(scene, begin, row):
    """Write the time of the minimum norm in a conflict, and the minimum, and turn its angles into times."""
    table, errors, segs, _, others, _, form, _, _, _, _, _, work, pieces = scene
    i, i_end, j, j_end, start, end, since, until = begin
    i, j = reaches(segs, i, i_end, row[1]), reaches(others, j, j_end, row[1])
    pairs = segs, i, i_end, others, j, j_end
    row[4], at = closest(table, errors, *pairs, form, row[1], row[2], work, pieces)
    clock = table[0]
    row[3] = instant(clock, at, since, until, start, end)
    row[1] = instant(clock, row[1], since, until, start, end)
    row[2] = instant(clock, row[2], since, until, start, end)


@kernel(int64(TABLE, float64[:, ::1], *PAIRS, *SEARCH))
def conflicts_of_pairs(
    table,
    errors,
    segs,
    firsts,
    others,
    other_firsts,
    first,
    second,
    pair,
    form,
    angles,
    tracks,
    other_tracks,
    rows,
    done,
):
    """Fill `rows` with conflicts of pairs, as `pair_search.conflicts_from`."""
    clock, joints, turn, rows_of, steps = table
    table = borrowed(clock), borrowed(joints), turn, borrowed(rows_of), borrowed(steps)
    errors, segs, others, rows = borrowed(errors), borrowed(segs), borrowed(others), borrowed(rows)
    firsts, other_firsts = borrowed(firsts), borrowed(other_firsts)
    tracks, other_tracks, angles = borrowed(tracks), borrowed(other_tracks), borrowed(angles)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    room = 2 * SQUARE + 2 * TERMS * (6 + len(form[2]))
    places, outs = np.empty(room), np.empty(room, dtype=np.int64)
    z, p, c, off = stack_vector(COLUMNS), stack_matrix(3, TERMS), stack_matrix(3, TERMS), stack_vector(3)
    ends, pieces = stack_vector(DEPTH), stack_matrix(DEEP, TERMS)
    work = z, p, c, off, stack_matrix(DEPTH, SQUARE), ends, borrowed(places), borrowed(outs)
    least_work = z, p, c, off, stack_vector(SQUARE), ends
    near = np.empty(max(0, len(angles) - 1), dtype=np.bool_)
    scene = (
        *(table, errors, segs, firsts, others, other_firsts, form),
        *(angles, tracks, other_tracks, borrowed(near), work, least_work, pieces),
    )
    count = conflicts_from(
        meet_segments, search_segments, nearest_segments, scene, first, second, pair, rows, done
    )
    near[:] = False  # counted uses: the loans end here
    places[0], outs[0] = 0.0, 0
    return count


@kernel(void(TABLE, float64[:, ::1], *PAIRS, FORM, float64[:, ::1]))
def approaches_of_pairs(table, errors, segs, firsts, others, other_firsts, first, second, form, out):
    """Fill `out` (P, 2) with the time and the minimum norm of every pair over its common time."""
    clock, joints, turn, rows_of, steps = table
    table = borrowed(clock), borrowed(joints), turn, borrowed(rows_of), borrowed(steps)
    errors, segs, others = borrowed(errors), borrowed(segs), borrowed(others)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    z, p, c, off = stack_vector(COLUMNS), stack_matrix(3, TERMS), stack_matrix(3, TERMS), stack_vector(3)
    work, pieces = (z, p, c, off, stack_vector(SQUARE), stack_vector(DEPTH)), stack_matrix(DEEP, TERMS)
    for m in range(len(first)):
        i, i_end = firsts[first[m]], firsts[first[m] + 1]
        j, j_end = other_firsts[second[m]], other_firsts[second[m] + 1]
        out[m, 0], out[m, 1] = nan, inf
        start, end = common(segs, i, i_end, others, j, j_end)
        if start <= end:
            since = max(segs[i, FIRST], others[j, FIRST])
            until = min(segs[i_end - 1, LAST], others[j_end - 1, LAST])
            i, j = reaches(segs, i, i_end, since), reaches(others, j, j_end, since)
            least, at = closest(
                table, errors, segs, i, i_end, others, j, j_end, form, since, until, work, pieces
            )
            out[m, 0], out[m, 1] = instant(table[0], at, since, until, start, end), least
