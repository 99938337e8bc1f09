"""Pieces: paths about any chief as rows of polynomials, which a problem's kernels read instead of arcs.

A row holds start and end, the angle and the length of the window in which it lies (see `motion.chief.clock`),
and 36 Bernstein coefficients of its position.  Velocity and acceleration are derivatives of the polynomial.

A path of minimum energy with fixed ends, which forces f push at times s, is at every instant

    q(t) = base(t) + sum A(t) B(s) f over later s + sum B(t)^T A(s)^T f over earlier s   # theory (12, 97a)

A and B^T have six columns each: A holds the optimal paths that begin at rest at the origin, B^T those that
end there.  Beside a chief all of them are polynomials in each window.  A path under any forces is one linear
combination of thirteen polynomials; A, B and their rates are values of twelve of them.
"""

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import END, START
from closeform.motion.certified_march import locate
from closeform.motion.chief.bernstein import TERMS, derivatives_of_weights
from closeform.motion.chief.clock import ECCENTRICITY, RATE, angle_at
from closeform.motion.chief.segments import LAST, TABLE, WINDOW, blocks_at, share, solve_all
from closeform.motion.chief.segments import ORIGIN as WINDOW_ORIGIN

ORIGIN, LENGTH, PLACES = 2, 3, 4  # columns of a piece after its start and end
PIECE = PLACES + 3 * TERMS
BASE = 1 + 2 * TERMS  # numbers of a base: see `sample_pieces`
AHEAD, BACK, PATHS = 1, 7, 13  # of a craft's polynomials: its base path, six of A, six of B^T


@kernel()
def weigh(clock, row, t, out):
    """Fill `out` (3, TERMS): weights of a row's coefficients in position, velocity and acceleration at t."""
    s = angle_at(clock, t)
    length = row[LENGTH]
    u = min(max((s - row[ORIGIN]) / length, 0.0), 1.0)
    derivatives_of_weights(u, out)
    e = clock[ECCENTRICITY]
    pace = 1.0 - e * np.cos(s) if e != 0.0 else 1.0
    rate = clock[RATE] / pace  # ds/dt
    du = rate / length  # by time
    turn = -e * np.sin(s) * rate / pace * du if e != 0.0 else 0.0  # d2u/dt2
    for i in range(TERMS):
        out[2, i] = du**2 * out[2, i] + turn * out[1, i]
        out[1, i] *= du


@kernel()
def add_piece(clock, row, t, out, sign):
    """Add `sign` times position, velocity and acceleration (rows) of a piece at time t to `out`."""
    w = stack_matrix(3, 12)
    weigh(clock, row, t, w)
    for k in range(3):
        for axis in range(3):
            for b in range(TERMS):
                out[k, axis] += sign * w[k, b] * row[PLACES + TERMS * axis + b]


@kernel()
def fill_gap(clock, one, other, t, out):
    """Fill the rows of `out` with position, velocity and acceleration of a piece relative to another."""
    out[:] = 0.0
    if one[ORIGIN] != other[ORIGIN]:
        add_piece(clock, one, t, out, 1.0)
        add_piece(clock, other, t, out, -1.0)
        return
    w, apart = stack_matrix(3, 12), stack_vector(36)  # in one window, where both have the same weights
    weigh(clock, one, t, w)
    for b in range(3 * TERMS):
        apart[b] = one[PLACES + b] - other[PLACES + b]
    for k in range(3):
        for axis in range(3):
            for b in range(TERMS):
                out[k, axis] += w[k, b] * apart[TERMS * axis + b]


@kernel()
def sample_pieces(clock, rows, first, last, times, bases, states):
    """Fill the states (T, 6) of one body at `times`; the first number is inf where it is absent.

    `bases` (T, 25) holds the angle of a window at each time and the weights there, or nan before they are
    known: all bodies have the same in the same window.
    """
    w, at = stack_matrix(3, 12), first
    for k in range(len(times)):
        t = times[k]
        if not rows[first, START] <= t <= rows[last - 1, END]:
            states[k, 0] = np.inf
            continue
        while at + 1 < last and rows[at + 1, START] <= t:
            at += 1
        base = bases[k]
        if base[0] != rows[at, ORIGIN]:
            weigh(clock, rows[at], t, w)
            base[0] = rows[at, ORIGIN]
            for b in range(TERMS):
                base[1 + b], base[1 + TERMS + b] = w[0, b], w[1, b]
        for part in range(2):
            for axis in range(3):
                total = 0.0
                for b in range(TERMS):
                    total += base[1 + TERMS * part + b] * rows[at, PLACES + TERMS * axis + b]
                states[k, 3 * part + axis] = total


@kernel()
def fill_piece_responses(scene, body, t, out):
    """Fill `out` (2, 6, 6) with the states of A and of B^T of a craft at time t."""
    at = locate(scene.spans, scene.unit_offsets[body], scene.unit_offsets[body + 1], t)
    w = stack_matrix(3, 12)
    weigh(scene.clock, scene.spans[at], t, w)
    for side in range(2):
        for j in range(6):
            c = scene.units[at, (AHEAD if side == 0 else BACK) + j]
            for axis in range(3):
                place, speed = 0.0, 0.0
                for b in range(TERMS):
                    place += w[0, b] * c[TERMS * axis + b]
                    speed += w[1, b] * c[TERMS * axis + b]
                out[side, axis, j], out[side, 3 + axis, j] = place, speed


