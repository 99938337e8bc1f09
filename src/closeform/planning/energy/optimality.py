"""Newton's method on the conditions of optimality of a formation's contacts.

A contact has a force f (in zone coordinates) and a time t.  The path q there touches one smooth part of
the zone's norm, or passes an edge and touches two, A as it falls and B as it rises.  Conditions:

    one part     A(q) = aim,               f along A's gradient,                  f . q' = 0
    an edge      A(q) = B(q) = aim,        f in the plane of both gradients,      f . q' = 0

A corner, three parts at one instant, is never better than the edge of the active parts before and after,
so there is no third kind.  The path is linear in all forces, so the unknowns are the forces and times
alone: four for each contact.
"""

from math import sqrt

import numpy as np

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.linear import solve
from closeform.planning.problem.deflection import add_block, deflect, fill_factors
from closeform.planning.problem.relative_motion import relative_motion
from closeform.planning.problem.rounded_norm import active_parts, add_bend, gradient, rounded_norm
from closeform.zones.shapes import part

STEPS = 12
TOUCHING = 1e-11  # error left in the norm
ALONG, STEADY = 1e-9, 1e-8  # errors in the force's direction, and in the norm's rate times the duration
LARGEST = 60  # contacts of one group, whose conditions are solved at once
FAR = 10.0  # error beyond which the method diverges


@kernel()
def part_at(scene, kind, index, motion, out):
    """Return one part of a zone's norm at a relative motion, its gradient in `out`; -1: all, rounded."""
    faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
    shape, power = scene.shapes[kind], scene.powers[kind]
    x, y, z = motion[0, 0], motion[0, 1], motion[0, 2]
    if index < 0:
        gradient(shape, faces, power, motion, out)
        return rounded_norm(shape, faces, power, x, y, z)
    value, gx, gy, gz = part(shape, faces, index, x, y, z)
    out[0], out[1], out[2] = gx, gy, gz
    return value


@kernel()
def shares(force, gradients, count, out):
    """Fill the least-squares multipliers of a force in terms of the active parts' gradients."""
    aa, ab, bb, af, bf = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        a, b = gradients[0, i], gradients[1, i]
        aa, ab, bb = aa + a * a, ab + a * b, bb + b * b
        af, bf = af + a * force[i], bf + b * force[i]
    out[0], out[1] = af / aa, 0.0
    if count == 2:
        size = aa * bb - ab * ab
        out[0], out[1] = (af * bb - bf * ab) / size, (bf * aa - af * ab) / size


@kernel()
def across(gradients, count, out):
    """Fill `out` (2, 3) with the directions orthogonal to the gradients: two, on an edge one."""
    if count == 2:
        a, b = gradients[0], gradients[1]
    else:
        a, b = gradients[0], out[1]
        least = 0 if abs(a[0]) <= min(abs(a[1]), abs(a[2])) else (1 if abs(a[1]) <= abs(a[2]) else 2)
        for i in range(3):
            b[i] = 1.0 if i == least else 0.0
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    size = sqrt(x * x + y * y + z * z)
    x, y, z = x / size, y / size, z / size
    out[0, 0], out[0, 1], out[0, 2] = x, y, z
    if count == 1:
        size = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
        out[1, 0] = (a[1] * z - a[2] * y) / size
        out[1, 1] = (a[2] * x - a[0] * z) / size
        out[1, 2] = (a[0] * y - a[1] * x) / size


@kernel()
def choose_parts(scene, arcs, offsets, contacts, count, active, parts):
    """Fill the parts that each contact touches, `active` (count, 2), and their number in `parts` (count,)."""
    motion, values, gradients = stack_matrix(3, 3), stack_vector(2), stack_matrix(2, 3)
    for k in range(count):
        which = contacts.which[k]
        kind = scene.kinds[which]
        relative_motion(scene, arcs, offsets, which, contacts.times[k], motion)
        faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
        parts[k] = active_parts(
            scene.shapes[kind], faces, scene.powers[kind], motion, active[k], values, gradients
        )


@kernel()
def is_pinned(scene, which, t):
    """Return whether a contact is at an end of its window, where its time is fixed at any speed."""
    return t <= scene.windows[which, 0] or t >= scene.windows[which, 1]


