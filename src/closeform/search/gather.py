"""Gathering of lost craft: they search, lock and join until one formation set holds them all (H03)."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.motion.arc import END, IMPULSE, START, STATE, WIDTH
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.search.gather_burns import LOCK
from closeform.search.gather_events import (
    CORRECTIONS,
    END_LEG,
    END_TIME,
    FIRST,
    HALF,
    KNOWN,
    LEFT,
    PUSHES,
    RESULT,
    SECOND,
    TOTAL,
    UNKNOWN,
)
from closeform.search.gather_result import Event, EventKind, Gathering, GatherStatus, reason_incomplete
from closeform.search.gatherings import Gatherings
from closeform.search.lock_march import in_parts
from closeform.search.request import Burns, Groups, states
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors, first_of
from closeform.search.sets import LOST
from closeform.search.spacecraft_set import LostFleet, lost_fleet
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones

KINDS = tuple(EventKind)  # in the order of the kernel's codes
WAYS = {"second": SECOND, "first": FIRST, "half": HALF}  # of equal costs the first is chosen
EACH_CALL = 1024  # gatherings in one call of the kernel


def gather(
    search: Search,
    positions: ArrayLike,
    velocities: ArrayLike,
    groups: Groups = "alternating",
    *,
    keep_out: OwnZone | Sequence[OwnZone | None] | PairZones | None = None,
    rounds: int = 2,
    burns: Burns = "least",
    max_speed: float | None = None,
    errors: SearchErrors | None = None,
) -> Gathering:
    """Simulate a gathering: lost craft search, lock and join until one formation set holds them all.

    The first pair to lock begins the formation set. Craft that join it null their velocity relative to it.
    Knowledge sets coast until they meet it, except for corrections against collisions.

    Parameters
    ----------
    search : Search
        The schedule of all craft.
    positions : array_like of shape (N, 3) [m]
        Positions at the start of the search, in the inertial frame, in deep space.
    velocities : array_like of shape (N, 3) [m/s]
        Velocities in the inertial frame.
    groups : "alternating", "balanced" or sequence of "A" or "B", default "alternating"
        A, B, A, ...; the first half A (H03's 3:2); or one for each craft.
    keep_out : Zone, CovarianceZone, Body, sequence of these or None, or PairZones, optional
        One zone for all or one for each craft, as in `screen`, but a Sphere, Ellipsoid or Box. Craft of a
        set that would enter it before the end of the search make a correction.
    rounds : int, default 2
        Maximum number of searches. A burn voids S04's guarantee for the pairs of that craft.
    burns : "least", "first", "second" or "half", default "least"
        Craft of the first pair that burns: the first, the second (the lower index keeps its velocity), both
        by half, or the choice that leaves the fewest craft and among those takes the minimum total delta-v.
    max_speed : float [m/s], optional
        Bound on the relative speeds. Each round then ends with the near-field search: all wait for
        near_field / max_speed, lost craft burn twice `max_speed` against their boresight, and all wait as
        long again.
    errors : SearchErrors, optional
        Search errors of the craft, (N,) or common to all, for the whole gathering. Each craft turns, and
        burns in the near-field search, by its own clock.

    Returns
    -------
    Gathering
        The outcome, also if some craft are still lost; see its `status`.

    Raises
    ------
    ValueError
        If there are fewer than two craft, a group is empty, two craft are at the same position, shapes do
        not match, a number is not finite, `keep_out` has another shape or no zone for a pair, `burns`,
        `rounds` or `max_speed` is out of range, or `errors` do not match or leave no cone.

    Notes
    -----
    Simultaneous locks are processed in the order of the craft in A, then in B. If two choices of burns cost
    the same, the lower index keeps its velocity.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) section IV, the near-field search section III.C; docs/lost_craft.md.
    """
    where, speeds = states(positions, velocities, 2)
    fleet = lost_fleet(search, groups, where.shape[:2], keep_out, rounds, burns, max_speed, errors)
    with ThreadPoolExecutor(len(WAYS)) as pool:
        flown = pool.map(lambda code: fleet.fly(where, speeds, [code], 8 * where.shape[1]), WAYS.values())
    flights = dict(zip(WAYS, flown, strict=True))
    results = np.concatenate([flight[2] for flight in flights.values()], axis=1)
    best = list(WAYS)[least(results)[0]] if burns == "least" else burns
    totals = {way: float(flight[2][0, 0, TOTAL]) for way, flight in flights.items()}
    return gathering(fleet, where[0], speeds[0], best, totals, *flights[best])


def gather_cases(
    search: Search,
    positions: ArrayLike,
    velocities: ArrayLike,
    groups: Groups = "alternating",
    *,
    keep_out: OwnZone | Sequence[OwnZone | None] | PairZones | None = None,
    rounds: int = 2,
    burns: Burns = "least",
    max_speed: float | None = None,
    errors: SearchErrors | None = None,
) -> Gatherings:
    """Simulate many gatherings on all cores, as `gather` does, without paths and events.

    Parameters
    ----------
    search : Search
        The schedule of all craft.
    positions : array_like of shape (C, N, 3) [m]
        Positions of each case at the start of the search, in the inertial frame, in deep space.
    velocities : array_like of shape (C, N, 3) [m/s]
        Velocities in the inertial frame.
    groups : "alternating", "balanced" or sequence of "A" or "B", default "alternating"
        As in `gather`, the same in all cases.
    keep_out : Zone, CovarianceZone, Body, sequence of these or None, or PairZones, optional
        As in `gather`.
    rounds : int, default 2
        As in `gather`.
    burns : "least", "first", "second" or "half", default "least"
        As in `gather`.
    max_speed : float [m/s], optional
        As in `gather`.
    errors : SearchErrors, optional
        Search errors of the craft of each case, (C, N), or (N,) for all cases.

    Returns
    -------
    Gatherings
        The outcomes as arrays of C cases.

    Raises
    ------
    ValueError
        As `gather`, and if there are no cases. The message names the case of two craft at the same position.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) section IV; docs/lost_craft.md.
    """
    where, speeds = states(positions, velocities, 3)
    fleet = lost_fleet(search, groups, where.shape[:2], keep_out, rounds, burns, max_speed, errors)
    return gatherings(fleet, flown_least(fleet, where, speeds, burns)[0])


def flown_least(fleet: LostFleet, positions: Floats, velocities: Floats, burns: Burns) -> tuple[Floats, Any]:
    """Return the results (C, ...) of gatherings with their choice of burns, and its index (C,) in WAYS."""
    places = range(len(WAYS)) if burns == "least" else [[*WAYS].index(burns)]
    ways = [[*WAYS.values()][place] for place in places]

    def part(some: slice) -> tuple[Floats, Any]:
        each = fleet.fly(positions[some], velocities[some], ways, some=some)[2]
        which = least(each)
        return each[np.arange(len(each)), which], np.take(places, which)

    results, which = zip(*in_parts(part, len(positions), EACH_CALL), strict=True)
    return np.concatenate(results), np.concatenate(which)


def gatherings(fleet: LostFleet, results: Floats) -> Gatherings:
    """Return the kernel's results of gatherings (C,) as an object."""
    duration, count = results[:, END_TIME], len(fleet.groups)
    return Gatherings(
        fleet.search,
        duration,
        results[:, END_LEG].astype(np.int64),
        fleet.begun(duration),
        results[:, LEFT].astype(np.int64),
        results[:, TOTAL],
        results[:, CORRECTIONS],
        results[:, PUSHES],
        results[:, RESULT : RESULT + count],
        results[:, UNKNOWN].astype(np.int64),
        results[:, KNOWN].astype(np.int64),
        results[:, RESULT + count :].sum(axis=1).astype(np.int64),
    )


