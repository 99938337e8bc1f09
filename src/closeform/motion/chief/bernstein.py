"""Polynomials in Bernstein form on [0, 1], of one variable u.

    f(u) = sum_i f_i B_i(u),   B_i(u) = C(m, i) u^i (1 - u)^(m - i)

Three facts make this the form of certified decisions: f lies in the hull of its coefficients; it has at most
as many roots as they have changes of sign, and one if they have one (Descartes); de Casteljau's
algorithm cuts it in two by means of coefficients, which keeps rounding errors below those of the
coefficients.

Samples at Chebyshev's nodes give Chebyshev coefficients first: rounding errors of these change the polynomial
by no more than themselves.
"""

from fractions import Fraction
from functools import cache
from math import comb

import numpy as np

from closeform._jit import kernel
from closeform.arrays import Floats

# Degree of all tables.  With 9, half as many windows again; with 13 as many windows less a tenth, and each
# window costs a third more.
DEGREE = 11
TERMS = DEGREE + 1
SQUARE = 2 * DEGREE + 1  # coefficients of a square
CHOOSE = np.array([float(comb(DEGREE, i)) for i in range(TERMS)])
BINOMIAL = np.array([[float(comb(n, i)) for i in range(SQUARE)] for n in range(SQUARE)])
# Coefficient i + j of a product of two polynomials of the degree has the share PRODUCT[i, j] of f_i g_j.
PRODUCT = np.array(
    [
        [comb(DEGREE, i) * comb(DEGREE, j) / comb(2 * DEGREE, i + j) for j in range(TERMS)]
        for i in range(TERMS)
    ]
)
# u^k is the polynomial with the coefficients C(i, k) / C(DEGREE, k).
FROM_POWERS = np.array([[comb(i, k) / comb(DEGREE, k) for k in range(TERMS)] for i in range(TERMS)])


