"""Prediction of the next lock of each pair in a gathering, repeated after each burn.

A burn changes a craft's straight line and therefore all later locks of that craft.
"""

from math import inf
from typing import Any, NamedTuple

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.search.gathering.craft_state import SINCE
from closeform.search.gathering.join_rule import know_each_other
from closeform.search.lock_march import detected_lock

HELD = -1.0  # time of a lock that has happened


class SearchingCraft(NamedTuple):
    """Search of the craft of one gathering.

    `legs` are those of `Search.table`; `first` (A,) and `second` (B,) the craft of the groups; `end` [s] that
    of all turns. `burns` (P, 6): the near-field burns in order of time: time, craft, leg, delta-v. `errors`
    (N, 10 + 2 K) are the craft's rows of search errors, and `offset` [m] is that of their sensors. Locks are
    detected at multiples of `step` [s], at any time if it is 0. With `all_locks` also the first lock of two
    craft of one set is found. `segments` (2, SEGMENT) is scratch memory.
    """

    legs: Floats
    first: Any
    second: Any
    end: Any
    burns: Floats
    errors: Floats
    offset: float
    step: float
    all_locks: bool
    segments: Floats


@kernel()
def lock_of_pair(search, craft, i, j, t):
    """Return the next lock of craft i of A and j of B from time t on; inf if they know each other."""
    if know_each_other(craft.labels, i, j) and not search.all_locks:
        return inf
    one, other = craft.rows[i], craft.rows[j]
    # the march counts from time 0, which loses digits only for craft that move far beyond their distance
    s, u = one[SINCE], other[SINCE]
    velocity = other[3] - one[3], other[4] - one[4], other[5] - one[5]
    position = (
        other[0] - other[3] * u - (one[0] - one[3] * s),
        other[1] - other[4] * u - (one[1] - one[4] * s),
        other[2] - other[5] * u - (one[2] - one[5] * s),
    )
    pair = position, velocity, search.offset, search.errors[i], search.errors[j], search.segments
    when, _ = detected_lock(search.legs, t, search.step, *pair)
    return when


@kernel()
def predict_locks(search, craft, times, t):
    """Update the next locks (A, B) of all craft that have burned, from time t on, unless they are HELD."""
    moved = craft.moved
    for a in range(len(search.first)):
        for b in range(len(search.second)):
            i, j = search.first[a], search.second[b]
            if (moved[i] or moved[j]) and times[a, b] != HELD:
                times[a, b] = lock_of_pair(search, craft, i, j, t)
    moved[:] = False


@kernel()
def earliest_lock(search, craft, times):
    """Return the next lock: (time, its craft in A and in B by their places in `times`), or (inf, -1, -1).

    Craft that know each other count only for `all_locks`.
    """
    earliest, one, other = inf, -1, -1
    for a in range(len(search.first)):
        for b in range(len(search.second)):
            if HELD < times[a, b] < earliest and (
                search.all_locks or not know_each_other(craft.labels, search.first[a], search.second[b])
            ):
                earliest, one, other = times[a, b], a, b
    return earliest, one, other