def least(results: Floats) -> Any:
    """Return the choice of burns (C,) from results (C, ways, ...): fewest craft left, then minimum delta-v.

    Of equal choices, the first.
    """
    spent, left = results[..., TOTAL], results[..., LEFT]
    tied = np.abs(spent - spent[:, :1]) <= 1e-12 * spent[:, :1]  # the same burns, added up in another order
    spent = np.where(tied, spent[:, :1], spent)
    return np.argmin(np.where(left == left.min(axis=1, keepdims=True), spent, inf), axis=1)


def gathering(
    fleet: LostFleet,
    positions: Floats,
    velocities: Floats,
    way: str,
    totals: dict[str, float],
    events: Floats,
    labels: Any,
    results: Floats,
) -> Gathering:
    """Return the kernel's results of one gathering as an object."""
    duration = float(results[0, 0, END_TIME])
    sets = [np.flatnonzero(labels == k) for k in np.unique(labels[labels != LOST])]
    members = tuple(tuple(map(int, some)) for some in sets)
    lost = tuple(map(int, np.flatnonzero(labels == LOST)))
    done = results[0, 0, LEFT] == 0
    adrift = tuple(np.flatnonzero(results[0, 0, RESULT + len(positions) :]).tolist())
    ended = GatherStatus.ADRIFT if adrift else GatherStatus.GATHERED
    burned = events[events[:, 1] != LOCK]
    delta_v = np.zeros(len(positions))
    np.add.at(delta_v, burned[:, 2].astype(int), np.linalg.norm(burned[:, 7:], axis=1))
    begun = int(fleet.begun(duration))
    return Gathering(
        fleet.search,
        fleet.groups,
        _paths(positions, velocities, burned, duration),
        tuple(_event(fleet.search, row) for row in events),
        delta_v,
        totals,
        way,
        members,
        lost,
        duration,
        begun,
        ended if done else GatherStatus.INCOMPLETE,
        reason_incomplete(members, lost, begun, adrift=adrift) or None,
        fleet.keep_out,
        None if fleet.errors is None else first_of(fleet.errors),
        adrift,
    )


def _event(search: Search, row: Floats) -> Event:
    """Return an event from its row."""
    kind, first, second, leg, case, label = map(int, row[1:7])
    there = search.legs[leg]
    return Event(
        float(row[0]), KINDS[kind], first, second, there.phase, there.round, case, label, row[7:].copy()
    )


def _paths(positions: Floats, velocities: Floats, burned: Floats, duration: float) -> Path:
    """Return paths of straight lines with burns as impulses; simultaneous burns are combined."""
    rows: list[Floats] = []
    offsets = [0]
    for k, (place, velocity) in enumerate(zip(positions, velocities, strict=True)):
        arc = np.zeros(WIDTH)
        arc[STATE : STATE + 3], arc[STATE + 3 : STATE + 6] = place, velocity
        for burn in burned[burned[:, 2] == k]:
            if burn[0] > arc[START]:
                arc[END] = burn[0]
                rows.append(arc)
                arc = arc.copy()
                arc[STATE : STATE + 3] += arc[STATE + 3 : STATE + 6] * (burn[0] - arc[START])
                arc[START], arc[IMPULSE : IMPULSE + 3] = burn[0], 0.0
            arc[IMPULSE : IMPULSE + 3] += burn[7:]
            arc[STATE + 3 : STATE + 6] += burn[7:]
        arc[END] = duration
        rows.append(arc)
        offsets.append(len(rows))
    return Path(Orbit(0.0), np.array(rows), np.array(offsets), (len(positions),))
