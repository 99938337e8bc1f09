"""Impulses of minimum delta-v from a nearly optimal primer, by Newton's method on its local maxima.

The program of `impulses` requires |p| <= 1 at every time; it is reduced to the local maxima of |p|, whose
times move with y, p = B(t) y:

    maximise g . y  subject to  phi_k(y) = |p(t_k(y))|^2 / 2 <= 1/2
    grad phi_k = B'p,   Hess phi_k = B'B + b b' / |phi''|,   b = d/dt (B'p)                      # theory (30)

The multipliers of its quadratic program are the sizes of the impulses, along p.
"""

from math import sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.linear import back_substitute, dot, factorise
from closeform.motion.minimum_delta_v.barrier import overlap, through
from closeform.motion.minimum_delta_v.nonnegative import MOST, left_over, nonnegative
from closeform.motion.minimum_delta_v.primer import peaks, position_rows, rate_rows, square_at

# Columns of an answer, in SI: bounds of delta-v, the number of impulses, 1 if the optimal plan is unique, the
# primer over the duration, and for each impulse its time and velocity.
LOWER, UPPER, COUNT, UNIQUE, PRIMER, FIRST = 0, 1, 2, 3, 4, 10
ANSWER = FIRST + 4 * MOST
GAP = 1e-12  # relative gap at which an answer is final
NEWTON = 20
TOUCHES = 1e-9  # relative distance of |p|^2 from 1 that counts as 1
TOUCHING = 0.8  # |p| from which a maximum can become active
ENDS_THERE = 1e-11  # share of the required change that a plan may leave
REACH = 0.5  # longest step of Newton's method, as a share of |y|
RIDGE = 1e-10  # share of the mean curvature that is added to it
FALLS = 1e-14  # relative decrease of the bound that counts as rounding


@kernel()
def keep_plan(n, metric, y, g, times, weights, active, count, answer):
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
            total += weight * along(n, times[active[a]], metric, aim, rows, column)
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
def along(n, t, metric, y, rows, column):
    """Fill `rows` (18,) at time t and `column` (9,) with B'p followed by p; return |p|."""
    psi, square = stack_matrix(3, 6), 0.0
    position_rows(n, t, psi)
    through(psi, metric, rows)
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
def weigh(n, metric, y, g, times, size, columns, costs, weights, active, answer):
    """Fill `columns` with B'p at these times, weigh them and keep the plan.

    Returns the number of positive weights.
    """
    rows = stack_vector(18)
    for k in range(size):
        along(n, times[k], metric, y, rows, columns[k])
    count = nonnegative(columns, size, g, costs, weights, active)
    keep_plan(n, metric, y, g, times, weights, active, count, answer)
    return count


@kernel()
def add_curvature(n, t, metric, y, c, weight, curvature):
    """Add `weight` times the Hessian of theory (30) at a maximum of the primer of start `c`, upper half."""
    psi, rows, rates = stack_matrix(3, 6), stack_vector(18), stack_vector(18)
    column, b = stack_vector(9), stack_vector(6)
    along(n, t, metric, y, rows, column)
    rate_rows(n, t, psi)
    through(psi, metric, rates)
    for i in range(6):
        b[i] = 0.0
    for axis in range(3):
        rate = 0.0
        for i in range(6):
            rate += rates[6 * axis + i] * y[i]
        for i in range(6):
            b[i] += rates[6 * axis + i] * column[6 + axis] + rows[6 * axis + i] * rate
    _, _, bend = square_at(n, c, t)
    moves = weight / max(-bend, 1e-9) if 0.0 < t < 1.0 and bend < 0.0 else 0.0
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
def newton(n, metric, g, y, times, squares, columns, bent, costs, weights, active, answer):
    """Run Newton's method on the local maxima of |p|; `answer` receives the best bound and plan.

    A step that lowers the bound is halved: where |p| is nearly constant maxima move far and vanish.
    """
    c, ahead, step, last = stack_vector(6), stack_vector(6), stack_vector(6), stack_vector(6)
    curvature = stack_matrix(6, 6)
    size, share, proved = 0, 0.0, 0.0
    for _ in range(NEWTON):
        natural(metric, y, c)
        size, highest = peaks(n, 1.0, c, TOUCHING, times, squares)
        if size == 0:
            break
        scale = 1.0 / sqrt(highest)
        for i in range(6):
            c[i] *= scale
            y[i] *= scale
        keep_bound(answer, c, dot(g, y))
        if dot(g, y) < (1.0 - FALLS) * proved:
            share *= 0.5
            for i in range(6):
                y[i] = last[i] + share * step[i]
            continue
        proved = dot(g, y)
        for k in range(size):
            costs[k] = 0.0
        count = weigh(n, metric, y, g, times, size, columns, costs, weights, active, answer)
        if answer[UPPER] - answer[LOWER] <= GAP * answer[LOWER]:
            answer[UNIQUE] = 1.0 * independent(columns, squares, size, highest, active)
            break
        trace = 0.0
        for i in range(6):
            for j in range(6):
                curvature[i, j] = 0.0
        for a in range(count):
            add_curvature(n, times[active[a]], metric, y, c, weights[active[a]], curvature)
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
