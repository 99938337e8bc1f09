"""Tables and figures of the benchmark, as text of at most 100 columns and as Markdown."""

from dataclasses import asdict, dataclass, field
from textwrap import fill
from typing import Any


@dataclass
class Table:
    title: str
    columns: list[str]
    rows: list[list[str]]
    notes: list[str] = field(default_factory=list)


@dataclass
class Figure:
    """A figure to reach: what was asked, what was measured, whether it is met (None: not measured)."""

    name: str
    asked: str
    measured: str
    met: bool | None


@dataclass
class Report:
    """What one section measured; `speeds` carries seconds by name to the on-board estimate."""

    tables: list[Table] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    speeds: dict[str, float] = field(default_factory=dict)
    failed: bool = False

    def plain(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_plain(cls, plain: dict[str, Any]) -> "Report":
        tables = [Table(**table) for table in plain["tables"]]
        figures = [Figure(**figure) for figure in plain["figures"]]
        return cls(tables, figures, plain["speeds"])


def figures_table(figures: list[Figure]) -> Table:
    words = {True: "yes", False: "NO", None: "not measured"}
    rows = [[figure.name, figure.asked, figure.measured, words[figure.met]] for figure in figures]
    return Table("Figures to reach", ["figure", "asked", "measured", "met"], rows)


def as_text(table: Table) -> str:
    """Columns aligned, the first to the left, the rest to the right."""
    lines = [table.columns, *table.rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(table.columns))]
    out = [fill(table.title, 100)]
    for line in lines:
        cells = [line[0].ljust(widths[0])]
        cells += [cell.rjust(width) for cell, width in zip(line[1:], widths[1:], strict=True)]
        out.append("  ".join(cells).rstrip())
    return "\n".join(out + [fill(note, 100) for note in table.notes])


def as_markdown(table: Table) -> str:
    head = [" | ".join(table.columns), " | ".join(["---"] + ["---:"] * (len(table.columns) - 1))]
    body = [f"| {line} |" for line in head + [" | ".join(row) for row in table.rows]]
    notes = [line for note in table.notes for line in ("", note)]
    return "\n".join([f"## {table.title}", "", *body, *notes, ""])


def seconds(value: float) -> str:
    """A time with three digits in the unit that suits it."""
    unit, size = next((u, x) for u, x in (("s", 1.0), ("ms", 1e-3), ("µs", 0.0)) if value >= x or x == 0.0)
    return f"{value / (size or 1e-6):.3g} {unit}"


def times(ratio: float) -> str:
    """How many times as long."""
    return f"{ratio:.3g}x" if ratio < 1000 else f"{ratio:,.0f}x"
