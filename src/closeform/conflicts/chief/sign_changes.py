"""Changes of sign of polynomials: where a spacecraft is inside a zone, in one window.

In a window the relative position of two spacecraft is a polynomial q(u), up to a proven error (see
`motion.chief.table`).  A zone is a set of parts, each of them one of

    round   q_1^2 + q_2^2 (+ q_3^2) <= 1        of degree 22
    flat    a . q <= 1                           of degree 11

and a spacecraft is inside while every part holds.  `mark_changes` finds where a part begins or ceases to
hold:

  * coefficients of one sign: never, in this piece;
  * one change of sign: once (Descartes' rule), at the root that Newton's method finds in a bracket;
  * more: cut the piece in two, where the coefficients lie deepest on the other side.

Polynomials that touch the level within rounding would be cut forever.  A piece whose coefficients all are
within rounding of the level, or that is shorter than `NARROWEST`, counts as inside, and so does every open
piece of a window after `MOST_CUTS` cuts.  The level is 1 plus the error of the polynomials, so that no motion
in the linear model is inside between the conflicts found.
"""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.motion.chief.bernstein import PRODUCT, SQUARE, TERMS, changes, cut, value_at
from closeform.motion.chief.positions import ROUNDING
from closeform.motion.chief.segments import squared
from closeform.zones.shapes import BALL, CUBE, CYLINDER, FACES

LEVEL = 1e-13  # within it a squared norm is on the surface: the rounding of positions of a zone's size
NARROWEST = 1e-13  # of a window: shorter pieces are instants
MOST_CUTS = 300  # of one part in one window; random pairs need at most twenty
DEPTH = 60  # of pieces in work


@kernel()
def part_number(shape, faces):
    """Return the number of parts of a zone, one-sided ones counted each."""
    if shape == BALL:
        return 1
    return 6 if shape == CUBE else (3 if shape == CYLINDER else len(faces))


@kernel()
def flat_square(c, f):
    """Fill `f` (SQUARE,) with the coefficients of c_0^2 + c_1^2."""
    for j in range(SQUARE):
        f[j] = 0.0
    for i in range(TERMS):
        for j in range(TERMS):
            f[i + j] += PRODUCT[i, j] * (c[0, i] * c[0, j] + c[1, i] * c[1, j])


@kernel()
def level_of(shape, faces, part, c, off, f):
    """Fill `f` with a part less its level; return its number of coefficients."""
    if shape == BALL or (shape == CYLINDER and part == 0):
        axes = 3 if shape == BALL else 2
        size = 0.0
        for axis in range(axes):
            size += off[axis] * off[axis]
        held = 1.0 + sqrt(size)
        if axes == 2:
            flat_square(c, f)
        else:
            squared(c, f)
        for j in range(SQUARE):
            f[j] -= held * held
        return SQUARE
    if shape == FACES:
        held = 1.0
        for axis in range(3):
            held += abs(faces[part, axis]) * off[axis]
        for b in range(TERMS):
            f[b] = faces[part, 0] * c[0, b] + faces[part, 1] * c[1, b] + faces[part, 2] * c[2, b] - held
        return TERMS
    axis = 2 if shape == CYLINDER else part // 2
    sign = 1.0 if part % 2 == 0 else -1.0
    for b in range(TERMS):
        f[b] = sign * c[axis, b] - 1.0 - off[axis]
    return TERMS


