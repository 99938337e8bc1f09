"""Relative orbits by name: what stands in `start` and in `to`."""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from closeform.arrays import Floats
from closeform.motion.orbit import Orbit
from closeform.motion.palmer import state_from_palmer
from closeform.motion.roe import state_from_scaled_roe
from closeform.scenario.quantity import LENGTH, Reader
from closeform.scenario.table import Angle, Length, Names, Position, Table, Vector, Velocity

Six = tuple[float, float, float, float, float, float]
SixLengths = Annotated[Six, BeforeValidator(Reader(LENGTH, 6))]
Signed = Annotated[float, BeforeValidator(Reader(LENGTH))]


class Shape(Table):
    """The sizes of a named formation, by the arguments of its function in `targets`."""

    function: ClassVar[str]

    def states(self, orbit: Orbit, count: int) -> Floats:
        """States (count, 6) of its places, in SI units."""
        from closeform.planning import targets  # whose kernels only a named formation needs

        places: Floats = getattr(targets, self.function)(orbit, count, **self.model_dump())
        return places


class ProjectedCircular(Shape):
    """A relative orbit whose projection along the radial is a circle; craft spread evenly."""

    function = "projected_circular"
    radius: Length = Field(examples=['"150 m"'])
    first_phase: Angle = Field(0.0, examples=['"0 deg"'])


class SafetyEllipse(Shape):
    """One relative orbit with parallel eccentricity and inclination vectors; craft spread evenly."""

    function = "safety_ellipse"
    radial: Length = Field(examples=['"100 m"'])
    cross_track: Length = Field(examples=['"100 m"'])
    along_track: Signed = Field(0.0, examples=['"0 m"'])
    phase: Angle = Field(0.0, examples=['"0 deg"'])


class StringOfPearls(Shape):
    """Craft one behind the other."""

    function = "string_of_pearls"
    spacing: Length = Field(examples=['"100 m"'])


class Pendulum(Shape):
    """Craft one behind the other that swing across the track."""

    function = "pendulum"
    spacing: Length = Field(examples=['"100 m"'])
    cross_track: Length = Field(examples=['"100 m"'])


class Ring(Shape):
    """Craft apart by the phases of parallel eccentricity and inclination vectors."""

    function = "separated_ring"
    eccentricity: Length = Field(examples=['"100 m"'])
    inclination: Signed = Field(examples=['"100 m"'])
    first_phase: Angle = Field(0.0, examples=['"0 deg"'])

    def flaws(self) -> Iterator[str]:
        if self.inclination == 0.0:
            yield 'inclination must not be zero; write for example inclination = "100 m"'


class Line(Shape):
    """Craft at rest in a row, in deep space."""

    spacing: Length = Field(examples=['"75 m"'])
    direction: Annotated[Vector, Field(strict=False)] = Field(examples=["[1, 0, 0]"])

    def flaws(self) -> Iterator[str]:
        if not 1e-30 < max(map(abs, self.direction)) < 1e30:
            yield "direction does not point anywhere; write for example direction = [1, 0, 0]"

    def states(self, orbit: Orbit, count: int) -> Floats:
        from closeform.planning import targets

        return targets.line(count, self.spacing, self.direction)


class Formation(Table):
    """A formation by its name."""

    projected_circular: ProjectedCircular | None = Field(None, examples=['{ radius = "150 m" }'])
    safety_ellipse: SafetyEllipse | None = Field(
        None, examples=['{ radial = "100 m", cross_track = "100 m" }']
    )
    string_of_pearls: StringOfPearls | None = Field(None, examples=['{ spacing = "100 m" }'])
    pendulum: Pendulum | None = Field(None, examples=['{ spacing = "100 m", cross_track = "100 m" }'])
    ring: Ring | None = Field(None, examples=['{ eccentricity = "100 m", inclination = "100 m" }'])
    line: Line | None = Field(None, examples=['{ spacing = "75 m", direction = [1, 0, 0] }'])

    @property
    def shape(self) -> Shape | None:
        """The formation, if it is one that has a name."""
        shapes = (getattr(self, name) for name in Formation.model_fields)
        return next((shape for shape in shapes if shape is not None), None)

    @property
    def orbital(self) -> bool | None:
        """Whether it is for an orbit (True) or for deep space (False) only; None where it is for both."""
        return None if self.shape is None else self.line is None


class Start(Formation):
    """start: a relative orbit instead of a position and a velocity."""

    not_built = ("oem",)
    palmer: SixLengths | None = Field(None, examples=['"0 0 0 100 0 20 m"'])
    roe: SixLengths | None = Field(None, examples=['"0 0 0 100 0 100 m"'])
    oem: str | None = Field(None, min_length=1, examples=['"F1.oem"'])

    def flaws(self) -> Iterator[str]:
        yield from self.one_of("palmer", "roe", *Formation.model_fields, "oem")

    @property
    def orbital(self) -> bool | None:
        return True if self.palmer is not None or self.roe is not None else super().orbital


class Target(Table):
    """to: the state that one craft moves to, relative to the formation's origin."""

    position: Position | None = Field(None, examples=['"0 100 0 m"'])
    velocity: Velocity | None = Field(None, examples=['"0 0 0 m/s"'])
    palmer: SixLengths | None = Field(None, examples=['"0 0 0 100 0 20 m"'])
    roe: SixLengths | None = Field(None, examples=['"0 0 0 100 0 100 m"'])

    def flaws(self) -> Iterator[str]:
        yield from self.one_of("position", "palmer", "roe")
        yield from self.only_with("velocity", "position")
        if self.position is not None and self.velocity is None:
            yield 'position needs velocity; add for example velocity = "0 0 0 m/s"'

    @property
    def orbital(self) -> bool | None:
        """Whether it is for an orbit only (True), or for deep space too (None)."""
        return True if self.palmer is not None or self.roe is not None else None

    def state(self, orbit: Orbit, latitude: float = 0.0) -> Floats:
        """The state (6,) in SI units, when the origin is at that argument of latitude [rad]."""
        if self.palmer is not None:
            return state_from_palmer(self.palmer, orbit.mean_motion)
        if self.roe is not None:
            return state_from_scaled_roe(self.roe, orbit.mean_motion, latitude)
        return np.array([*(self.position or ()), *(self.velocity or ())])


class Destination(Target, Formation):
    """to: the state, or the relative orbit by its name, that one craft moves to."""

    def flaws(self) -> Iterator[str]:
        yield from self.one_of("position", "palmer", "roe", *Formation.model_fields)
        yield from self.only_with("velocity", "position")
        if self.position is not None and self.velocity is None:
            yield 'position needs velocity; add for example velocity = "0 0 0 m/s"'

    @property
    def orbital(self) -> bool | None:
        return super().orbital if self.shape is None else self.line is None

    def state(self, orbit: Orbit, latitude: float = 0.0) -> Floats:
        if self.shape is None:
            return super().state(orbit, latitude)
        return np.array(self.shape.states(orbit, 1)[0])


class Goal(Formation):
    """to: the relative orbits that a whole formation moves to."""

    remove: Literal["eccentricity", "altitude difference"] | None = Field(None, examples=['"eccentricity"'])
    join: Names | None = Field(None, examples=['["F1", "F2"]'])

    def flaws(self) -> Iterator[str]:
        yield from self.one_of(*Formation.model_fields, "remove", "join")

    @property
    def orbital(self) -> bool | None:
        return True if self.shape is None else super().orbital
