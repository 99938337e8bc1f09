"""Certified search of pairs beside any chief: the signs of polynomials, window by window.

Beside one chief the relative position of two spacecraft is a polynomial q(u) in each window of the chief's
table, up to a proven error (see `motion.chief.table`).  A zone is a set of parts, each of them one of

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

from math import inf, nan, sqrt

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.conflicts.pair_search import conflicts_from
from closeform.conflicts.quick_rejection import OFF_CHORD, count_near
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
from closeform.motion.chief.bernstein import PRODUCT, SQUARE, TERMS, changes, cut, keep_piece, value_at
from closeform.motion.chief.clock import time_at
from closeform.motion.chief.segments import (
    BEGIN,
    COLUMN,
    FINISH,
    FIRST,
    LAST,
    ON_JOINT,
    ORIGIN,
    TABLE,
    WINDOW,
    columns_at,
    share,
    squared,
)
from closeform.motion.chief.table import COLUMNS, COSTATE
from closeform.zones.shapes import BALL, CUBE, CYLINDER, FACES, FORM, norm

ROUNDING = 4e-15  # of a coordinate, relative to the largest coefficient
LEVEL = 1e-13  # within it a squared norm is on the surface: the rounding of positions of a zone's size
NARROWEST = 1e-13  # of a window: shorter pieces are instants
MOST_CUTS = 300  # of one part in one window; random pairs need at most twenty
DEPTH = 60  # of pieces in work
DEEP = 3 * DEPTH  # rows of their coordinates
SAME = 1e-12  # [rad]: conflicts that follow each other so soon are one
LEAST = 1e-10  # relative accuracy of a minimum norm
PER_TURN = 48  # chords of a revolution: with half as many twice the pairs are searched


@kernel()
def subtract(a, b, z):
    """Fill `z` (15,) with the columns of a less those of b; return how many of them are not all zero."""
    count = COSTATE
    for j in range(COLUMNS):
        z[j] = a[COLUMN + j] - b[COLUMN + j]
        if z[j] != 0.0 and j >= count:
            count = COLUMNS
    return count


@kernel()
def columns_in(row):
    """Return the number of columns of a segment that are not all zero."""
    for j in range(COSTATE, COLUMNS):
        if row[COLUMN + j] != 0.0:
            return COLUMNS
    return COSTATE


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


@kernel()
def part_number(shape, faces):
    """Return the number of parts of a zone, one-sided ones counted each."""
    if shape == BALL:
        return 1
    return 6 if shape == CUBE else (3 if shape == CYLINDER else len(faces))


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
def flat_square(c, f):
    """Fill `f` (SQUARE,) with the coefficients of c_0^2 + c_1^2."""
    for j in range(SQUARE):
        f[j] = 0.0
    for i in range(TERMS):
        for j in range(TERMS):
            f[i + j] += PRODUCT[i, j] * (c[0, i] * c[0, j] + c[1, i] * c[1, j])


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
    """Return the only root of a part in [low, high], by Newton's method in a bracket from `first` on.

    It ends where steps no longer become shorter: there they are rounding.
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
    """Fill in the changes of all parts in order; return their number, and how many parts are out at 0."""
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


@kernel()
def append(rows, count, first, pair, start, end):
    """Store a conflict [start, end] in angles, or extend the one before; return the new count."""
    if count > first and count <= len(rows) and start - rows[count - 1, 2] <= SAME:
        rows[count - 1, 2] = max(end, rows[count - 1, 2])
        return count
    if count < len(rows):
        rows[count, 0], rows[count, 1], rows[count, 2] = pair, start, end
    return count + 1


