"""Reader of scenario files: a valid TOML text becomes a Scenario, an invalid one a list of errors.

Errors are found in three rounds: of TOML; within the tables, whose keys and rules are declared in their
models; and between the tables (`checks`). A round with errors is the last one.
"""

import os
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BeforeValidator, Field, ValidationError

from closeform.scenario.checks import check
from closeform.scenario.craft import Craft, SearchTable, SensorTable
from closeform.scenario.inputs import Inputs
from closeform.scenario.orbit import FeedbackTable, FlightTable, NavigationTable, OrbitTable, VerdictTable
from closeform.scenario.scenario import Scenario
from closeform.scenario.stages import Stage
from closeform.scenario.study import Study, points, words
from closeform.scenario.table import Place, ScenarioError, Table, complaints, dotted, setting

DEEPEST = 50  # parts of a dotted key: parser memory grows with their square, and the parser may recurse
# possessive, and from the beginning of a word only: the search time is linear in the text length
DEEP = re.compile(rf"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{DEEPEST}}}""")
KEY = re.compile(r"""\s*+(\[{0,2}[\w."' -]++\]{0,2})\s*+(?:=|#|$)""")  # at the beginning of a line
Model = TypeVar("Model", bound=Table)


def as_title(value: Any) -> str:
    """Return a title: one line of text that is not empty."""
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise ValueError('must be one line of text; write for example title = "My cluster"')
    return value


class File(Table):
    """Scenario file."""

    form: Literal[1] = setting("1", "format of the file", ..., alias="closeform")
    title: Annotated[str, BeforeValidator(as_title)] = setting('"A moves past B"', "one line of text", ...)
    orbit: OrbitTable = setting('{ altitude = "500 km" }', "orbit of the formation", ...)
    craft: tuple[Craft, ...] = setting('{ name = ["F1", "F2"] }', "spacecraft", ...)
    sensor: SensorTable | None = setting('{ half_angle = "70 deg" }', "relative sensor")
    search: SearchTable | None = setting('{ method = "modified" }', "search schedule")
    feedback: FeedbackTable | None = setting('{ every = "60 s" }', "feedback corrections")
    navigation: NavigationTable | None = setting('{ position = "10 cm" }', "navigation uncertainty")
    flights: FlightTable | None = setting("{ seeds = 100 }", "simulations", alias="simulation")
    verdict: VerdictTable | None = setting('{ model_error = "refuse" }', "verdict")
    study: Study | None = setting("{ cases = 1000, seed = 1 }", "Monte Carlo study")
    stages: Annotated[tuple[Stage, ...], Field(strict=False, min_length=1)] = setting(
        '[{ do = "coast", for = "1 orbit" }]', "stages of the mission", ..., alias="stage"
    )


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


def parse(text: str, file: str = "scenario") -> Scenario:
    """Return the scenario that a TOML text describes; `file` names it in messages.

    A byte-order mark is ignored. Raises ScenarioError, with one line for each error.
    """
    raw = toml(text, file)
    scenario = scenario_of(raw, text, file)
    if scenario.study is None or not scenario.study.sweep:
        return scenario
    return replace(scenario, points=tuple(swept(raw, scenario)))


def scenario_of(raw: dict[str, Any], text: str, file: str) -> Scenario:
    """Return the scenario that the tables of a file describe."""
    found = read(File, raw, file)
    tables = {name: getattr(found, name) for name in File.model_fields if name != "form"}
    count = len(found.craft)
    tables["craft"] = tuple(one.placed(k, count) for k, one in enumerate(found.craft))
    scenario = Scenario(file, text, **tables, inputs=Inputs(Path(file).parent))
    try:
        scenario = with_chief(scenario)
        scenario = with_starts(scenario)
    except Misplaced as error:
        raise ScenarioError(
            file, [f"{dotted(as_written(place, raw))}: {text}" for place, text in error.found]
        ) from None
    if lines := check(scenario):
        raise ScenarioError(file, lines)
    return scenario


