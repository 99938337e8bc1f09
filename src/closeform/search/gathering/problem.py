"""Problem of a gathering: its checked arguments, and its simulation for given choices of burns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import LARGEST, Floats, finite, instance, positive, shown, whole
from closeform.search.gathering.burn_errors import BurnErrors
from closeform.search.gathering.burns import DELTA_V, FIRST, HALF, SECOND, WHEN
from closeform.search.gathering.collision_avoidance import ENLARGED
from closeform.search.gathering.craft_state import EVENT
from closeform.search.gathering.event_simulation import (
    EVENTS,
    MOST,
    PER_CRAFT,
    RESULT,
    simulate_gatherings,
)
from closeform.search.gathering.keep_out_monitor import KeepOutZones
from closeform.search.gathering.lock_prediction import SearchingCraft
from closeform.search.leg import Group
from closeform.search.repeated_search import MOST_ROUNDS, repeated_search
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors, craft_rows, errors_of_each
from closeform.search.slew_profile import SEGMENT, ExecutedTurns
from closeform.uncertainty.random_streams import uniform
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones, all_made, pair_zones
from closeform.zones.shapes import BALL, CUBE
from closeform.zones.zone import Zone

CHOICES = {"second": SECOND, "first": FIRST, "half": HALF}  # of equal costs the first is chosen
FEW = 4  # number of burns of each craft with random numbers at first
Burns = Literal["least", "first", "second", "half"]
Groups = Literal["alternating", "balanced", "bearing"] | Sequence[Group]


@dataclass(frozen=True, eq=False)
class GatheringProblem:
    """Checked arguments of C gatherings of the same N craft.

    `search` is that over all `rounds`, `errors` (C or 1, N) are None without search errors, and `rows` (C or
    1, N, 10 + 2 K) those of kernels. In each of `burn_legs` a lost craft burns `near_field_burn` [m/s].
    Locks are detected every `step` [s], at any time if it is 0. `fixes` (C, K, 2, 3) are normal random
    numbers of the measurements, with K = 0 for exact ones.
    """

    search: Search
    rounds: int
    burn_legs: Any
    groups: tuple[Group, ...]
    keep_out: PairZones | None
    near_field_burn: float
    errors: SearchErrors | None
    rows: Floats
    step: float
    fixes: Floats

    def simulate(
        self,
        positions: Floats,
        velocities: Floats,
        choices: Sequence[str],
        some: Any = slice(None),
        burn_errors: BurnErrors | None = None,
        *,
        room: int = 0,
        sampled: int = FEW,
    ) -> tuple[Floats, Any, Floats]:
        """Simulate gatherings for each of the given choices of burns; they are the cases `some` of all.

        Returns the events (E, 10) of the last case and choice if there is `room` for any, with the locks of
        craft that know each other, the labels (C, N)
        of the last choice, and results (C, choices, RESULT + 8 N). `burn_errors` have random numbers for
        `sampled` burns of each craft; the simulation is repeated if these or the room do not suffice.
        """
        events = np.empty((room, EVENT))
        labels = np.empty(positions.shape[:2], dtype=np.int64)
        results = np.empty((len(positions), len(choices), RESULT + PER_CRAFT * positions.shape[1]))
        wrong = burn_errors or BurnErrors.none(positions.shape[:2])
        simulate_gatherings(
            self._searching(some, room > 0),
            self._zones,
            *wrong.sampled(sampled),
            self.search.sensor._accuracy,
            np.ascontiguousarray(self.fixes[some]),
            np.array([CHOICES[choice] for choice in choices]),
            positions,
            velocities,
            events,
            labels,
            results,
        )
        count, most = int(results[-1, -1, EVENTS]), int(results[..., MOST].max())
        if (room and count > room) or (most > sampled and wrong.normals is not None):
            larger = {"room": max(count, room) if room else 0, "sampled": max(most, sampled)}
            return self.simulate(positions, velocities, choices, some, burn_errors, **larger)
        return events[:count], labels, results

    def _searching(self, some: Any, all_locks: bool) -> SearchingCraft:
        """Return the kernel's arrays for some cases; those that are alike in all cases have a length of 1."""
        all_rows = (self._ends, self._burns, self.rows)
        ends, burns, errors = (rows if len(rows) == 1 else rows[some] for rows in all_rows)
        offset, segments = self.search.sensor.offset, np.empty((2, SEGMENT))
        craft = self.search.table, *self._sides, ends, burns, errors
        return SearchingCraft(*craft, offset, self.step, all_locks, segments)

    @cached_property
    def _sides(self) -> tuple[Any, Any]:
        """Craft of group A, and those of B."""
        groups = np.array(self.groups)
        return np.flatnonzero(groups == "A"), np.flatnonzero(groups == "B")

    @cached_property
    def _zones(self) -> KeepOutZones:
        """Zones of pairs for kernels."""
        kept = self.keep_out or PairZones.of([None] * len(self.groups))
        boxes = np.array([zone.shape == CUBE for zone in kept.zones], dtype=bool)
        both = [(zone.matrix, ENLARGED * np.linalg.inv(zone.matrix)) for zone in kept.zones]
        return KeepOutZones(kept.kinds, kept.table, boxes, np.array(both).reshape(-1, 2, 3, 3))

    @cached_property
    def turns(self) -> ExecutedTurns:
        """Turns of each craft in C or 1 cases."""
        errors = self.errors or errors_of_each(SearchErrors(), (1, len(self.groups)))
        return ExecutedTurns(self.search, self.groups, errors)

    @cached_property
    def _burns(self) -> Floats:
        """Near-field burns (C or 1, P, 6) of all craft by time, then A before B: see `SearchingCraft`."""
        rows = [np.empty((len(self.rows), 0, DELTA_V + 3))]
        for leg in self.burn_legs:
            times, looks = self.turns.begins[..., leg], self.turns.boresights(leg)
            for k in np.concatenate(self._sides):
                # a craft that began so early that the leg is over burns at once
                row = [np.maximum(times[:, k], 0.0), *np.full((2, len(times)), [[k], [leg]])]
                rows.append(np.column_stack([*row, -self.near_field_burn * looks[:, k]])[:, None])
        found = np.concatenate(rows, axis=1)
        order = np.argsort(found[..., WHEN], axis=1, kind="stable")
        return np.ascontiguousarray(np.take_along_axis(found, order[..., None], axis=1))

    @cached_property
    def _ends(self) -> Floats:
        """End of each case (C or 1,) [s]: the search is over, and all craft have made their turns."""
        own = self.turns.begins[..., -1].max(axis=-1)
        return np.asarray(np.maximum(own, self.search.duration))

    def rounds_begun(self, time: Any) -> Any:
        """Return the number of rounds that have begun by a time."""
        span = self.search.duration / self.rounds
        return np.minimum(np.floor(time / span).astype(np.int64) + 1, self.rounds)


