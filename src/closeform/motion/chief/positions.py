"""Polynomials of positions in a window of a chief's table, and bounds of their errors."""

from closeform._jit import kernel
from closeform.motion.chief.bernstein import TERMS, keep_piece

ROUNDING = 4e-15  # of a coordinate, relative to the largest coefficient


@kernel()
def polynomial(rows, k, z, count, matrix, p, c):
    """Fill `c` (3, TERMS) with the coefficients of the position of columns z in zone coordinates."""
    for axis in range(3):
        for b in range(TERMS):
            p[axis, b] = 0.0
    for j in range(count):
        value = z[j]
        if value != 0.0:
            for axis in range(3):
                for b in range(TERMS):
                    p[axis, b] += value * rows[k, j, axis, b]
    for axis in range(3):
        for b in range(TERMS):
            c[axis, b] = matrix[axis, 0] * p[0, b] + matrix[axis, 1] * p[1, b] + matrix[axis, 2] * p[2, b]


@kernel()
def largest(c):
    """Return the largest absolute coefficient."""
    most = 0.0
    for axis in range(3):
        for b in range(TERMS):
            most = max(most, abs(c[axis, b]))
    return most


@kernel()
def slack(errors, k, z, count, matrix, c, out):
    """Fill `out` (3,) with bounds of the error of a polynomial along each axis of zone coordinates."""
    off = 0.0
    for j in range(count):
        off += abs(z[j]) * errors[k, j]
    rounded = ROUNDING * largest(c)
    for axis in range(3):
        out[axis] = off * (abs(matrix[axis, 0]) + abs(matrix[axis, 1]) + abs(matrix[axis, 2])) + rounded


@kernel()
def keep(c, low, high, left):
    """Replace polynomials `c` (3, TERMS) by their pieces over [low, high]."""
    for axis in range(3):
        keep_piece(c[axis], low, high, left)
