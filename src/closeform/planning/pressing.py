"""The forces that press just hard enough: a quadratic program with one bound for each contact."""

import numpy as np
from numba import boolean, float64, void

from closeform.arrays import Floats
from closeform.compiled import kernel

STIFF = 1e-12  # of a contact's own compliance, added so that two like contacts share their force
PROVEN = 1e-9  # tolerance of the certificate of global optimality
SLACK = 1e-10  # of the zone, by which an idle contact may fall short
STALLED = 5  # exchanges of all wrong contacts without progress, before one at a time


@kernel()
def factor(matrix, size):
    """L D L^T of the leading block, symmetric and positive definite, in place: rows of L below D."""
    for k in range(size):
        for i in range(k + 1, size):
            share = matrix[k, i] / matrix[k, k]
            for j in range(i, size):  # along a row: vector instructions
                matrix[i, j] -= share * matrix[k, j]


@kernel()
def back(matrix, rhs, size):
    """Solve with the factors of `factor`, in place."""
    for k in range(size):
        for i in range(k + 1, size):
            rhs[i] -= matrix[k, i] / matrix[k, k] * rhs[k]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            rhs[k] -= matrix[k, j] * rhs[j]
        rhs[k] /= matrix[k, k]


@kernel(boolean(float64[:, ::1]))
def definite(matrix):
    """Whether a symmetric matrix, which is spoilt, is positive definite."""
    factor(matrix, len(matrix))
    for k in range(len(matrix)):
        if not matrix[k, k] > 0.0:
            return False
    return True


@kernel(void(float64[:, ::1], float64[::1], boolean[::1], float64, float64[::1]))
def press(gram, gaps, active, give, force):
    """Fill `force` >= 0 to minimise force.G.force / 2 - gaps.force, by block pivoting from `active`.

    Every contact gives way by `give` of its own compliance.  All contacts of the wrong sign change
    sides at once; the last of them alone where that does not help (Judice & Pires 1994).
    """
    count = len(gaps)
    work, rhs = np.empty((count, count)), np.empty(count)
    inside = np.empty(count, dtype=np.int64)
    wrong = np.empty(count, dtype=np.bool_)
    fewest, patience = count + 1, STALLED
    for _ in range(2 * count + 50):
        size = 0
        for k in range(count):
            force[k] = 0.0
            if active[k]:
                inside[size] = k
                size += 1
        for a in range(size):
            k = inside[a]
            rhs[a] = gaps[k]
            for b in range(a, size):
                work[a, b] = gram[k, inside[b]]
            work[a, a] *= 1.0 + max(give, STIFF)
        factor(work, size)
        back(work, rhs, size)
        for a in range(size):
            force[inside[a]] = rhs[a]
        number, last = 0, -1
        for k in range(count):
            if active[k]:
                wrong[k] = force[k] < 0.0
            else:
                short = gaps[k]
                for a in range(size):
                    short -= gram[k, inside[a]] * rhs[a]
                wrong[k] = short > SLACK
            if wrong[k]:
                number += 1
                last = k
        if number == 0:
            break
        if number < fewest:
            fewest, patience = number, STALLED
        elif patience > 0:
            patience -= 1
        else:
            for k in range(last):
                wrong[k] = False
        for k in range(count):
            active[k] ^= wrong[k]
    for k in range(count):
        force[k] = max(force[k], 0.0)


def convex(compliance: Floats, strength: Floats) -> bool:
    """Whether the Lagrangian of contacts is convex: their path is the global optimum at their times.

    `compliance` (3K, 3K) in zone coordinates, `strength` (K,) the forces over the aimed norms: I less the
    one weighted by the other is positive definite.                                      # theory 4
    """
    weight = np.repeat(np.sqrt(strength), 3)
    return bool(definite((1.0 + PROVEN) * np.eye(len(weight)) - weight[:, None] * compliance * weight))