@kernel()
def height(shape, faces, part, c, off, u):
    """Return a part less its level, and its rate, at u, from coordinates: more precise than from squares."""
    if shape == BALL or (shape == CYLINDER and part == 0):
        total, rate, size = 0.0, 0.0, 0.0
        for axis in range(3 if shape == BALL else 2):
            value, slope = value_at(c[axis], TERMS, u)
            total += value * value
            rate += 2.0 * value * slope
            size += off[axis] * off[axis]
        held = 1.0 + sqrt(size)
        return total - held * held, rate
    total, rate = -1.0, 0.0
    for axis in range(3):
        if shape == FACES:
            along = faces[part, axis]
        else:
            along = 0.0
            if axis == (2 if shape == CYLINDER else part // 2):
                along = 1.0 if part % 2 == 0 else -1.0
        if along != 0.0:
            value, slope = value_at(c[axis], TERMS, u)
            total += along * value - abs(along) * off[axis]
            rate += along * slope
    return total, rate


@kernel()
def root(shape, faces, part, c, off, low, high, first, rising):
    """Return the only root of a part in [low, high], by Newton's method in a bracket from `first` onward.

    It ends when steps no longer become shorter, because they then consist of rounding.
    """
    u, last = min(max(first, low), high), 1.0
    for _ in range(60):
        value, rate = height(shape, faces, part, c, off, u)
        if (value > 0.0) == rising:
            high = u
        else:
            low = u
        there = u - value / rate if rate != 0.0 else -1.0
        if not low < there < high:
            there = 0.5 * (low + high)
        step = abs(there - u)
        if step <= 2e-16 or (step < 1e-12 and 2.0 * step >= last):
            return there
        u, last = there, step
    return u


@kernel()
def deepest(f, count):
    """Return where to cut a polynomial: where its coefficients lie deepest on the other side of its start."""
    first = 0.0
    for j in range(count):
        if f[j] != 0.0:
            first = f[j]
            break
    best, at = 0.0, count // 2
    for j in range(1, count - 1):
        value = f[j] if first > 0.0 else -f[j]
        if value < best:
            best, at = value, j
    return min(max(at / (count - 1.0), 0.05), 0.95)


@kernel()
def mark_changes(shape, faces, part, c, off, stack, ends, number, places, outs):
    """Append where a part begins (-1) or ceases (+1) to hold; return the count, and True if it holds at 0.

    `stack` (DEPTH, SQUARE) begins with the part less its level.
    """
    count = level_of(shape, faces, part, c, off, stack[0])
    most = 0.0
    for j in range(count):
        most = max(most, abs(stack[0, j]))
    level = LEVEL + ROUNDING * most
    top, begin, cuts = 0, 0.0, 0
    ends[0] = 1.0
    outside, known, held_at_start = False, False, False
    while top >= 0:
        f = stack[top]
        least, most = inf, -inf
        for j in range(count):
            least, most = min(least, f[j]), max(most, f[j])
        end = ends[top]
        variations = changes(f, count)
        touches = most <= level and least >= -level
        if variations > 1 and not touches:
            if end - begin > NARROWEST and top + 1 < DEPTH and cuts < MOST_CUTS:
                u = deepest(f, count)
                cut(f, count, u, stack[top + 1])
                ends[top + 1] = begin + u * (end - begin)
                top += 1
                cuts += 1
                continue
            touches = True
        if touches:
            left = right = False
        elif variations == 1:
            left = False
            for j in range(count):
                if f[j] != 0.0:
                    left = f[j] > 0.0
                    break
            right = not left
        else:
            left = right = most > 0.0
        if not known:
            known, outside, held_at_start = True, left, not left
        if left != outside and number < len(places):
            places[number], outs[number] = begin, 1 if left else -1
            number += 1
        if right != left and number < len(places):
            first = begin + (end - begin) * f[0] / (f[0] - f[count - 1])  # where the chord is zero
            places[number] = root(shape, faces, part, c, off, begin, end, first, right)
            outs[number] = 1 if right else -1
            number += 1
        outside = right
        begin = end
        top -= 1
    return number, held_at_start


@kernel()
def excluded(shape, faces, c, off, f):
    """Return True if a plane keeps the whole polynomial out of the zone: hulls only."""
    if shape == BALL:
        x, y, z = c[0, 0], c[1, 0], c[2, 0]
        dx, dy, dz = c[0, TERMS - 1] - x, c[1, TERMS - 1] - y, c[2, TERMS - 1] - z
        square = dx * dx + dy * dy + dz * dz
        along = -(x * dx + y * dy + z * dz)
        along = 0.0 if along <= 0.0 else (1.0 if along >= square else along / square)
        wx, wy, wz = x + along * dx, y + along * dy, z + along * dz
        size = sqrt(wx * wx + wy * wy + wz * wz)
        least = inf
        for b in range(TERMS):
            least = min(least, wx * c[0, b] + wy * c[1, b] + wz * c[2, b])
        return least > size * (1.0 + off[0] + off[1] + off[2]) * (1.0 + 1e-14)
    for part in range(part_number(shape, faces)):
        if shape == CYLINDER and part == 0:
            continue
        least = inf
        level_of(shape, faces, part, c, off, f)
        for b in range(TERMS):
            least = min(least, f[b])
        if least > 0.0:
            return True
    return False


@kernel()
def window_changes(shape, faces, c, off, stack, ends, places, outs):
    """Fill in the changes of all parts in order; return their number and that of parts outside at 0."""
    number, out = 0, 0
    for part in range(part_number(shape, faces)):
        number, holds = mark_changes(shape, faces, part, c, off, stack, ends, number, places, outs)
        out += 0 if holds else 1
    for i in range(1, number):  # insertion: few, and almost sorted
        place, change = places[i], outs[i]
        j = i - 1
        while j >= 0 and (places[j] > place or (places[j] == place and outs[j] > change)):
            places[j + 1], outs[j + 1] = places[j], outs[j]
            j -= 1
        places[j + 1], outs[j + 1] = place, change
    return number, out
