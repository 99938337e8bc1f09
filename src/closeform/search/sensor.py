"""Sensor: what a lost craft sees with."""

from dataclasses import dataclass
from math import cos, inf, isfinite, pi

from closeform.arrays import numbers, shown


def one_number(name: str, value: float) -> float:
    """An argument as one float; ValueError naming it for anything else, or for nan."""
    number = numbers(name, value)
    if number.shape or number != number:
        raise ValueError(f"{name}: must be one number, got {shown(value)}")
    return float(number)


def positive(name: str, value: float) -> float:
    """An argument as a positive, finite float; ValueError naming it for anything else."""
    number = one_number(name, value)
    if not (isfinite(number) and number > 0.0):
        raise ValueError(f"{name}: must be positive and finite, got {number:g}")
    return number


@dataclass(frozen=True)
class Sensor:
    """A sensor that sees a cone about its boresight, and works only between two that see each other.

    `half_angle` of the cone [rad]; `offset` of the sensor from the centre of mass along the
    boresight [m] (H03: 7.5 m; S04: 0); `range` [m] between two sensors.  Raises ValueError for a
    half-angle that is not between 0 and pi, a negative offset or a range that is not positive.
    """

    half_angle: float
    offset: float = 0.0
    range: float = inf

    def __post_init__(self) -> None:
        for name in ("half_angle", "offset", "range"):
            object.__setattr__(self, name, one_number(name, getattr(self, name)))
        if not 0.0 < self.half_angle < pi:
            raise ValueError(
                f"half_angle: must be above 0 and below pi (180 deg), got {self.half_angle:g} rad"
            )
        if not (isfinite(self.offset) and self.offset >= 0.0):
            raise ValueError(f"offset: must be finite and at least 0 m, got {self.offset:g}")
        if not self.range > 0.0:
            raise ValueError(f"range: must be positive, got {self.range:g} m")

    @property
    def cosine(self) -> float:
        """Cosine of the half-angle; below 1e-15 it is that of a right angle."""
        value = cos(self.half_angle)
        return value if abs(value) > 1e-15 else 0.0

    @property
    def baseline(self) -> float:
        """How much farther apart two centres of mass are than their facing sensors [m].  # theory (13)"""
        return 2.0 * self.offset
