"""Cases of a mission as planned, with sampled errors and the conflicts that result, and their statistics.

A sampled trajectory is the planned one plus the craft's errors at its start and in its burns; in Hill's
equations they add. Each craft has its own stream of random numbers, keyed by seed and name, so that case K
does not depend on the number of cases or on other craft.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import compress
from typing import Any, ClassVar, Self

import numpy as np

from closeform.arrays import Floats
from closeform.campaign.cases import CaseChunks, Cases, Columns, Statistics
from closeform.mission.executed_mission import ProcessNoise, drawn
from closeform.mission.mission import plan_mission
from closeform.mission.mission_result import Mission
from closeform.motion.joining import join, stack
from closeform.motion.path import Path
from closeform.uncertainty.collision.sampled_trajectories import SampledTrajectories
from closeform.uncertainty.error_columns import columns_of
from closeform.zones.pair_zones import portions

AT_ONCE = 1 << 15  # cases in a chunk
NUMBERS = 1 << 22  # random numbers of process noise in memory, about
MOST = 10  # worst cases that are kept
MET = {"zone": "clear", "body": "free of collisions"}  # requirement by kind of pair


@dataclass(frozen=True, eq=False)
class Encounter:
    """Two craft by index with a zone or hard bodies, and their sampled trajectories."""

    pair: tuple[int, int]
    columns: tuple[int, ...]  # number of error columns of each
    sampled: SampledTrajectories

    @classmethod
    def of(
        cls,
        paths: list[Path],
        columns: list[Path | None],
        zone: Any,
        pair: tuple[int, int],
        step: float | None,
    ) -> Self:
        """Return a pair with its sampled trajectories; process noise acts in steps of length `step` [s]."""
        i, j = pair
        each = [one for one in (columns[k] for k in pair) if one is not None]
        every = [one[c] for one in each for c in range(len(one))]
        known = stack(every) if every else each[0]
        counts = tuple(0 if one is None else len(one) for one in (columns[k] for k in pair))
        return cls(pair, counts, SampledTrajectories.of(paths[i], paths[j], known, 0.0, zone, step))

    def counted(self, names: tuple[str, ...], seed: int, first: int, last: int, noise: Floats) -> Any:
        """Return for each case (C, 2) whether the pair begins inside the zone, and its number of entries.

        `noise` (N, C, K, 6): the increments of the states of all craft due to process noise, step by step.
        """
        draws = [
            sign * drawn(seed, names[k], count, first, last)
            for sign, k, count in zip((1.0, -1.0), self.pair, self.columns, strict=True)
            if count
        ]
        errors = np.ascontiguousarray(np.concatenate([np.empty((last - first, 0)), *draws], axis=1))
        if self.sampled.step is None:
            return self.sampled.count(errors)
        one, other = self.pair
        return self.sampled.count(errors, noise[one] - noise[other])


@dataclass(frozen=True, eq=False)
class ErrorCases(Cases):
    """Cases of a mission with sampled errors, a row each.

    Columns: `clear`, `free_of_collisions`, `zone_entries`, `body_entries`. For all pairs with a zone, and
    with hard bodies, `zone_began` and `zone_each` (C, P): whether they begin inside, and their number of
    entries.
    """

    failures: ClassVar = {what: f"not {what}" for what in MET.values()}

    @cached_property
    def mission(self) -> Mission:
        """Mission, executed as planned."""
        return plan_mission(self.scenario)

    @cached_property
    def noise(self) -> ProcessNoise | None:
        """Process noise of the craft; None without any."""
        executed = self.mission.executed
        if not (self.scenario.noisy and executed):
            return None
        return ProcessNoise.beside_zones(self.scenario, self.seed, executed[-1].end)

    @cached_property
    def encounters(self) -> dict[str, list[Encounter]]:
        """Pairs of which either craft has errors, by kind: "zone", and "body" for hard bodies."""
        scenario, executed = self.scenario, self.mission.executed
        if not executed:
            return {}
        paths = [join([result.after.path(name) for result in executed]) for name in scenario.names]
        columns = [
            None if craft.errors is None else columns_of(path, craft.errors)
            for craft, path in zip(scenario.craft, paths, strict=True)
        ]
        step = None if self.noise is None else self.noise.step
        found = {
            kind: [
                Encounter.of(paths, columns, zone, (int(i), int(j)), step)
                for zone, *both in portions(table)
                for i, j in zip(*both, strict=True)
                if columns[i] is not None or columns[j] is not None
            ]
            for kind, table in (("zone", scenario.zones), ("body", scenario.bodies))
        }
        return {kind: pairs for kind, pairs in found.items() if pairs}

    def prepared(self) -> Self:
        """Return the cases with their mission planned."""
        _ = self.encounters
        return self

    def pairs(self, kind: str) -> tuple[tuple[str, str], ...]:
        """Return the names of the pairs of a kind."""
        names = self.scenario.names
        return tuple((names[one.pair[0]], names[one.pair[1]]) for one in self.encounters[kind])

    def chunk_size(self, count: int) -> int:
        """Return the number of cases in a chunk."""
        return AT_ONCE

    def evaluate(self, first: int, last: int) -> Columns:
        """Return the conflicts of the given cases; with process noise in parts, which limits the memory."""
        if self.noise is None:
            return self.conflicts(first, last, np.empty(0))
        count, craft = self.noise.steps(self.mission.executed[-1].end), self.scenario.craft
        size = max(1, NUMBERS // (6 * count * len(craft)))
        parts = []
        for begin in range(first, last, size):
            some = begin, min(begin + size, last)
            noise = np.array([self.noise.pushes(one, count, *some) for one in craft])
            parts.append(self.conflicts(*some, noise))
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def conflicts(self, first: int, last: int, noise: Floats) -> Columns:
        """Return the conflicts of the given cases, given the noise increments (N, C, K, 6)."""
        found: dict[str, Any] = {}
        for kind, pairs in self.encounters.items():
            counts = [one.counted(self.scenario.names, self.seed, first, last, noise) for one in pairs]
            began = np.stack([count[:, 0] > 0 for count in counts], axis=1)
            entries = np.stack([count[:, 1] for count in counts], axis=1)
            found[MET[kind].replace(" ", "_")] = ~(began | (entries > 0)).any(axis=1)
            found |= {f"{kind}_entries": entries.sum(axis=1), f"{kind}_began": began, f"{kind}_each": entries}
        return found

    def met(self, columns: Columns) -> dict[str, Any]:
        """Return, for each kind of pairs, the cases (C,) in which no pair has a conflict."""
        return {MET[kind]: columns[MET[kind].replace(" ", "_")] for kind in self.encounters}

    def campaign(self, chunks: CaseChunks) -> ErrorCampaign:
        """Return the statistics of the cases."""
        return ErrorCampaign(self, chunks)


@dataclass(frozen=True, eq=False)
class PairCases:
    """Two craft by name: the cases (C,) in which they begin inside the zone, and their entries (C,)."""

    first: str
    second: str
    began: Any
    entries: Any

    @property
    def inside(self) -> Any:
        """Cases (C,) in which the pair has a conflict."""
        return self.began | (self.entries > 0)


@dataclass(frozen=True, eq=False)
class PairCounts:
    """Counts over all cases of P `pairs` of craft by name.

    The number of cases in which each pair is ever `inside` (P,), and in which `any` is; those in which they
    `began` inside (P,) and `any_began`; the number of `entries` (P,).
    """

    pairs: tuple[tuple[str, str], ...]
    any: int
    inside: Any
    any_began: int
    began: Any
    entries: Any


@dataclass(frozen=True, eq=False, repr=False)
class ErrorCampaign(Statistics):
    """Statistics of C cases with errors sampled with `seed`.

    `counts`: "zone" and "body" to the counts of their pairs; a kind without pairs is absent.
    """

    kind: ErrorCases
    _told: ClassVar = ("mission", "seed", "cases", "met", "reason")

    @property
    def cases(self) -> int:
        """Number of cases."""
        return len(self)

    @property
    def mission(self) -> Mission:
        """Mission as planned."""
        return self.kind.mission

    @cached_property
    def counts(self) -> dict[str, PairCounts]:
        """Counts of each kind of pairs."""

        def counted(kind: str) -> PairCounts:
            def sums(part: Columns) -> Any:
                began, entries = part[f"{kind}_began"], part[f"{kind}_each"]
                inside = began | (entries > 0)
                each = (inside, began, entries)
                return np.array([np.append(one.sum(axis=0), one.any(axis=1).sum()) for one in each])

            inside, began, entries = self.total(sums)
            each = inside[:-1], int(began[-1]), began[:-1], entries[:-1]
            return PairCounts(self.kind.pairs(kind), int(inside[-1]), *each)

        return {kind: counted(kind) for kind in self.kind.encounters}

    @cached_property
    def worst(self) -> tuple[tuple[int, int, str], ...]:
        """Cases with conflicts: their number, entries and pairs; some of those with most entries first."""
        kinds, found = list(self.kind.encounters), list[tuple[int, int, str]]()
        pairs = [" - ".join(pair) for kind in kinds for pair in self.kind.pairs(kind)]
        for cases, part in self.parts() if kinds else ():
            began = np.hstack([part[f"{kind}_began"] for kind in kinds])
            each = np.hstack([part[f"{kind}_each"] for kind in kinds])
            entries, inside = each.sum(axis=1), began | (each > 0)
            where = np.flatnonzero(inside.any(axis=1))
            for k in where[np.argsort(-entries[where], kind="stable")][:MOST].tolist():
                named = ", ".join(dict.fromkeys(compress(pairs, inside[k])))
                found.append((cases[k], int(entries[k]), named))
            found = sorted(found, key=lambda row: (-row[1], row[0]))[:MOST]
        return tuple(found)

    @cached_property
    def zones(self) -> tuple[PairCases, ...]:
        """Pairs that keep a keep-out zone."""
        return self.pairs("zone")

    @cached_property
    def bodies(self) -> tuple[PairCases, ...]:
        """Pairs with hard bodies."""
        return self.pairs("body")

    def pairs(self, kind: str) -> tuple[PairCases, ...]:
        """Return the pairs of a kind, case by case."""
        if kind not in self.kind.encounters:
            return ()
        began, each = self.column(f"{kind}_began"), self.column(f"{kind}_each")
        return tuple(
            PairCases(*names, began[:, k], each[:, k]) for k, names in enumerate(self.kind.pairs(kind))
        )

    @property
    def ok(self) -> bool:
        """True if the mission was executed and all cases are clear."""
        return self.mission.stopped is None and super().ok

    @property
    def reason(self) -> str | None:
        """Number of cases in which each requirement is not met; None if all are met."""
        return super().reason if self.mission.stopped is None else f"stopped in {self.mission.stopped}"