def swept(raw: dict[str, Any], scenario: Scenario) -> Iterator[Scenario]:
    """Yield the scenario at each point of its sweep; raise ScenarioError at the first invalid point."""
    file, same = scenario.file, [stage.verb for stage in scenario.stages]
    try:
        for place, (chosen, changed) in enumerate(points(raw)):
            point = scenario_of(changed, scenario.text, file)
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


def read(model: type[Model], raw: Mapping[str, Any], file: str) -> Model:
    """Return the validated contents of a file; raise ScenarioError with all errors within its tables."""
    lines, rows = rows_of(raw["craft"]) if "craft" in raw else ([], ())
    try:
        found = model.model_validate({**raw, "craft": rows} if "craft" in raw else raw)
    except ValidationError as error:
        lines += [f"{dotted(as_written(place, raw))}: {text}" for place, text in complaints(error, model)]
    if lines:
        raise ScenarioError(file, lines)
    return found


def rows_of(table: Any) -> tuple[list[str], tuple[dict[str, Any], ...]]:
    """Return error lines about [craft], and one table for each craft.

    A list has one value for each craft; other values are for all.
    """
    if not isinstance(table, dict):
        return ["craft: is not a table; write it as [craft]"], ()
    names = table.get("name", [])
    count = len(names) if isinstance(names, list) else 1
    if not count:
        return [f"craft.name: {Craft.missing('name')}"], ()
    columns = {key: value if isinstance(value, list) else [value] * count for key, value in table.items()}
    remedy = f"for {count} craft; give one value for all or one each"
    lines = [
        f"{dotted(('craft', key))}: has {len(column)} values {remedy}"
        for key, column in columns.items()
        if len(column) != count
    ]
    rows = (
        {key: column[min(k, len(column) - 1)] for key, column in columns.items() if column}
        for k in range(count)
    )
    return lines, tuple(rows)


def as_written(place: Place, raw: Mapping[str, Any]) -> Place:
    """Return a place as the file has it: each key of [craft] is one value for all craft, or a list."""
    if place[:1] != ("craft",) or len(place) < 2:
        return place
    number, *rest = place[1:]
    listed = bool(rest) and isinstance(raw["craft"].get(rest[0]), list)
    return "craft", *rest[:1], *([number] if listed else []), *rest[1:]


class Misplaced(ValueError):
    """Errors about the chief or the starts of craft, `found` with their places."""

    def __init__(self, *found: tuple[Place, str]) -> None:
        self.found = found


def with_chief(scenario: Scenario) -> Scenario:
    """Return the scenario with its chief; raise Misplaced for an invalid one."""
    assert scenario.inputs is not None
    try:
        chief = scenario.orbit.origin(scenario.inputs)
        if chief is None:
            return scenario
        orbit = scenario.orbit.following(chief, scenario.stages)
    except ValueError as error:
        raise Misplaced((("orbit", "chief"), str(error))) from None
    scenario = replace(scenario, chief=chief, orbit=orbit)
    try:
        _ = scenario.field
    except ValueError as error:
        key, _, words = str(error).partition(": ")
        raise Misplaced((("orbit", key), words)) from None
    return scenario


def with_starts(scenario: Scenario) -> Scenario:
    """Return the scenario with the initial states of craft from files and inertial states.

    Raises Misplaced for invalid ones.
    """
    chief, field, inputs = scenario.chief, scenario.field, scenario.inputs
    assert inputs is not None
    if chief is not None and scenario.orbit.model != "hill":
        from closeform.dynamics.force_model.field import Field  # only these scenarios need it

        field = Field(chief, 2 if scenario.orbit.model == "j2" else 0)  # whose frame turns with the chief
    placed, wrong = list(scenario.craft), list[tuple[Place, str]]()
    for number, craft in enumerate(placed):
        key = "states" if craft.states is not None else "start"
        if craft.states is not None or (craft.start is not None and craft.start.inertially):
            from closeform.scenario.start_state import at_start  # only these craft need it

            try:
                placed[number] = craft.known_at(at_start(craft, chief, scenario.epoch, inputs, field))
            except ValueError as error:
                wrong.append((("craft", number, key), str(error)))
    if wrong:
        raise Misplaced(*wrong)
    return replace(scenario, craft=tuple(placed))
