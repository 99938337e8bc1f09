"""Newton's method on the conditions of optimality of a path's contacts.

Unknown for each contact: its point p in zone coordinates, its force and its time.  Conditions:
p lies on the path, the norm of p is the aimed one, and the path has no speed along the normal.
"""

from math import inf, sqrt

import numpy as np
from numba import float64, int64, types

from closeform.compiled import kernel
from closeform.motion.arc import END, START
from closeform.motion.linear import solve
from closeform.planning.kernel import influences, relative, shape
from closeform.zones.shapes import CUBE, rate

ROUNDS = 12
SMALL = 80  # contacts of which the dense equations are solved
ON_EDGE = 1e-7  # how nearly two faces are met at once
TOUCHING, STEADY = 1e-11, 1e-8  # errors left in the norm, and in its rate times the duration


@kernel()
def p_norm(power, x, y, z):
    """The norm of a zone: power 2 for an ellipsoid, inf for a box, between for a rounded box."""
    if power == 2.0:
        return sqrt(x * x + y * y + z * z)
    largest = max(abs(x), abs(y), abs(z))
    if power == inf or largest == 0.0:
        return largest
    total = (abs(x) / largest) ** power + (abs(y) / largest) ** power + (abs(z) / largest) ** power
    return largest * total ** (1.0 / power)


@kernel()
def outward(power, motion, normal):
    """Gradient of the zone's norm at a relative motion (position, velocity rows).

    A box is touched on a face; or on an edge, where the path leaves one face's side as it
    reaches the other's: there the two faces are mixed such that the motion has no speed along
    the normal.
    """
    s = p_norm(power, motion[0, 0], motion[0, 1], motion[0, 2])
    if s == 0.0:
        return
    if power < inf:
        for i in range(3):
            slope = (abs(motion[0, i]) / s) ** (power - 1.0)
            normal[i] = slope if motion[0, i] > 0.0 else -slope
        return
    first, second = -1, -1
    for i in range(3):
        if abs(motion[0, i]) >= s * (1.0 - ON_EDGE):
            if first < 0 or abs(motion[0, i]) > abs(motion[0, first]):
                first, second = i, first
            elif second < 0 or abs(motion[0, i]) > abs(motion[0, second]):
                second = i
    for i in range(3):
        normal[i] = 0.0
    side = 1.0 if motion[0, first] > 0.0 else -1.0
    normal[first] = side
    if second >= 0:
        other = 1.0 if motion[0, second] > 0.0 else -1.0
        leaving, reaching = side * motion[1, first], other * motion[1, second]
        if leaving * reaching < 0.0:
            total = abs(leaving) + abs(reaching)
            normal[first] = side * abs(reaching) / total
            normal[second] = other * abs(leaving) / total


@kernel()
def approach_rate(power, motion, normal):
    """Rate of the zone's norm along a relative motion; spoils `normal`."""
    if power == inf:
        x, y, z = motion[0, 0], motion[0, 1], motion[0, 2]
        return rate(CUBE, motion, x, y, z, motion[1, 0], motion[1, 1], motion[1, 2])
    outward(power, motion, normal)
    return normal[0] * motion[1, 0] + normal[1] * motion[1, 1] + normal[2] * motion[1, 2]


@kernel()
def on_edge(normals, k):
    """Whether a box's normal mixes faces."""
    return max(abs(normals[k, 0]), abs(normals[k, 1]), abs(normals[k, 2])) < 1.0


@kernel()
def in_zone(block, left, right, first_row, out):
    """A block's position (first_row 0) or velocity (3) part between two zones' coordinates."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for a in range(3):
                for b in range(3):
                    total += left[i, a] * block[first_row + a, b] * right[j, b]
            out[i, j] = total


@kernel()
def push_back(contacts, matrices, pushes):
    """Forces of the contacts in metres: jumps of the thrust's rate (count, 3)."""
    which, _, normals, force = contacts
    for k in range(len(which)):
        for i in range(3):
            pushes[k, i] = 0.0
            for j in range(3):
                pushes[k, i] += matrices[which[k], j, i] * normals[k, j] * force[k]


