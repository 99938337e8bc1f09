"""[study]: what a Monte Carlo study varies. Each draw adds to the nominal value or replaces it."""

from functools import cache
from typing import Annotated, Any, Self, get_args

from pydantic import Field, model_validator

from closeform.scenario.craft import Craft, SearchTable, SensorTable
from closeform.scenario.quantity import Reader, shown
from closeform.scenario.table import Table

Pair = Annotated[tuple[str, str], Field(strict=False)]
DRAWS = ("uniform", "normal", "ball", "shell", "chance", "choice")


class Draw(Table):
    """One key's distribution; what its texts mean depends on the key."""

    uniform: str | None = Field(None, examples=['"500 m"'])
    normal: str | None = Field(None, examples=['"0.1 %"'])
    ball: str | None = Field(None, examples=['"0.5 deg"'])
    shell: Pair | None = Field(None, examples=['["1 km", "2 km"]'])
    chance: Annotated[float, Field(ge=0, le=1)] | None = Field(None, examples=["0.01"])
    choice: Annotated[tuple[Any, ...], Field(strict=False, min_length=1)] | None = Field(
        None, examples=['["1 km", "2 km"]']
    )

    @model_validator(mode="after")
    def complete(self) -> Self:
        return self.one_of(*DRAWS)


@cache
def readers() -> dict[str, Reader | None]:
    """Every key that may vary: the reader of its quantity, None for a truth value."""
    found: dict[str, Reader | None] = {"craft.silent": None}
    for section, table in (("craft", Craft), ("sensor", SensorTable), ("search", SearchTable)):
        for name, field in table.model_fields.items():
            notes = [*field.metadata]
            for part in get_args(field.annotation):  # X | None keeps its notes in X
                notes += getattr(part, "__metadata__", ())
            for note in notes:
                if isinstance(reader := getattr(note, "func", None), Reader):
                    found[f"{section}.{name}"] = reader
    return found


class Study(Table):
    """[study]."""

    cases: Annotated[int, Field(ge=1)] = Field(examples=["1000"])
    seed: Annotated[int, Field(ge=0)] = Field(examples=["1"])
    vary: dict[str, Draw] = Field(default_factory=dict, examples=['{ "craft.position" = { ball = "10 m" } }'])


def draw_error(key: str, draw: Draw) -> str | None:
    """What is wrong with a draw for this key, which is one of `readers`; None if nothing is."""
    reader = readers()[key]
    if reader is None:
        return None if draw.chance is not None else "is true or false; write { chance = 0.01 }"
    instead = f"write {{ normal = {one(reader).example} }}"
    if draw.chance is not None:
        return f"is a {reader.kind.name}, chance is for true or false; {instead}"
    if reader.size == 1 and (draw.ball is not None or draw.shell is not None):
        return f"is one number, ball and shell are for vectors; {instead}"
    try:
        for size in (draw.uniform, draw.normal, draw.ball, *(draw.shell or ())):
            if size is not None:
                one(reader)(size)
        for value in draw.choice or ():
            reader(value)
    except ValueError as error:
        return str(error)
    if draw.shell is not None and one(reader)(draw.shell[0]) >= one(reader)(draw.shell[1]):  # type: ignore[operator]  # numbers: size 1
        return f"shell {shown(draw.shell)} must grow; write the inner radius first"
    return None


def one(reader: Reader) -> Reader:
    """The reader of a size: one number, not negative, of the same kind."""
    return Reader(reader.kind, 1, "zero")
