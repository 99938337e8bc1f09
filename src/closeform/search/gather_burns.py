"""Burns of a gathering: what comes of them where thrust is lost or they are off; the log of all events.

What craft burn at one instant they decide by the velocities that they were told; by how much burns are off
shows only then, all at once.
"""

from math import hypot, sqrt
from typing import Any, NamedTuple

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.search.clearance import CORRECTED, PUSHED, SINCE, SPENT, VELOCITY
from closeform.search.violations import look_around

LOCK, BURN, CORRECTION, NEAR_FIELD = 0, 1, 2, 3  # kinds of events
ROUNDING = 1e-9  # of directions: burns against the boresight are along an axis but for it
EVENT = 10  # columns: time, kind, first, second, leg, case, label, delta-v (3)


class Flaws(NamedTuple):
    """How burns go wrong, in each case: `fails` (C, N) [s], from when on a craft has no thrust.

    `normals` (C, N, B, 3): by how many sigmas the first B burns of each are off, along it and two across;
    `gates` (N, 4): what the sigmas are made of.  With B = 0 burns are exact.
    """

    fails: Floats
    gates: Floats
    normals: Floats


class EventLog(NamedTuple):
    """The `rows` (E, 10) of events, as many as there is room for, and their `count` (1,)."""

    rows: Floats
    count: Any


@kernel()
def record(log, t, kind, i, j, leg, case, label, push):
    """Write an event if there is room for it."""
    count = log.count[0]
    if count < len(log.rows):
        row = log.rows[count]
        row[0], row[1], row[2], row[3], row[4], row[5], row[6] = t, kind, i, j, leg, case, label
        row[7], row[8], row[9] = push
    log.count[0] = count + 1


@kernel()
def advance(craft, i, t):
    """Describe craft i by where it is at time t."""
    row = craft.rows[i]
    for k in range(3):
        row[k] += row[VELOCITY + k] * (t - row[SINCE])
    row[SINCE] = t


@kernel()
def powerless(craft, i, t):
    """Whether craft i has lost its thrust by time t."""
    return t >= craft.flaws.fails[craft.case[0], i]


@kernel()
def error(craft, i, x, y, z):
    """By how much the next burn (x, y, z) of craft i is off."""
    flaws, burnt = craft.flaws, craft.burnt[i]
    if burnt >= flaws.normals.shape[2]:
        return 0.0, 0.0, 0.0
    size = sqrt(x * x + y * y + z * z)
    x, y, z = x / size, y / size, z / size
    # across: by the axis that it is least along, the first of those that differ by rounding
    if abs(x) <= min(abs(y), abs(z)) + ROUNDING:
        ax, ay, az = 0.0, z, -y
    elif abs(y) <= abs(z) + ROUNDING:
        ax, ay, az = -z, 0.0, x
    else:
        ax, ay, az = y, -x, 0.0
    width = sqrt(ax * ax + ay * ay + az * az)
    ax, ay, az = ax / width, ay / width, az / width
    gates, normal = flaws.gates[i], flaws.normals[craft.case[0], i, burnt]
    along = hypot(gates[0], gates[1] * size) * normal[0]  # theory (50)
    wide = hypot(gates[2], gates[3] * size)
    p, q = wide * normal[1], wide * normal[2]
    return (
        along * x + p * ax + q * (y * az - z * ay),
        along * y + p * ay + q * (z * ax - x * az),
        along * z + p * az + q * (x * ay - y * ax),
    )


@kernel()
def burn(monitor, craft, log, t, kind, i, leg, velocity):
    """Give craft i a velocity at time t; a burn of nothing is no event, and without thrust there is none."""
    row = craft.rows[i]
    dx, dy, dz = velocity[0] - row[3], velocity[1] - row[4], velocity[2] - row[5]
    if dx == 0.0 and dy == 0.0 and dz == 0.0:
        return
    if powerless(craft, i, t):
        craft.adrift[i] = craft.adrift[i] or kind == BURN
        return
    look_around(monitor, craft, i, t)
    advance(craft, i, t)
    row[3], row[4], row[5] = velocity[0], velocity[1], velocity[2]
    ex, ey, ez = error(craft, i, dx, dy, dz)
    off = craft.off[i]
    off[0], off[1], off[2] = off[0] + ex, off[1] + ey, off[2] + ez
    dx, dy, dz = dx + ex, dy + ey, dz + ez
    size = sqrt(dx * dx + dy * dy + dz * dz)
    row[SPENT] += size
    if kind != BURN:
        row[CORRECTED if kind == CORRECTION else PUSHED] += size
    craft.burnt[i] += 1
    craft.moved[i] = True
    record(log, t, kind, i, -1, leg, 0, craft.labels[i], (dx, dy, dz))


@kernel()
def slip(craft):
    """The burns of an instant are over: what they are off becomes part of the velocities."""
    for i in range(len(craft.moved)):
        if craft.moved[i]:
            for k in range(3):
                craft.rows[i, VELOCITY + k] += craft.off[i, k]
                craft.off[i, k] = 0.0
