"""HTML page of a report: sections, pictures, and the section on reproduction."""

import base64
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from closeform.mission.verdict import MET
from closeform.report.description import Column, Section, Table
from closeform.report.picture import Progress, Shot, drawn
from closeform.storage.result_folder import (
    REPORT,
    SCENARIO,
    SUMMARY,
    VIEWER,
    WORST_FLIGHT,
    Folder,
    digest,
    versions,
)

if TYPE_CHECKING:
    from closeform.scenario import Scenario

Viewer = Callable[[Folder, Sequence[Shot]], None]  # writes an animated page next to the pictures
Pages = Callable[[Progress], object]  # writes the pages of cases
LONG = 40  # characters above which the text of a cell wraps
RIGHT_TO_LEFT = re.compile(
    "[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc]+(?: +[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc]+)*"
)
STYLE = Path(__file__).with_name("page.css").read_text(encoding="utf-8")


@dataclass(frozen=True)
class Head:
    """Header of a page: title, subject `lines`, verdict, `warnings` and `links`.

    `links`: files next to the page, each with its link text.
    """

    title: str
    lines: Sequence[str]
    verdict: str
    good: bool
    warnings: Sequence[str] = ()
    links: Sequence[tuple[str, str]] = ()


def document(head: Head, sections: Sequence[Section], shots: Iterable[Shot]) -> str:
    """Return a complete HTML page: header, contents and sections; `shots` holds one shot per picture."""
    drawn = iter(shots)
    marks = [anchor(one.title, place) for place, one in enumerate(sections, 1)]
    links = " · ".join(link(*one) for one in head.links)
    parts = [
        f"<header>\n<h1>{letters(head.title)}</h1>",
        *(paragraph(line, "faint") for line in head.lines),
        paragraph(head.verdict, f"verdict {'good' if head.good else 'bad'}"),
        *(paragraph(line, "bad") for line in head.warnings),
        f'<p class="screen">{links}</p>' * bool(links),
        '</header>\n<nav aria-label="Contents"><ol>',
        *(
            f'<li><a href="#{mark}">{letters(one.title)}</a></li>'
            for one, mark in zip(sections, marks, strict=True)
        ),
        "</ol></nav>\n<main>",
    ]
    for one, mark in zip(sections, marks, strict=True):
        parts += [
            f'<section id="{mark}">',
            *content(one, islice(drawn, len(one.pictures))),
            "</section>",
        ]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(head.title)}</title><style>{STYLE}</style></head>\n<body>\n"
        + "\n".join(filter(None, [*parts, "</main>"]))
        + "\n</body></html>\n"
    )


def anchor(title: str, place: int) -> str:
    """Return the anchor of the section at a place in the page, such as "stage-2" or "what-was-found"."""
    words = re.findall(r"[a-z0-9]+", re.split('[:"]', title)[0].lower())
    return "-".join(words) or f"section-{place}"


def letters(text: str) -> str:
    """Return escaped text with right-to-left names isolated from the numbers next to them."""
    return RIGHT_TO_LEFT.sub(r"<bdi>\g<0></bdi>", escape(text))


def link(file: str, words: str) -> str:
    """Return the HTML link to a file next to the page."""
    return f'<a href="{escape(file)}">{letters(words)}</a>'


def paragraph(line: str, look: str = "") -> str:
    """Return one line of text as an HTML paragraph of class `look`."""
    return f'<p class="{look}">{letters(line)}</p>' if look else f"<p>{letters(line)}</p>"


def content(section: Section, pictures: Iterable[Shot]) -> Iterator[str]:
    """Yield the HTML of a section and its pictures; folded tables come last."""
    yield f"<h2>{letters(section.title)}</h2>"
    yield from map(paragraph, section.lines)
    if section.listing:
        yield f'<pre tabindex="0">{escape(section.listing)}</pre>'
    for one in section.tables:
        if not one.folded:
            yield (f"<h3>{escape(one.title)}</h3>" if one.title else "") + table(one)
    yield from map(paragraph, section.closing)
    for shot in pictures:
        data = base64.b64encode(shot.file.read_bytes()).decode()
        words = escape(": ".join(filter(None, (shot.caption, shot.says))))
        image = f'<img alt="{words}" src="data:image/{shot.file.suffix[1:]};base64,{data}">'
        yield f"<figure>{image}<figcaption>{letters(shot.caption)}</figcaption></figure>"
    for one in section.tables:
        if one.folded:
            yield f"<details><summary>{escape(one.title)}</summary>{table(replace(one, title=''))}</details>"


