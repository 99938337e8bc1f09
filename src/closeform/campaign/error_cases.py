"""Monte Carlo cases of a mission as planned, with sampled errors, and the conflicts that result.

A sampled trajectory is the planned one plus the craft's errors at its start and in its burns; in Hill's
equations they add. Each craft has its own stream of random numbers, keyed by seed and name, so that case K
does not depend on the number of cases or on other craft.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import compress
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from closeform.arrays import Floats
from closeform.campaign.cases import Cases, Columns
from closeform.campaign.executed_mission import drawn
from closeform.campaign.flown_cases import FlownCases
from closeform.campaign.process_noise import ProcessNoise
from closeform.mission.mission import fly
from closeform.mission.mission_result import Mission
from closeform.motion.joining import join, stack
from closeform.motion.path import Path
from closeform.uncertainty.columns import columns_of
from closeform.uncertainty.sampled_trajectories import SampledTrajectories
from closeform.zones.pair_zones import PairZones, portions

if TYPE_CHECKING:
    from closeform.campaign.chunks import CaseChunks
    from closeform.uncertainty.noisy_trajectories import NoisyTrajectories

AT_ONCE = 1 << 15  # cases in a chunk
NUMBERS = 1 << 22  # random numbers of process noise in memory, about
MOST = 10  # worst cases that are kept
BY_PAIR = ("began", "each")  # stored columns of each kind
KINDS = ("zone", "body")
MET = {"zone": "clear", "body": "free of collisions"}


@dataclass(frozen=True, eq=False)
class Meeting:
    """Two craft by index, a zone of theirs, and their sampled trajectories; `kind` is "zone" or "body"."""

    kind: str
    pair: tuple[int, int]
    columns: tuple[int, ...]  # number of error columns of each
    histories: SampledTrajectories | NoisyTrajectories

    def counted(self, names: tuple[str, ...], seed: int, first: int, last: int, shaken: Floats) -> Any:
        """Return for each case (C, 2) whether the pair begins inside the zone, and its number of entries.

        `shaken` (N, C, K, 6): the increments of the states of all craft due to process noise, step by step.
        """
        signs = (1.0, -1.0)
        draws = [
            sign * drawn(seed, names[k], count, first, last)
            for sign, k, count in zip(signs, self.pair, self.columns, strict=True)
            if count
        ]
        errors = np.ascontiguousarray(np.concatenate([np.empty((last - first, 0)), *draws], axis=1))
        if isinstance(self.histories, SampledTrajectories):
            return self.histories.counted(errors)
        one, other = self.pair
        return self.histories.counted(errors, shaken[one] - shaken[other])


@dataclass(frozen=True, eq=False)
class ErrorCases(Cases):
    """Cases of a mission with sampled errors, a row each.

    Columns: `clear`, `free_of_collisions`, `zone_entries`, `body_entries`. For all pairs with a zone, and
    with hard bodies, `zone_began` and `zone_each` (C, P): whether they begin inside, and their number of
    entries.
    """

    @cached_property
    def mission(self) -> Mission:
        """Mission, executed as planned."""
        return fly(self.scenario)

    @cached_property
    def shaking(self) -> ProcessNoise | None:
        """Process noise of the craft; None without any."""
        flown = self.mission.flown
        if not (self.scenario.noisy and flown):
            return None
        return ProcessNoise.beside_zones(self.scenario, self.seed, flown[-1].end)

    @cached_property
    def meetings(self) -> tuple[Meeting, ...]:
        """Pairs of which either craft has errors, with the zones and the hard bodies of the mission."""
        scenario, results = self.scenario, [result for result in self.mission.results if result.flown]
        if not results:
            return ()
        paths = [join([result.after.path(name) for result in results]) for name in scenario.names]
        columns = [
            None if craft.errors is None else columns_of(path, craft.errors)
            for craft, path in zip(scenario.craft, paths, strict=True)
        ]
        return tuple(
            meeting(kind, paths, columns, zone, (i, j), None if self.shaking is None else self.shaking.step)
            for kind, table in zip(KINDS, (scenario.zones, scenario.bodies), strict=True)
            for zone, i, j in pairs(table)
            if columns[i] is not None or columns[j] is not None
        )

    def prepared(self) -> Self:
        """Return the cases with their mission planned."""
        _ = self.meetings
        return self

    @property
    def at_once(self) -> int:
        """Greatest number of cases in a chunk."""
        return AT_ONCE

    def of_kind(self, kind: str) -> list[Meeting]:
        """Return the pairs with a zone, or with hard bodies."""
        return [one for one in self.meetings if one.kind == kind]

    def fly(self, first: int, last: int) -> Columns:
        """Return the conflicts of some cases; with process noise in parts, which limits the memory."""
        if self.shaking is None:
            return self.met_in(first, last, np.empty(0))
        count, craft = self.shaking.steps(self.mission.flown[-1].end), self.scenario.craft
        size = max(1, NUMBERS // (6 * count * len(craft)))
        parts = []
        for begin in range(first, last, size):
            some = begin, min(begin + size, last)
            shaken = np.array([self.shaking.pushes(one, count, *some) for one in craft])
            parts.append(self.met_in(*some, shaken))
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def met_in(self, first: int, last: int, shaken: Floats) -> Columns:
        """Return the conflicts of some cases, given the noise increments `shaken` (N, C, K, 6)."""
        found: Columns = {}
        for kind in KINDS:
            if not (pairs := self.of_kind(kind)):
                continue
            counts = [one.counted(self.scenario.names, self.seed, first, last, shaken) for one in pairs]
            began = np.stack([count[:, 0] > 0 for count in counts], axis=1)
            entries = np.stack([count[:, 1] for count in counts], axis=1)
            found[MET[kind].replace(" ", "_")] = ~(began | (entries > 0)).any(axis=1)
            found |= {f"{kind}_entries": entries.sum(axis=1), f"{kind}_began": began, f"{kind}_each": entries}
        return found

    def good(self, columns: Columns) -> Any:
        """Return the cases in which no pair is ever inside."""
        met = [columns[name] for what in MET.values() if (name := what.replace(" ", "_")) in columns]
        return np.all(met, axis=0) if met else np.zeros(0, dtype=bool)

    def campaign(self, chunks: CaseChunks) -> ErrorCampaign:
        """Return the statistics of the cases."""
        return ErrorCampaign(self, chunks)


def meeting(
    kind: str,
    paths: list[Path],
    columns: list[Path | None],
    zone: Any,
    pair: tuple[int, int],
    step: float | None,
) -> Meeting:
    """Return a pair with its sampled trajectories; process noise acts in steps of length `step` [s]."""
    i, j = pair
    each = [one for one in (columns[k] for k in pair) if one is not None]
    every = [one[c] for one in each for c in range(len(one))]
    known = stack(every) if every else each[0]
    counts = tuple(0 if one is None else len(one) for one in (columns[k] for k in pair))
    if step is None:
        return Meeting(kind, pair, counts, SampledTrajectories.of(paths[i], paths[j], known, 0.0, zone))
    from closeform.uncertainty.noisy_trajectories import NoisyTrajectories  # imported late: compiles a kernel

    return Meeting(kind, pair, counts, NoisyTrajectories.in_steps(paths[i], paths[j], known, 0.0, zone, step))


@dataclass(frozen=True, eq=False)
class PairCases:
    """Two craft by name: the cases (C,) in which they begin inside the zone, and their entries (C,)."""

    first: str
    second: str
    began: Any
    entries: Any

    @property
    def inside(self) -> Any:
        """Cases (C,) in which they are ever inside."""
        return self.began | (self.entries > 0)


@dataclass(frozen=True, eq=False, repr=False)
class ErrorCampaign(FlownCases):
    """Statistics of C cases with sampled errors, drawn with `seed`, held by `chunks`.

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
        kinds = [kind for kind in KINDS if self.kind.of_kind(kind)]
        return {kind: PairCounts.of(self.kind, kind, self.chunks) for kind in kinds}

    @cached_property
    def worst(self) -> tuple[tuple[int, int, str], ...]:
        """Cases with conflicts: their number, entries and pairs; some of those with most entries first."""
        kinds, found = list(self.counts), list[tuple[int, int, str]]()
        pairs = [f"{one} - {other}" for kind in kinds for one, other in self.counts[kind].pairs]
        for first, columns in self.chunks.read(*(f"{kind}_{what}" for kind in kinds for what in BY_PAIR)):
            began, each = (np.hstack([columns[f"{kind}_{what}"] for kind in kinds]) for what in BY_PAIR)
            entries, inside = each.sum(axis=1), began | (each > 0)
            where = np.flatnonzero(inside.any(axis=1))
            for k in where[np.argsort(-entries[where], kind="stable")][:MOST].tolist():
                who = ", ".join(dict.fromkeys(compress(pairs, inside[k])))
                found.append((first + k, int(entries[k]), who))
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
        meetings, names = self.kind.of_kind(kind), (f"{kind}_began", f"{kind}_each")
        if not meetings:
            return ()
        parts = [columns for _, columns in self.chunks.read(*names)]
        began, each = (np.concatenate([columns[name] for columns in parts]) for name in names)
        who = self.scenario.names
        return tuple(
            PairCases(who[one.pair[0]], who[one.pair[1]], began[:, k], each[:, k])
            for k, one in enumerate(meetings)
        )

    @cached_property
    def met(self) -> dict[str, Any]:
        """Cases (C,) in which each requirement is met."""
        found: dict[str, list[Any]] = {what: [] for kind, what in MET.items() if self.kind.of_kind(kind)}
        for _, columns in self.chunks.read(*(what.replace(" ", "_") for what in found)):
            for what in found:
                found[what].append(columns[what.replace(" ", "_")])
        return {what: np.concatenate(parts) for what, parts in found.items()}

    @property
    def good(self) -> Any:
        """Cases (C,) in which all requirements are met."""
        return np.all(list(self.met.values()), axis=0)

    @property
    def ok(self) -> bool:
        """True if the mission was executed and all cases are clear."""
        return self.mission.stopped is None and not any(one.any for one in self.counts.values())

    @property
    def reason(self) -> str | None:
        """Number of cases in which each requirement is not met; None if all are met."""
        if self.mission.stopped is not None:
            return f"stopped in {self.mission.stopped}"
        parts = [
            f"{found.any} of {self.cases} cases not {MET[kind]}"
            for kind, found in self.counts.items()
            if found.any
        ]
        return "; ".join(parts) or None


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

    @classmethod
    def of(cls, cases: ErrorCases, kind: str, chunks: CaseChunks) -> Self:
        """Count the pairs of a kind, chunk after chunk."""
        names = cases.scenario.names
        pairs = tuple((names[one.pair[0]], names[one.pair[1]]) for one in cases.of_kind(kind))
        sums: Any = np.zeros((3, len(pairs)), dtype=np.int64)
        any_inside = any_began = 0
        for _, columns in chunks.read(f"{kind}_began", f"{kind}_each"):
            began, entries = columns[f"{kind}_began"], columns[f"{kind}_each"]
            inside = began | (entries > 0)
            sums += [inside.sum(axis=0), began.sum(axis=0), entries.sum(axis=0)]
            any_inside += int(inside.any(axis=1).sum())
            any_began += int(began.any(axis=1).sum())
        return cls(pairs, any_inside, sums[0], any_began, sums[1], sums[2])


def pairs(table: PairZones) -> list[tuple[Any, int, int]]:
    """Return every pair that has a zone, as zone and indices."""
    return [(zone, int(i), int(j)) for zone, *both in portions(table) for i, j in zip(*both, strict=True)]
