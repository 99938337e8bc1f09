"""Gathering as a sequence of events: the next lock or near-field burn, the sets it joins, and the burns."""

from math import inf, sqrt
from typing import Any, NamedTuple

import numpy as np
from numba import boolean, float64, int64, types, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import Lent, borrowed, lent
from closeform.search.gathering.burns import (
    LEG,
    WHEN,
    apply_execution_errors,
    avoid_collisions,
    burn_in_near_field,
    join_formation,
)
from closeform.search.gathering.craft_state import (
    ADRIFT,
    BURNS,
    COLUMNS,
    CORRECTED,
    ESTIMATE,
    KNOWN_LOCK,
    LOCK,
    NEAR_FIELD_SPENT,
    SPENT,
    VELOCITY,
    CraftState,
    EventLog,
    advance,
    place,
    record,
)
from closeform.search.gathering.fixes import measure
from closeform.search.gathering.join_rule import (
    FORMATION,
    case_number,
    join,
    joint_label,
    know_each_other,
)
from closeform.search.gathering.keep_out_monitor import (
    ZONES,
    KeepOutMonitor,
    KeepOutZones,
    check_joining,
    count_violations,
    reset,
)
from closeform.search.gathering.lock_prediction import HELD, SearchingCraft, earliest_lock, predict_locks
from closeform.search.lock_march import NEVER
from closeform.search.schedule import START

# columns of a result; from RESULT on the delta-v of each craft (N), whether each is adrift (N), and the error
# of each estimated state (6 N)
END_TIME, END_LEG, LEFT, TOTAL, EVENTS, UNKNOWN, KNOWN, MOST, CORRECTIONS, NEAR_FIELD = range(10)
RESIDUAL, MISPLACED, RESULT = range(10, 13)
PER_CRAFT = 8  # columns from RESULT on, for each craft
ROWS, BLOCKS, INDICES, LABELS = float64[:, ::1], float64[:, :, ::1], int64[::1], int64[:, ::1]
NORMALS = float64[:, :, :, ::1]


# of C gatherings: `end` (C,), `burns` (C, P, 6) and `errors` (C, N, 10 + 2 K), of length 1 if all are alike
SEARCHING = Lent(
    types.NamedTuple(
        (ROWS, INDICES, INDICES, float64[::1], BLOCKS, BLOCKS, float64, float64, boolean, ROWS),
        SearchingCraft,
    )
)


@kernel()
def leg_at(legs, t):
    """Return the index of the leg at time t."""
    k = 0
    while k + 1 < len(legs) and legs[k + 1, START] <= t:
        k += 1
    return k


@kernel()
def spread_of(craft, column, formed):
    """Return the largest distance of three columns of the formation set (`formed` craft) from their mean."""
    most, x, y, z = 0.0, 0.0, 0.0, 0.0
    for i in range(len(craft.labels)):
        if craft.labels[i] == FORMATION:
            row = craft.rows[i]
            x, y, z = x + row[column] / formed, y + row[column + 1] / formed, z + row[column + 2] / formed
    for i in range(len(craft.labels)):
        if craft.labels[i] == FORMATION:
            row = craft.rows[i]
            away = (row[column] - x) ** 2 + (row[column + 1] - y) ** 2 + (row[column + 2] - z) ** 2
            most = max(most, sqrt(away))
    return most


@kernel()
def simulate_gathering(search, monitor, craft, log, locks, choice, result):
    """Simulate one gathering from placed craft and their next `locks` (A, B); write its outcome to `result`.

    The first pair burns by the given choice.
    """
    labels, burns, t, leg = craft.labels, search.burns, 0.0, NEVER
    formed, unused, joins, k = 0, 1, 0, 0
    log.count[0] = 0
    reset(monitor)
    while formed < len(labels):
        when, a, b = earliest_lock(search, craft, locks)
        if k < len(burns) and burns[k, WHEN] <= when:
            t, leg = burns[k, WHEN], int(burns[k, LEG])
            k = burn_in_near_field(burns, monitor, craft, log, k)
        elif when == inf:
            t, leg = search.end, NEVER
            break
        else:
            t, leg, locks[a, b] = when, leg_at(search.legs, when), HELD
            low, high = min(search.first[a], search.second[b]), max(search.first[a], search.second[b])
            one, other = labels[low], labels[high]
            if know_each_other(labels, low, high):
                case = case_number(one, other)
                record(log, t, KNOWN_LOCK, low, high, leg, case, one, (0.0, 0.0, 0.0))
                continue
            label = joint_label(one, other, formed > 0, unused)
            unused += label == unused
            check_joining(monitor, craft, low, high, t)
            join(labels, craft.fresh, low, high, label)
            measure(craft, low, high, t, joins)
            joins += 1
            record(log, t, LOCK, low, high, leg, case_number(one, other), label, (0.0, 0.0, 0.0))
            if label == FORMATION:
                join_formation(monitor, craft, log, t, low, high, leg, choice, formed > 0)
                formed = 0
                for m in range(len(labels)):
                    formed += labels[m] == FORMATION
            elif monitor.on:
                avoid_collisions(monitor, craft, log, t, leg, label, search.end)
        apply_execution_errors(craft)
        predict_locks(search, craft, locks, t)
    result[:] = 0.0
    result[END_TIME], result[END_LEG], result[EVENTS] = t, leg, log.count[0]
    result[LEFT] = len(labels) - formed
    result[UNKNOWN], result[KNOWN] = count_violations(monitor, craft, t)
    for i in range(len(labels)):
        row = craft.rows[i]
        result[TOTAL] += row[SPENT]
        result[CORRECTIONS] += row[CORRECTED]
        result[NEAR_FIELD] += row[NEAR_FIELD_SPENT]
        result[MOST] = max(result[MOST], row[BURNS])
        advance(craft, i, t)
        result[RESULT + i], result[RESULT + len(labels) + i] = row[SPENT], row[ADRIFT]
        for m in range(6):
            result[RESULT + 2 * len(labels) + 6 * i + m] = row[ESTIMATE + m]
    result[RESIDUAL], result[MISPLACED] = (
        spread_of(craft, VELOCITY, formed),
        spread_of(craft, ESTIMATE, formed),
    )


