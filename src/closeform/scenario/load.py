"""Reader of scenario files: a valid TOML text becomes a Scenario, an invalid one a list of errors."""

import os
import re
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from closeform.scenario.checks import ORBIT, Findings, check
from closeform.scenario.craft import Craft, SearchTable, SensorTable
from closeform.scenario.inputs import Inputs
from closeform.scenario.orbit import FeedbackTable, FlightTable, NavigationTable, OrbitTable, VerdictTable
from closeform.scenario.quantity import shown
from closeform.scenario.scenario import Scenario
from closeform.scenario.stages import STAGES, StageTable, Unknown
from closeform.scenario.study import Study, points, words
from closeform.scenario.table import (
    FLAWED,
    Place,
    ScenarioError,
    Table,
    complaints,
    did_you_mean,
    dotted,
    meant_by,
    tables_inside,
)

FORMAT = 1
TABLES: dict[str, type[Table]] = {
    "orbit": OrbitTable,
    "craft": Craft,
    "sensor": SensorTable,
    "search": SearchTable,
    "feedback": FeedbackTable,
    "navigation": NavigationTable,
    "simulation": FlightTable,
    "verdict": VerdictTable,
    "study": Study,
}
DEEPEST = 50  # parts of a dotted key: parser memory grows with their square, and the parser may recurse
# possessive, and from the beginning of a word only: the search time is linear in the text length
DEEP = re.compile(rf"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{DEEPEST}}}""")
KEY = re.compile(r"""\s*+(\[{0,2}[\w."' -]++\]{0,2})\s*+(?:=|#|$)""")  # at the beginning of a line
Model = TypeVar("Model", bound=Table)


def load(file: str | Path) -> Scenario:
    """Read a scenario file; raise ScenarioError, with one line for each error."""
    return parse(text_of(file), str(file))


def text_of(file: str | Path) -> str:
    """Return the text of a scenario file; raise ScenarioError if it cannot be read as UTF-8."""
    try:
        data = Path(file).read_bytes()
    except OSError as error:
        reason = "is a directory" if os.path.isdir(file) else (error.strerror or "cannot be read").lower()
        raise ScenarioError(str(file), [f"{reason}; check the path"]) from None
    try:
        return data.decode()
    except UnicodeDecodeError:
        raise ScenarioError(str(file), ["not UTF-8 text; save it as UTF-8"]) from None


def parse(text: str, file: str = "scenario", command: str = "run") -> Scenario:
    """Return the scenario that a TOML text describes; `file` names it in messages.

    A byte-order mark is ignored. Raises ScenarioError, with one line for each error, and for features that
    `command` needs and this version lacks.
    """
    raw = toml(text, file)
    scenario = scenario_of(raw, text, file, command)
    if scenario.study is None or not scenario.study.sweep:
        return scenario
    return replace(scenario, points=tuple(swept(raw, scenario, command)))


def scenario_of(raw: dict[str, Any], text: str, file: str, command: str) -> Scenario:
    """Return the scenario that the tables of a file describe."""
    reading = Reading(raw)
    scenario = Scenario(file, text, **reading.sections())
    scenario = located(scenario, Inputs(Path(file).parent), reading.lines, reading.complain)
    if lines := reading.lines + check(scenario, reading.lines, command):
        raise ScenarioError(file, lines)
    return scenario


def swept(raw: dict[str, Any], scenario: Scenario, command: str) -> Iterator[Scenario]:
    """Yield the scenario at each point of its sweep; raise ScenarioError at the first invalid point."""
    file, same = scenario.file, [stage.verb for stage in scenario.stages]
    try:
        for place, (chosen, changed) in enumerate(points(raw)):
            point = scenario_of(changed, scenario.text, file, command)
            if point.names != scenario.names or [stage.verb for stage in point.stages] != same:
                raise ScenarioError(file, ["study.sweep: changes the craft or the stages; remove that key"])
            yield replace(point, title=f"{scenario.title}: {words(chosen)}", point=chosen, place=place)
    except ScenarioError as error:
        line = error.lines[0].removeprefix(f"{file}: ")
        at = "" if line.startswith("study.sweep") else f"study.sweep: with {words(chosen)}: "
        raise ScenarioError(file, [f"{at}{line}"]) from None
    except ValueError as error:
        raise ScenarioError(file, [f"study.sweep: {error}"]) from None


