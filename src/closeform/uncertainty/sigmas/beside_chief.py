"""k-sigma tubes about any chief, certified by the hulls of polynomials.

In a window (see `table_windows`) the mean r_0 and the columns r_j are Bernstein polynomials of u.  With a
plane a of unit polar norm, l_j = a . r_j, and their coefficients b,

    |l(u)| <= sum B_b(u) |l_b|,   so   a . r_0(u) - k |l(u)| >= min over b of (a . r_0b - k |l_b|)

and one plane keeps k sigmas out of the zone for a whole piece of a window where the right side exceeds 1.
Planes are the best ones at the middles of pieces, as in `tube`; a piece that its plane does not clear is
halved.  From inside, errors that lead into the zone at the middle keep the whole piece inside where all
coefficients are: the zone is convex.  A piece too short to halve counts as inside.

Places are numbers: window w at u is w + u.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan, sqrt
from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.conflicts.two_paths import each_pair
from closeform.kernel_loans import lent, stack_matrix, stack_vector
from closeform.motion.chief.bernstein import TERMS, keep_piece, value_at
from closeform.motion.chief.clock import times_at
from closeform.motion.path import Path
from closeform.uncertainty.covariance_propagation import compress
from closeform.uncertainty.error_columns import columns_of_pair
from closeform.uncertainty.sigmas.tube import (
    NEVER,
    TUBE,
    WIDTH,
    fill_square,
    gap_at_sigmas,
    level_here,
    position_inside,
    tube_for,
)
from closeform.uncertainty.table_windows import table_windows
from closeform.zones.shapes import norm
from closeform.zones.zone import Zone

PRECISION = 1e-10  # relative accuracy of the minimum level
# Pieces after which the accuracy is halved again and again: a tube that touches a zone for a long time.
MANY = 20_000
NARROWEST = 1e-13  # of a window: a piece that counts as an instant
SAMPLES = 8  # of a window, to begin with a level near the lowest
DEPTH = 60  # pieces in work
CLEAR = 1.0 + 1e-12  # norm beyond which a plane is clear, above rounding
# A norm beyond 1 by up to WIDE times what a plane needs to be clear may count as inside, so that a tube that
# hardly enters is not cut into millions of pieces; the middle of a piece decides at AMID which is tried.
AMID, WIDE = 2.0, 4.0
SHORT = 64.0  # rounding of positions, in units of the last place of the largest coefficient
WINDOWS, BOUNDS = float64[:, :, :, ::1], float64[:, :, ::1]


@kernel()
def place_tube(tube, window, u, columns):
    """Fill the tube with the mean and its covariance at u; return the mean's norm.

    `columns` (6, K) is room for the columns, of which a root of three is kept.
    """
    place, at, many = tube.place, tube.at, len(window) - 1
    columns[:] = 0.0
    for i in range(3):
        place[i], place[3 + i] = value_at(window[0, :, i], TERMS, u)
        for j in range(many):
            columns[i, j] = value_at(window[1 + j, :, i], TERMS, u)[0]
    compress(columns, columns.shape[1])
    for j in range(3):
        for i in range(3):
            at[0, 3 * j + i], at[1, 3 * j + i] = columns[i, j], 0.0
    tube.state[WIDTH] = 9
    fill_square(tube)
    return norm(tube.shape, tube.faces, place[0], place[1], place[2])


@kernel()
def projected(tube, window, off, low, high, lines, left):
    """Fill `lines` (2, 12) with lower bounds of a . r_0 over a piece, and upper bounds of |l|.

    They belong to the coefficients. `off` (N, 3) are the errors of the polynomials along the axes.  Returns
    the error of a . r_0, and that of |l|.
    """
    x, y, z = tube.best[0], tube.best[1], tube.best[2]
    most, ahead, wide = 0.0, 0.0, 0.0
    for j in range(len(window)):
        for b in range(TERMS):
            left[0, b] = x * window[j, b, 0] + y * window[j, b, 1] + z * window[j, b, 2]
            most = max(most, abs(left[0, b]))
        keep_piece(left[0], low, high, left[1])
        wrong = abs(x) * off[j, 0] + abs(y) * off[j, 1] + abs(z) * off[j, 2] + SHORT * 2.2e-16 * most
        for b in range(TERMS):
            if j == 0:
                lines[0, b], lines[1, b] = left[0, b] - wrong, 0.0
            else:
                lines[1, b] += (abs(left[0, b]) + wrong) ** 2
        if j == 0:
            ahead = wrong
        else:
            wide += wrong**2
    for b in range(TERMS):
        lines[1, b] = sqrt(lines[1, b])
    return ahead, sqrt(wide)


@kernel()
def level_of_piece(lines, k):
    """Return the level up to which a plane separates both over a piece; `k` as for `tube.level`."""
    best = inf
    for b in range(TERMS):
        ahead, wide = lines[0, b], lines[1, b]
        if k < 0.0:
            here = 0.0 if ahead <= 1.0 else ((ahead - 1.0) / wide if wide > 0.0 else inf)
        else:
            here = max(ahead / (1.0 + k * wide), 0.0)
        best = min(best, here)
    return best


@kernel()
def level_at(tube, window, u, k, columns):
    """Return the level at u, as `tube.level`."""
    if place_tube(tube, window, u, columns) <= (1.0 if k < 0.0 else 0.0):
        return 0.0
    return level_here(tube, k, 0.0, inf, True)


@kernel(void(TUBE, WINDOWS, BOUNDS, float64, float64, float64, float64[::1]))
def least_of_windows(tube, windows, off, k, first, last, out):
    """Write the place of the minimum level between two places, and the level; `k` as for `tube.level`."""
    tube = lent(tube)
    columns = np.empty((6, max(6, windows.shape[1])))
    lines, left, ends = stack_matrix(2, TERMS), stack_matrix(2, TERMS), stack_vector(DEPTH)
    best, at, most, pieces = inf, nan, NEVER if k < 0.0 else inf, 0
    begin, stop = int(first), min(int(np.ceil(last)), len(windows))
    for w in range(begin, max(stop, begin + 1)):
        low, high = max(first - w, 0.0), min(last - w, 1.0)
        for m in range(SAMPLES + 1):
            u = low + (high - low) * m / SAMPLES
            here = level_at(tube, windows[w], u, k, columns)
            if here < best:
                best, at = here, w + u
    certain = best
    for w in range(begin, stop):
        low, top = max(first - w, 0.0), 0
        ends[0] = min(last - w, 1.0)
        while top >= 0 and best > 0.0:
            high = ends[top]
            pieces += 1
            allowed = PRECISION * 2.0 ** (pieces // MANY)
            here = level_at(tube, windows[w], 0.5 * (low + high), k, columns)
            if here < best:
                best, at = here, w + 0.5 * (low + high)
            projected(tube, windows[w], off[w], low, high, lines, left)
            bound = level_of_piece(lines, k)
            done = bound >= min(best * (1.0 - allowed), most)
            if done or high - low < NARROWEST or top + 1 == DEPTH:
                certain = min(certain, bound if done else here)
                low = high
                top -= 1
            else:
                top += 1
                ends[top] = 0.5 * (low + high)
    best = min(best, certain) if best > 0.0 else 0.0
    out[0], out[1] = (nan, inf) if best >= most else (at, best)


@kernel()
def holds_inside(tube, window, u, k, columns, lines, low, high, left, most):
    """Return True if errors that lead into the zone at u keep positions inside over a whole piece.

    Inside is a norm up to `most`.
    """
    used, gap = position_inside(tube, place_tube(tube, window, u, columns), k)
    if not gap < most:
        return False
    share = used / sqrt(tube.along[0]) if tube.along[0] > 0.0 else 0.0
    x, y, z = tube.best[0], tube.best[1], tube.best[2]
    for i in range(3):
        for b in range(TERMS):
            left[0, b] = window[0, b, i]
        for j in range(1, len(window) if used > 0.0 else 1):
            column = window[j]
            length = x * value_at(column[:, 0], TERMS, u)[0] + y * value_at(column[:, 1], TERMS, u)[0]
            length += z * value_at(column[:, 2], TERMS, u)[0]
            for b in range(TERMS):
                left[0, b] -= share * length * column[b, i]
        keep_piece(left[0], low, high, left[1])
        for b in range(TERMS):
            lines[i, b] = left[0, b]
    for b in range(TERMS):
        if norm(tube.shape, tube.faces, lines[0, b], lines[1, b], lines[2, b]) > most:
            return False
    return True


@kernel(int64(TUBE, WINDOWS, BOUNDS, float64, float64[:, ::1]))
def reached(tube, windows, off, k, rows):
    """Fill `rows` with the first and last place of intervals in which k sigmas reach the zone.

    Returns the number of intervals. If they do not fit, the number exceeds the rows.
    """
    tube = lent(tube)
    columns = np.empty((6, max(6, windows.shape[1])))
    lines, left, ends = stack_matrix(3, TERMS), stack_matrix(2, TERMS), stack_vector(DEPTH)
    count, inside = 0, False
    for w in range(len(windows)):
        low, top = 0.0, 0
        ends[0] = 1.0
        while top >= 0:
            high = ends[top]
            middle = 0.5 * (low + high)
            clear, room, gap = False, CLEAR - 1.0, 0.0
            if place_tube(tube, windows[w], middle, columns) > 1.0:
                gap = gap_at_sigmas(tube, k, inf)
            if gap > 1.0:
                ahead, wide = projected(tube, windows[w], off[w], low, high, lines, left)
                room += ahead + k * wide
                clear = True
                for b in range(TERMS):
                    clear = clear and lines[0, b] - k * lines[1, b] > CLEAR
            decided = clear or high - low < NARROWEST or top + 1 == DEPTH
            if not decided and not gap > 1.0 + AMID * room:
                most = 1.0 + WIDE * room
                decided = holds_inside(tube, windows[w], middle, k, columns, lines, low, high, left, most)
            if not decided:
                top += 1
                ends[top] = middle
                continue
            if inside == clear:
                if inside:
                    count += 1
                elif count < len(rows):
                    rows[count, 0] = w + low
                inside = not inside
            if inside and count < len(rows):
                rows[count, 1] = w + high
            low = high
            top -= 1
    return count + 1 if inside else count


class PairTube:
    """Relative motion of two craft about a chief and its errors, in the windows of their common time."""

    def __init__(self, path: Path, other: Path, zone: Zone, errors: Any, other_errors: Any) -> None:
        columns = columns_of_pair(path, other, errors, other_errors)
        self.angles, self.windows, self.off = table_windows(path, other, columns, zone)
        self.tube = tube_for(zone, 0.0)
        self.clock: Floats = path.orbit.chief.table.clock  # type: ignore[attr-defined]
        self.span = max(path.start, other.start), min(path.end, other.end)

    def times(self, places: Floats) -> Floats:
        """Return the times [s] of places."""
        found = times_at(self.clock, np.interp(places, np.arange(len(self.angles)), self.angles))
        found = np.where(places == 0.0, self.span[0], found)
        return np.where(places == len(self.windows), self.span[1], found)

    def least(self, k: float, first: float = 0.0, last: float = inf) -> tuple[float, float]:
        """Return the place of the minimum level between two places, and the level."""
        out = np.empty(2)
        last = min(last, float(len(self.windows)))
        least_of_windows(self.tube, self.windows, self.off, k, first, last, out)
        return float(out[0]), float(out[1])

    def conflicts(self, k: float) -> Floats:
        """Return start, end, time of the minimum and its scale (M, 4) of the conflicts at k sigmas."""
        spans = np.empty((64, 2))
        while (count := reached(self.tube, self.windows, self.off, k, spans)) > len(spans):
            spans = np.empty((count, 2))
        rows = np.empty((count, 4))
        for row, (first, last) in zip(rows, spans[:count].tolist(), strict=True):
            at, ratio = self.least(k, first, last)
            row[:] = *self.times(np.array([first, last, at])), ratio
        return rows


def least_of_all(
    path: Path, other: Path, first: Any, second: Any, zone: Zone, errors: Sequence[Any], others: Sequence[Any]
) -> Floats:
    """Return the time and the sigma level (P, 2) of pairs; nan and inf if no error reaches the zone."""
    found = np.empty((len(first), 2))
    pairs = zip(each_pair(path, other, first, second), first, second, strict=True)
    for row, (paths, one, two) in zip(found, pairs, strict=True):
        pair = PairTube(*paths, zone, errors[one], others[two])
        at, row[1] = pair.least(-1.0)
        row[0] = pair.times(np.array(at)) if np.isfinite(at) else nan
    return found


def conflicts_of_all(
    path: Path,
    other: Path,
    first: Any,
    second: Any,
    zone: Zone,
    errors: Sequence[Any],
    others: Sequence[Any],
    k: float,
) -> tuple[Any, Floats]:
    """Return the pairs (M, 2) and rows (M, 4) of the conflicts of pairs at k sigmas, as `conflicts_of`."""
    index, rows = [np.empty((0, 2), dtype=np.int64)], [np.empty((0, 4))]
    for (mine, its), one, two in zip(each_pair(path, other, first, second), first, second, strict=True):
        if max(mine.start, its.start) <= min(mine.end, its.end):
            rows.append(PairTube(mine, its, zone, errors[one], others[two]).conflicts(k))
            index.append(np.tile(np.array([one, two], dtype=np.int64), (len(rows[-1]), 1)))
    return np.concatenate(index), np.concatenate(rows)
