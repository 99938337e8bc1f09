"""Close approaches of craft after a loss of thrust: for every instant of failure, the free drift after it.

    r(t; s) = E Phi(t - s) x(s) - r_other(t),    t >= s                                       # theory (44)

Instants s of failure and times t are sampled; each local minimum over t is refined.  A minimum that is missed
costs a round of planning, not safety, because the certified search decides.
"""

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
from closeform.motion.arc import END, START, primer_at
from closeform.motion.certified_march import locate
from closeform.planning.problem.approaches import sample_path, slide, spread
from closeform.planning.problem.contacts import turn_normal
from closeform.planning.problem.natural_motion import (
    add_natural,
    fill_flow,
    state_after,
    state_at_first,
)
from closeform.planning.problem.relative_motion import add_body, in_zone, motion_after, state_at_loss
from closeform.planning.problem.rounded_norm import norm_rate, rounded_norm
from closeform.planning.problem.scene import CONTACTS, INDICES, NUMBERS, ROWS, SCENE
from closeform.zones.shapes import BALL, norm

STEPS = 4  # maximum steps of Newton's method to a minimum
LOWER = 0.3  # of the fall to a sample from its neighbours: possible further fall to the minimum
FINE = 1e-9  # of all time: accuracy of a minimum
NEARBY = 1e-4  # of all time: between the thrusts of which the rate is the difference
BEYOND = 1e100  # squared norm above which a body is absent
SETTLED = 1e-7  # of all time: accuracy of an instant of failure
STRIDE, DAMPED = 0.01, 1e-3  # maximum step, of all time; damping of a step


@kernel()
def fill_drifts(scene, kind, drifts):
    """Fill `drifts` (3, 6, T): positions at the samples, in zone coordinates, of states at the first time."""
    flow, matrix = stack_matrix(3, 6), scene.matrices[kind]
    for k in range(len(scene.times)):
        fill_flow(scene, scene.times[k], flow)
        for i in range(3):
            for j in range(6):
                drifts[i, j, k] = (
                    matrix[i, 0] * flow[0, j] + matrix[i, 1] * flow[1, j] + matrix[i, 2] * flow[2, j]
                )


@kernel()
def fill_gaps(lost, drifts, matrix, other, first, gaps):
    """Fill `gaps` (3, T) with relative positions of a natural motion to another body, from `first` onward.

    They are in zone coordinates.
    """
    for i in range(3):
        a, b, c = matrix[i, 0], matrix[i, 1], matrix[i, 2]
        x, y, z, vx, vy, vz = lost[0], lost[1], lost[2], lost[3], lost[4], lost[5]
        for k in range(first, gaps.shape[1]):
            gaps[i, k] = (
                x * drifts[i, 0, k]
                + y * drifts[i, 1, k]
                + z * drifts[i, 2, k]
                + vx * drifts[i, 3, k]
                + vy * drifts[i, 4, k]
                + vz * drifts[i, 5, k]
                - (a * other[0, k] + b * other[1, k] + c * other[2, k])
            )


@kernel()
def fill_squares(scene, kind, sign, gaps, first, squares):
    """Fill the signed squares of a zone's norm at all samples; for absent bodies they exceed all others."""
    shape = scene.shapes[kind]
    if shape == BALL:
        for k in range(first, len(squares)):
            squares[k] = gaps[0, k] * gaps[0, k] + gaps[1, k] * gaps[1, k] + gaps[2, k] * gaps[2, k]
        return
    faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
    for k in range(first, len(squares)):
        size = norm(shape, faces, sign * gaps[0, k], sign * gaps[1, k], sign * gaps[2, k])
        squares[k] = size * abs(size)


@kernel()
def drifting_motion(scene, arcs, offsets, which, side, lost, t, out):
    """Fill the relative motion of a pair with one body on a natural motion, in zone coordinates."""
    sign = 1.0 if side == 0 else -1.0
    out[:] = 0.0
    add_natural(scene, t, lost, out, sign)
    add_body(scene, arcs, offsets, scene.pairs[which, 1 - side], t, out, -sign)
    in_zone(scene, which, out)


