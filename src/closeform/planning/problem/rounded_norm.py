"""Norm of a zone with rounded edges: the p-norm of its parts, and its gradient.

The norm of a zone is the largest of its parts (see `zones.shapes`).  Passing sides are chosen with the
p-norm, which has no edges.  Then the power becomes inf, which gives the norm itself, and a path that
passes an edge touches two parts at the instant when one becomes larger than the other.
"""

from math import inf

from closeform._jit import kernel
from closeform.zones.shapes import BALL, FACES, norm, part, part_count, rate

ON_EDGE = 1e-7  # relative difference of two parts on an edge


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

    On an edge, where one part decreases and another increases, it is the weighted mean of their gradients for
    which the norm is stationary along the motion.  At the centre `out` is unchanged.
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
