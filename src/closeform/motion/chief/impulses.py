"""Minimum-delta-v impulses about any chief: Lawden's primer by its dual in six unknowns, certified.

    maximise   g . c   subject to   |p(t)| <= 1 at all times,   p(t) = rows(t) c           # theory (27, 29)

Rows are polynomials in each window, so the maxima of |p| over all times are found by hulls and Descartes'
rule, and g . c over the largest |p| is a lower bound on the delta-v of any thrust.  A barrier on a grid of
times finds c approximately, and Newton's method on the maxima converges, as in `motion.impulses`; where it
does not, the maxima join the grid.  Impulses along p at the maxima, corrected so that they make the transfer,
are a plan; the gap between its cost and the bound is valid however it was found.

`rows` (W, 3, 6, 12) are those of any linear system with bounded |p|: of the transition matrix, or of the
sensitivities of relative orbital elements.
"""

from math import inf, sqrt

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.motion.chief.bernstein import DEGREE, SQUARE, TERMS, changes, cut, value_at, weights
from closeform.motion.chief.segments import FIRST as FIRST_ANGLE
from closeform.motion.chief.segments import LAST as LAST_ANGLE
from closeform.motion.chief.segments import ORIGIN, TABLE, WINDOW, share, squared
from closeform.motion.linear import back_substitute, dot, factorise
from closeform.motion.minimum_delta_v.barrier import ROWS, SLACK, SQUARES, TIME, WIDTH, climb, overlap
from closeform.motion.minimum_delta_v.nonnegative import MOST, left_over, nonnegative
from closeform.motion.minimum_delta_v.reduced import half_solve, independent

# Columns of an answer: bounds, the number of impulses, 1 if the optimal plan is unique, the primer where the
# first window begins, and of each impulse its window, its place in that, and its velocity.
LOWER, UPPER, COUNT, UNIQUE, PRIMER, FIRST = 0, 1, 2, 3, 4, 10
ANSWER = FIRST + 5 * MOST
SPACING = 4  # times of the first grid in a window
ROOM = 8  # places of a window among which impulses are chosen
ROUNDS, NEWTON = 12, 20
GAP, CLOSER = 3e-3, 0.05  # gap of the barrier at first, and its factor each time
ENOUGH, FINAL = 1e-10, 1e-12  # gaps at which no round, and no step of Newton's method, follows
TOUCHING = 0.8  # |p| from which a maximum can become active
SPARING = 0.1  # cost of a weight where |p| is below 1
ENDS_THERE = 1e-11  # share of the required change that a plan may leave
REACH = 0.5  # longest step of Newton's method, as a share of |y|
RIDGE = 1e-10  # share of the curvature that is added to it
FALLS = 1e-14  # relative decrease of the bound that counts as rounding
DEPTH = 50  # of pieces in work
NARROWEST = 1e-9  # of a window: a shorter piece in which |p| is flat to rounding is one maximum


@kernel()
def rows_at(rows, w, u, basis, out):
    """Fill `out` (18,) with the rows at u of window w."""
    weights(u, basis)
    for axis in range(3):
        for i in range(6):
            total = 0.0
            for b in range(TERMS):
                total += basis[b] * rows[w, axis, i, b]
            out[6 * axis + i] = total


@kernel(void(TABLE, float64[:, ::1], float64[:, :, :, ::1], float64[:, ::1]))
def primer_rows(table, segments, rows, whole):
    """Fill `rows` (W, 3, 6, 12) with those of the transition matrix from where the first window begins.

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
        for axis in range(3):
            for i in range(6):
                for b in range(TERMS):
                    total = 0.0
                    for m in range(6):
                        total += of_table[k, m, axis, b] * whole[m, i]
                    rows[w, axis, i, b] = total
                if high < 1.0:
                    cut(rows[w, axis, i], TERMS, high, spare)
                    for b in range(TERMS):
                        rows[w, axis, i, b] = spare[b]
                if low > 0.0:
                    cut(rows[w, axis, i], TERMS, low / high if high > 0.0 else 0.0, spare)
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
def lay(rows, w, u, basis, spare, table, k):
    """Fill row k of the barrier's grid, for u of window w; its time is w + u."""
    rows_at(rows, w, u, basis, spare)
    table[k, TIME] = w + u
    for i in range(18):
        table[k, ROWS + i] = spare[i]
    q = SQUARES
    for i in range(6):
        for j in range(i, 6):
            table[k, q] = overlap(spare, i, j)
            q += 1


