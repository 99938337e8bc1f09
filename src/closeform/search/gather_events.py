"""Gathering as a sequence of events: the next lock or near-field burn, the sets it joins, and the burns."""

from math import inf
from typing import Any

import numpy as np
from numba import bool_, float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import borrowed, lent
from closeform.search.clearance import (
    CORRECTED,
    CRAFT,
    PUSHED,
    SINCE,
    SPENT,
    VELOCITY,
    GatheringCraft,
    KeptZones,
    correction,
)
from closeform.search.gather_burns import (
    BURN,
    CORRECTION,
    LOCK,
    NEAR_FIELD,
    EventLog,
    Flaws,
    advance,
    burn,
    powerless,
    record,
    slip,
)
from closeform.search.knowledge_sets import FORMATION, LOST, case_number, joined, relabel
from closeform.search.lock_march import END, NEVER, START, LockSensor
from closeform.search.next_locks import (
    Astray,
    NextLocks,
    Turns,
    earliest_row,
    foresee_anew,
    forget,
    least_of_row,
    lock_of_pair,
)
from closeform.search.violations import APART, KeepOutMonitor, count_violations, look_between

WHEN, WHO, LEG, PUSH = 0, 1, 2, 3  # columns of pushes
ATTEMPTS = 4  # corrections of each craft of a set, at most
FIRST, SECOND, HALF = 0, 1, 2  # burns of the first pair: lower index, higher index, half each
END_TIME, END_LEG, LEFT, TOTAL, EVENTS, UNKNOWN, KNOWN, MOST, CORRECTIONS, PUSHES, RESULT = range(11)


@kernel()
def leg_at(legs, t):
    """Return the index of the leg at time t."""
    k = 0
    while k + 1 < len(legs) and legs[k + 1, START] <= t:
        k += 1
    return k


@kernel()
def near_field_burns(turns, monitor, craft, log, k):
    """Apply near-field burn k and all simultaneous ones; return the index of the next burn."""
    pushes = turns.pushes
    t = pushes[k, WHEN]
    while k < len(pushes) and pushes[k, WHEN] == t:
        i = int(pushes[k, WHO])
        if craft.labels[i] == LOST:
            own, row = craft.rows[i], pushes[k]
            velocity = own[3] + row[PUSH], own[4] + row[PUSH + 1], own[5] + row[PUSH + 2]
            burn(monitor, craft, log, t, NEAR_FIELD, i, int(row[LEG]), velocity)
        k += 1
    return k


@kernel()
def into_formation(monitor, craft, log, t, low, high, leg, way, formed):
    """Match the velocity of each new craft to the formation set; the first pair agrees on one.

    If a craft of the first pair has lost its thrust, the other one burns.
    """
    shared = craft.shared
    if not formed:
        if powerless(craft, low, t):
            way = SECOND
        elif powerless(craft, high, t):
            way = FIRST
        for k in range(3):
            one, other = craft.rows[low, VELOCITY + k], craft.rows[high, VELOCITY + k]
            shared[k] = one if way == SECOND else (other if way == FIRST else 0.5 * (one + other))
    for m in range(len(craft.labels)):
        if craft.labels[m] == FORMATION and (craft.fresh[m] or not formed):
            burn(monitor, craft, log, t, BURN, m, leg, (shared[0], shared[1], shared[2]))


@kernel()
def keep_clear(monitor, craft, log, t, leg, label, end):
    """Burn the craft of a knowledge set that would enter each other's zones before `end`.

    Burns are made one after another, the smallest first: first by new craft, then by all craft. A conflict
    without a burn remains, and appears in Gathering.conflicts.
    """
    labels, scratch = craft.labels, monitor.scratch
    for i in range(len(labels)):
        if labels[i] == label:
            advance(craft, i, t)
    best, chosen = scratch[8], scratch[9]
    anyone = False
    for _ in range(ATTEMPTS * len(labels)):
        least, who = inf, -1
        for i in range(len(labels)):
            if labels[i] == label and (craft.fresh[i] or anyone) and not powerless(craft, i, t):
                size = correction(monitor.zones, craft, i, end - t, best, scratch)
                if 0.0 < size < least:
                    least, who = size, i
                    chosen[0], chosen[1], chosen[2] = best[0], best[1], best[2]
        if who >= 0:
            burn(monitor, craft, log, t, CORRECTION, who, leg, (chosen[0], chosen[1], chosen[2]))
        elif anyone:
            break
        else:
            anyone = True


