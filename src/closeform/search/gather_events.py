"""The gathering as a chain of events: the next lock or near-field burn, what it joins, what burns.

A craft is a row: its position, when it was there, its velocity, and the delta-v spent so far.
`locks` (A, B) holds the next lock of each pair that does not know each other yet, `earliest` and
`partner` the least of each row.  A burn changes a straight line, and so all later locks of it.
"""

from math import inf, sqrt
from typing import Any

import numpy as np
from numba import bool_, float64, int64, void

from closeform.arrays import Floats
from closeform.compiled import kernel
from closeform.search.clearance import CRAFT, SINCE, SPENT, VELOCITY, correction
from closeform.search.locks import COSINE, END, NEVER, START, STEADY, first_lock
from closeform.search.sets import FORMATION, LOST, case_number, joined, relabel
from closeform.search.violations import APART, count_violations, look_around, look_between

LOCK, BURN, CORRECTION, NEAR_FIELD = 0, 1, 2, 3  # kinds of events
EVENT = 10  # columns: time, kind, first, second, leg, case, label, delta-v (3)
ATTEMPTS = 4  # of each craft of a set to keep clear
FIRST, SECOND, HALF = 0, 1, 2  # who of the first pair burns: the lower index, the higher, half each
END_TIME, END_LEG, LEFT, TOTAL, EVENTS, UNKNOWN, KNOWN, RESULT = 0, 1, 2, 3, 4, 5, 6, 7


# A gathering in the hands of the kernel is four tuples of arrays:
#   sky    legs, sensor (baseline, cosine, range), first (A,) and second (B,): craft of the groups
#   fleet  craft (N, 8), labels (N,), moved (N,): who has burned since locks were last foreseen
#   book   locks (A, B), earliest (A,), partner (A,)
#   eyes   whether there is a zone; it (whether it is a box, its matrix, its half-axes enlarged); what
#          was looked at and seen (see violations); scratch (10, 3): clearance and violations work in its
#          rows 0 to 7, keep_clear holds 8 and 9


@kernel()
def advance(craft, i, t):
    """Describe craft i by where it is at time t."""
    for k in range(3):
        craft[i, k] += craft[i, VELOCITY + k] * (t - craft[i, SINCE])
    craft[i, SINCE] = t


@kernel()
def record(events, count, t, kind, i, j, leg, case, label, dx, dy, dz):
    """Write an event if there is room for it; the number of events."""
    if count < len(events):
        row = events[count]
        row[0], row[1], row[2], row[3], row[4], row[5], row[6] = t, kind, i, j, leg, case, label
        row[7], row[8], row[9] = dx, dy, dz
    return count + 1


@kernel()
def burn(eyes, fleet, events, count, t, kind, i, leg, vx, vy, vz):
    """Give craft i a velocity at time t; the number of events, which a burn of nothing does not add to."""
    craft, labels, moved = fleet
    dx, dy, dz = vx - craft[i, 3], vy - craft[i, 4], vz - craft[i, 5]
    if dx == 0.0 and dy == 0.0 and dz == 0.0:
        return count
    look_around(eyes, craft, labels, i, t)
    advance(craft, i, t)
    craft[i, 3], craft[i, 4], craft[i, 5] = vx, vy, vz
    craft[i, SPENT] += sqrt(dx * dx + dy * dy + dz * dz)
    moved[i] = True
    return record(events, count, t, kind, i, -1, leg, 0, labels[i], dx, dy, dz)


@kernel()
def least_of_row(book, a):
    locks, earliest, partner = book
    earliest[a], partner[a] = inf, 0
    for b in range(locks.shape[1]):
        if locks[a, b] < earliest[a]:
            earliest[a], partner[a] = locks[a, b], b


@kernel()
def foresee(sky, fleet, book, a, b, t):
    """Enter the next lock of the craft of row a and column b from time t on; inf if they know each other."""
    legs, sensor, first, second = sky
    craft, labels, moved = fleet
    locks, earliest, partner = book
    i, j = first[a], second[b]
    when = inf
    # the march counts from time 0, which loses digits only to craft that fly far beyond their distance
    if labels[i] == LOST or labels[i] != labels[j]:
        s, u = craft[i, SINCE], craft[j, SINCE]
        vx, vy, vz = craft[j, 3] - craft[i, 3], craft[j, 4] - craft[i, 4], craft[j, 5] - craft[i, 5]
        x = craft[j, 0] - craft[j, 3] * u - (craft[i, 0] - craft[i, 3] * s)
        y = craft[j, 1] - craft[j, 4] * u - (craft[i, 1] - craft[i, 4] * s)
        z = craft[j, 2] - craft[j, 5] * u - (craft[i, 2] - craft[i, 5] * s)
        when, leg = first_lock(legs, t, x, y, z, vx, vy, vz, sensor[0], sensor[1], sensor[2])
    locks[a, b] = when
    if when < earliest[a] or (when == earliest[a] and b < partner[a]):
        earliest[a], partner[a] = when, b
    elif partner[a] == b:
        least_of_row(book, a)


