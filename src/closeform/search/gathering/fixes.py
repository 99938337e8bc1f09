"""Relative state that two craft measure at a lock, by two fixes of range and bearing.

Each fix errs along the line of sight by the range error, and across it by the distance times the bearing
error. The estimate has the position of the second fix, and as velocity the difference of both over the time
between them, which is short: the craft measure and burn at the lock.
"""

from math import sqrt

from closeform._jit import kernel
from closeform.motion.linear import axes_across
from closeform.search.gathering.craft_state import ESTIMATE, advance


@kernel()
def measure(craft, low, high, t, number):
    """Shift the estimates of craft that are new to a set by the lock of low and high, the join `number`.

    The set that keeps its label keeps its estimates.
    """
    if len(craft.fixes) == 0:
        return
    rows, fixes = craft.rows, craft.fixes[number]
    in_range, in_bearing, interval = craft.accuracy[0], craft.accuracy[1], craft.accuracy[2]
    for m in range(len(craft.labels)):
        if craft.fresh[m] or m == low or m == high:
            advance(craft, m, t)
    new, kept = (high, low) if craft.fresh[high] else (low, high)
    one, other = rows[new], rows[kept]
    x, y, z = one[0] - other[0], one[1] - other[1], one[2] - other[2]
    distance = max(sqrt(x * x + y * y + z * z), 1e-300)  # no line of sight if they coincide
    x, y, z = x / distance, y / distance, z / distance
    across = distance * in_bearing
    # a direction across a line of sight is random in both of its components, so any frame will do
    p, q = axes_across(x, y, z)
    line = x, y, z
    for k in range(3):
        first = in_range * fixes[0, 0] * line[k] + across * (fixes[0, 1] * p[k] + fixes[0, 2] * q[k])
        second = in_range * fixes[1, 0] * line[k] + across * (fixes[1, 1] * p[k] + fixes[1, 2] * q[k])
        place = second + other[ESTIMATE + k] - one[ESTIMATE + k]
        speed = (second - first) / interval + other[ESTIMATE + 3 + k] - one[ESTIMATE + 3 + k]
        for m in range(len(craft.labels)):
            if craft.fresh[m]:
                rows[m, ESTIMATE + k] += place
                rows[m, ESTIMATE + 3 + k] += speed
