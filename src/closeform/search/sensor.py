"""Sensor of a lost craft: a cone with an offset and a range."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, pi

from closeform.arrays import number, size


@dataclass(frozen=True)
class Sensor:
    """Sensor with a conical field of view, which works only between two craft that see each other.

    Parameters
    ----------
    half_angle : float [rad]
        Half-angle of the cone, above 0 and below pi.
    offset : float [m], default 0
        Distance from the centre of mass along the boresight (H03: 7.5 m; S04: 0).
    range : float [m], default inf
        Largest distance between two sensors, above 0.

    Raises
    ------
    ValueError
        If a number is outside these bounds, nan, or not one number.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) eqs. 1-2; docs/theory.md (13).
    """

    half_angle: float
    offset: float = 0.0
    range: float = inf

    def __post_init__(self) -> None:
        for name in ("half_angle", "offset", "range"):
            object.__setattr__(self, name, number(name, getattr(self, name)))
        if not 0.0 < self.half_angle < pi:
            raise ValueError(
                f"half_angle: must be above 0 and below pi (180 deg), got {self.half_angle:g} rad"
            )
        size("offset", self.offset, " m")
        if not self.range > 0.0:
            raise ValueError(f"range: must be positive, got {self.range:g} m")

    @property
    def cosine(self) -> float:
        """Cosine of the half-angle, no unit; exactly 0 for a right angle."""
        value = cos(self.half_angle)
        return value if abs(value) > 1e-15 else 0.0

    @property
    def baseline(self) -> float:
        """Distance of two facing craft's centres of mass minus that of their sensors [m]."""
        return 2.0 * self.offset
