"""Quadratic program of the contacts: multipliers of minimum energy.

    minimise  m.G.m / 2 - gaps.m   over   m >= 0

G is the compliance between the contacts, positive semidefinite.  The solution closes every contact's gap
at the minimum energy m.G.m / 2.
"""

import numpy as np
from numba import boolean, float64, int64

from closeform._jit import kernel
from closeform.motion.linear import back_substitute, factorise
from closeform.planning.problem.scene import NUMBERS, ROWS

STIFF = 1e-12  # of a contact's own compliance, added so that two equal contacts share their force
SLACK = 1e-10  # of the zone: tolerated shortfall of an inactive contact
EXCHANGES = 200  # at most; with rounding, incompatible planes can cycle
STALLED = 5  # exchanges of all wrong contacts without progress, before one at a time
SWEEPS = 200  # of coordinate descent, where exchanges cycle
SOLVED, APPROXIMATE = 0, 1  # status: to rounding, or by coordinate descent


@kernel(boolean(ROWS))
def is_definite(matrix):
    """Return True if a symmetric matrix is positive definite; overwrite the matrix."""
    factorise(matrix, len(matrix))
    for k in range(len(matrix)):
        if not matrix[k, k] > 0.0:
            return False
    return True


@kernel()
def solve_qp(gram, gaps, count, active, give, work, multipliers):
    """Fill `multipliers` (count,) from the initial `active` set; return the status.

    Every contact yields by the fraction `give` of its own compliance.  All contacts of the wrong sign change
    sides at once. If that does not help, only the last of them does (Judice & Pires 1994), which terminates
    for every definite G.  If rounding prevents termination, coordinate descent is used.
    """
    inside = np.empty(count, dtype=np.int64)
    wrong = np.empty(count, dtype=np.bool_)
    fewest, patience = count + 1, STALLED
    soft = 1.0 + max(give, STIFF)
    for _ in range(min(4 * count + 50, EXCHANGES)):
        size = 0
        for k in range(count):
            multipliers[k] = 0.0
            if active[k]:
                inside[size] = k
                size += 1
        rhs = np.empty(size)
        for a in range(size):
            k = inside[a]
            rhs[a] = gaps[k]
            for b in range(a, size):
                work[a, b] = gram[k, inside[b]]
            work[a, a] *= soft
        factorise(work, size)
        back_substitute(work, rhs, size)
        for a in range(size):
            multipliers[inside[a]] = rhs[a]
        number, last = 0, -1
        for k in range(count):
            if active[k]:
                wrong[k] = multipliers[k] < 0.0
            else:
                short = gaps[k]
                for a in range(size):
                    short -= gram[k, inside[a]] * rhs[a]
                wrong[k] = short > SLACK
            if wrong[k]:
                number += 1
                last = k
        if number == 0:
            return SOLVED
        if number < fewest:
            fewest, patience = number, STALLED
        elif patience > 0:
            patience -= 1
        else:
            for k in range(last):
                wrong[k] = False
        for k in range(count):
            active[k] ^= wrong[k]
    descend(gram, gaps, count, soft, multipliers)
    return APPROXIMATE


@kernel(int64(ROWS, NUMBERS, float64, NUMBERS))
def fill_multipliers(gram, gaps, give, multipliers):
    """Fill the multipliers as `solve_qp` does, from no active contact; return the status."""
    count = len(gaps)
    active, work = np.zeros(count, dtype=np.bool_), np.empty((count, count))
    return solve_qp(gram, gaps, count, active, give, work, multipliers)


@kernel()
def descend(gram, gaps, count, soft, multipliers):
    """Improve the multipliers by coordinate descent."""
    for k in range(count):
        if not multipliers[k] > 0.0:
            multipliers[k] = 0.0
    for _ in range(SWEEPS):
        for k in range(count):
            short = gaps[k] + gram[k, k] * multipliers[k]
            for m in range(count):
                short -= gram[k, m] * multipliers[m]
            multipliers[k] = max(short / (gram[k, k] * soft), 0.0)
