"""Segments: arcs cut at the windows of a table, where position and thrust are polynomials of one variable.

A segment is a row of floats: the times and the angles of its start and end, its window, the angle at which
that window begins, and the columns of `table` there: the state (r, v/n), the costate (p/n^2, p'/n^3) and the
constant push a/n^2.  Two segments in one window differ by the same polynomials of the difference of their
columns, so the relative motion of two spacecraft is one polynomial, whatever both do.
"""

from math import floor, sqrt

import numpy as np
from numba import float64, int64, types, void

from closeform._jit import kernel
from closeform.motion.arc import END, START
from closeform.motion.arc import PUSH as ARC_PUSH
from closeform.motion.arc import STATE as ARC_STATE
from closeform.motion.arc import THRUST as ARC_THRUST
from closeform.motion.certified_march import locate
from closeform.motion.chief.bernstein import PRODUCT, SQUARE, TERMS, cut, keep_piece, value_at, weights
from closeform.motion.chief.clock import RATE, angle_at, pace, time_at
from closeform.motion.chief.table import COLUMNS, COSTATE, PUSH
from closeform.motion.linear import solve
from closeform.motion.quadrature import integral

BEGIN, FINISH, FIRST, LAST, WINDOW, ORIGIN, COLUMN = 0, 1, 2, 3, 4, 5, 6
SEGMENT = COLUMN + COLUMNS  # floats of a segment
TABLE = types.Tuple((float64[::1], float64[::1], float64, float64[:, :, :, ::1], float64[:, :, ::1]))
ON_JOINT = 1e-14  # [rad]: an arc that begins so close before a joint begins with the window after it


@kernel()
def joint(joints, turn, k, turns):
    """Return the angle of joint k after so many turns: one number for the end and the beginning of a turn."""
    if turn > 0.0 and k + 1 == len(joints):
        k, turns = 0, turns + 1.0
    return turn * turns + joints[k]


@kernel()
def window_at(joints, turn, s):
    """Return the window that contains an angle, and the number of earlier revolutions of the table."""
    turns = floor((s + ON_JOINT - joints[0]) / turn) if turn > 0.0 else 0.0
    low, high = 0, len(joints) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if joint(joints, turn, middle, turns) <= s + ON_JOINT:
            low = middle
        else:
            high = middle
    return low, turns


@kernel()
def share(joints, k, origin, s):
    """Return u, the place of an angle in its window, in [0, 1]."""
    return min(max((s - origin) / (joints[k + 1] - joints[k]), 0.0), 1.0)


@kernel()
def columns_in(row):
    """Return the number of columns of a segment that are not all zero."""
    for j in range(COSTATE, COLUMNS):
        if row[COLUMN + j] != 0.0:
            return COLUMNS
    return COSTATE


@kernel()
def columns_at(rows, k, u, z, out, basis):
    """Fill `out` (15,) with the columns at u of window k, from those at its beginning."""
    weights(u, basis)
    for i in range(6):
        out[i] = 0.0
        out[COSTATE + i] = 0.0
    for j in range(COLUMNS):
        if z[j] == 0.0:
            continue
        for i in range(6):
            total = 0.0
            for b in range(TERMS):
                total += basis[b] * rows[k, j, i, b]
            out[i] += total * z[j]
            if COSTATE <= j < PUSH:
                total = 0.0
                for b in range(TERMS):
                    total += basis[b] * rows[k, j - COSTATE, i, b]
                out[COSTATE + i] += total * z[j]
    for i in range(PUSH, COLUMNS):
        out[i] = z[i]


@kernel()
def blocks_at(rows, k, u, flow, response, basis):
    """Fill `flow` (6, 6), Phi, and `response` (6, 9), [R, G], at u of window k."""
    weights(u, basis)
    for j in range(COLUMNS):
        for i in range(6):
            total = 0.0
            for b in range(TERMS):
                total += basis[b] * rows[k, j, i, b]
            if j < COSTATE:
                flow[i, j] = total
            else:
                response[i, j - COSTATE] = total


