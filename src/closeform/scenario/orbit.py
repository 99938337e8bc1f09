"""Table [orbit]: a circular orbit, deep space, or a chief at an epoch."""

from collections.abc import Iterator
from math import atan2, cos, pi, sin, sqrt
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from closeform.arrays import Floats
from closeform.exchange.epochs import SYSTEMS, Epoch
from closeform.motion.elements import inertial_from_elements
from closeform.motion.mean_motion import EARTH_MU, EARTH_RADIUS
from closeform.motion.orbit import Orbit
from closeform.scenario.field import FieldTable
from closeform.scenario.inputs import Inputs
from closeform.scenario.quantity import BALLISTIC, GRAVITY, LENGTH, RATE, TIME, Reader, shown
from closeform.scenario.table import Angle, FileName, Inertial, Length, Table

if TYPE_CHECKING:
    from closeform.exchange.chief import Chief

CLOSE_TO_A_CIRCLE = 0.1  # largest eccentricity for which Hill's equations are useful


def as_epoch(value: Any) -> Epoch:
    """Return an epoch in UTC, or in the time system that follows it."""
    if not isinstance(value, str):
        raise ValueError(f'{shown(value)} is no text; write for example epoch = "2026-11-22T12:00:00Z"')
    try:
        return Epoch.of(value)
    except ValueError:
        others = ", ".join(SYSTEMS)
        remedy = f'write for example "2026-11-22T12:00:00Z", or another time system behind it, of {others}'
        raise ValueError(f"{shown(value)} is no epoch; {remedy}") from None


class Elements(Table):
    """Table `elements`: Keplerian elements of the chief at the epoch."""

    altitude: Length | None = Field(None, examples=['"550 km"'])
    semi_major_axis: Length | None = Field(None, examples=['"6928.137 km"'])
    eccentricity: float = Field(0.0, strict=False, ge=0.0, lt=1.0, examples=["0.001"])
    inclination: Angle = Field(examples=['"97.6 deg"'])
    ascending_node: Angle = Field(0.0, examples=['"30 deg"'])
    argument_of_perigee: Angle = Field(0.0, examples=['"90 deg"'])
    latitude: Angle | None = Field(None, examples=['"10 deg"'])
    mean_anomaly: Angle | None = Field(None, examples=['"10 deg"'])
    true_anomaly: Angle | None = Field(None, examples=['"10 deg"'])

    def flaws(self) -> Iterator[str]:
        yield from self.one_of("altitude", "semi_major_axis")
        yield from self.one_of("latitude", "mean_anomaly", "true_anomaly")
        if "argument_of_perigee" in self.model_fields_set and not self.eccentricity:
            yield "argument_of_perigee goes with eccentricity only, a circle has no perigee; remove it"

    def state(self, mu: float, radius: float) -> Floats:
        """Return the inertial state (6,) [m, m/s]."""
        a, e, w = (
            self.semi_major_axis or radius + (self.altitude or 0.0),
            self.eccentricity,
            self.argument_of_perigee,
        )
        if self.true_anomaly is not None:
            half = atan2(
                sqrt(1.0 - e) * sin(self.true_anomaly / 2), sqrt(1.0 + e) * cos(self.true_anomaly / 2)
            )
            mean = 2.0 * half - e * sin(2.0 * half)  # Kepler's equation
        else:
            mean = self.mean_anomaly if self.mean_anomaly is not None else (self.latitude or 0.0) - w
        elements = a, mean + w, e * cos(w), e * sin(w), self.inclination, self.ascending_node
        return inertial_from_elements(elements, mu)


