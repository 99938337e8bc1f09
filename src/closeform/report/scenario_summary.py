"""What a scenario asks for, in the words of its file: the orbit, the craft, the stages in order."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

from closeform.report.section import Section
from closeform.report.table import MOST_ROWS, Column, Table
from closeform.scenario import Scenario
from closeform.scenario.load import toml

OWN = {"closeform", "title", "craft", "stage"}  # tables and keys that are told in a way of their own
TOLD = {"do", "name"}  # keys of a stage that stand in columns of their own
DRAWN = {  # in a case of a study, by its `draws`
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
    """What the file asks for, and how it begins to say so."""
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
    """The comment with which a file begins."""
    lines = []
    for line in text.removeprefix("\ufeff").splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.lstrip("#").strip())
    if any(lines):
        yield " ".join(filter(None, lines))


def drawn_case(scenario: Scenario) -> Iterator[str]:
    """What of the flight is drawn, where it is a case of a study."""
    if scenario.case is not None and scenario.study is not None:
        of = DRAWN[scenario.study.draws]
        yield f"Flown is case {scenario.case} of its study, {of} drawn with seed {scenario.study.seed}"


def craft(names: Sequence[str], said: Mapping[str, Any]) -> Table:
    """What is said of each craft; those that stand one after another and are alike in one row."""
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
    """Craft that stand one after another."""
    if len(names) <= 2:
        return ", ".join(names)
    return f"{names[0]} to {names[-1]} ({len(names)} craft)"


def described(said: Mapping[str, Any], cost: str | None) -> str:
    """What a stage is to do, and what is to be least in it, which the file may leave out."""
    least = {"cost": cost} if cost is not None else {}
    kept = {key: value for key, value in {**said, **least}.items() if key not in TOLD}
    return "; ".join(f"{plain(key)} {words(value)}" for key, value in kept.items())


def words(value: Any) -> str:
    """A value of the file in words."""
    if isinstance(value, Mapping):
        return ", ".join(f"{plain(key)} {inner(one)}" for key, one in value.items())
    if isinstance(value, list):
        return ", ".join(map(inner, value))
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else str(value)


def plain(key: str) -> str:
    """A key in words."""
    return key.replace("delta_v", "delta-v").replace("_", " ")


def inner(value: Any) -> str:
    """The same within another value: what has parts in brackets."""
    return f"({words(value)})" if isinstance(value, Mapping | list) else words(value)