def toml(text: str, file: str) -> dict[str, Any]:
    """Return the contents of a TOML text; raise ScenarioError for invalid TOML."""
    if deep := DEEP.search(text):
        place = f"line {text.count(chr(10), 0, deep.start()) + 1}"
        raise ScenarioError(
            file, [f"{place}: a key of {DEEPEST} parts or more; docs/scenario_keys.md lists the keys"]
        )
    try:
        return tomllib.loads(text.removeprefix("\ufeff"))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ScenarioError(file, [not_toml(text, error)]) from None
    except ValueError:  # Python limits the digits of an integer
        most = sys.get_int_max_str_digits()
        before = re.split(rf"[0-9_]{{{most}}}", text)[0].count("\n")
        raise ScenarioError(
            file, [f"line {before + 1}: a number of more than {most} digits; write a shorter one"]
        ) from None


def not_toml(text: str, error: Exception) -> str:
    """Return an error line for invalid TOML: the line, the nearest key above it, and the remedy."""
    found = re.fullmatch(r"(.*) \(at (.*)\)", str(error))
    what, place = found.groups() if found else (str(error), "the file")
    lines = text.splitlines()
    if line := re.match(r"line (\d+), column (\d+)", place):
        lines = lines[: int(line[1]) - (line[2] == "1")]  # column 1: the line before is unterminated
    before = [KEY.match(line) for line in lines]
    key = next((found[1].strip()[:60] for found in reversed(before) if found is not None), "the file")
    if re.match("Cannot (overwrite|declare)|Duplicate", what):
        inline = re.search("key '(.*)'", what)
        return f"{place}: {inline[1] if inline else key}: occurs twice; keep one"
    return f"{place}: {key}: not TOML: {what}; correct it there"


def in_places(craft: tuple[Craft, ...]) -> tuple[Craft, ...]:
    """Return the craft with places 0 to N - 1 of N, for a `start` that names a formation."""
    return tuple(one.placed(k, len(craft)) for k, one in enumerate(craft))


class Reading:
    """Sections of a file, each validated separately so that all errors are reported at once.

    Examples replace wrong or missing values, so that the remaining checks can run.
    """

    def __init__(self, raw: dict[str, Any]) -> None:
        self.raw = raw
        self.lines: list[str] = []

    def sections(self) -> dict[str, Any]:
        """Return the validated sections; `lines` collects their errors."""
        known = ["closeform", "title", *TABLES, "stage"]
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
            "orbit": self.table("orbit", OrbitTable, '[orbit] with altitude = "500 km"')
            or OrbitTable.model_validate({"deep_space": True}),
            "craft": in_places(self.craft(Craft)),
            "stages": self.stages(),
            **{
                "flights" if key == "simulation" else key: self.table(key, model)
                for key, model in TABLES.items()
                if key not in ("orbit", "craft")
            },
        }

    def complain(self, place: Place, text: str) -> None:
        """Add an error line for a key; a column of a craft with a single value gets no index."""
        if place[0] == "craft" and len(place) > 1 and isinstance(place[1], int):
            number, *rest = place[1:]
            listed = bool(rest) and isinstance(self.raw["craft"].get(str(rest[0])), list)
            place = "craft", *rest[:1], *([number] if listed else []), *rest[1:]
        self.lines.append(f"{dotted(place)}: {text}")

    def table(self, key: str, model: type[Model], needed: str = "") -> Model | None:
        """Return one validated section, or None if it is absent or wrong."""
        if key not in self.raw:
            if needed:
                self.complain((key,), f"missing; add {needed}")
            return None
        if not isinstance(self.raw[key], dict):
            self.complain((key,), f"is not a table; write it as [{key}]")
            return None
        return self.validated(model, self.raw[key], (key,))

    def validated(self, model: type[Model], value: dict[str, Any], place: Place) -> Model | None:
        """Return a validated table, with examples in place of wrong values; None if that fails.

        Nested tables are validated separately.
        """
        value = value | {
            key: self.validated(table, value[key], (*place, key)) or model.example(key)
            for key, table in tables_inside(model)
            if isinstance(value.get(key), dict)
        }
        try:
            return model.model_validate(value)
        except ValidationError as error:
            found = [*complaints(error, model)]
        for where, text in found:
            self.complain(place + where, text)
        wrong = {str(where[0]) for where, _ in found if where}
        wrong |= {meant for where, text in found if len(where) == 1 and (meant := meant_by(text))}
        known = model.examples()
        try:
            mended = model.model_validate(
                {key: one for key, one in value.items() if key not in wrong}
                | {key: model.example(key) for key in wrong if known.get(key)},
                context=FLAWED,
            )
        except ValidationError:
            return None
        if wrong:  # otherwise its flaws are already reported
            for text in mended.all_flaws():
                if not wrong & set(re.findall(r"\w+", text)):
                    self.complain(place, text)
        return mended

    def craft(self, model: type[Model]) -> tuple[Model, ...]:
        """Return one table for each craft of [craft]: a list has one value each, other values are for all."""
        table = self.raw.get("craft")
        if not isinstance(table, dict):
            self.complain(("craft",), 'missing; add [craft] with name = ["F1", "F2"]')
            return ()
        names = table.get("name", [])
        names = names if isinstance(names, list) else [names]
        if not names:
            self.complain(("craft", "name"), Craft.missing("name"))
            return ()
        columns: dict[str, list[Any]] = {}
        for key, value in table.items():
            columns[key] = value if isinstance(value, list) else [value] * len(names)
            if len(columns[key]) != len(names):
                text = f"has {len(value)} values for {len(names)} craft; give one value for all or one each"
                self.complain(("craft", key), text)
                columns[key] = value[:1] * len(names)  # placeholder values, to find more errors
        rows = [{key: column[k] for key, column in columns.items() if column} for k in range(len(names))]
        each = (self.validated(model, row, ("craft", number)) for number, row in enumerate(rows))
        return tuple(craft for craft in each if craft is not None)

    def stages(self) -> tuple[StageTable, ...]:
        """Return the tables of [[stage]], each read by the model of its verb."""
        tables = self.raw.get("stage")
        if not isinstance(tables, list) or not tables:
            self.complain(("stage",), 'missing; add [[stage]] with do = "coast" and for = "1 orbit"')
            return ()
        found: list[StageTable] = []
        for number, table in enumerate(tables):
            stage: StageTable | None = None
            if not isinstance(table, dict):
                self.complain(("stage", number), "is not a table; write it as [[stage]]")
            elif "do" not in table:
                self.complain(("stage", number, "do"), 'missing; add for example do = "coast"')
            elif not isinstance(table["do"], str) or table["do"] not in STAGES:
                text = f"{shown(table['do'])} is not known here; {did_you_mean(str(table['do']), STAGES)}"
                self.complain(("stage", number, "do"), text)
            else:
                stage = self.validated(STAGES[table["do"]], table, ("stage", number))
            found.append(stage or Unknown.model_validate({}))
        return tuple(found)