@kernel()
def at_once(table, a, b, matrix, z, c, s):
    """Fill `c` with the constant relative position at an angle."""
    joints, rows = table[1], table[3]
    one, two, basis = np.empty(COLUMNS), np.empty(COLUMNS), np.empty(TERMS)
    columns_at(rows, int(a[WINDOW]), share(joints, int(a[WINDOW]), a[ORIGIN], s), a[COLUMN:], one, basis)
    columns_at(rows, int(b[WINDOW]), share(joints, int(b[WINDOW]), b[ORIGIN], s), b[COLUMN:], two, basis)
    for axis in range(3):
        total = 0.0
        for other in range(3):
            total += matrix[axis, other] * (one[other] - two[other])
        for m in range(TERMS):
            c[axis, m] = total


@kernel()
def meet(table, errors, a, b, matrix, z, p, c, off, low, high):
    """Fill `c` with the polynomial of a less b over angles [low, high], and `off` with its error."""
    joints, rows = table[1], table[3]
    k = int(a[WINDOW])
    if b[WINDOW] != a[WINDOW]:  # the instant between two windows
        at_once(table, a, b, matrix, z, c, low)
        off[:] = 0.0
        return
    count = subtract(a, b, z)
    polynomial(rows, k, z, count, matrix, p, c)
    slack(errors, k, z, count, matrix, c, off)
    first, last = share(joints, k, a[ORIGIN], low), share(joints, k, a[ORIGIN], high)
    if first > 0.0 or last < 1.0:
        keep(c, first, last, p[0])


@kernel()
def near_between(angles, near, low, high):
    """Return True if any marked piece overlaps angles [low, high]."""
    first, last = 0, len(angles) - 1
    while last - first > 1:
        middle = (first + last) // 2
        if angles[middle] <= low:
            first = middle
        else:
            last = middle
    while first < len(near) and angles[first] < high:
        if near[first]:
            return True
        first += 1
    return False


@kernel()
def pair_conflicts(
    table, errors, segs, i, i_end, others, j, j_end, form, angles, near, work, pair, rows, count
):
    """Append the conflicts of one pair in angles; return the new count, even if they do not fit."""
    shape, matrix, faces = form
    z, p, c, off, stack, ends, places, outs = work
    begin = max(segs[i, FIRST], others[j, FIRST])
    finish = min(segs[i_end - 1, LAST], others[j_end - 1, LAST])
    first, inside, entry = count, False, begin
    while i < i_end and j < j_end:
        low, high = max(segs[i, FIRST], others[j, FIRST]), min(segs[i, LAST], others[j, LAST])
        if low < high or (low == high and begin == finish):
            if not inside and len(near) > 0 and not near_between(angles, near, low, high):
                clear = True
            else:
                meet(table, errors, segs[i], others[j], matrix, z, p, c, off, low, high)
                clear = excluded(shape, faces, c, off, stack[0])
            if clear:
                if inside:
                    count = append(rows, count, first, pair, entry, low)
                    inside = False
            else:
                number, out = window_changes(shape, faces, c, off, stack, ends, places, outs)
                if inside and out > 0:
                    count = append(rows, count, first, pair, entry, low)
                elif not inside and out == 0:
                    entry = low
                inside = out == 0
                for m in range(number):
                    out += outs[m]
                    if (out == 0) != inside:
                        at = low + places[m] * (high - low)
                        if inside:
                            count = append(rows, count, first, pair, entry, at)
                        else:
                            entry = at
                        inside = not inside
        a_last, b_last = segs[i, LAST], others[j, LAST]
        i += 1 if a_last <= b_last else 0
        j += 1 if b_last <= a_last else 0
    if inside:
        count = append(rows, count, first, pair, entry, finish)
    return count


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


@kernel()
def closest(table, errors, segs, i, i_end, others, j, j_end, form, since, until, work, pieces):
    """Return the minimum norm of a pair over angles [since, until], and its angle."""
    shape, matrix, faces = form
    z, p, c, off, f, ends = work
    best, at = inf, nan
    while i < i_end and j < j_end:
        low = max(segs[i, FIRST], others[j, FIRST], since)
        high = min(segs[i, LAST], others[j, LAST], until)
        if low < high or (low == high and since == until and at != at):
            meet(table, errors, segs[i], others[j], matrix, z, p, c, off, low, high)
            least, u = minimum(shape, faces, c, pieces, ends, f, best, nan)
            if least < best:
                best, at = least, low + u * (high - low)
        if low > until:
            break
        a_last, b_last = segs[i, LAST], others[j, LAST]
        i += 1 if a_last <= b_last else 0
        j += 1 if b_last <= a_last else 0
    return best, at