@kernel()
def foresee_anew(sky, fleet, book, t):
    """The next locks of all craft that have burned."""
    legs, sensor, first, second = sky
    craft, labels, moved = fleet
    for a in range(len(first)):
        for b in range(len(second)):
            if moved[first[a]] or moved[second[b]]:
                foresee(sky, fleet, book, a, b, t)
    for i in range(len(moved)):
        moved[i] = False


@kernel()
def leg_at(legs, t):
    k = 0
    while k + 1 < len(legs) and legs[k + 1, START] <= t:
        k += 1
    return k


@kernel()
def near_field_burns(sky, eyes, fleet, events, count, leg, push):
    """All that are lost burn against their boresight as a leg begins; the number of events."""
    legs, sensor, first, second = sky
    craft, labels, moved = fleet
    bx = legs[leg, STEADY] + legs[leg, COSINE]
    by = legs[leg, STEADY + 1] + legs[leg, COSINE + 1]
    bz = legs[leg, STEADY + 2] + legs[leg, COSINE + 2]
    for group, away in ((first, -push), (second, push)):
        for i in group:
            if labels[i] == LOST:
                vx, vy, vz = craft[i, 3] + away * bx, craft[i, 4] + away * by, craft[i, 5] + away * bz
                count = burn(eyes, fleet, events, count, legs[leg, START], NEAR_FIELD, i, leg, vx, vy, vz)
    return count


@kernel()
def into_formation(eyes, fleet, events, count, t, low, high, leg, way, formed, shared):
    """All craft of the formation set take its velocity `shared`; the first pair agrees on one."""
    craft, labels, moved = fleet
    if not formed:
        for k in range(3):
            one, other = craft[low, VELOCITY + k], craft[high, VELOCITY + k]
            shared[k] = one if way == SECOND else (other if way == FIRST else 0.5 * (one + other))
    for m in range(len(labels)):
        if labels[m] == FORMATION:
            count = burn(eyes, fleet, events, count, t, BURN, m, leg, shared[0], shared[1], shared[2])
    return count


@kernel()
def keep_clear(eyes, fleet, fresh, events, count, t, leg, label, end):
    """Craft of a knowledge set that would come too near to others of it, as all now fly, until `end`, burn.

    One after another, the cheapest first: of the new ones, then of all.  What no burn is found for
    remains, and is found again in Gathering.conflicts.
    """
    keeps, zone, looked, met, scratch = eyes
    box, matrix, half_axes = zone
    craft, labels, moved = fleet
    for i in range(len(labels)):
        if labels[i] == label:
            advance(craft, i, t)
    best, chosen = scratch[8], scratch[9]
    anyone = False
    for _ in range(ATTEMPTS * len(labels)):
        least, who = inf, -1
        for i in range(len(labels)):
            if labels[i] == label and (fresh[i] or anyone):
                size = correction(box, matrix, half_axes, craft, labels, i, end - t, best, scratch)
                if 0.0 < size < least:
                    least, who = size, i
                    chosen[0], chosen[1], chosen[2] = best[0], best[1], best[2]
        if who >= 0:
            count = burn(eyes, fleet, events, count, t, CORRECTION, who, leg, chosen[0], chosen[1], chosen[2])
        elif anyone:
            break
        else:
            anyone = True
    return count


@kernel()
def newcomers(labels, low, high, label, fresh):
    """Who is new to the set of that label when these two lock: those whose label changes.

    Of two that were lost the higher index: the lower holds.
    """
    one, other = labels[low], labels[high]
    for m in range(len(labels)):
        fresh[m] = labels[m] != LOST and labels[m] != label and (labels[m] == one or labels[m] == other)
    fresh[low] = fresh[low] or (one == LOST and other != LOST)
    fresh[high] = fresh[high] or other == LOST


@kernel()
def earliest_row(earliest):
    a = 0
    for k in range(1, len(earliest)):
        if earliest[k] < earliest[a]:
            a = k
    return a


@kernel()
def forget(book, a):
    """Strike out the earliest lock of a row."""
    locks, earliest, partner = book
    locks[a, partner[a]] = inf
    least_of_row(book, a)


