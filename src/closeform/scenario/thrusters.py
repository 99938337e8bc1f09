"""Thruster directions and minimum impulse bit of a craft."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from closeform.fuel.thrusters import Thrusters
from closeform.scenario.quantity import IMPULSE, SPEED, Reader, shown, unit_of
from closeform.scenario.table import Table, Vector

Directions = Annotated[tuple[Annotated[Vector, Field(strict=False)], ...], Field(strict=False, min_length=1)]


class ThrusterTable(Table):
    """Table `thrusters`: "rtn" for one thruster along and one against each axis, or a list of directions."""

    directions: Directions = Field(examples=["[[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]"])
    frame: Literal["orbit", "inertial"] = Field("orbit", examples=['"inertial"'])

    @model_validator(mode="before")
    @classmethod
    def by_name(cls, value: Any) -> Any:
        """Return the table that a name stands for; return other values unchanged."""
        if isinstance(value, str):
            if value != "rtn":
                raise ValueError(f'{shown(value)} is not known here; use "rtn" or a table with directions')
            return {"directions": Thrusters.rtn().directions.tolist()}
        return value

    def flaws(self) -> Iterator[str]:
        try:
            Thrusters(self.directions, self.frame)
        except ValueError as error:
            yield str(error)


@dataclass(frozen=True)
class Bit:
    """Minimum impulse bit of a thruster: a `velocity` [m/s] or an `impulse` [N s]."""

    velocity: float = 0.0
    impulse: float = 0.0

    def on(self, mass: float) -> float:
        """Return the bit as a velocity change [m/s] of a craft of the given mass [kg]."""
        return self.velocity + (self.impulse / mass if self.impulse else 0.0)


def as_bit(value: Any) -> Bit:
    """Return a minimum impulse bit, given as a speed or as an impulse."""
    if isinstance(value, str) and unit_of(" ".join(value.split()[1:]))[1] == IMPULSE.dimension:
        return Bit(impulse=Reader(IMPULSE, least="positive").numbers(value)[0])
    return Bit(velocity=Reader(SPEED, least="positive").numbers(value)[0])


MinimumBit = Annotated[Bit, BeforeValidator(as_bit)]
