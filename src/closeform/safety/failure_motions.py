"""All motions that span a cell of failures, represented over one window by derivatives at its start.

The possible relative positions in a cell lie in a convex set: the hull of some motions of one spacecraft,
less that of some of the other, plus any part of some generators (burns that may be missed), plus a growing
ball.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import types

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.motion.arc import ANGLE, END, MEAN_MOTION, START, WIDTH, derivatives_at, is_cubic, thrusts
from closeform.motion.certified_march import COAST_ANGLE, locate, store
from closeform.motion.hill import inverse_transforms, oscillation
from closeform.safety.failure_cells import (
    BLOCKS,
    BURN,
    BURNS,
    DEGRADED,
    FIRST,
    HIGH,
    INTACT,
    KIND,
    LAST,
    LOST,
    LOW,
    MISSED,
    NUMBERS,
    OFFSET,
    ROWS,
    STUCK,
    Side,
    vertex_count,
)

OTHER, PATH, GENERATORS = 12, 24, 25  # indices of `motions`: first motion of the second side, and so on
CELLS = 512  # initial space for the cells of a pair; few paths have as many arcs under thrust


class PairRoom(NamedTuple):
    """Work space for one pair."""

    cells: Floats  # (C, W): cells still to be searched
    point: Floats  # (3, W): a cell without extent, the worst failure found, and one to be kept
    rows: Floats  # (2, 12, 30): natural motions of both sides
    motions: Floats  # (25 + G, 8, 3): derivatives of all motions at a window's start, in zone coordinates
    bends: Floats  # (25 + G, 3): bounds on their accelerations
    places: Floats  # (25 + G, 6): places and velocities at one time
    terms: Floats  # (25 + G, 5): along a plane's normal: position, rate, bend; drift, swing
    drifts: Floats  # (25 + G,): along the track [m/s]
    edges: Floats  # (P, 4): of the set at one time, a direction for each parameter, and its drift
    shares: Floats  # (P,): nearest point of the set in edge coordinates
    inverse: Floats  # (P + 1, P + 1): of the basis of `separating_planes.mixed_normal`
    mix: Floats  # (P + 1, 9): the normals in it, their shares, costs and more


ROOM_TYPE = types.NamedTuple(
    (ROWS, ROWS, BLOCKS, BLOCKS, ROWS, ROWS, ROWS, NUMBERS, ROWS, NUMBERS, ROWS, ROWS), PairRoom
)


def room_for(one: Side, two: Side, cells: int = CELLS) -> PairRoom:
    """Return work space for the search of one pair at a time."""
    burns = [int(np.diff(side.burn_offsets).max(initial=0)) if len(side.burns) else 0 for side in (one, two)]
    parameters, motions = 2 * max(2, *burns), GENERATORS + sum(burns)
    width = 2 * (1 + parameters)
    shapes: tuple[Any, ...] = (
        *((cells, 1 + width), (3, 1 + width), (2, 12, WIDTH)),
        *((motions, 8, 3), (motions, 3), (motions, 6), (motions, 5), motions),
        *((parameters, 4), parameters, (parameters + 1, parameters + 1), (parameters + 1, 9)),
    )
    return PairRoom(*map(np.zeros, shapes))


class Window(NamedTuple):
    """Range of the motions in `PairRoom` that are used in a window, and their order."""

    ones: int  # of the first side, from index 0
    twos: int  # of the second side, from index OTHER
    generators: int  # first index of the second side's; those of the first start at GENERATORS
    last: int  # index after the last
    order: int  # of the derivatives
    n: float


@kernel()
def next_motion(window, k):
    """Return the index of the next motion of a window; `last` or more after all of them."""
    if k + 1 == window.ones:
        return OTHER
    return GENERATORS if k + 1 == OTHER + window.twos else k + 1


@kernel()
def add_motion(arc, t, order, sign, q, fresh):
    """Fill `q` (8, 3) with `sign` times the derivatives of an arc, or add them if it is not `fresh`."""
    if fresh:
        for k in range(order):
            q[k, 0] = q[k, 1] = q[k, 2] = 0.0
    derivatives_at(arc, t, order, q, sign)


@kernel()
def combine(target, one, a, other, b, order):
    """Set the derivatives `target` to a times one motion's plus b times another's."""
    for k in range(order):
        for axis in range(3):
            target[k, axis] = a * one[k, axis] + b * other[k, axis]


@kernel()
def fill_burns(side, cell, arc, t, order, sign, room, base, first):
    """Subtract the burns' loss in a cell from a motion; fill generators with their variable part."""
    o = side.now[OFFSET]
    motions = room.motions
    for j in range(side.now[BURN], side.now[BURNS]):
        k = j - side.now[BURN]
        low, high = cell[o + LOW + 2 * k], cell[o + HIGH + 2 * k]
        before, after = side.burns[j, 0], side.burns[j, 1]
        given = motions[first + k]
        if t < before[START]:
            for i in range(order):
                given[i, 0] = given[i, 1] = given[i, 2] = 0.0
            continue
        add_motion(before, t, order, -1.0, given, True)
        add_motion(after if t >= after[START] else arc, t, order, 1.0, given, False)
        combine(motions[base], motions[base], 1.0, given, low - 1.0, order)
        combine(given, given, sign * (high - low), given, 0.0, order)


