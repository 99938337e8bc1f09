"""Reproduction of results: the command, the inputs, the versions, and the files next to the page."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from closeform.report.section import Section
from closeform.report.table import Column, Table
from closeform.storage.result_folder import SCENARIO, SUMMARY, VIEWER, WORST_FLIGHT, Folder, digest, versions

if TYPE_CHECKING:
    from closeform.scenario import Scenario

OPTIONS = Column("option", "option", words=True), Column("given", "given", words=True)
ROWS = Column("what", "what", words=True), Column("is", "is", words=True)
FILES = Column("file", "file", words=True, links=True), Column("what it holds", "words", words=True)
EXPANDED = {*'"$`'}  # characters that are special to a shell even in double quotes
HOLDS = {  # files of results, in the order in which they are listed
    VIEWER: "all of it in motion, in space",
    WORST_FLIGHT: "the worst flight in the field, in motion",
    SUMMARY: "every figure, in SI units, with status and verdict",
    "scenario.toml": "the scenario as it was flown",
    "conflicts.parquet": "every conflict",
    "approaches.parquet": "the closest approach of every pair",
    "sigmas.parquet": "by how many sigmas every pair is clear, and how probable a collision is",
    "drifts.parquet": "how near every pair comes when something fails",
    "craft.parquet": "what every craft spends in every stage",
    "burns.parquet": "every burn",
    "burns.csv": "every burn, as text",
    "paths.parquet": "states and thrust accelerations, at equal steps",
    "flown.parquet": "states as flown in the worst flight",
    "flights.parquet": "how far off each craft ends in each flight, and what it spends",
    "ends.parquet": "the same at the end of each stage",
    "ratios.parquet": "how near each pair comes in each flight",
    "pulses.parquet": "what thrusters fire in the field by plan",
    "corrections.parquet": "what thrusters fire beyond that in the worst flight: from when on, and how much",
    "commanded.parquet": "the thrust to command in the field, and what is left out along the plan",
    "cdm": "a conjunction data message for each conflict",
    "states.parquet": "states in the common frame, at every epoch",
    "events.parquet": "every lock and burn of a gathering",
    "sets.parquet": "who is in which set when a gathering ends",
    "locks.parquet": "the first lock of every pair",
    "arcs.parquet": "every arc of every path, to the last bit",
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
        return hashed([file for file in (*self.files, *self.also) if not file.is_dir()])

    @property
    def figures(self) -> dict[str, Any]:
        """The command and its inputs for `summary.json`."""
        return {"command": self.line, "inputs": self.inputs}

    def repeated(self, beside: Sequence[str]) -> Section:
        """Return the section on reproduction."""
        return section(self.line, self.inputs, beside, self.out)


def quoted(word: str) -> str:
    """Return a word quoted for a shell."""
    return f'"{word}"' if " " in word and not {*word} & EXPANDED else shlex.quote(word)


def section(
    command: str, inputs: Mapping[str, str], beside: Sequence[str], out: Path | None, **more: object
) -> Section:
    """Return the section on reproduction: a `command`, its `inputs` with hashes, and `more` dependencies.

    `out`: the result folder, if it was given.
    """
    rows = [("command", command + ("" if out is None else f" --out {quoted(str(out))}"))]
    rows += [(what, str(value)) for what, value in more.items() if value is not None]
    rows += [(f"{name}, SHA-256", digest.removeprefix("sha256:")) for name, digest in inputs.items()]
    rows.append(("versions", ", ".join(f"{name} {one}" for name, one in versions().items())))
    tables = [Table("", ROWS, rows)]
    if beside:
        tables.append(
            Table("Files beside this page", FILES, [(name, HOLDS.get(name, "")) for name in beside])
        )
    same = "The same command with the same file and versions gives the same figures."
    return Section("How to repeat it", (same,), tuple(tables))


def beside(folder: Folder) -> list[str]:
    """Return the files of a result folder that the page lists; pictures are embedded in the page."""
    there = {file.name for file in folder.path.iterdir()}
    return [name for name in HOLDS if name in there or name == SUMMARY]


def links(names: Sequence[str]) -> list[tuple[str, str]]:
    """Return the files that are linked at the top of the page, with their link texts."""
    pages = {VIEWER: "See it in motion", WORST_FLIGHT: "See the worst flight in motion"}
    return [(name, words) for name, words in pages.items() if name in names]


def by_scenario(
    scenario: "Scenario", verb: str, options: str, beside: Sequence[str], out: Path | None, seed: int | None
) -> Section:
    """Return the section on reproduction of a `verb` with a scenario, by its file or by the copy of it."""
    command = f"closeform {verb} {quoted(Path(scenario.file).name)}{options}"
    copied = {"the same, in this folder": f"closeform {verb} {SCENARIO}{options}"}
    return section(command, inputs(scenario), beside, out, **copied, seed=seed)


def inputs(scenario: "Scenario") -> dict[str, str]:
    """Return the hashes of a scenario and of the files it names."""
    return {name: f"sha256:{digest}" for name, digest in scenario.digests.items()}


def hashed(files: Sequence[Path]) -> dict[str, str]:
    """Return the hashes of files by file name."""
    return {file.name: f"sha256:{digest(file)}" for file in files}
