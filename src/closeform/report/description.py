"""Section: the lines, tables and pictures that describe a result on the terminal, the page and in files."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, isnan
from textwrap import shorten
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.epochs import Epoch
from closeform.mission.mission_result import StageResult
from closeform.mission.verdict import MOST_NAMES
from closeform.report.picture import Picture

if TYPE_CHECKING:
    from closeform.planning.plan import Plan

STATE_COLUMNS = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")
TOTAL = "all"  # the name of the last row for all spacecraft
MOST_ROWS = 40  # in a table on the terminal; longer tables are summarised there and shown on the page


@dataclass(frozen=True)
class Column:
    """Column of a table.

    `heading` includes the unit; None for a column that is stored and not shown.  `key`: name in stored
    files, in SI, with the unit as in `start_s`; None for a column that is only shown.  `form` formats a
    value, multiplied by `scale`, as text; `absent` replaces a missing value.  `words`: text, aligned left;
    numbers are aligned right.  `parts` names the values of a cell of several values: Parquet stores these,
    JSON the whole under the `key` if there is one.  `since`: origin of times, in a column of instants.
    `spare`: True for a column that is omitted if there is no room for it.  On the page, a cell of a column
    with `links` is a link to the file it names, and a cell of a column with `judges` is marked good if true
    and bad if false.
    """

    heading: str | None
    key: str | None = None
    form: Callable[..., str] = str
    scale: float = 1.0
    absent: str = "-"
    words: bool = False
    parts: tuple[str, ...] = ()
    since: Literal["mission", "stage"] | None = None
    spare: bool = False
    links: bool = False
    judges: bool = False

    def text(self, cell: Any) -> str:
        """Return a cell as text; a string is returned unchanged."""
        if isinstance(cell, str):
            return cell
        if missing(cell):
            return self.absent
        if self.parts:
            return self.form(*cell)
        return self.form(cell if self.scale == 1.0 else cell * self.scale)


@dataclass(frozen=True)
class Table:
    """Table with a title; `folded` ones are collapsed on the page and omitted from the terminal.

    Several rows of zeros are shown as one, such as "6 of 8 craft: no thrust used", where `idle` holds the
    last words.
    """

    title: str
    columns: tuple[Column, ...]
    rows: Sequence[tuple[Any, ...]]
    folded: bool = False
    idle: str = ""

    @property
    def places(self) -> list[int]:
        """Indices of the columns that are shown.

        A column without a heading is not shown, nor is a column without any value, unless its `absent` states
        the meaning.
        """
        found = []
        for k, column in enumerate(self.columns):
            known = any(not missing(row[k]) for row in self.rows) or column.absent not in ("-", "")
            if column.heading is not None and (known or not self.rows):
                found.append(k)
        return found

    @property
    def shown(self) -> tuple[Column, ...]:
        """The columns that are shown."""
        return tuple(self.columns[k] for k in self.places)

    @property
    def texts(self) -> list[list[str]]:
        """The shown cells as text, row by row."""
        return [
            [column.text(cell) for column, cell in zip(self.shown, row, strict=True)] for row in self.cells
        ]

    @property
    def cells(self) -> list[list[Any]]:
        """The values of the shown cells, row by row."""
        places = self.places
        cells = [[row[k] for k in places] for row in self.rows]
        kept = [row for row in cells if any(isinstance(cell, int | float) and cell for cell in row[1:])]
        total = [row for row in kept if row[0] == TOTAL]
        count, zeros = len(cells) - len(total), len(cells) - len(kept)
        if not self.idle or zeros < 2 or not kept:
            return cells
        line = [f"{zeros} of {count} craft: {self.idle}", *[""] * (len(places) - 1)]
        return [*(row for row in kept if row[0] != TOTAL), line, *total]

    @property
    def records(self) -> list[dict[str, Any]]:
        """The rows for JSON."""
        return [record(self.columns, row) for row in self.rows]

    @property
    def stored(self) -> dict[str, list[Any]]:
        """The columns for Parquet, null where a value is missing; present even without rows."""
        found: dict[str, list[Any]] = {}
        for k, column in enumerate(self.columns):
            cells = [row[k] for row in self.rows]
            for place, part in enumerate(column.parts):
                found[part] = [None if cell is None else cell[place] for cell in cells]
            if column.key is not None and not column.parts:
                found[column.key] = cells
        return found


def missing(cell: Any) -> bool:
    """Return True for a cell without a value."""
    return cell is None or (isinstance(cell, float) and isnan(cell))


def some_of(names: Sequence[str]) -> str:
    """Return the first names, and the number of the others."""
    return ", ".join(names[:MOST_NAMES]) + f" and {len(names) - MOST_NAMES} more" * (len(names) > MOST_NAMES)


def record(columns: Iterable[Column], row: Iterable[Any]) -> dict[str, Any]:
    """Return one row for JSON, as values by key."""
    found: dict[str, Any] = {}
    for column, cell in zip(columns, row, strict=True):
        if column.key is not None:
            found[column.key] = list(cell) if column.parts else cell
        elif column.parts:
            found |= zip(column.parts, cell or [None] * len(column.parts), strict=True)
    return found


PAIR = Column("pair", "pair", "{} - {}".format, words=True, parts=("first", "second"))
AT = Column("at [s]", "time_s", "{:.3f}".format, since="mission")
PHASE = Column("phase", None, "{} {}".format, words=True, parts=("phase", "round"))


def minutes(time: float) -> str:
    """Return a time [s] as min:s, rounded to a second."""
    whole = round(time)
    return f"{whole // 60}:{whole % 60:02d}"


def counted(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun in singular or plural."""
    return f"{number} {one if number == 1 else many or one + 's'}"


