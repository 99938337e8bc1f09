"""Conflicts of all pairs by SP11's zero crossings, compiled, so that the comparison is one of methods.

The method is that of `closeform.conflicts.zero_crossings`, for the motions of `peers.motion`.
"""

import numba
import numpy as np

from closeform.conflicts.zero_crossings import capacity, pair_conflicts, timeline
from peers.motion import Array

compiled = numba.njit(nogil=True, error_model="numpy")


@compiled
def search(paths, i, end, room, half_widths, box, rows):
    """Rows (i, j, begin, end) of spacecraft i with all later ones; returns how many, stored or not."""
    lines, both, spells = np.empty((3, room, 2)), np.empty((3 * room, 2)), np.empty((3 * room, 2))
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
    room = capacity(n * duration)
    rows = np.empty((16_384, 4))
    spells = []
    for i in range(len(paths)):  # one spacecraft at a time: room for its rows
        found = search(paths, i, n * duration, room, sizes, box, rows)
        if found > len(rows):
            rows = np.empty((2 * found, 4))
            found = search(paths, i, n * duration, room, sizes, box, rows)
        spells.append(rows[:found] / np.array([1, 1, n, n]))
    return np.concatenate(spells)


def timelines(path: Array, duration: float, n: float, half_widths: Array) -> list[Array]:
    """The three axes' timelines of one relative motion (3, 8) [s], as under SP11 figure 1."""
    d = path / np.asarray(half_widths)[:, None]
    spells = np.empty((capacity(n * duration), 2))
    return [spells[: timeline(d, axis, n * duration, spells)] / n for axis in range(3)]
