"""Deflection of paths with fixed ends by forces at contacts: the reproducing kernel of a formation.

Paths of a craft between fixed end states form a Hilbert space with the energy as its norm.  A force f at
time s, a jump f of the thrust rate, deflects the minimum-energy path by K(t, s) f, where

    K(t, s) = A(t) B(s)  for t <= s,   K(t, s) = K(s, t)^T                        # theory (12)

with A(t) the position's response to the initial thrust and thrust rate, and B(s) = -F(T)^-1 F_w(T - s) the
change of these by the force; F(T) is the response of the whole state at the end, F_w its columns of the
thrust rate.  No Gramian is inverted in Palmer's coordinates, so there is no cancellation as n T -> 0.

A contact of craft i and j pushes both with one force, opposite in sign.  The response of one contact to
another is therefore a signed sum over the craft that they share.  Each contact stores A and B^T in its
zone's coordinates for either craft: `factors` (2, 2, 3, 6).

After a loss of thrust at s a craft responds at t through its state at s, followed by natural motion:

    A = E Phi(t, s) [A(s); A'(s)],    B^T = E Phi(t, s) [B(s)^T; B'(s)^T]                      # theory (71)
"""

from typing import Any

import numpy as np
from numba import int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import END, MEAN_MOTION, START, STATE, THRUST, primer_at, state_at
from closeform.motion.hill import coast, response
from closeform.motion.linear import copy, solve
from closeform.planning.problem.natural_motion import state_after
from closeform.planning.problem.pieces import (
    acting,
    add_force,
    deflect_pieces,
    felt_at,
    fill_piece_responses,
    force_of,
)
from closeform.planning.problem.relative_motion import motion_after
from closeform.planning.problem.scene import BLOCKS, CONTACTS, INDICES, ROWS, SCENE, Contacts, Scene

PLACE, FORCE = 0, 1  # of the factors: A and B^T


@kernel(void(ROWS, BLOCKS))
def invert_responses(base, inverses):
    """Fill `inverses` (N, 6, 6) with each craft's F(T)^-1."""
    matrix, rhs = stack_matrix(6, 6), stack_vector(6)
    for c in range(len(base)):
        for k in range(6):
            response(base[c, MEAN_MOTION], base[c, END] - base[c, START], matrix)
            rhs[:] = 0.0
            rhs[k] = 1.0
            solve(matrix, rhs, 6)
            for i in range(6):
                inverses[c, i, k] = rhs[i]


@kernel()
def is_controllable(scene, body, t):
    """Return whether a force at time t deflects a body; obstacles and coasting craft are not deflected."""
    return body < len(scene.base) and scene.base[body, START] < t < scene.base[body, END]


@kernel()
def fill_hill_responses(scene, body, t, ahead, left, out):
    """Fill `out` (2, 6, 6) with the states of A and of B^T of a craft at time t."""
    n = scene.base[body, MEAN_MOTION]
    response(n, t - scene.base[body, START], ahead)
    response(n, scene.base[body, END] - t, left)
    inverse = scene.inverses[body]
    for j in range(6):
        for i in range(3):
            out[PLACE, i, j], out[PLACE, 3 + i, j] = ahead[i, j], ahead[3 + i, j]
            total, slope = 0.0, 0.0
            for h in range(6):  # F_w, and its rate in the time that is left
                rate = left[h, i]
                if i == 0:
                    rate -= 2.0 * n * left[h, 4]
                elif i == 1:
                    rate += 2.0 * n * left[h, 3]
                total -= inverse[j, h] * left[h, 3 + i]
                slope += inverse[j, h] * rate
            out[FORCE, i, j], out[FORCE, 3 + i, j] = total, slope


