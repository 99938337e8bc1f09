"""Minimum-delta-v impulses about any chief: Lawden's primer by its dual in six unknowns, certified.

    maximise   g . c   subject to   |p(t)| <= 1 at all times,   p(t) = rows(t) c           # theory (27, 29)

Rows are polynomials in each window, so the maxima of |p| over all times are found by hulls and Descartes'
rule, and g . c over the largest |p| is a lower bound on the delta-v of any thrust.  The solver is that of
`minimum_delta_v.reduced`; time is w + u for u of window w.

`rows` (W, 3, 6, 12) are those of any linear system with bounded |p|: of the transition matrix, or of the
sensitivities of relative orbital elements.
"""

from math import inf, sqrt

import numpy as np
from numba import float64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.motion.chief.bernstein import (
    DEGREE,
    SQUARE,
    TERMS,
    changes,
    cut,
    keep_piece,
    value_at,
    weights,
)
from closeform.motion.chief.segments import FIRST as FIRST_ANGLE
from closeform.motion.chief.segments import LAST as LAST_ANGLE
from closeform.motion.chief.segments import ORIGIN, TABLE, WINDOW, share, squared
from closeform.motion.linear import factorise
from closeform.motion.minimum_delta_v.barrier import WIDTH, overlap
from closeform.motion.minimum_delta_v.nonnegative import MOST
from closeform.motion.minimum_delta_v.reduced import (
    ANSWER,
    COUNT,
    FIRST,
    LOWER,
    ROUNDS,
    TOUCHING,
    UNIQUE,
    UPPER,
    improve,
    lay,
)

SPACING = 4  # times of the first grid in a window
ROOM = 8  # places of a window among which impulses are chosen
DEPTH = 50  # of pieces in work
NARROWEST = 1e-9  # of a window: a shorter piece in which |p| is flat to rounding is one maximum


@kernel()
def rows_at(scene, t, out):
    """Fill `out` (18,) with the rows at a time."""
    rows, basis = scene[0], scene[1]
    w, u = place_of(rows, t)
    weights(u, basis)
    for axis in range(3):
        for i in range(6):
            total = 0.0
            for b in range(TERMS):
                total += basis[b] * rows[w, axis, i, b]
            out[6 * axis + i] = total


@kernel()
def place_of(rows, t):
    """Return the window of a time, and the place in it."""
    w = min(int(t), len(rows) - 1)
    return w, min(max(t - w, 0.0), 1.0)


@kernel()
def bend_at(scene, t, y, out, rates):
    """Fill `out` and `rates` (18,), and return the second derivative of |p|^2 / 2."""
    rows, c = scene[0], scene[2]
    w, u = place_of(rows, t)
    bend = 0.0
    for axis in range(3):
        for k in range(TERMS):
            c[0, k] = 0.0
            for i in range(6):
                c[0, k] += rows[w, axis, i, k] * y[i]
        for k in range(TERMS - 2):
            c[1, k] = DEGREE * (DEGREE - 1.0) * (c[0, k + 2] - 2.0 * c[0, k + 1] + c[0, k])
        p, rate = value_at(c[0], TERMS, u)
        bend += rate * rate + p * value_at(c[1], TERMS - 2, u)[0]
        for i in range(6):
            out[6 * axis + i], rates[6 * axis + i] = value_at(rows[w, axis, i], TERMS, u)
    return bend


