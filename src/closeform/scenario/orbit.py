"""Tables of the motion: [orbit], [feedback], [navigation], [simulation] and [verdict]."""

from collections.abc import Iterator, Sequence
from math import atan2, cos, hypot, inf, pi, sin, sqrt
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr

from closeform.arrays import Floats
from closeform.exchange.epochs import SYSTEMS, Epoch
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.elements.elements import eccentric_latitude, inertial_from_elements
from closeform.motion.elements.mean_motion import EARTH_MU, EARTH_RADIUS
from closeform.motion.orbit import Orbit
from closeform.scenario.inputs import Inputs
from closeform.scenario.quantity import (
    ANGLE,
    DENSITY,
    GRAVITY,
    LENGTH,
    SHARE,
    SPEED,
    Parts,
    Reader,
    shown,
)
from closeform.scenario.table import (
    Angle,
    Ballistic,
    Delay,
    Deviation,
    FileName,
    Inertial,
    Length,
    Rate,
    Seconds,
    SpeedDeviation,
    Table,
    setting,
)

if TYPE_CHECKING:
    from closeform.dynamics.control.feedback import Feedback, Navigation
    from closeform.exchange.chief import Chief

CLOSE_TO_A_CIRCLE = 0.1  # largest eccentricity for which Hill's equations are useful
LATER, SPARE = 4.0, 12.0  # times the requested durations, and orbits, for plans that take longer
Model = Literal["hill", "kepler", "j2"]
DEGREES = (0, 2, 3, 4, 5, 6)
AIR = ("density", "at_altitude", "scale_height")
as_thrust_error = Parts(
    (Reader(SHARE, least="zero"), Reader(ANGLE, least="zero")),
    "a share, a comma and an angle",
    '"1 %, 1 deg"',
)
as_navigation = Parts(
    (Reader(LENGTH, least="zero"), Reader(SPEED, least="zero")),
    "a length, a comma and a speed",
    '"10 cm, 0.3 mm/s"',
)
ThrustError = Annotated[tuple[float, float], as_thrust_error]


def as_degree(zonals: int) -> int:
    """Return a supported degree of oblateness; raise ValueError for another."""
    if zonals not in DEGREES:
        raise ValueError(f"is 0 or a degree from 2 to 6, not {zonals}; write for example zonals = 2")
    return zonals


class FieldTable(Table):
    """Table `field` of [orbit]: the Earth's oblateness and its atmosphere."""

    zonals: Annotated[int, AfterValidator(as_degree)] = setting(
        "2", "highest zonal harmonic: 0 for a point mass, 2 to 6 for J2 to J6", 2
    )
    density: Annotated[float, Reader(DENSITY, least="positive")] | None = setting(
        '"5.2e-13 kg/m^3"', "atmospheric density at `at_altitude`; without it, no drag"
    )
    at_altitude: Length | None = setting('"500 km"', "altitude of `density` above the equatorial radius")
    scale_height: Length | None = setting('"60 km"', "altitude over which the density falls by a factor of e")

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

    every: Seconds = setting('"60 s"', "time between measurements", 60.0)
    horizon: Seconds = setting('"10 min"', "time within which a correction removes a deviation", 600.0)
    impulses: Annotated[int, Field(ge=0)] = setting(
        "6", "number of impulses of a correction; 0 for continuous thrust", 0
    )
    delay: Delay = setting(
        '"5 s"',
        "time from a measurement to the response of continuous thrust, at most `every`",
        0.0,
        excludes="impulses",
    )

    def flaws(self) -> Iterator[str]:
        if self.impulses == 1:
            yield "impulses is 0 (continuous thrust), or two or more; write for example impulses = 6"
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

    def build(self) -> "Feedback":
        """Return the feedback that the table describes."""
        from closeform.dynamics.control.feedback import Feedback

        return Feedback(self.every, self.horizon, self.impulses, self.delay)


class NavigationTable(Table):
    """Table [navigation]: navigation uncertainty of the measured states."""

    position: Deviation = setting('"10 cm"', "standard deviation of the measured position on each axis", 0.0)
    velocity: SpeedDeviation = setting(
        '"0.3 mm/s"', "standard deviation of the measured velocity on each axis", 0.0
    )
    position_bias: Deviation = setting('"5 cm"', "position error that is constant over a simulation", 0.0)
    velocity_bias: SpeedDeviation = setting(
        '"0.1 mm/s"', "velocity error that is constant over a simulation", 0.0
    )
    correlation: Delay = setting(
        '"5 min"',
        "correlation time of the random errors, as of a filter; 0 for independent measurements",
        0.0,
    )

    def build(self) -> "Navigation":
        """Return the navigation that the table describes."""
        from closeform.dynamics.control.feedback import Navigation

        biases = self.position_bias, self.velocity_bias
        return Navigation(self.position, self.velocity, *biases, self.correlation)


