"""Conflicts and closest approaches of two paths, certified between any two instants."""

from dataclasses import dataclass
from math import inf, nan
from typing import Any

import numpy as np
from numba import bool_, float64, int64, void

from closeform.arc import END, MEAN_MOTION, START, thrusts
from closeform.compiled import kernel
from closeform.extrema import lowest
from closeform.march import (
    LESS_PATIENCE,
    PATIENCE,
    along,
    bounds,
    inside_step,
    locate,
    norm,
    outside_step,
    taylor_step,
    window,
)
from closeform.path import Path
from closeform.zones import Zone

# A norm within 1e-12 of 1 is on the surface: entries are met from above at 1 + TOUCH / 2 or
# just below, exits from below just above it, so that the two searches cannot chase each other.
TOUCH = 1e-12
SWITCH, ENTRY_AIM, EXIT_AIM = 1.0 + 0.5 * TOUCH, 1.0 + 0.25 * TOUCH, 1.0 + 0.75 * TOUCH
COLUMNS = 5  # of a row of conflicts: pair, start, end, time, ratio


@kernel()
def cross(box, q, order, n, t, stop, inside, patience):
    """March through a window until the norm changes sides: (time reached, whether it did)."""
    ax, ay, az, a, speed = bounds(q, order, n, stop)
    if not box and patience == LESS_PATIENCE and t == 0.0:
        t = taylor_step(q, order, n, stop, EXIT_AIM if inside else ENTRY_AIM, inside)
    for _ in range(patience):
        x, y, z, vx, vy, vz = along(q, order, n, t)
        if (norm(box, x, y, z) <= SWITCH) != inside:
            return t, True
        if t >= stop:
            return stop, False
        if inside:
            h = inside_step(box, x, y, z, vx, vy, vz, ax, ay, az, a, speed, EXIT_AIM)
        else:
            h = outside_step(box, x, y, z, vx, vy, vz, ax, ay, az, a, ENTRY_AIM)
        t = min(stop, max(t + h, t * (1.0 + 2.3e-16)))
    return t, False


@kernel()
def closest(arcs, i, i_end, others, j, j_end, start, end, box, matrix, q):
    """Least norm over [start, end] and its time, between one path's arcs and another's."""
    best, best_time = inf, nan
    i = locate(arcs, i, i_end, start)
    j = locate(others, j, j_end, start)
    t = start
    patience = PATIENCE
    while True:
        while i + 1 < i_end and arcs[i, END] <= t:
            i += 1
        while j + 1 < j_end and others[j, END] <= t:
            j += 1
        order, n, stop = window(arcs, i, others, j, t, end, matrix, q)
        least, when, reached = lowest(box, q, order, n, 0.0, stop - t, patience, best, nan)
        if least < best:
            best, best_time = least, t + when
        if reached < stop - t:
            patience = LESS_PATIENCE
            t += reached
        else:
            t = stop
        if t >= end or best == 0.0:
            return best, best_time


@kernel()
def drifting_apart(arcs, i, others, j, start, end, matrix, q):
    """Whether two coasting craft stay clear along some axis of the zone all the time.

    Along an axis natural motion is centre + drift t + an oscillation: SP11's radial test and
    its last time of contact (SP11 eq. 15, theory 6) for any zone, and its first time too.
    """
    a, b = arcs[i], others[j]
    n = a[MEAN_MOTION]
    if n == 0.0 or n != b[MEAN_MOTION] or thrusts(a) or thrusts(b) or a[END] < end or b[END] < end:
        return False
    window(arcs, i, others, j, start, end, matrix, q)
    for axis in range(3):
        centre = q[0, axis] + q[2, axis] / (n * n)
        drift = q[1, axis] + q[3, axis] / (n * n)
        swing = np.hypot(q[2, axis], q[3, axis] / n) / (n * n)
        last = centre + drift * (end - start)
        if min(abs(centre), abs(last)) > 1.0 + 1e-9 + swing * (1.0 + 1e-12) and centre * last > 0.0:
            return True
    return False


