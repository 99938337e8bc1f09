"""Certified march to the first lock of two craft, in closed form.

For i in A and j in B, with q the vector from i's sensor to j's, both see each other when

    g(t) = |q| cos(half-angle) - b.(r + v t) + 2 offset <= 0                    # theory (13)

and, with a range, |q| <= range.  Along a leg b = steady + cosine cos(a) + sine sin(a), so that
all dot products are linear in time. |q| cos(half-angle) is convex except for the turning offset. The
curvature of b.(r + v t) is at most w^2 times its rotating part plus 2 w times that of the velocity. The
march steps as far as g certainly stays positive: it never steps over a lock, however short.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from math import inf, nan, sqrt
from typing import Any, NamedTuple

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import LARGEST, Floats
from closeform.search.sine_cosine import sine_cosine

START, END, RATE, STEADY, COSINE, SINE = 0, 1, 2, 3, 6, 9  # columns of a table of legs
SEEN = 1e-12  # of the distance: a smaller positive g counts as a lock
CLOSE = 1e-8  # s, accuracy of a lock time found by Newton's method
TINY = 1e-300  # prevents 0 / 0
NOT_FINITE, COINCIDENT, NEVER = -3, -2, -1
CHUNK = 65_536
BLOCK, SWEEPS = 128, 8  # pairs that step in parallel, and the number of steps


class LockSensor(NamedTuple):
    """Sensor data for locks: both offsets together [m], cosine of the half-angle, range [m]."""

    baseline: float
    cosine: float
    longest: float


@kernel(inline=True)
def before(gap, slope, bend):
    """Return the first h > 0 with gap + slope h - bend h^2 / 2 = 0, without cancellation or branches."""
    root = sqrt(slope * slope + 2.0 * bend * gap)
    over = 2.0 * gap if slope <= 0.0 else slope + root
    under = root - slope if slope <= 0.0 else bend
    return over / (under + TINY)


@kernel(inline=True)
def limits(turn, position, velocity, sensor):
    """Return bounds on g'' during a leg: its rotating part at the end, that of the velocity, and |q'|."""
    x, y, z = position
    vx, vy, vz = velocity
    start, end, w, fx, fy, fz, cx, cy, cz, sx, sy, sz = turn
    ex, ey, ez = x + vx * end, y + vy * end, z + vz * end
    last = (cx * ex + cy * ey + cz * ez) ** 2 + (sx * ex + sy * ey + sz * ez) ** 2
    sideways = sqrt((cx * vx + cy * vy + cz * vz) ** 2 + (sx * vx + sy * vy + sz * vz) ** 2)
    fast = sqrt(vx * vx + vy * vy + vz * vz) + sensor.baseline * abs(w)
    return last, 2.0 * abs(w) * sideways, fast


@kernel(inline=True)
def sight(boresight, place, sensor):
    """Return the vector between two sensors, its length, g, the excess over the range, and a tolerance.

    `boresight` is that of A, `place` the position of B relative to A.  # theory (13)

    The length is computed from components, so that passes within a micrometre keep their digits.
    """
    bx, by, bz = boresight
    px, py, pz = place
    baseline, c, longest = sensor
    qx, qy, qz = px - baseline * bx, py - baseline * by, pz - baseline * bz
    q = sqrt(qx * qx + qy * qy + qz * qz)
    gap, beyond = c * q - (bx * qx + by * qy + bz * qz), q - longest
    return (qx, qy, qz), q, gap, beyond, SEEN * (q + 2.0 * baseline)


@kernel(inline=True)
def step(turn, t, position, velocity, bounds, sensor):
    """Return a duration without a lock from t on, whether both see each other at t, and if a lock is near.

    `turn` is the leg's row, `position` that at time 0, `bounds` the leg's `limits`. If a lock is near, it
    follows at the end of the step.
    """
    x, y, z = position
    vx, vy, vz = velocity
    last, sideways, fast = bounds
    baseline, c = sensor.baseline, sensor.cosine
    start, end, w, fx, fy, fz, cx, cy, cz, sx, sy, sz = turn
    sa, ca = sine_cosine(w * (t - start))
    bx, by, bz = fx + cx * ca + sx * sa, fy + cy * ca + sy * sa, fz + cz * ca + sz * sa
    dx, dy, dz = w * (sx * ca - cx * sa), w * (sy * ca - cy * sa), w * (sz * ca - cz * sa)
    px, py, pz = x + vx * t, y + vy * t, z + vz * t
    (qx, qy, qz), q, gap, beyond, scale = sight((bx, by, bz), (px, py, pz), sensor)
    ux, uy, uz = vx - baseline * dx, vy - baseline * dy, vz - baseline * dz
    growth = (qx * ux + qy * uy + qz * uz) / (q + TINY)
    slope = c * growth - (bx * vx + by * vy + bz * vz + dx * px + dy * py + dz * pz)
    # curvature of b.(r + v t): the rotating part, largest at one end of the leg, and the velocity's
    now = (cx * px + cy * py + cz * pz) ** 2 + (sx * px + sy * py + sz * pz) ** 2
    turning = baseline * w * w  # acceleration of the sensors' offset, at most
    # c |q| is convex except for that; if c < 0 it is concave, and the curvature of |q| is
    # (its speed)^2 / |q|, at most twice that before |q| is halved
    curved = 2.0 * fast * fast / (q + TINY) + turning
    concave = max(0.0, -c)
    bend = w * w * sqrt(max(now, last)) + sideways + max(c, 0.0) * turning
    bend += concave * curved if concave > 0.0 else 0.0
    longer = q / (2.0 * fast + TINY) if concave > 0.0 else inf
    unseen = min(before(max(gap, 0.0), slope, bend), longer) if gap > scale else 0.0
    unreached = before(max(beyond, 0.0), growth, turning) if beyond > scale else 0.0
    h = max(unseen, unreached)
    # Newton's method is so near that the remainder d = 3 most h^2 / -slope is below CLOSE. A crossing
    # is certain: g(h + d) <= 1.5 most h^2 + most d^2 + slope d < 0 for d <= 1.2 h, if the bounds
    # hold until 2.2 h
    most, move = bend + abs(c) * curved, 2.2 * fast * h
    near = (most * h < -0.4 * slope) & (3.0 * most * h * h < -CLOSE * slope)
    near = near & (q > 2.0 * move) & (beyond + move <= 0.0)
    return h, (gap <= scale) & (beyond <= scale), near