class FlightTable(Table):
    """Table [simulation]: number and control of the simulations of a run in the high-fidelity model."""

    control: Literal["track", "replan", "open"] = setting(
        '"track"',
        "feedback to the plan, a new plan for the rest at each measurement, or "
        "commanded thrust without feedback",
        "track",
    )
    seeds: Annotated[int, Field(ge=1)] = setting(
        "100", "number of simulations of a run, each with its own errors; a case of a study has one", 100
    )


class VerdictTable(Table):
    """Table [verdict]: result of a run whose model error exceeds the distance from a zone."""

    model_error: Literal["report", "refuse"] = setting(
        '"refuse"',
        "without `field`, report a model error above the distance from a zone, or fail with status 1",
        "report",
    )


def as_epoch(value: Any) -> Epoch:
    """Return an epoch in UTC, or in the time system that follows it."""
    if not isinstance(value, str):
        raise ValueError(f'{shown(value)} is not text; write for example epoch = "2026-11-22T12:00:00Z"')
    try:
        return Epoch.of(value)
    except ValueError:
        others = ", ".join(SYSTEMS)
        remedy = f'write for example "2026-11-22T12:00:00Z", or another time system behind it, of {others}'
        raise ValueError(f"{shown(value)} is not a valid epoch; {remedy}") from None


class Elements(Table):
    """Table `elements`: Keplerian elements of the chief at the epoch."""

    alternatives = ("altitude", "semi_major_axis"), ("latitude", "mean_anomaly", "true_anomaly")
    altitude: Length | None = setting(
        '"550 km"', "semi-major axis minus `radius`, instead of `semi_major_axis`"
    )
    semi_major_axis: Length | None = setting('"6928.137 km"', "semi-major axis")
    eccentricity: float = setting(
        "0.001", 'eccentricity, at most 0.1 with model = "hill"', 0.0, strict=False, ge=0.0, lt=1.0
    )
    inclination: Angle = setting('"97.6 deg"', "inclination", ...)
    ascending_node: Angle = setting('"30 deg"', "right ascension of the ascending node", 0.0)
    argument_of_perigee: Angle = setting('"90 deg"', "argument of perigee", 0.0, only_with="eccentricity")
    latitude: Angle | None = setting(
        '"10 deg"', "mean argument of latitude; one of this and the two anomalies"
    )
    mean_anomaly: Angle | None = setting('"10 deg"', "mean anomaly")
    true_anomaly: Angle | None = setting('"10 deg"', "true anomaly")

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

    alternatives = (("elements", "state", "oem"),)
    elements: Elements | None = setting(
        '{ altitude = "550 km", inclination = "97.6 deg", latitude = "0 deg" }',
        "Keplerian elements at the epoch",
    )
    state: Inertial | None = setting(
        '"6928.137 0 0 km, 0 -1.003 7.518 km/s"', "inertial position and velocity at the epoch"
    )
    oem: FileName | None = setting('"chief.oem"', "orbit ephemeris message, interpolated at the epoch")
    frame: str | None = setting(
        '"GCRF"',
        "inertial frame: EME2000 (default), GCRF, ICRF, J2000, MCI, MOD, TEME or TOD",
        min_length=1,
        only_with="elements state",
    )
    center: str | None = setting(
        '"EARTH"',
        "central body, by default EARTH",
        min_length=1,
        only_with="elements state",
    )
    ballistic: Ballistic | None = setting(
        '"0.02 m^2/kg"',
        "drag coefficient times area over mass of the origin, 0 for an orbit "
        "without drag; required with drag",
    )

    def build(self, epoch: Epoch, mu: float, radius: float, inputs: Inputs, model: Model) -> "Chief":
        """Return the chief; raise ValueError for an invalid one, or one too far from a circle for Hill."""
        from closeform.exchange.chief import Chief  # most scenarios do not need it

        if self.oem is not None:
            chief = Chief.from_ephemeris(inputs.ephemeris(self.oem, epoch), epoch.stamp, epoch.system, mu)
            inputs.interpolated(self.oem, float(chief.interpolation_errors(0.0)))
        else:
            state = self.elements.state(mu, radius) if self.elements is not None else self.state
            place = self.frame or "EME2000", epoch.system, self.center or "EARTH"
            chief = Chief(epoch.stamp, np.array(state), *place, mu)
        if model == "hill" and chief.eccentricity > CLOSE_TO_A_CIRCLE:
            raise ValueError(
                f"eccentricity {chief.eccentricity:.3g}, and Hill's equations are useful "
                f'up to {CLOSE_TO_A_CIRCLE:g}; write model = "kepler" in [orbit]'
            )
        return chief


