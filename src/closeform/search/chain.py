"""The gathering as a chain of events: the next lock or near-field burn, what it joins, what burns.

A craft is a row: its position, when it was there, its velocity, and the delta-v spent so far.
`locks` (A, B) holds the next lock of each pair that does not know each other yet, `earliest` and
`partner` the least of each row.  A burn changes a straight line, and so all later locks of it.
"""

from math import inf, sqrt
from typing import Any

import numpy as np
from numba import bool_, float64, int64, void

from closeform.compiled import kernel
from closeform.search.clearance import correction
from closeform.search.locks import COSINE, NEVER, START, STEADY, first_lock
from closeform.search.sets import FORMATION, LOST, case_number, joined, relabel
from closeform.zones import Floats

VELOCITY, SINCE, SPENT, CRAFT = 3, 6, 7, 8  # columns of a craft's row, after its position
LOCK, BURN, CORRECTION, NEAR_FIELD = 0, 1, 2, 3  # kinds of events
EVENT = 10  # columns: time, kind, first, second, leg, case, label, delta-v (3)
FIRST, SECOND, HALF = 0, 1, 2  # who of the first pair burns: the lower index, the higher, half each
END_TIME, END_LEG, LEFT, TOTAL, EVENTS, RESULT = 0, 1, 2, 3, 4, 5


@kernel()
def advance(craft, i, t):
    """Describe craft i by where it is at time t."""
    for k in range(3):
        craft[i, k] += craft[i, VELOCITY + k] * (t - craft[i, SINCE])
    craft[i, SINCE] = t


@kernel()
def record(events, count, t, kind, i, j, leg, case, label):
    """Write an event without a burn if there is room; the number of events."""
    if count < len(events):
        row = events[count]
        row[0], row[1], row[2], row[3], row[4], row[5], row[6] = t, kind, i, j, leg, case, label
        row[7] = row[8] = row[9] = 0.0
    return count + 1


@kernel()
def burn(events, count, t, kind, craft, labels, moved, i, leg, vx, vy, vz):
    """Give craft i a velocity at time t; the number of events."""
    dx, dy, dz = vx - craft[i, 3], vy - craft[i, 4], vz - craft[i, 5]
    if dx == 0.0 and dy == 0.0 and dz == 0.0:
        return count
    advance(craft, i, t)
    craft[i, 3], craft[i, 4], craft[i, 5] = vx, vy, vz
    craft[i, SPENT] += sqrt(dx * dx + dy * dy + dz * dz)
    moved[i] = True
    if count < len(events):
        row = events[count]
        row[7], row[8], row[9] = dx, dy, dz
        row[0], row[1], row[2], row[3], row[4], row[5], row[6] = t, kind, i, -1.0, leg, 0.0, labels[i]
    return count + 1


@kernel()
def least_of_row(locks, earliest, partner, a):
    earliest[a], partner[a] = inf, 0
    for b in range(locks.shape[1]):
        if locks[a, b] < earliest[a]:
            earliest[a], partner[a] = locks[a, b], b


@kernel()
def expect(legs, sensor, craft, labels, first, second, locks, earliest, partner, a, b, t):
    """The next lock from time t on of the craft in row a and column b."""
    i, j = first[a], second[b]
    when = inf
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
        least_of_row(locks, earliest, partner, a)


@kernel()
def expect_anew(legs, sensor, craft, labels, first, second, locks, earliest, partner, moved, t):
    """The next locks of all craft that have burned."""
    for a in range(len(first)):
        for b in range(len(second)):
            if moved[first[a]] or moved[second[b]]:
                expect(legs, sensor, craft, labels, first, second, locks, earliest, partner, a, b, t)
    for i in range(len(moved)):
        moved[i] = False


@kernel()
def leg_at(legs, t):
    k = 0
    while k + 1 < len(legs) and legs[k + 1, START] <= t:
        k += 1
    return k


@kernel()
def into_formation(events, count, t, craft, labels, moved, i, j, leg, way, formed, kin):
    """All craft of the formation set take its velocity `kin`; the first pair agrees on one."""
    if not formed:
        low, high = min(i, j), max(i, j)
        for k in range(3):
            one, other = craft[low, VELOCITY + k], craft[high, VELOCITY + k]
            kin[k] = one if way == SECOND else (other if way == FIRST else 0.5 * (one + other))
    for m in range(len(labels)):
        if labels[m] == FORMATION:
            count = burn(events, count, t, BURN, craft, labels, moved, m, leg, kin[0], kin[1], kin[2])
    return count