@kernel()
def conditions_of(scene, contacts, k, arcs, offsets, active, parts, motion, rows, lines, rhs):
    """Fill one contact's errors of the conditions in `rhs` (4,); return the largest, inf if wrong.

    Fills its relative `motion`, and `rows` (3, 3), the derivatives of the first three by position.  A
    solution is wrong if a part pulls, or if a contact is at a maximum of the distance in time.
    """
    values, gradients, weights, bend = (
        stack_vector(2),
        stack_matrix(2, 3),
        stack_vector(2),
        stack_matrix(3, 3),
    )
    which, force, count = contacts.which[k], contacts.normals[k], parts[k]
    kind = scene.kinds[which]
    relative_motion(scene, arcs, offsets, which, contacts.times[k], motion)
    for a in range(count):
        values[a] = part_at(scene, kind, active[k, a], motion, gradients[a])
    shares(force, gradients, count, weights)
    across(gradients, count, lines)
    bend[:] = 0.0
    faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
    add_bend(scene.shapes[kind], faces, scene.powers[kind], motion, active[k], weights, count, bend)
    size = sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])
    speed_along, bent = 0.0, 0.0
    for i in range(3):
        speed_along += force[i] * motion[1, i]
        bent += force[i] * motion[2, i]
        for j in range(3):
            bent += motion[1, i] * bend[i, j] * motion[1, j]
    error, wrong = 0.0, False
    for a in range(3):
        rhs[a] = 0.0
        if a < count:  # the part's value
            for i in range(3):
                rows[a, i] = gradients[a, i]
            rhs[a] = scene.aims[kind] - values[a]
            error = max(error, abs(rhs[a]))
            wrong = wrong or weights[a] <= 0.0
        else:  # no component of the force orthogonal to the gradients, which turn with the position
            line = lines[a - count]
            for i in range(3):
                rows[a, i] = 0.0
                rhs[a] -= line[i] * force[i]
                for j in range(3):
                    rows[a, i] -= line[j] * bend[j, i]
            error = max(error, abs(rhs[a]) / size * (TOUCHING / ALONG))
    rhs[3] = 0.0
    if not is_pinned(scene, which, contacts.times[k]):
        rhs[3] = -speed_along
        longest = scene.windows[which, 1] - scene.windows[which, 0]
        error = max(error, abs(speed_along) / size * longest * (TOUCHING / STEADY))
        wrong = wrong or (count == 1 and bent < 0.0)
    return np.inf if wrong and error < TOUCHING else error


@kernel()
def fill_block(scene, contacts, factors, k, m, motion, rows, jacobian, row, column):
    """Fill the 4 x 4 derivatives of the conditions of contact k by the force and time of contact m."""
    place, place_rate, speed, speed_rate = (
        stack_matrix(3, 3),
        stack_matrix(3, 3),
        stack_matrix(3, 3),
        stack_matrix(3, 3),
    )
    add_block(scene, contacts, factors, k, m, 0, 0, place)
    add_block(scene, contacts, factors, k, m, 0, 1, place_rate)
    add_block(scene, contacts, factors, k, m, 1, 0, speed)
    add_block(scene, contacts, factors, k, m, 1, 1, speed_rate)
    force, other = contacts.normals[k], contacts.normals[m]
    pinned = is_pinned(scene, contacts.which[k], contacts.times[k])
    for unknown in range(4):
        for a in range(4):
            jacobian[row + a, column + unknown] = 0.0
        for i in range(3):  # how position and velocity at k change with it
            moved, hurried = 0.0, 0.0
            if unknown < 3:
                moved, hurried = place[i, unknown], speed[i, unknown]
            else:
                for j in range(3):
                    moved += place_rate[i, j] * other[j]
                    hurried += speed_rate[i, j] * other[j]
                if m == k:
                    moved, hurried = moved + motion[1, i], hurried + motion[2, i]
            for a in range(3):
                jacobian[row + a, column + unknown] += rows[a, i] * moved
            jacobian[row + 3, column + unknown] += force[i] * hurried
        if pinned:
            jacobian[row + 3, column + unknown] = 1.0 if m == k and unknown == 3 else 0.0


