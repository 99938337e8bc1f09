"""Norm of a zone with rounded edges: the p-norm of its parts, its gradient and its curvature.

The norm of a zone is the largest of its parts (see `zones.shapes`).  Passing sides are chosen with the
p-norm, which has no edges.  Then the power becomes inf, which gives the norm itself, and a path that
passes an edge touches two parts at the instant when one becomes larger than the other.
"""

from math import inf

import numpy as np

from closeform._jit import kernel
from closeform.zones.shapes import BALL, FACES, norm, part, part_count, rank, rate

ON_EDGE = 1e-7  # relative difference of two parts on an edge
NEAR_EDGE = 1e-4  # the same at the start of Newton's method


@kernel()
def rounded_norm(shape, faces, power, x, y, z):
    """Return the norm at (x, y, z) in zone coordinates; without rounding for power inf, or a ball."""
    largest = norm(shape, faces, x, y, z)
    if power == inf or shape == BALL or largest <= 0.0:
        return largest
    total = 0.0
    for k in range(part_count(shape, faces)):
        value = part(shape, faces, k, x, y, z)[0]
        if value > 0.0:
            total += (value / largest) ** power
    return largest * total ** (1.0 / power)


@kernel()
def gradient(shape, faces, power, motion, out):
    """Fill `out` with the gradient of the norm at a relative motion (rows: position, velocity).

    On an edge, where one part falls as another rises, it is the mean of their gradients along which the
    motion has no speed.  At the centre `out` is unchanged.
    """
    x, y, z = motion[0, 0], motion[0, 1], motion[0, 2]
    s = rounded_norm(shape, faces, power, x, y, z)
    if s == 0.0 or (s < 0.0 and shape != FACES):
        return
    sharp = power == inf or shape == BALL or s < 0.0
    slowest, fastest = inf, -inf
    ax, ay, az, bx, by, bz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(part_count(shape, faces)):
        value, gx, gy, gz = part(shape, faces, k, x, y, z)
        if not sharp:
            share = (value / s) ** (power - 1.0) if value > 0.0 else 0.0
            ax, ay, az = ax + share * gx, ay + share * gy, az + share * gz
        elif value >= s - ON_EDGE * abs(s):
            speed = gx * motion[1, 0] + gy * motion[1, 1] + gz * motion[1, 2]
            if speed < slowest:
                slowest, ax, ay, az = speed, gx, gy, gz
            if speed > fastest:
                fastest, bx, by, bz = speed, gx, gy, gz
    if sharp and slowest < fastest:
        share = min(max(fastest / (fastest - slowest), 0.0), 1.0)
        ax, ay, az = bx + share * (ax - bx), by + share * (ay - by), bz + share * (az - bz)
    out[0], out[1], out[2] = ax, ay, az


@kernel()
def norm_rate(shape, faces, power, motion, work):
    """Return the rate of the norm along a relative motion; overwrite `work` (3,)."""
    if power == inf or shape == BALL:
        return rate(
            shape, faces, motion[0, 0], motion[0, 1], motion[0, 2], motion[1, 0], motion[1, 1], motion[1, 2]
        )
    gradient(shape, faces, power, motion, work)
    return work[0] * motion[1, 0] + work[1] * motion[1, 1] + work[2] * motion[1, 2]


@kernel()
def active_parts(shape, faces, power, motion, active, values, gradients):
    """Fill indices, values and gradients (2, 3) of the smooth parts at a contact; return their number.

    It is one, or on an edge two: the falling and the rising part.  Index -1 is the rounded norm.
    """
    x, y, z = motion[0, 0], motion[0, 1], motion[0, 2]
    s = rounded_norm(shape, faces, power, x, y, z)
    if power < inf and shape != BALL:
        active[0], values[0] = -1, s
        gradient(shape, faces, power, motion, gradients[0])
        return 1
    slowest, fastest = inf, -inf
    for k in range(part_count(shape, faces)):
        value, gx, gy, gz = part(shape, faces, k, x, y, z)
        if value < s - NEAR_EDGE * abs(s):
            continue
        speed = gx * motion[1, 0] + gy * motion[1, 1] + gz * motion[1, 2]
        for place in range(2):
            if (speed < slowest) if place == 0 else (speed > fastest):
                active[place], values[place] = k, value
                gradients[place, 0], gradients[place, 1], gradients[place, 2] = gx, gy, gz
        slowest, fastest = min(speed, slowest), max(speed, fastest)
    return 2 if slowest < 0.0 < fastest else 1


@kernel()
def add_bend(shape, faces, power, motion, active, weights, count, out):
    """Add to `out` (3, 3) the derivative of the weighted sum of the active parts' gradients by position."""
    x, y, z = motion[0, 0], motion[0, 1], motion[0, 2]
    s = rounded_norm(shape, faces, power, x, y, z)
    gradient_of = np.zeros(3)
    for k in range(part_count(shape, faces)):
        value, gx, gy, gz = part(shape, faces, k, x, y, z)
        weight, along = 0.0, 0.0
        if active[0] < 0 and value > 0.0:
            weight = weights[0] * (value / s) ** (power - 1.0)
            along = weight * (power - 1.0) / value
            gradient_of[0] += weight * gx
            gradient_of[1] += weight * gy
            gradient_of[2] += weight * gz
        for place in range(count):
            if active[place] == k:
                weight += weights[place]
        across = weight / value if rank(shape, k) > 1 and weight != 0.0 else 0.0
        own = (gx, gy, gz)
        for i in range(3):
            if i < rank(shape, k):
                out[i, i] += across
            for j in range(3):
                out[i, j] += (along - across) * own[i] * own[j]
    if active[0] < 0 and weights[0] != 0.0:
        for i in range(3):
            for j in range(3):
                out[i, j] -= (power - 1.0) / (s * weights[0]) * gradient_of[i] * gradient_of[j]
