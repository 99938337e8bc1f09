"""Engine keys, which [craft] gives and a stage may override for the craft that it moves."""

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from closeform.scenario.quantity import ACCELERATION, FORCE, TIME, Reader
from closeform.scenario.table import Table
from closeform.scenario.thrusters import MinimumBit, ThrusterTable

IDLE = "of a craft without an engine write engine = false"
LIMITS = "max_thrust", "acceleration"  # alternative fields: one replaces the other


class Engine(Table):
    """Thrust limit, thrusters and specific impulse."""

    max_thrust: Annotated[float, BeforeValidator(Reader(FORCE, 1, "positive", IDLE))] | None = Field(
        None, examples=['"1.5 N"']
    )
    acceleration: Annotated[float, BeforeValidator(Reader(ACCELERATION, 1, "positive", IDLE))] | None = Field(
        None, alias="max_acceleration", examples=['"5 mm/s^2"']
    )
    thrusters: ThrusterTable | None = Field(None, examples=['"rtn"'])
    minimum_bit: MinimumBit | None = Field(None, examples=['"1 mm/s"'])
    period: Annotated[float, BeforeValidator(Reader(TIME, least="positive"))] | None = Field(
        None, examples=['"30 s"']
    )
    specific_impulse: Annotated[float, BeforeValidator(Reader(TIME, least="positive"))] | None = Field(
        None, examples=['"220 s"']
    )

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        if self.max_thrust is not None and self.acceleration is not None:
            yield "max_thrust and max_acceleration exclude each other; keep one"

    @property
    def limited(self) -> bool:
        """True if the thrust has a limit."""
        return self.max_thrust is not None or self.acceleration is not None

    @property
    def told(self) -> dict[str, Any]:
        """Given values by field; one thrust limit resets the other."""
        given = {name: value for name in Engine.model_fields if (value := getattr(self, name)) is not None}
        return dict.fromkeys(LIMITS) | given if self.limited else given
