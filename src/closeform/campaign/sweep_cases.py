"""Cases of a parameter sweep: the same cases at each point, one point after another, and their statistics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from closeform.campaign.cases import Cases, Columns, Range
from closeform.campaign.chunk import column
from closeform.campaign.chunks import CaseChunks
from closeform.campaign.flown_cases import FlownCases
from closeform.campaign.search_campaign import CampaignStatus
from closeform.campaign.spread import Spread
from closeform.confidence import Estimate, estimate
from closeform.scenario.sweep import text, words

NAMED = 3  # number of points that a message lists


@dataclass(frozen=True, eq=False)
class SweepCases(Cases):
    """`each` cases at each point of a sweep, of one kind per point, drawn with the same random numbers.

    Files have a column `point`, and number the `case` within it.
    """

    kinds: tuple[Any, ...]
    each: int

    @property
    def at_once(self) -> int:
        """Greatest number of cases in a chunk."""
        return int(self.kinds[0].at_once)

    def in_chunk(self, count: int) -> int:
        """Return the number of cases in a chunk of a study of `count` cases."""
        return min(self.at_once, int(self.kinds[0].in_chunk(count)))

    def parts(self, first: int, last: int) -> Iterator[tuple[int, int, int]]:
        """Yield the points in a range of all cases, with the range of cases at each."""
        for point in range(first // self.each, (last - 1) // self.each + 1):
            begin = point * self.each
            yield point, max(first - begin, 0), min(last - begin, self.each)

    def fly(self, first: int, last: int) -> Columns:
        """Return the results of some cases, point after point."""
        found = [self.kinds[point].flown(*some) for point, *some in self.parts(first, last)]
        return {name: np.concatenate([part[name] for part in found]) for name in found[0]}

    def good(self, columns: Columns) -> Any:
        """Return the cases in which all requirements are met."""
        return self.kinds[0].good(columns)

    def stored(self, first: int, last: int, columns: Columns) -> Columns:
        """Return the tables of the points, with their numbers."""
        import pyarrow

        rows = len(next(iter(columns.values()))) // (last - first)
        tables, done = [], 0
        for point, begin, end in self.parts(first, last):
            some = slice(done * rows, (done + end - begin) * rows)
            own = {name: values[some] for name, values in columns.items()}
            own = self.kinds[point].stored(begin, end, own)
            number = np.full((end - begin) * rows, point)
            tables.append(
                pyarrow.table({name: column(values) for name, values in {"point": number, **own}.items()})
            )
            done += end - begin
        whole = pyarrow.concat_tables(tables).combine_chunks()
        return {name: whole[name].chunk(0) for name in whole.column_names}

    def campaign(self, chunks: CaseChunks) -> SweepCampaign:
        """Return the statistics of the cases."""
        return SweepCampaign(self, chunks)


@dataclass(frozen=True, eq=False)
class PointChunks:
    """Chunks of one `point` of a sweep, of `count` cases."""

    cases: SweepCases
    chunks: CaseChunks
    point: int

    @property
    def count(self) -> int:
        """Number of cases."""
        return self.cases.each

    def read(self, *names: str, within: Range | None = None) -> Iterator[tuple[int, Columns]]:
        """Iterate over the named columns of this point's part of each chunk."""
        begin = self.point * self.count
        for first, columns in self.chunks.read(*names, within=(begin, begin + self.count)):
            last = min(first + self.cases.in_chunk(self.chunks.count), self.chunks.count)
            low, high = max(begin - first, 0), min(begin + self.count, last) - first
            own = {}
            for name, values in columns.items():
                rows = len(values) // (last - first)
                own[name] = values[low * rows : high * rows]
            yield first + low - begin, own


class Point(NamedTuple):
    """Statistics at one point: its `values` by key, its `campaign`, the share of cases that meet all.

    `name` and `spread`: of the times or the delta-v of its cases; None if none was done.
    """

    values: dict[str, str]
    campaign: Any
    met: Estimate
    met_cases: int
    name: str | None
    spread: Spread | None


@dataclass(frozen=True, eq=False, repr=False)
class SweepCampaign(FlownCases):
    """Statistics of a sweep, drawn with a seed, at its `points`; the last key varies fastest.

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
            campaign = kind.campaign(PointChunks(self.kind, self.chunks, number))
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
        for status in (CampaignStatus.INCOMPLETE, CampaignStatus.UNMET):
            if status in found:
                return status
        return CampaignStatus.COMPLETE

    @property
    def reason(self) -> str | None:
        """Number of points at which a requirement is not met, and the first of them; None if all are met."""
        wrong = [point for point in self.points if point.met_cases < len(self)]
        if not wrong:
            return None
        named = "; ".join(words(point.values) for point in wrong[:NAMED]) + "; ..." * (len(wrong) > NAMED)
        return f"not met in every case at {len(wrong)} of {len(self.points)} points: {named}"
