"""Failures of the thrust of a spacecraft."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import number, numbers, positive


@dataclass(frozen=True)
class ThrustLost:
    """Permanent loss of thrust at any instant of the path, also during an impulse.

    The spacecraft drifts from then on.  The path as planned is included: thrust that is lost
    at its end.

    References
    ----------
    docs/theory.md section 8.
    """


@dataclass(frozen=True)
class MissedBurns:
    """Missed or incomplete burns: each gives its own fraction, and later burns are still executed.

    A burn is an impulse, or an interval of continuous thrust.  All fractions are independent: with
    `least=0` any burns may be missed, one, some, or all from one on; the plan is executed open
    loop, without knowledge of missed burns.

    Parameters
    ----------
    least : float, no unit, default 0
        Minimum fraction of each burn, at least 0 and below 1.

    Raises
    ------
    ValueError
        If `least` is outside of [0, 1).

    References
    ----------
    docs/theory.md section 8.
    """

    least: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "least", _share("least", self.least))


@dataclass(frozen=True)
class DegradedThrust:
    """Degraded thrust: from any instant on, all thrust is the same fraction of the planned thrust.

    The fraction is any from `least` up to 1, and the plan is executed open loop, impulses included.

    Parameters
    ----------
    least : float, no unit, default 0
        Minimum fraction that remains, at least 0 and below 1; 0 includes `ThrustLost`.

    Raises
    ------
    ValueError
        If `least` is outside of [0, 1).

    References
    ----------
    docs/theory.md section 8.
    """

    least: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "least", _share("least", self.least))


@dataclass(frozen=True, eq=False)
class StuckOnThrust:
    """Thrust that is stuck on, from any instant, for any time up to the longest; then the spacecraft drifts.

    Parameters
    ----------
    longest : float [s]
        Longest duration for which thrust can be stuck on, until a valve is closed or the tank is empty.
    acceleration : array_like of shape (3,) [m/s^2], optional
        Thrust that is stuck on, in the rotating frame; it can then occur at any instant, also during coasts.
        By default it is the thrust of the path at that instant.

    Raises
    ------
    ValueError
        If `longest` is not positive and finite, or `acceleration` not finite or of another shape.

    References
    ----------
    docs/theory.md section 8.
    """

    longest: float
    acceleration: Any = None

    def __init__(self, longest: float, acceleration: ArrayLike | None = None) -> None:
        seconds = positive("longest", longest, " s")
        thrust = None if acceleration is None else numbers("acceleration", acceleration)
        if thrust is not None and (thrust.shape != (3,) or not np.isfinite(thrust).all()):
            raise ValueError(
                f"acceleration: expected three finite numbers in m/s^2, got {np.asarray(thrust).tolist()}"
            )
        object.__setattr__(self, "longest", seconds)
        object.__setattr__(self, "acceleration", thrust)


Failure = ThrustLost | MissedBurns | DegradedThrust | StuckOnThrust


def _share(name: str, value: ArrayLike) -> float:
    share = number(name, value)
    if not 0.0 <= share < 1.0:
        raise ValueError(f"{name}: must be a fraction of the thrust, at least 0 and below 1, got {share:g}")
    return share
