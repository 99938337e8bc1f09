"""Limit of the speed, which may rise with the distance along an approach."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from closeform.arrays import Floats, finite, number, numbers
from closeform.planning.requirements.requirement import StateRequirement, units


@dataclass(frozen=True, kw_only=True, eq=False)
class SpeedLimit(StateRequirement):
    """Limit of the speed in the rotating frame: `limit`, plus `rate` times the distance along an axis.

    Parameters
    ----------
    start, end : float [s], default always
        Times between which the limit holds.
    limit : float [m/s]
        Greatest speed at the target; positive.
    rate : float [1/s], default 0
        Increase of the limit with the distance from the target along `axis`; not negative.
    axis : array_like of shape (3,), no unit, optional
        Direction in the rotating frame from the target to the spacecraft; required with a `rate`.
    target : array_like of shape (3,) [m], default the origin
        Position of the target in the rotating frame.

    Raises
    ------
    ValueError
        If a shape or a number is out of its range, or a rate has no axis.

    Examples
    --------
    >>> glide = cf.requirements.SpeedLimit(limit=0.05, rate=1e-3, axis=[0, -1, 0])
    >>> round(float(glide.margin([0, -100, 0, 0, 0.1, 0])), 9)
    0.05
    """

    called = "speed limit"
    unit = "m/s"
    reserve = 1e-6
    limit: float
    rate: float = 0.0
    axis: Any = (0.0, 0.0, 0.0)
    target: Any = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        axis, target = (finite(name, numbers(name, getattr(self, name))) for name in ("axis", "target"))
        if axis.shape != (3,) or target.shape != (3,):
            raise ValueError("axis: expected a direction, and target a position, both of shape (3,)")
        if not 0.0 < number("limit", self.limit) < inf:
            raise ValueError(f"limit: must be positive and finite, got {self.limit} m/s")
        if not 0.0 <= number("rate", self.rate) < inf:
            raise ValueError(f"rate: must be finite and not negative, got {self.rate} 1/s")
        if self.rate and not axis.any():
            raise ValueError("axis: required with rate; give the direction from the target")
        size = float(np.linalg.norm(axis))
        object.__setattr__(self, "axis", axis / size if size else axis)
        object.__setattr__(self, "target", target)

    @property
    def per_metre(self) -> float:  # type: ignore[override]
        """Bound on the slope of the margin in the position [1/s]."""
        return self.rate

    @property
    def per_speed(self) -> float:  # type: ignore[override]
        """Bound on the slope of the margin in the velocity."""
        return 1.0

    def _margin(self, states: Floats) -> Floats:
        """Return the difference [m/s] of the limit and the speeds of states (..., 6)."""
        along = (states[..., :3] - self.target) @ self.axis
        found: Floats = self.limit + self.rate * along - np.linalg.norm(states[..., 3:], axis=-1)
        return found

    def _slope(self, states: Floats) -> Floats:
        """Return the slopes (..., 6) of the margin at states (..., 6)."""
        along = np.broadcast_to(self.rate * self.axis, states[..., :3].shape)
        return np.concatenate([along, -units(states[..., 3:])], axis=-1)
