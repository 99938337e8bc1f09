"""Passive safety about any chief: certified clearance of all drifts after a loss of thrust.

A drift after a failure at angle s is natural motion.  Taken back to the beginning of the window of s, its
state is a polynomial y of s (`returns` of the table), or a linear function of the fraction of an impulse that
was still fired.  In a later window its position is a polynomial of the window's variable u as well, so that
the relative position is a tensor of 12 x 12 control points, in the hull of which it stays:

    q(l, u) = Z (sum_i sum_b B_i(l) B_b(u) C_b A y_i - r_other(u))

A plane that keeps all control points out of the zone clears a cell of failures l and times u; a cell that it
does not clear is halved.  Errors of the polynomials enlarge the zone.
"""

from math import inf, sqrt

import numpy as np
from numba import boolean, float64, int64

from closeform._jit import kernel
from closeform.motion.arc import IMPULSE
from closeform.motion.chief.bernstein import TERMS, cut, keep_piece, weights
from closeform.motion.chief.positions import largest, polynomial, slack
from closeform.motion.chief.segments import (
    COLUMN,
    FIRST,
    LAST,
    ON_JOINT,
    ORIGIN,
    TABLE,
    WINDOW,
    back,
    columns_in,
    joint,
    share,
    window_at,
    work_space,
)
from closeform.motion.chief.table import COSTATE
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.path import Path
from closeform.zones.shapes import BALL, CYLINDER, FACES, FORM, norm
from closeform.zones.zone import Zone

DEPTH = 60  # halvings of cells in work
MOST_CELLS = 20_000  # of one failing spacecraft: grazing failures end undecided, as unsafe
NARROWEST = 1e-6  # of a window: a smaller cell that is not clear is undecided


