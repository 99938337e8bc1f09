"""Named relative orbits, as given in `start` and `to`."""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from closeform.arrays import Floats
from closeform.motion.elements.palmer import state_from_palmer
from closeform.motion.elements.roe import state_from_scaled_roe
from closeform.motion.orbit import Orbit
from closeform.scenario.quantity import ANGLE, LENGTH, Either, Reader
from closeform.scenario.table import (
    FileName,
    Groups,
    Inertial,
    Length,
    Names,
    Position,
    Six,
    Table,
    Vector,
    Velocity,
    setting,
)

SixLengths = Annotated[Six, Reader(LENGTH, 6)]
Signed = Annotated[float, Reader(LENGTH)]
CHEAPEST = "cheapest"


Phase = Annotated[float | None, Either(CHEAPEST, None, Reader(ANGLE))]


class Shape(Table):
    """Sizes of a named formation; the keys are the arguments of its function in `targets`."""

    function: ClassVar[str]
    phased: ClassVar[str | None] = None  # key of the first craft's phase, or None

    @property
    def phase_angle(self) -> float | None:
        """Phase of the first craft [rad]; None if it is that of lowest cost, or without phases."""
        found: float | None = getattr(self, self.phased) if self.phased is not None else None
        return found

    @property
    def is_open(self) -> bool:
        """True if the phase is that of lowest cost and not yet determined."""
        return self.phased is not None and self.phase_angle is None

    def at_phase(self, phase: float) -> Self:
        """Return the formation with its first craft at a phase [rad]."""
        assert self.phased is not None
        return self.model_copy(update={self.phased: phase})

    def states(self, orbit: Orbit, count: int) -> Floats:
        """Return the states (count, 6) of the slots in SI units."""
        from closeform.planning import targets  # only a named formation needs its kernels

        places: Floats = getattr(targets, self.function)(orbit, count, **self.model_dump())
        return places


class ProjectedCircular(Shape):
    """Relative orbit with a circular projection along the radial axis; craft evenly spaced."""

    function = "projected_circular"
    phased = "first_phase"
    radius: Length = setting('"150 m"', "radius of the circle", ...)
    first_phase: Phase = setting(
        '"0 deg"', 'phase of the first spacecraft, or "cheapest" in `avoid` and `transfer`', 0.0
    )


class SafetyEllipse(Shape):
    """One relative orbit with parallel eccentricity and inclination vectors; craft evenly spaced."""

    function = "safety_ellipse"
    phased = "phase"
    radial: Length = setting('"100 m"', "radial half-axis; the along-track half-axis is twice that", ...)
    cross_track: Length = setting('"100 m"', "cross-track half-axis", ...)
    along_track: Signed = setting('"0 m"', "along-track position of the centre", 0.0)
    phase: Phase = setting(
        '"0 deg"',
        'phase of the first spacecraft, or "cheapest" in `avoid` and `transfer`; '
        "the others follow ahead of it",
        0.0,
    )


class StringOfPearls(Shape):
    """Craft at rest, one behind the other."""

    function = "string_of_pearls"
    spacing: Length = setting('"100 m"', "distance between neighbours", ...)


class Pendulum(Shape):
    """Craft one behind the other, with cross-track oscillation."""

    function = "pendulum"
    spacing: Length = setting('"100 m"', "distance between neighbours", ...)
    cross_track: Length = setting(
        '"100 m"', "cross-track half-axis of neighbours relative to each other", ...
    )


class Ring(Shape):
    """Craft separated in phase, with parallel eccentricity and inclination vectors."""

    function = "separated_ring"
    phased = "first_phase"
    eccentricity: Length = setting('"100 m"', "length of the relative eccentricity vector", ...)
    inclination: Signed = setting(
        '"100 m"', "length of the relative inclination vector; negative for anti-parallel vectors", ...
    )
    first_phase: Phase = setting(
        '"0 deg"', 'phase of the first spacecraft, or "cheapest" in `avoid` and `transfer`', 0.0
    )

    def flaws(self) -> Iterator[str]:
        if self.inclination == 0.0:
            yield 'inclination must not be zero; write for example inclination = "100 m"'


class Line(Shape):
    """Craft at rest in a row, in deep space."""

    spacing: Length = setting('"75 m"', "distance between neighbours", ...)
    direction: Annotated[Vector, Field(strict=False)] = setting(
        "[1, 0, 0]", "direction from the first spacecraft to the last", ...
    )

    def flaws(self) -> Iterator[str]:
        if not 1e-30 < max(map(abs, self.direction)) < 1e30:
            yield "direction is zero or out of range; write for example direction = [1, 0, 0]"

    def states(self, orbit: Orbit, count: int) -> Floats:
        from closeform.planning import targets

        return targets.line(count, self.spacing, self.direction)


