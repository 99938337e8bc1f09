"""Conflicts by the method of SP11: zero crossings per axis, timelines and their overlap.

Each axis of the relative motion is a distance function f, which crosses the half-width of the zone where
f - delta or f + delta is zero. Every half period of the oscillation starts a search by secants, with
bisection as safeguard. The intervals within the tolerance are the timeline of an axis. The overlap of the
three timelines is the conflict with the box [SP11 eqs. 12-14, 17-19 and figure 1]. For an ellipsoid the
function of SP11 eq. 16 is searched within each overlap.

The paper does not specify where its half periods begin and how the ellipsoid is searched. This module makes
favourable choices. Half periods begin at the extremes of natural motion, and at the peaks of the distance
function for optimal paths. Their half periods vary, and are searched from every quarter of a period; from
every half, a third of the conflicts would be missed. The ellipsoid search starts at its minimum in the
overlap. Between two starts the method finds at most one crossing of each line, so it misses conflicts of some
drifting or thrusting spacecraft. It is compiled, so that the comparison is one of methods.
"""

from math import atan2, cos, floor, pi, sin

import numba
import numpy as np

from peers.motion import Array

SEEDS = 512  # half periods: 250 orbits
ROOM = 256  # spells of one timeline
TOLERANCE = 1e-9  # radians of n t; a microsecond in low orbit
LINE, PEAK, SURFACE, LEAST = range(4)  # whose zero is sought

compiled = numba.njit(nogil=True, error_model="numpy", cache=True)


@compiled
def distance(a, t):
    """One axis's distance function, its eight coefficients in `a`, at the angle t."""
    secular = a[0] + t * (a[1] + t * (a[2] + t * a[3]))
    return secular + (a[4] + a[6] * t) * cos(t) + (a[5] + a[7] * t) * sin(t)


@compiled
def slope(a, t):
    c, s = cos(t), sin(t)
    secular = a[1] + t * (2.0 * a[2] + t * 3.0 * a[3])
    return secular + (a[6] + a[5] + a[7] * t) * c + (a[7] - a[4] - a[6] * t) * s


@compiled
def ellipsoid(d, t):
    """SP11 eq. 16, zero on the surface; rows of d in units of the semi-axes."""
    return distance(d[0], t) ** 2 + distance(d[1], t) ** 2 + distance(d[2], t) ** 2 - 1.0


@compiled
def ellipsoid_slope(d, t):
    return (
        distance(d[0], t) * slope(d[0], t)
        + distance(d[1], t) * slope(d[1], t)
        + distance(d[2], t) * slope(d[2], t)
    )


@compiled
def value(kind, d, axis, line, t):
    if kind == LINE:
        return distance(d[axis], t) - line
    if kind == PEAK:
        return slope(d[axis], t)
    return ellipsoid(d, t) if kind == SURFACE else ellipsoid_slope(d, t)


@compiled
def crossing(kind, d, axis, line, low, high):
    """Root between low and high, where the function changes sign: secants; halving where they leave."""
    before, last = low, high
    f_before, f_last = value(kind, d, axis, line, low), value(kind, d, axis, line, high)
    rising = f_last > f_before
    while high - low > TOLERANCE:
        t = last - f_last * (last - before) / (f_last - f_before)
        if not low < t < high:
            t = 0.5 * (low + high)
        f = value(kind, d, axis, line, t)
        if (f < 0.0) == rising:
            low = t
        else:
            high = t
        before, f_before, last, f_last = last, f_last, t, f
        if abs(last - before) <= TOLERANCE or f == 0.0:
            return t
    return 0.5 * (low + high)


@compiled
def seeds(d, axis, end, out):
    """Start, end and in between the extremes or peaks, a half period apart; returns how many."""
    a = d[axis]
    thrust = a[2] != 0.0 or a[3] != 0.0 or a[6] != 0.0 or a[7] != 0.0
    extreme = atan2(a[5], a[4])
    t = 0.0 if thrust else extreme - pi * floor(extreme / pi)
    out[0] = 0.0
    count = 1
    while t < end and count < len(out) - 1:
        if thrust:
            after = min(t + 0.5 * pi, end)
            if slope(a, t) * slope(a, after) < 0.0:
                out[count] = crossing(PEAK, d, axis, 0.0, t, after)
                count += 1
            t = after
        else:
            if t > 0.0:
                out[count] = t
                count += 1
            t += pi
    out[count] = end
    return count + 1