@kernel()
def lowest(scene, arcs, offsets, which, side, lost, t, low, high, motion):
    """Return the time of the minimum norm near t, within [low, high]; fill the relative motion there."""
    kind, work = scene.kinds[which], stack_vector(3)
    faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
    fine = FINE * (scene.span[1] - scene.span[0])
    while scene.shapes[kind] != BALL and high - low > fine:
        t = 0.5 * (low + high)
        drifting_motion(scene, arcs, offsets, which, side, lost, t, motion)
        if norm_rate(scene.shapes[kind], faces, scene.powers[kind], motion, work) < 0.0:
            low = t
        else:
            high = t
    for _ in range(STEPS):
        drifting_motion(scene, arcs, offsets, which, side, lost, t, motion)
        slope, bend = 0.0, 0.0
        for i in range(3):
            slope += motion[0, i] * motion[1, i]
            bend += motion[1, i] * motion[1, i] + motion[0, i] * motion[2, i]
        if not bend > 0.0 or abs(slope) <= fine * bend:
            break
        t = min(max(t - slope / bend, low), high)
    drifting_motion(scene, arcs, offsets, which, side, lost, t, motion)
    return t


@kernel()
def pair_norm(scene, which, motion):
    """Return a pair's norm with rounded edges, as a fraction of the aim."""
    kind = scene.kinds[which]
    faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
    x, y, z = motion[0, 0], motion[0, 1], motion[0, 2]
    return rounded_norm(scene.shapes[kind], faces, scene.powers[kind], x, y, z) / scene.aims[kind]


@kernel()
def add_minima(scene, arcs, offsets, which, side, s, lost, squares, first, reach, contacts, norms, count):
    """Add the local minima over t of one failure within reach; return the number of contacts."""
    motion, last = stack_matrix(3, 3), len(squares) - 1
    times = scene.times
    for k in range(first, last + 1):
        here = squares[k]
        before = squares[k - 1] if k > first else BEYOND
        after = squares[k + 1] if k < last else BEYOND
        if here >= BEYOND or here > before or here > after:
            continue
        fall = max(before if before < BEYOND else here, after if after < BEYOND else here) - here
        if here - LOWER * fall > reach * reach:
            continue
        low = max(times[k - 1] if k > first else s, scene.presence[which, 0])
        high = min(times[min(k + 1, last)], scene.presence[which, 1])
        t = lowest(scene, arcs, offsets, which, side, lost, times[k], low, high, motion)
        size = pair_norm(scene, which, motion)
        if not size < reach or count == len(norms):
            continue
        contacts.which[count], contacts.times[count], norms[count] = which, t, size
        contacts.drifts[count, side], contacts.drifts[count, 1 - side] = t - s, 0.0
        turn_normal(scene, which, motion, contacts.normals[count])
        count += 1
    return count


