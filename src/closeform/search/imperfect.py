"""Locks of craft with search errors: each has its own attitude, schedule, cone and range.

With b the boresight of A, d that of B and q the vector between their sensors, both see each other when

    |q| cos(h_A) - b.q <= 0,   |q| cos(h_B) + d.q <= 0,   |q| <= range            # theory (13)

Each craft makes its turns one after another at its own rate. Between the ends of turns, of either craft, the
boresights rotate about fixed axes by angles that are quadratic in time. There the march of `lock_march` steps
as far as one of the three expressions certainly stays positive.
"""

from math import inf, nan, sqrt
from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import LARGEST, Floats
from closeform.kernel_loans import stack_matrix
from closeform.search.lock_march import CHUNK, COINCIDENT, NEVER, NOT_FINITE, SEEN, TINY, before, in_parts
from closeform.search.schedule import Search
from closeform.search.search_errors import (
    ACCELERATION,
    BODY,
    COSINE,
    LATE,
    LONGEST,
    OUTAGES,
    PACE,
    SearchErrors,
    craft_rows,
)
from closeform.search.sine_cosine import sine_cosine

LENGTH, ANGLE, MATRICES, TURN = 0, 1, 2, 29  # columns of a turn: [s], [rad], three matrices
BEGIN, END, PHASE, RATE, BEND = 0, 1, 2, 3, 4  # columns of a swing, by PHASE + RATE s + BEND s^2 / 2
VECTORS, LEG, PART = 5, 14, 15  # steady, cosine and sine vectors; the leg, and the part of its turn
WAIT, FASTER, STEADY, SLOWER = -1, 0, 1, 2  # parts


def turn_rows(search: Search) -> Floats:
    """Return the turns of a search as rows (L, 29), from which any body vector can be rotated."""
    rows = np.empty((len(search.legs), TURN))
    for row, leg in zip(rows, search.legs, strict=True):
        steady = np.outer(leg.axis, leg.axis @ leg.attitude)
        sine = np.cross(leg.axis, leg.attitude, axisb=0, axisc=0)
        row[LENGTH], row[ANGLE] = leg.end - leg.start, leg.angle
        row[MATRICES:] = np.concatenate([steady, leg.attitude - steady, sine]).ravel()
    return rows


@kernel()
def enter(turns, k, craft, swing):
    """Write the boresight vectors of a craft in turn k to `swing`."""
    for j in range(9):
        m = MATRICES + 3 * j
        swing[VECTORS + j] = (
            turns[k, m] * craft[BODY] + turns[k, m + 1] * craft[BODY + 1] + turns[k, m + 2] * craft[BODY + 2]
        )


@kernel()
def begin(turns, craft, swing):
    """Initialize a craft's swing: it waits until its start."""
    enter(turns, 0, craft, swing)
    swing[BEGIN] = swing[PHASE] = swing[RATE] = swing[BEND] = 0.0
    swing[END], swing[LEG], swing[PART] = craft[LATE], 0.0, WAIT


@kernel()
def go_on(turns, craft, swing):
    """Advance a craft to the next part of its turns; after the last one it keeps its attitude forever."""
    k, part = int(swing[LEG]), int(swing[PART]) + 1
    if part > SLOWER:
        k, part = k + 1, FASTER
        if k == len(turns):
            length = swing[END] - swing[BEGIN]
            swing[PHASE] += (swing[RATE] + 0.5 * swing[BEND] * length) * length
            swing[BEGIN], swing[RATE], swing[BEND] = swing[END], 0.0, 0.0
            swing[END], swing[LEG] = inf, k
            return
        enter(turns, k, craft, swing)
    turn, length = turns[k, ANGLE], turns[k, LENGTH]
    angle, way = abs(turn), -1.0 if turn < 0.0 else 1.0
    swing[BEGIN], swing[LEG], swing[PART] = swing[END], k, part
    if angle == 0.0:  # a wait lasts as long for all craft
        swing[PHASE] = swing[RATE] = swing[BEND] = 0.0
        swing[END] += length
        swing[PART] = SLOWER
        return
    rate, gain = craft[PACE] * angle / length, craft[ACCELERATION]
    rate = min(rate, sqrt(angle * gain))
    ramp = rate / gain
    last = angle - 0.5 * rate * ramp
    swing[PHASE] = way * (0.0 if part == FASTER else 0.5 * rate * ramp if part == STEADY else last)
    swing[RATE] = 0.0 if part == FASTER else way * rate
    swing[BEND] = way * (gain if part == FASTER else 0.0 if part == STEADY else -gain)
    swing[END] += angle / rate - ramp if part == STEADY else ramp
    if ramp == 0.0:
        swing[BEND] = 0.0


