"""Keep-out violations of pairs in a gathering, before they knew each other or only after.

A pair is checked before either craft changes its velocity, when they come to know each other, and at the end.
"""

from typing import Any, NamedTuple

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.search.clearance import SINCE, VELOCITY, KeptZones, between, chosen, within
from closeform.search.knowledge_sets import LOST

APART, KNOWN, UNKNOWN = 0, 1, 2


class KeepOutMonitor(NamedTuple):
    """Violations of the `zones` of pairs; `on` if there are any zones.

    `looked` (N, N): the time [s] up to which each pair i < j was checked; `met` (N, N): the result; `scratch`
    (10, 3): rows 0 to 7 are used here and by `clearance`, rows 8 and 9 by `keep_clear`.
    """

    on: bool
    zones: KeptZones
    looked: Floats
    met: Any
    scratch: Floats


@kernel()
def look(monitor, craft, i, j, t):
    """Check the straight line of a pair i < j until time t."""
    which = between(monitor.zones, i, j)
    if which < 0:
        return
    rows, labels, met = craft.rows, craft.labels, monitor.met
    since, r, v = monitor.looked[i, j], monitor.scratch[0], monitor.scratch[1]
    for k in range(3):
        v[k] = rows[j, VELOCITY + k] - rows[i, VELOCITY + k]
        r[k] = rows[j, k] + rows[j, VELOCITY + k] * (since - rows[j, SINCE])
        r[k] -= rows[i, k] + rows[i, VELOCITY + k] * (since - rows[i, SINCE])
    if met[i, j] != UNKNOWN and within(chosen(monitor.zones, which), r, v, t - since):
        met[i, j] = KNOWN if labels[i] == labels[j] and labels[i] != LOST else UNKNOWN
    monitor.looked[i, j] = t


@kernel()
def look_around(monitor, craft, i, t):
    """Check all pairs of craft i."""
    if monitor.on:
        for j in range(len(craft.labels)):
            if j != i:
                look(monitor, craft, min(i, j), max(i, j), t)


@kernel()
def look_between(monitor, craft, one, other, t):
    """Check all pairs that come to know each other when craft `one` and `other` lock."""
    labels = craft.labels
    if monitor.on:
        for i in range(len(labels)):
            if i == one or (labels[i] == labels[one] and labels[i] != LOST):
                for j in range(len(labels)):
                    if j == other or (labels[j] == labels[other] and labels[j] != LOST):
                        look(monitor, craft, min(i, j), max(i, j), t)


@kernel()
def count_violations(monitor, craft, t):
    """Count the pairs with a violation by time t: before they knew each other, and only afterwards."""
    unknown = known = 0
    if monitor.on:
        for i in range(len(craft.labels)):
            for j in range(i + 1, len(craft.labels)):
                look(monitor, craft, i, j, t)
                unknown += monitor.met[i, j] == UNKNOWN
                known += monitor.met[i, j] == KNOWN
    return unknown, known
