"""Tables [craft], [sensor] and [search]."""

from collections.abc import Iterator
from math import hypot, inf, nan, pi
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, PlainValidator, PrivateAttr

from closeform.arrays import Floats
from closeform.fuel.falling_mass import STANDARD_GRAVITY
from closeform.fuel.thrusters import Thrusters
from closeform.motion.orbit import Orbit
from closeform.motion.palmer import state_from_palmer
from closeform.motion.roe import state_from_scaled_roe
from closeform.scenario.engine import Engine
from closeform.scenario.field import ThrustError
from closeform.scenario.formation import Start
from closeform.scenario.keep_out import KeepOut
from closeform.scenario.quantity import (
    ANGLE,
    BALLISTIC,
    LENGTH,
    MASS,
    RATE,
    SHARE,
    SPEED,
    TIME,
    TURNING,
    Reader,
    shown,
)
from closeform.scenario.table import FileName, Length, Name, Position, Table, Vector, Velocity
from closeform.scenario.uncertainty import Covariance, Execution, as_errors

if TYPE_CHECKING:
    from closeform.search.schedule import Search
    from closeform.search.sensor import Sensor
    from closeform.uncertainty.errors import Uncertainty

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
        raise ValueError(f"{shown(value)} is neither true, false nor intervals that rise; {example}")
    return tuple(found)


class Craft(Engine):
    """One craft of [craft]."""

    name: Name = Field(examples=['["F1", "F2"]'])
    group: Literal["A", "B"] | None = Field(None, examples=['["A", "B"]'])
    position: Position | None = Field(None, examples=['["0 0 0 m", "0 100 0 m"]'])
    velocity: Velocity | None = Field(None, examples=['["0 0 0 m/s", "0 0 0 m/s"]'])
    start: Start | None = Field(None, examples=['{ palmer = "0 0 0 100 0 20 m" }'])
    states: FileName | None = Field(None, examples=['"states.csv"'])
    mass: Annotated[float, BeforeValidator(Reader(MASS, least="positive"))] | None = Field(
        None, examples=['"150 kg"']
    )
    engine: bool = Field(True, examples=["true"])
    delta_v_budget: Annotated[float, BeforeValidator(Reader(SPEED, least="positive"))] | None = Field(
        None, examples=['"12 m/s"']
    )
    propellant: Annotated[float, BeforeValidator(Reader(MASS, least="positive"))] | None = Field(
        None, examples=['"2 kg"']
    )
    keep_out: KeepOut | None = Field(None, examples=['{ sphere = "20 m" }'])
    covariance: Annotated[Covariance | None, BeforeValidator(as_errors)] = Field(
        None, examples=['{ position = "3 6 3 m", velocity = "2 2 2 mm/s" }']
    )
    execution: Annotated[Execution | None, BeforeValidator(as_errors)] = Field(
        None, examples=['{ magnitude = "1 %", pointing = "0.5 deg" }']
    )
    ballistic: Annotated[float, BeforeValidator(Reader(BALLISTIC, least="zero"))] | None = Field(
        None, examples=['"0.02 m^2/kg"']
    )
    thrust_error: ThrustError = Field((0.0, 0.0), examples=['"1 %, 1 deg"'])
    hard_body: Length | None = Field(None, examples=['"5 m"'])
    shade: Length | None = Field(None, examples=['"15 m"'])
    pointing_error: Annotated[Vector, BeforeValidator(Reader(ANGLE, 3))] = Field(
        (0.0, 0.0, 0.0), examples=['"0 0 0 deg"']
    )
    slew_rate_error: Annotated[float, BeforeValidator(Reader(SHARE))] = Field(0.0, examples=['"0.1 %"'])
    start_offset: Annotated[float, BeforeValidator(Reader(TIME))] = Field(0.0, examples=['"2 s"'])
    slew_acceleration: Annotated[float, BeforeValidator(Reader(TURNING, least="positive"))] | None = Field(
        None, examples=['"0.01 deg/s^2"']
    )
    silent: Annotated[bool | Intervals, PlainValidator(as_silence)] = Field(False, examples=["false"])
    _place: tuple[int, int] = PrivateAttr((0, 1))  # place and number of places in a formation
    _known: Floats | None = PrivateAttr(None)  # initial state (6,) that is inertial or in a file

    @classmethod
    def example(cls, key: str) -> Any:
        value = super().example(key)
        return value[0] if isinstance(value, list) else value  # of one craft

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        given = self.start is not None or self.states is not None
        if self.start is not None and self.states is not None:
            yield "start and states exclude each other; keep one"
        if given and (self.position is not None or self.velocity is not None):
            key = "start" if self.start is not None else "states"
            yield f"{key} and position with velocity exclude each other; keep one"
        if not given and self.position is None:
            yield 'no position; add for example position = "0 100 0 m"'
        if not given and self.velocity is None:
            yield 'no velocity; add for example velocity = "0 0 0 m/s"'
        yield from self.unfit()
        if self.propellant is not None and self.specific_impulse is None:
            yield 'propellant needs specific_impulse; add for example specific_impulse = "220 s"'
        if self.propellant is not None and self.mass is not None and self.propellant >= self.mass:
            yield (
                f"propellant of {self.propellant:g} kg leaves nothing of a mass of {self.mass:g} kg; "
                "give less of it"
            )
        if hypot(*self.pointing_error) >= MOST_TURN:
            yield 'pointing_error must be below 90 deg; write for example "0.5 0 0 deg"'
        if self.slew_rate_error <= -1.0:
            yield 'slew_rate_error must be above -100 %; write for example "0.1 %"'
        if self.covariance is not None and self.keep_out is not None and self.keep_out.of_errors:
            yield (
                "covariance and a keep_out that is one both say where the craft may be; "
                "keep one, or give keep_out a size of its own"
            )

    def unfit(self) -> Iterator[str]:
        """Yield one line per inconsistency between the engine and the mass."""
        if self.max_thrust is not None and self.mass is None:
            yield 'max_thrust needs mass; add for example mass = "150 kg"'
        if self.thrusters is not None and not super().limited:
            yield 'thrusters need max_thrust, which each gives; add for example max_thrust = "10 mN"'
        yield from self.only_with("minimum_bit", "thrusters")
        yield from self.only_with("period", "thrusters")
        if self.minimum_bit is not None and self.minimum_bit.impulse and self.mass is None:
            yield 'minimum_bit in N s needs mass; add for example mass = "12 kg"'
        if self.specific_impulse is not None and self.mass is None:
            yield 'specific_impulse needs mass; add for example mass = "150 kg"'

    def using(self, engine: Engine) -> Self:
        """Return the craft with the engine keys of a stage in place of its own."""
        return self.model_copy(update=engine.told) if engine.told else self

    def placed(self, place: int, count: int) -> Self:
        """Return the craft with place `place` of `count` in a formation that `start` names."""
        craft = self.model_copy()
        craft._place = (place, count)
        return craft

    @property
    def astray(self) -> bool:
        """True if the craft deviates from its commanded search."""
        errors = *self.pointing_error, self.slew_rate_error, self.start_offset, self.silent
        return any(errors) or self.slew_acceleration is not None

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

    half_angle: Annotated[float, BeforeValidator(Reader(ANGLE, least="positive"))] = Field(
        examples=['"70 deg"']
    )
    offset: Annotated[float, BeforeValidator(Reader(LENGTH, least="zero"))] = Field(0.0, examples=['"7.5 m"'])
    range: Length | None = Field(None, examples=['"2 km"'])

    def flaws(self) -> Iterator[str]:
        if self.half_angle >= pi:
            yield 'half_angle must be below 180 deg; write for example "70 deg"'

    def build(self) -> "Sensor":
        """Return the sensor that the table describes."""
        from closeform.search.sensor import Sensor

        return Sensor(self.half_angle, self.offset, inf if self.range is None else self.range)