@kernel()
def pair_conflicts(arcs, i, i_end, others, j, j_end, box, matrix, q, pair, rows, count):
    """Append the conflicts of one pair to `rows`; the new count, beyond len(rows) if they do not fit."""
    start = max(arcs[i, START], others[j, START])
    end = min(arcs[i_end - 1, END], others[j_end - 1, END])
    if not start <= end:
        return count
    i = locate(arcs, i, i_end, start)
    j = locate(others, j, j_end, start)
    if drifting_apart(arcs, i, others, j, start, end, matrix, q):
        return count
    inside = False
    entry = start
    patience = PATIENCE
    t = start
    while True:
        while i + 1 < i_end and arcs[i, END] <= t:
            i += 1
        while j + 1 < j_end and others[j, END] <= t:
            j += 1
        order, n, stop = window(arcs, i, others, j, t, end, matrix, q)
        local = 0.0
        while True:
            local, crossed = cross(box, q, order, n, local, stop - t, inside, patience)
            if not crossed:
                break
            inside = not inside
            if inside:
                entry = t + local
            else:
                if count < len(rows):
                    rows[count, 0], rows[count, 1], rows[count, 2] = pair, entry, t + local
                count += 1
        if local < stop - t:
            patience = LESS_PATIENCE
            t += local
        else:
            t = stop
        if t >= end:
            break
    if inside:
        if count < len(rows):
            rows[count, 0], rows[count, 1], rows[count, 2] = pair, entry, end
        count += 1
    return count


@kernel(
    int64(
        float64[:, ::1],
        int64[::1],
        float64[:, ::1],
        int64[::1],
        int64[::1],
        int64[::1],
        int64,
        bool_,
        float64[:, ::1],
        float64[:, ::1],
        int64[::1],
    )
)
def conflicts_of_pairs(arcs, offsets, others, other_offsets, first, second, pair, box, matrix, rows, done):
    """Conflicts of pairs (first[k], second[k]) from k = `pair` on, as many as fit in `rows`.

    Returns how many rows were filled; `done` gets the pair to go on with.
    """
    q = np.empty((8, 3))
    count = 0
    while pair < len(first):
        i, i_end = offsets[first[pair]], offsets[first[pair] + 1]
        j, j_end = other_offsets[second[pair]], other_offsets[second[pair] + 1]
        total = pair_conflicts(arcs, i, i_end, others, j, j_end, box, matrix, q, pair, rows, count)
        if total > len(rows):
            done[1] = total - count
            break
        for k in range(count, total):
            ratio, when = closest(arcs, i, i_end, others, j, j_end, rows[k, 1], rows[k, 2], box, matrix, q)
            rows[k, 3], rows[k, 4] = when, ratio
        count = total
        pair += 1
    done[0] = pair
    return count


@kernel(
    void(
        float64[:, ::1],
        int64[::1],
        float64[:, ::1],
        int64[::1],
        int64[::1],
        int64[::1],
        bool_,
        float64[:, ::1],
        float64[:, ::1],
    )
)
def approaches_of_pairs(arcs, offsets, others, other_offsets, first, second, box, matrix, out):
    """Time and least norm of every pair over its common time."""
    q = np.empty((8, 3))
    for pair in range(len(first)):
        i, i_end = offsets[first[pair]], offsets[first[pair] + 1]
        j, j_end = other_offsets[second[pair]], other_offsets[second[pair] + 1]
        start = max(arcs[i, START], others[j, START])
        end = min(arcs[i_end - 1, END], others[j_end - 1, END])
        out[pair, 0], out[pair, 1] = nan, inf
        if start <= end:
            ratio, when = closest(arcs, i, i_end, others, j, j_end, start, end, box, matrix, q)
            out[pair, 0], out[pair, 1] = when, ratio


@dataclass(frozen=True)
class Conflict:
    """One stay inside a zone: `start` and `end` [s], and the `time` [s] of its least `ratio`.

    The ratio is the least norm: below 1, and 0 where the two centres meet.
    """

    start: float
    end: float
    time: float
    ratio: float


@dataclass(frozen=True, eq=False)
class Approach:
    """Closest approach: `time` [s], least norm `ratio`, and the `distance` [m] at that time.

    Floats for two craft, arrays of the broadcast shape for batches.  Paths with no common time
    have ratio and distance inf and time nan.
    """

    time: Any
    ratio: Any
    distance: Any


def _same_orbit(path: Path, other: Path) -> None:
    if path.orbit.mean_motion != other.orbit.mean_motion:
        raise ValueError(
            f"other: must be in the orbit of path, mean motion {path.orbit.mean_motion:g} rad/s, "
            f"got {other.orbit.mean_motion:g}"
        )


