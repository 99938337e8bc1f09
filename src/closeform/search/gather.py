"""Gather: lost craft search, lock and join until one formation set holds them all (H03)."""

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import inf
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import LARGEST, Floats, instance, numbers, shown
from closeform.motion.arc import END, IMPULSE, START, STATE, WIDTH
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.search.clearance import ENLARGED
from closeform.search.gather_events import (
    END_LEG,
    END_TIME,
    EVENT,
    EVENTS,
    FIRST,
    HALF,
    KNOWN,
    LEFT,
    LOCK,
    RESULT,
    SECOND,
    TOTAL,
    UNKNOWN,
    fly_all,
)
from closeform.search.gather_result import Event, EventKind, Gathering, Gatherings, GatherStatus, who_is_left
from closeform.search.locks import in_parts
from closeform.search.rounds import MOST_ROUNDS, all_rounds
from closeform.search.schedule import Group, Search
from closeform.search.sensor import positive
from closeform.search.sets import LOST
from closeform.zones.own_zone import OwnZone
from closeform.zones.pair_zones import PairZones, pair_zones
from closeform.zones.shapes import BALL, CUBE
from closeform.zones.zone import Zone

Burns = Literal["least", "first", "second", "half"]
Groups = Literal["alternating", "balanced"] | Sequence[Group]
KINDS = tuple(EventKind)  # in the order of the kernel's
WAYS = {"second": SECOND, "first": FIRST, "half": HALF}  # the first of equals is taken
EACH_CALL = 1024  # gatherings that one call of the kernel flies


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
) -> Gathering:
    """Lost craft search, lock and join until one formation set holds them all (H03 section IV).

    `positions` [m] and `velocities` [m/s] are (N, 3) at the start of the `search`, in deep space.
    `groups`: "alternating" (A, B, A, ...), "balanced" (the first half A: H03's 3:2), or one of
    "A", "B" for each craft.  The first pair to lock begins the formation set: of its
    two craft `burns` the "second" (the lower index holds), the "first", "half" each, or the
    "least", which flies the way of the three that leaves the fewest craft and of those spends the
    least delta-v in total; of equals the lower index holds.  Of locks at one time that of the
    lowest craft in A counts first, then of the lowest in B.  Craft that join the formation set
    null their velocity relative to it; knowledge sets coast, but for corrections where
    `keep_out` would be entered before the end of the search: one zone for all or one for each
    craft, as in `screen`, but round or a box.  A burn voids S04's guarantee for
    the pairs that it touches, so the search is repeated up to `rounds` times.  With `max_speed`
    [m/s], a bound of the relative speeds, each round ends with the near-field search (H03
    section III.C): all wait for near_field / max_speed, the lost burn twice max_speed against
    their boresight, all wait as long again.

    Raises ValueError for fewer than two craft, an empty group, coincident craft, wrong shapes or
    numbers that are not finite, and other arguments that make no sense.
    """
    where, speeds = _states(positions, velocities, 2)
    fleet = _fleet(search, groups, where.shape[1], keep_out, rounds, burns, max_speed)
    with ThreadPoolExecutor(len(WAYS)) as pool:
        flown = pool.map(lambda code: fleet.fly(where, speeds, code, 8 * where.shape[1]), WAYS.values())
    flights = dict(zip(WAYS, flown, strict=True))
    results = [flight[2] for flight in flights.values()]
    best = list(WAYS)[_least(results)[0]] if burns == "least" else burns
    totals = {way: float(flight[2][0, TOTAL]) for way, flight in flights.items()}
    return fleet.gathering(where[0], speeds[0], best, totals, *flights[best])


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
) -> Gatherings:
    """Many gatherings at once, on all cores: what `gather` does, without paths and events.

    `positions` [m] and `velocities` [m/s] are (C, N, 3); `search`, `groups`, `keep_out`, `rounds`,
    `burns` and `max_speed` [m/s] as there.  Raises ValueError as there.
    """
    where, speeds = _states(positions, velocities, 3)
    fleet = _fleet(search, groups, where.shape[1], keep_out, rounds, burns, max_speed)
    ways = list(WAYS.values()) if burns == "least" else [WAYS[burns]]

    def part(some: slice) -> Floats:
        each = [fleet.fly(where[some], speeds[some], way, 0)[2] for way in ways]
        best: Floats = np.take_along_axis(np.stack(each), _least(each)[None, :, None], axis=0)[0]
        return best

    results = np.concatenate(in_parts(part, len(where), EACH_CALL))
    duration = results[:, END_TIME]
    return Gatherings(
        fleet.search,
        duration,
        results[:, END_LEG].astype(np.int64),
        fleet.begun(duration),
        results[:, LEFT].astype(np.int64),
        results[:, TOTAL],
        results[:, RESULT:],
        results[:, UNKNOWN].astype(np.int64),
        results[:, KNOWN].astype(np.int64),
    )