class SearchTable(Table):
    """Table [search]: the synchronized turns by which lost craft search for each other."""

    method: Literal["basic", "modified"] = Field(examples=['"modified"'])
    slew_rate: Annotated[float, BeforeValidator(Reader(RATE, least="positive"))] = Field(
        examples=['"0.25 deg/s"']
    )
    sun_limit: Annotated[float, BeforeValidator(Reader(ANGLE, least="positive"))] = Field(
        examples=['"25 deg"']
    )
    in_plane_turn: Annotated[float, BeforeValidator(Reader(ANGLE, least="positive"))] | None = Field(
        None, examples=['"1.5 turn"']
    )
    tip_angle: Annotated[float, BeforeValidator(Reader(ANGLE, least="positive"))] | None = Field(
        None, examples=['"25 deg"']
    )
    max_speed: Annotated[float, BeforeValidator(Reader(SPEED, least="positive"))] | None = Field(
        None, examples=['"12 cm/s"']
    )

    def flaws(self) -> Iterator[str]:
        for key in ("in_plane_turn", "tip_angle"):
            if self.method == "modified" and getattr(self, key) is not None:
                yield f'{key} goes with method = "basic" only; remove {key}'
        if self.sun_limit >= pi / 2.0:
            yield 'sun_limit must be below 90 deg; write for example "25 deg"'

    def build(self, sensor: "Sensor") -> "Search":
        """Return the search that the table describes.

        Raises ValueError, beginning with the key, outside the published limits: tips beyond the sun limit, or
        a sensor too narrow for the modified search.
        """
        from closeform.search.schedule import Search

        if self.method == "modified":
            return Search.modified(sensor, self.slew_rate, self.sun_limit)
        turn = 3.0 * pi if self.in_plane_turn is None else self.in_plane_turn
        return Search.basic(sensor, self.slew_rate, self.sun_limit, turn, self.tip_angle)