@kernel()
def scale_rows(rows, g, metric, basis, spare):
    """Replace rows and g by those of y with c = metric y, so that |y|^2 is the mean of |p|^2."""
    mean, count = np.zeros((6, 6)), SPACING * len(rows)
    for w in range(len(rows)):
        for k in range(SPACING):
            rows_at(rows, w, k / (SPACING - 1.0), basis, spare)
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
def maxima(rows, y, places, squares, c, stack, ends):
    """Fill in the local maxima of |p|^2 from TOUCHING^2 on; return how many, and a bound over all times."""
    floor, count, slopes = TOUCHING * TOUCHING, 0, np.empty(SQUARE)
    most, last, rose = floor, 0.0, False
    for w in range(len(rows)):
        for axis in range(3):
            for b in range(TERMS):
                total = 0.0
                for i in range(6):
                    total += rows[w, axis, i, b] * y[i]
                c[axis, b] = total
        squared(c, stack[0])
        top, begin = 0, 0.0
        ends[0] = 1.0
        first, last = stack[0, 0], stack[0, SQUARE - 1]
        most = max(most, first, last)
        if first >= floor and stack[0, 1] <= first and (w == 0 or rose):
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
    if last >= floor and rose:
        count = note(places, squares, count, len(rows) + 0.0, last)
    return count, most


@kernel()
def place_of(rows, place):
    """Return the window and the place in it of a maximum."""
    w = min(int(place), len(rows) - 1)
    return w, min(max(place - w, 0.0), 1.0)


@kernel()
def along(rows, place, y, basis, spare, column):
    """Fill `column` (9,) with rows' p followed by p, and `spare` with the rows; return |p|."""
    w, u = place_of(rows, place)
    rows_at(rows, w, u, basis, spare)
    for i in range(6):
        column[i] = 0.0
    square = 0.0
    for axis in range(3):
        p = 0.0
        for i in range(6):
            p += spare[6 * axis + i] * y[i]
        for i in range(6):
            column[i] += p * spare[6 * axis + i]
        column[6 + axis] = p
        square += p * p
    return sqrt(square)


@kernel()
def keep_plan(rows, y, g, places, weights_of, active, count, basis, spare, answer):
    """Correct impulses of these weights along p so that they make the transfer; keep them if cheaper."""
    rest, aim, normal, columns = np.empty(6), y.copy(), np.zeros((6, 6)), np.empty((MOST, 9))
    trace, total = 0.0, 0.0
    for turn in range(4):
        total = 0.0
        for i in range(6):
            rest[i] = g[i]
        for a in range(count):
            column, weight = columns[a], weights_of[active[a]]
            total += weight * along(rows, places[active[a]], aim, basis, spare, column)
            for i in range(6):
                rest[i] -= weight * column[i]
                if turn == 0:
                    for j in range(i, 6):
                        normal[i, j] += weight * overlap(spare, i, j)
        if turn == 3:
            break
        if turn == 0:
            for i in range(6):
                trace += normal[i, i]
            for i in range(6):
                normal[i, i] += 1e-14 * trace
            factorise(normal, 6)
        back_substitute(normal, rest, 6)
        for i in range(6):
            aim[i] += rest[i]
    if dot(rest, rest) <= ENDS_THERE * ENDS_THERE * dot(g, g) and total < answer[UPPER]:
        answer[UPPER], answer[COUNT] = total, count
        for a in range(count):
            w, u = place_of(rows, places[active[a]])
            at = FIRST + 5 * a
            answer[at], answer[at + 1] = w, u
            for axis in range(3):
                answer[at + 2 + axis] = weights_of[active[a]] * columns[a, 6 + axis]