@kernel()
def solve_all(matrix, rhs, work):
    """Replace the columns of `rhs` (6, C) by solutions of the equations of `matrix` (6, 6)."""
    column = work[6]
    for c in range(rhs.shape[1]):
        for i in range(6):
            column[i] = rhs[i, c]
            for j in range(6):
                work[i, j] = matrix[i, j]
        solve(work, column, 6)
        for i in range(6):
            rhs[i, c] = column[i]


@kernel()
def back(rows, k, u, z, out, space):
    """Fill `out` (15,) with the columns at the beginning of window k, from those at u."""
    flow, response, ends, work, basis = space
    blocks_at(rows, k, u, flow, response, basis)
    for i in range(6):
        ends[i, 0] = z[COSTATE + i]
    solve_all(flow, ends[:, :1], work)
    for i in range(6):
        out[COSTATE + i] = ends[i, 0]
    for i in range(PUSH, COLUMNS):
        out[i] = z[i]
    for i in range(6):
        ends[i, 0] = z[i]
        for j in range(9):
            ends[i, 0] -= response[i, j] * out[COSTATE + j]
    solve_all(flow, ends[:, :1], work)
    for i in range(6):
        out[i] = ends[i, 0]


@kernel()
def work_space():
    """Return the arrays that `back` works in."""
    return np.empty((6, 6)), np.empty((6, 9)), np.empty((6, 1)), np.empty((7, 6)), np.empty(TERMS)


@kernel()
def advance(steps, k, z, out):
    """Fill `out` (15,) with the columns at the end of window k."""
    for i in range(COLUMNS):
        total = 0.0
        for j in range(COLUMNS):
            total += steps[k, i, j] * z[j]
        out[i] = total


@kernel()
def load(arc, rate, z):
    """Fill `z` (15,) with the columns of an arc at its start."""
    for i in range(3):
        z[i] = arc[ARC_STATE + i]
        z[3 + i] = arc[ARC_STATE + 3 + i] / rate
        z[COSTATE + i] = arc[ARC_THRUST + i] / rate**2
        z[COSTATE + 3 + i] = arc[ARC_THRUST + 3 + i] / rate**3
        z[PUSH + i] = arc[ARC_PUSH + i] / rate**2


@kernel(int64(TABLE, float64[:, ::1], int64[::1], float64[:, ::1], int64[::1]))
def unroll(table, arcs, offsets, segments, firsts):
    """Fill `segments` of all arcs, and the index of the first of each path; return their number.

    Only as many as there is space for are filled.
    """
    clock, joints, turn, rows, steps = table
    z, after, space = np.empty(COLUMNS), np.empty(COLUMNS), work_space()
    count = 0
    for p in range(len(offsets) - 1):
        firsts[p] = count
        for a in range(offsets[p], offsets[p + 1]):
            arc = arcs[a]
            s, last = angle_at(clock, arc[START]), angle_at(clock, arc[END])
            k, turns = window_at(joints, turn, s)
            origin = joint(joints, turn, k, turns)
            fills = count < len(segments)
            if fills:
                load(arc, clock[RATE], after)
                u = share(joints, k, origin, s)
                if u > 0.0:
                    back(rows, k, u, after, z, space)
                else:
                    z[:] = after
            t = arc[START]
            while True:
                end = joint(joints, turn, k + 1, turns)
                over = end + ON_JOINT >= last or (turn == 0.0 and k + 2 == len(joints))
                if over:
                    end = last
                until = arc[END] if over else time_at(clock, end)
                if count < len(segments):
                    row = segments[count]
                    row[BEGIN], row[FINISH], row[FIRST], row[LAST] = t, until, s, end
                    row[WINDOW], row[ORIGIN] = k, origin
                    row[COLUMN:] = z
                count += 1
                if over:
                    break
                if fills:
                    advance(steps, k, z, after)
                    z, after = after, z
                s, t = end, until
                k += 1
                origin = end
                if k + 1 == len(joints):
                    k, turns = 0, turns + 1.0
    firsts[len(offsets) - 1] = count
    return count