class Scratch(NamedTuple):
    """Memory of `CraftState`; next `locks` (A, B), now and in the `initial` state."""

    rows: Floats
    moved: Any
    fresh: Any
    shared: Floats
    locks: Floats
    initial: Floats


@kernel()
def simulate_each(searching, errors, choices, positions, velocities, monitor, log, scratch, labels, results):
    """Simulate gatherings one after another; their initial locks are predicted once for all choices."""
    first, second, legs = borrowed(searching.first), borrowed(searching.second), borrowed(searching.legs)
    monitor, log, scratch = lent(monitor), lent(log), lent(scratch)
    losses, gates, normals = borrowed(errors[0]), borrowed(errors[1]), borrowed(errors[2])
    accuracy, fixes = borrowed(errors[3]), borrowed(errors[4])
    positions, velocities = borrowed(positions), borrowed(velocities)
    labels, results = borrowed(labels), borrowed(results)
    for c in range(len(positions)):
        one = 0 if len(searching.end) == 1 else c
        end, burns, rows = searching.end[one], searching.burns[one], searching.errors[one]
        sensors = rows, searching.offset, searching.step, searching.all_locks, searching.segments
        search = lent(SearchingCraft(legs, first, second, end, burns, *sensors))
        memory = scratch.rows, labels[c], scratch.moved, scratch.fresh, scratch.shared
        wrong = losses[c], gates, normals[c], accuracy, fixes[c]
        craft = lent(CraftState(*memory, *wrong))
        place(craft, positions[c], velocities[c])
        craft.moved[:], scratch.initial[:] = True, 0.0
        predict_locks(search, craft, scratch.initial, 0.0)
        for w in range(len(choices)):
            place(craft, positions[c], velocities[c])
            scratch.locks[:] = scratch.initial
            simulate_gathering(search, monitor, craft, log, scratch.locks, choices[w], results[c, w])


@kernel(
    void(
        *(SEARCHING, ZONES, ROWS, ROWS, NORMALS, float64[::1], NORMALS, INDICES),
        *(BLOCKS, BLOCKS, ROWS, LABELS, BLOCKS),
    )
)
def simulate_gatherings(
    searching: SearchingCraft,
    zones: KeepOutZones,
    losses: Floats,
    gates: Floats,
    normals: Floats,
    accuracy: Floats,
    fixes: Floats,
    choices: Any,
    positions: Floats,
    velocities: Floats,
    events: Floats,
    labels: Any,
    results: Floats,
) -> None:
    """Simulate gatherings (C,), each with all given choices of burns; `events` holds those of the last.

    `labels` (C, N) are those of the last choice, and `results` is (C, choices, RESULT + 8 N). All scratch
    arrays are allocated here, so that inner functions do not count references.
    """
    count, pairs = positions.shape[1], (len(searching.first), len(searching.second))
    moved, fresh = np.empty(count, dtype=np.bool_), np.empty(count, dtype=np.bool_)
    scratch = Scratch(np.empty((count, COLUMNS)), moved, fresh, np.empty(3), np.empty(pairs), np.empty(pairs))
    watched = count if len(zones.boxes) else 0
    checked, violated = np.empty((watched, watched)), np.empty((watched, watched), dtype=np.int64)
    monitor = KeepOutMonitor(watched > 0, zones, checked, violated, np.empty((11, 3)))
    log, errors = EventLog(events, np.zeros(1, dtype=np.int64)), (losses, gates, normals, accuracy, fixes)
    simulate_each(searching, errors, choices, positions, velocities, monitor, log, scratch, labels, results)
