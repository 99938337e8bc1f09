"""Cells: boxes of failures of one or two spacecraft, and the motions that span their consequences.

A cell is a row of floats: the time from which it is still to be searched, and for each side (the spacecraft
of `path`, then that of `other`) a piece of its path and a low and a high end of each of its
parameters.  A piece is an arc (2 i) or the impulse at its start (2 i + 1).  The parameters are

    LOST     the time of the loss of thrust [s]; for an impulse the fraction of it that was given
    DEGRADED     the same, and the fraction of thrust that remains from then on
    STUCK    the same, and the duration for which thrust is stuck on [s]
    MISSED   the fraction of each burn that is given

Motions of the first three are natural: rows of arcs without thrust, from their own times on.
"""

from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numba import float64, int64, types

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, START, STATE, THRUST, WIDTH, state_at, thrusts
from closeform.motion.hill import coast, pushed
from closeform.motion.path import Path
from closeform.safety.failures import DegradedThrust, Failure, MissedBurns, StuckOnThrust, ThrustLost
from closeform.safety.remainders import lost_remainder, stuck_remainder, thrust_derivatives

INTACT, LOST, DEGRADED, STUCK, MISSED = 0, 1, 2, 3, 4
KIND, FIRST, LAST, BURN, BURNS, OFFSET = range(6)  # indices of a side's `now`
MEASURE, HELD, ACCELERATION = 0, 1, 2  # indices of a side's `numbers`
FROM, SIDE = 0, 1  # first columns of a cell
PIECE, LOW, HIGH = 0, 1, 2  # columns of a side of a cell; the next parameter follows two columns later
# Initial length of a cell in n t. At 0.5 safety checks take a fifth longer; at 1, those of a day a tenth.
LONGEST = 0.7
KINDS = {ThrustLost: LOST, MissedBurns: MISSED, DegradedThrust: DEGRADED, StuckOnThrust: STUCK}
NO_BURNS = np.empty((0, 2, WIDTH))


class Side(NamedTuple):
    """One of the two spacecraft in every pair of a batch: its paths, their burns, and its failure."""

    arcs: Floats  # (M, 30)
    offsets: Any  # (N + 1,)
    burns: Floats  # (B, 2, 30): the natural motions before and after each burn, of MISSED alone
    burn_offsets: Any  # (N + 1,)
    now: Any  # (6,): kind of failure; first and last arc and burn of the current spacecraft; column in a cell
    numbers: Floats  # (5,): minimum share or longest duration; length and components of a given acceleration


ROWS, BLOCKS, NUMBERS, INDICES = float64[:, ::1], float64[:, :, ::1], float64[::1], int64[::1]
SIDE_TYPE = types.NamedTuple((ROWS, INDICES, BLOCKS, INDICES, INDICES, NUMBERS), Side)


@kernel()
def choose(side, craft):
    """Make one spacecraft of a side the current one."""
    side.now[FIRST], side.now[LAST] = side.offsets[craft], side.offsets[craft + 1]
    side.now[BURN], side.now[BURNS] = side.burn_offsets[craft], side.burn_offsets[craft + 1]


@kernel()
def parameter_count(side):
    """Return the number of parameters of a failure."""
    kind = side.now[KIND]
    if kind == MISSED:
        return side.now[BURNS] - side.now[BURN]
    return 0 if kind == INTACT else (1 if kind == LOST else 2)


@kernel()
def vertex_count(side):
    """Return the number of motions that span a cell on one side."""
    kind = side.now[KIND]
    if kind == DEGRADED:
        return 8
    if kind == STUCK:
        return 12
    return 4 if kind == LOST else 1


@kernel()
def set_natural(row, s, n, x, y, z, vx, vy, vz):
    """Fill a row with the natural motion through a state at time s."""
    row[START], row[MEAN_MOTION] = s, n
    row[STATE], row[STATE + 1], row[STATE + 2] = x, y, z
    row[STATE + 3], row[STATE + 4], row[STATE + 5] = vx, vy, vz


