"""Base classes of the [[stage]] tables: all stages, those with a drift, those with thrust."""

from collections.abc import Iterator
from math import inf
from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field

from closeform.safety.failures import DegradedThrust, Failure, MissedBurns, StuckOnThrust, ThrustLost
from closeform.scenario.engine import Engine
from closeform.scenario.formation import Goal, Target
from closeform.scenario.quantity import SPEED, Reader
from closeform.scenario.table import Drift, Length, Name, Names, Share, Span, Table

Cost = Literal["energy", "delta-v"]
Failed = Literal["thrust lost", "burns missed", "thrust weak", "thrust stuck"]


class StageTable(Table):
    """Keys and properties that all stages share."""

    keeps_out: ClassVar[bool] = True  # whether the stage needs keep_out in [craft]
    searches: ClassVar[bool] = False  # whether the stage needs [sensor], [search] and craft groups

    name: Name | None = Field(None, examples=['"threat"'])
    sigmas: Annotated[float, Field(gt=0, le=1000)] | None = Field(None, examples=["3.0"])
    max_probability: Annotated[float, Field(gt=0, le=1)] | None = Field(None, examples=["1e-4"])

    @property
    def assigns(self) -> bool:
        """True if the plan assigns the slots to the craft."""
        return False

    @property
    def verb(self) -> str:
        """Value of `do`."""
        return type(self).__name__.lower()

    @property
    def durations(self) -> dict[str, Span]:
        """Durations of the stage by key."""
        keys = "length", "within", "drift"
        return {key: value for key in keys if (value := getattr(self, key, None)) is not None}

    @property
    def craft_named(self) -> dict[str, tuple[str, ...]]:
        """Craft that the stage names, by key."""
        return {}

    def moving(self, names: Names) -> Names:
        """Return the names of the craft that may thrust in the stage, in planning order."""
        return ()

    @property
    def targets(self) -> dict[str, Target | Goal]:
        """States or formations that craft move to, by key."""
        return {}


class Drifting(StageTable):
    """Stage with a passive-safety horizon: no conflict occurs during free drift for `drift` afterwards."""

    drift: Drift | None = Field(None, examples=['"24 h"'])

    @property
    def for_ever(self) -> bool:
        """True if the drift has no end."""
        return self.drift is not None and self.drift.seconds == inf

    @property
    def lasting(self) -> str:
        """Duration of the drift as text."""
        return "for ever" if self.for_ever else f"for {self.drift}"

    @property
    def what_fails(self) -> Failure:
        """Failure that precedes the drift."""
        return ThrustLost()


class ArrivalTolerance(Table):
    """Largest arrival error that pulses of thrusters may leave.

    Relative satellite navigation resolves a decimetre and a tenth of a millimetre per second, so that a
    tighter tolerance has little meaning. An along-track error of 1 mm/s drifts 17 m per orbit at 500 km.
    """

    position: Length = Field(1.0, examples=['"1 m"'])
    velocity: Annotated[float, BeforeValidator(Reader(SPEED, least="positive"))] = Field(
        1e-3, examples=['"1 mm/s"']
    )


class Thrusting(Engine, Drifting):
    """Stage with thrust: the cost to minimize, the engine and the failure to consider."""

    arrival: ArrivalTolerance = Field(
        default_factory=lambda: ArrivalTolerance.model_validate({}),
        examples=['{ position = "1 m", velocity = "1 mm/s" }'],
    )
    cost: Cost = Field("energy", examples=['"delta-v"'])
    failure: Failed | None = Field(None, examples=['"thrust lost"'])
    least: Share | None = Field(None, examples=['"90 %"'])
    longest: Span | None = Field(None, examples=['"10 s"'])

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        yield from self.only_with("failure", "drift")
        if self.least is not None and self.failure not in ("burns missed", "thrust weak"):
            yield 'least goes with failure = "burns missed" or "thrust weak" only; remove least'
        if self.least is not None and self.least >= 1.0:
            yield 'least is a share below 100 %; write for example least = "90 %"'
        if (self.longest is not None) != (self.failure == "thrust stuck"):
            yield 'failure = "thrust stuck" and longest go together; write for example longest = "10 s"'
        if self.longest is not None and self.longest.orbits:
            yield 'longest is a time; write for example longest = "10 s"'

    @property
    def plans_drift(self) -> bool:
        """True if a plan can be made passively safe for the drift: loss of thrust and a finite horizon."""
        lost = self.failure in (None, "thrust lost")
        return self.drift is not None and not self.for_ever and lost

    @property
    def what_fails(self) -> Failure:
        if self.failure == "thrust stuck" and self.longest is not None:
            return StuckOnThrust(self.longest.seconds)
        if self.failure in ("burns missed", "thrust weak"):
            return (MissedBurns if self.failure == "burns missed" else DegradedThrust)(self.least or 0.0)
        return ThrustLost()
