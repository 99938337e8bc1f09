"""Layout of lanes: rows of numbers for simulations that run in parallel, one column each."""

from closeform._jit import kernel

LANES = 16  # simulations in parallel
# Rows of lanes: inertial state relative to the chief, deviation in effect, deviation measured, errors of
# thrust, delta-v and time at the limit, craft, its thrust limit and ballistic coefficient, thruster order and
# its burn,
# errors of the planned burn, errors of the feedback burn, and zeros.
Y, COUNTED, SEEN, ERROR, SPENT, CRAFT, LIMIT, BALLISTIC = 0, 6, 12, 18, 22, 24, 25, 26
ORDER, BURN, OWN, BACK, NONE, LANE = 27, 36, 39, 43, 47, 51


@kernel(inline=True)
def erred(lanes, m, row, x, y, z):
    """Return a thrust or an impulse of a lane with its errors: the common ones and those in a `row`."""
    grown, a = 1.0 + lanes[ERROR, m] + lanes[row, m], lanes[ERROR + 1, m] + lanes[row + 1, m]
    b, c = lanes[ERROR + 2, m] + lanes[row + 2, m], lanes[ERROR + 3, m] + lanes[row + 3, m]
    return grown * (x + b * z - c * y), grown * (y + c * x - a * z), grown * (z + a * y - b * x)


@kernel()
def correct(course, lanes, m, node, out):
    """Fill `out` (3,) with the feedback impulse for the deviation in effect."""
    for axis in range(3):
        out[axis] = 0.0
        if course.kicks[node] >= 0:
            for k in range(6):
                out[axis] += course.gains[course.kicks[node], axis, k] * lanes[COUNTED + k, m]