@kernel(inline=True)
def as_turn(leg):
    """Return the row of a leg as a tuple."""
    return leg[0], leg[1], leg[2], leg[3], leg[4], leg[5], leg[6], leg[7], leg[8], leg[9], leg[10], leg[11]


@kernel()
def lock_in_leg(leg, t, position, velocity, sensor):
    """Return the first lock within a leg from time t on: (time, found).

    `position` is that at time 0.
    """
    turn = as_turn(leg)
    end = leg[END]
    bounds = limits(turn, position, velocity, sensor)
    while True:
        h, locked, near = step(turn, t, position, velocity, bounds, sensor)
        if locked:
            return t, True
        if t >= end:
            return end, False
        if near:
            return min(t + h, end), t + h <= end
        t = min(end, max(t + h, t * (1.0 + 2.3e-16)))


@kernel()
def first_lock(legs, t, position, velocity, sensor):
    """Return the first lock from time t on: (time, leg), or (inf, NEVER)."""
    for k in range(len(legs)):
        if t <= legs[k, END]:
            when, locked = lock_in_leg(legs[k], max(t, legs[k, START]), position, velocity, sensor)
            if locked:
                return when, k
    return inf, NEVER


# inlined where the arrays are allocated, so that the compiler knows that they do not overlap
@kernel(inline=True)
def ahead(leg, positions, velocities, begin, count, sensor, parts, reached, sure):
    """Advance a block of pairs through a leg in parallel: times reached, and if a lock is certain there."""
    x, y, z, vx, vy, vz, last, sideways, fast = parts
    turn = as_turn(leg)
    end = leg[END]
    for k in range(count):
        m = begin + k
        x[k], y[k], z[k] = positions[m, 0], positions[m, 1], positions[m, 2]
        vx[k], vy[k], vz[k] = velocities[m, 0], velocities[m, 1], velocities[m, 2]
        reached[k] = leg[START]
    for k in range(count):
        position = x[k], y[k], z[k]
        velocity = vx[k], vy[k], vz[k]
        last[k], sideways[k], fast[k] = limits(turn, position, velocity, sensor)
    for _ in range(SWEEPS):
        for k in range(count):
            t = reached[k]
            position = x[k], y[k], z[k]
            velocity = vx[k], vy[k], vz[k]
            bounds = last[k], sideways[k], fast[k]
            h, locked, near = step(turn, t, position, velocity, bounds, sensor)
            reached[k] = min(end, t + h)
            sure[k] = 1.0 if (locked | near) & (t + h < end) else 0.0


@kernel(
    void(
        float64[:, ::1],
        float64[:, ::1],
        float64[:, ::1],
        float64,
        float64,
        float64,
        float64[::1],
        int64[::1],
    )
)
def first_locks(
    legs: Floats,
    positions: Floats,
    velocities: Floats,
    baseline: float,
    cosine: float,
    longest: float,
    times: Floats,
    found: Any,
) -> None:
    """Write the first lock of each pair to `times` and `found`; `found` holds a code for an invalid pair."""
    sensor = LockSensor(baseline, cosine, longest)
    reached, sure, parts = np.empty(BLOCK), np.empty(BLOCK), np.empty((9, BLOCK))
    for begin in range(0, len(positions), BLOCK):
        count = min(BLOCK, len(positions) - begin)
        ahead(legs[0], positions, velocities, begin, count, sensor, parts, reached, sure)
        for k in range(count):
            m = begin + k
            x, y, z = positions[m, 0], positions[m, 1], positions[m, 2]
            vx, vy, vz = velocities[m, 0], velocities[m, 1], velocities[m, 2]
            size = abs(x) + abs(y) + abs(z)
            times[m] = nan
            if not size + abs(vx) + abs(vy) + abs(vz) < LARGEST:
                found[m] = NOT_FINITE
            elif size < 1.0 / LARGEST:
                found[m] = COINCIDENT
            elif sure[k] > 0.0:
                times[m], found[m] = reached[k], 0
            else:
                when, leg = first_lock(legs, reached[k], (x, y, z), (vx, vy, vz), sensor)
                found[m] = leg
                if leg >= 0:
                    times[m] = when


def in_parts(part: Callable[[slice], Any], count: int, size: int) -> list[Any]:
    """Return the results of `part` for slices of `size` among `count` items, on all cores if many."""
    parts = [slice(first, first + size) for first in range(0, count, size)]
    if len(parts) <= 1:
        return [part(some) for some in parts]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(part, parts))