@kernel()
def common(segs, i, i_end, others, j, j_end):
    """Return the common times of two paths; the second is before the first if there is none."""
    start = max(segs[i, BEGIN], others[j, BEGIN])
    return start, min(segs[i_end - 1, FINISH], others[j_end - 1, FINISH])


@kernel()
def reaches(segs, first, last, s):
    """Return the first segment in [first, last) that ends at or after an angle."""
    low, high = first, last - 1
    while low < high:
        middle = (low + high) // 2
        if segs[middle, LAST] < s:
            low = middle + 1
        else:
            high = middle
    return low


@kernel()
def instant(clock, s, first, last, start, end):
    """Return the time of an angle in [first, last], which are those of `start` and `end`."""
    if s <= first:
        return start
    return end if s >= last else min(max(time_at(clock, s), start), end)


@kernel()
def meet_segments(scene, one, two):
    """Return False for a pair that never comes near, and the segments and angles from which to search."""
    _, _, segs, firsts, others, other_firsts, _, angles, tracks, other_tracks, near, _, _, _ = scene
    i, i_end, j, j_end = firsts[one], firsts[one + 1], other_firsts[two], other_firsts[two + 1]
    start, end = common(segs, i, i_end, others, j, j_end)
    since = max(segs[i, FIRST], others[j, FIRST])
    until = min(segs[i_end - 1, LAST], others[j_end - 1, LAST])
    begin = i, i_end, j, j_end, start, end, since, until
    if not start <= end:
        return False, begin
    if len(near) > 0:
        low, high = 0, len(near)
        while low + 1 < high and angles[low + 1] <= since:
            low += 1
        while high > low + 1 and angles[high - 1] >= until:
            high -= 1
        if count_near(tracks, one, other_tracks, two, low, high) == 0:
            return False, begin
        for k in range(len(near)):
            near[k] = low <= k < high and count_near(tracks, one, other_tracks, two, k, k + 1) > 0
    return True, begin


@kernel()
def search_segments(scene, begin, pair, rows, count):
    """Append the conflicts of a pair in angles; return the new count."""
    table, errors, segs, _, others, _, form, angles, _, _, near, work, _, _ = scene
    i, i_end, j, j_end, _, _, since, _ = begin
    i, j = reaches(segs, i, i_end, since), reaches(others, j, j_end, since)
    pairs = segs, i, i_end, others, j, j_end
    return pair_conflicts(table, errors, *pairs, form, angles, near, work, pair, rows, count)


@kernel()
def nearest_segments(scene, begin, row):
    """Write the time of the minimum norm in a conflict, and the minimum, and turn its angles into times."""
    table, errors, segs, _, others, _, form, _, _, _, _, _, work, pieces = scene
    i, i_end, j, j_end, start, end, since, until = begin
    i, j = reaches(segs, i, i_end, row[1]), reaches(others, j, j_end, row[1])
    pairs = segs, i, i_end, others, j, j_end
    row[4], at = closest(table, errors, *pairs, form, row[1], row[2], work, pieces)
    clock = table[0]
    row[3] = instant(clock, at, since, until, start, end)
    row[1] = instant(clock, row[1], since, until, start, end)
    row[2] = instant(clock, row[2], since, until, start, end)


