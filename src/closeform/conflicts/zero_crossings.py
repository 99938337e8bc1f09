"""Conflicts by the method of SP11 (Sauter and Palmer 2011): zero crossings along each axis.

Each axis of the relative motion is a distance function f, which crosses the half-width of the zone where
f - delta or f + delta is zero. Every half period of the oscillation starts a search by secants, with
bisection as safeguard. The intervals within the tolerance are the timeline of an axis. The overlap of the
three timelines is the conflict with the box [SP11 eqs. 12-14, 17-19 and figure 1]. For an ellipsoid the
function of SP11 eq. 16 is searched within each overlap.

The paper does not specify where its half periods begin and how the ellipsoid is searched. This module makes
favourable choices. Half periods begin at the extremes of natural motion, and at the peaks of the distance
function for optimal paths. Their half periods vary, and are searched from every quarter of a period; from
every half, a third of the conflicts would be missed. The ellipsoid search starts at its minimum in the
overlap. Between two starts the method finds at most one crossing of each line. So it misses some short
conflicts of drifting or thrusting spacecraft, and some short exits from a conflict.
"""

from __future__ import annotations

from math import atan2, ceil, cos, floor, pi, sin

import numpy as np

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.motion.arc import MEAN_MOTION, PUSH, START, derivatives_at, thrusts
from closeform.motion.path import Path
from closeform.zones.shapes import BALL, CUBE
from closeform.zones.zone import Zone

TOLERANCE = 1e-9  # radians of n t; a microsecond in low orbit
LINE, PEAK, SURFACE, LEAST = range(4)  # whose zero is sought
SAMPLES, ZOOMS = 129, 6  # of a conflict, for its minimum norm


def capacity(angle: float) -> int:
    """Return the maximum number of spells of a timeline over `angle` = n t: one per start of a search."""
    return ceil(2.0 * angle / pi) + 4


@kernel()
def distance(a, t):
    """Return one axis's distance function at the angle t, from its eight coefficients `a`.

    They are those of 1, t, t^2, t^3, cos t, sin t, t cos t and t sin t; natural motion has no others than of
    1, t, cos t and sin t.  # SP11 eqs. 12-14 and 17-19
    """
    secular = a[0] + t * (a[1] + t * (a[2] + t * a[3]))
    return secular + (a[4] + a[6] * t) * cos(t) + (a[5] + a[7] * t) * sin(t)


@kernel()
def slope(a, t):
    c, s = cos(t), sin(t)
    secular = a[1] + t * (2.0 * a[2] + t * 3.0 * a[3])
    return secular + (a[6] + a[5] + a[7] * t) * c + (a[7] - a[4] - a[6] * t) * s


@kernel()
def ellipsoid(d, t):
    """Return SP11 eq. 16, zero on the surface; rows of d in units of the semi-axes."""
    return distance(d[0], t) ** 2 + distance(d[1], t) ** 2 + distance(d[2], t) ** 2 - 1.0


@kernel()
def ellipsoid_slope(d, t):
    return (
        distance(d[0], t) * slope(d[0], t)
        + distance(d[1], t) * slope(d[1], t)
        + distance(d[2], t) * slope(d[2], t)
    )


@kernel()
def value(kind, d, axis, line, t):
    if kind == LINE:
        return distance(d[axis], t) - line
    if kind == PEAK:
        return slope(d[axis], t)
    return ellipsoid(d, t) if kind == SURFACE else ellipsoid_slope(d, t)


@kernel()
def crossing(kind, d, axis, line, low, high):
    """Return the root between low and high, by secants, or halves where these leave the bracket."""
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


@kernel()
def seeds(d, axis, end, out):
    """Fill in start, end and the extremes or peaks in between, half a period apart; return their number."""
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


@kernel()
def timeline(d, axis, end, spells):
    """Fill in the spells of one axis within its tolerance, rows of `spells`; return their number."""
    at = np.empty(len(spells))
    count = seeds(d, axis, end, at)
    found = 0
    begin = 0.0 if abs(distance(d[axis], 0.0)) <= 1.0 else -1.0
    for k in range(count - 1):
        left, right = distance(d[axis], at[k]), distance(d[axis], at[k + 1])
        for turn in range(2):
            line = 1.0 if (turn == 0) == (left > right) else -1.0  # in the order of crossing
            if (line * left > 1.0) == (line * right > 1.0):
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


@kernel()
def overlap(a, count_a, b, count_b, out):
    """Fill in the common spells of two timelines; return their number."""
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


@kernel()
def within_ellipsoid(d, begin, end):
    """Return the first and last time inside the ellipsoid in one spell in its box; begin > end if none."""
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


@kernel()
def pair_conflicts(d, end, box, lines, both, spells):
    """Fill in the spells in the zone of a motion `d` in units of its half-widths; return their number.

    `lines` has room for a timeline of each axis, `both` and `spells` for three timelines.
    """
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


