"""Stamps: UTC next to the times of a mission, in tables, files and figures, if its epoch is known."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.epochs import Epoch
from closeform.report.section import Section
from closeform.report.table import Column, Table

# Keys of instants in figures, and the keys of their UTC.
INSTANTS = {f"{what}_s": f"{what}_utc" for what in ("time", "start", "end", "failed_at", "until")}


@dataclass(frozen=True)
class Stamps:
    """UTC of instants: a mission's times count from its `epoch`, a stage's times from its `start` [s]."""

    epoch: Epoch
    start: float = 0.0

    def utc(self, times: Sequence[float], since: str, decimals: int = 9) -> list[str]:
        """Return instants in UTC, in ISO format."""
        begin = self.start if since == "stage" else 0.0
        return self.epoch.utc([begin + time for time in times], decimals)

    def column(self, times: Floats, count: int) -> Any:
        """Return instants of a mission in UTC, repeated for `count` spacecraft; equal objects are shared."""
        return np.tile(np.array(self.epoch.utc(times), dtype=object), count)

    def dated(self, table: Table) -> Table:
        """Return a table with UTC next to its instants; all are stored, and the first column is shown."""
        columns: list[Column] = []
        cells: list[list[Any]] = []
        shown = False
        for k, column in enumerate(table.columns):
            columns.append(column)
            cells.append([row[k] for row in table.rows])
            if column.since is None:
                continue
            known = [j for j, time in enumerate(cells[-1]) if time is not None and isfinite(time)]
            times = [cells[-1][j] for j in known]
            if column.key is not None:
                columns.append(Column(None, column.key.removesuffix("_s") + "_utc"))
                cells.append(spread(self.utc(times, column.since), known, len(table.rows)))
            if column.heading is not None and not shown:
                shown = True
                day, stamps = short(self.utc(times, column.since, len(column.form(0.0).partition(".")[2])))
                columns.append(Column(f"UTC {day}".strip(), spare=True))
                cells.append(spread(stamps, known, len(table.rows)))
        return replace(table, columns=tuple(columns), rows=[*zip(*cells, strict=True)])

    def told(self, section: Section, end: float) -> Section:
        """Return the section of a stage that ends at `end` [s], with UTC next to all of its instants."""
        start, stop = self.epoch.utc([self.start, end], 1)
        day, until = start[:10], stop[11:-1] if stop[:10] == start[:10] else stop[:-1].replace("T", " ")
        return replace(
            section,
            title=f"{section.title} ({day} {start[11:-1]} to {until} UTC)",
            tables=tuple(map(self.dated, section.tables)),
            files={name: self.dated(table) for name, table in section.files.items()},
            figures=self.record(section.figures),
        )

    def record(self, figures: Any) -> Any:
        """Return figures for JSON with UTC next to their instants."""
        every: dict[str, list[float]] = {"mission": [], "stage": []}
        for since, time in instants(figures):
            every[since].append(time)
        stamps = {
            (since, time): stamp
            for since, times in every.items()
            for time, stamp in zip(times, self.utc(times, since), strict=True)
        }
        return with_utc(figures, stamps)


def instants(figures: Any, since: str = "mission") -> Iterator[tuple[str, float]]:
    """Yield all instants in figures for JSON; those of a `search` count from the start of the stage."""
    if isinstance(figures, list | tuple):
        for one in figures:
            yield from instants(one, since)
    elif isinstance(figures, dict):
        for key, value in figures.items():
            yield from instants(value, "stage" if key == "search" else since)
            if key in INSTANTS and value is not None and isfinite(value):
                yield since, value


def with_utc(figures: Any, stamps: dict[tuple[str, float], str], since: str = "mission") -> Any:
    """Return figures with the UTC of each of their instants, None if it is unknown."""
    if isinstance(figures, list | tuple):
        return [with_utc(one, stamps, since) for one in figures]
    if not isinstance(figures, dict):
        return figures
    found: dict[str, Any] = {}
    for key, value in figures.items():
        found[key] = with_utc(value, stamps, "stage" if key == "search" else since)
        if key in INSTANTS:
            found[INSTANTS[key]] = stamps.get((since, value))
    return found


def spread(values: Sequence[Any], places: Sequence[int], count: int) -> list[Any]:
    """Return a column of `count` cells with the given values at their places, None elsewhere."""
    cells: list[Any] = [None] * count
    for place, value in zip(places, values, strict=True):
        cells[place] = value
    return cells


def short(stamps: Sequence[str]) -> tuple[str, list[str]]:
    """Return the common day and times of day; without a common day, an empty text and full dates."""
    days = {stamp[:10] for stamp in stamps}
    if len(days) == 1:
        return days.pop(), [stamp[11:-1] for stamp in stamps]
    return "", [f"{stamp[5:10]} {stamp[11:-1]}" for stamp in stamps]