@kernel(void(TABLE, float64[:, ::1], int64[::1], float64[:, ::1], float64[:, :, ::1]))
def evaluate(table, segments, firsts, times, out):
    """Fill `out` with states, or with thrusts if it has three columns.

    `times` has one row for all paths or one for each.
    """
    clock, joints, turn, rows, steps = table
    rate = clock[RATE]
    values, basis = np.empty(COLUMNS), np.empty(TERMS)
    for p in range(len(firsts) - 1):
        for m in range(times.shape[1]):
            t = times[p if len(times) > 1 else 0, m]
            row = segments[locate(segments, firsts[p], firsts[p + 1], t)]
            t = min(max(t, row[BEGIN]), segments[firsts[p + 1] - 1, FINISH])
            k = int(row[WINDOW])
            u = share(joints, k, row[ORIGIN], angle_at(clock, t))
            columns_at(rows, k, u, row[COLUMN:], values, basis)
            for i in range(3):
                if out.shape[2] == 6:
                    out[p, m, i], out[p, m, 3 + i] = values[i], values[3 + i] * rate
                else:
                    out[p, m, i] = (values[COSTATE + i] + values[PUSH + i]) * rate**2


@kernel()
def compose(flow, response, whole, answer, work):
    """Replace `whole` (6, 6) and `answer` (6, 9) by those with `flow` and `response` after them."""
    for i in range(6):
        for j in range(9):
            total = response[i, j] if j >= 6 else 0.0
            for m in range(6):
                total += flow[i, m] * answer[m, j]
                if j < 6:
                    total += response[i, m] * whole[m, j]
            work[i, j] = total
    for j in range(9):
        for i in range(6):
            answer[i, j] = work[i, j]
    for i in range(6):
        for j in range(6):
            total = 0.0
            for m in range(6):
                total += flow[i, m] * whole[m, j]
            work[i, j] = total
    for j in range(6):
        for i in range(6):
            whole[i, j] = work[i, j]


@kernel(void(TABLE, float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1]))
def flows(table, spans, wholes, answers):
    """Fill `wholes` (P, 6, 6), Phi, and `answers` (P, 6, 9), [R, G], over time spans (P, 2).

    The second time of a span is not before the first.
    """
    clock, joints, turn, rows, steps = table
    flow, response, basis, work = np.empty((6, 6)), np.empty((6, 9)), np.empty(TERMS), np.empty((7, 9))
    inverse = np.empty((6, 6))
    for p in range(len(spans)):
        start, last = angle_at(clock, spans[p, 0]), angle_at(clock, spans[p, 1])
        whole, answer = wholes[p], answers[p]
        k, turns = window_at(joints, turn, start)
        origin = joint(joints, turn, k, turns)
        blocks_at(rows, k, share(joints, k, origin, start), flow, response, basis)
        for i in range(6):
            for j in range(6):
                inverse[i, j] = 1.0 if i == j else 0.0
        solve_all(flow, inverse, work)
        for i in range(6):  # back to the beginning of the window
            for j in range(9):
                total = 0.0
                for m in range(6):
                    total -= inverse[i, m] * response[m, j]
                work[i, j] = total
        for i in range(6):
            for j in range(9):
                total = work[i, j] if j >= 6 else 0.0
                if j < 6:
                    whole[i, j] = inverse[i, j]
                    for m in range(6):
                        total += work[i, m] * inverse[m, j]
                answer[i, j] = total
        while True:
            end = joint(joints, turn, k + 1, turns)
            if end + ON_JOINT >= last or (turn == 0.0 and k + 2 == len(joints)):
                break
            compose(steps[k, :6, :6], steps[k, :6, 6:], whole, answer, work)
            k += 1
            origin = end
            if k + 1 == len(joints):
                k, turns = 0, turns + 1.0
        blocks_at(rows, k, share(joints, k, origin, last), flow, response, basis)
        compose(flow, response, whole, answer, work)