@kernel(
    int64(
        *(TABLE, float64[:, ::1], float64[:, ::1], int64[::1], float64[:, ::1], int64[::1]),
        *(int64[::1], int64[::1], int64, FORM, float64[::1], float64[:, :, ::1], float64[:, :, ::1]),
        *(float64[:, ::1], int64[::1]),
    )
)
def conflicts_of_pairs(
    table,
    errors,
    segs,
    firsts,
    others,
    other_firsts,
    first,
    second,
    pair,
    form,
    angles,
    tracks,
    other_tracks,
    rows,
    done,
):
    """Fill `rows` with conflicts of pairs, as `pair_search.conflicts_from`."""
    clock, joints, turn, rows_of, steps = table
    table = borrowed(clock), borrowed(joints), turn, borrowed(rows_of), borrowed(steps)
    errors, segs, others, rows = borrowed(errors), borrowed(segs), borrowed(others), borrowed(rows)
    firsts, other_firsts = borrowed(firsts), borrowed(other_firsts)
    tracks, other_tracks, angles = borrowed(tracks), borrowed(other_tracks), borrowed(angles)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    room = 2 * SQUARE + 2 * TERMS * (6 + len(form[2]))
    places, outs = np.empty(room), np.empty(room, dtype=np.int64)
    z, p, c, off = stack_vector(COLUMNS), stack_matrix(3, TERMS), stack_matrix(3, TERMS), stack_vector(3)
    ends, pieces = stack_vector(DEPTH), stack_matrix(DEEP, TERMS)
    work = z, p, c, off, stack_matrix(DEPTH, SQUARE), ends, borrowed(places), borrowed(outs)
    least_work = z, p, c, off, stack_vector(SQUARE), ends
    near = np.empty(max(0, len(angles) - 1), dtype=np.bool_)
    scene = (
        *(table, errors, segs, firsts, others, other_firsts, form),
        *(angles, tracks, other_tracks, borrowed(near), work, least_work, pieces),
    )
    count = conflicts_from(
        meet_segments, search_segments, nearest_segments, scene, first, second, pair, rows, done
    )
    near[:] = False  # counted uses: the loans end here
    places[0], outs[0] = 0.0, 0
    return count


@kernel(
    void(
        TABLE,
        float64[:, ::1],
        float64[:, ::1],
        int64[::1],
        float64[:, ::1],
        int64[::1],
        int64[::1],
        int64[::1],
        FORM,
        float64[:, ::1],
    )
)
def approaches_of_pairs(table, errors, segs, firsts, others, other_firsts, first, second, form, out):
    """Fill `out` (P, 2) with the time and the minimum norm of every pair over its common time."""
    clock, joints, turn, rows_of, steps = table
    table = borrowed(clock), borrowed(joints), turn, borrowed(rows_of), borrowed(steps)
    errors, segs, others = borrowed(errors), borrowed(segs), borrowed(others)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    z, p, c, off = stack_vector(COLUMNS), stack_matrix(3, TERMS), stack_matrix(3, TERMS), stack_vector(3)
    work, pieces = (z, p, c, off, stack_vector(SQUARE), stack_vector(DEPTH)), stack_matrix(DEEP, TERMS)
    for m in range(len(first)):
        i, i_end = firsts[first[m]], firsts[first[m] + 1]
        j, j_end = other_firsts[second[m]], other_firsts[second[m] + 1]
        out[m, 0], out[m, 1] = nan, inf
        start, end = common(segs, i, i_end, others, j, j_end)
        if start <= end:
            since = max(segs[i, FIRST], others[j, FIRST])
            until = min(segs[i_end - 1, LAST], others[j_end - 1, LAST])
            i, j = reaches(segs, i, i_end, since), reaches(others, j, j_end, since)
            least, at = closest(
                table, errors, segs, i, i_end, others, j, j_end, form, since, until, work, pieces
            )
            out[m, 0], out[m, 1] = instant(table[0], at, since, until, start, end), least


