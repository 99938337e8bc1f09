"""State of the craft of a gathering, and the log of its events."""

from typing import Any, NamedTuple

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.search.gathering.join_rule import LOST

LOCK, BURN, CORRECTION, NEAR_FIELD = range(4)  # kinds of events
KNOWN_LOCK = 4  # of two craft of one set, which joins nothing
EVENT = 10  # columns of an event: time, kind, first, second, leg, case, label, delta-v (3)
# columns of a craft after its position: velocity, the time of both, the delta-v spent in all, on corrections
# and in the near field, the number of burns, whether it is adrift, the burn errors of this instant, and the
# error of its estimated state (6), relative to a reference that its set shares
VELOCITY, SINCE, SPENT, CORRECTED, NEAR_FIELD_SPENT, BURNS, ADRIFT, ERROR, ESTIMATE = 3, *range(6, 13), 15
COLUMNS = 21


class CraftState(NamedTuple):
    """State of the craft of a gathering.

    `rows` (N, COLUMNS); `labels` (N,): the set of each; `moved` (N,): whether it has burned since locks were
    last predicted; `fresh` (N,): whether it is new to the set of the last lock; `shared` (3,): the velocity
    of the formation set, as estimated. Burn errors: `losses`, `gates` and `normals` as in `BurnErrors`, of
    this case. `accuracy` (3,): that of `Sensor`; `fixes` (K, 2, 3): normal random numbers of both fixes of
    each lock that joins sets, K = 0 for exact ones.
    """

    rows: Floats
    labels: Any
    moved: Any
    fresh: Any
    shared: Floats
    losses: Floats
    gates: Floats
    normals: Floats
    accuracy: Floats
    fixes: Floats


class EventLog(NamedTuple):
    """Preallocated `rows` (E, 10) of events, and their `count` (1,), which may exceed E."""

    rows: Floats
    count: Any


@kernel()
def place(craft, positions, velocities):
    """Set all craft to lost, at their initial positions and velocities."""
    craft.rows[:] = 0.0
    for i in range(len(positions)):
        for k in range(3):
            craft.rows[i, k], craft.rows[i, VELOCITY + k] = positions[i, k], velocities[i, k]
        craft.labels[i], craft.moved[i] = LOST, False


@kernel()
def advance(craft, i, t):
    """Propagate the row of craft i to time t, with the error of its estimate."""
    row = craft.rows[i]
    for k in range(3):
        row[k] += row[VELOCITY + k] * (t - row[SINCE])
        row[ESTIMATE + k] += row[ESTIMATE + 3 + k] * (t - row[SINCE])
    row[SINCE] = t


@kernel()
def record(log, t, kind, i, j, leg, case, label, delta_v):
    """Append an event to the log if it has a free row."""
    count = log.count[0]
    if count < len(log.rows):
        row = log.rows[count]
        row[0], row[1], row[2], row[3], row[4], row[5], row[6] = t, kind, i, j, leg, case, label
        row[7], row[8], row[9] = delta_v
    log.count[0] = count + 1
