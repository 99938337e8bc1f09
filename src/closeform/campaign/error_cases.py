"""Cases of a mission's errors: drawn for each craft, flown as planned, and who comes within what.

A history is the mission as planned, plus each craft's errors at its start and in all that it does; in Hill's
equations they add.  Each craft has a stream of random numbers of its own, keyed by seed and name, so that
case K is the same however many cases and other craft there are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from scipy.special import ndtri

from closeform.arrays import Floats
from closeform.campaign.draws import WORDS, uniform
from closeform.mission import fly
from closeform.mission_result import Mission
from closeform.motion.joining import join, stack
from closeform.motion.path import Path
from closeform.result import Result
from closeform.scenario import Scenario
from closeform.uncertainty.columns import columns_of
from closeform.uncertainty.histories import Histories
from closeform.zones.pair_zones import PairZones, portions

AT_ONCE = 1 << 17  # histories


@dataclass(frozen=True, eq=False)
class PairCases:
    """Two craft by name: in which cases (C,) they begin within the zone, and how often each enters it."""

    first: str
    second: str
    began: Any
    entries: Any

    @property
    def inside(self) -> Any:
        """In which cases (C,) they are ever within it."""
        return self.began | (self.entries > 0)


@dataclass(frozen=True, eq=False, repr=False)
class ErrorCampaign(Result):
    """What became of C cases of a mission's errors, drawn with `seed`.

    `zones` has the pairs that keep a keep-out zone, `bodies` those with hard bodies.
    """

    mission: Mission
    seed: int
    cases: int
    zones: tuple[PairCases, ...]
    bodies: tuple[PairCases, ...]
    _told: ClassVar = ("mission", "seed", "cases", "met", "reason")

    def __len__(self) -> int:
        return self.cases

    @property
    def scenario(self) -> Scenario:
        """What was flown."""
        return self.mission.scenario

    def any_of(self, pairs: tuple[PairCases, ...]) -> Any:
        """In which cases (C,) any of some pairs is ever inside."""
        found = np.zeros(self.cases, dtype=bool)
        for pair in pairs:
            found |= pair.inside
        return found

    @cached_property
    def met(self) -> dict[str, Any]:
        """Of all that is looked for, in which cases (C,) it is so."""
        found = {"clear": ~self.any_of(self.zones)} if self.zones else {}
        return found | ({"free of collisions": ~self.any_of(self.bodies)} if self.bodies else {})

    @cached_property
    def good(self) -> Any:
        """In which cases (C,) all of it is so."""
        return np.all(list(self.met.values()), axis=0)

    @property
    def ok(self) -> bool:
        """Whether the mission was flown, and all cases are clear."""
        return self.mission.stopped is None and bool(self.good.all())

    @property
    def reason(self) -> str | None:
        """In how many cases what is not so; None where all is well."""
        if self.mission.stopped is not None:
            return f"stopped in {self.mission.stopped}"
        parts = [
            f"{int((~met).sum())} of {self.cases} cases not {what}"
            for what, met in self.met.items()
            if not met.all()
        ]
        return "; ".join(parts) or None


def flown(scenario: Scenario, cases: int, seed: int, progress: Callable[[int], None]) -> ErrorCampaign:
    """Fly a mission as planned, and the cases of its errors beside it."""
    mission = fly(scenario)
    results = [result for result in mission.results if result.flown]
    if not results:
        return ErrorCampaign(mission, seed, cases, (), ())
    paths = [join([result.after.path(name) for result in results]) for name in scenario.names]
    columns = [
        None if craft.errors is None else columns_of(path, craft.errors)
        for craft, path in zip(scenario.craft, paths, strict=True)
    ]
    wanted = [
        (kind, zone, i, j)
        for kind, table in enumerate((scenario.zones, scenario.bodies))
        for zone, i, j in pairs(table)
        if columns[i] is not None or columns[j] is not None
    ]
    found: tuple[list[PairCases], list[PairCases]] = ([], [])
    for done, (kind, zone, i, j) in enumerate(wanted, 1):
        names = scenario.names[i], scenario.names[j]
        counts = counted(paths, columns, scenario.names, zone, (i, j), cases, seed)
        found[kind].append(PairCases(*names, counts[:, 0] > 0, counts[:, 1]))
        progress(cases * done // len(wanted))
    return ErrorCampaign(mission, seed, cases, *map(tuple, found))


def pairs(table: PairZones) -> list[tuple[Any, int, int]]:
    """Every pair that has a zone, with it."""
    return [(zone, int(i), int(j)) for zone, *both in portions(table) for i, j in zip(*both, strict=True)]


def counted(
    paths: list[Path],
    columns: list[Path | None],
    names: tuple[str, ...],
    zone: Any,
    pair: tuple[int, int],
    cases: int,
    seed: int,
) -> Any:
    """Whether two craft begin within a zone, and how often they enter, in each case (C, 2)."""
    i, j = pair
    every = [(k, each) for k in pair if (each := columns[k]) is not None]
    known = stack([each[c] for _, each in every for c in range(len(each))])
    histories = Histories.of(paths[i], paths[j], known, 0.0, zone)
    out = np.empty((cases, 2), dtype=np.int64)
    for first in range(0, cases, AT_ONCE):
        last = min(first + AT_ONCE, cases)
        draws = [
            (1.0 if k == i else -1.0) * drawn(seed, names[k], len(each), first, last) for k, each in every
        ]
        out[first:last] = histories.counted(np.ascontiguousarray(np.concatenate(draws, axis=1)))
    return out


def drawn(seed: int, name: str, count: int, first: int, last: int) -> Floats:
    """Normal random numbers (last - first, count) of one craft in some cases."""
    random = uniform(seed, f"errors of {name}", -(-count // WORDS), first, last)
    return np.asarray(ndtri(random.reshape(last - first, -1)[:, :count]))
