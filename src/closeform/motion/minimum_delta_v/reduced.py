"""Impulses of minimum delta-v of any linear motion: the primer's program by a barrier and Newton's method.

The program of `impulses` requires |p| <= 1 at every time; it is reduced to the local maxima of |p|, whose
times move with y, p = B(t) y:

    maximise g . y  subject to  phi_k(y) = |p(t_k(y))|^2 / 2 <= 1/2
    grad phi_k = B'p,   Hess phi_k = B'B + b b' / |phi''|,   b = d/dt (B'p)                      # theory (30)

The multipliers of its quadratic program are the sizes of the impulses, along p.  A barrier on a grid of times
finds an approximation, and Newton's method converges on the local maxima.  Where that stalls the maxima join
the grid and the barrier continues.  The gap between bound and cost is valid however a plan was found.

Three kernels that read a `scene` describe the primer, over times from 0 to `end`:

    rows_at(scene, t, rows)              B(t), as 18 numbers
    bend_at(scene, t, y, rows, rates)    B(t) and its rate; returns phi''
    maxima(scene, y, times, squares)     the local maxima of |p|^2; returns their number and a certified bound

The primer's start is c = metric y with an upper triangular `metric` (6, 6).
"""

from math import sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.linear import back_substitute, dot, factorise
from closeform.motion.minimum_delta_v.barrier import ROWS, SLACK, SQUARES, TIME, climb, overlap
from closeform.motion.minimum_delta_v.nonnegative import MOST, left_over, nonnegative

# Columns of an answer: bounds of delta-v, the number of impulses, 1 if the optimal plan is unique, the
# primer at the start, and for each impulse its time and velocity.
LOWER, UPPER, COUNT, UNIQUE, PRIMER, FIRST = 0, 1, 2, 3, 4, 10
ANSWER = FIRST + 4 * MOST
GAP = 1e-12  # relative gap at which an answer is final
NEWTON, ROUNDS = 20, 12  # steps of Newton's method, and rounds of it and the barrier
NEAR, CLOSER = 3e-3, 0.05  # gap to which the barrier is solved at first, and its factor each time
ENOUGH = 1e-10  # gap at which no round follows
SPARING = 0.1  # cost of a weight where |p| is below 1
TOUCHES = 1e-9  # relative distance of |p|^2 from 1 that counts as 1
TOUCHING = 0.8  # |p| from which a maximum can become active
ENDS_THERE = 1e-11  # share of the required change that a plan may leave
REACH = 0.5  # longest step of Newton's method, as a share of |y|
RIDGE = 1e-10  # share of the mean curvature that is added to it
FALLS = 1e-14  # relative decrease of the bound that counts as rounding


@kernel()
def keep_plan(rows_at, scene, y, g, times, weights, active, count, answer):
    """Correct impulses of these weights along p to achieve the transfer; keep them if they cost less."""
    rows, rest, aim = stack_vector(18), stack_vector(6), stack_vector(6)
    normal, columns = stack_matrix(6, 6), stack_matrix(MOST, 9)
    trace, total = 0.0, 0.0
    for i in range(6):
        aim[i] = y[i]
        for j in range(6):
            normal[i, j] = 0.0
    for turn in range(4):
        total = 0.0
        for i in range(6):
            rest[i] = g[i]
        for a in range(count):
            column, weight = columns[a], weights[active[a]]
            total += weight * along(rows_at, scene, times[active[a]], aim, rows, column)
            for i in range(6):
                rest[i] -= weight * column[i]
                if turn == 0:
                    for j in range(i, 6):
                        normal[i, j] += weight * overlap(rows, i, j)
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
            answer[FIRST + 4 * a] = times[active[a]]
            for axis in range(3):
                answer[FIRST + 4 * a + 1 + axis] = weights[active[a]] * columns[a, 6 + axis]


@kernel()
def natural(metric, y, c):
    """Fill `c` (6,), the start of the primer of y."""
    for i in range(6):
        c[i] = 0.0
        for j in range(i, 6):
            c[i] += metric[i, j] * y[j]