@kernel(inline=True)
def swung(row, t, place):
    """Return the boresight at time t, its rate, and the squared part of a `place` that rotates with it."""
    px, py, pz = place
    cx, cy, cz, sx, sy, sz = row[8], row[9], row[10], row[11], row[12], row[13]
    s = t - row[BEGIN]
    sa, ca = sine_cosine(row[PHASE] + (row[RATE] + 0.5 * row[BEND] * s) * s)
    w = row[RATE] + row[BEND] * s
    boresight = row[5] + cx * ca + sx * sa, row[6] + cy * ca + sy * sa, row[7] + cz * ca + sz * sa
    speed = w * (sx * ca - cx * sa), w * (sy * ca - cy * sa), w * (sz * ca - cz * sa)
    part = (cx * px + cy * py + cz * pz) ** 2 + (sx * px + sy * py + sz * pz) ** 2
    return boresight, speed, part


@kernel(inline=True)
def bounds(row, t, end, place, velocity):
    """Return bounds on the motion of a boresight b from t to `end`.

    The curvature of the rotating part of b.p, that part at `end`, the other curvature of b.p, and the
    largest |b'| and |b''|.
    """
    vx, vy, vz = velocity
    cx, cy, cz, sx, sy, sz = row[8], row[9], row[10], row[11], row[12], row[13]
    w = row[RATE]
    fastest = max(abs(w + row[BEND] * (t - row[BEGIN])), abs(w + row[BEND] * (end - row[BEGIN])))
    curl = sqrt(fastest**4 + row[BEND] ** 2)
    _, _, last = swung(row, end, place)
    sideways = sqrt((cx * vx + cy * vy + cz * vz) ** 2 + (sx * vx + sy * vy + sz * vz) ** 2)
    radius = sqrt(cx * cx + cy * cy + cz * cz)
    return curl, last, 2.0 * fastest * sideways, radius * fastest, radius * curl


@kernel(inline=True)
def unseen(gap, slope, bend, scale, longer):
    """Return a time for which one craft certainly does not see the other."""
    return min(before(max(gap, 0.0), slope, bend), longer) if gap > scale else 0.0


@kernel()
def lock_between(a, b, t, end, position, velocity, offset, cosines, longest):
    """Return the first lock from t to `end` within swings a and b: (time, found).

    `position` is that at time 0.
    """
    x, y, z = position
    vx, vy, vz = velocity
    c, e = cosines
    there = x + vx * end, y + vy * end, z + vz * end
    curl_a, last_a, else_a, fast_a, turn_a = bounds(a, t, end, there, velocity)
    curl_b, last_b, else_b, fast_b, turn_b = bounds(b, t, end, there, velocity)
    fast = sqrt(vx * vx + vy * vy + vz * vz) + offset * (fast_a + fast_b)
    turning = offset * (turn_a + turn_b)  # acceleration of the sensors' offsets, at most
    between = turning + 2.0 * offset * fast_a * fast_b  # of offset b.d
    concave = max(0.0, -min(c, e))
    while True:
        place = x + vx * t, y + vy * t, z + vz * t
        (bx, by, bz), (fx, fy, fz), now_a = swung(a, t, place)
        (dx, dy, dz), (gx, gy, gz), now_b = swung(b, t, place)
        qx, qy, qz = (
            place[0] + offset * (dx - bx),
            place[1] + offset * (dy - by),
            place[2] + offset * (dz - bz),
        )
        ux, uy, uz = vx + offset * (gx - fx), vy + offset * (gy - fy), vz + offset * (gz - fz)
        q = sqrt(qx * qx + qy * qy + qz * qz)
        growth = (qx * ux + qy * uy + qz * uz) / (q + TINY)
        seen_a, seen_b = c * q - (bx * qx + by * qy + bz * qz), e * q + (dx * qx + dy * qy + dz * qz)
        slope_a = c * growth - (bx * ux + by * uy + bz * uz + fx * qx + fy * qy + fz * qz)
        slope_b = e * growth + (dx * ux + dy * uy + dz * uz + gx * qx + gy * qy + gz * qz)
        beyond, scale = q - longest, SEEN * (q + 4.0 * offset)
        # |q| is convex except for the sensors' acceleration. A negative cosine reverses its sign;
        # then its curvature is (its speed)^2 / |q|, at most twice that before |q| is halved
        curved = 2.0 * fast * fast / (q + TINY) + turning
        longer = q / (2.0 * fast + TINY) if concave > 0.0 else inf
        bend_a = curl_a * sqrt(max(now_a, last_a)) + else_a + between
        bend_b = curl_b * sqrt(max(now_b, last_b)) + else_b + between
        bend_a += c * turning if c > 0.0 else -c * curved
        bend_b += e * turning if e > 0.0 else -e * curved
        h = max(
            unseen(seen_a, slope_a, bend_a, scale, longer), unseen(seen_b, slope_b, bend_b, scale, longer)
        )
        h = max(h, unseen(beyond, growth, turning, scale, inf))
        if h == 0.0:
            return t, True
        if t >= end:
            return end, False
        t = min(end, max(t + h, t * (1.0 + 2.3e-16)))


