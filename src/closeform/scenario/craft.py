"""Tables of the craft: [craft] with its engine, keep-out zone and uncertainty, [sensor] and [search]."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import hypot, inf, nan, pi
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, PrivateAttr, model_validator

from closeform.arrays import Floats
from closeform.fuel.falling_mass import STANDARD_GRAVITY
from closeform.fuel.thrusters import Thrusters
from closeform.motion.elements.palmer import state_from_palmer
from closeform.motion.elements.roe import state_from_scaled_roe
from closeform.motion.orbit import Orbit
from closeform.scenario.formation import Start
from closeform.scenario.orbit import ThrustError
from closeform.scenario.quantity import (
    ACCELERATION,
    ANGLE,
    AREA,
    FORCE,
    IMPULSE,
    LENGTH,
    NOISE,
    SHARE,
    SPEED,
    TIME,
    TURNING,
    Reader,
    shown,
    unit_of,
)
from closeform.scenario.table import (
    AngleDeviation,
    Ballistic,
    Deviation,
    FileName,
    Length,
    Lengths,
    Mass,
    Name,
    Position,
    Rate,
    Seconds,
    Share,
    Six,
    Speed,
    SpeedDeviation,
    Table,
    Turn,
    Vector,
    Velocity,
    setting,
)
from closeform.uncertainty.covariance import root_of
from closeform.zones.combined_zones import Body, CovarianceZone, OwnZone
from closeform.zones.solids import Box, Cylinder, Ellipsoid, HalfSpaces, Sphere
from closeform.zones.zone import LARGEST, SMALLEST, Zone

if TYPE_CHECKING:
    from closeform.search.schedule import Search
    from closeform.search.sensor import Sensor
    from closeform.uncertainty.errors import Uncertainty

SHAPES = "sphere", "box", "ellipsoid", "covariance", "cylinder", "half_spaces"
Row = Annotated[Vector, Field(strict=False)]


class KeepOut(Table):
    """Table `keep_out`: the zone around a craft that no other craft may enter."""

    alternatives = (SHAPES,)
    kind: Literal["region", "covariance", "body"] | None = setting(
        '"body"', 'meaning of the zone; by default "covariance" with `covariance`, else "region"'
    )
    sphere: Length | None = setting('"20 m"', "radius of a sphere")
    box: Lengths | None = setting('"20 40 20 m"', "half-widths of a box: radial, along-track, cross-track")
    ellipsoid: Lengths | None = setting(
        '"20 40 20 m"', "semi-axes of an ellipsoid: radial, along-track, cross-track"
    )
    covariance: Annotated[Six, Reader(AREA, 6)] | None = setting(
        '"25 0 100 0 0 25 m^2"',
        "position covariance, lower triangle rr tr tt nr nt nn as in a conjunction message",
        needs="sigmas",
    )
    sigmas: Annotated[float, Field(gt=0)] | None = setting(
        "3.0",
        "size of the covariance ellipsoid in standard deviations",
        only_with="covariance",
    )
    axes: Annotated[tuple[Row, Row, Row], Field(strict=False)] | None = setting(
        "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
        "orthonormal axes of the box or ellipsoid, as rows",
        only_with="box ellipsoid",
    )
    cylinder: Annotated[tuple[float, float], Reader(LENGTH, 2, "positive")] | None = setting(
        '"10 100 m"', "radius and half-length of a cylinder", needs="axis"
    )
    axis: Row | None = setting("[0, 1, 0]", "direction of the cylinder", only_with="cylinder")
    half_spaces: Annotated[tuple[float, ...], Reader(LENGTH, 0, "positive")] | None = setting(
        '"50 m"', "distance of each face from the spacecraft", needs="normals"
    )
    normals: Annotated[tuple[Row, ...], Field(strict=False)] | None = setting(
        "[[1, 0, 0]]",
        "outward normal of each face, as rows",
        only_with="half_spaces",
    )

    def flaws(self) -> Iterator[str]:
        found = list(self.inconsistencies())
        yield from found
        if not found:
            try:
                self.own()
            except ValueError as error:  # a size out of range
                yield f"{error}; change the size"

    def inconsistencies(self) -> Iterator[str]:
        """Yield one line per inconsistency among the keys."""
        rows = np.array(self.axes or np.eye(3))
        if not np.allclose(rows @ rows.T, np.eye(3), atol=1e-9):
            yield "axes are not orthonormal; give three perpendicular rows of length 1"
        if self.axis is not None and not any(self.axis):
            yield "axis is zero; give the cylinder's direction, for example axis = [0, 1, 0]"
        if self.normals is not None and not all(map(any, self.normals)):
            yield "normals: a row is zero; give the direction out of each face"
        if self.half_spaces and self.normals and len(self.normals) != len(self.half_spaces):
            rows_for = f"{len(self.normals)} rows for {len(self.half_spaces)} half_spaces"
            yield f"normals: {rows_for}; give one for each"
        if self.covariance is not None and np.linalg.eigvalsh(self.covariance_matrix())[0] <= 0.0:
            yield "covariance is not positive definite; check its six numbers: rr tr tt nr nt nn"
        if (self.kind == "covariance") > (self.covariance is not None):
            yield 'kind = "covariance" requires covariance; write "region" or "body"'
        if self.kind == "body" and self.covariance is not None:
            yield 'covariance cannot be combined with kind = "body"; remove kind'

    def covariance_matrix(self) -> Floats:
        """Return the covariance (3, 3) in m^2 from its lower triangle by rows, as in a CCSDS CDM."""
        matrix = np.zeros((3, 3))
        matrix[np.tril_indices(3)] = self.covariance
        return np.asarray(matrix + np.tril(matrix, -1).T)

    @property
    def of_errors(self) -> bool:
        """True if the zone is a position uncertainty."""
        return self.covariance is not None and self.kind != "region"

    def own(self) -> OwnZone:
        """Return the craft's own zone: a region, a body or a position uncertainty."""
        if self.of_errors:
            return CovarianceZone(self.covariance_matrix(), self.sigmas or 0.0)
        return Body(self.zone()) if self.kind == "body" else self.zone()

    def zone(self) -> Zone:
        """Return the set of positions that the table describes."""
        if self.sphere is not None:
            return Sphere(self.sphere)
        if self.box is not None:
            return Box(self.box, self.axes)
        if self.ellipsoid is not None:
            return Ellipsoid(self.ellipsoid, self.axes)
        if self.cylinder is not None and self.axis is not None:
            return Cylinder(*self.cylinder, self.axis)
        if self.half_spaces is not None and self.normals is not None:
            return HalfSpaces(self.normals, self.half_spaces)
        return Ellipsoid.from_covariance(self.covariance_matrix(), self.sigmas or 0.0)


