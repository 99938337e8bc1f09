"""Conflicts from samples of the relative motion of each pair at a fixed step, the common method.

Three compiled variants and one in NumPy:

    each      sine and cosine at each sample of each pair
    table     sine and cosine from one table for all pairs; stops at the first axis outside
    vector    as `table`, by blocks of samples without branches, so that the processor tests eight at
              once; only blocks with a sample inside are searched again
    numpy     positions of all spacecraft at all samples, then array differences

All variants take motions (N, 3, 8) as in `peers.motion`. They find the conflicts of every pair with an
ellipsoid of given semi-axes, or with `box` with the box of those half-widths: rows (i, j, first sample
inside, last sample inside), sorted by pair. Conflicts between two samples are missed.
"""

from math import cos, sin

import numba
import numpy as np
from numpy.typing import NDArray

from peers.motion import Array, functions, position

BLOCK = 256  # best of 64 ... 1024 with rows of 2 KiB; more delays the second look
ROOM = 16_384  # spells of one spacecraft with all others, at first
Rows = NDArray[np.int64]

# Peers may reorder sums (fastmath); without it LLVM tests one sample at a time.
compiled = numba.njit(nogil=True, fastmath=True, error_model="numpy", cache=True)


@compiled
def note(rows, found, i, j, k):
    """Extend the last row if sample k follows it, else begin one; counts rows beyond the room too."""
    last = found - 1
    if 0 <= last < len(rows) and rows[last, 0] == i and rows[last, 1] == j and rows[last, 3] == k - 1:
        rows[last, 3] = k
        return found
    if found < len(rows):
        rows[found, 0], rows[found, 1], rows[found, 2], rows[found, 3] = i, j, k, k
    return found + 1


@compiled
def square(x, y, z, box):
    """Square of the unit zone's norm."""
    return max(x * x, max(y * y, z * z)) if box else x * x + y * y + z * z


@compiled
def scaled(path, other, weights):
    """Relative motion in units of the zone's half-widths."""
    d = other - path
    for axis in range(3):
        d[axis] *= weights[axis]
    return d


@compiled
def coast_x(d, t, c, s):
    return d[0, 0] + d[0, 4] * c + d[0, 5] * s


@compiled
def coast_y(d, t, c, s):
    return d[1, 0] + d[1, 1] * t + d[1, 4] * c + d[1, 5] * s


@compiled
def coast_z(d, t, c, s):
    return d[2, 4] * c + d[2, 5] * s


@compiled
def thrust_x(d, t, c, s):
    return d[0, 0] + t * (d[0, 1] + t * d[0, 2]) + (d[0, 4] + d[0, 6] * t) * c + (d[0, 5] + d[0, 7] * t) * s


@compiled
def thrust_y(d, t, c, s):
    secular = d[1, 0] + t * (d[1, 1] + t * (d[1, 2] + t * d[1, 3]))
    return secular + (d[1, 4] + d[1, 6] * t) * c + (d[1, 5] + d[1, 7] * t) * s


@compiled
def thrust_z(d, t, c, s):
    return (d[2, 4] + d[2, 6] * t) * c + (d[2, 5] + d[2, 7] * t) * s


