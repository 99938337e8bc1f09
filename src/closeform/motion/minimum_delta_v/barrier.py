"""Approximate solution of the primer's program on a grid of times, by a logarithmic barrier.

    maximise   g . y   subject to   |rows_j y|^2 <= 1   at times t_j

y are six numbers scaled so that the mean of |p|^2 over the grid is |y|^2: no digit is lost for very short
transfers.  The start y = 0 is the analytic centre.  At weight w, J / w bounds the deficit of g . y from its
maximum, and the impulses 2 p_j / (w (1 - |p_j|^2)) make the transfer.
"""

from math import log, sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.linear import back_substitute, factorise

# A row of the grid holds the time, `rows` (3, 6), the upper half of the Gram matrix of `rows` (21), and space
# for p, its step and 1 - |p|^2.
TIME, ROWS, SQUARES, PLACE, STEP, SLACK, WIDTH = 0, 1, 19, 40, 43, 46, 47
FASTER = 30.0  # factor of the weight once y is near the centre
CENTRED = 0.1  # Newton decrement below which y counts as near the centre
CLIMBING = 0.1  # share of the increase that Newton's step predicts
STEPS = 500  # ten times the most that was seen


@kernel()
def overlap(rows, i, j):
    """Return the scalar product of columns i and j of `rows` (18,)."""
    return rows[i] * rows[j] + rows[6 + i] * rows[6 + j] + rows[12 + i] * rows[12 + j]


@kernel()
def curve(table, count, y, weight, rise, half):
    """Add the gradient of the barrier at y to `rise` (6,) and its Hessian to `half` (21,), upper half."""
    pull = stack_vector(6)
    for j in range(count):
        row = table[j]
        x, u, v = 0.0, 0.0, 0.0
        for k in range(6):
            x += row[ROWS + k] * y[k]
            u += row[ROWS + 6 + k] * y[k]
            v += row[ROWS + 12 + k] * y[k]
        row[PLACE], row[PLACE + 1], row[PLACE + 2] = x, u, v
        slack = 1.0 - x * x - u * u - v * v
        row[SLACK] = slack
        twice = 2.0 / slack
        for k in range(6):
            pull[k] = twice * (row[ROWS + k] * x + row[ROWS + 6 + k] * u + row[ROWS + 12 + k] * v)
            rise[k] -= pull[k]
        q = 0
        for k in range(6):
            for i in range(k, 6):
                half[q] += twice * row[SQUARES + q] + pull[k] * pull[i]
                q += 1


@kernel()
def longest_step(table, count, d):
    """Return the longest step along d that stays feasible on the grid; store the change of p at each time."""
    longest = 1e30
    for j in range(count):
        row = table[j]
        along, square = 0.0, 0.0
        for i in range(3):
            step = 0.0
            for k in range(6):
                step += row[ROWS + 6 * i + k] * d[k]
            row[STEP + i] = step
            along += step * row[PLACE + i]
            square += step * step
        if square > 0.0:
            root = sqrt(along * along + square * row[SLACK])
            reach = row[SLACK] / (along + root) if along > 0.0 else (root - along) / square
            longest = min(longest, reach)
    return longest


@kernel()
def shrinkage(table, count, a):
    """Return the product over the grid of 1 - |p|^2 after a step over that before it; 0 if infeasible."""
    product = 1.0
    for j in range(count):
        row = table[j]
        x, u, v = (
            row[PLACE] + a * row[STEP],
            row[PLACE + 1] + a * row[STEP + 1],
            row[PLACE + 2] + a * row[STEP + 2],
        )
        slack = 1.0 - x * x - u * u - v * v
        product *= max(slack, 0.0) / row[SLACK]
    return product


@kernel()
def climb(table, count, g, y, gap, weight):
    """Increase g . y until y is within the relative `gap` of the maximum; return the final weight of g."""
    rise, half, d, bend = stack_vector(6), stack_vector(21), stack_vector(6), stack_matrix(6, 6)
    for _ in range(STEPS):
        for k in range(6):
            rise[k] = weight * g[k]
        for q in range(21):
            half[q] = 0.0
        curve(table, count, y, weight, rise, half)
        q = 0
        for k in range(6):
            d[k] = rise[k]
            for i in range(k, 6):
                bend[k, i] = half[q]
                q += 1
            bend[k, k] *= 1.0 + 1e-15
        factorise(bend, 6)
        back_substitute(bend, d, 6)
        decrement, gain, value = 0.0, 0.0, 0.0
        for k in range(6):
            decrement += rise[k] * d[k]
            gain += weight * g[k] * d[k]
        a = min(1.0, 0.99 * longest_step(table, count, d))
        for _ in range(30):
            if a * gain + log(shrinkage(table, count, a)) >= CLIMBING * a * decrement:
                break
            a *= 0.5
        for k in range(6):
            y[k] += a * d[k]
            value += g[k] * y[k]
        if not decrement >= CENTRED:
            if not count > weight * gap * value:
                break
            weight *= FASTER
    return weight
