"""Keep-out zones of coasting craft in a gathering, and the pairs that violate them.

Relative motion is a straight line. A pair is checked before either craft changes its velocity, when both
first know each other, and at the end.
"""

from typing import Any, NamedTuple

from numba import bool_, float64, int64, types

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import Lent
from closeform.motion.linear import times
from closeform.search.gathering.craft_state import SINCE, VELOCITY
from closeform.search.gathering.join_rule import know_each_other

APART, KNOWN, UNKNOWN = 0, 1, 2  # no violation yet; first one after they knew each other, or before


class KeepOutZone(NamedTuple):
    """Zone for kernels: whether it is a box, its matrix, and its enlarged half-axes as columns."""

    box: bool
    matrix: Floats
    half_axes: Floats


class KeepOutZones(NamedTuple):
    """Zones of all pairs for kernels: `kinds` (N,) and `table` are those of `PairZones`.

    `boxes` (K,): whether each zone is a box; `matrices` (K, 2, 3, 3): matrix and half-axes of each.
    """

    kinds: Any
    table: Any
    boxes: Any
    matrices: Floats


ZONES = Lent(types.NamedTuple((int64[::1], int64[:, ::1], bool_[::1], float64[:, :, :, ::1]), KeepOutZones))


class KeepOutMonitor(NamedTuple):
    """Violations of the `zones` of pairs; `on` if there are any zones.

    `checked` (N, N): the time [s] up to which each pair i < j was checked; `violated` (N, N): the result;
    `scratch` (11, 3): rows 0 to 7 and 10 are used here and by `collision_avoidance`, 8 and 9 by `burns`.
    """

    on: bool
    zones: KeepOutZones
    checked: Floats
    violated: Any
    scratch: Floats


@kernel()
def index_of_zone(zones, i, j):
    """Return the index of the zone that a pair keeps; -1 for none."""
    return zones.table[zones.kinds[min(i, j)], zones.kinds[max(i, j)]]


@kernel()
def zone_at(zones, k):
    """Return the zone of index k."""
    return KeepOutZone(zones.boxes[k], zones.matrices[k, 0], zones.matrices[k, 1])


@kernel()
def within(zone, r, v, duration):
    """Return True if r + v t has a norm of at most 1 at some time in [0, duration]; r, v (3,)."""
    x, y, z = times(zone.matrix, r[0], r[1], r[2])
    ux, uy, uz = times(zone.matrix, v[0], v[1], v[2])
    if not zone.box:
        rv, vv = x * ux + y * uy + z * uz, ux * ux + uy * uy + uz * uz
        t = min(duration, -rv / vv) if rv < 0.0 else 0.0
        return (x + ux * t) ** 2 + (y + uy * t) ** 2 + (z + uz * t) ** 2 <= 1.0
    begin, end = 0.0, duration
    for s, u in ((x, ux), (y, uy), (z, uz)):
        if u != 0.0:
            one, other = (1.0 - s) / u, (-1.0 - s) / u
            begin, end = max(begin, min(one, other)), min(end, max(one, other))
        elif abs(s) > 1.0:
            return False
    return begin <= end


@kernel()
def reset(monitor):
    """Forget all checks."""
    monitor.checked[:] = 0.0
    monitor.violated[:] = APART


@kernel()
def check(monitor, craft, i, j, t):
    """Check the straight line of a pair until time t."""
    i, j = min(i, j), max(i, j)
    which = index_of_zone(monitor.zones, i, j)
    if which < 0:
        return
    rows, violated = craft.rows, monitor.violated
    since, r, v = monitor.checked[i, j], monitor.scratch[0], monitor.scratch[1]
    for k in range(3):
        v[k] = rows[j, VELOCITY + k] - rows[i, VELOCITY + k]
        r[k] = rows[j, k] + rows[j, VELOCITY + k] * (since - rows[j, SINCE])
        r[k] -= rows[i, k] + rows[i, VELOCITY + k] * (since - rows[i, SINCE])
    if violated[i, j] != UNKNOWN and within(zone_at(monitor.zones, which), r, v, t - since):
        violated[i, j] = KNOWN if know_each_other(craft.labels, i, j) else UNKNOWN
    monitor.checked[i, j] = t


@kernel()
def check_pairs_of(monitor, craft, i, t):
    """Check all pairs of craft i."""
    if monitor.on:
        for j in range(len(craft.labels)):
            if j != i:
                check(monitor, craft, i, j, t)


@kernel()
def check_joining(monitor, craft, one, other, t):
    """Check all pairs that first know each other when craft `one` and `other` lock."""
    labels = craft.labels
    if monitor.on:
        for i in range(len(labels)):
            if i == one or know_each_other(labels, i, one):
                for j in range(len(labels)):
                    if j == other or know_each_other(labels, j, other):
                        check(monitor, craft, i, j, t)


@kernel()
def count_violations(monitor, craft, t):
    """Return the numbers of pairs with a violation before they knew each other, and only after, by time t."""
    unknown = known = 0
    if monitor.on:
        for i in range(len(craft.labels)):
            for j in range(i + 1, len(craft.labels)):
                check(monitor, craft, i, j, t)
                unknown += monitor.violated[i, j] == UNKNOWN
                known += monitor.violated[i, j] == KNOWN
    return unknown, known