@kernel(int64(SCENE, ROWS, INDICES, ROWS, ROWS, float64, CONTACTS, NUMBERS))
def find_failures(scene, arcs, offsets, moments, shifts, reach, contacts, norms):
    """Fill `contacts` with local minima over time after failures at `moments` (N, S); return their number.

    Minima up to `reach` times the aim are returned; `norms` receives their norms.  `shifts` (N + M, 6) are
    added to the bodies as natural motions, given as states at the first time.
    """
    arcs, offsets = borrowed(arcs), borrowed(offsets)
    craft, count, times = len(scene.base), 0, scene.times
    places = np.empty((len(scene.states), 3, len(times)))
    states, drifts = np.empty((len(times), 6)), np.empty((3, 6, len(times)))
    gaps, squares, kind = np.empty((3, len(times))), np.empty(len(times)), -1
    for body in range(len(scene.states)):
        if body < craft:
            first, last = offsets[body], offsets[body + 1]
            sample_path(scene.clock, arcs, first, last, times, scene.bases, states)
            spread(states, places[body])
        else:
            spread(scene.states[body], places[body])
    lost = np.empty(6)
    for which in range(len(scene.pairs)):
        matrix = scene.matrices[scene.kinds[which]]
        if scene.kinds[which] != kind:
            kind = scene.kinds[which]
            fill_drifts(scene, kind, drifts)
        for side in range(2):
            body, other = scene.pairs[which, side], scene.pairs[which, 1 - side]
            if body >= craft:
                continue
            for k in range(moments.shape[1]):
                s = moments[body, k]
                state_at_loss(scene, arcs, offsets, body, s, lost)
                for i in range(6):
                    lost[i] += shifts[body, i] - shifts[other, i]
                first = np.searchsorted(times, s)
                fill_gaps(lost, drifts, matrix, places[other], first, gaps)
                fill_squares(scene, scene.kinds[which], 1.0 - 2.0 * side, gaps, first, squares)
                count = add_minima(
                    *(scene, arcs, offsets, which, side, s, lost, squares, first, reach),
                    *(contacts, norms, count),
                )
    return count


@kernel()
def fill_thrust(scene, arcs, offsets, body, s, out):
    """Fill `out` (3,) with a craft's thrust about any chief: its acceleration without the natural one."""
    motion, state = stack_matrix(3, 3), stack_vector(6)
    motion[:] = 0.0
    add_body(scene, arcs, offsets, body, s, motion, 1.0)
    state_at_loss(scene, arcs, offsets, body, s, state)
    add_natural(scene, s, state, motion, -1.0)
    for i in range(3):
        out[i] = motion[2, i]


@kernel()
def fill_turns(scene, arcs, offsets, which, side, t, drift, out):
    """Fill derivatives of a pair's position after a failure at s: rows d/ds, d2/dsdt, d2/ds2.

    Derivatives are in zone coordinates.                                                  # theory (44)
    """
    craft, s = scene.pairs[which, side], t - drift
    row = arcs[locate(arcs, offsets[craft], offsets[craft + 1], s)]
    first, second, bent = stack_vector(6), stack_vector(6), stack_matrix(3, 3)
    if len(scene.clock) == 0:
        ux, uy, uz, wx, wy, wz = primer_at(row, s)
        first[3], first[4], first[5], second[3], second[4], second[5] = ux, uy, uz, wx, wy, wz
    else:
        step = NEARBY * (scene.span[1] - scene.span[0])
        low, high = max(s - step, row[START]), min(s + step, row[END] - FINE * step)
        before, after = stack_vector(3), stack_vector(3)
        fill_thrust(scene, arcs, offsets, craft, low, before)
        fill_thrust(scene, arcs, offsets, craft, high, after)
        for i in range(3):
            second[3 + i] = (after[i] - before[i]) / (high - low)
            first[3 + i] = before[i] + (s - low) * second[3 + i]
    for i in range(3):
        first[i], second[i] = 0.0, -first[3 + i]
    begun = stack_vector(6)
    for i in range(6):
        begun[i] = first[i]
    bent[:] = 0.0
    state_at_first(scene, s, begun)
    add_natural(scene, s, begun, bent, 1.0)  # Phi(t, s) changes with s by -Phi A
    for i in range(3):
        second[3 + i] -= bent[2, i]
    state_after(scene, s, t, first)
    state_after(scene, s, t, second)
    sign = 1.0 if side == 0 else -1.0
    for i in range(3):
        out[0, i], out[1, i], out[2, i] = sign * first[i], sign * first[3 + i], sign * second[i]
    in_zone(scene, which, out)


