"""Prediction of the next lock of each pair in a gathering, repeated after each burn.

A burn changes a craft's straight line and therefore all later locks of that craft.
"""

from math import inf
from typing import Any, NamedTuple

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.search.clearance import SINCE
from closeform.search.imperfect import imperfect_lock
from closeform.search.lock_march import LockSensor, first_lock
from closeform.search.sets import LOST


class Turns(NamedTuple):
    """Search of a gathering: `legs`; craft of the groups, `first` (A,) and `second` (B,); `end` [s].

    `pushes` (P, 6): burns of the near-field search in order of time: time, craft, leg, delta-v. Craft that
    are `exact` turn as planned and have the same sensor `see`; others have attitudes of their `own`.
    """

    legs: Floats
    first: Any
    second: Any
    end: float
    pushes: Floats
    exact: bool
    see: LockSensor
    own: "Astray"


class Astray(NamedTuple):
    """Craft with search errors: the nominal `turns` (L, 29), rows `craft` (N, 8), the `offset` [m].

    `swings` (2, 16) is scratch memory for the attitudes of two of them.
    """

    turns: Floats
    craft: Floats
    offset: float
    swings: Floats


class NextLocks(NamedTuple):
    """Next lock `times` (A, B) [s] of each pair of craft that do not know each other yet, else inf.

    `earliest` and `partner` (A,): the minimum of each row, and its column.
    """

    times: Floats
    earliest: Floats
    partner: Any


@kernel()
def next_lock(turns, i, j, t, position, velocity):
    """Return the time of the next lock of craft i of A and j of B; `position` is that at time 0."""
    if turns.exact:
        when, _ = first_lock(turns.legs, t, position, velocity, turns.see)
    else:
        own = turns.own
        one, other = own.craft[i], own.craft[j]
        when, _ = imperfect_lock(own.turns, t, position, velocity, own.offset, one, other, own.swings)
    return when


@kernel()
def least_of_row(next_locks, a):
    """Update the earliest lock of a row."""
    times, earliest, partner = next_locks.times, next_locks.earliest, next_locks.partner
    earliest[a], partner[a] = inf, 0
    for b in range(times.shape[1]):
        if times[a, b] < earliest[a]:
            earliest[a], partner[a] = times[a, b], b


@kernel()
def lock_of_pair(turns, craft, a, b, t):
    """Return the next lock of the craft of row a and column b from time t on; inf if they know each other."""
    i, j = turns.first[a], turns.second[b]
    one, other, labels = craft.rows[i], craft.rows[j], craft.labels
    if labels[i] != LOST and labels[i] == labels[j]:
        return inf
    # the march counts from time 0, which loses digits only for craft that move far beyond their distance
    s, u = one[SINCE], other[SINCE]
    velocity = other[3] - one[3], other[4] - one[4], other[5] - one[5]
    position = (
        other[0] - other[3] * u - (one[0] - one[3] * s),
        other[1] - other[4] * u - (one[1] - one[4] * s),
        other[2] - other[5] * u - (one[2] - one[5] * s),
    )
    return next_lock(turns, i, j, t, position, velocity)


@kernel()
def foresee(turns, craft, next_locks, a, b, t):
    """Update the next lock of the craft of row a and column b from time t on."""
    earliest, partner = next_locks.earliest, next_locks.partner
    when = lock_of_pair(turns, craft, a, b, t)
    next_locks.times[a, b] = when
    if when < earliest[a] or (when == earliest[a] and b < partner[a]):
        earliest[a], partner[a] = when, b
    elif partner[a] == b:
        least_of_row(next_locks, a)


@kernel()
def foresee_anew(turns, craft, next_locks, t):
    """Update the next locks of all craft that have burned."""
    moved = craft.moved
    for a in range(len(turns.first)):
        for b in range(len(turns.second)):
            if moved[turns.first[a]] or moved[turns.second[b]]:
                foresee(turns, craft, next_locks, a, b, t)
    for i in range(len(moved)):
        moved[i] = False


@kernel()
def earliest_row(earliest):
    """Return the row with the earliest lock."""
    a = 0
    for k in range(1, len(earliest)):
        if earliest[k] < earliest[a]:
            a = k
    return a


@kernel()
def forget(next_locks, a):
    """Delete the earliest lock of a row."""
    next_locks.times[a, next_locks.partner[a]] = inf
    least_of_row(next_locks, a)
