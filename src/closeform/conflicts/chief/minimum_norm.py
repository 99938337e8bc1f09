"""Certified minimum of a norm along a polynomial: pieces whose lower bound is below the best are cut."""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.conflicts.chief.sign_changes import DEPTH, MOST_CUTS, NARROWEST, flat_square
from closeform.motion.chief.bernstein import SQUARE, TERMS, changes, cut, value_at
from closeform.motion.chief.segments import squared
from closeform.zones.shapes import BALL, CYLINDER, FACES, norm

DEEP = 3 * DEPTH  # rows of their coordinates
LEAST = 1e-10  # relative accuracy of a minimum norm


@kernel()
def lower_bound(shape, faces, c, f):
    """Return a lower bound of the norm over [0, 1]: the largest of the parts' least coefficients."""
    best = 0.0 if shape != FACES else -inf
    if shape == BALL or shape == CYLINDER:
        if shape == BALL:
            squared(c, f)
        else:
            flat_square(c, f)
        least = inf
        for j in range(SQUARE):
            least = min(least, f[j])
        best = sqrt(max(least, 0.0))
    if shape == FACES:
        for part in range(len(faces)):
            least = inf
            for b in range(TERMS):
                value = faces[part, 0] * c[0, b] + faces[part, 1] * c[1, b] + faces[part, 2] * c[2, b]
                least = min(least, value)
            best = max(best, least)
    elif shape != BALL:
        for axis in range(2 if shape == CYLINDER else 0, 3):
            least, most = inf, -inf
            for b in range(TERMS):
                least, most = min(least, c[axis, b]), max(most, c[axis, b])
            best = max(best, least, -most)
    return best


@kernel()
def norm_at(shape, faces, c, u):
    """Return the norm at u."""
    return norm(
        shape, faces, value_at(c[0], TERMS, u)[0], value_at(c[1], TERMS, u)[0], value_at(c[2], TERMS, u)[0]
    )


@kernel()
def rising_at(f, count):
    """Return the zero of a polynomial that rises through it once in [0, 1], by Newton in a bracket."""
    low, high, u = 0.0, 1.0, 0.5
    for _ in range(60):
        value, rate = value_at(f, count, u)
        if value > 0.0:
            high = u
        else:
            low = u
        there = u - value / rate if rate > 0.0 else -1.0
        if not low < there < high:
            there = 0.5 * (low + high)
        if abs(there - u) <= 1e-13:
            return there
        u = there
    return u


@kernel()
def minimum(shape, faces, c, pieces, ends, f, best, at):
    """Return the minimum norm over [0, 1] and its place, if it is below `best`; `best` and `at` otherwise.

    `pieces` (3 DEPTH, TERMS) begins with the polynomial.
    """
    for u in (0.0, 1.0):
        value = norm_at(shape, faces, c, u)
        if value < best:
            best, at = value, u
    for axis in range(3):
        for b in range(TERMS):
            pieces[axis, b] = c[axis, b]
    top, begin, cuts = 0, 0.0, 0
    ends[0] = 1.0
    while top >= 0:
        piece, end = pieces[3 * top : 3 * top + 3], ends[top]
        bound = lower_bound(shape, faces, piece, f)
        if bound >= best - LEAST * abs(best) or end - begin <= NARROWEST or top + 1 == DEPTH:
            begin = end
            top -= 1
            continue
        if shape == BALL:
            for j in range(SQUARE - 1):
                f[j] = f[j + 1] - f[j]
            turns = changes(f, SQUARE - 1)
            if turns <= 1:
                if turns == 1 and (f[0] < 0.0 or (f[0] == 0.0 and f[1] < 0.0)):
                    u = rising_at(f, SQUARE - 1)
                    value = norm_at(shape, faces, piece, u)
                    if value < best:
                        best, at = value, begin + u * (end - begin)
                begin = end
                top -= 1
                continue
        for axis in range(3):
            cut(piece[axis], TERMS, 0.5, pieces[3 * top + 3 + axis])
        ends[top + 1] = 0.5 * (begin + end)
        value = norm(shape, faces, piece[0, 0], piece[1, 0], piece[2, 0])
        if value < best:
            best, at = value, ends[top + 1]
        top += 1
        cuts += 1
        if cuts > 40 * MOST_CUTS:
            break
    return best, at