@kernel()
def add_curvature(rows, place, y, weight, basis, spare, curvature):
    """Add `weight` times the Hessian of theory (30) at a maximum of |p|, upper half."""
    w, u = place_of(rows, place)
    rates, b, bend = np.empty(18), np.zeros(6), 0.0
    twice, c = np.empty(TERMS), np.empty(TERMS)
    for axis in range(3):
        for k in range(TERMS):
            c[k] = 0.0
            for i in range(6):
                c[k] += rows[w, axis, i, k] * y[i]
        for k in range(TERMS - 2):
            twice[k] = DEGREE * (DEGREE - 1.0) * (c[k + 2] - 2.0 * c[k + 1] + c[k])
        p, rate = value_at(c, TERMS, u)
        bend += rate * rate + p * value_at(twice, TERMS - 2, u)[0]
        for i in range(6):
            value, slope = value_at(rows[w, axis, i], TERMS, u)
            spare[6 * axis + i], rates[6 * axis + i] = value, slope
            b[i] += slope * p + value * rate
    moves = weight / max(-bend, 1e-9) if 0.0 < place < len(rows) and bend < 0.0 else 0.0
    for i in range(6):
        for j in range(i, 6):
            curvature[i, j] += weight * overlap(spare, i, j) + moves * b[i] * b[j]


@kernel()
def keep_bound(answer, metric, y, worth):
    """Keep a primer that proves a higher bound."""
    if worth > answer[LOWER]:
        answer[LOWER] = worth
        for i in range(6):
            answer[PRIMER + i] = 0.0
            for j in range(i, 6):
                answer[PRIMER + i] += metric[i, j] * y[j]


@kernel()
def newton(rows, g, metric, y, found, work, answer):
    """Run Newton's method on the local maxima of |p|, theory (30); return how many there are.

    A step that lowers the bound is halved: where |p| is nearly constant maxima move far and vanish.
    """
    places, squares, costs, pushes, columns, bent, active = found
    c, stack, ends, basis, spare = work
    ahead, step, last, curvature = np.empty(6), np.empty(6), np.empty(6), np.empty((6, 6))
    count, part, proved = 0, 0.0, 0.0
    for _ in range(NEWTON):
        count, most = maxima(rows, y, places, squares, c, stack, ends)
        if count == 0:
            break
        scale = 1.0 / sqrt(most)
        for i in range(6):
            y[i] *= scale
        keep_bound(answer, metric, y, dot(g, y))
        if dot(g, y) < (1.0 - FALLS) * proved:
            part *= 0.5
            for i in range(6):
                y[i] = last[i] + part * step[i]
            continue
        proved = dot(g, y)
        for k in range(count):
            along(rows, places[k], y, basis, spare, columns[k])
            costs[k] = 0.0
        chosen = nonnegative(columns, count, g, costs, pushes, active)
        keep_plan(rows, y, g, places, pushes, active, chosen, basis, spare, answer)
        if answer[UPPER] - answer[LOWER] <= FINAL * answer[LOWER]:
            answer[UNIQUE] = 1.0 * independent(columns, squares, count, most, active)
            break
        trace = 0.0
        for i in range(6):
            for j in range(6):
                curvature[i, j] = 0.0
        for a in range(chosen):
            add_curvature(rows, places[active[a]], y, pushes[active[a]], basis, spare, curvature)
        for i in range(6):
            trace += curvature[i, i]
        for i in range(6):
            curvature[i, i] += RIDGE * trace
        factorise(curvature, 6)
        half_solve(curvature, g, ahead)
        for k in range(count):
            half_solve(curvature, columns[k], bent[k])
            costs[k] = 0.5 * (1.0 - squares[k] * scale * scale)
        chosen = nonnegative(bent, count, ahead, costs, pushes, active)
        left_over(columns, g, pushes, active, chosen, step)
        back_substitute(curvature, step, 6)
        long = dot(step, step)
        part = min(1.0, REACH * sqrt(dot(y, y) / long)) if long > 0.0 else 0.0
        for i in range(6):
            last[i] = y[i]
            y[i] += part * step[i]
    return count