@kernel()
def outage(craft, t):
    """Return whether a craft has an outage at time t, and when one begins or ends next."""
    out, change = False, inf
    for k in range(OUTAGES, len(craft), 2):
        if craft[k] <= t < craft[k + 1]:
            out, change = True, min(change, craft[k + 1])
        elif craft[k] > t:
            change = min(change, craft[k])
    return out, change


@kernel()
def imperfect_lock(turns, t, position, velocity, offset, one, other, swings):
    """Return the first lock of two craft from time t on: (time, leg of the first), or (inf, NEVER)."""
    a, b = swings[0], swings[1]
    longest = min(one[LONGEST], other[LONGEST])
    if longest < 0.0:
        return inf, NEVER
    begin(turns, one, a)
    begin(turns, other, b)
    while True:
        while a[END] <= t:
            go_on(turns, one, a)
        while b[END] <= t:
            go_on(turns, other, b)
        end = min(a[END], b[END])
        if end == inf:
            return inf, NEVER
        out_a, change_a = outage(one, t)
        out_b, change_b = outage(other, t)
        end = min(end, change_a, change_b)
        if out_a or out_b:
            t = end
            continue
        cosines = one[COSINE], other[COSINE]
        when, locked = lock_between(a, b, t, end, position, velocity, offset, cosines, longest)
        if locked:
            return when, min(int(a[LEG]), len(turns) - 1)
        t = end


@kernel(
    void(
        float64[:, ::1],
        float64[:, :, ::1],
        float64[:, ::1],
        float64[:, ::1],
        float64,
        float64[::1],
        int64[::1],
    )
)
def imperfect_locks(
    turns: Floats,
    craft: Floats,
    positions: Floats,
    velocities: Floats,
    offset: float,
    times: Floats,
    found: Any,
) -> None:
    """Write the first lock of each pair to `times` and `found`; `found` holds a code for an invalid pair."""
    swings = stack_matrix(2, 16)
    for m in range(len(positions)):
        x, y, z = positions[m, 0], positions[m, 1], positions[m, 2]
        vx, vy, vz = velocities[m, 0], velocities[m, 1], velocities[m, 2]
        size = abs(x) + abs(y) + abs(z)
        times[m] = nan
        if not size + abs(vx) + abs(vy) + abs(vz) < LARGEST:
            found[m] = NOT_FINITE
        elif size < 1.0 / LARGEST:
            found[m] = COINCIDENT
        else:
            one, other = craft[m, 0], craft[m, 1]
            when, leg = imperfect_lock(turns, 0.0, (x, y, z), (vx, vy, vz), offset, one, other, swings)
            found[m] = leg
            if leg >= 0:
                times[m] = when


def fill_imperfect(
    search: Search, positions: Floats, velocities: Floats, errors: SearchErrors, times: Floats, legs: Any
) -> None:
    """Write the first locks of M pairs of craft with errors to `times` and `legs` (M,)."""
    table, count = turn_rows(search), len(positions)

    def part(some: slice) -> None:
        some = slice(some.start, min(some.stop, count))
        asked = f"{count} pairs is (M, 2{{}}), or common to all pairs"
        craft = craft_rows(errors, search.sensor, (count, 2), [False, True], asked, some)
        where, speeds = positions[some], velocities[some]
        imperfect_locks(table, craft, where, speeds, search.sensor.offset, times[some], legs[some])

    in_parts(part, count, CHUNK)
