"""Sensor of a lost craft: a cone with an offset and a range."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, pi

import numpy as np

from closeform.arrays import Floats, number, positive, size


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
    range_error, bearing_error : float [m], [rad], default 0
        Standard deviations of a measured distance, and of a measured direction about each axis across it.
        `gather` computes burns from such measurements.
    fix_interval : float [s], default 10
        Time between the two measurements after a lock that give the relative velocity, above 0.

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
    range_error: float = 0.0
    bearing_error: float = 0.0
    fix_interval: float = 10.0

    def __post_init__(self) -> None:
        for name in ("half_angle", "offset", "range", "range_error", "bearing_error", "fix_interval"):
            object.__setattr__(self, name, number(name, getattr(self, name)))
        if not 0.0 < self.half_angle < pi:
            raise ValueError(
                f"half_angle: must be above 0 and below pi (180 deg), got {self.half_angle:g} rad"
            )
        size("offset", self.offset, " m")
        size("range_error", self.range_error, " m")
        size("bearing_error", self.bearing_error, " rad")
        positive("fix_interval", self.fix_interval)
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

    @property
    def _accuracy(self) -> Floats:
        """Range error [m], bearing error [rad] and time between both fixes [s] (3,)."""
        return np.array([self.range_error, self.bearing_error, self.fix_interval])

    @property
    def _exact(self) -> bool:
        """True if a lock gives the exact relative state."""
        return self.range_error == self.bearing_error == 0.0
