"""Nonnegative weights of columns of six numbers: a quadratic program with few active unknowns.

    minimise   |target - sum of m_k columns_k|^2 / 2 + costs . m     over m >= 0

The active-set method of Lawson and Hanson: the column of steepest descent joins, and a column whose weight
would become negative leaves.  Active columns are linearly independent: at most six.
"""

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.linear import back_substitute, factorise

MOST = 6  # active columns: more are linearly dependent
RIDGE = 1e-15  # share of the longest column's square, added to the active columns' Gram matrix
FINE = 1e-13  # largest descent of an inactive column at the end, as a share of the steepest at the start
EXCHANGES = 60


@kernel()
def left_over(columns, target, weights, active, count, rest):
    """Fill `rest` with the target minus the weighted active columns."""
    for i in range(6):
        rest[i] = target[i]
    for a in range(count):
        k = active[a]
        for i in range(6):
            rest[i] -= weights[k] * columns[k, i]


@kernel()
def balance(columns, target, costs, weights, active, count, rest, gram, aims):
    """Fill `aims` with the stationary weights of the active columns, refined once by the residual."""
    longest = 0.0
    for a in range(count):
        for b in range(a, count):
            gram[a, b] = 0.0
            for i in range(6):
                gram[a, b] += columns[active[a], i] * columns[active[b], i]
        longest = max(longest, gram[a, a])
    for a in range(count):
        gram[a, a] += RIDGE * longest
    factorise(gram, count)
    left_over(columns, target, weights, active, count, rest)
    for a in range(count):
        k = active[a]
        aims[a] = -costs[k]
        for i in range(6):
            aims[a] += columns[k, i] * rest[i]
    back_substitute(gram, aims, count)
    for a in range(count):
        aims[a] += weights[active[a]]


@kernel()
def nonnegative(columns, size, target, costs, weights, active):
    """Fill `weights` (K,) and list the positive ones in `active`; return their number."""
    rest, aims, gram = stack_vector(6), stack_vector(MOST), stack_matrix(MOST, MOST)
    count = 0
    for k in range(size):
        weights[k] = 0.0
    fine = 0.0
    for exchange in range(EXCHANGES):
        left_over(columns, target, weights, active, count, rest)
        best, joins = 0.0, -1
        for k in range(size):
            fall = -costs[k]
            for i in range(6):
                fall += columns[k, i] * rest[i]
            if fall > best and weights[k] == 0.0:
                best, joins = fall, k
        if exchange == 0:
            fine = FINE * best
        if best <= fine or count == MOST:
            break
        active[count] = joins
        count += 1
        while count:
            balance(columns, target, costs, weights, active, count, rest, gram, aims)
            reach, leaves = 1.0, -1
            for a in range(count):
                now = weights[active[a]]
                if aims[a] <= 0.0 and now <= reach * (now - aims[a]):
                    reach, leaves = now / (now - aims[a]) if now > 0.0 else 0.0, a
            for a in range(count):
                k = active[a]
                weights[k] += reach * (aims[a] - weights[k])
            if leaves < 0:
                break
            weights[active[leaves]] = 0.0
            count -= 1
            for a in range(leaves, count):
                active[a] = active[a + 1]
        if weights[joins] == 0.0:  # rounding: the column would join and leave forever
            break
    return count