def located(
    scenario: Scenario, inputs: Inputs, wrong: Sequence[str], complain: Callable[[Place, str], None]
) -> Scenario:
    """Return the scenario with its chief and the initial states of all craft.

    `wrong` holds the lines already reported, whose keys are skipped; `complain` takes a place and a text.
    """
    found, scenario = Findings(wrong), replace(scenario, inputs=inputs)
    if not found.sound(ORBIT):
        return scenario
    try:
        chief = scenario.orbit.origin(inputs)
    except ValueError as error:
        complain(("orbit", "chief"), str(error))
        return scenario
    field = None
    if chief is not None:
        try:
            scenario = replace(scenario, chief=chief, orbit=scenario.orbit.following(chief, scenario.stages))
        except ValueError as error:
            complain(("orbit", "chief"), str(error))
            return scenario
        if not found.sound(r"orbit\.field"):
            return scenario
        try:
            field = scenario.field
        except ValueError as error:
            key, _, words = str(error).partition(": ")
            complain(("orbit", key), words)
            return scenario
    if chief is not None and scenario.orbit.model != "hill":
        from closeform.dynamics.force_model.field import Field  # only these scenarios need it

        field = Field(chief, 2 if scenario.orbit.model == "j2" else 0)  # whose frame turns with the chief
    placed = list(scenario.craft)
    for number, craft in enumerate(placed):
        inertially = craft.start is not None and craft.start.inertially
        for key, begins in (("start", inertially), ("states", craft.states is not None)):
            if begins and found.sound(rf"craft\.{key}"):
                from closeform.scenario.start_state import at_start  # only these craft need it

                try:
                    placed[number] = craft.known_at(at_start(craft, chief, scenario.epoch, inputs, field))
                except ValueError as error:
                    complain(("craft", number, key), str(error))
    return replace(scenario, craft=tuple(placed))


def changes(before: str, after: str) -> list[str]:
    """Return one line for each key that differs between two texts, with its new and its old value.

    The list is empty if the files differ only in layout or comments.
    """
    old, new = (dict(leaves(toml(text, "scenario"))) for text in (before, after))
    return [
        f"{dotted(place)} {value_at(old, place)}, not {value_at(new, place)}"
        for place in {**old, **new}
        if place not in old or place not in new or old[place] != new[place]
    ]


def leaves(raw: Any, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Yield each value of a file with its place; nested tables and lists are expanded."""
    inner = raw.items() if isinstance(raw, Mapping) else enumerate(raw)
    for key, value in inner:
        if isinstance(value, Mapping | list) and value:
            yield from leaves(value, (*place, key))
        else:
            yield (*place, key), value


def value_at(found: Mapping[Place, Any], place: Place) -> str:
    """Return the value at a place as text, or "absent" if the key is missing."""
    return shown(found[place]) if place in found else "absent"