@kernel()
def begin(sky, fleet, book):
    """All are lost, and all locks are foreseen."""
    legs, sensor, first, second = sky
    craft, labels, moved = fleet
    locks, earliest, partner = book
    for i in range(len(labels)):
        labels[i] = LOST
        moved[i] = True
    for a in range(len(first)):
        earliest[a], partner[a] = inf, 0
        for b in range(len(second)):
            locks[a, b] = inf
    foresee_anew(sky, fleet, book, 0.0)


@kernel()
def chain(sky, eyes, fleet, book, drifts, push, way, fresh, shared, events, result):
    """Fly one gathering; what came of it in `result`, its events as rows."""
    legs, sensor, first, second = sky
    craft, labels, moved = fleet
    locks, earliest, partner = book
    begin(sky, fleet, book)
    end, t, leg = legs[-1, END], 0.0, NEVER
    count, formed, unused, drift = 0, 0, 1, 0
    while formed < len(labels):
        a = earliest_row(earliest)
        when = earliest[a]
        if drift < len(drifts) and legs[drifts[drift], START] <= when:
            leg, t = drifts[drift], legs[drifts[drift], START]
            drift += 1
            count = near_field_burns(sky, eyes, fleet, events, count, leg, push)
            foresee_anew(sky, fleet, book, t)
            continue
        if when == inf:
            t, leg = end, NEVER
            break
        low, high = min(first[a], second[partner[a]]), max(first[a], second[partner[a]])
        one, other = labels[low], labels[high]
        forget(book, a)
        if one == other and one != LOST:  # a third craft has introduced them
            continue
        t, leg = when, leg_at(legs, when)
        label = joined(one, other, formed > 0, unused)
        unused += label == unused
        newcomers(labels, low, high, label, fresh)
        look_between(eyes, craft, labels, low, high, t)
        for old in (one, other):
            if old > FORMATION and old != label:
                relabel(labels, old, label)
        labels[low] = labels[high] = label
        count = record(events, count, t, LOCK, low, high, leg, case_number(one, other), label, 0.0, 0.0, 0.0)
        if label == FORMATION:
            count = into_formation(eyes, fleet, events, count, t, low, high, leg, way, formed > 0, shared)
            formed = 0
            for m in range(len(labels)):
                formed += labels[m] == FORMATION
        elif eyes[0]:
            count = keep_clear(eyes, fleet, fresh, events, count, t, leg, label, end)
        foresee_anew(sky, fleet, book, t)
    result[END_TIME], result[END_LEG], result[EVENTS], result[LEFT] = t, leg, count, len(labels) - formed
    result[UNKNOWN], result[KNOWN] = count_violations(eyes, craft, labels, t)
    result[TOTAL] = 0.0
    for i in range(len(labels)):
        result[TOTAL] += craft[i, SPENT]


@kernel(
    void(
        float64[:, ::1],
        int64[::1],
        float64[::1],
        float64,
        int64,
        bool_,
        bool_,
        float64[:, :, ::1],
        int64[::1],
        int64[::1],
        float64[:, :, ::1],
        float64[:, :, ::1],
        float64[:, ::1],
        int64[:, ::1],
        float64[:, ::1],
    )
)
def chains(
    legs: Floats,
    drifts: Any,
    sensor: Floats,
    push: float,
    way: int,
    keeps: bool,
    box: bool,
    zone: Floats,
    first: Any,
    second: Any,
    positions: Floats,
    velocities: Floats,
    events: Floats,
    labels: Any,
    results: Floats,
) -> None:
    """Fly gatherings; `events` holds those of the last one, `labels` and `results` a row for each."""
    count = positions.shape[1]
    moved, fresh = np.empty(count, dtype=np.bool_), np.empty(count, dtype=np.bool_)
    locks, earliest = np.empty((len(first), len(second))), np.empty(len(first))
    partner = np.empty(len(first), dtype=np.int64)
    craft, shared, scratch = np.empty((count, CRAFT)), np.empty(3), np.empty((10, 3))
    seen = count if keeps else 0
    looked, met = np.empty((seen, seen)), np.empty((seen, seen), dtype=np.int64)
    sky, book = (legs, sensor, first, second), (locks, earliest, partner)
    eyes = (keeps, (box, zone[0], zone[1]), looked, met, scratch)
    for c in range(len(positions)):
        for i in range(count):
            for k in range(3):
                craft[i, k] = positions[c, i, k]
                craft[i, VELOCITY + k] = velocities[c, i, k]
            craft[i, SINCE] = craft[i, SPENT] = 0.0
        for i in range(seen):
            for j in range(seen):
                looked[i, j], met[i, j] = 0.0, APART
        fleet = (craft, labels[c], moved)
        chain(sky, eyes, fleet, book, drifts, push, way, fresh, shared, events, results[c])
