"""Navigation accuracy: errors of the measured states that feedback and replanning use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, number
from closeform.motion.elements.mean_motion import checked


@dataclass(frozen=True)
class Navigation:
    """Navigation accuracy: random errors of each axis, and constant ones.

    Parameters
    ----------
    position : float [m], default 0
        Standard deviation of the position on each axis.
    velocity : float [m/s], default 0
        Standard deviation of the velocity on each axis.
    position_bias : float [m], default 0
        Size of a constant position error, in any direction.
    velocity_bias : float [m/s], default 0
        Size of a constant velocity error, in any direction.
    correlation : float [s], default 0
        Correlation time of random errors (decay to 1/e), as of a filter; 0: independent measurements.

    Raises
    ------
    ValueError
        If a number is negative or not finite.

    References
    ----------
    docs/theory.md (86).
    """

    position: float = 0.0
    velocity: float = 0.0
    position_bias: float = 0.0
    velocity_bias: float = 0.0
    correlation: float = 0.0

    def __post_init__(self) -> None:
        for name in ("position", "velocity", "position_bias", "velocity_bias", "correlation"):
            object.__setattr__(self, name, float(nonnegative(name, number(name, getattr(self, name)))))

    def _kept(self, seconds: float) -> float:
        """Return the share of a random error that remains after some time."""
        return float(np.exp(-seconds / self.correlation)) if self.correlation > 0.0 else 0.0


def nonnegative(name: str, value: ArrayLike) -> Floats:
    """Return an argument as finite non-negative numbers."""
    sizes = np.asarray(checked(name, value))
    if not (sizes >= 0.0).all():
        raise ValueError(f"{name}: must be 0 or more, got {sizes.min():g}")
    return sizes
