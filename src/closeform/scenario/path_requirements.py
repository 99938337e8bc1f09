"""Tables of a stage's requirements on the path of its craft, beyond keep-out zones."""

from collections.abc import Iterator
from math import inf
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from closeform.scenario.quantity import ANGLE, DURATION, Duration, Reader
from closeform.scenario.table import (
    Length,
    Position,
    Seconds,
    Span,
    Speed,
    Table,
    Vector,
    setting,
)

if TYPE_CHECKING:
    from closeform.planning.requirements import (
        ApproachCone,
        KeepIn,
        NoThrust,
        Plume,
        SpeedLimit,
        ThrustExclusion,
    )

Direction = Annotated[Vector, Field(strict=False)]
Instant = Annotated[Duration, Reader(DURATION, least="zero")]
Cone = Annotated[float, Reader(ANGLE, least="positive", below="90 deg")]
ORIGIN = 0.0, 0.0, 0.0


class Corridor(Table):
    """Approach corridor at a target: a cone, or with half_angle = "0 deg" a cylinder."""

    axis: Direction = setting("[0, -1, 0]", "direction from the target into the corridor", ...)
    half_angle: Annotated[float, Reader(ANGLE, least="zero", below="90 deg")] = setting(
        '"10 deg"', "angle between axis and surface", ...
    )
    radius: Length = setting('"0.5 m"', "radius at the target", ...)
    target: Position = setting('"0 0 0 m"', "position of the target", ORIGIN)
    after: Instant | None = setting('"10 min"', "time after the start of the stage from which it holds")

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        if not any(self.axis):
            yield "axis has no direction; write for example [0, -1, 0]"

    def built(self, start: float, period: float) -> "ApproachCone":
        """Return the requirement of a stage that starts at a time [s], in orbits of a `period` [s]."""
        from closeform.planning.requirements import ApproachCone

        begins = {} if self.after is None else {"start": start + self.after.on(period)}
        return ApproachCone(
            axis=self.axis, half_angle=self.half_angle, radius=self.radius, target=self.target, **begins
        )


class ApproachSpeed(Table):
    """Limit of the speed, which rises with the distance along an approach axis."""

    limit: Speed = setting('"0.05 m/s"', "maximum speed at the target", ...)
    time_constant: Seconds | None = setting(
        '"1000 s"', "the limit rises by the distance along `axis`, divided by this time", needs="axis"
    )
    axis: Direction | None = setting("[0, -1, 0]", "direction from the target", needs="time_constant")
    target: Position = setting('"0 0 0 m"', "position of the target", ORIGIN)
    after: Instant | None = setting('"10 min"', "time after the start of the stage from which it holds")

    def built(self, start: float, period: float) -> "SpeedLimit":
        """Return the requirement of a stage that starts at a time [s], in orbits of a `period` [s]."""
        from closeform.planning.requirements import SpeedLimit

        begins = {} if self.after is None else {"start": start + self.after.on(period)}
        rate = 0.0 if self.time_constant is None else 1.0 / self.time_constant
        return SpeedLimit(limit=self.limit, rate=rate, axis=self.axis or ORIGIN, target=self.target, **begins)


class Waypoint(Table):
    """Place that the craft passes at a given time."""

    at: Span = setting('"15 min"', "time after the start of the stage", ...)
    position: Position = setting('"10 -100 0 m"', "position", ...)
    tolerance: Length = setting('"5 m"', "maximum distance from it", ...)

    def built(self, start: float, period: float) -> "KeepIn":
        """Return the requirement of a stage that starts at a time [s], in orbits of a `period` [s]."""
        from closeform.planning.requirements import KeepIn
        from closeform.zones.solids import Sphere

        time = start + self.at.on(period)
        return KeepIn(zone=Sphere(self.tolerance), centre=self.position, start=time, end=time)


class QuietTime(Table):
    """Time in which the craft does not fire, such as an eclipse."""

    after: Instant = setting('"10 min"', "start of the time, after the start of the stage", ...)
    until: Span = setting('"25 min"', "end of the time, after the start of the stage", ...)

    def built(self, start: float, period: float) -> "NoThrust":
        """Return the requirement of a stage that starts at a time [s], in orbits of a `period` [s]."""
        from closeform.planning.requirements import NoThrust

        begin, end = start + self.after.on(period), start + self.until.on(period)
        if not begin < end:
            raise ValueError(f"no_thrust: until must be later than after, got {begin - start:g} s")
        return NoThrust(start=begin, end=end)


class Exhaust(Table):
    """Cone of exhaust in which no other spacecraft may be while the craft fires."""

    half_angle: Cone = setting('"20 deg"', "angle between axis and edge of the exhaust", ...)
    range: Length = setting('"50 m"', "distance from which on the exhaust does no harm", ...)

    def built(self, start: float, period: float) -> "Plume":
        """Return the requirement of a stage that starts at a time [s], in orbits of a `period` [s]."""
        from closeform.planning.requirements import Plume

        return Plume(half_angle=self.half_angle, range=self.range)


class Exclusion(Table):
    """Cone of directions into which the craft must not thrust, such as towards the Sun."""

    direction: Direction = setting("[-1, 0, 0]", "axis of the cone, in the rotating frame at time 0", ...)
    half_angle: Cone = setting('"30 deg"', "angle between axis and surface", ...)
    frame: Literal["orbit", "inertial"] = setting(
        '"inertial"', "frame in which the axis is fixed: that of the orbit, or inertial", "orbit"
    )
    after: Instant | None = setting('"10 min"', "time after the start of the stage from which it holds")
    until: Span | None = setting('"25 min"', "time after the start of the stage until which it holds")

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        if not any(self.direction):
            yield "direction is zero; write for example [-1, 0, 0]"

    def built(self, start: float, period: float) -> "ThrustExclusion":
        """Return the requirement of a stage that starts at a time [s], in orbits of a `period` [s]."""
        from closeform.planning.requirements import ThrustExclusion

        return ThrustExclusion(
            start=-inf if self.after is None else start + self.after.on(period),
            end=inf if self.until is None else start + self.until.on(period),
            direction=self.direction,
            half_angle=self.half_angle,
            rate=-2.0 * np.pi / period if self.frame == "inertial" else 0.0,
        )


def built_all(stage: Any, start: float, period: float) -> dict[str, Any]:
    """Return the requirements of a stage by their name in reports."""
    single = {
        "approach corridor": stage.corridor,
        "speed limit": stage.speed_limit,
        "plume limit": stage.plume,
    }
    found = {name: one.built(start, period) for name, one in single.items() if one is not None}
    lists = {
        "waypoint": stage.waypoints,
        "time without thrust": stage.no_thrust,
        "direction without thrust": stage.thrust_exclusion,
    }
    for name, several in lists.items():
        for k, one in enumerate(several, 1):
            found[f"{name} {k}" if len(several) > 1 else name] = one.built(start, period)
    return found
