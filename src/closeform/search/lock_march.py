"""Certified march to the first lock of two craft, in closed form.

In a segment of a turn a boresight is steady + cosine cos(a) + sine sin(a), with an angle a that is quadratic
in time. So the gaps of `field_of_view` have bounded curvature: that of b.(r + v t) is at most w^2 times its
rotating part plus 2 w times that of the velocity, and |q| is convex except for the turning offsets. The march
steps as far as one gap certainly stays positive: it never steps over a lock, however short.

Solar pressure accelerates both craft along the sun line. Its difference bends the line of a pair into a
parabola, whose distance from its chord is bounded.

Pairs without search errors are facing: one gap decides, and the legs of the search are the segments. All
other pairs march through the segments of both slew profiles. `first_locks` advances many facing pairs through
the first leg in parallel, with vector instructions, which is ten times as fast as one after another.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from math import ceil, factorial, floor, inf, nan, pi, sqrt
from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import LARGEST, Floats
from closeform.kernel_loans import stack_matrix
from closeform.search.field_of_view import Sensors, outage, view
from closeform.search.schedule import END, START
from closeform.search.search_errors import COSINE, EXACT, RANGE, SOLAR
from closeform.search.slew_profile import FINISH, LEG, first_segment, next_segment, nominal_segment

CLOSE = 1e-8  # s, accuracy of a lock time found by Newton's method
TINY = 1e-300  # prevents 0 / 0
NOT_FINITE, COINCIDENT, NEVER = -3, -2, -1  # instead of the leg of a lock
CHUNK = 65_536
BLOCK, SWEEPS = 128, 8  # pairs that step in parallel, and the number of steps

# coefficients of the series of sine and cosine
S1, S2, S3, S4, S5, S6, S7 = ((-1) ** k / factorial(2 * k + 1) for k in range(1, 8))
C1, C2, C3, C4, C5, C6, C7, C8 = ((-1) ** k / factorial(2 * k) for k in range(1, 9))
QUARTER = 1.57079632673412561417  # pi / 2 to 33 bits, and its remainder
REST = 6.07710050650619224932e-11


@kernel(inline=True)
def sine_cosine(angle):
    """Return sine and cosine to 2e-16 of an angle up to a few turns, from series about a quarter turn.

    Without branches, as `march_block` requires for many pairs in parallel.
    """
    turns = floor(angle * (2.0 / pi) + 0.5)
    x = (angle - turns * QUARTER) - turns * REST
    z = x * x
    zz = z * z
    s = ((1.0 + S1 * z) + (S2 + S3 * z) * zz) + ((S4 + S5 * z) + (S6 + S7 * z) * zz) * (zz * zz)
    c = ((C4 + C5 * z) + (C6 + C7 * z) * zz + C8 * (zz * zz)) * (zz * zz)
    c += (1.0 + C1 * z) + (C2 + C3 * z) * zz
    s *= x
    half = floor(turns * 0.5)
    odd, sign = turns - 2.0 * half, 1.0 - 2.0 * (half - 2.0 * floor(half * 0.5))
    return sign * (s * (1.0 - odd) + c * odd), sign * (c * (1.0 - odd) - s * odd)


@kernel(inline=True)
def before(gap, slope, bend):
    """Return the first h > 0 with gap + slope h - bend h^2 / 2 = 0, without cancellation or branches."""
    root = sqrt(slope * slope + 2.0 * bend * gap)
    over = 2.0 * gap if slope <= 0.0 else slope + root
    under = root - slope if slope <= 0.0 else bend
    return over / (under + TINY)


@kernel(inline=True)
def rotated(segment, steady, t, place):
    """Return the boresight at time t, its rate, and the squared part of b.place that rotates with it.

    `steady`: whether the segment has a constant rate and begins at the angle 0.
    """
    px, py, pz = place
    begin, _, phase, rate, bend, fx, fy, fz, cx, cy, cz, sx, sy, sz = segment
    s = t - begin
    angle, w = (rate * s, rate) if steady else (phase + (rate + 0.5 * bend * s) * s, rate + bend * s)
    sa, ca = sine_cosine(angle)
    boresight = fx + cx * ca + sx * sa, fy + cy * ca + sy * sa, fz + cz * ca + sz * sa
    speed = w * (sx * ca - cx * sa), w * (sy * ca - cy * sa), w * (sz * ca - cz * sa)
    part = (cx * px + cy * py + cz * pz) ** 2 + (sx * px + sy * py + sz * pz) ** 2
    return boresight, speed, part


@kernel(inline=True)
def bounds_of(segment, t, end, position, velocity):
    """Return bounds on the motion of a boresight b from t to `end`.

    The curvature of the rotating part of b.(r + v t), the square of that part at `end`, the other curvature
    of b.(r + v t), and the largest |b'| and |b''|.
    """
    x, y, z = position
    vx, vy, vz = velocity
    begin, _, _, rate, bend, _, _, _, cx, cy, cz, sx, sy, sz = segment
    fastest = max(abs(rate + bend * (t - begin)), abs(rate + bend * (end - begin)))
    curl = sqrt(fastest * fastest * fastest * fastest + bend * bend)
    px, py, pz = x + vx * end, y + vy * end, z + vz * end
    last = (cx * px + cy * py + cz * pz) ** 2 + (sx * px + sy * py + sz * pz) ** 2
    sideways = sqrt((cx * vx + cy * vy + cz * vz) ** 2 + (sx * vx + sy * vy + sz * vz) ** 2)
    radius = sqrt(cx * cx + cy * cy + cz * cz)
    return curl, last, 2.0 * fastest * sideways, radius * fastest, radius * curl


@kernel(inline=True)
def bounds_of_pair(a, b, facing, t, end, position, velocity, push, offset):
    """Return bounds on the motion of both boresights from t to `end`.

    The largest |q'| and acceleration of q, a curvature of both gaps, and the first three bounds of each. The
    curvature is that of offset b.d, and of the effect of the relative acceleration `push` along z.
    """
    vx, vy, vz = velocity
    if not facing:
        position = position[0], position[1], position[2] + 0.5 * push * end * end
    curl, last, sideways, fastest, turning = bounds_of(a, t, end, position, velocity)
    if facing:  # b.d is constant
        other_curl, other_last, other_sideways, between = curl, last, sideways, 0.0
        fastest, turning = 2.0 * fastest, 2.0 * turning
    else:
        other_curl, other_last, other_sideways, fast, turn = bounds_of(b, t, end, position, velocity)
        between = 2.0 * offset * fastest * fast
        # b.(r + v t + a t^2 / 2): of b'' the distance from the chord, of b' the change of velocity, and a
        size, span = abs(push), end - t
        between += size * (0.125 * span * span * max(curl, other_curl) + 2.0 * end * max(fastest, fast) + 1.0)
        fastest, turning = fastest + fast, turning + turn
    speed = sqrt(vx * vx + vy * vy + vz * vz) + offset * fastest
    turning *= offset
    if not facing:
        speed, turning = speed + size * end, turning + size
    ours, others = (curl, last, sideways), (other_curl, other_last, other_sideways)
    return speed, turning, between, ours, others


@kernel(inline=True)
def unseen(gap, slope, bend, tolerance, longer):
    """Return a time for which a gap certainly stays positive."""
    return min(before(max(gap, 0.0), slope, bend), longer) if gap > tolerance else 0.0


@kernel(inline=True)
def bend_of(bounds, rotating, cosine, turning, curved):
    """Return a bound on the curvature of a gap, from the square of the rotating part of b.(r + v t) now.

    c |q| is convex except for the turning; if c < 0 it is concave.
    """
    curl, last, sideways = bounds
    bend = curl * sqrt(max(rotating, last)) + sideways + max(cosine, 0.0) * turning
    return bend + (-cosine * curved if cosine < 0.0 else 0.0)


@kernel(inline=True)
def step(a, b, facing, t, position, velocity, push, bounds, sensors):
    """Return a time without a lock from t on, whether they see each other at t, and if a lock is near.

    `a` and `b` are the segments of both boresights, `position` and `velocity` are those at time 0. Of a
    `facing` pair `b` and `push` are ignored. If a lock is near, it follows at the end of the step.
    """
    x, y, z = position
    vx, vy, vz = velocity
    if not facing:
        z, vz = z - 0.5 * push * t * t, vz + push * t  # z + vz t is then the position at t
    fast, turning, between, ours, others = bounds
    offset, c, e, _ = sensors
    place = x + vx * t, y + vy * t, z + vz * t
    boresight, turn, rotating = rotated(a, facing, t, place)
    bx, by, bz = boresight
    fx, fy, fz = turn
    if facing:
        other, other_turn, other_rotating = (-bx, -by, -bz), (-fx, -fy, -fz), rotating
    else:
        other, other_turn, other_rotating = rotated(b, False, t, place)
    gx, gy, gz = other_turn
    (qx, qy, qz), q, gap, other_gap, beyond, tolerance = view(boresight, other, place, sensors)
    ux, uy, uz = vx + offset * (gx - fx), vy + offset * (gy - fy), vz + offset * (gz - fz)
    growth = (qx * ux + qy * uy + qz * uz) / (q + TINY)
    slope = c * growth - (bx * ux + by * uy + bz * uz + fx * qx + fy * qy + fz * qz)
    # the curvature of |q| is (its speed)^2 / |q|, at most twice that before |q| is halved
    curved = 2.0 * fast * fast / (q + TINY) + turning
    longer = q / (2.0 * fast + TINY) if min(c, e) < 0.0 else inf
    bend = bend_of(ours, rotating, c, turning, curved) + between
    h = unseen(gap, slope, bend, tolerance, longer)
    if not facing:
        dx, dy, dz = other
        other_slope = e * growth + (dx * ux + dy * uy + dz * uz + gx * qx + gy * qy + gz * qz)
        other_bend = bend_of(others, other_rotating, e, turning, curved) + between
        h = max(h, unseen(other_gap, other_slope, other_bend, tolerance, longer))
        gap = max(gap, other_gap)
    h = max(h, unseen(beyond, growth, turning, tolerance, inf))
    # Newton's method is so near that the remainder d = 3 most h^2 / -slope is below CLOSE. A crossing
    # is certain: g(h + d) <= 1.5 most h^2 + most d^2 + slope d < 0 for d <= 1.2 h, if the bounds
    # hold until 2.2 h
    most, move = bend + abs(c) * curved, 2.2 * fast * h
    near = facing & (most * h < -0.4 * slope) & (3.0 * most * h * h < -CLOSE * slope)
    near = near & (q > 2.0 * move) & (beyond + move <= 0.0)
    return h, (gap <= tolerance) & (beyond <= tolerance), near


@kernel()
def lock_within(a, b, facing, t, end, position, velocity, push, sensors):
    """Return the first lock from t to `end`, while both boresights keep their segments: (time, found).

    `position` and `velocity` are those at time 0. Of a `facing` pair `b` and `push` are ignored.
    """
    bounds = bounds_of_pair(a, b, facing, t, end, position, velocity, push, sensors.offset)
    while True:
        h, locked, near = step(a, b, facing, t, position, velocity, push, bounds, sensors)
        if locked:
            return t, True
        if t >= end:
            return end, False
        if near:
            return min(t + h, end), t + h <= end
        t = min(end, max(t + h, t * (1.0 + 2.3e-16)))


@kernel()
def lock_in_leg(leg, t, end, position, velocity, sensors):
    """Return the first lock of a facing pair from t to `end` within a leg: (time, found)."""
    a = nominal_segment(leg)
    return lock_within(a, a, True, t, end, position, velocity, 0.0, sensors)


@kernel()
def nominal_lock(legs, t, position, velocity, sensors):
    """Return the first lock of a facing pair from time t on: (time, leg), or (inf, NEVER)."""
    for k in range(len(legs)):
        if t <= legs[k, END]:
            begin = max(t, legs[k, START])
            when, locked = lock_in_leg(legs[k], begin, legs[k, END], position, velocity, sensors)
            if locked:
                return when, k
    return inf, NEVER


@kernel(inline=True)
def as_segment(row):
    """Return the row of a segment as a tuple."""
    return (
        *(row[0], row[1], row[2], row[3], row[4], row[5], row[6]),
        *(row[7], row[8], row[9], row[10], row[11], row[12], row[13]),
    )


@kernel()
def first_lock(legs, t, position, velocity, offset, one, other, segments):
    """Return the first lock of two craft from time t on: (time, leg of the first), or (inf, NEVER).

    `one` and `other` are the rows of their search errors; `segments` (2, SEGMENT) is scratch memory.
    """
    sensors = Sensors(offset, one[COSINE], other[COSINE], min(one[RANGE], other[RANGE]))
    if sensors.range < 0.0:
        return inf, NEVER
    if one[EXACT] * other[EXACT] > 0.0:
        return nominal_lock(legs, t, position, velocity, sensors)
    a, b = segments[0], segments[1]
    first_segment(legs, one, a)
    first_segment(legs, other, b)
    while True:
        while a[FINISH] <= t:
            next_segment(legs, one, a)
        while b[FINISH] <= t:
            next_segment(legs, other, b)
        end = min(a[FINISH], b[FINISH])
        if end == inf:
            return inf, NEVER
        out_a, change_a = outage(one, t)
        out_b, change_b = outage(other, t)
        end = min(end, change_a, change_b)
        if not (out_a or out_b):
            one_segment, other_segment = as_segment(a), as_segment(b)
            pair = position, velocity, other[SOLAR] - one[SOLAR], sensors
            when, locked = lock_within(one_segment, other_segment, False, t, end, *pair)
            if locked:
                return when, min(int(a[LEG]), len(legs) - 1)
        t = end


@kernel()
def detected_lock(legs, t, step, position, velocity, offset, one, other, segments):
    """Return the first lock as `first_lock` does; with a `step` above 0, the first at a multiple of it."""
    when, leg = first_lock(legs, t, position, velocity, offset, one, other, segments)
    while step > 0.0 and when < inf:
        sample = ceil(when / step) * step
        sample += step if sample < when else 0.0
        when, leg = first_lock(legs, sample, position, velocity, offset, one, other, segments)
        if when == sample:
            break
    return when, leg


# inlined where the arrays are allocated, so that the compiler knows that they do not overlap
@kernel(inline=True)
def march_block(leg, positions, velocities, begin, count, sensors, parts, reached, sure):
    """Advance a block of facing pairs through a leg in parallel: times reached, and if a lock is certain."""
    x, y, z, vx, vy, vz, speed, last, sideways = parts
    a, start, end = nominal_segment(leg), leg[START], leg[END]
    still = 0.0, 0.0, 0.0
    _, turning, between, (curl, _, _), _ = bounds_of_pair(
        a, a, True, start, end, still, still, 0.0, sensors.offset
    )
    for k in range(count):
        m = begin + k
        x[k], y[k], z[k] = positions[m, 0], positions[m, 1], positions[m, 2]
        vx[k], vy[k], vz[k] = velocities[m, 0], velocities[m, 1], velocities[m, 2]
        reached[k] = start
    for k in range(count):
        position, velocity = (x[k], y[k], z[k]), (vx[k], vy[k], vz[k])
        bounds = bounds_of_pair(a, a, True, start, end, position, velocity, 0.0, sensors.offset)
        speed[k], (_, last[k], sideways[k]) = bounds[0], bounds[3]
    for _ in range(SWEEPS):
        for k in range(count):
            t = reached[k]
            position, velocity = (x[k], y[k], z[k]), (vx[k], vy[k], vz[k])
            ours = curl, last[k], sideways[k]
            bounds = speed[k], turning, between, ours, ours
            h, locked, near = step(a, a, True, t, position, velocity, 0.0, bounds, sensors)
            reached[k] = min(end, t + h)
            sure[k] = 1.0 if (locked | near) & (t + h < end) else 0.0


@kernel(void(*(float64[:, ::1],) * 3, float64[:, :, ::1], float64, float64, float64[::1], int64[::1]))
def first_locks(
    legs: Floats,
    positions: Floats,
    velocities: Floats,
    craft: Floats,
    offset: float,
    step: float,
    times: Floats,
    found: Any,
) -> None:
    """Write the first lock of each pair to `times` and `found`; `found` holds a code for an invalid pair.

    With a `step` [s] above 0, locks are detected only at its multiples.
    `craft` (M, 2, 10 + 2 K) has the search errors of each pair, or (1, 2, 10 + 2 K) those of all.
    """
    alike, exact = len(craft) == 1, craft[0, 0, EXACT] * craft[0, 1, EXACT] > 0.0
    sensors = Sensors(offset, craft[0, 0, COSINE], craft[0, 1, COSINE], craft[0, 0, RANGE])
    segments = stack_matrix(2, 16)
    reached, sure, parts = np.zeros(BLOCK), np.zeros(BLOCK), np.empty((9, BLOCK))
    for begin in range(0, len(positions), BLOCK):
        count = min(BLOCK, len(positions) - begin)
        if alike and exact:
            march_block(legs[0], positions, velocities, begin, count, sensors, parts, reached, sure)
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
            elif sure[k] > 0.0 and step == 0.0:
                times[m], found[m] = reached[k], 0
            else:
                one, other = craft[0 if alike else m, 0], craft[0 if alike else m, 1]
                position, velocity = (x, y, z), (vx, vy, vz)
                pair = position, velocity, offset, one, other, segments
                when, leg = detected_lock(legs, reached[k], step, *pair)
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
