"""Table: rows of numbers and names, with the heading and the format of each column.

The terminal, the HTML page, Parquet and `summary.json` use the same rows.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import isnan
from typing import Any, Literal

STATE_COLUMNS = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")
MOST_ROWS = 40  # in a table on the terminal; longer tables are summarised there and shown on the page


@dataclass(frozen=True)
class Column:
    """Column of a table.

    `heading` includes the unit; None for a column that is stored and not shown.  `key`: name in stored
    files, in SI, with the unit as in `start_s`; None for a column that is only shown.  `form` formats a
    value, times `scale`, as text; `absent` stands in for a missing value.  `words`: text, aligned left;
    numbers are aligned right.  `parts` names the values of a cell of several values: Parquet stores these,
    JSON the whole under the `key` if there is one.  `since`: origin of times, in a column of instants.
    `spare`: left out if there is no room for it.  On the page, a cell of a column with `links` is a link
    to the file it names, and a cell of a column with `judges` is marked good if true and bad if false.
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
        if cell is None or (isinstance(cell, float) and isnan(cell)):
            return self.absent
        if self.parts:
            return self.form(*cell)
        return self.form(cell if self.scale == 1.0 else cell * self.scale)


@dataclass(frozen=True)
class Table:
    """Table with a title; `folded` ones are collapsed on the page and omitted from the terminal."""

    title: str
    columns: tuple[Column, ...]
    rows: Sequence[tuple[Any, ...]]
    folded: bool = False

    @property
    def shown(self) -> tuple[Column, ...]:
        """The columns that are shown."""
        return tuple(column for column in self.columns if column.heading is not None)

    @property
    def texts(self) -> list[list[str]]:
        """The shown cells as text, row by row."""
        return [
            [column.text(cell) for column, cell in zip(self.shown, row, strict=True)] for row in self.cells
        ]

    @property
    def cells(self) -> list[list[Any]]:
        """The values of the shown cells, row by row."""
        places = [k for k, column in enumerate(self.columns) if column.heading is not None]
        return [[row[k] for k in places] for row in self.rows]

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
PHASE = Column("phase", None, "{} {}".format, words=True, parts=("phase", "round"))


def minutes(time: float) -> str:
    """Return a time [s] as min:s, rounded to a second."""
    whole = round(time)
    return f"{whole // 60}:{whole % 60:02d}"


def counted(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun in singular or plural."""
    return f"{number} {one if number == 1 else many or one + 's'}"
