"""What tables of [[stage]] have in common: all, those whose craft drift on, those whose craft thrust."""

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
    """What every stage has."""

    keeps_out: ClassVar[bool] = True  # whether it needs [craft] keep_out
    searches: ClassVar[bool] = False  # whether it needs [sensor], [search] and craft groups

    name: Name | None = Field(None, examples=['"threat"'])
    sigmas: Annotated[float, Field(gt=0, le=1000)] | None = Field(None, examples=["3.0"])
    max_probability: Annotated[float, Field(gt=0, le=1)] | None = Field(None, examples=["1e-4"])

    @property
    def assigns(self) -> bool:
        """Whether it is left open who takes which place."""
        return False

    @property
    def verb(self) -> str:
        """What stands in `do`."""
        return type(self).__name__.lower()

    @property
    def durations(self) -> dict[str, Span]:
        """The stage's durations by key."""
        keys = "length", "within", "drift"
        return {key: value for key in keys if (value := getattr(self, key, None)) is not None}

    @property
    def craft_named(self) -> dict[str, tuple[str, ...]]:
        """The craft that the stage names, by key."""
        return {}

    def moving(self, names: Names) -> Names:
        """Who of all craft may thrust in it, those that it plans for first."""
        return ()

    @property
    def targets(self) -> dict[str, Target | Goal]:
        """The states or formations that craft move to, by key."""
        return {}


class Drifting(StageTable):
    """What stages share whose craft may drift on: for how long afterwards nobody is to enter a zone."""

    drift: Drift | None = Field(None, examples=['"24 h"'])

    @property
    def for_ever(self) -> bool:
        """Whether the drift has no end."""
        return self.drift is not None and self.drift.seconds == inf

    @property
    def lasting(self) -> str:
        """For how long, in words."""
        return "for ever" if self.for_ever else f"for {self.drift}"

    @property
    def what_fails(self) -> Failure:
        """What goes wrong before that."""
        return ThrustLost()


class ArrivalTolerance(Table):
    """Greatest miss of a target that pulses of thrusters may leave.

    Relative navigation by satellite signals resolves a decimetre and a tenth of a millimetre per second, so
    that smaller misses than these say little.  Along the track 1 mm/s drifts 17 m an orbit at 500 km.
    """

    position: Length = Field(1.0, examples=['"1 m"'])
    velocity: Annotated[float, BeforeValidator(Reader(SPEED, least="positive"))] = Field(
        1e-3, examples=['"1 mm/s"']
    )


class Thrusting(Engine, Drifting):
    """What stages share in which craft thrust: what is least, by which engine, and what may fail."""

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
        """Whether a plan can be made to be safe for that drift: when thrust is lost, and it has an end."""
        lost = self.failure in (None, "thrust lost")
        return self.drift is not None and not self.for_ever and lost

    @property
    def what_fails(self) -> Failure:
        if self.failure == "thrust stuck" and self.longest is not None:
            return StuckOnThrust(self.longest.seconds)
        if self.failure in ("burns missed", "thrust weak"):
            return (MissedBurns if self.failure == "burns missed" else DegradedThrust)(self.least or 0.0)
        return ThrustLost()