class OrbitTable(Table):
    """Table [orbit]: the circular orbit that the formation's frame follows, or deep space."""

    alternatives = (("altitude", "period", "semi_major_axis", "mean_motion", "deep_space", "chief"),)
    deep_space: Literal[True] | None = setting("true", "no gravity")
    altitude: Length | None = setting('"500 km"', "altitude above `radius`")
    period: Seconds | None = setting('"95 min"', "orbital period")
    semi_major_axis: Length | None = setting('"6878 km"', "semi-major axis")
    mean_motion: Rate | None = setting('"0.0634 deg/s"', "mean motion")
    latitude: Angle = setting(
        '"30 deg"',
        "argument of latitude of the origin at the start, to which `roe` refers",
        0.0,
        only_with="altitude period semi_major_axis mean_motion",
    )
    mu: Annotated[float, Reader(GRAVITY, least="positive")] | None = setting(
        '"398600.4418 km^3/s^2"',
        "gravitational parameter, by default the Earth's",
        only_with="altitude semi_major_axis chief",
    )
    radius: Length | None = setting(
        '"6378.137 km"',
        "equatorial radius of the central body, by default the Earth's",
        only_with="altitude chief",
    )
    epoch: Annotated[Epoch, BeforeValidator(as_epoch)] | None = setting(
        '"2026-11-22T12:00:00Z"', "start of the mission, in UTC or another time system"
    )
    model: Model = setting(
        '"kepler"',
        "equations of relative motion: those of Hill for a circle, those about a chief on an ellipse, or "
        "these with J2 of the Earth; `kepler` and `j2` need `chief`",
        "hill",
    )
    chief: ChiefTable | None = setting(
        '{ oem = "chief.oem" }', "orbit of the origin at the epoch", needs="epoch"
    )
    field: FieldTable | None = setting(
        "{ zonals = 2 }",
        "perturbations of the high-fidelity model; without it, Hill's equations only",
        needs="chief",
        only_if={"model": ("hill",)},
    )

    _beside: ChiefOrbit | None = PrivateAttr(None)

    def flaws(self) -> Iterator[str]:
        if self.model != "hill" and self.chief is None:
            yield f'model = "{self.model}" needs chief; add it with epoch, or remove model'

    def build(self) -> Orbit:
        """Return the orbit that the table describes; about a chief that is not on a circle a `ChiefOrbit`."""
        if self._beside is not None:
            return cast(Orbit, self._beside)  # with the same methods
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
        planet = self.mu or EARTH_MU, self.radius or EARTH_RADIUS
        return self.chief.build(self.epoch, *planet, inputs, self.model)

    def following(self, chief: "Chief", stages: Sequence[Any] = ()) -> "OrbitTable":
        """Return the table with the orbit of its chief: in its `model`, for as long as `stages` may last."""
        table = self.model_copy(
            update={
                "semi_major_axis": chief.semi_major_axis,
                "latitude": float(chief.elements[1]) % (2.0 * pi),
                "mu": chief.mu,
            }
        )
        if self.model != "hill":
            table._beside = beside(chief, self.model, self.radius or EARTH_RADIUS, stages)
        return table


def beside(chief: "Chief", model: Model, radius: float, stages: Sequence[Any]) -> ChiefOrbit:
    """Return the motion about a chief in a `model`; raise ValueError for a chief that it does not suit."""
    a, u, ex, ey, inclination, _ = chief.elements.tolist()
    e, perigee = hypot(ex, ey), atan2(ey, ex)
    anomaly = float(eccentric_latitude(u, ex, ey)) - perigee
    true = 2.0 * atan2(sqrt(1.0 + e) * sin(anomaly / 2.0), sqrt(1.0 - e) * cos(anomaly / 2.0))
    shape = {"semi_major_axis": a, "true_anomaly": true, "mu": chief.mu, "radius": radius}
    if model == "kepler":
        return Orbit.eccentric(e, **shape)
    if chief.center.upper() != "EARTH":
        raise ValueError(f'model = "j2" supports only the Earth, not {chief.center}; write model = "kepler"')
    period = 2.0 * pi * sqrt(a**3 / chief.mu)
    times = [{key: one.on(period) for key, one in stage.durations.items()} for stage in stages]
    moves = sum(time for each in times for key, time in each.items() if key != "drift")
    drift = max((each.get("drift", 0.0) for each in times), default=0.0)
    if not drift < inf:
        raise ValueError('model = "j2" needs a drift that ends; write for example drift = "24 h"')
    span = LATER * moves + drift + SPARE * period
    return Orbit.perturbed(e, inclination, argument_of_perigee=perigee, span=span, **shape)