@kernel()
def fill_piece(scene, at, start, end, ahead, back, row):
    """Fill a row with a craft's path in its piece `at` from `start` to `end`."""
    row[START], row[END] = start, end
    row[ORIGIN], row[LENGTH] = scene.spans[at, ORIGIN], scene.spans[at, LENGTH]
    for b in range(3 * TERMS):
        row[PLACES + b] = scene.units[at, 0, b]
    for j in range(6):
        if ahead[j] != 0.0 or back[j] != 0.0:
            for b in range(3 * TERMS):
                row[PLACES + b] += ahead[j] * scene.units[at, AHEAD + j, b]
                row[PLACES + b] += back[j] * scene.units[at, BACK + j, b]


@kernel()
def add_force(force, normal, factor, out):
    """Add a force along a contact's normal, through A or B^T (3, 6) in its zone's coordinates, to `out`."""
    for i in range(3):
        for j in range(6):
            out[j] += force * normal[i] * factor[i, j]


@kernel()
def felt_at(scene, contacts, k, craft):
    """Return the time when a contact's force acts on a craft: the contact, or the loss of thrust."""
    side = 0 if scene.pairs[contacts.which[k], 0] == craft else 1
    return contacts.times[k] - contacts.drifts[k, side]


@kernel()
def acting(scene, contacts, count, craft, own, sides):
    """Fill `own` and `sides` with the contacts whose forces act on a craft, by time; return their number.

    A force is positive for the first of a pair (side 0) and negative for the second.
    """
    total = 0
    for k in range(count):
        t = felt_at(scene, contacts, k, craft)
        if contacts.multipliers[k] == 0.0 or not scene.base[craft, START] < t < scene.base[craft, END]:
            continue
        for side in range(2):
            if scene.pairs[contacts.which[k], side] == craft:
                place = total
                while place > 0 and felt_at(scene, contacts, own[place - 1], craft) > t:
                    own[place], sides[place] = own[place - 1], sides[place - 1]
                    place -= 1
                own[place], sides[place] = k, side
                total += 1
    return total


@kernel()
def force_of(contacts, k, side):
    """Return a contact's force on one side of its pair, along the normal."""
    return contacts.multipliers[k] if side == 0 else -contacts.multipliers[k]


@kernel()
def deflect_pieces(scene, contacts, count, factors, rows, offsets):
    """Fill `rows` and `offsets` (N + 1,) with all craft's paths under the contacts' multipliers."""
    row = 0
    own, sides = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    ahead, back = stack_vector(6), stack_vector(6)
    for c in range(len(scene.base)):
        offsets[c] = row
        ahead[:] = 0.0
        back[:] = 0.0
        pushed = acting(scene, contacts, count, c, own, sides)
        for place in range(pushed):
            k, side = own[place], sides[place]
            add_force(force_of(contacts, k, side), contacts.normals[k], factors[k, side, 1], ahead)
        following = 0
        for at in range(scene.unit_offsets[c], scene.unit_offsets[c + 1]):
            start, end = scene.spans[at, START], scene.spans[at, END]
            while following < pushed and felt_at(scene, contacts, own[following], c) < end:
                k, side = own[following], sides[following]
                t = felt_at(scene, contacts, k, c)
                if t > start:
                    fill_piece(scene, at, start, t, ahead, back, rows[row])
                    row += 1
                    start = t
                force = force_of(contacts, k, side)
                add_force(force, contacts.normals[k], factors[k, side, 0], back)
                add_force(-force, contacts.normals[k], factors[k, side, 1], ahead)
                following += 1
                if following == pushed:
                    ahead[:] = 0.0  # without what rounding leaves
            fill_piece(scene, at, start, end, ahead, back, rows[row])
            row += 1
    offsets[len(scene.base)] = row


@kernel(void(TABLE, float64[:, ::1], int64, int64, float64[:, ::1], float64[:, :, ::1]))
def columns_back(table, segments, first, last, costates, out):
    """Fill `out` (last - first, 12, 6): columns at the window beginnings of consecutive segments.

    They belong to six optimal paths that reach the origin at rest, with `costates` (6, 6) as columns, at the
    end of the last segment.
    """
    _, joints, _, rows, _ = table
    flow, response, basis, work = np.empty((6, 6)), np.empty((6, 9)), np.empty(TERMS), np.empty((7, 6))
    states, ends = np.zeros((6, 6)), costates.copy()
    for q in range(last - 1, first - 1, -1):
        k = int(segments[q, WINDOW])
        u = share(joints, k, segments[q, WINDOW_ORIGIN], segments[q, LAST])
        blocks_at(rows, k, u, flow, response, basis)
        solve_all(flow, ends, work)
        for i in range(6):
            for j in range(6):
                for m in range(6):
                    states[i, j] -= response[i, m] * ends[m, j]
        solve_all(flow, states, work)
        for i in range(6):
            for j in range(6):
                out[q - first, i, j], out[q - first, 6 + i, j] = states[i, j], ends[i, j]
