"""Lanes: rows of numbers of flights that go side by side, one column each."""

from closeform._jit import kernel

LANES = 16  # flights of a craft, side by side
# Rows of lanes: the state from the chief, inertial, the deviation that counts, that which was seen, errors of
# thrust, what is spent, the craft, its limit and ballistic coefficient, an order to thrusters and its burn,
# errors of what is planned until the next edge, of what leads back until it is told anew, and none.
Y, COUNTED, SEEN, ERROR, SPENT, CRAFT, LIMIT, BALLISTIC = 0, 6, 12, 18, 22, 24, 25, 26
ORDER, BURN, OWN, BACK, NONE, LANE = 27, 36, 39, 43, 47, 51


@kernel(inline=True)
def erred(lanes, m, row, x, y, z):
    """A thrust or an impulse of a lane as it comes out, with the errors of a `row` of its own."""
    grown, a = 1.0 + lanes[ERROR, m] + lanes[row, m], lanes[ERROR + 1, m] + lanes[row + 1, m]
    b, c = lanes[ERROR + 2, m] + lanes[row + 2, m], lanes[ERROR + 3, m] + lanes[row + 3, m]
    return grown * (x + b * z - c * y), grown * (y + c * x - a * z), grown * (z + a * y - b * x)


@kernel()
def correct(course, lanes, m, node, out):
    """Fill `out` (3,) with the impulse that leads a lane back from what counts."""
    for axis in range(3):
        out[axis] = 0.0
        if course.kicks[node] >= 0:
            for k in range(6):
                out[axis] += course.gains[course.kicks[node], axis, k] * lanes[COUNTED + k, m]
