"""Approximate search for close approaches between certified searches.

Samples locate the minima of every pair's norm, which are then refined.  A minimum that is missed costs a
round of planning, not safety, because the certified march decides.
"""

from math import inf, nan, sqrt

import numpy as np
from numba import void

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import END, MEAN_MOTION, START, primer_at, pushes, state_at
from closeform.motion.certified_march import locate
from closeform.motion.hill import inverse_transforms, step_on
from closeform.planning.problem.pieces import sample_pieces
from closeform.planning.problem.relative_motion import relative_motion
from closeform.planning.problem.rounded_norm import norm_rate, rounded_norm
from closeform.planning.problem.scene import BLOCKS, INDICES, NUMBERS, ROWS
from closeform.zones.shapes import BALL, norm

LEVEL = 1e-13  # slope times width, in zones, at which a minimum has converged
NEWTON, STRIDE = 8, 0.1  # maximum steps to a minimum, and maximum step as a share of the interval
EVEN = 1e-12  # of a step between samples: larger differences are different steps
ABSENT = 1e150  # coordinate of a body while it is absent


@kernel()
def sample_body(arcs, first, last, times, states):
    """Fill the states (T, 6) of one body at `times`; the first number is inf where it is absent.

    Along an arc the states are propagated from sample to sample, with transition matrices that are
    reused for equal steps.
    """
    row, step, transforms = -1, inf, inverse_transforms(0.0, 0.0)
    state = thrust = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(len(times)):
        t = times[k]
        if not arcs[first, START] <= t <= arcs[last - 1, END]:
            states[k, 0], row = inf, -1
            continue
        before, row = row, locate(arcs, first, last, t)
        arc = arcs[row]
        if row != before or pushes(arc):
            state, thrust, step = state_at(arc, t), primer_at(arc, t), inf
        else:
            h = t - times[k - 1]
            if abs(h - step) > EVEN * h:
                step, transforms = h, inverse_transforms(arc[MEAN_MOTION], h)
            state, thrust = step_on(arc[MEAN_MOTION], step, transforms, state, thrust)
        for i in range(6):
            states[k, i] = state[i]


@kernel()
def sample_path(clock, rows, first, last, times, bases, states):
    """Fill the states (T, 6) of one body at `times`, from arcs, or from pieces on the clock of a chief."""
    if len(clock) == 0:
        sample_body(rows, first, last, times, states)
    else:
        sample_pieces(clock, rows, first, last, times, bases, states)


@kernel(void(NUMBERS, ROWS, INDICES, NUMBERS, ROWS, BLOCKS))
def sample_bodies(clock, rows, offsets, times, bases, states):
    """Fill the states (B, T, 6) of all bodies at `times`, and of any chief the `bases` (T, 25) there."""
    for body in range(len(offsets) - 1):
        sample_path(clock, rows, offsets[body], offsets[body + 1], times, bases, states[body])


@kernel()
def spread(states, places):
    """Fill positions (3, T) axis by axis, for vectorised loops; return the maximum speed."""
    fastest = 0.0
    for k in range(len(states)):
        present = states[k, 0] < inf
        for i in range(3):
            places[i, k] = states[k, i] if present else ABSENT
        if present:
            vx, vy, vz = states[k, 3], states[k, 4], states[k, 5]
            fastest = max(fastest, vx * vx + vy * vy + vz * vz)
    return sqrt(fastest)


@kernel()
def nearest_sample(one, other, squares):
    """Fill the squared distances of two bodies at the samples; return their minimum."""
    for k in range(len(squares)):
        x, y, z = one[0, k] - other[0, k], one[1, k] - other[1, k], one[2, k] - other[2, k]
        squares[k] = x * x + y * y + z * z
    least = squares[0]
    for k in range(1, len(squares)):
        least = squares[k] if squares[k] < least else least
    return least


