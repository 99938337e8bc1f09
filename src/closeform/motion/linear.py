"""Small dense linear algebra for kernels."""

from math import inf, sqrt

import numpy as np

from closeform._jit import kernel

ROOT = 1e-14  # share of the diagonal that is added to it
DEPENDENT = 1e-12  # share of the diagonal: a smaller remainder is rounding


@kernel()
def solve(matrix, rhs, size):
    """Solve the first `size` equations in place by scaled, pivoted elimination.

    Overwrites both arguments; the solution is left in `rhs`.
    """
    scale = np.empty(size)
    for j in range(size):  # columns of very different units
        largest = 0.0
        for i in range(size):
            largest = max(largest, abs(matrix[i, j]))
        scale[j] = 1.0 / largest
        for i in range(size):
            matrix[i, j] *= scale[j]
    for i in range(size):
        largest = 0.0
        for j in range(size):
            largest = max(largest, abs(matrix[i, j]))
        for j in range(size):
            matrix[i, j] /= largest
        rhs[i] /= largest
    for k in range(size):
        pivot = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, size):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
            rhs[k], rhs[pivot] = rhs[pivot], rhs[k]
        for i in range(k + 1, size):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, size):
                matrix[i, j] -= factor * matrix[k, j]
            rhs[i] -= factor * rhs[k]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            rhs[k] -= matrix[k, j] * rhs[j]
        rhs[k] /= matrix[k, k]
    for j in range(size):
        rhs[j] *= scale[j]


@kernel()
def factorise(matrix, size):
    """Factorise the leading block, symmetric positive definite, as L D L^T in place.

    The upper triangle holds the rows of L^T D, the diagonal holds D.
    """
    for k in range(size):
        for i in range(k + 1, size):
            share = matrix[k, i] / matrix[k, k]
            if share != 0.0:  # few contacts of a large formation act on each other
                for j in range(i, size):  # along a row: vector instructions
                    matrix[i, j] -= share * matrix[k, j]


@kernel()
def back_substitute(matrix, rhs, size):
    """Solve with the factors of `factorise`, in place."""
    for k in range(size):
        for i in range(k + 1, size):
            rhs[i] -= matrix[k, i] / matrix[k, k] * rhs[k]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            rhs[k] -= matrix[k, j] * rhs[j]
        rhs[k] /= matrix[k, k]


@kernel()
def dot(a, b):
    """Return the scalar product of the first six numbers of two vectors."""
    total = 0.0
    for k in range(6):
        total += a[k] * b[k]
    return total


@kernel()
def triangle(matrix, size):
    """Compute Cholesky's factor of the leading block in its lower half; the block may be rank deficient.

    A row that depends on those before it has inf on the diagonal, so that substitution ignores it.
    """
    for a in range(size):
        least = DEPENDENT * matrix[a, a]
        matrix[a, a] *= 1.0 + ROOT
        for b in range(a):
            matrix[a, a] -= matrix[a, b] * matrix[a, b]
        matrix[a, a] = sqrt(matrix[a, a]) if matrix[a, a] > least else inf
        for c in range(a + 1, size):
            for b in range(a):
                matrix[c, a] -= matrix[c, b] * matrix[a, b]
            matrix[c, a] /= matrix[a, a]


@kernel()
def copy(source, target):
    """Copy a vector; a slice assignment would make numba compile its error message."""
    for k in range(len(source)):
        target[k] = source[k]


@kernel()
def times(matrix, x, y, z):
    """Return the product of a matrix (3, 3) and a vector."""
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
    )


@kernel()
def axes_across(x, y, z):
    """Return two unit vectors across a unit vector and each other, without loss of digits."""
    side = 1.0 if z >= 0.0 else -1.0
    part = -1.0 / (side + z)
    return (
        (1.0 + side * x * x * part, side * x * y * part, -side * x),
        (x * y * part, side + y * y * part, -y),
    )