@kernel()
def keep_bound(answer, c, worth):
    """Keep a primer that proves a higher bound."""
    if worth > answer[LOWER]:
        answer[LOWER] = worth
        for k in range(6):
            answer[PRIMER + k] = c[k]


@kernel()
def along(rows_at, scene, t, y, rows, column):
    """Fill `rows` (18,) at time t and `column` (9,) with B'p followed by p; return |p|."""
    square = 0.0
    rows_at(scene, t, rows)
    for i in range(6):
        column[i] = 0.0
    for axis in range(3):
        p = 0.0
        for i in range(6):
            p += rows[6 * axis + i] * y[i]
        for i in range(6):
            column[i] += p * rows[6 * axis + i]
        column[6 + axis] = p
        square += p * p
    return sqrt(square)


@kernel()
def weigh(rows_at, scene, y, g, times, size, columns, costs, weights, active, answer):
    """Fill `columns` with B'p at these times, weigh them and keep the plan.

    Returns the number of positive weights.
    """
    rows = stack_vector(18)
    for k in range(size):
        along(rows_at, scene, times[k], y, rows, columns[k])
    count = nonnegative(columns, size, g, costs, weights, active)
    keep_plan(rows_at, scene, y, g, times, weights, active, count, answer)
    return count


@kernel()
def add_curvature(bend_at, scene, end, t, y, weight, curvature):
    """Add `weight` times the Hessian of theory (30) at a maximum, upper half."""
    rows, rates, b = stack_vector(18), stack_vector(18), stack_vector(6)
    bend = bend_at(scene, t, y, rows, rates)
    for i in range(6):
        b[i] = 0.0
    for axis in range(3):
        p, rate = 0.0, 0.0
        for i in range(6):
            p += rows[6 * axis + i] * y[i]
            rate += rates[6 * axis + i] * y[i]
        for i in range(6):
            b[i] += rates[6 * axis + i] * p + rows[6 * axis + i] * rate
    moves = weight / max(-bend, 1e-9) if 0.0 < t < end and bend < 0.0 else 0.0
    for i in range(6):
        for j in range(i, 6):
            curvature[i, j] += weight * overlap(rows, i, j) + moves * b[i] * b[j]


@kernel()
def independent(columns, squares, size, highest, active):
    """Return True if the columns where |p| is largest are independent, so that the plan is unique."""
    gram, whole, count = stack_matrix(MOST, MOST), stack_vector(MOST), 0
    for k in range(size):
        if squares[k] >= (1.0 - TOUCHES) * highest:
            if count == MOST:
                return False
            active[count] = k
            count += 1
    for a in range(count):
        for b in range(a, count):
            gram[a, b] = dot(columns[active[a]], columns[active[b]])
        whole[a] = gram[a, a]
    factorise(gram, count)  # the diagonal keeps the part of a column that is independent of the earlier ones
    alone = True
    for a in range(count):
        alone = alone and gram[a, a] > TOUCHES * whole[a]
    return alone


