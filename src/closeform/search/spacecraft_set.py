"""Craft of gatherings with their turns and burns, and the call of the kernel that simulates them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, get_args

import numpy as np

from closeform.arrays import Floats, instance, shown
from closeform.search.burn_flaws import FEW, BurnFlaws
from closeform.search.clearance import ENLARGED
from closeform.search.gather_burns import EVENT
from closeform.search.gather_events import EVENTS, MOST, PUSH, RESULT, WHEN, fly_all
from closeform.search.imperfect_attitude import OwnTurns
from closeform.search.leg import Group
from closeform.search.lock_march import COSINE, START, STEADY
from closeform.search.request import Burns, Groups, cleared, sides
from closeform.search.rounds import MOST_ROUNDS, all_rounds
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors, craft_rows, of_each
from closeform.search.sensor import one_positive
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones, all_made, pair_zones
from closeform.zones.shapes import CUBE


@dataclass(frozen=True, eq=False)
class LostFleet:
    """Data that all gatherings of the same craft share."""

    search: Search
    rounds: int
    drifts: Any
    groups: tuple[Group, ...]
    keep_out: PairZones | None
    push: float
    errors: SearchErrors | None
    craft: Floats  # (C, N, 8) rows of craft with errors

    def fly(
        self,
        positions: Floats,
        velocities: Floats,
        ways: Sequence[int],
        room: int = 0,
        some: Any = slice(None),
        flaws: BurnFlaws | None = None,
        drawn: int = FEW,
    ) -> tuple[Floats, Any, Floats]:
        """Simulate gatherings for each of the given choices of burns; they are the cases `some` of all.

        Returns the events (E, 10) of the last case and choice if there is `room` for any, the labels (C, N)
        of the last choice, and results (C, ways, RESULT + 2 N). `flaws` of the burns have random numbers for
        `drawn` burns of each craft; the simulation is repeated if these or the room do not suffice.
        """
        events = np.empty((room, EVENT))
        labels = np.empty(positions.shape[:2], dtype=np.int64)
        columns = RESULT + 2 * positions.shape[1]  # then the delta-v of each, and whether it is adrift
        results = np.empty((len(positions), len(ways), columns))
        kept = self.keep_out or PairZones.of([None] * len(self.groups))
        both = [(zone.matrix, ENLARGED * np.linalg.inv(zone.matrix)) for zone in kept.zones]
        boxes = np.array([zone.shape == CUBE for zone in kept.zones], dtype=bool)
        zones = bool(kept.zones), kept.kinds, kept.table, boxes, np.array(both).reshape(-1, 2, 3, 3)
        first, second = (np.flatnonzero(np.array(self.groups) == group) for group in ("A", "B"))
        wrong = flaws or BurnFlaws.none(positions.shape[:2])
        flown = np.array(ways), *zones, *wrong.drawn(drawn), positions, velocities, events, labels, results
        if self.errors is None:
            sensor = self.search.sensor
            see = np.array([sensor.baseline, sensor.cosine, sensor.range])
            fly_all(self.search.table, first, second, self.pushes[0], see, *flown)
        else:
            from closeform.search.imperfect import turn_rows
            from closeform.search.imperfect_gather import fly_astray  # imported late: compiles a kernel

            own = turn_rows(self.search), self.craft[some], self.ends[some], self.search.sensor.offset
            fly_astray(self.search.table, first, second, self.pushes[some], *own, *flown)
        count, most = int(results[-1, -1, EVENTS]), int(results[..., MOST].max())
        if (room and count > room) or (most > drawn and wrong.normals is not None):
            more = max(count, room) if room else 0
            return self.fly(positions, velocities, ways, more, some, flaws, max(most, drawn))
        return events[:count], labels, results

    @cached_property
    def turns(self) -> OwnTurns:
        """Turns of each craft."""
        return OwnTurns(self.search, self.groups, self.errors or SearchErrors())

    def pushed(self, leg: int) -> tuple[Floats, Floats]:
        """Return the times at which craft begin a leg (C, N) [s], and their boresights then (C, N, 3)."""
        if self.errors is not None:
            return self.turns.begins[..., leg], self.turns.boresights(leg)
        row = self.search.table[leg]
        sign = np.where(np.array(self.groups) == "A", 1.0, -1.0)
        look = row[STEADY : STEADY + 3] + row[COSINE : COSINE + 3]
        return np.full((1, len(sign)), row[START]), sign[None, :, None] * look

    @cached_property
    def pushes(self) -> Floats:
        """Near-field burns (C, P, 6) of all craft by time, then A before B; C is 1 without errors."""
        order = sorted(range(len(self.groups)), key=lambda k: self.groups[k])
        rows = [np.empty((1 if self.errors is None else len(self.craft), 0, PUSH + 3))]
        for leg in self.drifts:
            times, looks = self.pushed(leg)
            for k in order:
                # a craft that began so early that the leg is over burns at once
                row = [np.maximum(times[:, k], 0.0), *np.full((2, len(times)), [[k], [leg]])]
                rows.append(np.column_stack([*row, -self.push * looks[:, k]])[:, None])
        found = np.concatenate(rows, axis=1)
        late = np.argsort(found[..., WHEN], axis=1, kind="stable")
        return np.ascontiguousarray(np.take_along_axis(found, late[..., None], axis=1))

    @cached_property
    def ends(self) -> Floats:
        """End of each case (C,) [s]: the search is over, and all craft have made their turns."""
        own = self.turns.begins[..., -1].max(axis=-1)
        return np.asarray(np.maximum(own, self.search.duration))

    def begun(self, time: Any) -> Any:
        """Return the number of rounds that have begun by a time."""
        span = self.search.duration / self.rounds
        return np.minimum(np.floor(time / span).astype(np.int64) + 1, self.rounds)


def lost_fleet(
    search: Search,
    groups: Groups,
    shape: tuple[int, ...],
    keep_out: OwnZone | Sequence[OwnZone | None] | PairZones | None,
    rounds: int,
    burns: Burns,
    max_speed: float | None,
    errors: SearchErrors | None,
) -> LostFleet:
    """Return the craft of gatherings (C, N) from the arguments of `gather`.

    Raises ValueError, with the name of the argument, for invalid ones.
    """
    count = shape[1]
    if isinstance(rounds, bool) or not isinstance(rounds, int | np.integer) or not 1 <= rounds <= MOST_ROUNDS:
        raise ValueError(f"rounds: must be a whole number from 1 to {MOST_ROUNDS}, got {shown(rounds)}")
    if not isinstance(burns, str) or burns not in get_args(Burns):
        raise ValueError(f"burns: must be one of {', '.join(get_args(Burns))}, got {shown(burns)}")
    instance("search", search, Search)
    kept = None
    if keep_out is not None:
        cleared(keep_out)
        kept = all_made(pair_zones("keep_out", keep_out, count))
        for zone in kept.zones:
            cleared(zone)
    speed = None if max_speed is None else one_positive("max_speed", max_speed)
    flown, drifts = all_rounds(search, int(rounds), speed)
    own_groups, push, craft = sides(groups, count), 2.0 * (speed or 0.0), np.empty((0, count, 0))
    if errors is not None:
        instance("errors", errors, SearchErrors)
        cases = f" in {shape[0]} cases is (C, N{{}}), (N{{}})" if shape[0] > 1 else " is (N{})"
        asked = f"{count} craft{cases}, or common to all"
        craft = craft_rows(errors, search.sensor, shape, np.array(own_groups) == "B", asked)
        errors = of_each(errors, shape)
    return LostFleet(flown, int(rounds), drifts, own_groups, kept, push, errors, craft)