@kernel()
def thrust_polynomial(rows, row, c):
    """Fill `c` (3, TERMS) with the coefficients of a segment's thrust, in its whole window."""
    k = int(row[WINDOW])
    for axis in range(3):
        for b in range(TERMS):
            total = row[COLUMN + PUSH + axis]
            for j in range(6):
                total += row[COLUMN + COSTATE + j] * rows[k, j, axis, b]
            c[axis, b] = total


DEEPEST = 40  # pieces in work of a polynomial that is almost constant near its maximum


@kernel()
def squared(c, f):
    """Fill `f` (SQUARE,) with the coefficients of |c|^2."""
    for j in range(SQUARE):
        f[j] = 0.0
    for i in range(TERMS):
        x, y, z = c[0, i], c[1, i], c[2, i]
        f[2 * i] += PRODUCT[i, i] * (x * x + y * y + z * z)
        x, y, z = 2.0 * x, 2.0 * y, 2.0 * z
        for j in range(i + 1, TERMS):
            f[i + j] += PRODUCT[i, j] * (x * c[0, j] + y * c[1, j] + z * c[2, j])


@kernel()
def highest(c, stack, least):
    """Return the largest norm over [0, 1] of polynomials `c` (3, TERMS), if above `least`, else that.

    It is accurate to a relative 1e-12. `stack` (DEEPEST, SQUARE) is room for pieces of the square.
    """
    squared(c, stack[0])
    best, depth = max(least * least, stack[0, 0], stack[0, SQUARE - 1]), 0
    while depth >= 0:
        piece = stack[depth]
        most = 0.0
        for j in range(SQUARE):
            most = max(most, piece[j])
        if most <= best * (1.0 + 1e-12) or depth + 1 == DEEPEST:
            depth -= 1
            continue
        cut(piece, SQUARE, 0.5, stack[depth + 1])
        best = max(best, piece[0])
        depth += 1
    return sqrt(best)


@kernel()
def sampled(scene, s):
    """Return |thrust|^power dt/ds at an angle."""
    clock, c, origin, length, power = scene
    u = (s - origin) / length
    total = 0.0
    for axis in range(3):
        value = value_at(c[axis], TERMS, u)[0]
        total += value * value
    return (total if power == 2 else sqrt(total)) * pace(clock, s)


ENERGY, DELTA_V, PEAK = 0, 1, 2


@kernel(void(TABLE, float64[:, ::1], int64[::1], int64, float64[::1]))
def totals(table, segments, firsts, what, out):
    """Fill `out` with energy, delta-v or peak thrust of each path, without impulses."""
    clock, joints, turn, rows, steps = table
    rate = clock[RATE]
    c, left, stack = np.empty((3, TERMS)), np.empty(TERMS), np.empty((DEEPEST, SQUARE))
    for p in range(len(firsts) - 1):
        total = 0.0
        for q in range(firsts[p], firsts[p + 1]):
            row = segments[q]
            if not row[LAST] > row[FIRST] or columns_in(row) == COSTATE:
                continue
            k = int(row[WINDOW])
            thrust_polynomial(rows, row, c)
            length = joints[k + 1] - joints[k]
            if what != PEAK:
                power = 2 if what == ENERGY else 1
                scene = clock, c, row[ORIGIN], length, power
                total += integral(sampled, scene, row[FIRST], row[LAST]) / power
            else:
                low, high = (
                    share(joints, k, row[ORIGIN], row[FIRST]),
                    share(joints, k, row[ORIGIN], row[LAST]),
                )
                for axis in range(3):
                    keep_piece(c[axis], low, high, left)
                total = highest(c, stack, total)
        out[p] = total * (rate**3 if what == ENERGY else (rate if what == DELTA_V else rate**2))