@compiled
def timeline(d, axis, end, spells):
    """Spells of one axis within its tolerance (rows of `spells`); returns how many."""
    at = np.empty(SEEDS)
    count = seeds(d, axis, end, at)
    found = 0
    begin = 0.0 if abs(distance(d[axis], 0.0)) <= 1.0 else -1.0
    for k in range(count - 1):
        left, right = distance(d[axis], at[k]), distance(d[axis], at[k + 1])
        for turn in range(2):
            line = 1.0 if (turn == 0) == (left > right) else -1.0  # in the order of crossing
            if (left - line) * (right - line) >= 0.0:
                continue
            t = crossing(LINE, d, axis, line, at[k], at[k + 1])
            if begin < 0.0:
                begin = t
            elif found < len(spells):
                spells[found, 0], spells[found, 1] = begin, t
                found += 1
                begin = -1.0
    if begin >= 0.0 and found < len(spells):
        spells[found, 0], spells[found, 1] = begin, end
        found += 1
    return found


@compiled
def overlap(a, count_a, b, count_b, out):
    """Common part of two timelines."""
    i, j, found = 0, 0, 0
    while i < count_a and j < count_b:
        begin, end = max(a[i, 0], b[j, 0]), min(a[i, 1], b[j, 1])
        if begin <= end and found < len(out):
            out[found, 0], out[found, 1] = begin, end
            found += 1
        if a[i, 1] < b[j, 1]:
            i += 1
        else:
            j += 1
    return found


@compiled
def within_ellipsoid(d, begin, end):
    """First and last time inside the ellipsoid during one spell inside its box; begin > end if none."""
    least = begin
    if ellipsoid_slope(d, begin) < 0.0:
        least = end if ellipsoid_slope(d, end) <= 0.0 else crossing(LEAST, d, 0, 0.0, begin, end)
    if ellipsoid(d, least) > 0.0:
        return 1.0, 0.0
    if ellipsoid(d, begin) > 0.0:
        begin = crossing(SURFACE, d, 0, 0.0, begin, least)
    if ellipsoid(d, end) > 0.0:
        end = crossing(SURFACE, d, 0, 0.0, least, end)
    return begin, end


@compiled
def pair_conflicts(d, end, box, lines, both, spells):
    """Spells in the zone of one relative motion in units of its half-widths; returns how many."""
    count_x = timeline(d, 0, end, lines[0])
    count_y = timeline(d, 1, end, lines[1])
    count_z = timeline(d, 2, end, lines[2])
    count = overlap(lines[0], count_x, lines[1], count_y, both)
    count = overlap(both, count, lines[2], count_z, spells)
    if box:
        return count
    found = 0
    for k in range(count):
        begin, finish = within_ellipsoid(d, spells[k, 0], spells[k, 1])
        if begin <= finish:
            spells[found, 0], spells[found, 1] = begin, finish
            found += 1
    return found


@compiled
def search(paths, i, end, half_widths, box, rows):
    """Rows (i, j, begin, end) of spacecraft i with all later ones; returns how many, stored or not."""
    lines, both, spells = np.empty((3, ROOM, 2)), np.empty((ROOM, 2)), np.empty((ROOM, 2))
    found = 0
    for j in range(i + 1, len(paths)):
        d = paths[j] - paths[i]
        for axis in range(3):
            d[axis] /= half_widths[axis]
        for k in range(pair_conflicts(d, end, box, lines, both, spells)):
            if found < len(rows):
                rows[found, 0], rows[found, 1] = i, j
                rows[found, 2], rows[found, 3] = spells[k, 0], spells[k, 1]
            found += 1
    return found


def conflicts(paths: Array, duration: float, n: float, half_widths: Array, *, box: bool) -> Array:
    """Rows (i, j, begin, end) [s] of motions (N, 3, 8) of `peers.motion`, sorted by pair, then begin."""
    sizes = np.asarray(half_widths, dtype=float)
    rows = np.empty((16_384, 4))
    spells = []
    for i in range(len(paths)):  # one spacecraft at a time: room for its rows
        found = search(paths, i, n * duration, sizes, box, rows)
        if found > len(rows):
            rows = np.empty((2 * found, 4))
            found = search(paths, i, n * duration, sizes, box, rows)
        spells.append(rows[:found] / np.array([1, 1, n, n]))
    return np.concatenate(spells)


def timelines(path: Array, duration: float, n: float, half_widths: Array) -> list[Array]:
    """The three axes' timelines of one relative motion (3, 8) [s], as under SP11 figure 1."""
    d = path / np.asarray(half_widths)[:, None]
    spells = np.empty((ROOM, 2))
    return [spells[: timeline(d, axis, n * duration, spells)] / n for axis in range(3)]