Directions = Annotated[tuple[Annotated[Vector, Field(strict=False)], ...], Field(strict=False, min_length=1)]


class ThrusterTable(Table):
    """Table `thrusters`: "rtn" for one thruster along and one against each axis, or a list of directions."""

    directions: Directions = setting(
        "[[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]",
        "thrust direction of each thruster, as unit vectors",
        ...,
    )
    frame: Literal["orbit", "inertial"] = setting(
        '"inertial"',
        "directions that rotate with the orbit, or fixed ones along the orbit's axes at time 0",
        "orbit",
    )

    @model_validator(mode="before")
    @classmethod
    def by_name(cls, value: Any) -> Any:
        """Return the table that a name represents; return other values unchanged."""
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
        """Return the minimum impulse bit as a velocity change [m/s] for a craft of the given mass [kg]."""
        return self.velocity + (self.impulse / mass if self.impulse else 0.0)


def as_bit(value: Any) -> Bit:
    """Return a minimum impulse bit, given as a speed or as an impulse."""
    if isinstance(value, str) and unit_of(" ".join(value.split()[1:]))[1] == IMPULSE.dimension:
        return Bit(impulse=Reader(IMPULSE, least="positive").numbers(value)[0])
    return Bit(velocity=Reader(SPEED, least="positive").numbers(value)[0])


