"""Impulses from a primer near the best: Newton's method on the local maxima of its length.

The program of `impulses` asks |p| <= 1 at every time; it is reduced to the local maxima of |p|, whose
times move with y, p = B(t) y:

    maximise g . y  subject to  phi_k(y) = |p(t_k(y))|^2 / 2 <= 1/2
    grad phi_k = B'p,   Hess phi_k = B'B + b b' / |phi''|,   b = d/dt (B'p)                      # theory (30)

The multipliers of its quadratic program are the sizes of the impulses, along p.
"""

from math import inf, sqrt

from closeform.compiled import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.barrier import overlap, rows_of
from closeform.motion.linear import back_substitute, factorise
from closeform.motion.nonnegative import MOST, nonnegative
from closeform.motion.primer import peaks, rate_rows

# Columns of an answer, in SI: bounds of delta-v, how many impulses, whether no other plan costs as little,
# the primer over the duration, and for each impulse its time and velocity.
LOWER, UPPER, COUNT, UNIQUE, PRIMER, FIRST = 0, 1, 2, 3, 4, 10
ANSWER = FIRST + 4 * MOST
GAP = 1e-12  # at which an answer is final
NEWTON = 20
TOUCHES = 1e-9  # of |p|^2, by which one that counts as 1 may be below
TOUCHING = 0.8  # |p| from which a maximum can matter
ENDS_THERE = 1e-11  # of what is to be gained, that a plan may leave
REACH = 0.5  # of |y|, for one step of Newton's method
RIDGE = 1e-10  # of the mean curvature, added to it


@kernel()
def fly(n, metric, y, g, times, weights, active, count, answer):
    """Impulses of these weights along p, changed the least that makes the transfer: kept if cheaper."""
    psi, rows, rest, change = stack_matrix(3, 6), stack_vector(18), stack_vector(6), stack_vector(6)
    normal, work, pushes = stack_matrix(6, 6), stack_matrix(6, 6), stack_matrix(MOST, 3)
    trace, size = 0.0, 0.0
    for i in range(6):
        change[i] = 0.0
        size += g[i] * g[i]
        for j in range(6):
            normal[i, j] = 0.0
    for a in range(count):
        rows_of(n, times[int(active[a])], metric, psi, rows)
        weight = weights[int(active[a])]
        for i in range(6):
            for j in range(i, 6):
                normal[i, j] += weight * (
                    rows[i] * rows[j] + rows[6 + i] * rows[6 + j] + rows[12 + i] * rows[12 + j]
                )
    for i in range(6):
        trace += normal[i, i]
    total, left = 0.0, inf
    for _ in range(4):
        for i in range(6):
            rest[i] = g[i]
            for j in range(i, 6):
                work[i, j] = normal[i, j]
            work[i, i] += 1e-14 * trace
        total = 0.0
        for a in range(count):
            rows_of(n, times[int(active[a])], metric, psi, rows)
            square = 0.0
            for axis in range(3):
                push = 0.0
                for i in range(6):
                    push += rows[6 * axis + i] * (y[i] + change[i])
                push *= weights[int(active[a])]
                pushes[a, axis] = push
                square += push * push
                for i in range(6):
                    rest[i] -= rows[6 * axis + i] * push
            total += sqrt(square)
        left = 0.0
        for i in range(6):
            left += rest[i] * rest[i]
        factorise(work, 6)
        back_substitute(work, rest, 6)
        for i in range(6):
            change[i] += rest[i]
    if left <= ENDS_THERE * ENDS_THERE * size and total < answer[UPPER]:
        answer[UPPER], answer[COUNT] = total, count
        for a in range(count):
            answer[FIRST + 4 * a] = times[int(active[a])]
            for axis in range(3):
                answer[FIRST + 4 * a + 1 + axis] = pushes[a, axis]


@kernel()
def settle(answer, c, worth):
    """Keep a primer that proves more."""
    if worth > answer[LOWER]:
        answer[LOWER] = worth
        for k in range(6):
            answer[PRIMER + k] = c[k]


@kernel()
def along(n, t, metric, y, psi, rows, column):
    """Fill `rows` (18,) at time t and `column` (6,) with B'p."""
    rows_of(n, t, metric, psi, rows)
    for i in range(6):
        column[i] = 0.0
    for axis in range(3):
        p = 0.0
        for i in range(6):
            p += rows[6 * axis + i] * y[i]
        for i in range(6):
            column[i] += p * rows[6 * axis + i]