REASON = 60  # maximum characters of the reason for a failure, in a picture


@dataclass(frozen=True)
class Section:
    """Section on a stage: `lines`, the `tables` that are shown, `closing` lines and `pictures`.

    `figures` go into `summary.json`; the rows of `files` are appended to the Parquet file of that name.
    `listing` is a text that the page shows as it is.
    """

    title: str
    lines: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    closing: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()
    figures: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, Table] = field(default_factory=dict)
    listing: str = ""


def plan_of(result: StageResult[Any, Any]) -> "Plan | None":
    """Return the avoidance plan of a stage, of one spacecraft or of many; None for any other stage."""
    found: Plan | None = getattr(result.result, "plan", None)
    return found


def called(result: StageResult[Any, Any]) -> str:
    """Return the number, the name and the verb of a stage."""
    named = f' "{result.stage.name}"' if result.stage.name else ""
    return f"Stage {result.number}{named}: {result.stage.verb}"


def heading(result: StageResult[Any, Any], moving: str = "") -> str:
    """Return the title of a stage, with the spacecraft that move."""
    return f"{', '.join(filter(None, (called(result), moving)))}, {result.start:.1f} s to {result.end:.1f} s"


def fate(result: StageResult[Any, Any]) -> str:
    """Return the stage of a picture, with the reason if it failed."""
    if result.failure is None:
        return called(result)
    shown = "" if result.executed else "; shown are the direct paths, not executed"
    return f"{called(result)} failed: {in_short(result.failure)}{shown}"


def in_short(reason: str) -> str:
    """Return the first part of a reason for a failure, in at most REASON characters."""
    return shorten(re.split("[:;]", reason)[0], REASON, placeholder=" …")


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
            if column.heading is not None and known and not shown:
                shown = True
                day, stamps = without_day(
                    self.utc(times, column.since, len(column.form(0.0).partition(".")[2]))
                )
                columns.append(Column(f"UTC {day}".strip(), spare=True))
                cells.append(spread(stamps, known, len(table.rows)))
        return replace(table, columns=tuple(columns), rows=[*zip(*cells, strict=True)])

    def stage(self, section: Section, end: float) -> Section:
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

    def record(self, figures: Any, since: str = "mission") -> Any:
        """Return figures for JSON with the UTC of their instants, None if it is unknown.

        Instants of a `search` count from the start of the stage.
        """
        if isinstance(figures, list | tuple):
            return [self.record(one, since) for one in figures]
        if not isinstance(figures, Mapping):
            return figures
        found: dict[str, Any] = {}
        for key, one in figures.items():
            found[key] = self.record(one, "stage" if key == "search" else since)
            if key in INSTANTS:
                known = one is not None and isfinite(one)
                found[INSTANTS[key]] = self.utc([one], since)[0] if known else None
        return found


def state_columns(names: Sequence[str], times: Floats, states: Floats, epoch: Epoch | None) -> dict[str, Any]:
    """Return states (N, T, 6) of spacecraft at times (T,) [s] as columns for Parquet, with UTC if known."""
    utc = {}
    if epoch is not None:  # equal objects are shared
        utc["time_utc"] = np.tile(np.array(epoch.utc(times), dtype=object), len(names))
    return {
        "craft": np.repeat(names, len(times)),
        "time_s": np.tile(times, len(names)),
        **utc,
        **dict(zip(STATE_COLUMNS, states.reshape(-1, 6).T, strict=True)),
    }


def spread(values: Sequence[Any], places: Sequence[int], count: int) -> list[Any]:
    """Return a column of `count` cells with the given values at their places, None elsewhere."""
    cells: list[Any] = [None] * count
    for place, value in zip(places, values, strict=True):
        cells[place] = value
    return cells


def without_day(stamps: Sequence[str]) -> tuple[str, list[str]]:
    """Return the common day and times of day; without a common day, an empty text and full dates."""
    days = {stamp[:10] for stamp in stamps}
    if len(days) == 1:
        return days.pop(), [stamp[11:-1] for stamp in stamps]
    return "", [f"{stamp[5:10]} {stamp[11:-1]}" for stamp in stamps]