@kernel()
def apart(scene, kind, one, other):
    """Return the norm of two bodies' relative position without rounded edges, and its speed in zones/s."""
    if one[0] == inf or other[0] == inf:
        return inf, 0.0
    matrix = scene.matrices[kind]
    x, y, z, vx, vy, vz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(3):
        gap, speed = one[j] - other[j], one[3 + j] - other[3 + j]
        x, y, z = x + matrix[0, j] * gap, y + matrix[1, j] * gap, z + matrix[2, j] * gap
        vx, vy, vz = vx + matrix[0, j] * speed, vy + matrix[1, j] * speed, vz + matrix[2, j] * speed
    faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
    return norm(scene.shapes[kind], faces, x, y, z), sqrt(vx * vx + vy * vy + vz * vz)


@kernel()
def norm_at(scene, arcs, offsets, which, t, motion):
    """Return the norm of a pair at time t; fill its relative motion."""
    relative_motion(scene, arcs, offsets, which, t, motion)
    kind = scene.kinds[which]
    faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
    return rounded_norm(
        scene.shapes[kind], faces, scene.powers[kind], motion[0, 0], motion[0, 1], motion[0, 2]
    )


@kernel()
def rate_at(scene, arcs, offsets, which, t, motion, work):
    """Return the rate of a pair's norm at time t; fill its relative motion and overwrite `work`."""
    relative_motion(scene, arcs, offsets, which, t, motion)
    kind = scene.kinds[which]
    faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
    return norm_rate(scene.shapes[kind], faces, scene.powers[kind], motion, work)


@kernel()
def minimum_between(scene, arcs, offsets, which, a, b, falling, rising, fine, motion, work):
    """Return the time of the minimum norm between a (falling) and b (rising), by the Illinois method."""
    side, t, span = 0, a, b - a
    for k in range(60):
        if b - a <= fine * span:
            break
        t = (a * rising - b * falling) / (rising - falling)
        if k % 4 == 3 or not a < t < b:  # bisect: rates jump where another part of the zone is nearest
            t = a + 0.5 * (b - a)
        slope = rate_at(scene, arcs, offsets, which, t, motion, work)
        if abs(slope) * (b - a) < LEVEL:
            break
        if slope < 0.0:
            a, falling = t, slope
            rising *= 0.5 if side < 0 else 1.0
            side = -1
        else:
            b, rising = t, slope
            falling *= 0.5 if side > 0 else 1.0
            side = 1
    return t


@kernel()
def descend(scene, arcs, offsets, which, t, low, high, fine, motion):
    """Return the time of a ball's local minimum norm near t, within [low, high], by Newton's method.

    Returns nan where the method does not converge; fills the relative motion there.
    """
    for _ in range(NEWTON):
        relative_motion(scene, arcs, offsets, which, t, motion)
        square, slope, bend = 0.0, 0.0, 0.0
        for i in range(3):
            square += motion[0, i] * motion[0, i]
            slope += motion[0, i] * motion[1, i]
            bend += motion[1, i] * motion[1, i] + motion[0, i] * motion[2, i]
        bend -= slope * slope / square  # second derivative of the norm, times the norm
        if not bend > 0.0:
            return nan
        step = -slope / bend
        if (t == low and step < 0.0) or (t == high and step > 0.0) or abs(step) <= fine:
            return t
        if abs(step) > STRIDE * (high - low):
            return nan
        t = min(max(t + step, low), high)
    return nan


