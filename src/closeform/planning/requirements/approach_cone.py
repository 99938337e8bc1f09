"""Approach corridor: a cone or a cylinder that a spacecraft must not leave."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, tan
from typing import Any

import numpy as np

from closeform.arrays import Floats, finite, number, numbers
from closeform.planning.requirements.requirement import StateRequirement, units


@dataclass(frozen=True, kw_only=True, eq=False)
class ApproachCone(StateRequirement):
    """Approach corridor: a cone that opens along an axis, or with half-angle 0 a cylinder.

    Parameters
    ----------
    start, end : float [s], default always
        Times between which the spacecraft must be inside.
    axis : array_like of shape (3,), no unit
        Direction in the rotating frame from the target into the corridor; any length.
    half_angle : float [rad]
        Between axis and surface, from 0 to below pi/2.
    radius : float [m]
        Radius of the corridor at the target, such as the tolerance of a docking port; positive.
    target : array_like of shape (3,) [m], default the origin
        Position of the target in the rotating frame.

    Raises
    ------
    ValueError
        If a shape or a number is out of its range.

    Examples
    --------
    >>> corridor = cf.requirements.ApproachCone(axis=[0, -1, 0], half_angle=np.radians(10), radius=0.5)
    >>> corridor.margin([0, -100, 5, 0, 0, 0]) > 0
    np.True_
    """

    called = "approach corridor"
    axis: Any
    half_angle: float
    radius: float
    target: Any = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        axis, target = (finite(name, numbers(name, getattr(self, name))) for name in ("axis", "target"))
        if axis.shape != (3,) or not axis.any():
            raise ValueError(f"axis: expected a direction of shape (3,), got {axis.tolist()}")
        if target.shape != (3,):
            raise ValueError(f"target: expected a position of shape (3,), got {target.tolist()}")
        if not 0.0 <= number("half_angle", self.half_angle) < pi / 2.0:
            raise ValueError(f"half_angle: must be at least 0 and below pi/2 rad, got {self.half_angle}")
        if not number("radius", self.radius) > 0.0:
            raise ValueError(f"radius: must be positive, got {self.radius} m")
        object.__setattr__(self, "axis", axis / np.linalg.norm(axis))
        object.__setattr__(self, "target", target)

    def _outline(self, places: Floats) -> Floats:
        """Return four lines (4, 2, 3) on the surface, as far from the target as places (K, 3) [m] are."""
        along = float(((places - self.target) @ self.axis).max(initial=0.0))
        across = np.linalg.svd(self.axis[None])[2][1:]
        sides = np.concatenate([across, -across])
        far = self.radius + along * tan(self.half_angle)
        ends = self.target + along * self.axis + far * sides
        return np.stack([self.target + self.radius * sides, ends], axis=1)

    def _margin(self, states: Floats) -> Floats:
        """Return the distances (...) [m] of states (..., 6) from the surface, negative outside."""
        place = states[..., :3] - self.target
        along = place @ self.axis
        off = np.linalg.norm(place - along[..., None] * self.axis, axis=-1)
        found: Floats = (self.radius - off) * cos(self.half_angle) + along * sin(self.half_angle)
        return found

    def _slope(self, states: Floats) -> Floats:
        """Return the slopes (..., 6) of the margin at states (..., 6)."""
        off = states[..., :3] - self.target
        off -= (off @ self.axis)[..., None] * self.axis
        found = np.zeros_like(states)
        found[..., :3] = sin(self.half_angle) * np.asarray(self.axis) - cos(self.half_angle) * units(off)
        return found