def gathering_problem(
    search: Search,
    groups: Groups,
    shape: tuple[int, ...],
    keep_out: OwnZone | Sequence[OwnZone | None] | PairZones | None,
    rounds: int,
    burns: Burns,
    max_speed: float | None,
    errors: SearchErrors | None,
    step: float | None = None,
    seed: int = 0,
    case: int = 0,
    fixes: Floats | None = None,
) -> GatheringProblem:
    """Return the problem of gatherings (C, N) from the arguments of `gather`; `fixes` replace random ones.

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
        check_zone(keep_out)
        kept = all_made(pair_zones("keep_out", keep_out, count))
        for zone in kept.zones:
            check_zone(zone)
    speed = None if max_speed is None else positive("max_speed", max_speed)
    repeated, burn_legs = repeated_search(search, int(rounds), speed)
    own_groups = groups_of(groups, count)
    alike = errors is None or len(instance("errors", errors, SearchErrors).shape) < 2
    each = (1, count) if alike else shape
    cases = f" in {shape[0]} cases is (C, N{{}}), (N{{}})" if shape[0] > 1 else " is (N{})"
    asked = f"{count} craft{cases}, or common to all"
    rows = craft_rows(errors, search.sensor, each, np.array(own_groups) == "B", asked)
    errors = None if errors is None else errors_of_each(errors, each)
    if errors is not None and errors.solar_acceleration.any():
        raise ValueError("errors: solar_acceleration is for lock_times; a gathering moves on straight lines")
    near_field_burn = 2.0 * (speed or 0.0)
    every = 0.0 if step is None else positive("step", step)
    begun = repeated, int(rounds), burn_legs, own_groups
    if fixes is None:
        fixes = random_fixes(search, shape, seed, case)
    return GatheringProblem(*begun, kept, near_field_burn, errors, rows, every, fixes)


def random_fixes(search: Search, shape: tuple[int, ...], seed: int, case: int) -> Floats:
    """Return the random numbers (C, N - 1, 2, 3) of the fixes of gatherings (C, N) from a `case` on.

    They are normal; (C, 0, 2, 3) for a sensor that measures exactly.
    """
    (cases, craft), seed, first = shape, whole("seed", seed), whole("case", case)
    if instance("search", search, Search).sensor._exact:
        return np.empty((cases, 0, 2, 3))
    from scipy.special import ndtri  # imported late: slow to import

    random = uniform(seed, "fixes", 2 * (craft - 1), first, first + cases)
    return np.asarray(ndtri(random[..., :3]).reshape(cases, craft - 1, 2, 3))


def check_zone(zone: Any) -> None:
    """Raise ValueError for a zone that a gathering cannot keep clear."""
    if isinstance(zone, Zone) and zone.shape not in (BALL, CUBE):
        raise ValueError(
            f"keep_out: a gathering requires a Sphere, Ellipsoid or Box, got a {type(zone).__name__}; "
            "give one that encloses it"
        )


def groups_of(groups: Groups, count: int) -> tuple[Group, ...]:
    """Return the group of each craft."""
    if isinstance(groups, str):
        if groups not in ("alternating", "balanced"):
            raise ValueError(
                'groups: must be "alternating", "balanced", "bearing" or one of A, B for each craft, '
                f"got {shown(groups)}"
            )
        middle = (count + 1) // 2  # H03 figure 3: three and two of five
        second = [k % 2 == 1 if groups == "alternating" else k >= middle for k in range(count)]
        return tuple("B" if there else "A" for there in second)
    if not isinstance(groups, Iterable):
        raise ValueError(
            f'groups: must be "alternating", "balanced" or A, B for each craft, got {shown(groups)}'
        )
    given = tuple(groups)
    if len(given) != count:
        raise ValueError(f"groups: expected one for each of {count} craft, got {len(given)}")
    if wrong := [group for group in given if group not in ("A", "B")]:
        raise ValueError(f'groups: each must be "A" or "B", got {shown(wrong[0])}')
    for group in ("A", "B"):
        if group not in given:
            raise ValueError(f"groups: {group} is empty; craft of one group never see each other")
    return given


def ahead(positions: Floats) -> Any:
    """Return which craft (..., N) are in B by bearings: the half ahead along the first boresight of A.

    With hemisphere antennas each craft knows on which side of its body x-y each other is, which ranks all
    along the first boresight. Each pair of A and B then begins with boresights towards each other.
    """
    count = positions.shape[-2]
    order = np.argsort(positions[..., 0], axis=-1, kind="stable")
    return np.argsort(order, axis=-1) >= (count + 1) // 2


def groups_by_bearing(positions: Floats) -> tuple[Group, ...]:
    """Return the groups of one gathering of craft at these positions (N, 3), by bearings."""
    return tuple("B" if there else "A" for there in ahead(positions))


def initial_states(positions: ArrayLike, velocities: ArrayLike, dimensions: int) -> tuple[Floats, Floats]:
    """Return positions and velocities as arrays (C, N, 3) after a check."""
    shape = ("N, 3", "C, N, 3")[dimensions - 2]
    arrays = {"positions": finite("positions", positions), "velocities": finite("velocities", velocities)}
    for name, array in arrays.items():
        if array.ndim != dimensions or array.shape[-1] != 3:
            raise ValueError(f"{name}: expected shape ({shape}), got {array.shape}")
    where, speeds = (np.where(np.abs(array) < 1.0 / LARGEST, 0.0, array) for array in arrays.values())
    if where.shape != speeds.shape:
        raise ValueError(f"velocities: expected the shape of positions, {where.shape}, got {speeds.shape}")
    if where.shape[-2] < 2:
        raise ValueError(f"positions: a gathering requires two craft or more, got {where.shape[-2]}")
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
        raise ValueError(f"positions: craft {i} and {j} are at the same position{place}")
    return np.ascontiguousarray(cases), np.ascontiguousarray(speeds.reshape(cases.shape))
