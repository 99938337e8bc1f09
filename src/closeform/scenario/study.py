"""Table [study]: varied keys of a Monte Carlo study, and the points of a sweep."""

import re
from collections.abc import Iterator, Mapping
from copy import deepcopy
from functools import cache
from itertools import product
from math import prod
from typing import Annotated, Any, Literal

from pydantic import Field

from closeform.scenario.craft import Craft, SearchTable, SensorTable
from closeform.scenario.orbit import FeedbackTable, FieldTable, NavigationTable
from closeform.scenario.quantity import TIME, Reader, shown
from closeform.scenario.table import Table, notes_of, setting

Pair = Annotated[tuple[str, str], Field(strict=False)]
DRAWS = ("uniform", "normal", "ball", "shell", "chance", "choice")
STATES = ("craft.position", "craft.velocity")
FAILS = "craft.fails"  # loss of thrust at a random time of the mission
SEARCHED = (  # search keys of each craft
    "craft.pointing_error",
    "craft.slew_rate_error",
    "craft.start_offset",
    "craft.slew_acceleration",
    "craft.silent",
    "craft.solar_acceleration",
    "sensor.half_angle",
    "sensor.range",
    "search.slew_rate",
)
TABLES: dict[str, type[Table]] = {  # tables whose numeric keys may vary
    "craft": Craft,
    "sensor": SensorTable,
    "search": SearchTable,
    "navigation": NavigationTable,
    "feedback": FeedbackTable,
    "orbit.field": FieldTable,
}
TABLED = "navigation.", "feedback.", "orbit.field."  # one value for all craft
UNPLANNED = "craft.ballistic", *TABLED  # values of the simulation that are unknown to plans
NORMAL_REACH = 8.3  # sigmas: limit of a normal value from a random number of 53 bits
ROW = re.compile(r"source|at once|never|(IPS|OPS|mOPS|NFS) [1-9][0-9]*")
Step = Annotated[float, Reader(TIME, least="0.01 s")]


class Draw(Table):
    """Distribution of one key, in units of that key."""

    alternatives = (DRAWS,)
    uniform: str | None = setting('"500 m"', "each component uniform between plus and minus this")
    normal: str | None = setting('"0.1 %"', "standard deviation of each component")
    ball: str | None = setting('"0.5 deg"', "radius of a uniformly filled ball, for vectors")
    shell: Pair | None = setting(
        '["1 km", "2 km"]', "inner and outer radius of a uniformly filled shell, for vectors"
    )
    chance: Annotated[float, Field(ge=0, le=1)] | None = setting(
        "0.01", "probability, for `craft.silent` and `craft.fails`"
    )
    choice: Annotated[tuple[Any, ...], Field(strict=False, min_length=1)] | None = setting(
        '["1 km", "2 km"]', "values that replace the nominal one"
    )

    @property
    def kind(self) -> str:
        """Name of the distribution."""
        return next(name for name in DRAWS if getattr(self, name) is not None)

    def numbers(self, key: str) -> tuple[Any, ...]:
        """Return the parameters for a key in SI units: sizes, the values of a choice, or a chance."""
        reader = readers()[key]
        if reader is None:
            return (self.chance,)
        if self.choice is not None:
            return tuple(reader(value) for value in self.choice)
        given = getattr(self, self.kind)
        return tuple(one(reader)(size) for size in (given if self.shell is not None else (given,)))


@cache
def readers() -> dict[str, Reader | None]:
    """Return the reader of every key that may vary; None for a truth value."""
    found: dict[str, Reader | None] = {"craft.silent": None}
    for section, table in TABLES.items():
        for name, field in table.model_fields.items():
            readers = (note for note in notes_of(field) if isinstance(note, Reader))
            found |= {f"{section}.{table.key_of(name)}": reader for reader in readers}
    return found | {FAILS: None}


