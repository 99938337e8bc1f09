"""Cases of a parameter sweep: the same cases at each point, one point after another, and their statistics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from closeform.campaign.cases import CampaignStatus, CaseChunks, Cases, Columns, Range, Statistics
from closeform.campaign.spread import Spread
from closeform.confidence import Estimate, estimate
from closeform.scenario.study import text, words

NAMED = 3  # number of points that a message lists


@dataclass(frozen=True, eq=False)
class SweepCases(Cases):
    """`each` cases at each point of a sweep, of one kind per point, sampled with the same random numbers.

    Files have a column `point`, and number the `case` within it.
    """

    kinds: tuple[Any, ...]
    each: int

    def chunk_size(self, count: int) -> int:
        """Return the largest number of cases in a chunk, which are all at one point."""
        return int(self.kinds[0].chunk_size(self.each))

    def ranges(self, count: int) -> Iterator[range]:
        """Yield the cases of each chunk, point after point."""
        for begin in range(0, count, self.each):
            for cases in self.kinds[begin // self.each].ranges(self.each):
                yield range(begin + cases.start, begin + cases.stop)

    def evaluate(self, first: int, last: int) -> Columns:
        """Return the results of the given cases, which are at one point."""
        found: Columns = self.kinds[first // self.each].columns(*self.within_point(first, last))
        return found

    def within_point(self, first: int, last: int) -> Range:
        """Return the numbers of the given cases at their point."""
        begin = first // self.each * self.each
        return first - begin, last - begin

    def met(self, columns: Columns) -> dict[str, Any]:
        """Return the cases (C,) in which each requirement is met."""
        found: dict[str, Any] = self.kinds[0].met(columns)
        return found

    def stored(self, first: int, last: int, columns: Columns) -> dict[str, Any]:
        """Return the table of the point, with its number."""
        point = first // self.each
        table = self.kinds[point].stored(*self.within_point(first, last), columns)
        return {"point": np.full(len(next(iter(table.values()))), point), **table}

    def campaign(self, chunks: CaseChunks) -> SweepCampaign:
        """Return the statistics of the cases."""
        return SweepCampaign(self, chunks)


@dataclass(frozen=True, eq=False)
class PointChunks:
    """Chunks of one `point` of a sweep, of `count` cases."""

    count: int
    chunks: CaseChunks
    point: int

    def part(self, cases: range) -> Columns:
        """Return the columns of the cases of one chunk."""
        begin = self.point * self.count
        return self.chunks.part(range(begin + cases.start, begin + cases.stop))


class Point(NamedTuple):
    """Statistics at one point: its `values` by key, its `campaign`, and the fraction of good cases.

    `name` and `spread` describe the times or the delta-v of its cases; they are None if no case is done.
    """

    values: dict[str, str]
    campaign: Any
    met: Estimate
    met_cases: int
    name: str | None
    spread: Spread | None


@dataclass(frozen=True, eq=False, repr=False)
class SweepCampaign(Statistics):
    """Statistics of a sweep at its `points`, sampled with a seed; the last key varies fastest.

    Its `scenario` holds all values except the swept ones.
    """

    kind: SweepCases
    _told: ClassVar = ("title", "seed", "points", "status", "reason")

    def __len__(self) -> int:
        return self.kind.each

    @cached_property
    def points(self) -> tuple[Point, ...]:
        """Statistics at each point."""
        found = []
        for number, kind in enumerate(self.kind.kinds):
            campaign = kind.campaign(PointChunks(len(self), self.chunks, number))
            count = campaign.met_cases
            name, spread = next(iter(campaign.spreads.items()), (None, None))
            values = {key: text(value) for key, value in kind.scenario.point.items()}
            found.append(Point(values, campaign, estimate(count, len(self)), count, name, spread))
        return tuple(found)

    @property
    def ok(self) -> bool:
        """True if all requirements are met in every case at every point."""
        return all(point.met_cases == len(self) for point in self.points)

    @property
    def status(self) -> CampaignStatus:
        """Status of the campaign."""
        found = {point.campaign.status for point in self.points}
        return next(one for one in reversed(CampaignStatus) if one in found)

    @property
    def reason(self) -> str | None:
        """Number of points at which a requirement is not met, and the first of them; None if all are met."""
        wrong = [point for point in self.points if point.met_cases < len(self)]
        if not wrong:
            return None
        named = "; ".join(words(point.values) for point in wrong[:NAMED]) + "; ..." * (len(wrong) > NAMED)
        return f"not met in every case at {len(wrong)} of {len(self.points)} points: {named}"
