"""One kind of case, `(seed, index) -> columns`, and the statistics of such cases.

A kind states which columns its cases have, which requirements they meet and which quantities have a spread.
Chunks, threads, clusters and statistics need nothing else. Case K does not depend on the range, the machine
or the other cases that are evaluated with it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from enum import StrEnum
from functools import cached_property
from math import inf
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from closeform.arrays import Floats
from closeform.campaign.spread import QUANTILES, Spread
from closeform.result import Result
from closeform.scenario import Scenario, ScenarioError

NAMED = 10  # number of failed cases that a message lists

Columns = Mapping[str, Any]
Range = tuple[int, int]
Quantity = Callable[[Columns], Floats]  # a value for each case (C,), nan in cases that do not count


class CaseChunks(Protocol):
    """Cases of a study in chunks."""

    @property
    def count(self) -> int:
        """Number of cases."""
        ...

    def part(self, cases: range) -> Columns:
        """Return the columns of the cases of one chunk."""
        ...


@dataclass(frozen=True, eq=False)
class Cases(ABC):
    """Cases of one kind, determined by a scenario and a seed alone.

    `failures`: the words for a case without each requirement, by its name. `unfinished`: requirements that a
    case must meet to count as ended. `drawn`: columns that are not kept in memory, because seed and case
    number reproduce them.
    """

    scenario: Scenario
    seed: int
    failures: ClassVar[Mapping[str, str]] = {}
    unfinished: ClassVar[tuple[str, ...]] = ()
    drawn: ClassVar[tuple[str, ...]] = ()

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields: a copy, in this or another process, prepares itself."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    @abstractmethod
    def chunk_size(self, count: int) -> int:
        """Return the number of cases in a chunk of a study of `count` cases.

        A chunk takes some tenths of a second; this is the work that an interrupted study loses.
        """

    def ranges(self, count: int) -> Iterator[range]:
        """Yield the cases of each chunk of a study of `count` cases."""
        size = self.chunk_size(count)
        for first in range(0, count, size):
            yield range(first, min(first + size, count))

    @property
    def numbers(self) -> int:
        """Approximate number of values of a case that the Python interface keeps in memory."""
        return 1

    @abstractmethod
    def evaluate(self, first: int, last: int) -> Columns:
        """Return the columns of the cases from `first` to `last`, exclusive.

        Each column has the same number of rows for each case, in the order of cases. nan is an absent number,
        -1 an absent `leg`. Raises ValueError for cases that cannot be evaluated.
        """

    @abstractmethod
    def met(self, columns: Columns) -> dict[str, Any]:
        """Return the cases (C,) in which each requirement is met; True or False if all are equal."""

    def quantities(self) -> dict[str, Quantity]:
        """Return the quantities whose distribution is reported, by label."""
        return {}

    def prepared(self) -> Self:
        """Return the cases with their shared data computed, before threads evaluate any of them."""
        return self

    def columns(self, first: int, last: int) -> Columns:
        """Return the same columns as `evaluate`; report every failure as an error of the scenario."""
        try:
            return self.evaluate(first, last)
        except ScenarioError:
            raise
        except ValueError as error:
            line = f"stage[1]: {error}; change [craft] or its draws"
            raise ScenarioError(self.scenario.file, [line]) from error

    def good(self, count: int, columns: Columns) -> Any:
        """Return in which of `count` cases all requirements are met."""
        found = np.ones(count, dtype=bool)
        for met in self.met(columns).values():
            found &= met
        return found

    def stored(self, first: int, last: int, columns: Columns) -> dict[str, Any]:
        """Return the columns as files hold them, with the case and names instead of indices."""
        return {"case": np.arange(first, last), **columns}

    @abstractmethod
    def campaign(self, chunks: CaseChunks) -> Any:
        """Return the statistics of the cases in the given chunks."""


class CampaignStatus(StrEnum):
    """Status of a campaign: all requirements met, some not met in some cases, or some cases never done."""

    COMPLETE = "complete"
    UNMET = "a clearance or a limit not met"
    INCOMPLETE = "incomplete"


@dataclass
class Met:
    """Number of cases in which a requirement is met, and the first cases in which it is not."""

    count: int = 0
    unmet: list[int] = field(default_factory=list)

    def add(self, cases: range, met: Any) -> None:
        """Count some cases (C,)."""
        met = np.broadcast_to(met, len(cases))
        self.count += int(np.count_nonzero(met))
        self.unmet += [cases[k] for k in np.flatnonzero(~met)[: NAMED - len(self.unmet)].tolist()]


@dataclass
class Tally:
    """Number of cases in which each requirement is `met`, and in which all are, `good`."""

    met: dict[str, Met] = field(default_factory=dict)
    good: Met = field(default_factory=Met)


@dataclass(frozen=True, eq=False, repr=False)
class Statistics(Result):
    """Statistics of C cases of one `kind`, sampled with its seed, stored in `chunks`.

    Counts and spreads are taken chunk after chunk, in memory that does not grow with the number of cases.
    Arrays (C,) are read on request: any `column`, and the cases in which each requirement is `met`.
    """

    kind: Any
    chunks: CaseChunks
    _told: ClassVar[tuple[str, ...]] = ("title", "seed", "status", "reason")

    def __len__(self) -> int:
        return self.chunks.count

    @property
    def scenario(self) -> Scenario:
        """Scenario of the study."""
        found: Scenario = self.kind.scenario
        return found

    @property
    def seed(self) -> int:
        """Seed of the random cases."""
        return int(self.kind.seed)

    @property
    def title(self) -> str:
        """Title of the scenario."""
        return self.scenario.title

    @property
    def as_in_file(self) -> bool:
        """True if the seed in the file produces the same cases."""
        study = self.scenario.study
        return study is not None and study.seed == self.seed

    def parts(self) -> Iterator[tuple[range, Columns]]:
        """Iterate over the chunks: the cases of each, and their columns."""
        for cases in self.kind.ranges(self.chunks.count):
            yield cases, self.chunks.part(cases)

    def column(self, name: str) -> Any:
        """Return one column of all cases."""
        return np.concatenate([part[name] for _, part in self.parts()])

    def total(self, of: Callable[[Columns], Any]) -> Any:
        """Return the sum of the given counts over all chunks."""
        return sum(of(part) for _, part in self.parts())

    def least(self, of: Quantity) -> tuple[float, int] | None:
        """Return the minimum value of a quantity and its case; None if no case has one."""
        best = inf, -1
        for cases, part in self.parts():
            value = np.nan_to_num(of(part), nan=inf, posinf=inf, neginf=-inf)
            best = min(best, (float(value.min()), cases[int(value.argmin())]))
        return best if best[0] < inf else None

    def spread(self, of: Quantity, shares: tuple[float, ...] = QUANTILES) -> Spread | None:
        """Return the spread of a quantity over the cases that have one; None without any."""

        def values() -> Iterator[tuple[Floats, Any]]:
            for cases, part in self.parts():
                value = of(part)
                counts = ~np.isnan(value)
                yield value[counts], cases.start + np.flatnonzero(counts)

        return Spread.of(values, shares)

    def each_spread(self, quantities: Mapping[str, Quantity]) -> dict[str, Spread]:
        """Return the spreads of several quantities, without those that no case has."""
        found = {label: self.spread(of) for label, of in quantities.items()}
        return {label: spread for label, spread in found.items() if spread is not None}

    @cached_property
    def spreads(self) -> dict[str, Spread]:
        """Spreads of the quantities of the cases, by label."""
        return self.each_spread(self.kind.quantities())

    @cached_property
    def tally(self) -> Tally:
        """Number of cases in which each requirement is met."""
        found = Tally()
        for cases, part in self.parts():
            for name, met in self.kind.met(part).items():
                found.met.setdefault(name, Met()).add(cases, met)
            found.good.add(cases, self.kind.good(len(cases), part))
        return found

    @cached_property
    def met(self) -> dict[str, Any]:
        """Cases (C,) in which each requirement is met."""
        parts = [
            {name: np.broadcast_to(met, len(cases)) for name, met in self.kind.met(part).items()}
            for cases, part in self.parts()
        ]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    @cached_property
    def good(self) -> Any:
        """Cases (C,) in which all requirements are met, as in a run with exit status 0."""
        return np.concatenate([self.kind.good(len(cases), part) for cases, part in self.parts()])

    @property
    def failed(self) -> Any:
        """Numbers (F,) of the cases in which they are not."""
        return np.flatnonzero(~self.good)

    @property
    def met_cases(self) -> int:
        """Number of cases in which all requirements are met."""
        return self.tally.good.count

    @property
    def never(self) -> int:
        """Number of cases that never ended."""
        met = self.tally.met
        return sum(len(self) - met[name].count for name in self.kind.unfinished if name in met)

    @property
    def ok(self) -> bool:
        """True if all requirements are met in every case."""
        return self.met_cases == len(self)

    @property
    def status(self) -> CampaignStatus:
        """Status of the campaign."""
        if self.never:
            return CampaignStatus.INCOMPLETE
        return CampaignStatus.COMPLETE if self.ok else CampaignStatus.UNMET

    @property
    def reason(self) -> str | None:
        """Number of cases in which each requirement is not met, and the first of them; None if all are."""
        parts = []
        for name, met in self.tally.met.items():
            if unmet := len(self) - met.count:
                named = ", ".join(map(str, met.unmet)) + ", ..." * (unmet > len(met.unmet))
                parts.append(f"{unmet} of {len(self)} cases {self.kind.failures[name]}: {named}")
        return "; ".join(parts) or None
