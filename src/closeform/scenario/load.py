"""A TOML file as a Scenario, or every reason why it is none."""

import os
import re
import sys
import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from closeform.scenario.checks import check
from closeform.scenario.craft import Craft, OrbitTable, SearchTable, SensorTable
from closeform.scenario.errors import ScenarioError, complaints, did_you_mean, dotted
from closeform.scenario.quantity import shown
from closeform.scenario.scenario import Scenario
from closeform.scenario.stages import STAGES, StageTable
from closeform.scenario.study import Study
from closeform.scenario.table import Table

FORMAT = 1
DEEPEST = 50  # parts of a dotted key: what reads TOML needs memory by their square, and may recurse
DEEP = re.compile(rf"""(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){{{DEEPEST}}}""")
Model = TypeVar("Model", bound=Table)


def load(file: str | Path) -> Scenario:
    """Read a scenario file. Raises ScenarioError, with one line for each thing that is wrong."""
    return parse(text_of(file), str(file))


def text_of(file: str | Path) -> str:
    """What stands in a scenario file, to the last byte. Raises ScenarioError where it is no text."""
    try:
        data = Path(file).read_bytes()
    except OSError as error:
        reason = "is a directory" if os.path.isdir(file) else (error.strerror or "cannot be read").lower()
        raise ScenarioError(str(file), [f"{reason}; check the path"]) from None
    try:
        return data.decode()
    except UnicodeDecodeError:
        raise ScenarioError(str(file), ["not UTF-8 text; save it as UTF-8"]) from None


def parse(text: str, file: str = "scenario") -> Scenario:
    """The scenario that a TOML text describes; `file` names it in messages. A byte-order mark is no matter.

    Raises ScenarioError, with one line for each thing that is wrong.
    """
    if deep := DEEP.search(text):
        place = f"line {text.count(chr(10), 0, deep.start()) + 1}"
        raise ScenarioError(file, [f"{place}: a key of {DEEPEST} parts or more; no key here has so many"])
    try:
        raw = tomllib.loads(text.removeprefix("\ufeff"))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        where = re.search(r"\(at (.*)\)$", str(error))
        what = re.sub(r" \(at .*\)$", "", str(error))
        place = where[1] if where else "the file"
        raise ScenarioError(file, [f"{place}: not TOML: {what}; correct it there"]) from None
    except ValueError:  # Python converts no more digits than these
        most = sys.get_int_max_str_digits()
        before = re.split(rf"[0-9_]{{{most}}}", text)[0].count("\n")
        raise ScenarioError(
            file, [f"line {before + 1}: a number of more than {most} digits; write a shorter one"]
        ) from None
    reading = Reading(raw)
    values = reading.sections()
    if not reading.lines:
        scenario = Scenario(file, text, **values)
        reading.lines += check(scenario)
    if reading.lines:
        raise ScenarioError(file, reading.lines)
    return scenario


class Reading:
    """The sections of a file, each validated by itself so that every error shows at once."""

    def __init__(self, raw: dict[str, Any]) -> None:
        self.raw = raw
        self.lines: list[str] = []

    def sections(self) -> dict[str, Any]:
        """The validated sections; what is wrong with them is in `lines`."""
        known = ("closeform", "title", "orbit", "craft", "sensor", "search", "stage", "study")
        for key in self.raw:
            if key not in known:
                self.complain((key,), f"unknown key; {did_you_mean(key, known)}")
        if self.raw.get("closeform") != FORMAT or isinstance(self.raw["closeform"], bool):
            self.complain(("closeform",), f"must say the file's format; write closeform = {FORMAT}")
        title = self.raw.get("title")
        if not isinstance(title, str) or not title.strip() or not title.isprintable():
            self.complain(("title",), 'must be one line of text; write for example title = "My cluster"')
        return {
            "title": title,
            "orbit": self.table("orbit", OrbitTable, '[orbit] with altitude = "500 km"'),
            "craft": self.craft(),
            "sensor": self.table("sensor", SensorTable),
            "search": self.table("search", SearchTable),
            "stages": self.stages(),
            "study": self.table("study", Study),
        }

    def complain(self, place: tuple[int | str, ...], text: str) -> None:
        """Note that something is wrong at a place of the file."""
        self.lines.append(f"{dotted(place)}: {text}")

    def table(self, key: str, model: type[Model], needed: str = "") -> Model | None:
        """One section, or None where it is absent or wrong."""
        if key not in self.raw:
            if needed:
                self.complain((key,), f"missing; add {needed}")
            return None
        if not isinstance(self.raw[key], dict):
            self.complain((key,), f"is not a table; write it as [{key}]")
            return None
        return self.validated(model, self.raw[key], (key,))

    def validated(self, model: type[Model], value: Any, place: tuple[int | str, ...]) -> Model | None:
        """A table, or None if something is wrong with it."""
        try:
            return model.model_validate(value)
        except ValidationError as error:
            for where, text in complaints(error, model):
                self.complain(place + where, text)
            return None

    def craft(self) -> tuple[Craft, ...]:
        """[craft] as one table for each craft: a list gives one each, anything else is for all."""
        table = self.raw.get("craft")
        if not isinstance(table, dict):
            self.complain(("craft",), 'missing; add [craft] with name = ["F1", "F2"]')
            return ()
        names = table.get("name", [])
        names = names if isinstance(names, list) else [names]
        if not names:
            self.complain(("craft", "name"), 'missing; add for example name = ["F1", "F2"]')
            return ()
        columns: dict[str, list[Any]] = {}
        for key, value in table.items():
            columns[key] = value if isinstance(value, list) else [value] * len(names)
            if len(columns[key]) != len(names):
                text = f"has {len(value)} values for {len(names)} craft; give one value for all or one each"
                self.complain(("craft", key), text)
                columns[key] = value[:1] * len(names)  # stands in, to find more errors
        return self.each_craft({key: column for key, column in columns.items() if column}, len(names))

    def each_craft(self, columns: dict[str, list[Any]], count: int) -> tuple[Craft, ...]:
        """The craft one by one; what is wrong with all of them is said once."""
        found = []
        for number in range(count):
            try:
                craft = Craft.model_validate({key: column[number] for key, column in columns.items()})
                found.append(craft.placed(number, count))
            except ValidationError as error:
                for place, text in complaints(error, Craft):
                    listed = bool(place) and isinstance(self.raw["craft"].get(str(place[0])), list)
                    index = (place[0], number) if listed else place[:1]
                    self.complain(("craft", *index, *place[1:]), text)
        return tuple(found)

    def stages(self) -> tuple[StageTable, ...]:
        """[[stage]], each by the model of its verb."""
        tables = self.raw.get("stage")
        if not isinstance(tables, list) or not tables:
            self.complain(("stage",), 'missing; add [[stage]] with do = "coast" and for = "1 orbit"')
            return ()
        found: list[StageTable | None] = []
        for number, table in enumerate(tables):
            if not isinstance(table, dict):
                self.complain(("stage", number), "is not a table; write it as [[stage]]")
            elif "do" not in table:
                self.complain(("stage", number, "do"), 'missing; add for example do = "coast"')
            elif not isinstance(table["do"], str) or table["do"] not in STAGES:
                text = f"{shown(table['do'])} is not known here; {did_you_mean(str(table['do']), STAGES)}"
                self.complain(("stage", number, "do"), text)
            else:
                found.append(self.validated(STAGES[table["do"]], table, ("stage", number)))
        return tuple(stage for stage in found if stage is not None)