def _least(results: Sequence[Floats]) -> Any:
    """The way that leaves the fewest craft in each case, of those the cheapest, of equals the first."""
    table = np.stack(results)
    spent = table[:, :, TOTAL]
    tied = np.abs(spent - spent[:1]) <= 1e-12 * spent[:1]  # the same burns, added up in another order
    spent = np.where(tied, spent[:1], spent)
    fewest = table[:, :, LEFT] == table[:, :, LEFT].min(axis=0)
    return np.argmin(np.where(fewest, spent, inf), axis=0)


@dataclass(frozen=True, eq=False)
class _Fleet:
    """All that gatherings of the same craft share."""

    search: Search
    rounds: int
    drifts: Any
    groups: tuple[Group, ...]
    keep_out: PairZones | None
    push: float

    def fly(self, positions: Floats, velocities: Floats, way: int, room: int) -> tuple[Floats, Any, Floats]:
        """Events (E, 10) of the last case, if `room` is not 0, labels (C, N) and results (C, RESULT + N)."""
        sensor = self.search.sensor
        events = np.empty((room, EVENT))
        labels = np.empty(positions.shape[:2], dtype=np.int64)
        results = np.empty((len(positions), RESULT + positions.shape[1]))  # and what each craft spent
        kept = self.keep_out or PairZones.of([None] * len(self.groups))
        both = [(zone.matrix, ENLARGED * np.linalg.inv(zone.matrix)) for zone in kept.zones]
        fly_all(
            self.search.table,
            self.drifts,
            np.array([sensor.baseline, sensor.cosine, sensor.range]),
            self.push,
            way,
            bool(kept.zones),
            kept.kinds,
            kept.table,
            np.array([zone.shape == CUBE for zone in kept.zones], dtype=bool),
            np.array(both).reshape(-1, 2, 3, 3),
            np.array([k for k, group in enumerate(self.groups) if group == "A"]),
            np.array([k for k, group in enumerate(self.groups) if group == "B"]),
            positions,
            velocities,
            events,
            labels,
            results,
        )
        count = int(results[-1, EVENTS])
        if room and count > room:
            return self.fly(positions, velocities, way, count)
        return events[:count], labels, results

    def begun(self, time: Any) -> Any:
        """How many rounds have begun by a time."""
        span = self.search.duration / self.rounds
        return np.minimum(np.floor(time / span).astype(np.int64) + 1, self.rounds)

    def gathering(
        self,
        positions: Floats,
        velocities: Floats,
        way: str,
        totals: dict[str, float],
        events: Floats,
        labels: Any,
        results: Floats,
    ) -> Gathering:
        """The kernel's numbers as objects."""
        duration = float(results[0, END_TIME])
        sets = [np.flatnonzero(labels == k) for k in np.unique(labels[labels != LOST])]
        members = tuple(tuple(map(int, some)) for some in sets)
        lost = tuple(map(int, np.flatnonzero(labels == LOST)))
        done = results[0, LEFT] == 0
        burned = events[events[:, 1] != LOCK]
        delta_v = np.zeros(len(positions))
        np.add.at(delta_v, burned[:, 2].astype(int), np.linalg.norm(burned[:, 7:], axis=1))
        begun = int(self.begun(duration))
        return Gathering(
            self.search,
            self.groups,
            _paths(positions, velocities, burned, duration),
            tuple(self.event(row) for row in events),
            delta_v,
            totals,
            way,
            members,
            lost,
            duration,
            begun,
            GatherStatus.GATHERED if done else GatherStatus.INCOMPLETE,
            None if done else who_is_left(members, lost, begun),
            self.keep_out,
        )

    def event(self, row: Floats) -> Event:
        """An event from its row."""
        kind, first, second, leg, case, label = map(int, row[1:7])
        there = self.search.legs[leg]
        return Event(
            float(row[0]), KINDS[kind], first, second, there.phase, there.round, case, label, row[7:].copy()
        )