MinimumBit = Annotated[Bit, BeforeValidator(as_bit)]


IDLE = "of a craft without an engine write engine = false"
LIMITS = "max_thrust", "acceleration"  # alternative fields: one replaces the other


class Engine(Table):
    """Thrust limit, thrusters and specific impulse."""

    max_thrust: Annotated[float, Reader(FORCE, 1, "positive", IDLE)] | None = setting(
        '"1.5 N"', "maximum thrust, with `thrusters` of each; needs `mass`", excludes="acceleration"
    )
    acceleration: Annotated[float, Reader(ACCELERATION, 1, "positive", IDLE)] | None = setting(
        '"5 mm/s^2"', "maximum thrust acceleration", alias="max_acceleration"
    )
    thrusters: ThrusterTable | None = setting(
        '"rtn"',
        'on-off thrusters: "rtn" for one along and one against each axis, or a '
        "table; by default thrust in any direction",
    )
    minimum_bit: MinimumBit | None = setting(
        '"1 mm/s"', "minimum impulse bit as a speed, or as an impulse with `mass`; with `thrusters`"
    )
    period: Seconds | None = setting(
        '"30 s"', 'firing period for continuous thrust; with `thrusters`; required there with cost = "energy"'
    )
    specific_impulse: Seconds | None = setting(
        '"220 s"', "specific impulse, with which a run reports propellant; needs `mass`"
    )

    @property
    def limited(self) -> bool:
        """True if the thrust has a limit."""
        return self.max_thrust is not None or self.acceleration is not None

    @property
    def given_keys(self) -> dict[str, Any]:
        """Given values by field; one thrust limit resets the other."""
        given = {name: value for name in Engine.model_fields if (value := getattr(self, name)) is not None}
        return dict.fromkeys(LIMITS) | given if self.limited else given


Deviations = Annotated[Vector, Reader(LENGTH, 3, "zero")]
Speeds = Annotated[Vector, Reader(SPEED, 3, "zero")]
SixNumbers = Annotated[Six, Field(strict=False)]
SixRows = tuple[SixNumbers, SixNumbers, SixNumbers, SixNumbers, SixNumbers, SixNumbers]
EXACT = "exact"  # in a list: no uncertainty for this craft
UNCORRELATED: Any = tuple(tuple(row) for row in np.eye(6, dtype=int).tolist())


def as_errors(value: Any) -> Any:
    """Return a table of errors unchanged, or None for "exact"."""
    return None if value == EXACT else value


class Covariance(Table):
    """Table `covariance`: standard deviations and correlations of the initial position and velocity."""

    position: Deviations = setting(
        '"3 6 3 m"', "standard deviations: radial, along-track, cross-track", (0.0, 0.0, 0.0)
    )
    velocity: Speeds = setting('"2 2 2 mm/s"', "standard deviations of the velocity", (0.0, 0.0, 0.0))
    correlation: Annotated[SixRows, Field(strict=False)] = setting(
        str([list(row) for row in UNCORRELATED]), "correlation matrix; by default none", UNCORRELATED
    )

    def flaws(self) -> Iterator[str]:
        if not np.allclose(np.diag(self.correlation), 1.0, atol=1e-9):
            yield "correlation has a diagonal other than 1; give the deviations in position and velocity"
            return
        try:
            root_of("correlation", self.correlation)
        except ValueError as error:
            words = str(error).replace(": no covariance, ", " is none, ").replace(": must", " must")
            words = words.replace(", scaled by its diagonal,", "")
            yield words if ";" in words else f"{words}; give the same above and below the diagonal"

    @property
    def exact(self) -> bool:
        """True if the state is known exactly."""
        return not any((*self.position, *self.velocity))

    @cached_property
    def matrix(self) -> Floats:
        """Covariance (6, 6) in m^2, m^2/s and m^2/s^2."""
        deviations = np.array([*self.position, *self.velocity])
        return np.asarray(np.array(self.correlation) * np.outer(deviations, deviations))


