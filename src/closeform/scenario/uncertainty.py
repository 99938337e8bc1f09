"""Uncertainty of one craft: `covariance` of its initial state and `execution` errors of its thrust."""

from collections.abc import Iterator
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field

from closeform.arrays import Floats
from closeform.scenario.quantity import ANGLE, LENGTH, NOISE, SHARE, SPEED, Reader
from closeform.scenario.table import Table, Vector
from closeform.uncertainty.covariance import root_of

Deviations = Annotated[Vector, BeforeValidator(Reader(LENGTH, 3, "zero"))]
Speeds = Annotated[Vector, BeforeValidator(Reader(SPEED, 3, "zero"))]
Six = tuple[float, float, float, float, float, float]
Row = Annotated[Six, Field(strict=False)]
Share = Annotated[float, BeforeValidator(Reader(SHARE, least="zero"))]
Angle = Annotated[float, BeforeValidator(Reader(ANGLE, least="zero"))]
Speed = Annotated[float, BeforeValidator(Reader(SPEED, least="zero"))]
Rows = tuple[Row, Row, Row, Row, Row, Row]
EXACT = "exact"  # in a list: no uncertainty for this craft
UNCORRELATED: Any = tuple(tuple(row) for row in np.eye(6, dtype=int).tolist())


def as_errors(value: Any) -> Any:
    """Return a table of errors unchanged, or None for "exact"."""
    return None if value == EXACT else value


class Covariance(Table):
    """Table `covariance`: standard deviations and correlations of the initial position and velocity."""

    position: Deviations = Field((0.0, 0.0, 0.0), examples=['"3 6 3 m"'])
    velocity: Speeds = Field((0.0, 0.0, 0.0), examples=['"2 2 2 mm/s"'])
    correlation: Annotated[Rows, Field(strict=False)] = Field(
        UNCORRELATED, examples=[str([list(row) for row in UNCORRELATED])]
    )

    def flaws(self) -> Iterator[str]:
        if not np.allclose(np.diag(self.correlation), 1.0, atol=1e-9):
            yield "correlation has not 1 on its diagonal; the sizes stand in position and velocity"
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

    speed: Speed = Field(0.0, examples=['"1 mm/s"'])
    magnitude: Share = Field(0.0, examples=['"1 %"'])
    across: Speed = Field(0.0, examples=['"1 mm/s"'])
    pointing: Angle = Field(0.0, examples=['"0.5 deg"'])


class Execution(Table):
    """Table `execution`: execution errors of a craft's thrust."""

    magnitude: Share = Field(0.0, examples=['"1 %"'])
    pointing: Angle = Field(0.0, examples=['"0.5 deg"'])
    impulse: Gates | None = Field(None, examples=['{ speed = "1 mm/s", magnitude = "1 %" }'])
    noise: Annotated[float, BeforeValidator(Reader(NOISE, least="zero"))] = Field(
        0.0, examples=['"1e-9 m^2/s^3"']
    )

    @property
    def gates(self) -> tuple[float, float, float, float]:
        """Gates deviations s1 to s4 of impulses: their own, or else those of continuous thrust."""
        if self.impulse is None:
            return 0.0, self.magnitude, 0.0, self.pointing
        one = self.impulse
        return one.speed, one.magnitude, one.across, one.pointing
