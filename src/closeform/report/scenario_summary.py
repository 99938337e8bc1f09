"""Summary of a scenario in the words of its file: the orbit, the spacecraft and the stages in order."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

from closeform.report.section import Section
from closeform.report.table import MOST_ROWS, Column, Table
from closeform.scenario import Scenario
from closeform.scenario.load import toml

OWN = {"closeform", "title", "craft", "stage"}  # tables and keys that are shown separately
TOLD = {"do", "name"}  # keys of a stage that have their own columns
DRAWN = {  # words for a case of a study, by its `draws`
    "vary": "whose states are",
    "errors": "flown as planned with errors that are",
    "replanned": "each stage planned from where errors led the craft, which are",
}
FIELDS = Column("what", "table", words=True), Column("as the file says it", "words", words=True)
STAGES = (
    Column("stage", "number"),
    Column("does", "do", words=True),
    Column("called", "name", words=True, absent=""),
    Column("as the file says it", "words", words=True),
)


def section(scenario: Scenario) -> Section:
    """Return the section on what the scenario requests, opened by the file's first comment."""
    said = toml(scenario.text, "scenario")
    rest = [(key, words(value)) for key, value in said.items() if key not in OWN]
    stages = [
        (number, stage.verb, stage.name, described(written, getattr(stage, "cost", None)))
        for number, (stage, written) in enumerate(zip(scenario.stages, said["stage"], strict=True), 1)
    ]
    return Section(
        "What was asked",
        (*introduction(scenario.text), *drawn_case(scenario)),
        (
            Table("", FIELDS, rest),
            craft(scenario.names, said["craft"]),
            Table("Stages", STAGES, stages),
        ),
    )


def introduction(text: str) -> Iterator[str]:
    """Yield the comment at the beginning of the file as one line, if there is one."""
    lines = []
    for line in text.removeprefix("\ufeff").splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.lstrip("#").strip())
    if any(lines):
        yield " ".join(filter(None, lines))


def drawn_case(scenario: Scenario) -> Iterator[str]:
    """Yield the line that describes the sampled case, if the scenario is a case of a study."""
    if scenario.case is not None and scenario.study is not None:
        of = DRAWN[scenario.study.draws]
        yield f"Flown is case {scenario.case} of its study, {of} drawn with seed {scenario.study.seed}"


def craft(names: Sequence[str], said: Mapping[str, Any]) -> Table:
    """Return the table of spacecraft; consecutive ones with equal values share a row."""
    keys = [key for key in said if key != "name"]
    rows = [
        (name, *(words(said[key][k] if isinstance(said[key], list) else said[key]) for key in keys))
        for k, name in enumerate(names)
    ]
    alike = [list(some) for _, some in groupby(rows, key=lambda row: row[1:])]
    shown = [(called([row[0] for row in some]), *some[0][1:]) for some in alike]
    columns = Column("craft", words=True), *(Column(plain(key), words=True) for key in keys)
    return Table("Craft", columns, shown, folded=len(shown) > MOST_ROWS)


def called(names: Sequence[str]) -> str:
    """Return the names of consecutive spacecraft in short form."""
    if len(names) <= 2:
        return ", ".join(names)
    return f"{names[0]} to {names[-1]} ({len(names)} craft)"


def described(said: Mapping[str, Any], cost: str | None) -> str:
    """Return the keys of a stage as text, with the cost even if the file omits it."""
    least = {"cost": cost} if cost is not None else {}
    kept = {key: value for key, value in {**said, **least}.items() if key not in TOLD}
    return "; ".join(f"{plain(key)} {words(value)}" for key, value in kept.items())


def words(value: Any) -> str:
    """Return a value of the file as text."""
    if isinstance(value, Mapping):
        return ", ".join(f"{plain(key)} {inner(one)}" for key, one in value.items())
    if isinstance(value, list):
        return ", ".join(map(inner, value))
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else str(value)


def plain(key: str) -> str:
    """Return a key as words."""
    return key.replace("delta_v", "delta-v").replace("_", " ")


def inner(value: Any) -> str:
    """Return a nested value as text, in brackets if it has parts."""
    return f"({words(value)})" if isinstance(value, Mapping | list) else words(value)
