"""Certified lower bound on the energy of clear plans beyond the unconstrained optima.

Let q_r be linear functions of the deviation of all paths: `places` without it, and `gram` = G the Gram
matrix of the kernel (12) between them.  For any pairs and times, every clear plan satisfies

    squares   |q_g|^2 >= 1      for groups g of rows: outside a ball of a zone at some time
    halves    q_c >= floor_c    for the rows after them: beyond a plane, where one was chosen

So for any multipliers l, n >= 0 for which S = I - R G_ss R is positive definite, with R = diag(sqrt(l))
over the rows of the squares and v = R (places + G_sh n),

    extra energy >= sum(l) / 2 + n (floor - places) - n G_hh n / 2 - v S^-1 v / 2        # theory (21a)

No inverse of G is taken, so times may coincide.  The right side is concave; Newton's method maximises it
with barriers on S, l and n.  The returned bound does not rely on this: it is recomputed with G enlarged
(more compliant paths are cheaper) and S certified definite.
"""

from math import inf, log, sqrt

import numpy as np
from numba import float64, int64

from closeform._jit import kernel
from closeform.motion.linear import copy

DEFINITE = 1e-9  # certified smallest eigenvalue of S: far above rounding, and a loss of this share
ENLARGED = 1e-12  # of G's diagonal, for each row: above the rounding of the kernel
ROUNDING = 1e-13  # of the terms of the bound, for each row
STEPS = 200  # of Newton's method, at most
FINE = 1e-9  # of the bound: accuracy where `enough` is within reach
FIRST = 1.0  # initial barrier, relative to the mean multiplier's part of the bound
CENTRED, SHRINK = 2.0, 0.12  # decrement, in barriers, at which the barrier is reduced, and the factor
STIFFEST = 1e-12  # of the largest compliance: lower limit that bounds initial multipliers
BACK = 0.7  # factor of the initial multipliers while S is not definite
INSIDE = 0.9  # of the distance to where a multiplier vanishes
CLIMBING = 0.3  # of the rise predicted by the slope
SHORTEST = 1e-9  # minimum step length
RETREAT = 10.0 * DEFINITE  # of the multipliers at the maximum, where S is nearly singular


@kernel()
def invert(matrix, size):
    """Invert a symmetric matrix in place; return the log of its determinant, -inf where indefinite."""
    total = 0.0
    row = np.empty(size)
    for k in range(size):
        pivot = matrix[k, k]
        if not pivot > 0.0:
            return -inf
        total += log(pivot)
        for i in range(size):
            row[i] = matrix[i, k] if i < k else matrix[k, i]
        row[k] = 0.0
        for i in range(size):
            share = row[i] / pivot
            for j in range(i, size):  # along a row: vector instructions
                matrix[i, j] -= share * row[j]
        for i in range(size):
            if i < k:
                matrix[i, k] = row[i] / pivot
            else:
                matrix[k, i] = row[i] / pivot
        matrix[k, k] = -1.0 / pivot
    for i in range(size):  # Gauss-Jordan leaves the negative upper half
        for j in range(i, size):
            matrix[i, j] *= -1.0
            matrix[j, i] = matrix[i, j]
    return total


@kernel()
def weigh(places, gram, offsets, floors, multipliers, larger, less, roots, aims, matrix):
    """Fill R, v and S, with G enlarged and S reduced; return the bound without the term v S^-1 v / 2."""
    groups = len(offsets) - 1
    size = offsets[groups]
    total = 0.0
    for g in range(groups):
        total += 0.5 * multipliers[g]
        for r in range(offsets[g], offsets[g + 1]):
            roots[r] = sqrt(multipliers[g])
    for r in range(size):
        aims[r] = places[r]
        for c in range(len(floors)):
            aims[r] += gram[r, size + c] * multipliers[groups + c]
        aims[r] *= roots[r]
        for s in range(size):
            matrix[r, s] = -roots[r] * gram[r, s] * roots[s]
        matrix[r, r] += 1.0 - less + larger * matrix[r, r]
    for c in range(len(floors)):
        own, at = multipliers[groups + c], size + c
        total += own * (floors[c] - places[at] - 0.5 * larger * gram[at, at] * own)
        for d in range(len(floors)):
            total -= 0.5 * own * gram[at, size + d] * multipliers[groups + d]
    return total