@kernel()
def keep_clear(events, count, t, zone, craft, labels, moved, fresh, leg, label, end, scratch):
    """Craft that are new to a knowledge set burn if they would come too near to others of it."""
    box, matrix, ball, inverse = zone
    for i in range(len(labels)):
        if labels[i] == label:
            advance(craft, i, t)
    for i in range(len(labels)):
        if fresh[i]:
            size = correction(
                box, matrix, ball, inverse, craft, labels, i, end - t, scratch[4], scratch[5:8], scratch
            )
            if 0.0 < size < inf:
                x, y, z = scratch[4, 0], scratch[4, 1], scratch[4, 2]
                count = burn(events, count, t, CORRECTION, craft, labels, moved, i, leg, x, y, z)
    return count


@kernel()
def chain(legs, drifts, sensor, push, way, keeps, zone, first, second, craft, events, state, result):
    """Fly one gathering; what came of it in `result`, its events as rows."""
    labels, partner, moved, fresh, locks, earliest, kin, scratch = state
    end = legs[-1, 1]
    for i in range(len(labels)):
        labels[i] = LOST
        moved[i] = False
    for a in range(len(first)):
        earliest[a], partner[a] = inf, 0
        for b in range(len(second)):
            locks[a, b] = inf
        for b in range(len(second)):
            expect(legs, sensor, craft, labels, first, second, locks, earliest, partner, a, b, 0.0)
    count, in_formation, unused, drift, leg = 0, 0, 1, 0, NEVER
    t = 0.0
    while in_formation < len(labels):
        a = 0
        for k in range(1, len(first)):
            if earliest[k] < earliest[a]:
                a = k
        when = earliest[a]
        if drift < len(drifts) and legs[drifts[drift], START] <= when:
            leg = drifts[drift]
            t = legs[leg, START]
            drift += 1
            for i in range(len(labels)):
                if labels[i] == LOST:
                    away = -push
                    for b in range(len(second)):
                        away = push if second[b] == i else away
                    vx = craft[i, 3] + away * (legs[leg, STEADY] + legs[leg, COSINE])
                    vy = craft[i, 4] + away * (legs[leg, STEADY + 1] + legs[leg, COSINE + 1])
                    vz = craft[i, 5] + away * (legs[leg, STEADY + 2] + legs[leg, COSINE + 2])
                    count = burn(events, count, t, NEAR_FIELD, craft, labels, moved, i, leg, vx, vy, vz)
            expect_anew(legs, sensor, craft, labels, first, second, locks, earliest, partner, moved, t)
            continue
        if when == inf:
            t, leg = end, NEVER
            break
        i, j = first[a], second[partner[a]]
        one, other = labels[i], labels[j]
        if one == other and one != LOST:  # a third craft has introduced them
            locks[a, partner[a]] = inf
            least_of_row(locks, earliest, partner, a)
            continue
        t = max(t, when)
        leg = leg_at(legs, t)
        label = joined(one, other, in_formation > 0, unused)
        unused += label == unused
        low, high = min(i, j), max(i, j)
        case = case_number(labels[low], labels[high])
        for m in range(len(labels)):
            fresh[m] = labels[m] != LOST and labels[m] != label and (labels[m] == one or labels[m] == other)
        fresh[low] = fresh[low] or (labels[low] == LOST and labels[high] != LOST)
        fresh[high] = fresh[high] or labels[high] == LOST
        for old in (one, other):
            if old > FORMATION and old != label:
                relabel(labels, old, label)
        labels[i] = labels[j] = label
        count = record(events, count, t, LOCK, low, high, leg, case, label)
        if label == FORMATION:
            formed = in_formation > 0
            count = into_formation(events, count, t, craft, labels, moved, i, j, leg, way, formed, kin)
            in_formation = 0
            for m in range(len(labels)):
                in_formation += labels[m] == FORMATION
        elif keeps:
            count = keep_clear(events, count, t, zone, craft, labels, moved, fresh, leg, label, end, scratch)
        locks[a, partner[a]] = inf
        least_of_row(locks, earliest, partner, a)
        expect_anew(legs, sensor, craft, labels, first, second, locks, earliest, partner, moved, t)
    result[END_TIME], result[END_LEG], result[EVENTS] = t, leg, count
    result[LEFT] = len(labels) - in_formation
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
    partner = np.empty(len(first), dtype=np.int64)
    moved = np.empty(count, dtype=np.bool_)
    fresh = np.empty(count, dtype=np.bool_)
    locks = np.empty((len(first), len(second)))
    earliest = np.empty(len(first))
    kin = np.empty(3)
    scratch = np.empty((8, 3))
    craft = np.empty((count, CRAFT))
    for c in range(len(positions)):
        for i in range(count):
            for k in range(3):
                craft[i, k] = positions[c, i, k]
                craft[i, VELOCITY + k] = velocities[c, i, k]
            craft[i, SINCE] = craft[i, SPENT] = 0.0
        state = (labels[c], partner, moved, fresh, locks, earliest, kin, scratch)
        bodies = (box, zone[0], zone[1], zone[2])
        chain(legs, drifts, sensor, push, way, keeps, bodies, first, second, craft, events, state, results[c])
