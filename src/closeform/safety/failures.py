"""Failures: what can go wrong with the thrust of a craft."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import number, numbers, positive


@dataclass(frozen=True)
class ThrustLost:
    """Thrust is lost for good, at any instant of the path; in the midst of an impulse, too.

    From then on the craft drifts.  The path as planned is among what can happen: thrust that is lost
    at its end.

    References
    ----------
    docs/theory.md section 8.
    """


@dataclass(frozen=True)
class MissedBurns:
    """Burns are missed or too weak: each gives its own share, and the next are flown still.

    A burn is an impulse, or a stretch of continuous thrust.  All shares at once, each by itself: with
    `least=0` any burns may be missed, one, some, or all from one on; what is planned is flown open
    loop, without knowledge of what was missed.

    Parameters
    ----------
    least : float, no unit, default 0
        Of the shares that burns give, from 0 on, below 1.

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
    """From any instant on, all thrust is the same share of what is planned.

    The share is anything from `least` up to 1, and the plan is flown on open loop, impulses included.

    Parameters
    ----------
    least : float, no unit, default 0
        Of the share that is left, from 0 on, below 1; 0 holds `ThrustLost`.

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
    """Thrust is stuck on, at any instant, for any time up to the longest; after that the craft drifts.

    Parameters
    ----------
    longest : float [s]
        For which thrust can be stuck: until somebody closes the valve, or the tank is empty.
    acceleration : array_like of shape (3,) [m/s^2], optional
        The thrust that is stuck on, in the rotating frame: then it can be at any instant, coasting too.
        Unless given it is the thrust that the path has at that instant.

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
        raise ValueError(f"{name}: a share of thrust from 0 on, below 1, got {share:g}")
    return share