@kernel()
def times(matrix, vector, size, out):
    """Fill `out` with the product; return its scalar product with the vector."""
    total = 0.0
    for i in range(size):
        out[i] = 0.0
        for j in range(size):
            out[i] += matrix[i, j] * vector[j]
        total += vector[i] * out[i]
    return total


@kernel()
def certified(places, gram, offsets, floors, multipliers):
    """Return the bound of given multipliers, rounding included; -inf where S is not definite."""
    size, rows = offsets[len(offsets) - 1], len(places)
    roots, aims, x, product = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    matrix, inverse = np.empty((size, size)), np.empty((size, size))
    larger = ENLARGED * rows
    weigh(places, gram, offsets, floors, multipliers, larger, 2.0 * DEFINITE, roots, aims, inverse)
    if invert(inverse, size) == -inf:
        return -inf
    bound = weigh(places, gram, offsets, floors, multipliers, larger, DEFINITE, roots, aims, matrix)
    inverse[:] = matrix  # definite too, and its inverse makes the residual below small
    invert(inverse, size)
    times(inverse, aims, size, x)
    curved, straight, left = times(matrix, x, size, product), 0.0, 0.0
    for r in range(size):
        straight += aims[r] * x[r]
        left += (aims[r] - product[r]) ** 2
    # v S^-1 v = 2 v x - x S x + (v - S x) S^-1 (v - S x) for any x, and S >= DEFINITE
    terms = abs(bound) + abs(straight) + abs(curved)
    return bound - straight + 0.5 * curved - 0.5 * left / DEFINITE - ROUNDING * rows * terms


@kernel()
def slopes(places, gram, offsets, floors, multipliers, roots, x, inverse, barrier, slope, hessian):
    """Fill gradient and negative Hessian of the bound with its barriers, in shares of the multipliers.

    `x` = S^-1 v: the roots times the rows at which the Lagrangian is minimal.
    """
    groups, halves = len(offsets) - 1, len(floors)
    size = offsets[groups]
    felt = np.empty((halves, size))  # G_hs R S^-1
    for c in range(halves):
        for s in range(size):
            felt[c, s] = 0.0
            for r in range(size):
                felt[c, s] += gram[size + c, r] * roots[r] * inverse[r, s]
    for g in range(groups):
        slope[g] = 0.5 * multipliers[g] + barrier
        for h in range(g, groups):
            total = 0.0
            for r in range(offsets[g], offsets[g + 1]):
                for s in range(offsets[h], offsets[h + 1]):
                    share = inverse[r, s] - (1.0 if r == s else 0.0)
                    total += share * (x[r] * x[s] + barrier * share)
            hessian[g, h] = total
        for r in range(offsets[g], offsets[g + 1]):
            slope[g] -= 0.5 * x[r] * x[r] + barrier * (inverse[r, r] - 1.0)
        for c in range(halves):
            total = 0.0
            for r in range(offsets[g], offsets[g + 1]):
                total += felt[c, r] * x[r]
            hessian[g, groups + c] = multipliers[groups + c] * total
        hessian[g, g] += barrier
    for c in range(halves):
        own = multipliers[groups + c]
        place = places[size + c]
        for r in range(size):
            place += gram[size + c, r] * roots[r] * x[r]
        for d in range(halves):
            other = multipliers[groups + d]
            place += gram[size + c, size + d] * other
            total = gram[size + c, size + d]
            for r in range(size):
                total += felt[c, r] * roots[r] * gram[r, size + d]
            hessian[groups + c, groups + d] = own * other * total
        slope[groups + c] = own * (floors[c] - place) + barrier
        hessian[groups + c, groups + c] += barrier


