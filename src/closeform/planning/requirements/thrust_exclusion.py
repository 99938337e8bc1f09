"""Directions without thrust, such as towards the Sun or the Earth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from closeform.arrays import Floats, finite, number, numbers
from closeform.planning.requirements.thrust_directions import ThrustRequirement, checked_half_angle


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrustExclusion(ThrustRequirement):
    """Cone about a direction into which a spacecraft must not thrust.

    The cone restricts the acceleration.  The exhaust leaves in the opposite direction.

    Parameters
    ----------
    start, end : float [s], default always
        Times between which the exclusion holds.
    direction : array_like of shape (3,), no unit
        Axis of the cone in the rotating frame at time 0; any length.
    half_angle : float [rad]
        Between axis and surface, above 0 and below pi/2.
    rate : float [rad/s], default 0
        Rate at which the axis turns about the cross-track direction; minus the mean motion for a direction
        that is fixed in inertial space, such as that of the Sun.

    Raises
    ------
    ValueError
        If a shape or a number is out of its range.

    Examples
    --------
    >>> earth = cf.requirements.ThrustExclusion(direction=[-1, 0, 0], half_angle=np.radians(30))
    """

    called = "direction without thrust"
    direction: Any
    half_angle: float
    rate: float = 0.0

    def __post_init__(self) -> None:
        direction = finite("direction", numbers("direction", self.direction))
        if direction.shape != (3,) or not direction.any():
            raise ValueError(f"direction: expected a direction of shape (3,), got {direction.tolist()}")
        checked_half_angle(self.half_angle)
        finite("rate", np.array(number("rate", self.rate)))
        object.__setattr__(self, "direction", direction / np.linalg.norm(direction))

    def _cones(self, times: Floats, places: Floats, about: Floats, speeds: Floats) -> tuple[Floats, Floats]:
        """Return the turned axis (1, J, 3), and half-angles (1, J) [rad] that contain its turn."""
        x, y, z = self.direction
        c, s = np.cos(self.rate * times), np.sin(self.rate * times)
        axes = np.stack([x * c - y * s, x * s + y * c, np.full(len(times), z)], axis=-1)
        return axes[None], (self.half_angle + abs(self.rate) * about)[None]