def nodes(degree: int) -> Floats:
    """Return Chebyshev's nodes on [0, 1] for a degree."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1)))


@cache
def chebyshev_of(degree: int) -> Floats:
    """Return the matrix from values at the nodes to Chebyshev coefficients."""
    count = degree + 1
    k, j = np.arange(count)[:, None], np.arange(count)[None, :]
    # the nodes increase: T_k at node j is (-1)^k cos(k pi (j + 1/2) / count)
    matrix = (-1.0) ** k * np.cos(np.pi * k * (j + 0.5) / count) * 2.0 / count
    matrix[0] *= 0.5
    return np.asarray(matrix)


@cache
def bernstein_of() -> Floats:
    """Return the matrix from Chebyshev to Bernstein coefficients of `DEGREE`, exact up to one rounding."""
    out = np.empty((TERMS, TERMS))
    for k in range(TERMS):
        row = [Fraction((-1) ** (k - i) * comb(2 * k, 2 * i), comb(k, i)) for i in range(k + 1)]
        for d in range(k, DEGREE):  # the same polynomial, one degree higher
            higher = [Fraction(0)] * (d + 2)
            for i, value in enumerate(row):
                higher[i] += value * Fraction(d + 1 - i, d + 1)
                higher[i + 1] += value * Fraction(i + 1, d + 1)
            row = higher
        out[:, k] = [float(value) for value in row]
    return out


@cache
def integral_to(degree: int, ends: tuple[float, ...]) -> Floats:
    """Return the matrix from values at the nodes of a degree to integrals from 0 to each of `ends`."""
    return np.asarray(chebyshev_at(degree + 1, np.array(ends)) @ integral_of(degree))


@cache
def integral_of(degree: int) -> Floats:
    """Return the matrix from values at the nodes to Chebyshev coefficients of the integral from 0."""
    integrals = np.zeros((degree + 2, degree + 1))
    for k in range(degree + 1):  # of T_k(2 u - 1) by u
        if k == 0:
            integrals[1, k] += 0.5
        elif k == 1:
            integrals[2, k] += 0.125
        else:
            integrals[k + 1, k] += 0.25 / (k + 1)
            integrals[k - 1, k] -= 0.25 / (k - 1)
    integrals = integrals @ chebyshev_of(degree)
    integrals[0] -= (chebyshev_at(degree + 1, np.zeros(1)) @ integrals)[0]
    return np.asarray(integrals)


def chebyshev_at(degree: int, u: Floats) -> Floats:
    """Return T_k(2 u - 1), k = 0 ... degree, (..., degree + 1)."""
    angle = 2.0 * np.arcsin(np.sqrt(np.clip(u, 0.0, 1.0)))[..., None]
    k = np.arange(degree + 1)
    return np.asarray((-1.0) ** k * np.cos(k * angle))


def basis_at(u: Floats) -> Floats:
    """Return B_i(u), (..., TERMS)."""
    i = np.arange(TERMS)
    return np.asarray(CHOOSE * u[..., None] ** i * (1.0 - u[..., None]) ** (DEGREE - i))


@cache
def pieces_of(count: int) -> Floats:
    """Return the matrices (count, TERMS, TERMS) of `piece_of` for equal pieces of [0, 1]."""
    return np.array([piece_of(k / count, (k + 1) / count) for k in range(count)])


def piece_of(low: float, high: float) -> Floats:
    """Return the matrix (TERMS, TERMS) from coefficients on [0, 1] to those on [low, high]."""
    out = np.empty((TERMS, TERMS))
    for column, unit in zip(out.T, np.eye(TERMS), strict=True):
        for j in range(TERMS):  # the blossom at j times `high` and the rest times `low`
            f = unit.copy()
            for k in range(DEGREE):
                u = high if k < j else low
                f = (1.0 - u) * f[:-1] + u * f[1:]
            column[j] = f[0]
    return out


@kernel()
def weights(u, out, degree=DEGREE):
    """Fill `out` (degree + 1,) with B_i(u)."""
    v = 1.0 - u
    power = 1.0
    for i in range(degree + 1):
        out[i] = BINOMIAL[degree, i] * power
        power *= u
    power = 1.0
    for i in range(degree, -1, -1):
        out[i] *= power
        power *= v


@kernel()
def derivatives_of_weights(u, out):
    """Fill `out` (3, TERMS) with B_i(u) and its first two derivatives, which have lower degrees."""
    two, one, v = out[2], out[1], 1.0 - u
    weights(u, two, DEGREE - 2)
    two[DEGREE - 1] = two[DEGREE] = 0.0
    for i in range(TERMS):
        one[i] = v * two[i] + (u * two[i - 1] if i > 0 else 0.0)
    for i in range(DEGREE, -1, -1):  # in place, from the end
        before = one[i - 1] if i > 0 else 0.0
        second = two[i] - (2.0 * two[i - 1] if i > 0 else 0.0) + (two[i - 2] if i > 1 else 0.0)
        out[0, i], one[i] = v * one[i] + u * before, DEGREE * (before - one[i])
        two[i] = DEGREE * (DEGREE - 1) * second


@kernel()
def cut(f, count, u, left):
    """Cut a polynomial of `count` coefficients at u: `left` receives [0, u], `f` keeps [u, 1]."""
    v = 1.0 - u
    left[0] = f[0]
    for k in range(1, count):
        for i in range(count - k):
            f[i] = v * f[i] + u * f[i + 1]
        left[k] = f[0]


@kernel()
def keep_piece(f, low, high, left):
    """Replace a polynomial (TERMS,) by its piece over [low, high]; `left` is room."""
    if high < 1.0:
        cut(f, TERMS, high, left)
        for b in range(TERMS):
            f[b] = left[b]
    if low > 0.0:
        cut(f, TERMS, low / high if high > 0.0 else 0.0, left)


@kernel()
def from_powers(powers, f):
    """Fill `f` (TERMS,) with the polynomial of powers of u."""
    for i in range(TERMS):
        f[i] = 0.0
        for k in range(i + 1):
            f[i] += FROM_POWERS[i, k] * powers[k]


@kernel()
def changes(f, count):
    """Return the number of changes of sign of coefficients, without zeros."""
    number, last = 0, 0.0
    for j in range(count):
        if f[j] != 0.0:
            if last != 0.0 and (f[j] > 0.0) != (last > 0.0):
                number += 1
            last = f[j]
    return number


@kernel()
def value_at(f, count, u):
    """Return f(u) and f'(u), by de Casteljau's sums in Horner's form."""
    v = 1.0 - u
    last = count - 1
    power = 1.0
    total = f[0]
    slope = f[1] - f[0] if last > 0 else 0.0
    for i in range(1, count):
        # the sum of degree i of the leading terms: multiply by v, and add the next
        power *= u
        total = total * v + BINOMIAL[last, i] * power * f[i]
        if i < last:
            slope = slope * v + BINOMIAL[last - 1, i] * power * (f[i + 1] - f[i])
    return total, last * slope