@kernel()
def begin(places, gram, offsets, floors, multipliers, roots, aims, inverse):
    """Fill initial multipliers, scaled until S is definite."""
    groups = len(offsets) - 1
    size = offsets[groups]
    softest = 0.0
    for r in range(len(places)):
        softest = max(softest, gram[r, r])
    for g in range(groups):
        own = STIFFEST * softest  # limits multipliers of stiff rows at an end of a craft's time
        for r in range(offsets[g], offsets[g + 1]):
            own += gram[r, r]
        multipliers[g] = 1.0 / own
    for c in range(len(floors)):
        multipliers[groups + c] = 1.0 / (gram[size + c, size + c] + STIFFEST * softest)
    while True:
        weigh(places, gram, offsets, floors, multipliers, 0.0, 0.0, roots, aims, inverse)
        definite = invert(inverse, size) > -inf
        for g in range(groups):
            multipliers[g] *= BACK
        if definite:
            return


@kernel(
    float64(
        float64[::1], float64[:, ::1], int64[::1], float64[::1], float64, float64, float64[::1], float64[::1]
    )
)
def dual_bound(places, gram, offsets, floors, enough, tolerance, multipliers, forces):
    """Return a certified bound on the extra energy, maximised until it reaches `enough` or cannot.

    It is accurate to `tolerance`, relative to the bound or to its difference from `enough`.  G must not
    vanish.

    `places` (m,), `gram` (m, m); rows offsets[g] to offsets[g + 1] are the squares of group g, the last
    len(floors) rows the halves.  `multipliers`, of groups and then halves, are kept where they suffice, as a
    plan's may, and are replaced by those of the bound otherwise.  `forces` (m,) are filled with the forces
    that minimise its Lagrangian: then the rows are places + gram forces.
    """
    groups = len(offsets) - 1
    size, count = offsets[groups], groups + len(floors)
    first = certified(places, gram, offsets, floors, multipliers)
    roots, aims, x = np.empty(size), np.empty(size), np.empty(size)
    inverse, hessian = np.empty((size, size)), np.empty((count, count))
    slope, step, here = np.empty(count), np.empty(count), multipliers.copy()
    begin(places, gram, offsets, floors, here, roots, aims, inverse)
    tried = here.copy()
    barrier, length, decrement, height = 0.0, 0.0, 0.0, -inf
    for _ in range(STEPS if first < enough else 0):
        level = weigh(places, gram, offsets, floors, tried, 0.0, 0.0, roots, aims, inverse)
        volume = invert(inverse, size)
        level -= 0.5 * times(inverse, aims, size, x)
        for k in range(count):
            volume += log(tried[k])
        if not level + barrier * volume >= height + CLIMBING * length * decrement:
            length *= 0.5
            if length < SHORTEST:
                break
        else:
            total = 0.0
            for k in range(count):
                here[k] = tried[k]
                total += here[k]
            if level >= enough:
                break
            if barrier == 0.0:
                barrier = FIRST * total / count
            elif length == 1.0 and decrement < CENTRED * barrier:
                left = barrier * (size + count)  # distance from the centre to the maximum
                scale = abs(level) if enough == inf else max(abs(level), enough - level)
                if left < FINE * abs(level) or (left < tolerance * scale and level + left < enough):
                    break
                barrier *= SHRINK
            slopes(places, gram, offsets, floors, here, roots, x, inverse, barrier, slope, hessian)
            invert(hessian, count)
            decrement = times(hessian, slope, count, step)
            steepest = 0.0
            for k in range(count):
                steepest = max(steepest, -step[k])
            length = 1.0 if steepest < INSIDE else INSIDE / steepest
            height = level + barrier * volume
        for k in range(count):
            tried[k] = here[k] * (1.0 + length * step[k])
    bound, retreat = first, RETREAT
    while first < enough and retreat < BACK:
        bound = certified(places, gram, offsets, floors, here)
        if bound > -inf:
            break
        for g in range(groups):
            here[g] *= 1.0 - retreat
        retreat *= 10.0
    if bound > first:
        copy(here, multipliers)
    weigh(places, gram, offsets, floors, multipliers, 0.0, 0.0, roots, aims, inverse)
    invert(inverse, size)
    times(inverse, aims, size, x)
    for r in range(size):
        forces[r] = roots[r] * x[r]
    for c in range(len(floors)):
        forces[size + c] = multipliers[groups + c]
    return max(bound, first)