def find_conflicts(path: Path, other: Path, zone: Zone) -> tuple[Conflict, ...]:
    """Every stay of `path` inside the `zone` around `other`, in order of time.

    Certified: between two stays the norm of the relative position is above 1, with no time
    step and however short a stay is, up to rounding: of positions, about 1e-15 of the largest
    relative coordinate met; of time, one unit in its last place.  A norm within 1e-12 of 1
    counts as a conflict.  At every start and end inside the common time |norm - 1| <= 1e-12
    (times, then, to 1e-6 s wherever the norm changes faster than 1e-6 per second); the least
    ratio is certain to 1e-9.  A conflict that is on at the edge of the common time starts or
    ends there; without a common time there is none.

    Both paths are of one craft.  Raises ValueError for batches (use `screen`) or for paths in
    different orbits.  Theory 3; the problem is that of SP11 section 3.
    """
    if path.shape or other.shape:
        raise ValueError(
            f"path, other: of one craft each, got shapes {path.shape} and {other.shape}; index them or screen"
        )
    _same_orbit(path, other)
    one = np.zeros(1, dtype=np.int64)
    rows = np.empty((16, COLUMNS))
    done = np.zeros(2, dtype=np.int64)
    while True:
        count = conflicts_of_pairs(
            path.arcs,
            path.offsets,
            other.arcs,
            other.offsets,
            one,
            one,
            0,
            zone.box,
            zone.matrix,
            rows,
            done,
        )
        if done[0]:
            return tuple(Conflict(*map(float, row[1:])) for row in rows[:count])
        rows = np.empty((done[1], COLUMNS))


def closest_approach(path: Path, other: Path, zone: Zone) -> Approach:
    """Least norm of the relative position over the common time; batch shapes broadcast.

    The ratio is certain to 1e-9 of itself: nothing closer happens between any two instants.
    Raises ValueError for paths in different orbits or shapes that do not broadcast.
    """
    _same_orbit(path, other)
    shape = np.broadcast_shapes(path.shape, other.shape)
    first = _index(path, shape)
    second = _index(other, shape)
    out = np.empty((len(first), 2))
    approaches_of_pairs(
        path.arcs, path.offsets, other.arcs, other.offsets, first, second, zone.box, zone.matrix, out
    )
    time, ratio = out[:, 0].reshape(shape), out[:, 1].reshape(shape)
    distance = np.full(len(first), inf)
    met = np.isfinite(out[:, 0])
    gap = path._at(first[met], out[met, 0]) - other._at(second[met], out[met, 0])
    distance[met] = np.linalg.norm(gap[:, :3], axis=1)
    if not shape:
        return Approach(float(time), float(ratio), float(distance[0]))
    return Approach(time, ratio, distance.reshape(shape))


def _index(path: Path, shape: tuple[int, ...]) -> Any:
    craft = np.arange(len(path.offsets) - 1, dtype=np.int64).reshape(path.shape)
    return np.broadcast_to(craft, shape).flatten()  # numba wants it writable


def last_possible_conflict(path: Path, other: Path, zone: Zone) -> Any:
    """Latest time [s] at which two coasting craft can be in conflict, however long they coast.

    SP11 eq. 15 as theory (6): drift carries them apart for good once 3 n |d| t exceeds
    |l| + 2E + the zone's along-track extent.  inf where their mean motions agree (d = 0) and
    nothing carries them apart; -inf where they never come close radially (|2d| - E above the
    radial extent).  Shapes broadcast; times count from the later start.

    Raises ValueError in deep space, for paths that thrust, or in different orbits.
    """
    _same_orbit(path, other)
    n = path.orbit.mean_motion
    if n == 0:
        raise ValueError("path: the bound needs an orbit, in deep space use closest_approach")
    if any(
        p.arcs[:, 3:6].any() or p.arcs[:, 12:].any() or (p.arcs[:, MEAN_MOTION] != n).any()
        for p in (path, other)
    ):
        raise ValueError("path, other: the bound is for coasting craft without impulses")
    shape = np.broadcast_shapes(path.shape, other.shape)
    first, second = _index(path, shape), _index(other, shape)
    start = np.maximum(path.arcs[path.offsets[first], START], other.arcs[other.offsets[second], START])
    gap = path._at(first, start) - other._at(second, start)
    x, y, _, vx, vy, _ = gap.T
    e1, e2, d, along_track = 3 * x + 2 * vy / n, vx / n, 2 * x + vy / n, y - 2 * vx / n  # theory (2)
    swing = np.hypot(e1, e2)
    radial, transverse, _ = zone.extents
    with np.errstate(divide="ignore"):
        last = start + (np.abs(along_track) + 2 * swing + transverse) / (3 * n * np.abs(d))
    last = np.where(np.abs(2 * d) - swing > radial, -inf, last)
    return last.reshape(shape) if shape else float(last[0])