@kernel()
def fill_side(side, cell, rows, count, i, t, order, sign, room, base, first):
    """Fill the motions of one side at time t, in metres; `i` is the arc of its path."""
    o = side.now[OFFSET]
    kind, motions = side.now[KIND], room.motions
    if kind == INTACT or kind == MISSED:
        add_motion(side.arcs[i], t, order, 1.0, motions[base], True)
        if kind == MISSED:
            fill_burns(side, cell, side.arcs[i], t, order, sign, room, base, first)
        return
    for k in range(12 if kind == STUCK and count > 1 else count):
        add_motion(rows[k], t, order, 1.0, motions[base + k], True)
    if kind == DEGRADED:
        low, high = cell[o + LOW + 2], cell[o + HIGH + 2]
        add_motion(side.arcs[i], t, order, 1.0, motions[PATH], True)
        for k in range(count):
            failed = motions[base + k]
            combine(motions[base + 4 + k], failed, 1.0 - high, motions[PATH], high, order)
            combine(failed, failed, 1.0 - low, motions[PATH], low, order)


@kernel()
def is_natural(side, i, n):
    """Return True if a side moves without thrust while it is in the i-th arc."""
    kind = side.now[KIND]
    return kind == LOST or kind == STUCK or not (thrusts(side.arcs[i]) or side.arcs[i, MEAN_MOTION] != n)


@kernel()
def arc_end(side, i, end):
    """Return the time up to which a side's motions are valid in the i-th arc."""
    kind = side.now[KIND]
    if kind == LOST or kind == STUCK or i + 1 == side.now[LAST]:
        return end
    return min(end, side.arcs[i, END])


@kernel()
def arc_of(side, t):
    """Return the arc that continues a side's path after time t; it may be the last one, after its end."""
    return locate(side.arcs, side.now[FIRST], side.now[LAST], t)


@kernel()
def open_window(one, two, cell, t, end, n, count, epoch, form, room):
    """Fill the motions of both sides from time t on; return the window and its end."""
    shape, matrix, faces = form
    motions = room.motions
    i, j = arc_of(one, t), arc_of(two, t)
    stop = min(arc_end(one, i, end), arc_end(two, j, end))
    order = 4
    if not (is_natural(one, i, n) and is_natural(two, j, n)):
        cubics = n == 0.0 and is_cubic(one.arcs[i]) and is_cubic(two.arcs[j])
        order = 4 if cubics else 8
        if n > 0.0:
            stop = min(stop, t + ANGLE / n)
    if n > 0.0:  # deviations from the span of a cell are bounded by their value at the end of a window
        stop = min(stop, t + max(t - epoch if count > 1 else 0.0, COAST_ANGLE / n))
    elif count > 1:
        stop = min(stop, t + max(t - epoch, 0.25 * (end - t)))
    generators = GENERATORS + one.now[BURNS] - one.now[BURN]
    last = generators + two.now[BURNS] - two.now[BURN]
    fill_side(one, cell, room.rows[0], count, i, t, order, 1.0, room, 0, GENERATORS)
    fill_side(two, cell, room.rows[1], count, j, t, order, -1.0, room, OTHER, generators)
    ones = vertex_count(one) if count > 1 else 1
    twos = vertex_count(two) if count > 1 else 1
    if twos == 1:  # the difference is a single motion, and smaller than both
        for k in range(ones):
            combine(motions[k], motions[k], 1.0, motions[OTHER], -1.0, order)
        combine(motions[OTHER], motions[OTHER], 0.0, motions[OTHER], 0.0, order)
    window = Window(ones, twos, generators, last, order, n)
    k = 0
    while k < last:
        for m in range(order):
            store(motions[k], m, matrix, motions[k, m, 0], motions[k, m, 1], motions[k, m, 2])
        k = next_motion(window, k)
    return window, stop


@kernel()
def place_all(room, window, t):
    """Fill `room.places` with positions and velocities of all motions at time t after the window's start."""
    n, order = window.n, window.order
    p = inverse_transforms(n, t) if order == 8 else (0.0,) * 12
    c2, c3, c4 = oscillation(n, t) if order == 4 else (t, 0.5 * t * t, t * t * t / 6.0)
    b4, b5, d4 = p[8] + 2.0 * n * n * p[10], p[9] + 2.0 * n * n * p[11], p[7] + 2.0 * n * n * p[9]
    k = 0
    while k < window.last:
        q, place = room.motions[k], room.places[k]
        for axis in range(3):
            x = q[0, axis] + q[1, axis] * t + q[2, axis] * c3 + q[3, axis] * c4
            v = q[1, axis] + q[2, axis] * c2 + q[3, axis] * c3
            if order == 8:
                x += q[4, axis] * b4 + q[5, axis] * b5 + q[6, axis] * p[10] + q[7, axis] * p[11]
                v += q[4, axis] * d4 + q[5, axis] * b4 + q[6, axis] * p[9] + q[7, axis] * p[10]
            place[axis], place[3 + axis] = x, v
        k = next_motion(window, k)