class ChiefTable(Table):
    """Table `chief`: the orbit of the formation's origin."""

    elements: Elements | None = Field(
        None, examples=['{ altitude = "550 km", inclination = "97.6 deg", latitude = "0 deg" }']
    )
    state: Inertial | None = Field(None, examples=['"6928.137 0 0 km, 0 -1.003 7.518 km/s"'])
    oem: FileName | None = Field(None, examples=['"chief.oem"'])
    frame: str | None = Field(None, min_length=1, examples=['"GCRF"'])
    center: str | None = Field(None, min_length=1, examples=['"EARTH"'])
    ballistic: Annotated[float, BeforeValidator(Reader(BALLISTIC, least="zero"))] | None = Field(
        None, examples=['"0.02 m^2/kg"']
    )

    def flaws(self) -> Iterator[str]:
        yield from self.one_of("elements", "state", "oem")
        yield from self.only_with("frame", "elements", "state")
        yield from self.only_with("center", "elements", "state")

    def build(self, epoch: Epoch, mu: float, radius: float, inputs: Inputs) -> "Chief":
        """Return the chief; raise ValueError for an invalid one or one too far from a circle."""
        from closeform.exchange.chief import Chief  # most scenarios do not need it

        if self.oem is not None:
            chief = Chief.from_ephemeris(inputs.ephemeris(self.oem, epoch), epoch.stamp, epoch.system, mu)
            inputs.interpolated(self.oem, float(chief.interpolation_errors(0.0)))
        else:
            state = self.elements.state(mu, radius) if self.elements is not None else self.state
            place = self.frame or "EME2000", epoch.system, self.center or "EARTH"
            chief = Chief(epoch.stamp, np.array(state), *place, mu)
        if chief.eccentricity > CLOSE_TO_A_CIRCLE:
            raise ValueError(
                f"eccentricity {chief.eccentricity:.3g}, and Hill's equations, those of a circle, are of use "
                f"up to {CLOSE_TO_A_CIRCLE:g}; give another orbit"
            )
        return chief


class OrbitTable(Table):
    """Table [orbit]: the circular orbit that the formation's frame follows, or deep space."""

    deep_space: Literal[True] | None = Field(None, examples=["true"])
    altitude: Annotated[float, BeforeValidator(Reader(LENGTH, least="positive"))] | None = Field(
        None, examples=['"500 km"']
    )
    period: Annotated[float, BeforeValidator(Reader(TIME, least="positive"))] | None = Field(
        None, examples=['"95 min"']
    )
    semi_major_axis: Length | None = Field(None, examples=['"6878 km"'])
    mean_motion: Annotated[float, BeforeValidator(Reader(RATE, least="positive"))] | None = Field(
        None, examples=['"0.0634 deg/s"']
    )
    latitude: Angle = Field(0.0, examples=['"30 deg"'])
    mu: Annotated[float, BeforeValidator(Reader(GRAVITY, least="positive"))] | None = Field(
        None, examples=['"398600.4418 km^3/s^2"']
    )
    radius: Length | None = Field(None, examples=['"6378.137 km"'])
    epoch: Annotated[Epoch, BeforeValidator(as_epoch)] | None = Field(
        None, examples=['"2026-11-22T12:00:00Z"']
    )
    chief: ChiefTable | None = Field(None, examples=['{ oem = "chief.oem" }'])
    field: FieldTable | None = Field(None, examples=["{ zonals = 2 }"])

    def flaws(self) -> Iterator[str]:
        yield from self.only_with("latitude", "altitude", "period", "semi_major_axis", "mean_motion")
        yield from self.only_with("mu", "altitude", "semi_major_axis", "chief")
        yield from self.only_with("radius", "altitude", "chief")
        yield from self.one_of("altitude", "period", "semi_major_axis", "mean_motion", "deep_space", "chief")
        if self.chief is not None and self.epoch is None:
            yield f"chief needs epoch; add for example epoch = {self.examples()['epoch']}"
        if self.field is not None and self.chief is None:
            yield "field needs epoch and chief, whose orbit is in it; add both"

    def build(self) -> Orbit:
        """Return the orbit that the table describes."""
        planet = {key: value for key in ("mu", "radius") if (value := getattr(self, key)) is not None}
        if self.altitude is not None:
            semi_major_axis = self.altitude + planet.pop("radius", EARTH_RADIUS)
            return Orbit.from_semi_major_axis(semi_major_axis, **planet)
        if self.semi_major_axis is not None:
            return Orbit.from_semi_major_axis(
                self.semi_major_axis, **{k: v for k, v in planet.items() if k == "mu"}
            )
        if self.period is not None:
            return Orbit.from_period(self.period)
        return Orbit(self.mean_motion or 0.0)

    def origin(self, inputs: Inputs) -> "Chief | None":
        """Return the chief, or None; raise ValueError for an invalid one."""
        if self.chief is None or self.epoch is None:
            return None
        return self.chief.build(self.epoch, self.mu or EARTH_MU, self.radius or EARTH_RADIUS, inputs)

    def following(self, chief: "Chief") -> "OrbitTable":
        """Return the table with the circular orbit of its chief."""
        return self.model_copy(
            update={
                "semi_major_axis": chief.semi_major_axis,
                "latitude": float(chief.elements[1]) % (2.0 * pi),
                "mu": chief.mu,
            }
        )