@kernel()
def newcomers(craft, low, high, label):
    """Mark the craft that are new to the set of that label when two craft lock.

    These are the craft whose label changes. Of two lost craft it is the higher index; the lower keeps its
    velocity.
    """
    labels, fresh = craft.labels, craft.fresh
    one, other = labels[low], labels[high]
    for m in range(len(labels)):
        fresh[m] = labels[m] != LOST and labels[m] != label and (labels[m] == one or labels[m] == other)
    fresh[low] = fresh[low] or (one == LOST and other != LOST)
    fresh[high] = fresh[high] or other == LOST


@kernel()
def place(craft, position, velocity):
    """Set all craft to lost, at their initial positions and velocities."""
    rows = craft.rows
    for i in range(len(rows)):
        for k in range(3):
            rows[i, k], rows[i, VELOCITY + k], craft.off[i, k] = position[i, k], velocity[i, k], 0.0
        rows[i, SINCE] = rows[i, SPENT] = rows[i, CORRECTED] = rows[i, PUSHED] = 0.0
        craft.labels[i], craft.moved[i], craft.adrift[i], craft.burnt[i] = LOST, False, False, 0


@kernel()
def begin(monitor, next_locks, foreseen, log):
    """Reset the log, the conflicts and the next locks, which are given as `foreseen` (A, B)."""
    log.count[0] = 0
    for i in range(len(monitor.met)):
        for j in range(len(monitor.met)):
            monitor.looked[i, j], monitor.met[i, j] = 0.0, APART
    for a in range(len(foreseen)):
        for b in range(foreseen.shape[1]):
            next_locks.times[a, b] = foreseen[a, b]
        least_of_row(next_locks, a)


@kernel()
def fly_one(turns, monitor, craft, next_locks, log, way, result):
    """Simulate one gathering after `begin`; its outcome goes to `result`."""
    legs, labels, pushes = turns.legs, craft.labels, turns.pushes
    end, t, leg = turns.end, 0.0, NEVER
    formed, unused, push = 0, 1, 0
    while formed < len(labels):
        a = earliest_row(next_locks.earliest)
        when = next_locks.earliest[a]
        if push < len(pushes) and pushes[push, WHEN] <= when:
            t, leg = pushes[push, WHEN], int(pushes[push, LEG])
            push = near_field_burns(turns, monitor, craft, log, push)
            slip(craft)
            foresee_anew(turns, craft, next_locks, t)
            continue
        if when == inf:
            t, leg = end, NEVER
            break
        i, j = turns.first[a], turns.second[next_locks.partner[a]]
        low, high = min(i, j), max(i, j)
        one, other = labels[low], labels[high]
        forget(next_locks, a)
        if one == other and one != LOST:  # they know each other through a third craft
            continue
        t, leg = when, leg_at(legs, when)
        label = joined(one, other, formed > 0, unused)
        unused += label == unused
        newcomers(craft, low, high, label)
        look_between(monitor, craft, low, high, t)
        for old in (one, other):
            if old > FORMATION and old != label:
                relabel(labels, old, label)
        labels[low] = labels[high] = label
        record(log, t, LOCK, low, high, leg, case_number(one, other), label, (0.0, 0.0, 0.0))
        if label == FORMATION:
            into_formation(monitor, craft, log, t, low, high, leg, way, formed > 0)
            formed = 0
            for m in range(len(labels)):
                formed += labels[m] == FORMATION
        elif monitor.on:
            keep_clear(monitor, craft, log, t, leg, label, end)
        slip(craft)
        foresee_anew(turns, craft, next_locks, t)
    result[END_TIME], result[END_LEG], result[EVENTS], result[LEFT] = (
        t,
        leg,
        log.count[0],
        len(labels) - formed,
    )
    result[UNKNOWN], result[KNOWN] = count_violations(monitor, craft, t)
    result[TOTAL] = result[MOST] = result[CORRECTIONS] = result[PUSHES] = 0.0
    for i in range(len(labels)):
        result[TOTAL] += craft.rows[i, SPENT]
        result[CORRECTIONS] += craft.rows[i, CORRECTED]
        result[PUSHES] += craft.rows[i, PUSHED]
        result[MOST] = max(result[MOST], craft.burnt[i])
        result[RESULT + i] = craft.rows[i, SPENT]
        result[RESULT + len(labels) + i] = craft.adrift[i]