class Gates(Table):
    """Table `impulse` of `execution`: the four standard deviations of the Gates model of an impulse."""

    speed: SpeedDeviation = setting('"1 mm/s"', "fixed magnitude error", 0.0)
    magnitude: Share = setting('"1 %"', "proportional magnitude error", 0.0)
    across: SpeedDeviation = setting('"1 mm/s"', "fixed error along each perpendicular axis", 0.0)
    pointing: AngleDeviation = setting('"0.5 deg"', "pointing error", 0.0)


class Execution(Table):
    """Table `execution`: execution errors of a craft's thrust."""

    magnitude: Share = setting('"1 %"', "standard deviation of the size of each burn", 0.0)
    pointing: AngleDeviation = setting(
        '"0.5 deg"', "standard deviation of the direction of each burn about each axis", 0.0
    )
    impulse: Gates | None = setting(
        '{ speed = "1 mm/s", magnitude = "1 %" }',
        "Gates model of impulses; by default `magnitude` and `pointing` apply to them",
    )
    noise: Annotated[float, Reader(NOISE, least="zero")] = setting(
        '"1e-9 m^2/s^3"', "white acceleration along each axis", 0.0
    )

    @property
    def gates(self) -> tuple[float, float, float, float]:
        """Gates deviations s1 to s4 of impulses: their own, or else those of continuous thrust."""
        if self.impulse is None:
            return 0.0, self.magnitude, 0.0, self.pointing
        one = self.impulse
        return one.speed, one.magnitude, one.across, one.pointing


Matrix = tuple[Vector, Vector, Vector]
Intervals = tuple[tuple[float, float], ...]
MOST_TURN = pi / 2.0  # rad: upper limit of a body's pointing error


def as_silence(value: Any) -> bool | Intervals:
    """Return True or False for a craft that is always or never silent, or its silent intervals [s]."""
    if isinstance(value, bool):
        return value
    time, found = Reader(TIME, least="zero"), list[tuple[float, float]]()
    try:
        for text in value.split(",") if isinstance(value, str) else value:
            begin, end = (part.strip() for part in text.split(" to "))
            found.append((time.numbers(begin)[0], inf if end == "end" else time.numbers(end)[0]))
    except (AttributeError, TypeError, ValueError):
        found = []
    if not found or any(begin >= end for begin, end in found):
        example = 'write for example "10 min to 20 min, 1 h to end"'
        raise ValueError(f"{shown(value)} is not true, false or a list of increasing intervals; {example}")
    return tuple(found)


def as_radius(radius: float) -> float:
    """Return the radius of a hard body [m]; raise ValueError for one that no zone can have."""
    if not SMALLEST <= radius <= LARGEST:
        raise ValueError(f'must be from {SMALLEST:g} to {LARGEST:g} m; write for example "5 m"')
    return radius