@kernel()
def fill_factors(scene, contacts, count, factors):
    """Fill the factors (count, 2, 2, 3, 6) of contacts; zero for bodies that are not controllable."""
    ahead, left, state = stack_matrix(6, 6), stack_matrix(6, 6), stack_vector(6)
    states = np.empty((2, 6, 6))
    for k in range(count):
        which = contacts.which[k]
        matrix = scene.matrices[scene.kinds[which]]
        for side in range(2):
            body, drift = scene.pairs[which, side], contacts.drifts[k, side]
            t = contacts.times[k] - drift
            if not is_controllable(scene, body, t):
                factors[k, side] = 0.0
                continue
            if len(scene.clock) > 0:
                fill_piece_responses(scene, body, t, states)
            else:
                fill_hill_responses(scene, body, t, ahead, left, states)
            for part in range(2):
                for j in range(6):
                    for i in range(6):
                        state[i] = states[part, i, j]
                    if drift > 0.0:
                        state_after(scene, t, contacts.times[k], state)
                    for i in range(3):
                        factors[k, side, part, i, j] = (
                            matrix[i, 0] * state[0] + matrix[i, 1] * state[1] + matrix[i, 2] * state[2]
                        )


@kernel()
def fill_gram(scene, contacts, count, factors, gram):
    """Fill `gram` (count, count): displacement of contacts along their normals by unit forces at others."""
    ahead, back = np.zeros((count, 2, 6)), np.zeros((count, 2, 6))
    for k in range(count):
        for side in range(2):
            for j in range(6):
                for i in range(3):
                    ahead[k, side, j] += contacts.normals[k, i] * factors[k, side, PLACE, i, j]
                    back[k, side, j] += contacts.normals[k, i] * factors[k, side, FORCE, i, j]
    for k in range(count):
        for m in range(k + 1):
            total = 0.0
            for a in range(2):
                for b in range(2):
                    if scene.pairs[contacts.which[k], a] == scene.pairs[contacts.which[m], b]:
                        part = 0.0
                        mine = contacts.times[k] - contacts.drifts[k, a]
                        if mine <= contacts.times[m] - contacts.drifts[m, b]:
                            for j in range(6):
                                part += ahead[k, a, j] * back[m, b, j]
                        else:
                            for j in range(6):
                                part += ahead[m, b, j] * back[k, a, j]
                        total += part if a == b else -part
            gram[k, m] = gram[m, k] = total


@kernel()
def fill_block(scene, contacts, factors, k, m, out):
    """Fill `out` (3, 3) with the response of the position at contact k to a force at contact m."""
    out[:] = 0.0
    for a in range(2):
        for b in range(2):
            if scene.pairs[contacts.which[k], a] != scene.pairs[contacts.which[m], b]:
                continue
            sign = 1.0 if a == b else -1.0
            ahead = contacts.times[k] - contacts.drifts[k, a] <= contacts.times[m] - contacts.drifts[m, b]
            mine, other = (PLACE, FORCE) if ahead else (FORCE, PLACE)
            for i in range(3):
                for j in range(3):
                    total = 0.0
                    for h in range(6):
                        total += factors[k, a, mine, i, h] * factors[m, b, other, j, h]
                    out[i, j] += sign * total


@kernel()
def coast_arc(n, start, end, state, row):
    """Fill a row with an arc of natural motion."""
    row[:] = 0.0
    row[START], row[END], row[MEAN_MOTION] = start, end, n
    for i in range(6):
        row[STATE + i] = state[i]


@kernel()
def deflect(scene, contacts, count, factors, rows, offsets):
    """Fill `rows` and `offsets` (N + 1,) with all craft's paths under the contacts' multipliers."""
    if len(scene.clock) == 0:
        deflect_arcs(scene, contacts, count, factors, rows, offsets)
    else:
        deflect_pieces(scene, contacts, count, factors, rows, offsets)


