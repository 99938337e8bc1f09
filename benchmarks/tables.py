"""Tables and single figures of the benchmark, as text of at most 100 columns and as Markdown."""

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
    """A single figure: its limit or its exact value, and whether it is met (None: not measured)."""

    name: str
    asked: str
    measured: str
    met: bool | None


@dataclass
class Report:
    """Results of one section; `speeds` are times [s] by name for the on-board estimate."""

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
    """Return all single figures with their limits."""
    words = {True: "yes", False: "NO", None: "not measured"}
    rows = [[figure.name, figure.asked, figure.measured, words[figure.met]] for figure in figures]
    return Table("Single figures and their limits", ["figure", "limit", "measured", "met"], rows)


def other_figures(reports: list[Report]) -> Table:
    """Return the single figures that no table of their section shows, with exact or published values."""
    rows = []
    for report in reports:
        cells = {cell for table in report.tables for row in table.rows for cell in row}
        notes = " ".join(note for table in report.tables for note in table.notes)
        for figure in report.figures:
            if figure.measured not in notes and not cells.issuperset(figure.measured.split(", ")):
                exact = "" if figure.asked[0] in "<>" else figure.asked
                rows.append([figure.name, exact, figure.measured])
    return Table("Other figures", ["figure", "exact or published", "measured"], rows)


def as_text(table: Table) -> str:
    """Return a table as text, with the first column left-aligned and the others right-aligned."""
    lines = [table.columns, *table.rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(table.columns))]
    out = [fill(table.title, 100)]
    for line in lines:
        cells = [line[0].ljust(widths[0])]
        cells += [cell.rjust(width) for cell, width in zip(line[1:], widths[1:], strict=True)]
        out.append("  ".join(cells).rstrip())
    return "\n".join(out + [fill(note, 100) for note in table.notes])


def as_markdown(table: Table) -> str:
    """Return a table as a Markdown section."""
    head = [" | ".join(table.columns), " | ".join(["---"] + ["---:"] * (len(table.columns) - 1))]
    body = [f"| {line} |" for line in head + [" | ".join(row) for row in table.rows]]
    notes = ["", " ".join(table.notes)] if table.notes else []
    return "\n".join([f"## {table.title}", "", *body, *notes, ""])


def seconds(value: float) -> str:
    """Return a time with three digits and a suitable unit."""
    unit, size = next((u, x) for u, x in (("s", 1.0), ("ms", 1e-3), ("µs", 0.0)) if value >= x or x == 0.0)
    return f"{value / (size or 1e-6):.3g} {unit}"


def times(ratio: float) -> str:
    """Return a ratio of times as text."""
    return f"{ratio:.3g}x" if ratio < 1000 else f"{ratio:,.0f}x"