class Craft(Engine):
    """Table [craft]: initial states, engines, zones and errors of the spacecraft."""

    name: Name = setting('["F1", "F2"]', "names, of at most 24 characters each", ...)
    group: Literal["A", "B"] | None = setting(
        '["A", "B"]', "search group; required for `lock` and `gather` without `bearing`"
    )
    position: Position | None = setting(
        '["0 0 0 m", "0 100 0 m"]', "initial position; required without `start` or `states`"
    )
    velocity: Velocity | None = setting(
        '["0 0 0 m/s", "0 0 0 m/s"]', "initial velocity; required without `start` or `states`"
    )
    start: Start | None = setting(
        '{ palmer = "0 0 0 100 0 20 m" }',
        "initial relative orbit or inertial state",
        excludes="states position velocity",
    )
    states: FileName | None = setting(
        '"states.csv"', "CSV file of initial states", excludes="position velocity"
    )
    mass: Mass | None = setting('"150 kg"', "mass at the start of the mission")
    engine: bool = setting("true", "false for a spacecraft that cannot thrust", True)
    delta_v_budget: Speed | None = setting('"12 m/s"', "maximum delta-v of the mission")
    propellant: Mass | None = setting(
        '"2 kg"', "mass of propellant, part of `mass`", needs="specific_impulse"
    )
    keep_out: KeepOut | None = setting('{ sphere = "20 m" }', "keep-out zone; by default the `hard_body`")
    covariance: Annotated[Covariance | None, BeforeValidator(as_errors)] = setting(
        '{ position = "3 6 3 m", velocity = "2 2 2 mm/s" }',
        'uncertainty of the initial state; "exact" for none',
    )
    execution: Annotated[Execution | None, BeforeValidator(as_errors)] = setting(
        '{ magnitude = "1 %", pointing = "0.5 deg" }', 'execution errors of burns; "exact" for none'
    )
    ballistic: Ballistic | None = setting(
        '"0.02 m^2/kg"', "drag coefficient times area over mass; required with drag"
    )
    thrust_error: ThrustError = setting(
        '"1 %, 1 deg"',
        "largest magnitude and pointing error of thrust, constant over a simulation",
        (0.0, 0.0),
    )
    hard_body: Annotated[Length, AfterValidator(as_radius)] | None = setting(
        '"5 m"',
        "radius of the enclosing sphere, for the collision probability; the radii of two spacecraft add",
    )
    shade: Length | None = setting(
        '"15 m"', "diameter of the sunshade; the sphere around it is the default `hard_body`"
    )
    pointing_error: Annotated[Vector, Reader(ANGLE, 3)] = setting(
        '"0 0 0 deg"',
        "constant rotation vector of the body in a search, in body axes with the "
        "boresight along z; `sun_limit` includes it",
        (0.0, 0.0, 0.0),
    )
    slew_rate_error: Annotated[float, Reader(SHARE)] = setting(
        '"0.1 %"', "fraction by which all turns are too fast", 0.0
    )
    start_offset: Annotated[float, Reader(TIME)] = setting('"2 s"', "delay of the spacecraft's search", 0.0)
    slew_acceleration: Annotated[float, Reader(TURNING, least="positive")] | None = setting(
        '"0.01 deg/s^2"', "angular acceleration at the beginning and end of turns; by default unlimited"
    )
    solar_acceleration: Annotated[float, Reader(ACCELERATION, least="zero")] = setting(
        '"0.0012 mm/s^2"', "acceleration by solar pressure, away from the sun; `lock` only", 0.0
    )
    silent: Annotated[bool | Intervals, PlainValidator(as_silence)] = setting(
        "false",
        'true for a spacecraft that never locks, or intervals of a search: "10 min to 20 min, 1 h to end"',
        False,
    )
    _place: tuple[int, int] = PrivateAttr((0, 1))  # place and number of places in a formation
    _known: Floats | None = PrivateAttr(None)  # initial state (6,) that is inertial or in a file

    @property
    def body_radius(self) -> float | None:
        """Radius of the hard body [m], by default half the diameter of the shade; None without either."""
        return self.hard_body if self.hard_body is not None or self.shade is None else 0.5 * self.shade

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        given = self.start is not None or self.states is not None
        if not given and self.position is None:
            yield 'no position; add for example position = "0 100 0 m"'
        if not given and self.velocity is None:
            yield 'no velocity; add for example velocity = "0 0 0 m/s"'
        yield from self.unfit()
        if self.propellant is not None and self.mass is not None and self.propellant >= self.mass:
            yield (
                f"propellant of {self.propellant:g} kg is the whole mass of {self.mass:g} kg or more; "
                "give less propellant"
            )
        if hypot(*self.pointing_error) >= MOST_TURN:
            yield 'pointing_error must be below 90 deg; write for example "0.5 0 0 deg"'
        if self.slew_rate_error <= -1.0:
            yield 'slew_rate_error must be above -100 %; write for example "0.1 %"'
        if self.covariance is not None and self.keep_out is not None and self.keep_out.of_errors:
            yield (
                "covariance cannot be combined with a keep_out that is a covariance; "
                "keep one, or give keep_out another shape"
            )

    def unfit(self) -> Iterator[str]:
        """Yield one line per inconsistency between the engine and the mass."""
        yield from self.unmet("max_thrust", needed="mass")
        if self.thrusters is not None and not super().limited:
            yield 'thrusters need the max_thrust of each; add for example max_thrust = "10 mN"'
        yield from self.unmet("minimum_bit", partners=["thrusters"])
        yield from self.unmet("period", partners=["thrusters"])
        if self.minimum_bit is not None and self.minimum_bit.impulse and self.mass is None:
            yield 'minimum_bit in N s needs mass; add for example mass = "12 kg"'
        yield from self.unmet("specific_impulse", needed="mass")

    def using(self, engine: Engine) -> Self:
        """Return the craft with the engine keys of a stage in place of its own."""
        return self.model_copy(update=engine.given_keys) if engine.given_keys else self

    def placed(self, place: int, count: int) -> Self:
        """Return the craft with place `place` of `count` in a formation that `start` names."""
        craft = self.model_copy()
        craft._place = (place, count)
        return craft

    @property
    def astray(self) -> bool:
        """True if the craft deviates from its commanded search."""
        errors = *self.pointing_error, self.slew_rate_error, self.start_offset, self.silent
        return any((*errors, self.solar_acceleration)) or self.slew_acceleration is not None

    def known_at(self, state: Floats) -> Self:
        """Return the craft with its initial state (6,), read from a file or from an inertial state."""
        craft = self.model_copy()
        craft._known = state
        return craft

    @property
    def max_acceleration(self) -> float:
        """Maximum acceleration [m/s^2] at the initial mass; inf without a limit or an engine."""
        if not self.engine:
            return inf
        if self.max_thrust is None or self.mass is None:
            return inf if self.acceleration is None else self.acceleration
        return self.max_thrust / self.mass

    @property
    def limited(self) -> bool:
        """True if its thrust has a limit."""
        return self.engine and super().limited

    @property
    def unlimited(self) -> bool:
        """True if it has an engine without a thrust limit."""
        return self.engine and not self.limited

    @property
    def exhaust(self) -> float:
        """Exhaust speed [m/s]; inf if the specific impulse is unknown."""
        return inf if self.specific_impulse is None else STANDARD_GRAVITY * self.specific_impulse

    def fired(self, share: float) -> Thrusters | None:
        """Return the thrusters at a `share` of the initial mass; None without any."""
        if self.thrusters is None or not self.engine:
            return None
        bit = 0.0 if self.minimum_bit is None else self.minimum_bit.on(self.mass or nan)
        table, has = self.thrusters, self.max_acceleration / share
        return Thrusters(table.directions, table.frame, has, bit / share, self.period)

    @property
    def errors(self) -> "Uncertainty | None":
        """Uncertainty of the craft from the mission's start; None if all is known exactly."""
        if (self.covariance is None or self.covariance.exact) and self.execution is None:
            return None
        from closeform.uncertainty.errors import Uncertainty  # only this property needs its kernels

        state = None if self.covariance is None else self.covariance.matrix
        one = self.execution
        if one is None:
            return Uncertainty(state)
        return Uncertainty(state, one.magnitude, one.pointing, one.gates, one.noise)

    def state(self, orbit: Orbit, latitude: float = 0.0) -> Floats:
        """Return the initial state (6,) in SI units, with the origin at this argument of latitude [rad].

        The state is nan for a craft whose inertial state or file, or that of the chief, is invalid.
        """
        if self.states is not None:
            return np.full(6, nan) if self._known is None else self._known
        if self.start is None:
            return np.array([*(self.position or ()), *(self.velocity or ())])
        if self.start.palmer is not None:
            return state_from_palmer(self.start.palmer, orbit.mean_motion)
        if self.start.roe is not None:
            return state_from_scaled_roe(self.start.roe, orbit.mean_motion, latitude)
        if self.start.shape is None:
            return np.full(6, nan) if self._known is None else self._known
        place, count = self._place
        return np.array(self.start.shape.states(orbit, count)[place])


