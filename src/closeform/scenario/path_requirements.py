"""Tables of a stage's requirements on the path of its craft, beyond keep-out zones."""

from collections.abc import Iterator
from math import inf, pi
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field

from closeform.scenario.quantity import ANGLE, DURATION, Duration, Reader
from closeform.scenario.table import Length, Position, Seconds, Span, Speed, Table, Vector, setting

if TYPE_CHECKING:
    from closeform.planning.requirements.requirement import Requirement

Direction = Annotated[Vector, Field(strict=False)]
Instant = Annotated[Duration, Reader(DURATION, least="zero")]
Cone = Annotated[float, Reader(ANGLE, least="positive", below="90 deg")]
ORIGIN = 0.0, 0.0, 0.0


class PathRequirement(Table):
    """Requirement on a path; `kind` is its class in `planning.requirements`."""

    kind: ClassVar[str]

    def arguments(self, start: float, period: float) -> dict[str, Any]:
        """Return the arguments of that class; start and period of the orbit are in s."""
        return self.model_dump()

    def built(self, start: float, period: float) -> "Requirement":
        """Return the requirement in a stage that starts at a time [s], in orbits of a `period` [s]."""
        from closeform.planning import requirements  # only these stages need it

        found: Requirement = getattr(requirements, self.kind)(**self.arguments(start, period))
        return found


def without_direction(axis: Vector, key: str) -> Iterator[str]:
    """Yield the flaw of an axis that is zero."""
    if not any(axis):
        yield f"{key} has no direction; write for example [0, -1, 0]"


class Corridor(PathRequirement):
    """Approach corridor at a target: a cone, or with half_angle = "0 deg" a cylinder."""

    kind = "ApproachCone"
    axis: Direction = setting("[0, -1, 0]", "direction from the target into the corridor", ...)
    half_angle: Annotated[float, Reader(ANGLE, least="zero", below="90 deg")] = setting(
        '"10 deg"', "angle between axis and surface", ...
    )
    radius: Length = setting('"0.5 m"', "radius at the target", ...)
    target: Position = setting('"0 0 0 m"', "position of the target", ORIGIN)
    after: Instant | None = setting('"10 min"', "time after the start of the stage from which it holds")

    def flaws(self) -> Iterator[str]:
        yield from without_direction(self.axis, "axis")

    def arguments(self, start: float, period: float) -> dict[str, Any]:
        return self.model_dump(exclude={"after"}) | since(self.after, start, period)


class ApproachSpeed(PathRequirement):
    """Limit of the speed, which rises with the distance along an approach axis."""

    kind = "SpeedLimit"
    limit: Speed = setting('"0.05 m/s"', "maximum speed at the target", ...)
    time_constant: Seconds | None = setting(
        '"1000 s"', "the limit rises by the distance along `axis`, divided by this time", needs="axis"
    )
    axis: Direction | None = setting("[0, -1, 0]", "direction from the target", needs="time_constant")
    target: Position = setting('"0 0 0 m"', "position of the target", ORIGIN)
    after: Instant | None = setting('"10 min"', "time after the start of the stage from which it holds")

    def arguments(self, start: float, period: float) -> dict[str, Any]:
        rate = 0.0 if self.time_constant is None else 1.0 / self.time_constant
        given = {"limit": self.limit, "rate": rate, "axis": self.axis or ORIGIN, "target": self.target}
        return given | since(self.after, start, period)


class Waypoint(PathRequirement):
    """Place that the craft passes at a given time."""

    kind = "KeepIn"
    at: Span = setting('"15 min"', "time after the start of the stage", ...)
    position: Position = setting('"10 -100 0 m"', "position", ...)
    tolerance: Length = setting('"5 m"', "maximum distance from it", ...)

    def arguments(self, start: float, period: float) -> dict[str, Any]:
        from closeform.zones.solids import Sphere

        time = start + self.at.on(period)
        return {"zone": Sphere(self.tolerance), "centre": self.position, "start": time, "end": time}


class QuietTime(PathRequirement):
    """Time in which the craft does not fire, such as an eclipse."""

    kind = "NoThrust"
    after: Instant = setting('"10 min"', "start of the time, after the start of the stage", ...)
    until: Span = setting('"25 min"', "end of the time, after the start of the stage", ...)

    def arguments(self, start: float, period: float) -> dict[str, Any]:
        begin, end = start + self.after.on(period), start + self.until.on(period)
        if not begin < end:
            raise ValueError(f"no_thrust: until must be later than after, got {begin - start:g} s")
        return {"start": begin, "end": end}


class Exhaust(PathRequirement):
    """Cone of exhaust in which no other spacecraft may be while the craft fires."""

    kind = "Plume"
    half_angle: Cone = setting('"20 deg"', "angle between axis and edge of the exhaust", ...)
    range: Length = setting('"50 m"', "distance beyond which the exhaust does no harm", ...)


class Exclusion(PathRequirement):
    """Cone of directions into which the craft must not thrust, such as towards the Sun."""

    kind = "ThrustExclusion"
    direction: Direction = setting("[-1, 0, 0]", "axis of the cone, in the rotating frame at time 0", ...)
    half_angle: Cone = setting('"30 deg"', "angle between axis and surface", ...)
    frame: Literal["orbit", "inertial"] = setting(
        '"inertial"', "frame in which the axis is fixed: that of the orbit, or inertial", "orbit"
    )
    after: Instant | None = setting('"10 min"', "time after the start of the stage from which it holds")
    until: Span | None = setting('"25 min"', "time after the start of the stage until which it holds")

    def flaws(self) -> Iterator[str]:
        yield from without_direction(self.direction, "direction")

    def arguments(self, start: float, period: float) -> dict[str, Any]:
        end = inf if self.until is None else start + self.until.on(period)
        rate = -2.0 * pi / period if self.frame == "inertial" else 0.0
        cone = {"direction": self.direction, "half_angle": self.half_angle}
        return cone | {"end": end, "rate": rate} | since(self.after, start, period)


def since(after: Duration | None, start: float, period: float) -> dict[str, float]:
    """Return the argument `start` of a requirement that holds from a time after the start of the stage."""
    return {} if after is None else {"start": start + after.on(period)}


def built_all(stage: Any, start: float, period: float) -> "dict[str, Requirement]":
    """Return the requirements of a stage by their name in reports."""
    given: dict[str, tuple[PathRequirement | None, ...]] = {
        "approach corridor": (stage.corridor,),
        "speed limit": (stage.speed_limit,),
        "plume limit": (stage.plume,),
        "waypoint": stage.waypoints,
        "time without thrust": stage.no_thrust,
        "direction without thrust": stage.thrust_exclusion,
    }
    return {
        f"{name} {k}" if len(several) > 1 else name: one.built(start, period)
        for name, several in given.items()
        for k, one in enumerate(several, 1)
        if one is not None
    }
