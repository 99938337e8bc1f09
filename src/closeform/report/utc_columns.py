"""Stamps: UTC beside the times of a mission, in tables, in files and in figures, where its epoch is known."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.epochs import Epoch
from closeform.report.section import Section
from closeform.report.table import Column, Table

# Keys of figures that are instants, and those of their stamps.
INSTANTS = {f"{what}_s": f"{what}_utc" for what in ("time", "start", "end", "failed_at", "until")}


@dataclass(frozen=True)
class Stamps:
    """What instants are in UTC: a mission's count from its `epoch`, a stage's from its `start` [s]."""

    epoch: Epoch
    start: float = 0.0

    def utc(self, times: Sequence[float], since: str, decimals: int = 9) -> list[str]:
        """Instants in UTC, ISO."""
        begin = self.start if since == "stage" else 0.0
        return self.epoch.utc([begin + time for time in times], decimals)

    def column(self, times: Floats, count: int) -> Any:
        """Instants of a mission in UTC, for each of so many craft; objects, of which each is there once."""
        return np.tile(np.array(self.epoch.utc(times), dtype=object), count)

    def dated(self, table: Table) -> Table:
        """A table with UTC beside its instants: stored of all, shown of the first."""
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
        """What is said of a stage, with UTC beside all of its instants; it ends at `end` [s]."""
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
        """Figures for JSON with UTC beside their instants."""
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
    """All instants in figures for JSON; those of a `search` count from its stage."""
    if isinstance(figures, list | tuple):
        for one in figures:
            yield from instants(one, since)
    elif isinstance(figures, dict):
        for key, value in figures.items():
            yield from instants(value, "stage" if key == "search" else since)
            if key in INSTANTS and value is not None and isfinite(value):
                yield since, value


def with_utc(figures: Any, stamps: dict[tuple[str, float], str], since: str = "mission") -> Any:
    """Figures with the stamp of each of their instants, None where that is not known."""
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
    """Cells of which some are known, by their places."""
    cells: list[Any] = [None] * count
    for place, value in zip(places, values, strict=True):
        cells[place] = value
    return cells


def short(stamps: Sequence[str]) -> tuple[str, list[str]]:
    """The day that all have in common, and the times of that day; else none, and each with month and day."""
    days = {stamp[:10] for stamp in stamps}
    if len(days) == 1:
        return days.pop(), [stamp[11:-1] for stamp in stamps]
    return "", [f"{stamp[5:10]} {stamp[11:-1]}" for stamp in stamps]
