"""Table: numbers and names in rows, with what each column is called and how it is written.

The terminal, the HTML page, Parquet and `summary.json` all take the same rows.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import isnan
from typing import Any, Literal

STATE_COLUMNS = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")
MOST_ROWS = 40  # of a table on the terminal; longer ones are for the page, and summed up


@dataclass(frozen=True)
class Column:
    """A column of a table.

    `heading`, with the unit; None for one that is stored and not shown.  `key`: its name where it is
    stored, with the unit as in `start_s`, in SI; None for one that is only shown.  `form` writes a
    value, times `scale`, as text; `absent` stands where there is none.  Words stand left, numbers
    right.  A cell of several values has a name for each in `parts`: Parquet stores these, JSON the
    whole under the `key` if there is one.  `since`: from when it counts, of a column of instants.
    `spare`: left out where there is no room for it.  On the page a cell that
    `links` leads to the file it names, and one that `judges` is good where it is true and bad where not.
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
        """A cell in words: a text as it is."""
        if isinstance(cell, str):
            return cell
        if cell is None or (isinstance(cell, float) and isnan(cell)):
            return self.absent
        if self.parts:
            return self.form(*cell)
        return self.form(cell if self.scale == 1.0 else cell * self.scale)


@dataclass(frozen=True)
class Table:
    """A table; `folded` on the page and not on the terminal."""

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
        """The rows as they are shown."""
        return [
            [column.text(cell) for column, cell in zip(self.shown, row, strict=True)] for row in self.cells
        ]

    @property
    def cells(self) -> list[list[Any]]:
        """The rows of which the texts are made."""
        places = [k for k, column in enumerate(self.columns) if column.heading is not None]
        return [[row[k] for k in places] for row in self.rows]

    @property
    def records(self) -> list[dict[str, Any]]:
        """The rows for JSON."""
        return [record(self.columns, row) for row in self.rows]

    @property
    def stored(self) -> dict[str, list[Any]]:
        """The columns for Parquet, null where there is nothing; also without any row."""
        found: dict[str, list[Any]] = {}
        for k, column in enumerate(self.columns):
            cells = [row[k] for row in self.rows]
            for place, part in enumerate(column.parts):
                found[part] = [None if cell is None else cell[place] for cell in cells]
            if column.key is not None and not column.parts:
                found[column.key] = cells
        return found


def record(columns: Iterable[Column], row: Iterable[Any]) -> dict[str, Any]:
    """One row for JSON."""
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
    """A time [s] as min:s, rounded to a second."""
    whole = round(time)
    return f"{whole // 60}:{whole % 60:02d}"


def counted(number: int, one: str, many: str = "") -> str:
    """A number of things."""
    return f"{number} {one if number == 1 else many or one + 's'}"