@kernel()
def bend(power, points, normals, k, out):
    """Fill `out` (3, 3): how the gradient of the norm at point k turns with the point."""
    for i in range(3):
        for j in range(3):
            out[i, j] = 0.0  # and stays so on a box's face
    if power == inf:
        return
    s = p_norm(power, points[k, 0], points[k, 1], points[k, 2])
    for i in range(3):
        out[i, i] = (power - 1.0) / s * (abs(points[k, i]) / s) ** (power - 2.0)
        for j in range(3):
            out[i, j] -= (power - 1.0) / s * normals[k, i] * normals[k, j]


@kernel()
def closing(normals, bends, motion, k):
    """Second derivative of the norm in time at contact k."""
    total = 0.0
    for i in range(3):
        total += normals[k, i] * motion[2, i]
        for j in range(3):
            total += motion[1, i] * bends[k, i, j] * motion[1, j]
    return total


@kernel()
def own_terms(jacobian, rhs, k, normals, points, bends, motion, aim, duration):
    """Residuals of contact k and what depends on it alone; returns the greatest residual."""
    row = 5 * k
    reach, speed, push, error = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        rhs[row + i] = motion[0, i] - points[k, i]
        jacobian[row + i, row + i] += 1.0
        jacobian[row + i, row + 4] -= motion[1, i]
        jacobian[row + 3, row + i] += normals[k, i]
        for a in range(3):
            jacobian[row + 4, row + a] += bends[k, a, i] * motion[1, i]
        reach += normals[k, i] * points[k, i]
        speed += normals[k, i] * motion[1, i]
        push += normals[k, i] * motion[2, i]
        error = max(error, abs(rhs[row + i]))
    rhs[row + 3] = aim - reach
    rhs[row + 4] = -speed
    jacobian[row + 4, row + 4] += push
    return max(error, abs(rhs[row + 3]), abs(speed) * duration * (TOUCHING / STEADY))


@kernel()
def cross_terms(jacobian, k, m, normals, bends, force, left, right, block, rates):
    """How the residuals of contact k change with contact m's point, force and time."""
    row, column = 5 * k, 5 * m
    place, speed, place_rate, speed_rate = (
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((3, 3)),
    )
    in_zone(block, left, right, 0, place)
    in_zone(block, left, right, 3, speed)
    in_zone(rates, left, right, 0, place_rate)
    in_zone(rates, left, right, 3, speed_rate)
    for i in range(3):
        for j in range(3):
            jacobian[row + i, column + 3] -= place[i, j] * normals[m, j]
            jacobian[row + i, column + 4] -= place_rate[i, j] * normals[m, j] * force[m]
            jacobian[row + 4, column + 3] += normals[k, i] * speed[i, j] * normals[m, j]
            jacobian[row + 4, column + 4] += normals[k, i] * speed_rate[i, j] * normals[m, j] * force[m]
            for a in range(3):
                turn = bends[m, a, j] * force[m]
                jacobian[row + i, column + a] -= place[i, j] * turn
                jacobian[row + 4, column + a] += normals[k, i] * speed[i, j] * turn