class Formation(Table):
    """Named formations, centred on the origin, which do not drift."""

    projected_circular: ProjectedCircular | None = setting(
        '{ radius = "150 m" }',
        "spacecraft evenly spaced on a relative orbit whose radial projection is a circle",
    )
    safety_ellipse: SafetyEllipse | None = setting(
        '{ radial = "100 m", cross_track = "100 m" }',
        "spacecraft evenly spaced on a safety ellipse around the origin",
    )
    string_of_pearls: StringOfPearls | None = setting(
        '{ spacing = "100 m" }', "spacecraft one behind the other, the last foremost"
    )
    pendulum: Pendulum | None = setting(
        '{ spacing = "100 m", cross_track = "100 m" }',
        "as `string_of_pearls`, each with a larger cross-track oscillation than the one before",
    )
    ring: Ring | None = setting(
        '{ eccentricity = "100 m", inclination = "100 m" }',
        "different phases of parallel eccentricity and inclination vectors",
    )
    line: Line | None = setting(
        '{ spacing = "75 m", direction = [1, 0, 0] }', "spacecraft at rest in a row; in deep space only"
    )

    @property
    def called(self) -> str | None:
        """Name of the formation, or None."""
        return next((name for name in Formation.model_fields if getattr(self, name) is not None), None)

    @property
    def shape(self) -> Shape | None:
        """Sizes of the named formation, or None."""
        found: Shape | None = getattr(self, self.called) if self.called is not None else None
        return found

    def closed(self) -> Iterator[str]:
        """Yield a flaw if the phase of several craft is left open."""
        if self.shape is not None and self.shape.is_open:
            key = self.shape.phased
            yield f'{key} = "{CHEAPEST}" is for the one craft of avoid and transfer; give an angle'

    @property
    def orbital(self) -> bool | None:
        """True if it requires an orbit (True) or deep space (False); None if it suits both."""
        return None if self.shape is None else self.line is None


class RelativeElements(Table):
    """Elements of a relative orbit, as lengths."""

    palmer: SixLengths | None = setting(
        '"0 0 0 100 0 20 m"', "Palmer's coordinates e1 e2 d l h1 h2, as lengths"
    )
    roe: SixLengths | None = setting(
        '"0 0 0 100 0 100 m"', "semi-major axis times the relative orbital elements δa δλ δex δey δix δiy"
    )


class Start(RelativeElements, Formation):
    """Table `start`: a relative orbit or an inertial state instead of a position and a velocity."""

    inertial: Inertial | None = setting(
        '"6928 0.1 0 km, 0 -1.003 7.518 km/s"', "position and velocity in the chief's frame"
    )
    oem: FileName | None = setting(
        '"F1.oem"', "orbit ephemeris message in the chief's frame, interpolated at the epoch"
    )

    flaws = Formation.closed
    alternatives = (("palmer", "roe", *Formation.model_fields, "inertial", "oem"),)

    @property
    def orbital(self) -> bool | None:
        given = self.palmer, self.roe, self.inertial, self.oem
        return super().orbital if all(one is None for one in given) else True

    @property
    def inertially(self) -> bool:
        """True if the start is an inertial state, which requires that of the chief."""
        return self.inertial is not None or self.oem is not None


class Target(RelativeElements):
    """Table `to`: the state that one craft moves to, relative to the formation's origin."""

    position: Position | None = setting('"0 100 0 m"', "position relative to the origin", needs="velocity")
    velocity: Velocity | None = setting(
        '"0 0 0 m/s"', "velocity relative to the origin", only_with="position"
    )

    alternatives: ClassVar[Groups] = (("position", "palmer", "roe"),)

    @property
    def orbital(self) -> bool | None:
        """True if it requires an orbit (True); None if it also suits deep space."""
        return True if self.palmer is not None or self.roe is not None else None

    def state(self, orbit: Orbit, latitude: float = 0.0) -> Floats:
        """Return the state (6,) in SI units, with the origin at this argument of latitude [rad]."""
        if self.palmer is not None:
            return state_from_palmer(self.palmer, orbit.mean_motion)
        if self.roe is not None:
            return state_from_scaled_roe(self.roe, orbit.mean_motion, latitude)
        return np.array([*(self.position or ()), *(self.velocity or ())])


class Destination(Target, Formation):
    """Table `to`: the state or the named relative orbit that one craft moves to."""

    alternatives = (("position", "palmer", "roe", *Formation.model_fields),)

    @property
    def orbital(self) -> bool | None:
        return super().orbital if self.shape is None else self.line is None

    def state(self, orbit: Orbit, latitude: float = 0.0) -> Floats:
        if self.shape is None:
            return super().state(orbit, latitude)
        return np.array(self.shape.states(orbit, 1)[0])

    @property
    def is_open(self) -> bool:
        """True if the phase is that of lowest cost and not yet determined."""
        return self.shape is not None and self.shape.is_open

    def at_phase(self, phase: float) -> Self:
        """Return the same relative orbit at a phase [rad]."""
        shape, name = self.shape, self.called
        assert shape is not None
        assert name is not None
        return self.model_copy(update={name: shape.at_phase(phase)})


class Goal(Formation):
    """Table `to`: the relative orbits that a whole formation moves to."""

    remove: Literal["eccentricity", "altitude difference"] | None = setting(
        '"eccentricity"', "component of the relative orbits to remove"
    )
    join: Names | None = setting(
        '["F1", "F2"]', "spacecraft in whose formation the one that moves takes a free place"
    )

    flaws = Formation.closed
    alternatives = ((*Formation.model_fields, "remove", "join"),)

    @property
    def orbital(self) -> bool | None:
        return True if self.shape is None else super().orbital