@kernel()
def deflect_arcs(scene, contacts, count, factors, arcs, offsets):
    """Fill `arcs` and `offsets` (N + 1,) with all craft's paths by Hill's equations.

    A craft has one arc more than contacts that act on it, and the coasts before and after its own time.
    """
    row = 0
    own, sides, push = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64), stack_vector(3)
    for c in range(len(scene.base)):
        offsets[c] = row
        n, begin, end = scene.base[c, MEAN_MOTION], scene.base[c, START], scene.base[c, END]
        if scene.span[0] < begin:
            b = scene.base[c]
            back = coast(n, scene.span[0] - begin, b[6], b[7], b[8], b[9], b[10], b[11])
            coast_arc(n, scene.span[0], begin, back, arcs[row])
            row += 1
        copy(scene.base[c], arcs[row])
        pushed = acting(scene, contacts, count, c, own, sides)
        for place in range(pushed):
            k, side = own[place], sides[place]
            start = arcs[row, THRUST : THRUST + 6]
            add_force(force_of(contacts, k, side), contacts.normals[k], factors[k, side, FORCE], start)
        for place in range(pushed):
            k = own[place]
            t, which = felt_at(scene, contacts, k, c), contacts.which[k]
            if t > arcs[row, START]:  # contacts at one instant share an arc
                arcs[row, END] = t
                copy(scene.base[c], arcs[row + 1])
                arcs[row + 1, START] = t
                state, primer = state_at(arcs[row], t), primer_at(arcs[row], t)
                for i in range(6):
                    arcs[row + 1, STATE + i], arcs[row + 1, THRUST + i] = state[i], primer[i]
                row += 1
            force = force_of(contacts, k, sides[place])
            matrix, normal = scene.matrices[scene.kinds[which]], contacts.normals[k]
            for j in range(3):
                push[j] = force * (
                    normal[0] * matrix[0, j] + normal[1] * matrix[1, j] + normal[2] * matrix[2, j]
                )
            jump = coast(n, t - contacts.times[k], 0.0, 0.0, 0.0, push[0], push[1], push[2])
            for j in range(6):
                arcs[row, THRUST + j] += jump[j]
        row += 1
        if end < scene.span[1]:
            coast_arc(n, end, scene.span[1], state_at(arcs[row - 1], end), arcs[row])
            row += 1
    offsets[len(scene.base)] = row


def room_for(scene: Scene, contacts: Contacts) -> tuple[Floats, Any]:
    """Return empty arrays for the rows of the craft's paths under contacts."""
    count, width = scene.room
    return np.zeros((count + 2 * contacts.number, width)), np.zeros(len(scene.base) + 1, dtype=np.int64)


@kernel(int64(SCENE, CONTACTS, ROWS, INDICES))
def deflected_arcs(scene, contacts, arcs, offsets):
    """Fill the paths of `deflect` for Python; return the number of arcs."""
    factors = np.empty((len(contacts.times), 2, 2, 3, 6))
    fill_factors(scene, contacts, len(contacts.times), factors)
    deflect(scene, contacts, len(contacts.times), factors, arcs, offsets)
    return offsets[len(scene.base)]


@kernel(void(SCENE, CONTACTS, ROWS))
def fill_changes(scene, contacts, out):
    """Fill the changes (N, 6) of all craft's initial thrust and thrust rate under contacts."""
    count = len(contacts.times)
    factors = np.empty((count, 2, 2, 3, 6))
    fill_factors(scene, contacts, count, factors)
    own, sides = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    out[:] = 0.0
    for c in range(len(scene.base)):
        for place in range(acting(scene, contacts, count, c, own, sides)):
            k, side = own[place], sides[place]
            add_force(force_of(contacts, k, side), contacts.normals[k], factors[k, side, FORCE], out[c])


@kernel(void(SCENE, ROWS, INDICES, CONTACTS, BLOCKS, ROWS))
def look_at(scene, arcs, offsets, contacts, motions, gram):
    """Fill the relative motions (K, 3, 3) of pairs at contacts, and their kernel (3K, 3K) there.

    If `gram` is empty, the kernel is not computed.
    """
    count = len(contacts.times)
    for k in range(count):
        which, t = contacts.which[k], contacts.times[k]
        motion_after(scene, arcs, offsets, which, t, contacts.drifts[k], motions[k])
    if len(gram) == 0:
        return
    factors, block = np.empty((count, 2, 2, 3, 6)), stack_matrix(3, 3)
    fill_factors(scene, contacts, count, factors)
    for k in range(count):
        for m in range(count):
            fill_block(scene, contacts, factors, k, m, block)
            for i in range(3):
                for j in range(3):
                    gram[3 * k + i, 3 * m + j] = block[i, j]