class SensorTable(Table):
    """Table [sensor]: the relative sensor that every craft carries."""

    half_angle: Annotated[float, Reader(ANGLE, least="positive", below="180 deg")] = setting(
        '"70 deg"', "half-angle of the sensor cone, below 180 deg", ...
    )
    offset: Deviation = setting(
        '"7.5 m"', "distance of the sensor from the centre of mass, along the boresight", 0.0
    )
    range: Length | None = setting('"2 km"', "maximum range; by default unlimited")
    range_error: Deviation = setting(
        '"2 cm"', "standard deviation of a measured distance, from which `gather` computes burns", 0.0
    )
    bearing_error: AngleDeviation = setting(
        '"0.02 deg"', "standard deviation of a measured direction, about each axis across it", 0.0
    )
    fix_interval: Seconds = setting(
        '"10 s"', "time between the two measurements that give the relative velocity after a lock", 10.0
    )

    def build(self) -> "Sensor":
        """Return the sensor that the table describes."""
        from closeform.search.sensor import Sensor

        longest = inf if self.range is None else self.range
        accuracy = self.range_error, self.bearing_error, self.fix_interval
        return Sensor(self.half_angle, self.offset, longest, *accuracy)


BASIC = {"method": ("basic",)}  # condition of some keys


class SearchTable(Table):
    """Table [search]: the synchronised turns by which lost craft search for each other."""

    method: Literal["basic", "modified"] = setting('"modified"', "search schedule", ...)
    slew_rate: Rate = setting('"0.25 deg/s"', "angular rate of every turn", ...)
    sun_limit: Annotated[float, Reader(ANGLE, least="positive", below="90 deg")] = setting(
        '"25 deg"', "largest tip angle of the sunshade, below 90 deg", ...
    )
    in_plane_turn: Turn | None = setting(
        '"1.5 turn"',
        "angle of the in-plane search, 1.5 turn by default",
        only_if=BASIC,
    )
    tip_angle: Turn | None = setting(
        '"25 deg"',
        "tip angle of the out-of-plane search, `sun_limit` by default",
        only_if=BASIC,
    )
    passes: Annotated[int, Field(ge=1, le=100)] | None = setting(
        "1", "number of times that IPS and OPS are made, 2 by default", only_if=BASIC
    )
    relaxed: bool = setting(
        "true",
        "true if the out-of-plane search may exceed `sun_limit`",
        False,
        only_if=BASIC,
    )
    max_speed: Speed | None = setting(
        '"12 cm/s"', "largest relative speed, which determines the near-field search"
    )
    bearing: bool = setting(
        "true", "true if hemisphere antennas assign the groups, instead of `group` of [craft]", False
    )

    def build(self, sensor: "Sensor") -> "Search":
        """Return the search that the table describes.

        Raises ValueError, beginning with the key, outside the published limits: tips beyond the sun limit, or
        a sensor too narrow for the modified search.
        """
        from closeform.search.schedule import Search

        if self.method == "modified":
            return Search.modified(sensor, self.slew_rate, self.sun_limit)
        turn = 3.0 * pi if self.in_plane_turn is None else self.in_plane_turn
        passes = 2 if self.passes is None else self.passes
        options = turn, self.tip_angle
        return Search.basic(
            sensor, self.slew_rate, self.sun_limit, *options, passes=passes, relaxed=self.relaxed
        )