@kernel()
def newton(rows_at, bend_at, maxima, scene, end, metric, g, y, work, answer):
    """Run Newton's method on the local maxima of |p|; `answer` receives the best bound and plan.

    A step that lowers the bound is halved: where |p| is nearly constant maxima move far and vanish.
    """
    times, squares, columns, bent, costs, weights, active = work
    c, ahead, step, last = stack_vector(6), stack_vector(6), stack_vector(6), stack_vector(6)
    curvature = stack_matrix(6, 6)
    size, share, proved = 0, 0.0, 0.0
    for _ in range(NEWTON):
        size, highest = maxima(scene, y, times, squares)
        if size == 0:
            break
        scale = 1.0 / sqrt(highest)
        for i in range(6):
            y[i] *= scale
        natural(metric, y, c)
        keep_bound(answer, c, dot(g, y))
        if dot(g, y) < (1.0 - FALLS) * proved:
            share *= 0.5
            for i in range(6):
                y[i] = last[i] + share * step[i]
            continue
        proved = dot(g, y)
        for k in range(size):
            costs[k] = SPARING * max(1.0 - sqrt(squares[k]) * scale, 0.0)
        count = weigh(rows_at, scene, y, g, times, size, columns, costs, weights, active, answer)
        if answer[UPPER] - answer[LOWER] <= GAP * answer[LOWER]:
            answer[UNIQUE] = 1.0 * independent(columns, squares, size, highest, active)
            break
        trace = 0.0
        for i in range(6):
            for j in range(6):
                curvature[i, j] = 0.0
        for a in range(count):
            add_curvature(bend_at, scene, end, times[active[a]], y, weights[active[a]], curvature)
        for i in range(6):
            trace += curvature[i, i]
        for i in range(6):
            curvature[i, i] += RIDGE * trace
        factorise(curvature, 6)
        half_solve(curvature, g, ahead)
        for k in range(size):
            half_solve(curvature, columns[k], bent[k])
            costs[k] = 0.5 * (1.0 - squares[k] * scale * scale)
        count = nonnegative(bent, size, ahead, costs, weights, active)
        left_over(columns, g, weights, active, count, step)
        back_substitute(curvature, step, 6)
        long = dot(step, step)
        share = min(1.0, REACH * sqrt(dot(y, y) / long)) if long > 0.0 else 0.0
        for i in range(6):
            last[i] = y[i]
            y[i] += share * step[i]
    return size


@kernel()
def half_solve(factors, vector, out):
    """Fill `out` with the vector whose length is that of `vector` in the inverse of a factorised matrix."""
    for i in range(6):
        out[i] = vector[i]
    for k in range(6):
        for i in range(k + 1, 6):
            out[i] -= factors[k, i] / factors[k, k] * out[k]
        out[k] /= sqrt(factors[k, k])


@kernel()
def lay(rows_at, scene, t, table, k):
    """Fill row k of the barrier's grid for time t."""
    rows, row = stack_vector(18), table[k]
    rows_at(scene, t, rows)
    row[TIME] = t
    for i in range(18):
        row[ROWS + i] = rows[i]
    q = SQUARES
    for i in range(6):
        for j in range(i, 6):
            row[q] = overlap(rows, i, j)
            q += 1


@kernel()
def widen(rows_at, scene, times, size, table, grid):
    """Add times to the grid that are not yet on it; return its size."""
    for k in range(size):
        on = grid == len(table)
        for j in range(grid):
            on = on or abs(table[j, TIME] - times[k]) < 1e-9
        if not on:
            lay(rows_at, scene, times[k], table, grid)
            grid += 1
    return grid


@kernel()
def improve(rows_at, bend_at, maxima, scene, end, metric, g, table, grid, work, answer):
    """Improve an answer for a required change until its gap is small; `table` holds a grid of times."""
    times, squares, columns, _, costs, weights, active = work
    y, near = stack_vector(6), stack_vector(6)
    for i in range(6):
        y[i] = 0.0
    gap, weight = NEAR, sqrt(2.0 * grid / dot(g, g))
    for turn in range(ROUNDS):
        weight = climb(table, grid, g, y, gap, weight)
        if turn:
            size = min(grid, len(times))
            for k in range(size):
                times[k], costs[k] = table[k, TIME], SPARING * table[k, SLACK]
            weigh(rows_at, scene, y, g, times, size, columns, costs, weights, active, answer)
        for i in range(6):
            near[i] = y[i]
        size, highest = maxima(scene, y, times, squares)
        for i in range(6):
            y[i] *= 0.999 / sqrt(highest)
        grid = widen(rows_at, scene, times, size, table, grid)
        size = newton(rows_at, bend_at, maxima, scene, end, metric, g, near, work, answer)
        if answer[UPPER] - answer[LOWER] <= ENOUGH * answer[LOWER]:
            return
        grid = widen(rows_at, scene, times, size, table, grid)
        gap *= CLOSER
