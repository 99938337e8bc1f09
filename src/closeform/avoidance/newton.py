"""Newton's method on the conditions of optimality of a path's contacts.

Unknown for each contact: its point p in zone coordinates, its force and its time.  Conditions:
p lies on the path, the norm of p is the aimed one, and the path has no speed along the normal.
"""

from math import sqrt

import numpy as np

from closeform.arc import END, START
from closeform.avoidance.kernel import influences, relative, shape
from closeform.compiled import kernel
from closeform.linear import solve
from closeform.march import norm

ROUNDS = 12
TOUCHING, STEADY = 1e-11, 1e-8  # errors left in the norm, and in its rate times the duration


@kernel()
def outward(box, x, y, z, normal):
    """Unit normal of the zone scaled to pass through a point; a box keeps to one face."""
    s = norm(box, x, y, z)
    if s == 0.0:
        return
    if box:
        face = 0 if abs(x) == s else (1 if abs(y) == s else 2)
        side = x if face == 0 else (y if face == 1 else z)
        normal[:] = 0.0
        normal[face] = 1.0 if side > 0.0 else -1.0
    else:
        normal[0], normal[1], normal[2] = x / s, y / s, z / s


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
def bend(normals, k, i, j, size):
    """How the unit normal at a point of an ellipsoid turns with the point."""
    return ((1.0 if i == j else 0.0) - normals[k, i] * normals[k, j]) / size


@kernel()
def own_terms(jacobian, rhs, k, normals, points, motion, aim, curved, duration):
    """Residuals of contact k and what depends on it alone; returns the greatest residual."""
    row = 5 * k
    size = sqrt(points[k, 0] ** 2 + points[k, 1] ** 2 + points[k, 2] ** 2)
    reach, speed, push, error = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        rhs[row + i] = motion[0, i] - points[k, i]
        jacobian[row + i, row + i] += 1.0
        jacobian[row + i, row + 4] -= motion[1, i]
        jacobian[row + 3, row + i] += normals[k, i]
        if curved:
            for a in range(3):
                jacobian[row + 4, row + a] += bend(normals, k, a, i, size) * motion[1, i]
        reach += normals[k, i] * points[k, i]
        speed += normals[k, i] * motion[1, i]
        push += normals[k, i] * motion[2, i]
        error = max(error, abs(rhs[row + i]))
    rhs[row + 3] = aim - reach
    rhs[row + 4] = -speed
    jacobian[row + 4, row + 4] += push
    return max(error, abs(rhs[row + 3]), abs(speed) * duration * (TOUCHING / STEADY))


@kernel()
def cross_terms(jacobian, k, m, normals, points, force, left, right, block, rates, curved):
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
    size = sqrt(points[m, 0] ** 2 + points[m, 1] ** 2 + points[m, 2] ** 2)
    for i in range(3):
        for j in range(3):
            jacobian[row + i, column + 3] -= place[i, j] * normals[m, j]
            jacobian[row + i, column + 4] -= place_rate[i, j] * normals[m, j] * force[m]
            jacobian[row + 4, column + 3] += normals[k, i] * speed[i, j] * normals[m, j]
            jacobian[row + 4, column + 4] += normals[k, i] * speed_rate[i, j] * normals[m, j] * force[m]
            if curved:
                for a in range(3):
                    turn = bend(normals, m, a, j, size) * force[m]
                    jacobian[row + i, column + a] -= place[i, j] * turn
                    jacobian[row + 4, column + a] += normals[k, i] * speed[i, j] * turn


@kernel()
def newton(base, inverse, scene, aim, contacts, rows, pulls, blocks, rates):
    """Polish contacts, all of them pressed: whether they come to meet the conditions of optimality."""
    obstacles, offsets, matrices, boxes = scene
    which, times, normals, force = contacts
    count = len(which)
    size = 5 * count
    jacobian = np.empty((size, size))
    rhs = np.empty(size)
    points, pushes, motion = np.empty((count, 3)), np.empty((count, 3)), np.empty((3, 3))
    for trial in range(ROUNDS):
        influences(base, inverse, times, count, pulls, blocks, rates)
        push_back(contacts, matrices, pushes)
        arcs = shape(base, pulls, times, pushes, count, rows)
        jacobian[:] = 0.0
        error = 0.0
        for k in range(count):
            o = which[k]
            relative(rows, arcs, obstacles, offsets[o], offsets[o + 1], matrices[o], times[k], motion)
            if trial == 0:
                s = 0.0
                for i in range(3):
                    s += normals[k, i] * motion[0, i]
                for i in range(3):
                    points[k, i] = motion[0, i] if boxes[o] else normals[k, i] * s
            duration = base[END] - base[START]
            own = own_terms(jacobian, rhs, k, normals, points, motion, aim, not boxes[o], duration)
            error = max(error, own)
            for m in range(count):
                p = which[m]
                cross_terms(
                    jacobian,
                    k,
                    m,
                    normals,
                    points,
                    force,
                    matrices[o],
                    matrices[p],
                    blocks[k, m],
                    rates[k, m],
                    not boxes[p],
                )
        if error < TOUCHING:
            return True
        if not error < 10.0:
            return False
        solve(jacobian, rhs, size)
        for k in range(count):
            for i in range(3):
                points[k, i] += rhs[5 * k + i]
            force[k] += rhs[5 * k + 3]
            times[k] += rhs[5 * k + 4]
            if not (base[START] < times[k] < base[END] and force[k] > 0.0):
                return False
            if not boxes[which[k]]:
                outward(False, points[k, 0], points[k, 1], points[k, 2], normals[k])
    return False
