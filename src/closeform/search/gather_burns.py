"""Burns of a gathering, with lost thrust and execution errors, and the log of all events.

All burns of an instant are computed from the velocities known to the craft. Their execution errors are
applied afterwards, all at once.
"""

from math import hypot, sqrt
from typing import Any, NamedTuple

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.search.clearance import CORRECTED, PUSHED, SINCE, SPENT, VELOCITY
from closeform.search.violations import look_around

LOCK, BURN, CORRECTION, NEAR_FIELD = 0, 1, 2, 3  # kinds of events
ROUNDING = 1e-9  # of directions: a burn against the boresight is along an axis up to rounding
EVENT = 10  # columns: time, kind, first, second, leg, case, label, delta-v (3)


class Flaws(NamedTuple):
    """Flaws of the burns in each case: `fails` (C, N) [s], the time from which a craft has no thrust.

    `normals` (C, N, B, 3): the errors of the first B burns in sigmas, one along and two across; `gates` (N,
    4): the parameters of the sigmas. With B = 0 burns are exact.
    """

    fails: Floats
    gates: Floats
    normals: Floats


class EventLog(NamedTuple):
    """Preallocated `rows` (E, 10) of events, and their `count` (1,), which may exceed E."""

    rows: Floats
    count: Any


@kernel()
def record(log, t, kind, i, j, leg, case, label, push):
    """Append an event to the log if it has a free row."""
    count = log.count[0]
    if count < len(log.rows):
        row = log.rows[count]
        row[0], row[1], row[2], row[3], row[4], row[5], row[6] = t, kind, i, j, leg, case, label
        row[7], row[8], row[9] = push
    log.count[0] = count + 1


@kernel()
def advance(craft, i, t):
    """Propagate the row of craft i to time t."""
    row = craft.rows[i]
    for k in range(3):
        row[k] += row[VELOCITY + k] * (t - row[SINCE])
    row[SINCE] = t


@kernel()
def powerless(craft, i, t):
    """Return True if craft i has lost its thrust by time t."""
    return t >= craft.flaws.fails[craft.case[0], i]


@kernel()
def error(craft, i, x, y, z):
    """Return the execution error of the next burn (x, y, z) of craft i."""
    flaws, burnt = craft.flaws, craft.burnt[i]
    if burnt >= flaws.normals.shape[2]:
        return 0.0, 0.0, 0.0
    size = sqrt(x * x + y * y + z * z)
    x, y, z = x / size, y / size, z / size
    # across: from the axis with the least component, the first of those equal up to rounding
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
    """Give craft i a velocity at time t; skip a zero burn, and a burn without thrust."""
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
    """Apply the execution errors of all burns of an instant to the velocities."""
    for i in range(len(craft.moved)):
        if craft.moved[i]:
            for k in range(3):
                craft.rows[i, VELOCITY + k] += craft.off[i, k]
                craft.off[i, k] = 0.0