@kernel()
def failed_row(side, piece, at, n, kick, u, stuck, row):
    """Fill a row with the motion after a failure at parameter `at` of a piece.

    Returns the time of the failure.

    The velocity there is changed by `kick` times the thrust u, which then is stuck on for a while.
    """
    arc = side.arcs[piece // 2]
    if piece % 2 == 1:
        s, left = arc[START], 1.0 - at
        x, y, z = arc[STATE], arc[STATE + 1], arc[STATE + 2]
        vx = arc[STATE + 3] - left * arc[IMPULSE]
        vy = arc[STATE + 4] - left * arc[IMPULSE + 1]
        vz = arc[STATE + 5] - left * arc[IMPULSE + 2]
    else:
        s = at
        x, y, z, vx, vy, vz = state_at(arc, s)
        vx, vy, vz = vx + kick * u[0, 0], vy + kick * u[0, 1], vz + kick * u[0, 2]
    if stuck > 0.0:
        push = stack_vector(12)
        for k in range(12):
            push[k] = u[0, k] if k < 3 else 0.0
        x, y, z, vx, vy, vz = coast(n, stuck, x, y, z, vx, vy, vz)
        dx, dy, dz, dvx, dvy, dvz = pushed(n, stuck, push, 0)
        x, y, z, vx, vy, vz = x + dx, y + dy, z + dz, vx + dvx, vy + dvy, vz + dvz
    set_natural(row, s + stuck, n, x, y, z, vx, vy, vz)
    return s


@kernel()
def stuck_thrust(side, piece, at, n, u):
    """Fill the first row of `u` with the thrust that is stuck on at the failure."""
    if side.numbers[HELD] >= 0.0:
        for axis in range(3):
            u[0, axis] = side.numbers[ACCELERATION + axis]
    elif piece % 2 == 1:
        u[0, 0] = u[0, 1] = u[0, 2] = 0.0
    else:
        thrust_derivatives(side.arcs[piece // 2], n, at, u)


@kernel()
def single_failure(side, cell, n, rows):
    """Fill the first row with the motion at the low ends of a cell's side."""
    o = side.now[OFFSET]
    kind = side.now[KIND]
    if kind == INTACT or kind == MISSED:
        return
    u = stack_matrix(7, 3)
    piece, at = int(cell[o + PIECE]), cell[o + LOW]
    stuck = cell[o + LOW + 2] if kind == STUCK else 0.0
    if stuck > 0.0:
        stuck_thrust(side, piece, at, n, u)
    failed_row(side, piece, at, n, 0.0, u, stuck, rows[0])


@kernel()
def column_of(one, two, k):
    """Return the column of the low end of a cell's k-th unknown."""
    mine = parameter_count(one)
    return one.now[OFFSET] + LOW + 2 * k if k < mine else two.now[OFFSET] + LOW + 2 * (k - mine)


@kernel()
def set_shifted(row, source, by, x, y, z, vx, vy, vz):
    """Fill a row with a natural motion plus `by` times another state at the same time."""
    a = STATE
    set_natural(
        row,
        source[START],
        source[MEAN_MOTION],
        source[a] + by * x,
        source[a + 1] + by * y,
        source[a + 2] + by * z,
        source[a + 3] + by * vx,
        source[a + 4] + by * vy,
        source[a + 5] + by * vz,
    )


@kernel()
def span_stuck(side, piece, at, n, third, short, long, end, rows):
    """Fill the six rows at one end of a cell of thrust that is stuck on from `short` to `long`.

    They are the points of a parabola in the duration at `end` (0 or 3), and of its derivative by the instant,
    a `third` of the cell away, theory (48).
    """
    u, w, push = stack_matrix(7, 3), stack_matrix(7, 3), stack_vector(12)
    own, half, inner = side.numbers[HELD] < 0.0, 0.5 * (long - short), 1 if end == 0 else 2
    stuck_thrust(side, piece, at, n, w)
    for k in range(7):
        u[k, 0] = u[k, 1] = u[k, 2] = 0.0
    if third != 0.0:
        thrust_derivatives(side.arcs[piece // 2], n, at, u)
    for k in range(12):
        push[k] = u[1, k] if own and k < 3 else 0.0
    wx, wy, wz = w[0, 0], w[0, 1], w[0, 2]
    for j in range(0, 3, 2):
        row, stuck = rows[4 * j + end], short if j == 0 else long
        failed_row(side, piece, at, n, 0.0, w, stuck, row)
        x, y, z, vx, vy, vz = pushed(n, stuck, push, 0)
        if not own:
            x, y, z, vx, vy, vz = coast(n, stuck, 0.0, 0.0, 0.0, u[0, 0] - wx, u[0, 1] - wy, u[0, 2] - wz)
        vx, vy, vz = vx + wx, vy + wy, vz + wz
        set_shifted(rows[4 * j + inner], row, third, x, y, z, vx, vy, vz)
        if j == 0:
            set_shifted(rows[4 + end], row, half, 0.0, 0.0, 0.0, wx, wy, wz)
            vx += half * (push[0] - 2.0 * n * wy)
            vy += half * (push[1] + 2.0 * n * wx)
            vz += half * push[2]
            set_shifted(
                rows[4 + inner], rows[4 + end], third, x - half * wx, y - half * wy, z - half * wz, vx, vy, vz
            )


@kernel()
def span_cell(side, cell, n, rows):
    """Fill rows with the motions that span a cell's side; return bounds on the deviation of others.

    The four numbers are bounds in position, in velocity and constant ones, and the epoch of the cell's start.
    """
    o = side.now[OFFSET]
    kind = side.now[KIND]
    if kind == INTACT or kind == MISSED:
        return 0.0, 0.0, 0.0, cell[FROM]
    piece, low, high = int(cell[o + PIECE]), cell[o + LOW], cell[o + HIGH]
    arc = side.arcs[piece // 2]
    u, w = stack_matrix(7, 3), stack_matrix(7, 3)
    h = 0.0 if piece % 2 == 1 else high - low
    if kind == STUCK:
        short, long = cell[o + LOW + 2], cell[o + HIGH + 2]
        span_stuck(side, piece, low, n, h / 3.0, short, long, 0, rows)
        span_stuck(side, piece, high, n, -h / 3.0, short, long, 3, rows)
        for k in range(7):
            u[k, 0] = u[k, 1] = u[k, 2] = 0.0
        if h > 0.0:
            thrust_derivatives(arc, n, low, u)
        place, speed, rest = stuck_remainder(
            n, arc[MEAN_MOTION], u, h, side.numbers[HELD], long, long - short
        )
        start = arc[START] if piece % 2 == 1 else low
        return place, speed, rest, start - h - (long - short)
    if h > 0.0:
        thrust_derivatives(arc, n, low, u)
        thrust_derivatives(arc, n, high, w)
    epoch = failed_row(side, piece, low, n, 0.0, u, 0.0, rows[0])
    failed_row(side, piece, high, n, 0.0, w, 0.0, rows[3])
    third = h / 3.0 if h > 0.0 else 0.0
    failed_row(side, piece, low, n, third, u, 0.0, rows[1])
    failed_row(side, piece, high, n, -third, w, 0.0, rows[2])
    if not h > 0.0:
        return 0.0, 0.0, 0.0, epoch
    place, speed = lost_remainder(n, u, h)
    share = 1.0 - cell[o + LOW + 2] if kind == DEGRADED else 1.0
    return share * place, share * speed, 0.0, epoch


@kernel()
def span_both(one, two, cell, n, rows):
    """Span both sides by `span_cell`; return bounds on the deviation of the difference of two motions."""
    place, speed, always, epoch = span_cell(one, cell, n, rows[0])
    other_place, other_speed, other_always, other_epoch = span_cell(two, cell, n, rows[1])
    return place + other_place, speed + other_speed, always + other_always, min(epoch, other_epoch)


@kernel()
def first_cells(side, n, cells):
    """Fill a side's columns of `cells` with the cells that contain all its failures; return their number.

    Cells beyond the last row are counted only.
    """
    o = side.now[OFFSET]
    kind, count = side.now[KIND], 0
    if kind == INTACT or kind == MISSED:
        if len(cells) > 0:
            cells[0, o + PIECE] = 2.0 * side.now[FIRST]
            for k in range(side.now[BURNS] - side.now[BURN]):
                cells[0, o + LOW + 2 * k], cells[0, o + HIGH + 2 * k] = side.numbers[MEASURE], 1.0
        return 1
    shortest = 0.0 if kind == STUCK else side.numbers[MEASURE]
    longest = side.numbers[MEASURE] if kind == STUCK else 1.0
    start, end = side.arcs[side.now[FIRST], START], side.arcs[side.now[LAST] - 1, END]
    for i in range(side.now[FIRST], side.now[LAST]):
        arc = side.arcs[i]
        for jump in range(1, -1, -1):
            low, high, parts = arc[START], arc[END], 1
            if jump == 1:
                if arc[IMPULSE] == 0.0 and arc[IMPULSE + 1] == 0.0 and arc[IMPULSE + 2] == 0.0:
                    continue
                low, high = 0.0, 1.0
            elif thrusts(arc) or arc[MEAN_MOTION] != n or (kind == STUCK and side.numbers[HELD] >= 0.0):
                shares = (high - low) * n / LONGEST if n > 0.0 else 4.0 * (high - low) / (end - start)
                parts = max(1, ceil(shares))
            else:
                high = low  # natural motion continues unchanged
            for k in range(parts):
                if count < len(cells):
                    cell = cells[count]
                    cell[o + PIECE] = 2.0 * i + jump
                    cell[o + LOW] = low + (high - low) * k / parts
                    cell[o + HIGH] = low + (high - low) * (k + 1) / parts if k + 1 < parts else high
                    if kind != LOST:
                        cell[o + LOW + 2], cell[o + HIGH + 2] = shortest, longest
                count += 1
    return count


@kernel()
def earliest(side, cell):
    """Return the time from which the motions of a cell's side are valid."""
    o = side.now[OFFSET]
    kind = side.now[KIND]
    if kind == INTACT or kind == MISSED:
        return side.arcs[side.now[FIRST], START]
    piece = int(cell[o + PIECE])
    s = side.arcs[piece // 2, START] if piece % 2 == 1 else cell[o + LOW]
    return s + cell[o + LOW + 2] if kind == STUCK else s


def side_of(path: Path, failure: Failure | None, until: float, carry_on: bool = False) -> Side:
    """Return a path that fails, or continues if `failure` is None, as a side of the search."""
    kind = INTACT if failure is None else KINDS[type(failure)]
    numbers = np.array([0.0, -1.0, 0.0, 0.0, 0.0])
    if isinstance(failure, MissedBurns | DegradedThrust):
        numbers[MEASURE] = failure.least
    if isinstance(failure, StuckOnThrust):
        numbers[MEASURE] = failure.longest
        if failure.acceleration is not None:
            numbers[HELD] = np.linalg.norm(failure.acceleration)
            numbers[ACCELERATION:] = failure.acceleration
    if kind in (DEGRADED, MISSED) or (kind == INTACT and carry_on):
        path = path.extended(until)
    burns, burn_offsets = NO_BURNS, np.zeros_like(path.offsets)
    if kind == MISSED:
        burns, burn_offsets = burns_of(path)
    now = np.array([kind, 0, 0, 0, 0, SIDE], dtype=np.int64)
    return Side(path.arcs, path.offsets, burns, burn_offsets, now, numbers)


def burns_of(path: Path) -> tuple[Floats, Any]:
    """Return natural motions before and after each burn (B, 2, 30), and the first index of each spacecraft.

    A burn is an impulse, or consecutive arcs with thrust; an impulse between these is a separate burn.
    """
    n = path.orbit.mean_motion
    arcs = path.arcs
    thrusts: Any = arcs[:, THRUST:].any(axis=1) | (arcs[:, MEAN_MOTION] != n)
    jumps: Any = arcs[:, IMPULSE : IMPULSE + 3].any(axis=1)
    rows, counts = [], []
    for first, last, ended in zip(path.offsets[:-1], path.offsets[1:], end_states(path), strict=True):
        found: list[tuple[float, Floats, float, Floats]] = []
        for i in range(first, last):
            start, end = arcs[i, START], arcs[i, END]
            after = arcs[i, STATE : STATE + 6]
            if jumps[i]:
                found.append((start, _state_before(arcs[i]), start, after))
            if thrusts[i]:
                if i > first and thrusts[i - 1] and not jumps[i]:
                    start, after, *_ = found.pop()
                found.append((start, after, end, _state_before(arcs[i + 1]) if i + 1 < last else ended))
        counts.append(len(found))
        rows += [_coasts(n, *one) for one in found]
    burns = np.array(rows).reshape(-1, 2, WIDTH)
    return burns, np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def end_states(path: Path) -> Floats:
    """Return the states (N, 6) of all spacecraft at their ends."""
    return path._evaluate_rows(path.arcs[path.offsets[1:] - 1, END][:, None])[:, 0]


def _state_before(arc: Floats) -> Floats:
    """Return the state at the start of an arc, before the impulse there."""
    state: Floats = arc[STATE : STATE + 6].copy()
    state[3:] -= arc[IMPULSE : IMPULSE + 3]
    return state


def _coasts(n: float, start: float, before: Floats, end: float, after: Floats) -> Floats:
    rows = np.zeros((2, WIDTH))
    rows[:, MEAN_MOTION] = n
    rows[:, START] = start, end
    rows[:, STATE : STATE + 6] = before, after
    return rows