def searches(x_at, y_at, z_at):
    """The three compiled searches for motions with the given axes."""

    @compiled
    def each(paths, first, last, angle, samples, weights, box, rows):
        found = 0
        for i in range(first, last):
            for j in range(i + 1, len(paths)):
                d = scaled(paths[i], paths[j], weights)
                for k in range(samples):
                    t = angle * k
                    c, s = cos(t), sin(t)
                    if square(x_at(d, t, c, s), y_at(d, t, c, s), z_at(d, t, c, s), box) <= 1.0:
                        found = note(rows, found, i, j, k)
        return found

    @compiled
    def table(paths, first, last, t, c, s, weights, box, rows):
        found = 0
        for i in range(first, last):
            for j in range(i + 1, len(paths)):
                d = scaled(paths[i], paths[j], weights)
                for k in range(len(t)):
                    x = x_at(d, t[k], c[k], s[k])
                    if abs(x) > 1.0:
                        continue
                    z = z_at(d, t[k], c[k], s[k])
                    if abs(z) > 1.0:
                        continue
                    if square(x, y_at(d, t[k], c[k], s[k]), z, box) <= 1.0:
                        found = note(rows, found, i, j, k)
        return found

    @compiled
    def count(d, t, c, s, box):
        inside = 0
        for k in range(len(t)):
            x, y, z = x_at(d, t[k], c[k], s[k]), y_at(d, t[k], c[k], s[k]), z_at(d, t[k], c[k], s[k])
            inside += 1 if square(x, y, z, box) <= 1.0 else 0
        return inside

    @compiled
    def vector(paths, first, last, t, c, s, weights, box, rows):
        found = 0
        for i in range(first, last):
            for j in range(i + 1, len(paths)):
                d = scaled(paths[i], paths[j], weights)
                for begin in range(0, len(t), BLOCK):
                    end = begin + BLOCK
                    if count(d, t[begin:end], c[begin:end], s[begin:end], box) == 0:
                        continue
                    for k in range(begin, min(end, len(t))):
                        x, y = x_at(d, t[k], c[k], s[k]), y_at(d, t[k], c[k], s[k])
                        if square(x, y, z_at(d, t[k], c[k], s[k]), box) <= 1.0:
                            found = note(rows, found, i, j, k)
        return found

    return {"each": each, "table": table, "vector": vector}


COASTING = searches(coast_x, coast_y, coast_z)
THRUSTING = searches(thrust_x, thrust_y, thrust_z)


def search(
    way: str,
    paths: Array,
    duration: float,
    n: float,
    half_widths: Array,
    *,
    box: bool,
    thrust: bool,
    first: int = 0,
    last: int | None = None,
    step: float = 1.0,
) -> Rows:
    """Spells inside of all pairs (i, j), first <= i < last, i < j; `way` is each, table or vector."""
    kernel = (THRUSTING if thrust else COASTING)[way]
    samples = int(duration / step) + 1
    weights = 1 / np.asarray(half_widths, dtype=float)
    if way == "each":
        times = (n * step, samples)
    else:
        times = tuple(np.ascontiguousarray(functions(n * step * np.arange(samples)).T[[1, 4, 5]]))
    rows = np.empty((ROOM, 4), dtype=np.int64)
    spells = []
    for i in range(first, len(paths) if last is None else last):  # one spacecraft at a time bounds the rows
        found = kernel(paths, i, i + 1, *times, weights, box, rows)
        if found > len(rows):
            rows = np.empty((2 * found, 4), dtype=np.int64)
            found = kernel(paths, i, i + 1, *times, weights, box, rows)
        spells.append(rows[:found].copy())
    return np.concatenate(spells)


def search_numpy(
    paths: Array,
    duration: float,
    n: float,
    half_widths: Array,
    *,
    box: bool,
    first: int = 0,
    last: int | None = None,
    step: float = 1.0,
) -> Rows:
    """Search in NumPy: one spacecraft against all later ones, 512 samples at a time to fit the cache."""
    times = step * np.arange(int(duration / step) + 1)
    places = np.ascontiguousarray(
        np.moveaxis(position(paths, times, n), 1, 2) / np.asarray(half_widths)[:, None]
    )
    found = []
    for i in range(first, len(paths) if last is None else last):
        inside = np.empty((len(paths) - i - 1, len(times)), dtype=bool)
        for begin in range(0, len(times), 512):
            d = places[i + 1 :, :, begin : begin + 512] - places[i, :, begin : begin + 512]
            d *= d
            inside[:, begin : begin + 512] = (d.max(axis=1) if box else d.sum(axis=1)) <= 1
        for j in np.flatnonzero(inside.any(axis=1)):
            edges = np.diff(inside[j].astype(np.int8), prepend=0, append=0)
            starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
            found += [(i, i + 1 + j, a, b) for a, b in zip(starts, ends, strict=True)]
    return np.array(found, dtype=np.int64).reshape(-1, 4)