@kernel()
def distance_functions(arc, other, t, matrix):
    """Return the coefficients (3, 8) of the relative motion of two arcs from t on, in zone coordinates."""
    n = arc[MEAN_MOTION]
    thrust = thrusts(arc) or thrusts(other)
    f = np.zeros((8, 3))  # derivatives with respect to n t
    derivatives_at(arc, t, 8, f, 1.0)
    derivatives_at(other, t, 8, f, -1.0)
    a = np.zeros((8, 3))
    for k in range(3):
        for j in range(8):
            f[j, k] /= n**j
        if thrust:
            a[6, k], a[7, k] = -0.5 * (f[5, k] + f[7, k]), 0.5 * (f[4, k] + f[6, k])
            a[4, k], a[5, k] = f[4, k] + 4.0 * a[7, k], f[5, k] - 5.0 * a[6, k]
            a[2, k] = 0.5 * (f[2, k] + a[4, k] - 2.0 * a[7, k])
            a[3, k] = (f[3, k] + a[5, k] + 3.0 * a[6, k]) / 6.0
        else:
            a[4, k], a[5, k] = -f[2, k], -f[3, k]
        a[0, k], a[1, k] = f[0, k] - a[4, k], f[1, k] - a[5, k] - a[6, k]
    d = np.zeros((3, 8))
    for i in range(3):
        for j in range(8):
            for k in range(3):
                d[i, j] += matrix[i, k] * a[j, k]
    return d


def conflicts_of_arcs(
    arc: Floats, other: Floats, start: float, end: float, box: bool, matrix: Floats, spells: Floats
) -> int:
    """Fill in the conflicts (begin, end) of two arcs from `start` to `end` [s]; return their number."""
    n = arc[MEAN_MOTION]
    d = distance_functions(arc, other, start, matrix)
    room = len(spells) // 3
    lines, both = np.empty((3, room, 2)), np.empty((3 * room, 2))
    count: int = pair_conflicts(d, n * (end - start), box, lines, both, spells)
    for k in range(count):
        spells[k, 0], spells[k, 1] = start + spells[k, 0] / n, min(start + spells[k, 1] / n, end)
    return count


def check_applicable(path: Path, other: Path, zone: Zone) -> None:
    """Raise ValueError if the method of SP11 does not cover the orbit, the zone or the thrust."""
    n = path.orbit._column
    if not n > 0.0:
        raise ValueError("method: 'sauter-palmer' requires a circular orbit; use 'exact'")
    if zone.shape not in (BALL, CUBE):
        raise ValueError("zone: method 'sauter-palmer' requires a Box or an Ellipsoid; use 'exact'")
    for name, one in (("path", path), ("other", other)):
        if one.arcs[:, PUSH:].any() or (one.arcs[:, MEAN_MOTION] != n).any():
            raise ValueError(
                f"{name}: method 'sauter-palmer' requires coasts, impulses and transfers of minimum energy; "
                "use 'exact'"
            )


def zero_crossings(path: Path, other: Path, zone: Zone) -> Floats:
    """Return start, end, time of the minimum norm and this norm (M, 4) of the conflicts that SP11 finds."""
    check_applicable(path, other, zone)
    first, last = max(path.start, other.start), min(path.end, other.end)
    starts = np.unique(np.concatenate([path.arcs[:, START], other.arcs[:, START], [first, last]]))
    edges = starts[(starts >= first) & (starts <= last)]
    found: list[list[float]] = []
    for begin, end in zip(edges, edges[1:], strict=False):
        spells = np.empty((3 * capacity(path.orbit.mean_motion * (end - begin)), 2))
        arcs = arc_at(path, begin), arc_at(other, begin)
        count = conflicts_of_arcs(*arcs, begin, end, zone.shape == CUBE, zone.matrix, spells)
        for spell in spells[:count].tolist():
            if found and found[-1][1] == begin == spell[0]:  # it goes on from one arc to the next
                found[-1][1] = spell[1]
            else:
                found.append(spell)
    return np.array([[*spell, *_minimum(path, other, zone, *spell)] for spell in found]).reshape(-1, 4)


def arc_at(path: Path, time: float) -> Floats:
    """Return the row of a path's arc that begins or continues at a time."""
    arc: Floats = path.arcs[np.searchsorted(path.arcs[:, START], time, side="right") - 1]
    return arc


def _minimum(path: Path, other: Path, zone: Zone, begin: float, end: float) -> tuple[float, float]:
    """Return the time and the value of the smallest sampled norm, with samples ever closer around it."""
    low, high = begin, end
    for _ in range(ZOOMS):
        times = np.linspace(low, high, SAMPLES)
        norms = zone.norm(path.position(times) - other.position(times))
        k = int(norms.argmin())
        low, high = times[max(k - 1, 0)], times[min(k + 1, SAMPLES - 1)]
    return float(times[k]), float(norms[k])