@kernel()
def many_off(joints, rows, errors, segs, q, last, low, high, matrix, chord, p, c, left):
    """Return the largest distance from their chord of all segments from q on that begin before `high`.

    The chord's end, which is that of the last of them, is filled in.
    """
    end, most, off = q + 1, 0.0, np.empty(3)
    while end < last and segs[end, FIRST] < high - ON_JOINT:
        end += 1
    for m in range(end - 1, q - 1, -1):
        row = segs[m]
        window = int(row[WINDOW])
        polynomial(rows, window, row[COLUMN:], COLUMNS, matrix, p, c)
        slack(errors, window, row[COLUMN:], COLUMNS, matrix, c, off)
        first, final = share(joints, window, row[ORIGIN], low), share(joints, window, row[ORIGIN], high)
        keep(c, first, final, left)
        for axis in range(3 if m == end - 1 else 0):
            chord[axis, 1] = c[axis, TERMS - 1]
        for b in range(TERMS):
            part = b / (TERMS - 1.0)
            square = 0.0
            for axis in range(3):
                square += (c[axis, b] - (1.0 - part) * chord[axis, 0] - part * chord[axis, 1]) ** 2
            most = max(most, sqrt(square) + off[0] + off[1] + off[2])
    return most


@kernel(
    void(
        TABLE,
        float64[:, ::1],
        float64[:, :, :, ::1],
        float64[:, ::1],
        int64[::1],
        float64[:, ::1],
        float64[::1],
        float64[:, :, ::1],
    )
)
def fill_tracks(table, errors, apart, segs, firsts, matrix, angles, tracks):
    """Fill the tracks (N, 4, K + 1) of all spacecraft at `angles`; entries outside of a path stay unchanged.

    A track has the position at each angle in coordinates of a ball, and the largest deviation from the
    chord to the next one: the hull of the polynomial less its chord.  `apart` has the
    rows of that difference for equal pieces of each window (see `Table.apart`).
    """
    joints, rows, errors, apart = borrowed(table[1]), borrowed(table[3]), borrowed(errors), borrowed(apart)
    segs, matrix, angles, tracks = borrowed(segs), borrowed(matrix), borrowed(angles), borrowed(tracks)
    p, c, off, chord, left = (
        stack_matrix(3, TERMS),
        stack_matrix(3, TERMS),
        stack_vector(3),
        stack_matrix(3, 2),
        stack_vector(TERMS),
    )
    pieces = len(apart) // (len(joints) - 1)
    for craft in range(len(firsts) - 1):
        track, q, last = tracks[craft], firsts[craft], firsts[craft + 1]
        count, known, before = 0, -1, -1
        for k in range(len(angles) - 1):
            low, high = angles[k], angles[k + 1]
            while q + 1 < last and segs[q, LAST] <= low + ON_JOINT:
                q += 1
            if segs[q, FIRST] >= high or segs[last - 1, LAST] < low:
                continue
            row = segs[q]
            window = int(row[WINDOW])
            if known != q:
                count, known = columns_in(row), q
                polynomial(rows, window, row[COLUMN:], count, matrix, p, c)
                slack(errors, window, row[COLUMN:], count, matrix, c, off)
            piece = window * pieces + int(pieces * share(joints, window, row[ORIGIN], 0.5 * (low + high)))
            polynomial(apart, min(piece, len(apart) - 1), row[COLUMN:], count, matrix, p, c)
            most = 0.0
            for b in range(1, TERMS - 1):
                most = max(most, c[0, b] * c[0, b] + c[1, b] * c[1, b] + c[2, b] * c[2, b])
            reach = sqrt(most) + off[0] + off[1] + off[2]
            for axis in range(3):
                chord[axis, 0], chord[axis, 1] = c[axis, 0], c[axis, TERMS - 1]
            if q + 1 < last and segs[q + 1, FIRST] < high - ON_JOINT:
                reach = many_off(joints, rows, errors, segs, q, last, low, high, matrix, chord, p, c, left)
            for axis in range(3):
                if before == k:  # a jump of position that `join` accepts
                    track[OFF_CHORD, k - 1] += abs(track[axis, k] - chord[axis, 0])
                track[axis, k], track[axis, k + 1] = chord[axis, 0], chord[axis, 1]
            track[OFF_CHORD, k], before = reach, k + 1
