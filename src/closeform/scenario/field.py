"""High-fidelity model: `field` of [orbit], [feedback], [navigation], [simulation] and [verdict]."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from closeform.scenario.quantity import ANGLE as TURN
from closeform.scenario.quantity import DENSITY, LENGTH, SHARE, SPEED, TIME, Parts, Reader
from closeform.scenario.table import Length, Table

if TYPE_CHECKING:
    from closeform.dynamics.feedback import Feedback, Navigation

DEGREES = (0, 2, 3, 4, 5, 6)
AIR = ("density", "at_altitude", "scale_height")
Seconds = Annotated[float, BeforeValidator(Reader(TIME, least="positive"))]
Late = Annotated[float, BeforeValidator(Reader(TIME, least="zero"))]
Deviation = Annotated[float, BeforeValidator(Reader(LENGTH, least="zero"))]
Speed = Annotated[float, BeforeValidator(Reader(SPEED, least="zero"))]
as_thrust_error = Parts(
    (Reader(SHARE, least="zero"), Reader(TURN, least="zero")), "a share, a comma and an angle", '"1 %, 1 deg"'
)
as_navigation = Parts(
    (Reader(LENGTH, least="zero"), Reader(SPEED, least="zero")),
    "a length, a comma and a speed",
    '"10 cm, 0.3 mm/s"',
)
ThrustError = Annotated[tuple[float, float], BeforeValidator(as_thrust_error)]


def as_degree(zonals: int) -> int:
    """Return a supported degree of oblateness; raise ValueError for another."""
    if zonals not in DEGREES:
        raise ValueError(f"is 0 or a degree from 2 to 6, not {zonals}; write for example zonals = 2")
    return zonals


class FieldTable(Table):
    """Table `field` of [orbit]: the Earth's oblateness and its atmosphere."""

    zonals: Annotated[int, AfterValidator(as_degree)] = Field(2, examples=["2"])
    density: Annotated[float, BeforeValidator(Reader(DENSITY, least="positive"))] | None = Field(
        None, examples=['"5.2e-13 kg/m^3"']
    )
    at_altitude: Length | None = Field(None, examples=['"500 km"'])
    scale_height: Length | None = Field(None, examples=['"60 km"'])

    def flaws(self) -> Iterator[str]:
        missing = [key for key in AIR if getattr(self, key) is None]
        if missing and len(missing) < len(AIR):
            given = next(key for key in AIR if key not in missing)
            yield f"{given} needs {missing[0]}; add for example {missing[0]} = {self.examples()[missing[0]]}"

    @property
    def air(self) -> tuple[float, float, float] | None:
        """Density [kg/m^3], its altitude [m] and its scale height [m]; None without an atmosphere."""
        if self.density is None or self.at_altitude is None or self.scale_height is None:
            return None
        return self.density, self.at_altitude, self.scale_height


class FeedbackTable(Table):
    """Table [feedback]: interval of the measurements, and horizon and form of the feedback corrections."""

    every: Seconds = Field(60.0, examples=['"60 s"'])
    horizon: Seconds = Field(600.0, examples=['"10 min"'])
    impulses: Annotated[int, Field(ge=0)] = Field(0, examples=["6"])
    delay: Late = Field(0.0, examples=['"5 s"'])

    def flaws(self) -> Iterator[str]:
        if self.impulses == 1:
            yield "impulses is 0, thrust that lasts, or two or more; write for example impulses = 6"
        if self.horizon < self.every:
            yield (
                f"horizon of {self.horizon:g} s is shorter than the {self.every:g} s from one measurement to "
                'the next; write for example horizon = "10 min"'
            )
        if self.delay > self.every:
            yield (
                f"delay of {self.delay:g} s is longer than the {self.every:g} s from one measurement to "
                'the next; write for example delay = "5 s"'
            )
        if self.delay and self.impulses:
            yield "delay goes with thrust that lasts; remove delay, or impulses"

    def build(self) -> "Feedback":
        """Return the feedback that the table describes."""
        from closeform.dynamics.feedback import Feedback

        return Feedback(self.every, self.horizon, self.impulses, self.delay)


class NavigationTable(Table):
    """Table [navigation]: navigation uncertainty of the measured states."""

    position: Deviation = Field(0.0, examples=['"10 cm"'])
    velocity: Speed = Field(0.0, examples=['"0.3 mm/s"'])
    position_bias: Deviation = Field(0.0, examples=['"5 cm"'])
    velocity_bias: Speed = Field(0.0, examples=['"0.1 mm/s"'])
    correlation: Late = Field(0.0, examples=['"5 min"'])

    def build(self) -> "Navigation":
        """Return the navigation that the table describes."""
        from closeform.dynamics.feedback import Navigation

        biases = self.position_bias, self.velocity_bias
        return Navigation(self.position, self.velocity, *biases, self.correlation)


class FlightTable(Table):
    """Table [simulation]: number and control of the simulations of a run in the high-fidelity model."""

    control: Literal["track", "replan", "open"] = Field("track", examples=['"track"'])
    seeds: Annotated[int, Field(ge=1)] = Field(100, examples=["100"])


class VerdictTable(Table):
    """Table [verdict]: result of a run whose model error exceeds the margin."""

    model_error: Literal["report", "refuse"] = Field("report", examples=['"refuse"'])