@kernel()
def widen(rows, places, count, basis, spare, table, grid):
    """Add places to the barrier's grid that are not yet on it; return its size."""
    for k in range(count):
        on = grid == len(table)
        for j in range(grid):
            on = on or abs(table[j, TIME] - places[k]) < 1e-9
        if not on:
            w, u = place_of(rows, places[k])
            lay(rows, w, u, basis, spare, table, grid)
            grid += 1
    return grid


@kernel(int64(float64[:, :, :, ::1], float64[::1], float64[::1]))
def least_impulses(rows, g, answer):
    """Fill `answer` (40,) for a required change g (6,) of length one; rows and g are overwritten.

    Returns the number of rounds.
    """
    basis, spare, metric, y, near = np.empty(TERMS), np.empty(18), np.empty((6, 6)), np.zeros(6), np.empty(6)
    scale_rows(rows, g, metric, basis, spare)
    grid = (SPACING - 1) * len(rows) + 1
    table, size = np.empty((grid + 2 * ROUNDS * (8 + len(rows)), WIDTH)), ROOM * len(rows) + 8
    places, squares, costs, pushes = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    columns, bent, active = np.empty((size, 9)), np.empty((size, 9)), np.empty(MOST, dtype=np.int64)
    found = places, squares, costs, pushes, columns, bent, active
    c, stack, ends = np.empty((3, TERMS)), np.empty((DEPTH, SQUARE)), np.empty(DEPTH)
    work = c, stack, ends, basis, spare
    for k in range(grid):
        w, u = place_of(rows, k / (SPACING - 1.0))
        lay(rows, w, u, basis, spare, table, k)
    answer[LOWER], answer[UPPER], answer[UNIQUE] = 0.0, inf, 1.0
    gap, weight = GAP, sqrt(2.0 * grid / dot(g, g))
    for turn in range(ROUNDS):
        weight = climb(table, grid, g, y, gap, weight)
        if turn:
            for k in range(min(grid, size)):
                places[k], costs[k] = table[k, TIME], SPARING * table[k, SLACK]
                along(rows, places[k], y, basis, spare, columns[k])
            chosen = nonnegative(columns, min(grid, size), g, costs, pushes, active)
            keep_plan(rows, y, g, places, pushes, active, chosen, basis, spare, answer)
        for i in range(6):
            near[i] = y[i]
        count, most = maxima(rows, y, places, squares, c, stack, ends)
        for i in range(6):
            y[i] *= 0.999 / sqrt(most)
        grid = widen(rows, places, count, basis, spare, table, grid)
        count = newton(rows, g, metric, near, found, work, answer)
        if answer[UPPER] - answer[LOWER] <= ENOUGH * answer[LOWER]:
            return turn + 1
        grid = widen(rows, places, count, basis, spare, table, grid)
        gap *= CLOSER
    return ROUNDS


def solve(rows: Floats, change: Floats) -> Floats:
    """Return the answer (40,) for a change (6,) of the functional, of any size."""
    answer, size = np.zeros(ANSWER), float(np.linalg.norm(change))
    answer[UNIQUE] = 1.0
    if size == 0.0:
        return answer
    least_impulses(np.ascontiguousarray(rows), change / size, answer)
    answer[[LOWER, UPPER]] *= size
    answer[LOWER] = min(answer[LOWER], answer[UPPER])  # a plan may leave 1e-11 of the change
    impulses = answer[FIRST:].reshape(MOST, 5)[: int(answer[COUNT])]
    impulses[:, 2:] *= size
    impulses[:] = impulses[np.lexsort((impulses[:, 1], impulses[:, 0]))]
    return answer