def table(shown: Table) -> str:
    """Return the HTML of a table; text is aligned left, numbers right."""
    columns = shown.shown
    heads = (f'<th scope="col"{look(column)}>{letters(column.heading or "")}</th>' for column in columns)
    rows = []
    for cells, texts in zip(shown.cells, shown.texts, strict=True):
        parts = zip(columns, cells, texts, strict=True)
        rows.append(f"<tr>{''.join(f'<td{look(*part)}>{cell_html(*part)}</td>' for part in parts)}</tr>")
    named = f' aria-label="{escape(shown.title)}"' if shown.title else ""
    return (
        f'<div class="wide" role="group" tabindex="0"{named}><table><thead><tr>{"".join(heads)}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def look(column: Column, cell: Any = None, text: str = "") -> str:
    """Return the class attribute of a cell, or of its heading; empty if it has none."""
    found = ["words"] * column.words + ["long"] * (column.words and len(text) > LONG)
    if column.judges and cell is not None:
        found.append("good" if cell else "bad")
    return f' class="{" ".join(found)}"' if found else ""


def cell_html(column: Column, cell: Any, text: str) -> str:
    """Return the HTML content of a cell."""
    return link(str(cell), text) if column.links and cell is not None else letters(text)


OPTIONS = Column("option", "option", words=True), Column("given", "given", words=True)
ROWS = Column("what", "what", words=True), Column("is", "is", words=True)
FILES = Column("file", "file", words=True, links=True), Column("content", "words", words=True)
MOVING = {VIEWER: "See the mission in motion", WORST_FLIGHT: "See the worst simulation in motion"}
EXPANDED = {*'"$`'}  # characters that are special to a shell even in double quotes
HOLDS = {  # files of results, in the order in which they are listed
    VIEWER: "the mission in motion, in space",
    WORST_FLIGHT: "the worst simulation in the high-fidelity model, in motion",
    SUMMARY: "every figure, in SI units, with status and verdict",
    "scenario.toml": "the scenario of this run",
    "conflicts.parquet": "every conflict",
    "approaches.parquet": "the closest approach of every pair",
    "sigmas.parquet": "clearance in sigmas and probability of collision of every pair",
    "drifts.parquet": "closest approach of every pair in free drift after a failure",
    "craft.parquet": "costs of every craft in every stage",
    "burns.parquet": "every burn",
    "burns.csv": "every burn, as text",
    "paths.parquet": "states and thrust accelerations, at equal steps",
    "worst.parquet": "states in the worst simulation",
    "flights.parquet": "deviation and delta-v of each craft in each simulation",
    "ends.parquet": "deviation and delta-v at the end of each stage",
    "ratios.parquet": "minimum clearance ratio of each pair in each simulation",
    "pulses.parquet": "planned pulses of thrusters in the high-fidelity model",
    "corrections.parquet": "further pulses in the worst simulation, by feedback",
    "commanded.parquet": "commanded thrust in the high-fidelity model, and the model error along the plan",
    "cdm": "a conjunction data message for each conflict",
    "states.parquet": "states in the common frame, at every epoch",
    "events.parquet": "every lock and burn of a gathering",
    "sets.parquet": "the set of every craft when a gathering ends",
    "locks.parquet": "the first lock of every pair",
    "arcs.parquet": "every arc of every path, in full precision",
    "legs.parquet": "every turn of every search",
    "cases": "every case by its number",
}


@dataclass(frozen=True, eq=False)
class Command:
    """Command on files as it was typed, with its `options` by name; an option that is None was not given."""

    name: str
    files: Sequence[Path]
    options: Mapping[str, Any]
    also: Sequence[Path] = ()  # files that options name
    out: Path | None = None  # the option for the result folder

    @property
    def given(self) -> dict[str, str]:
        """The given options and their values as text."""
        return {
            option: "" if value is True else str(value)
            for option, value in self.options.items()
            if value is not None and value is not False
        }

    @property
    def line(self) -> str:
        """The command line, for use in the folder of the files."""
        typed = [
            f"--{option}" + (f" {quoted(value)}" if value else "") for option, value in self.given.items()
        ]
        return " ".join(["closeform", self.name, *(quoted(file.name) for file in self.files), *typed])

    @property
    def table(self) -> Table:
        """The options as a table."""
        return Table("Options", OPTIONS, [(f"--{option}", value) for option, value in self.given.items()])

    @cached_property
    def inputs(self) -> dict[str, str]:
        """The input files by name, with their hashes."""
        files = [file for file in (*self.files, *self.also) if not file.is_dir()]
        return {file.name: f"sha256:{digest(file)}" for file in files}

    @property
    def figures(self) -> dict[str, Any]:
        """The command and its inputs for `summary.json`."""
        return {"command": self.line, "inputs": self.inputs}

    @property
    def repeat(self) -> "Repeat":
        """The command as data for the section on reproduction."""
        return Repeat(self.line, self.inputs, self.out)


def quoted(word: str) -> str:
    """Return a word quoted for a shell."""
    return f'"{word}"' if " " in word and not {*word} & EXPANDED else shlex.quote(word)


@dataclass(frozen=True)
class Repeat:
    """Command that reproduces results, with the hashes of its `inputs` and further rows of the section.

    `out`: the result folder, if it was given.
    """

    command: str
    inputs: Mapping[str, str]
    out: Path | None
    further: Mapping[str, object] = field(default_factory=dict)

    @classmethod
    def of(cls, scenario: "Scenario", verb: str, options: str, out: Path | None, seed: int | None) -> Self:
        """Return the command `verb` with a scenario, by its file or by the copy of it."""
        command = f"closeform {verb} {quoted(Path(scenario.file).name)}{options}"
        copied = f"closeform {verb} {SCENARIO}{options}"
        return cls(command, inputs(scenario), out, {"the same, in this folder": copied, "seed": seed})

    def section(self, beside: Sequence[str]) -> Section:
        """Return the section on reproduction, with the files next to the page."""
        out = "" if self.out is None else f" --out {quoted(str(self.out))}"
        rows = [("command", self.command + out)]
        rows += [(what, str(value)) for what, value in self.further.items() if value is not None]
        rows += [(f"{name}, SHA-256", one.removeprefix("sha256:")) for name, one in self.inputs.items()]
        rows.append(("versions", ", ".join(f"{name} {one}" for name, one in versions().items())))
        files = [(name, HOLDS[name]) for name in beside]
        same = "The same command with the same file and versions gives the same figures."
        return Section(
            "Reproduction", (same,), (Table("", ROWS, rows), Table("Files next to this page", FILES, files))
        )


def inputs(scenario: "Scenario") -> dict[str, str]:
    """Return the hashes of a scenario and of the files it names."""
    return {name: f"sha256:{digest}" for name, digest in scenario.digests.items()}


def nothing(progress: Progress) -> None:
    """Write no page."""


def write(
    folder: Folder,
    head: Head,
    chapters: Sequence[Section],
    repeat: Repeat,
    figures: Mapping[str, Any],
    progress: Progress = lambda text: None,
    viewer: Viewer | None = None,
    pages: Pages = nothing,
) -> None:
    """Draw all pictures, then write the page and, last, the summary; all other files already exist.

    `viewer` writes an animated page next to the pictures, and `pages` those of cases.
    """
    shots = drawn([picture for one in chapters for picture in one.pictures], folder, progress)
    if viewer is not None:
        progress(f"writing {VIEWER}")
        viewer(folder, shots)
    pages(progress)
    there = {file.name for file in folder.path.iterdir()}
    beside = [name for name in HOLDS if name in there or name == SUMMARY]  # pictures are in the page
    links = [(name, words) for name, words in MOVING.items() if name in beside]
    folder.text(REPORT, document(replace(head, links=links), [*chapters, repeat.section(beside)], shots))
    folder.summary(figures)


@dataclass(frozen=True, eq=False)
class CommandReport:
    """Report on the files of a `command`: what the terminal, the page, `summary.json` and tables show.

    - `subject`: what was evaluated, for the animated page.
    - `opening`, `lines`, `tables`, `verdict`: printed in this order; `about`: lines below the title.
    - `chapters`: sections of the page except the one on reproduction.
    - `figures`: for `summary.json`; `files`: columns of tables by name.
    - `beside`: writes further files.
    """

    command: Command
    subject: Any
    title: str
    opening: tuple[str, ...]
    about: Sequence[str]
    lines: tuple[str, ...]
    tables: tuple[Table, ...]
    verdict: Any
    chapters: tuple[Section, ...]
    figures: Mapping[str, Any]
    files: Mapping[str, Mapping[str, Any]]
    warnings: Sequence[str] = ()
    beside: Callable[[Folder], object] = lambda folder: None
    printed_warnings = hint = ()
    wraps = False  # whether a long verdict is broken into lines

    @property
    def printed(self) -> tuple[Section, ...]:
        """Sections that the terminal shows."""
        tables = tuple(replace(one, folded=False) for one in self.tables)
        return (Section("", (*self.opening, *self.lines), tables),)

    def write(
        self, folder: Folder, progress: Progress = lambda text: None, viewer: Viewer | None = None
    ) -> None:
        """Fill a result folder with all files; `viewer` writes the animated page."""
        progress("writing tables")
        for name, columns in self.files.items():
            folder.table(name, columns)
        self.beside(folder)
        head = Head(self.title, self.about, str(self.verdict), self.verdict.status == MET, self.warnings)
        figures = {
            "kind": self.figures["kind"],
            "title": self.title,
            **self.command.figures,
            **self.figures,
        }
        write(folder, head, self.chapters, self.command.repeat, figures, progress, viewer)