def _fleet(
    search: Search,
    groups: Groups,
    count: int,
    keep_out: OwnZone | Sequence[OwnZone | None] | PairZones | None,
    rounds: int,
    burns: Burns,
    max_speed: float | None,
) -> _Fleet:
    if isinstance(rounds, bool) or not isinstance(rounds, int | np.integer) or not 1 <= rounds <= MOST_ROUNDS:
        raise ValueError(f"rounds: must be a whole number from 1 to {MOST_ROUNDS}, got {shown(rounds)}")
    if not isinstance(burns, str) or burns not in get_args(Burns):
        raise ValueError(f"burns: must be one of {', '.join(get_args(Burns))}, got {shown(burns)}")
    instance("search", search, Search)
    kept = None
    if keep_out is not None:
        _cleared(keep_out)
        kept = pair_zones("keep_out", keep_out, count)
        for zone in kept.zones:
            _cleared(zone)
    speed = None if max_speed is None else positive("max_speed", max_speed)
    flown, drifts = all_rounds(search, int(rounds), speed)
    return _Fleet(flown, int(rounds), drifts, _sides(groups, count), kept, 2.0 * (speed or 0.0))


def _cleared(zone: Any) -> None:
    """Refuse a zone that the kernel has no burn for."""
    if isinstance(zone, Zone) and zone.shape not in (BALL, CUBE):
        raise ValueError(
            f"keep_out: a gathering keeps a Sphere, Ellipsoid or Box clear, not a {type(zone).__name__}; "
            "give one that holds it"
        )


def _sides(groups: Groups, count: int) -> tuple[Group, ...]:
    """The group of each craft."""
    if isinstance(groups, str):
        if groups not in ("alternating", "balanced"):
            raise ValueError(
                f'groups: "alternating", "balanced" or one of A, B for each craft, got {shown(groups)}'
            )
        middle = (count + 1) // 2  # H03 figure 3: three and two of five
        second = [k % 2 == 1 if groups == "alternating" else k >= middle for k in range(count)]
        return tuple("B" if there else "A" for there in second)
    if not isinstance(groups, Iterable):
        raise ValueError(f'groups: "alternating", "balanced" or A, B for each craft, got {shown(groups)}')
    given = tuple(groups)
    if len(given) != count:
        raise ValueError(f"groups: expected one for each of {count} craft, got {len(given)}")
    if wrong := [group for group in given if group not in ("A", "B")]:
        raise ValueError(f'groups: each must be "A" or "B", got {shown(wrong[0])}')
    for group in ("A", "B"):
        if group not in given:
            raise ValueError(f"groups: {group} is empty; craft of one group never see each other")
    return given


def _states(positions: ArrayLike, velocities: ArrayLike, dimensions: int) -> tuple[Floats, Floats]:
    """Positions and velocities as (C, N, 3)."""
    shape = ("N, 3", "C, N, 3")[dimensions - 2]
    arrays = {"positions": numbers("positions", positions), "velocities": numbers("velocities", velocities)}
    for name, array in arrays.items():
        if array.ndim != dimensions or array.shape[-1] != 3:
            raise ValueError(f"{name}: expected shape ({shape}), got {array.shape}")
        if not (np.abs(array) < LARGEST).all():
            raise ValueError(f"{name}: every number must be finite, and below {LARGEST:g} in SI units")
    where, speeds = (np.where(np.abs(array) < 1.0 / LARGEST, 0.0, array) for array in arrays.values())
    if where.shape != speeds.shape:
        raise ValueError(f"velocities: expected the shape of positions, {where.shape}, got {speeds.shape}")
    if where.shape[-2] < 2:
        raise ValueError(f"positions: a gathering needs two craft or more, got {where.shape[-2]}")
    if not where.size:
        raise ValueError("positions: no cases")
    cases = where.reshape(-1, *where.shape[-2:])
    order = np.lexsort(cases.transpose(2, 0, 1), axis=-1)
    ranked = np.take_along_axis(cases, order[..., None], axis=1)
    same = (ranked[:, 1:] == ranked[:, :-1]).all(axis=2)
    if same.any():
        case, k = np.argwhere(same)[0]
        i, j = sorted(map(int, order[case, k : k + 2]))
        place = f" in case {case}" if dimensions > 2 else ""
        raise ValueError(f"positions: craft {i} and {j} are at one place{place}")
    return np.ascontiguousarray(cases), np.ascontiguousarray(speeds.reshape(cases.shape))


def _paths(positions: Floats, velocities: Floats, burned: Floats, duration: float) -> Path:
    """Straight lines between burns, which become impulses; burns at one time become one."""
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