@kernel()
def slide(scene, arcs, offsets, which, t, fine, motion, work):
    """Return the time of the pair's local minimum norm downhill from t, within the pair's window."""
    start, end = scene.windows[which, 0], scene.windows[which, 1]
    if scene.shapes[scene.kinds[which]] == BALL:
        settled = descend(scene, arcs, offsets, which, t, start, end, fine * (end - start), motion)
        if settled == settled:
            return settled
    here = rate_at(scene, arcs, offsets, which, t, motion, work)
    sign = -1.0 if here > 0.0 else 1.0
    step = 1e-3 * (end - start)
    a = t
    while True:
        b = min(max(t + sign * step, start), end)
        there = rate_at(scene, arcs, offsets, which, b, motion, work)
        if there * here <= 0.0 or b in (start, end):
            break
        a, here = b, there
        step *= 2.0
    if there * here > 0.0 or here == 0.0:
        return b if here != 0.0 else a
    if a < b:
        return minimum_between(scene, arcs, offsets, which, a, b, here, there, fine, motion, work)
    return minimum_between(scene, arcs, offsets, which, b, a, there, here, fine, motion, work)


@kernel()
def sample_craft(scene, arcs, offsets, contacts, count, states, places, speeds):
    """Fill states, positions axis by axis and maximum speeds of all craft; copy those without forces."""
    pushed = np.zeros(len(states), dtype=np.bool_)
    for k in range(count):
        if contacts.multipliers[k] != 0.0:
            for side in range(2):
                pushed[scene.pairs[contacts.which[k], side]] = True
    for craft in range(len(scene.base)):
        if pushed[craft]:
            first, last = offsets[craft], offsets[craft + 1]
            sample_path(scene.clock, arcs, first, last, scene.times, scene.bases, states[craft])
            speeds[craft] = spread(states[craft], places[craft])
        else:
            for k in range(len(scene.times)):
                for i in range(6):
                    states[craft, k, i] = scene.states[craft, k, i]
            speeds[craft] = spread(scene.states[craft], places[craft])


@kernel()
def find_minima(scene, arcs, offsets, states, places, speeds, found):
    """Fill `found` with rows (pair, time, norm as a fraction of the aim) of minima below the aim.

    Returns the number of minima, including those for which `found` has no row.  A zone with rounded edges
    is sampled without rounding, where its norm is smaller.
    """
    times = scene.times
    count, last, widest = 0, len(times) - 1, 0.0
    for k in range(last):
        widest = max(widest, times[k + 1] - times[k])
    motion, work, squares = stack_matrix(3, 3), stack_vector(3), np.empty(len(times))
    for which in range(len(scene.pairs)):
        i, j = scene.pairs[which, 0], scene.pairs[which, 1]
        kind = scene.kinds[which]
        aim = scene.aims[kind]
        reach = aim * scene.radii[kind] + widest * (speeds[i] + speeds[j])
        if nearest_sample(places[i], places[j], squares) > reach * reach:
            continue
        before, here = inf, inf
        after, speed = apart(scene, kind, states[i, 0], states[j, 0])
        for k in range(len(times)):
            before, here, pace = here, after, speed
            after = inf
            if k < last and squares[k + 1] <= reach * reach:  # no minimum is in reach from farther away
                after, speed = apart(scene, kind, states[i, k + 1], states[j, k + 1])
            if here == inf or here > before or here > after or here - pace * widest > aim:
                continue
            start = max(times[max(k - 1, 0)], scene.presence[which, 0])
            end = min(times[min(k + 1, last)], scene.presence[which, 1])
            when = times[k]
            settled = nan
            if start < end and scene.shapes[kind] == BALL:
                settled = descend(
                    scene, arcs, offsets, which, when, start, end, 1e-12 * (end - start), motion
                )
                when = settled
            if start < end and settled != settled:
                falling = rate_at(scene, arcs, offsets, which, start, motion, work)
                rising = rate_at(scene, arcs, offsets, which, end, motion, work)
                when = start if falling >= 0.0 else end
                if falling < 0.0 < rising:
                    when = minimum_between(
                        scene, arcs, offsets, which, start, end, falling, rising, 1e-14, motion, work
                    )
            ratio = norm_at(scene, arcs, offsets, which, when, motion) / aim
            if ratio < 1.0:
                if count < len(found):
                    found[count, 0], found[count, 1], found[count, 2] = which, when, ratio
                count += 1
    return count