@kernel()
def slide_failure(scene, arcs, offsets, contacts, k, side, motion, turns):
    """Move contact k to its pair's closest approach over failure instant and time, by Newton's method."""
    which, span = contacts.which[k], scene.span[1] - scene.span[0]
    craft = scene.base[scene.pairs[which, side]]
    margin = 1e-7 * (craft[END] - craft[START])
    for _ in range(2 * STEPS):
        t, drift = contacts.times[k], contacts.drifts[k, side]
        motion_after(scene, arcs, offsets, which, t, contacts.drifts[k], motion)
        fill_turns(scene, arcs, offsets, which, side, t, drift, turns)
        gs = gt = ss = st = tt = 0.0
        for i in range(3):
            q, moving = motion[0, i], motion[1, i]
            gs, gt = gs + q * turns[0, i], gt + q * moving
            ss += turns[0, i] * turns[0, i] + q * turns[2, i]
            st += turns[0, i] * moving + q * turns[1, i]
            tt += moving * moving + q * motion[2, i]
        if t >= scene.span[1] and gt < 0.0:  # at the last time: a step in s alone
            gt, st, tt = 0.0, 0.0, 1.0
        if not (tt > 0.0 and ss * tt > st * st):  # not convex: treat both motions as straight
            ss, st, tt = 0.0, 0.0, 0.0
            for i in range(3):
                ss, tt = ss + turns[0, i] * turns[0, i], tt + motion[1, i] * motion[1, i]
                st += turns[0, i] * motion[1, i]
            ss, tt = (1.0 + DAMPED) * ss, (1.0 + DAMPED) * tt
        size = ss * tt - st * st
        if not size > 0.0:
            return
        ds, dt = (st * gt - tt * gs) / size, (st * gs - ss * gt) / size
        shorter = min(1.0, STRIDE * span / max(abs(ds), abs(dt), 1e-300))
        ds, dt = shorter * ds, shorter * dt
        s = min(max(t - drift + ds, craft[START] + margin), craft[END] - margin)
        contacts.times[k] = min(max(t + dt, s), scene.span[1])
        contacts.drifts[k, side] = contacts.times[k] - s
        if max(abs(ds), abs(dt)) <= SETTLED * span:
            return


@kernel(void(SCENE, ROWS, INDICES, CONTACTS, ROWS, NUMBERS))
def slide_failures(scene, arcs, offsets, contacts, turned, norms):
    """Move contacts to their pairs' current closest approaches, with the normals there.

    Contacts with zones that have edges keep their failure instants.  Fills the normals `turned` (K, 3) at the
    previous times, and the norms (K,) as a fraction of the aim.
    """
    motion, turns, work, before = stack_matrix(3, 3), stack_matrix(3, 3), stack_vector(3), stack_vector(3)
    for k in range(len(contacts.times)):
        which = contacts.which[k]
        before[0], before[1], before[2] = contacts.times[k], contacts.drifts[k, 0], contacts.drifts[k, 1]
        motion_after(scene, arcs, offsets, which, contacts.times[k], contacts.drifts[k], motion)
        size = pair_norm(scene, which, motion)
        turn_normal(scene, which, motion, turned[k])
        side = 0 if contacts.drifts[k, 0] > 0.0 else 1
        if contacts.drifts[k, side] == 0.0:
            contacts.times[k] = slide(scene, arcs, offsets, which, before[0], FINE, motion, work)
        elif scene.shapes[scene.kinds[which]] == BALL:
            slide_failure(scene, arcs, offsets, contacts, k, side, motion, turns)
        motion_after(scene, arcs, offsets, which, contacts.times[k], contacts.drifts[k], motion)
        if pair_norm(scene, which, motion) > size:
            contacts.times[k], contacts.drifts[k, 0], contacts.drifts[k, 1] = before[0], before[1], before[2]
            motion_after(scene, arcs, offsets, which, contacts.times[k], contacts.drifts[k], motion)
        norms[k] = pair_norm(scene, which, motion)
        turn_normal(scene, which, motion, contacts.normals[k])