class Study(Table):
    """Table [study]: number of cases, seed and draws of a Monte Carlo study."""

    cases: Annotated[int, Field(ge=1)] = setting("1000", "number of cases", ...)
    seed: Annotated[int, Field(ge=0)] = setting("1", "seed of the random samples", ...)
    draws: Literal["vary", "errors", "replanned"] = setting(
        '"errors"', "samples of `vary`, the errors of a mission, or both with new plans in each stage", "vary"
    )
    vary: dict[str, Draw] = setting(
        '{ "craft.position" = { ball = "10 m" } }',
        "samples by quoted key, drawn for each case and spacecraft",
        dict,
        only_if={"draws": ("vary", "replanned")},
    )
    sweep: dict[str, Annotated[tuple[Any, ...], Field(strict=False)]] = setting(
        '{ "sensor.half_angle" = ["65 deg", "70 deg"] }',
        "values by quoted key",
        dict,
        only_if={"draws": ("vary", "replanned")},
    )
    sampled: Annotated[tuple[Step, ...], Field(strict=False)] = setting(
        '["1 s", "60 s"]',
        "steps of a simulation whose locks are compared; `lock` only",
        (),
        only_if={"draws": ("vary",)},
    )
    pages: bool = setting("false", "false to omit the animated pages of single cases", True)
    published: dict[str, str] = setting(
        '{ source = "S04", never = "0" }',
        "published values by row of the printed table",
        dict,
        only_if={"draws": ("vary",)},
    )

    def flaws(self) -> Iterator[str]:
        for key, values in self.sweep.items():
            if not values:
                yield f"sweep has no values of {key}; give some, or remove it"
        for row, text in self.published.items():
            if ROW.fullmatch(row) is None:
                yield (
                    f'published has {shown(row)}, which is not a row of the printed table; use "source", '
                    '"at once", "never" or a phase like "IPS 1"'
                )
            if not text.isprintable() or len(text) > (80 if row == "source" else 20):
                yield (f"published {shown(row)} does not fit; write at most 20 characters, or 80 for source")


def draw_error(key: str, draw: Draw) -> str | None:
    """Return the error of a draw for this key, which is one of `readers`, or None."""
    reader = readers()[key]
    if reader is None:
        return None if draw.chance is not None else "is true or false; write { chance = 0.01 }"
    instead = f"write {{ normal = {one(reader).example} }}"
    if draw.chance is not None:
        return f"is a {reader.kind.name}, chance is for true or false; {instead}"
    if reader.size == 1 and (draw.ball is not None or draw.shell is not None):
        return f"is one number, ball and shell are for vectors; {instead}"
    try:
        numbers = draw.numbers(key)
    except ValueError as error:
        return str(error)
    if draw.shell is not None and numbers[0] > numbers[1]:
        return f"shell {shown(draw.shell)} begins with its outer radius; write the inner radius first"
    return None


def one(reader: Reader) -> Reader:
    """Return the reader of a size: one non-negative number of the same kind."""
    return Reader(reader.kind, 1, "zero")


MOST_POINTS = 1000
PART = re.compile(r"(\w+)(?:\[(\d+)\])?")  # of a key, with an optional index that counts from 1
DRAWN = "study.vary."


def points(raw: Mapping[str, Any]) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Yield each combination of the swept values, by key, with the file contents that result from it.

    The contents no longer include the sweep. The last key changes fastest. Raises ValueError, beginning with
    the key, if the file has no such place.
    """
    sweep = raw["study"]["sweep"]
    if prod(map(len, sweep.values())) > MOST_POINTS:
        raise ValueError(f"more than {MOST_POINTS} points; give fewer values")
    for values in product(*sweep.values()):
        changed = deepcopy(dict(raw))
        del changed["study"]["sweep"]
        chosen = dict(zip(sweep, values, strict=True))
        for key, value in chosen.items():
            put(changed, key, value)
        yield chosen, changed


def put(raw: dict[str, Any], key: str, value: Any) -> None:
    """Write one value into the contents of a file."""
    path = ["study", "vary", key.removeprefix(DRAWN)] if key.startswith(DRAWN) else key.split(".")
    place: Any = raw
    for part in path[:-1]:
        found = PART.fullmatch(part)
        place = place.get(found[1]) if found is not None and isinstance(place, dict) else None
        if found is not None and found[2] and isinstance(place, list):
            place = place[int(found[2]) - 1] if 0 < int(found[2]) <= len(place) else None
        if not isinstance(place, dict):
            raise ValueError(f"{key}: there is no {part} in the file; add it, or name a key that is there")
    place[path[-1]] = value


def words(chosen: Mapping[str, Any]) -> str:
    """Return the values of a point as text."""
    return ", ".join(f"{key} = {text(value)}" for key, value in chosen.items())


def text(value: Any) -> str:
    """Return a value as text; a draw as its kind and size."""
    if isinstance(value, dict):
        return " ".join(f"{name} {text(one)}" for name, one in value.items())
    if isinstance(value, list):
        return ", ".join(map(text, value))
    return str(value)