@kernel()
def fly_each(turns, monitor, craft, next_locks, foreseen, log, ways, positions, velocities, labels, results):
    """Simulate gatherings, each with all choices of burns; the initial locks are predicted once for all."""
    turns, monitor, craft = lent(turns), lent(monitor), lent(craft)
    next_locks, log, foreseen = lent(next_locks), lent(log), borrowed(foreseen)
    positions, velocities = borrowed(positions), borrowed(velocities)
    labels, results = borrowed(labels), borrowed(results)
    for c in range(len(positions)):
        craft.case[0] = c
        place(craft, positions[c], velocities[c])
        for a in range(len(foreseen)):
            for b in range(foreseen.shape[1]):
                foreseen[a, b] = lock_of_pair(turns, craft, a, b, 0.0)
        for w in range(len(ways)):
            place(craft, positions[c], velocities[c])
            begin(monitor, next_locks, foreseen, log)
            fly_one(turns, monitor, craft, next_locks, log, ways[w], results[c, w])
        for i in range(len(craft.labels)):
            labels[c, i] = craft.labels[i]


@kernel()
def fly_cases(
    turns,
    ways,
    keeps,
    kinds,
    table,
    boxes,
    matrices,
    fails,
    gates,
    normals,
    positions,
    velocities,
    events,
    labels,
    results,
):
    """Simulate gatherings of one search with given choices of burns; `events` holds those of the last one.

    All scratch arrays are allocated here, outside the loops, so that inner functions do not count references.
    """
    count, seen = positions.shape[1], positions.shape[1] if keeps else 0
    rows, shared, scratch = np.empty((count, CRAFT)), np.empty(3), np.empty((10, 3))
    moved, fresh = np.empty(count, dtype=np.bool_), np.empty(count, dtype=np.bool_)
    sets = np.empty(count, dtype=np.int64)
    looked, met = np.empty((seen, seen)), np.empty((seen, seen), dtype=np.int64)
    monitor = KeepOutMonitor(keeps, lent(KeptZones(kinds, table, boxes, matrices)), looked, met, scratch)
    times, foreseen = np.empty((2, len(turns.first), len(turns.second)))
    next_locks = NextLocks(times, np.empty(len(times)), np.empty(len(times), dtype=np.int64))
    log = EventLog(events, np.zeros(1, dtype=np.int64))
    flaws, off = lent(Flaws(fails, gates, normals)), np.empty((count, 3))
    adrift, burnt = np.empty(count, dtype=np.bool_), np.empty(count, dtype=np.int64)
    case = np.zeros(1, dtype=np.int64)
    craft = GatheringCraft(rows, sets, moved, fresh, shared, flaws, case, off, burnt, adrift)
    fly_each(turns, monitor, craft, next_locks, foreseen, log, ways, positions, velocities, labels, results)


FLOWN = (  # common argument types of the entry points
    *(int64[::1], bool_, int64[::1], int64[:, ::1], bool_[::1], float64[:, :, :, ::1]),
    *(float64[:, ::1], float64[:, ::1], float64[:, :, :, ::1]),
    *(float64[:, :, ::1], float64[:, :, ::1], float64[:, ::1], int64[:, ::1], float64[:, :, ::1]),
)


@kernel(void(float64[:, ::1], int64[::1], int64[::1], float64[:, ::1], float64[::1], *FLOWN))
def fly_all(
    legs: Floats,
    first: Any,
    second: Any,
    pushes: Floats,
    sensor: Floats,
    ways: Any,
    keeps: bool,
    kinds: Any,
    table: Any,
    boxes: Any,
    matrices: Floats,
    fails: Floats,
    gates: Floats,
    normals: Floats,
    positions: Floats,
    velocities: Floats,
    events: Floats,
    labels: Any,
    results: Floats,
) -> None:
    """Simulate gatherings of craft without search errors, with each of the given choices of burns."""
    see = LockSensor(sensor[0], sensor[1], sensor[2])
    nothing = np.empty((0, 0))
    own = lent(Astray(nothing, nothing, 0.0, nothing))
    turns = Turns(legs, first, second, legs[-1, END], pushes, True, see, own)
    kept, flaws = (keeps, kinds, table, boxes, matrices), (fails, gates, normals)
    fly_cases(turns, ways, *kept, *flaws, positions, velocities, events, labels, results)
