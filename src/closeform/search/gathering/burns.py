"""Burns of a gathering: to join the formation set, against collisions, and in the near-field search.

All burns of an instant are computed from the velocities that the craft estimate. Their execution errors are
applied afterwards, all at once.
"""

from math import hypot, inf, sqrt

from closeform._jit import kernel
from closeform.search.gathering.collision_avoidance import smallest_correction
from closeform.search.gathering.craft_state import (
    ADRIFT,
    BURN,
    BURNS,
    CORRECTED,
    CORRECTION,
    ERROR,
    ESTIMATE,
    NEAR_FIELD,
    NEAR_FIELD_SPENT,
    SPENT,
    VELOCITY,
    advance,
    record,
)
from closeform.search.gathering.join_rule import FORMATION, LOST
from closeform.search.gathering.keep_out_monitor import check_pairs_of

WHEN, CRAFT, LEG, DELTA_V = range(4)  # columns of a near-field burn
FIRST, SECOND, HALF = range(3)  # burns of the first pair: lower index, higher index, half each
ATTEMPTS = 4  # corrections of each craft of a set, at most
ROUNDING = 1e-9  # of directions: a burn against the boresight is along an axis up to rounding


@kernel()
def execution_error(craft, i, x, y, z):
    """Return the execution error of the next burn (x, y, z) of craft i."""
    burnt = int(craft.rows[i, BURNS])
    if burnt >= craft.normals.shape[1]:
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
    gates, normal = craft.gates[i], craft.normals[i, burnt]
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
    """Give craft i an estimated velocity at time t; skip a zero burn, and a burn without thrust."""
    row = craft.rows[i]
    vx, vy = velocity[0] - row[ESTIMATE + 3], velocity[1] - row[ESTIMATE + 4]
    vz = velocity[2] - row[ESTIMATE + 5]
    dx, dy, dz = vx - row[3], vy - row[4], vz - row[5]
    if dx == 0.0 and dy == 0.0 and dz == 0.0:
        return
    if t >= craft.losses[i]:
        if kind == BURN:
            row[ADRIFT] = 1.0
        return
    check_pairs_of(monitor, craft, i, t)
    advance(craft, i, t)
    row[3], row[4], row[5] = vx, vy, vz
    ex, ey, ez = execution_error(craft, i, dx, dy, dz)
    row[ERROR], row[ERROR + 1], row[ERROR + 2] = row[ERROR] + ex, row[ERROR + 1] + ey, row[ERROR + 2] + ez
    dx, dy, dz = dx + ex, dy + ey, dz + ez
    size = sqrt(dx * dx + dy * dy + dz * dz)
    row[SPENT] += size
    if kind != BURN:
        row[CORRECTED if kind == CORRECTION else NEAR_FIELD_SPENT] += size
    row[BURNS] += 1.0
    craft.moved[i] = True
    record(log, t, kind, i, -1, leg, 0, craft.labels[i], (dx, dy, dz))


@kernel()
def apply_execution_errors(craft):
    """Apply the execution errors of all burns of an instant to the velocities."""
    for i in range(len(craft.moved)):
        if craft.moved[i]:
            for k in range(3):
                craft.rows[i, VELOCITY + k] += craft.rows[i, ERROR + k]
                craft.rows[i, ERROR + k] = 0.0


@kernel()
def burn_in_near_field(burns, monitor, craft, log, k):
    """Burn the lost craft of near-field burn k and of all simultaneous ones; return the index of the next."""
    t = burns[k, WHEN]
    while k < len(burns) and burns[k, WHEN] == t:
        i = int(burns[k, CRAFT])
        if craft.labels[i] == LOST:
            own, row = craft.rows[i], burns[k]
            velocity = own[3] + row[DELTA_V], own[4] + row[DELTA_V + 1], own[5] + row[DELTA_V + 2]
            burn(monitor, craft, log, t, NEAR_FIELD, i, int(row[LEG]), velocity)
        k += 1
    return k


@kernel()
def join_formation(monitor, craft, log, t, low, high, leg, choice, formed):
    """Match the estimated velocity of each new craft to the formation set; the first pair agrees on one.

    If a craft of the first pair has lost its thrust, the other one burns.
    """
    shared = craft.shared
    if not formed:
        if t >= craft.losses[low]:
            choice = SECOND
        elif t >= craft.losses[high]:
            choice = FIRST
        if choice == FIRST:  # the one that keeps its velocity is the reference of estimates
            for k in range(6):
                craft.rows[low, ESTIMATE + k] -= craft.rows[high, ESTIMATE + k]
                craft.rows[high, ESTIMATE + k] = 0.0
        for k in range(3):
            one = craft.rows[low, VELOCITY + k] + craft.rows[low, ESTIMATE + 3 + k]
            other = craft.rows[high, VELOCITY + k] + craft.rows[high, ESTIMATE + 3 + k]
            shared[k] = one if choice == SECOND else (other if choice == FIRST else 0.5 * (one + other))
    for m in range(len(craft.labels)):
        if craft.labels[m] == FORMATION and (craft.fresh[m] or not formed):
            burn(monitor, craft, log, t, BURN, m, leg, (shared[0], shared[1], shared[2]))


@kernel()
def avoid_collisions(monitor, craft, log, t, leg, label, end):
    """Burn the craft of a knowledge set that would enter each other's zones before `end`.

    The burns are made one after another, the smallest first, by new craft and then by all. A conflict without
    a burn remains, and appears in Gathering.conflicts.
    """
    labels, scratch = craft.labels, monitor.scratch
    for i in range(len(labels)):
        if labels[i] == label:
            advance(craft, i, t)
    best, chosen = scratch[8], scratch[9]
    all_may_burn = False
    for _ in range(ATTEMPTS * len(labels)):
        least, burning = inf, -1
        for i in range(len(labels)):
            if labels[i] == label and (craft.fresh[i] or all_may_burn) and t < craft.losses[i]:
                size = smallest_correction(monitor.zones, craft, i, end - t, best, scratch)
                if 0.0 < size < least:
                    least, burning = size, i
                    chosen[0], chosen[1], chosen[2] = best[0], best[1], best[2]
        if burning >= 0:
            burn(monitor, craft, log, t, CORRECTION, burning, leg, (chosen[0], chosen[1], chosen[2]))
        elif all_may_burn:
            break
        else:
            all_may_burn = True