@kernel(void(TABLE, float64[:, ::1], float64[:, :, :, ::1], float64[:, ::1]))
def primer_rows(table, segments, rows, whole):
    """Fill `rows` (W, 3 or 6, 6, 12) with those of the transition matrix from the start of the first window.

    `segments` (W, 21) are those of one coast; `whole` (6, 6) receives the matrix at its end.
    """
    joints, of_table, steps = table[1], table[3], table[4]
    product, basis, spare = np.empty((6, 6)), np.empty(TERMS), np.empty(TERMS)
    for i in range(6):
        for j in range(6):
            whole[i, j] = 1.0 if i == j else 0.0
    for w in range(len(segments)):
        row = segments[w]
        k = int(row[WINDOW])
        low, high = (
            share(joints, k, row[ORIGIN], row[FIRST_ANGLE]),
            share(joints, k, row[ORIGIN], row[LAST_ANGLE]),
        )
        for axis in range(rows.shape[1]):
            for i in range(6):
                for b in range(TERMS):
                    total = 0.0
                    for m in range(6):
                        total += of_table[k, m, axis, b] * whole[m, i]
                    rows[w, axis, i, b] = total
                keep_piece(rows[w, axis, i], low, high, spare)
        weights(high, basis)
        for i in range(6):
            for j in range(6):
                product[i, j] = 0.0
                for m in range(6):
                    step = steps[k, i, m]
                    if w + 1 == len(segments):
                        step = 0.0
                        for b in range(TERMS):
                            step += basis[b] * of_table[k, m, i, b]
                    product[i, j] += step * whole[m, j]
        for i in range(6):
            for j in range(6):
                whole[i, j] = product[i, j]


@kernel()
def scale_rows(scene, g, metric):
    """Replace rows and g by those of y with c = metric y, so that |y|^2 is the mean of |p|^2."""
    rows, spare = scene[0], np.empty(18)
    mean, count = np.zeros((6, 6)), SPACING * len(rows)
    for w in range(len(rows)):
        for k in range(SPACING):
            rows_at(scene, w + k / (SPACING - 1.0), spare)
            for i in range(6):
                for j in range(i, 6):
                    mean[i, j] += overlap(spare, i, j)
    factorise(mean, 6)
    for i in range(6):
        for j in range(6):
            metric[i, j] = 0.0
    for j in range(6):
        metric[j, j] = sqrt(count / mean[j, j])
        for i in range(j - 1, -1, -1):
            for k in range(i + 1, j + 1):
                metric[i, j] -= mean[i, k] / mean[i, i] * metric[k, j]
    for w in range(len(rows)):
        for axis in range(3):
            for j in range(5, -1, -1):  # column j of the product depends on those before it
                for b in range(TERMS):
                    total = 0.0
                    for i in range(j + 1):
                        total += rows[w, axis, i, b] * metric[i, j]
                    rows[w, axis, j, b] = total
    for j in range(5, -1, -1):
        total = 0.0
        for i in range(j + 1):
            total += metric[i, j] * g[i]
        g[j] = total


@kernel()
def highest_in(f, slopes):
    """Return the place and the value of the only maximum of `f` (SQUARE,), whose slope falls through zero."""
    for j in range(SQUARE - 1):
        slopes[j] = f[j + 1] - f[j]
    low, high, u = 0.0, 1.0, 0.5
    for _ in range(60):
        value, rate = value_at(slopes, SQUARE - 1, u)
        if value > 0.0:
            low = u
        else:
            high = u
        there = u - value / rate if rate < 0.0 else -1.0
        if not low < there < high:
            there = 0.5 * (low + high)
        if abs(there - u) <= 1e-15:
            break
        u = there
    return u, value_at(f, SQUARE, u)[0]


@kernel()
def note(places, squares, count, place, square):
    """Add a maximum if there is room; those at one place are one.  Return the count."""
    if count > 0 and abs(places[count - 1] - place) < 1e-9:
        squares[count - 1] = max(squares[count - 1], square)
        return count
    if count < len(places):
        places[count], squares[count] = place, square
        count += 1
    return count


@kernel()
def primer_in(rows, c, p):
    """Fill `p` (3, 12) with the primer of `c` (6,) in a window of `rows` (at least 3, 6, 12)."""
    for axis in range(3):
        for b in range(TERMS):
            total = 0.0
            for i in range(6):
                total += rows[axis, i, b] * c[i]
            p[axis, b] = total