@kernel()
def newton(base, inverse, scene, contacts, windows, rows, pulls, blocks, rates):
    """Polish contacts, all of them pressed: whether they come to meet the conditions of optimality."""
    obstacles, offsets, matrices, norm_powers, aims = scene
    which, times, normals, force = contacts
    count = len(which)
    size = 5 * count
    jacobian = np.empty((size, size))
    rhs = np.empty(size)
    points, pushes = np.empty((count, 3)), np.empty((count, 3))
    motions, bends = np.empty((count, 3, 3)), np.empty((count, 3, 3))
    pinned = np.empty(count, dtype=np.bool_)  # at an end of the time that an obstacle is there
    for k in range(count):
        if norm_powers[which[k]] == inf and on_edge(normals, k):
            return False
        pinned[k] = times[k] <= windows[k, 0] or times[k] >= windows[k, 1]
    for trial in range(ROUNDS):
        influences(base, inverse, times, count, pulls, blocks, rates)
        push_back(contacts, matrices, pushes)
        arcs = shape(base, pulls, times, pushes, count, rows)
        jacobian[:] = 0.0
        error = 0.0
        for k in range(count):
            o = which[k]
            motion = motions[k]
            relative(rows, arcs, obstacles, offsets[o], offsets[o + 1], matrices[o], times[k], motion)
            if trial == 0:
                s = p_norm(norm_powers[o], motion[0, 0], motion[0, 1], motion[0, 2])
                for i in range(3):
                    points[k, i] = motion[0, i] * (aims[o] / s)
            bend(norm_powers[o], points, normals, k, bends[k])
        for k in range(count):
            o = which[k]
            duration = 0.0 if pinned[k] else base[END] - base[START]
            own = own_terms(jacobian, rhs, k, normals, points, bends, motions[k], aims[o], duration)
            error = max(error, own)
            for m in range(count):
                left, right = matrices[o], matrices[which[m]]
                cross_terms(jacobian, k, m, normals, bends, force, left, right, blocks[k, m], rates[k, m])
            if pinned[k]:  # the time is given, whatever the speed along the normal
                for column in range(size):
                    jacobian[5 * k + 4, column] = 1.0 if column == 5 * k + 4 else 0.0
                rhs[5 * k + 4] = 0.0
        if error < TOUCHING:
            for k in range(count):  # closest, not farthest, in time
                if not pinned[k] and closing(normals, bends, motions[k], k) < 0.0:
                    return False
            return True
        if not error < 10.0:
            return False
        solve(jacobian, rhs, size)
        for k in range(count):
            for i in range(3):
                points[k, i] += rhs[5 * k + i]
            force[k] += rhs[5 * k + 3]
            times[k] += rhs[5 * k + 4]
            if not (windows[k, 0] <= times[k] <= windows[k, 1] and force[k] > 0.0):
                return False
            if norm_powers[which[k]] < inf:
                for i in range(3):
                    motions[k, 0, i] = points[k, i]
                outward(norm_powers[which[k]], motions[k], normals[k])
    return False


@kernel(
    float64(
        int64[:, ::1],
        float64[:, :, ::1],
        float64[:, :, ::1],
        float64[:, :, ::1],
        types.UniTuple(float64[::1], 3),
        types.UniTuple(float64[:, ::1], 2),
        float64[:, :, ::1],
        float64[::1],
        float64[:, ::1],
        float64[::1],
    )
)
def conditions(links, blocks, rates, matrices, numbers, vectors, motions, durations, jacobian, rhs):
    """Conditions of optimality of many contacts and their derivatives; returns the greatest error.

    `numbers`: the contacts' powers, aims and forces; `vectors`: their normals and points; a duration of
    0 says that a contact's time is given.  Fills `jacobian` (5K, 5K) and `rhs` (5K,); up to SMALL contacts
    solves them too, which leaves the step in `rhs`.  -1 where a contact is the farthest, not the
    closest, in time.
    """
    powers, aims, force = numbers
    normals, points = vectors
    count = len(force)
    bends = np.empty((count, 3, 3))
    error, farthest = 0.0, False
    for k in range(count):
        bend(powers[k], points, normals, k, bends[k])
        own = own_terms(jacobian, rhs, k, normals, points, bends, motions[k], aims[k], durations[k])
        error = max(error, own)
        if durations[k] > 0.0 and closing(normals, bends, motions[k], k) < 0.0:
            farthest = True
    for link in range(len(links)):
        k, m = links[link]
        left, right = matrices[k], matrices[m]
        cross_terms(jacobian, k, m, normals, bends, force, left, right, blocks[link], rates[link])
    for k in range(count):
        if durations[k] == 0.0:  # the time is given, whatever the speed along the normal
            for column in range(5 * count):
                jacobian[5 * k + 4, column] = 1.0 if column == 5 * k + 4 else 0.0
            rhs[5 * k + 4] = 0.0
    if error < TOUCHING:
        return -1.0 if farthest else error
    if count <= SMALL:
        solve(jacobian, rhs, 5 * count)
    return error