@kernel()
def add_curvature(n, t, metric, y, weight, curvature):
    """Add `weight` times the Hessian of theory (29) at a maximum, upper half."""
    psi, rows, rates, p = stack_matrix(3, 6), stack_vector(18), stack_vector(18), stack_matrix(2, 3)
    b = stack_vector(6)
    rows_of(n, t, metric, psi, rows)
    rate_rows(n, t, psi)
    bend = 0.0
    for axis in range(3):
        p[0, axis] = p[1, axis] = 0.0
        for j in range(6):
            total = 0.0
            for k in range(j + 1):
                total += psi[axis, k] * metric[k, j]
            rates[6 * axis + j] = total
            p[0, axis] += rows[6 * axis + j] * y[j]
            p[1, axis] += total * y[j]
        bend += p[1, axis] * p[1, axis]
    bend += n * n * (3.0 * p[0, 0] * p[0, 0] - p[0, 2] * p[0, 2])
    bend += 2.0 * n * (p[0, 0] * p[1, 1] - p[0, 1] * p[1, 0])
    for i in range(6):
        b[i] = 0.0
        for axis in range(3):
            b[i] += rates[6 * axis + i] * p[0, axis] + rows[6 * axis + i] * p[1, axis]
    moves = weight / max(-bend, 1e-9) if 0.0 < t < 1.0 and bend < 0.0 else 0.0
    for i in range(6):
        for j in range(i, 6):
            curvature[i, j] += weight * overlap(rows, i, j) + moves * b[i] * b[j]


@kernel()
def independent(columns, squares, size, highest, basis):
    """Whether the columns where |p| is greatest are independent: else impulses can be shared otherwise."""
    count = 0
    for k in range(size):
        if squares[k] < (1.0 - TOUCHES) * highest:
            continue
        if count == 6:
            return False
        left, whole = 0.0, 0.0
        for i in range(6):
            basis[count, i] = columns[k, i]
            whole += columns[k, i] ** 2
        for j in range(count):
            share = 0.0
            for i in range(6):
                share += basis[j, i] * basis[count, i]
            for i in range(6):
                basis[count, i] -= share * basis[j, i]
        for i in range(6):
            left += basis[count, i] ** 2
        if left <= TOUCHES * whole:
            return False
        for i in range(6):
            basis[count, i] /= sqrt(left)
        count += 1
    return True


@kernel()
def newton(n, metric, g, y, times, squares, columns, bent, costs, weights, active, answer):
    """Newton's method on the local maxima of |p|; `answer` takes the best bound and plan on the way."""
    c, psi, rows = stack_vector(6), stack_matrix(3, 6), stack_vector(18)
    curvature, ahead, step = stack_matrix(6, 6), stack_vector(6), stack_vector(6)
    size = 0
    for _ in range(NEWTON):
        for i in range(6):
            c[i] = 0.0
            for j in range(i, 6):
                c[i] += metric[i, j] * y[j]
        size, highest = peaks(n, 1.0, c, TOUCHING, times, squares)
        if size == 0:
            break
        scale, worth = 1.0 / sqrt(highest), 0.0
        for i in range(6):
            c[i] *= scale
            y[i] *= scale
            worth += g[i] * y[i]
        settle(answer, c, worth)
        for k in range(size):
            along(n, times[k], metric, y, psi, rows, columns[k])
            costs[k] = 0.0
        count = nonnegative(columns, size, g, costs, weights, active)
        fly(n, metric, y, g, times, weights, active, count, answer)
        if answer[UPPER] - answer[LOWER] <= GAP * answer[LOWER]:
            answer[UNIQUE] = 1.0 * independent(columns, squares, size, highest, bent)
            break
        trace = 0.0
        for i in range(6):
            for j in range(6):
                curvature[i, j] = 0.0
        for a in range(count):
            add_curvature(n, times[int(active[a])], metric, y, weights[int(active[a])], curvature)
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
        for i in range(6):
            step[i] = g[i]
            for a in range(count):
                k = int(active[a])
                step[i] -= weights[k] * columns[k, i]
        back_substitute(curvature, step, 6)
        long, wide = 0.0, 0.0
        for i in range(6):
            long += step[i] * step[i]
            wide += y[i] * y[i]
        share = min(1.0, REACH * sqrt(wide / long)) if long > 0.0 else 0.0
        for i in range(6):
            y[i] += share * step[i]
    return size


@kernel()
def half_solve(factors, vector, out):
    """Fill `out` with what has the vector's length in the inverse of a factorised matrix."""
    for i in range(6):
        out[i] = vector[i]
    for k in range(6):
        for i in range(k + 1, 6):
            out[i] -= factors[k, i] / factors[k, k] * out[k]
        out[k] /= sqrt(factors[k, k])
