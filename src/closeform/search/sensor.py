"""Sensor: what a lost craft sees with."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, pi

from closeform.arrays import numbers, positive, shown, size


def one_number(name: str, value: float) -> float:
    """An argument as one float; ValueError naming it for anything else, or for nan."""
    number = numbers(name, value)
    if number.shape or number != number:
        raise ValueError(f"{name}: must be one number, got {shown(value)}")
    return float(number)


def one_positive(name: str, value: float) -> float:
    """The same, which is positive and finite."""
    return positive(name, one_number(name, value))


@dataclass(frozen=True)
class Sensor:
    """A sensor that sees a cone about its boresight, and works only between two that see each other.

    Parameters
    ----------
    half_angle : float [rad]
        Of the cone, above 0 and below pi.
    offset : float [m], default 0
        From the centre of mass along the boresight (H03: 7.5 m; S04: 0).
    range : float [m], default inf
        Between two sensors, above 0.

    Raises
    ------
    ValueError
        If a number is outside of these bounds, nan, or not one number.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) eqs. 1-2; docs/theory.md (13).
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
        size("offset", self.offset, " m")
        if not self.range > 0.0:
            raise ValueError(f"range: must be positive, got {self.range:g} m")

    @property
    def cosine(self) -> float:
        """Cosine of the half-angle, no unit; 0 where it is below 1e-15, that of a right angle."""
        value = cos(self.half_angle)
        return value if abs(value) > 1e-15 else 0.0

    @property
    def baseline(self) -> float:
        """How much farther apart two centres of mass are than their facing sensors [m]."""  # theory (13)
        return 2.0 * self.offset
