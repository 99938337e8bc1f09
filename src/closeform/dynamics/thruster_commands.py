"""Feedback orders to thrusters in simulations: the burns in addition to the plan, and their thrust."""

from math import cos, sin

from closeform._jit import kernel
from closeform.dynamics.batch_layout import BACK, BURN, CRAFT, LANES, ORDER, SPENT, correct, erred
from closeform.kernel_loans import stack_vector

SIDE, BIT, STRENGTH, THRUSTER = 0, 3, 4, 5  # of a thruster: direction, minimum bit, acceleration
CORNER, INVERSE, FACET = 0, 3, 12  # of a facet: its thrusters, and the inverse of their directions


@kernel(inline=True)
def asked(facet, k, x, y, z):
    """Return the share of thruster `k` of a facet in a push."""
    return x * facet[INVERSE + k] + y * facet[INVERSE + 3 + k] + z * facet[INVERSE + 6 + k]


@kernel()
def order(course, lanes, m, node, given):
    """Order the thrusters of a lane for the slot that begins at a node.

    The order holds for three thrusters: index, and on and off times, counted in time without planned firing
    and centred in the slot. `given` (3,) is the delta-v in the chief's axes, which is added to the spent one.
    A slot counts as limited if the thrusters cannot provide the whole feedback impulse.
    """
    i, until, v = int(lanes[CRAFT, m]), course.slots[node], stack_vector(3)
    correct(course, lanes, m, node, v)
    angle = 0.5 * (course.angles[i, node] + course.angles[i, until])
    c, s = cos(angle), sin(angle)
    x, y, z = c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]
    facets = course.facets[i]
    best, least = 0, -1e300
    for f in range(len(facets)):
        lowest = 1e300
        for k in range(3):
            lowest = min(lowest, asked(facets[f], k, x, y, z))
        if lowest > least:
            best, least = f, lowest
    fx, fy, fz, short = 0.0, 0.0, 0.0, False
    for k in range(3):
        j = int(facets[best, CORNER + k])
        own, free = course.thrusters[i, j], course.free[i, j]
        q = asked(facets[best], k, x, y, z)
        most = own[STRENGTH] * (free[until] - free[node])
        if q < own[BIT] or q <= 0.0:
            q = 0.0
        elif q > most:
            q, short = most if most >= own[BIT] else 0.0, True
        half = 0.5 * q / own[STRENGTH] if q > 0.0 else 0.0
        middle = 0.5 * (free[node] + free[until])
        lanes[ORDER + 3 * k, m], lanes[ORDER + 3 * k + 1, m], lanes[ORDER + 3 * k + 2, m] = (
            j,
            middle - half,
            middle + half,
        )
        lanes[SPENT, m] += q
        fx, fy, fz = fx + q * own[SIDE], fy + q * own[SIDE + 1], fz + q * own[SIDE + 2]
    given[0], given[1], given[2] = c * fx + s * fy, c * fy - s * fx, fz
    if short:
        never = course.free[i, course.free.shape[1] - 1]
        lanes[SPENT + 1, m] += never[until] - never[node]


@kernel()
def burn_all(course, lanes, step):
    """Fill the mean thrust of ordered burns within a step, with errors."""
    for m in range(LANES):
        i = int(lanes[CRAFT, m])
        fx, fy, fz = 0.0, 0.0, 0.0
        for k in range(3):
            j = int(lanes[ORDER + 3 * k, m])
            free, own = course.free[i, j], course.thrusters[i, j]
            lasts = min(lanes[ORDER + 3 * k + 2, m], free[step + 1])
            lasts -= max(lanes[ORDER + 3 * k + 1, m], free[step])
            if lasts > 0.0:
                size = own[STRENGTH] * lasts / course.steps[step]
                fx, fy, fz = fx + size * own[SIDE], fy + size * own[SIDE + 1], fz + size * own[SIDE + 2]
        angle = 0.5 * (course.angles[i, step] + course.angles[i, step + 1])
        c, s = cos(angle), sin(angle)
        lanes[BURN, m], lanes[BURN + 1, m], lanes[BURN + 2, m] = erred(
            lanes, m, BACK, c * fx + s * fy, c * fy - s * fx, fz
        )