@kernel()
def clears(shape, faces, cell, off):
    """Return True if a plane keeps all control points (TERMS, 3, TERMS) out of the zone."""
    last = TERMS - 1
    if shape == BALL or shape == CYLINDER:
        axes, best, wx, wy, wz = 3 if shape == BALL else 2, inf, 0.0, 0.0, 0.0
        for i in (0, TERMS // 2, last):  # the control point nearest to the centre, of nine
            for b in (0, TERMS // 2, last):
                x, y, z = cell[i, 0, b], cell[i, 1, b], cell[i, 2, b] if axes == 3 else 0.0
                if x * x + y * y + z * z < best:
                    best, wx, wy, wz = x * x + y * y + z * z, x, y, z
        least = inf
        for i in range(TERMS):
            for b in range(TERMS):
                least = min(least, wx * cell[i, 0, b] + wy * cell[i, 1, b] + wz * cell[i, 2, b])
        if least > sqrt(best) * (1.0 + off):
            return True
    if shape == FACES:
        for part in range(len(faces)):
            least = inf
            for i in range(TERMS):
                for b in range(TERMS):
                    value = faces[part, 0] * cell[i, 0, b] + faces[part, 1] * cell[i, 1, b]
                    least = min(least, value + faces[part, 2] * cell[i, 2, b])
            size = abs(faces[part, 0]) + abs(faces[part, 1]) + abs(faces[part, 2])
            if least > 1.0 + off * size:
                return True
        return False
    if shape == BALL:
        return False
    for axis in range(2 if shape == CYLINDER else 0, 3):
        least, most = inf, -inf
        for i in range(TERMS):
            for b in range(TERMS):
                least, most = min(least, cell[i, axis, b]), max(most, cell[i, axis, b])
        if least > 1.0 + off or most < -1.0 - off:
            return True
    return False


@kernel()
def halve(cells, top, along_time, line, left):
    """Cut cell `top` in two along failures or time: the first half goes to top + 1."""
    for axis in range(3):
        for k in range(TERMS):
            for m in range(TERMS):
                line[m] = cells[top, k, axis, m] if along_time else cells[top, m, axis, k]
            cut(line, TERMS, 0.5, left)
            for m in range(TERMS):
                if along_time:
                    cells[top, k, axis, m], cells[top + 1, k, axis, m] = line[m], left[m]
                else:
                    cells[top, m, axis, k], cells[top + 1, m, axis, k] = line[m], left[m]


@kernel()
def all_clear(shape, faces, cells, spans, off, when, line, left, spent):
    """Return True if the cell in place 0 is clear wherever drift is after the failure.

    `spans` (DEPTH, 4) begins with [0, 1] for failures and the time's first and last place in its window.
    `when` are the first and last place of failures in this window, or -1 for failures before it.
    """
    top = 0
    while top >= 0:
        spent[0] += 1
        l0, l1, u0, u1 = spans[top, 0], spans[top, 1], spans[top, 2], spans[top, 3]
        fails = -1.0 if when[0] < 0.0 else when[0] + l0 * (when[1] - when[0])
        if u1 <= fails or clears(shape, faces, cells[top], off):
            top -= 1
            continue
        for i in (0, TERMS - 1):
            for b in (0, TERMS - 1):
                at = u0 if b == 0 else u1
                lost = -1.0 if when[0] < 0.0 else when[0] + (l0 if i == 0 else l1) * (when[1] - when[0])
                x, y, z = cells[top, i, 0, b], cells[top, i, 1, b], cells[top, i, 2, b]
                if at >= lost and norm(shape, faces, x, y, z) <= 1.0:
                    return False
        if top + 1 == DEPTH or spent[0] > MOST_CELLS or max(l1 - l0, u1 - u0) < NARROWEST:
            return False
        by_failure, by_time = 0.0, 0.0
        for axis in range(3):
            for k in (0, TERMS - 1):
                by_failure += abs(cells[top, TERMS - 1, axis, k] - cells[top, 0, axis, k])
                by_time += abs(cells[top, k, axis, TERMS - 1] - cells[top, k, axis, 0])
        along_time = by_time >= by_failure
        halve(cells, top, along_time, line, left)
        for m in range(4):
            spans[top + 1, m] = spans[top, m]
        if along_time:
            spans[top + 1, 3] = spans[top, 2] = 0.5 * (u0 + u1)
        else:
            spans[top + 1, 1] = spans[top, 0] = 0.5 * (l0 + l1)
        top += 1
    return True


@kernel()
def fill_control_points(rows, errors, k, whole, y, wrong, row, matrix, u0, u1, work):
    """Fill cell 0 with the control points of all drifts of `y` less `row`, over [u0, u1] of window k.

    Returns a bound of their error.
    """
    cells, _, _, _, z, p, c, there, line, left, slacks, _ = work
    count = columns_in(row)
    polynomial(rows, k, row[COLUMN:], count, matrix, p, there)
    slack(errors, k, row[COLUMN:], count, matrix, there, slacks)
    off, most, size, stretch = size_of(slacks), 0.0, 0.0, 0.0
    for i in range(TERMS):
        for m in range(6):
            total = 0.0
            for q in range(6):
                total += whole[m, q] * y[q, i]
            z[m] = total
        polynomial(rows, k, z, COSTATE, matrix, p, c)
        slack(errors, k, z, COSTATE, matrix, c, slacks)
        most = max(most, size_of(slacks))
        for axis in range(3):
            for b in range(TERMS):
                line[b] = c[axis, b] - there[axis, b]
            keep_piece(line, u0, u1, left)
            for b in range(TERMS):
                cells[0, i, axis, b] = line[b]
    for m in range(6):
        total = 0.0
        for q in range(6):
            total += abs(whole[m, q])
        size += total * largest(rows[k, m])
    for axis in range(3):
        total = abs(matrix[axis, 0]) + abs(matrix[axis, 1]) + abs(matrix[axis, 2])
        stretch += total * total
    return off + most + sqrt(stretch) * wrong * size


@kernel()
def size_of(vector):
    """Return the Euclidean length of a vector (3,)."""
    return sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)


@kernel()
def carry(steps, k, whole, product):
    """Replace `whole` (6, 6) by the transition matrix to the end of window k."""
    for i in range(6):
        for m in range(6):
            total = 0.0
            for q in range(6):
                total += steps[k, i, q] * whole[q, m]
            product[i, m] = total
    for i in range(6):
        for m in range(6):
            whole[i, m] = product[i, m]


@kernel()
def drifts_clear(table, errors, y, wrong, k, turns, begins, when, others, until, form, work):
    """Return True if all drifts of states `y` (6, TERMS) at the beginning of window k stay out of the zone.

    They begin at the angle `begins` and end at `until`; `wrong` bounds the error of y.
    """
    shape, matrix, faces = form
    clock, joints, turn, rows, steps = table
    cells, spans, whole, product, _, _, _, _, line, left, _, spent = work
    j, j_end = 0, len(others)
    for i in range(6):
        for m in range(6):
            whole[i, m] = 1.0 if i == m else 0.0
    first_window = True
    while True:
        origin, end = joint(joints, turn, k, turns), joint(joints, turn, k + 1, turns)
        low, high = max(origin, begins), min(end, until)
        while j + 1 < j_end and others[j, LAST] <= low + ON_JOINT:
            j += 1
        n = j
        while n < j_end and others[n, FIRST] < high - ON_JOINT:
            a, b = max(low, others[n, FIRST]), min(high, others[n, LAST])
            row = others[n]
            n += 1
            if not a < b or int(row[WINDOW]) != k:
                continue
            u0, u1 = share(joints, k, origin, a), share(joints, k, origin, b)
            off = fill_control_points(rows, errors, k, whole, y, wrong, row, matrix, u0, u1, work)
            spans[0, 0], spans[0, 1], spans[0, 2], spans[0, 3] = 0.0, 1.0, u0, u1
            place = when if first_window else (-1.0, -1.0)
            if not all_clear(shape, faces, cells, spans, off, place, line, left, spent):
                return False
        if end >= until - ON_JOINT or (turn == 0.0 and k + 2 == len(joints)):
            return True
        carry(steps, k, whole, product)
        first_window = False
        k += 1
        if k + 1 == len(joints):
            k, turns = 0, turns + 1.0


@kernel(
    boolean(
        TABLE,
        float64[:, ::1],
        float64[:, :, :, ::1],
        float64[:, ::1],
        float64[:, ::1],
        float64[:, ::1],
        float64[:, ::1],
        float64,
        FORM,
        int64[::1],
    )
)
def loss_is_safe(table, errors, returns, return_errors, segs, jumps, others, until, form, spent):
    """Return True if no loss of thrust along the segments of one path violates the zone around another.

    `jumps` (S, 3) are the impulses at the beginnings of segments over n; `until` is an angle.
    """
    joints, turn, rows = table[1], table[2], table[3]
    cells, y, fixed = np.empty((DEPTH, TERMS, 3, TERMS)), np.empty((6, TERMS)), np.empty(6)
    line, left, basis = np.empty(TERMS), np.empty(TERMS), np.empty(TERMS)
    work = (
        cells,
        np.empty((DEPTH, 4)),
        np.empty((6, 6)),
        np.empty((6, 6)),
        np.zeros(15),
        np.empty((3, TERMS)),
        np.empty((3, TERMS)),
        np.empty((3, TERMS)),
        line,
        left,
        np.empty(3),
        spent,
    )
    given, before, space = np.zeros(15), np.empty(15), work_space()
    for s in range(len(segs)):
        row = segs[s]
        k, turns = window_at(joints, turn, row[ORIGIN])
        u0, u1 = share(joints, k, row[ORIGIN], row[FIRST]), share(joints, k, row[ORIGIN], row[LAST])
        wrong, push = 0.0, columns_in(row) > COSTATE
        weights(u0, basis)
        for i in range(6):
            fixed[i] = row[COLUMN + i]
        if push:
            for q in range(9):
                value = row[COLUMN + COSTATE + q]
                wrong += abs(value) * return_errors[k, q]
                for i in range(6):
                    for b in range(TERMS):
                        fixed[i] += value * basis[b] * returns[k, q, i, b]
        jumped = jumps[s, 0] != 0.0 or jumps[s, 1] != 0.0 or jumps[s, 2] != 0.0
        for amid in range(2):  # amid an impulse, then along the segment
            place = (-1.0, -1.0)
            if amid == 0 and (s == 0 or jumped):
                for i in range(3):
                    given[i], given[3 + i] = 0.0, jumps[s, i]
                before[:] = 0.0
                if jumped:
                    back(rows, k, u0, given, before, space)
                for i in range(6):
                    for b in range(TERMS):
                        y[i, b] = fixed[i] - (1.0 - b / (TERMS - 1.0)) * before[i]
            elif amid == 1 and push and row[LAST] > row[FIRST]:
                place = (u0, u1)
                for i in range(6):
                    y[i] = row[COLUMN + i]
                    for q in range(9):
                        value = row[COLUMN + COSTATE + q]
                        for b in range(TERMS):
                            y[i, b] += value * returns[k, q, i, b]
                    keep_piece(y[i], u0, u1, left)
            else:
                continue
            if not drifts_clear(
                table, errors, y, wrong, k, turns, row[FIRST], place, others, until, form, work
            ):
                return False
    return True


def loss_of_thrust_is_safe(path: Path, other: Path, zone: Zone, until: float, around: bool = True) -> bool:
    """Return True if a loss of thrust of `path` at any instant keeps the two spacecraft apart until a time.

    `other` continues as planned.  The zone is around `other`, or around `path` if not `around`.  The result
    is False also where many cells leave it undecided.
    """
    shape, matrix, faces = zone.form
    form = shape, matrix if around else -matrix, faces
    orbit: ChiefOrbit = path.orbit  # type: ignore[assignment]  # the caller has checked it
    table, rate = orbit.chief.table, orbit._rate
    segments, firsts = orbit._segments(path.arcs, np.arange(len(path.arcs) + 1))
    jumps = np.zeros((len(segments), 3))
    jumps[firsts[:-1]] = path.arcs[:, IMPULSE : IMPULSE + 3] / rate
    last = orbit._angle(until)
    spent = np.zeros(1, dtype=np.int64)
    found = loss_is_safe(
        table.form,
        table.errors,
        table.returns,
        table.return_errors,
        segments,
        jumps,
        other._segments[0],
        last,
        form,
        spent,
    )
    return bool(found)