@kernel()
def fill_conditions(scene, contacts, group, size, factors, arcs, offsets, active, parts, jacobian, rhs):
    """Fill the linearised conditions (4 size equations) of the first contacts of a `group`.

    Returns the largest error, inf for a wrong solution.  The contacts' normals are forces here, their
    multipliers 1.
    """
    motion, rows, lines = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(2, 3)
    error = 0.0
    for a in range(size):
        k, first = group[a], 4 * a
        own = conditions_of(
            scene, contacts, k, arcs, offsets, active, parts, motion, rows, lines, rhs[first : first + 4]
        )
        error = max(error, own)
        for b in range(size):
            fill_block(scene, contacts, factors, k, group[b], motion, rows, jacobian, first, 4 * b)
        for i in range(3):  # and directly with its own force
            for line in range(3 - parts[k]):
                jacobian[first + parts[k] + line, first + i] += lines[line, i]
            if not is_pinned(scene, contacts.which[k], contacts.times[k]):
                jacobian[first + 3, first + i] += motion[1, i]
    return error


@kernel()
def group_contacts(scene, contacts, count, labels):
    """Fill `labels` (count,), equal for contacts that are connected by shared craft."""
    for k in range(count):
        labels[k] = k
        for m in range(k):
            if labels[m] == labels[k]:
                continue
            for side in range(2):
                body = scene.pairs[contacts.which[k], side]
                pair = scene.pairs[contacts.which[m]]
                if body < len(scene.base) and body in (pair[0], pair[1]):
                    mine, other = labels[k], labels[m]
                    for j in range(k + 1):
                        if labels[j] == mine:
                            labels[j] = other


@kernel()
def members(labels, count, label, group):
    """Fill `group` with the contacts of a label; return their number."""
    size = 0
    for k in range(count):
        if labels[k] == label:
            group[size] = k
            size += 1
    return size


@kernel()
def take_step(scene, contacts, group, size, rhs):
    """Add a step to the forces and times of a group; return False where a time leaves its window."""
    for a in range(size):
        k = group[a]
        for i in range(3):
            contacts.normals[k, i] += rhs[4 * a + i]
        contacts.times[k] += rhs[4 * a + 3]
        window = scene.windows[contacts.which[k]]
        if not window[0] <= contacts.times[k] <= window[1]:
            return False
    return True


@kernel()
def as_forces(contacts, count):
    """Write each contact's force into its normal."""
    for k in range(count):
        for i in range(3):
            contacts.normals[k, i] *= contacts.multipliers[k]
        contacts.multipliers[k] = 1.0


@kernel()
def as_normals(scene, arcs, offsets, contacts, count, active, parts):
    """Convert forces back to normals, the means of the active parts' gradients, and multipliers."""
    motion, gradients, weights = stack_matrix(3, 3), stack_matrix(2, 3), stack_vector(2)
    for k in range(count):
        which = contacts.which[k]
        relative_motion(scene, arcs, offsets, which, contacts.times[k], motion)
        for a in range(parts[k]):
            part_at(scene, scene.kinds[which], active[k, a], motion, gradients[a])
        shares(contacts.normals[k], gradients, parts[k], weights)
        contacts.multipliers[k] = weights[0] + weights[1]
        for i in range(3):
            contacts.normals[k, i] /= contacts.multipliers[k]


@kernel()
def newton(scene, contacts, count, factors, arcs, offsets):
    """Solve the conditions of optimality of active contacts; return whether the method converges.

    Connected groups are solved one by one.  `arcs` and `offsets` hold the paths under the contacts, before
    and after.
    """
    active, parts = np.empty((count, 2), dtype=np.int64), np.empty(count, dtype=np.int64)
    labels, group = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    group_contacts(scene, contacts, count, labels)
    largest = 0
    for k in range(count):
        largest = max(largest, members(labels, count, k, group))
    if largest > LARGEST:
        return False
    jacobian, rhs = np.empty((4 * largest, 4 * largest)), np.empty(4 * largest)
    choose_parts(scene, arcs, offsets, contacts, count, active, parts)
    as_forces(contacts, count)
    for _ in range(STEPS):
        fill_factors(scene, contacts, count, factors)
        deflect(scene, contacts, count, factors, arcs, offsets)
        settled = True
        for label in range(count):
            size = members(labels, count, label, group)
            error = fill_conditions(
                scene, contacts, group, size, factors, arcs, offsets, active, parts, jacobian, rhs
            )
            if error < TOUCHING:
                continue
            settled = False
            if not error < FAR:
                return False
            solve(jacobian, rhs, 4 * size)
            if not take_step(scene, contacts, group, size, rhs):
                return False
        if settled:
            as_normals(scene, arcs, offsets, contacts, count, active, parts)
            return True
    return False