@kernel()
def window_maxima(w, floor, rises, work, places, squares, count):
    """Add the local maxima from `floor` on of a polynomial in window w, but for its end.

    The polynomial is the first of the stack in `work`.  Its begin is a maximum where it falls from there and
    `rises` before.  Returns the number of maxima, a bound over the window, at least `floor`, the value at the
    end, and if it rises there.
    """
    stack, ends, slopes = work
    top, begin = 0, 0.0
    ends[0] = 1.0
    first, last = stack[0, 0], stack[0, SQUARE - 1]
    most = max(floor, first, last)
    if first >= floor and stack[0, 1] <= first and rises:
        count = note(places, squares, count, w + 0.0, first)
    rose = last >= stack[0, SQUARE - 2]
    while top >= 0:
        f, end = stack[top], ends[top]
        peak = 0.0
        for j in range(SQUARE):
            peak = max(peak, f[j])
        if peak < floor:
            begin = end
            top -= 1
            continue
        for j in range(SQUARE - 1):
            slopes[j] = f[j + 1] - f[j]
        turns = changes(slopes, SQUARE - 1)
        flat = peak - min(f[0], f[SQUARE - 1]) <= 1e-13 * peak
        if turns > 1 and not flat and end - begin > NARROWEST and top + 1 < DEPTH:
            cut(f, SQUARE, 0.5, stack[top + 1])
            ends[top + 1] = 0.5 * (begin + end)
            top += 1
            continue
        if turns > 1:
            count = note(places, squares, count, w + 0.5 * (begin + end), peak)
            most = max(most, peak)
        elif turns == 1 and (slopes[0] > 0.0 or (slopes[0] == 0.0 and slopes[1] > 0.0)):
            u, square = highest_in(f, slopes)
            if square >= floor:
                count = note(places, squares, count, w + begin + u * (end - begin), square)
            most = max(most, square)
        begin = end
        top -= 1
    return count, most, last, rose


@kernel()
def maxima(scene, y, places, squares):
    """Fill in the local maxima of |p|^2 above TOUCHING^2; return their number, and a bound over all times."""
    rows, _, c, stack, ends, slopes = scene
    work = stack, ends, slopes
    floor, count = TOUCHING * TOUCHING, 0
    most, last, rose = floor, 0.0, True
    for w in range(len(rows)):
        primer_in(rows[w], y, c)
        squared(c, stack[0])
        count, high, last, rose = window_maxima(w, floor, rose, work, places, squares, count)
        most = max(most, high)
    if last >= floor and rose:
        count = note(places, squares, count, len(rows) + 0.0, last)
    return count, most


@kernel(void(float64[:, :, :, ::1], float64[::1], float64[::1]))
def least_impulses(rows, g, answer):
    """Fill `answer` (34,) for a required change g (6,) of length one; rows and g are overwritten."""
    metric, active = np.empty((6, 6)), np.empty(MOST, dtype=np.int64)
    scene = (
        *(rows, np.empty(TERMS), np.empty((3, TERMS))),
        *(np.empty((DEPTH, SQUARE)), np.empty(DEPTH), np.empty(SQUARE)),
    )
    scale_rows(scene, g, metric)
    grid, size = (SPACING - 1) * len(rows) + 1, ROOM * len(rows) + 8
    table = np.empty((grid + 2 * ROUNDS * (8 + len(rows)), WIDTH))
    lines, columns = np.empty((4, size)), np.empty((2, size, 9))
    work = lines[0], lines[1], columns[0], columns[1], lines[2], lines[3], active
    for k in range(grid):
        lay(rows_at, scene, k / (SPACING - 1.0), table, k)
    answer[LOWER], answer[UPPER], answer[UNIQUE] = 0.0, inf, 1.0
    improve(rows_at, bend_at, maxima, scene, 1.0 * len(rows), metric, g, table, grid, work, answer)


def solve(rows: Floats, change: Floats) -> Floats:
    """Return the answer (34,) for a change (6,) of the functional, of any size, impulses in order of time."""
    answer, size = np.zeros(ANSWER), float(np.linalg.norm(change))
    answer[UNIQUE] = 1.0
    if size == 0.0:
        return answer
    least_impulses(np.ascontiguousarray(rows), change / size, answer)
    answer[[LOWER, UPPER]] *= size
    answer[LOWER] = min(answer[LOWER], answer[UPPER])  # a plan may leave 1e-11 of the change
    impulses = answer[FIRST:].reshape(MOST, 4)[: int(answer[COUNT])]
    impulses[:, 1:] *= size
    impulses[:] = impulses[np.argsort(impulses[:, 0])]
    return answer
