"""Thrust and propellant limits: longer plans under a thrust limit, and the propellant of a delta-v."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.fuel.falling_mass import STANDARD_GRAVITY
from closeform.fuel.shortest import REACH
from closeform.motion.elements.mean_motion import checked
from closeform.motion.orbit import Orbit

FAR = 100.0  # times the duration: longest duration tried in deep space
LEAST_STEP, LARGEST_STEP = 1.02, 2.0  # factors of one stretch of the durations
STRETCHINGS = 16  # at most
HALVINGS = 5  # bisections of the last stretch
FULL = 1 + 1e-9  # of a limit

Planned = TypeVar("Planned")


def propellant(mass: ArrayLike, delta_v: ArrayLike, specific_impulse: ArrayLike) -> Any:
    """Return the propellant that a velocity change requires, by Tsiolkovsky's equation.

    Parameters
    ----------
    mass : array_like of shape (...) [kg]
        Mass before the burns, including propellant.
    delta_v : array_like of shape (...) [m/s]
        Velocity change, at least 0.
    specific_impulse : array_like of shape (...) [s]
        Exhaust speed divided by 9.80665 m/s^2; all arguments broadcast.

    Returns
    -------
    float or array of shape (...) [kg]
        Propellant mass (1 - exp(-delta_v / exhaust speed)).

    Raises
    ------
    ValueError
        If a mass or a specific impulse is not positive, a delta-v is negative, or a number is not finite.

    References
    ----------
    Tsiolkovsky's equation; standard gravity of the CGPM, 1901.
    """
    wet = checked("mass", mass, positive=True)
    exhaust = STANDARD_GRAVITY * checked("specific_impulse", specific_impulse, positive=True)
    spent = checked("delta_v", delta_v)
    if np.any(np.less(spent, 0.0)):
        raise ValueError(f"delta_v: must be at least 0, got {np.min(spent):g} m/s")
    return -wet * np.expm1(-spent / exhaust)


def longest(orbit: Orbit, duration: float) -> float:
    """Return the longest duration [s] to try for a thrust limit where a `duration` [s] was requested.

    It is ten orbits or twice the duration, in deep space a hundred times the duration, over which thrust
    falls to a ten-thousandth.
    """
    if orbit.period == np.inf:
        return FAR * duration
    return max(REACH * orbit.period, LARGEST_STEP * duration)


class Stretched(NamedTuple, Generic[Planned]):
    """Plan at a `factor` of all durations, or None; `excess` (N,) is its thrust divided by the limits."""

    factor: float
    found: Planned | None
    excess: Floats

    @property
    def measure(self) -> str:
        """Description of the durations tried and of the outcome."""
        if self.found is None:
            return f"longer, up to {self.factor:.4g} times the duration: the thrust limit is exceeded"
        return f"longer, {self.factor:.6g} times the duration: the thrust limit is kept"


def stretched(
    excess: Floats,
    free: Callable[[float], Floats],
    attempt: Callable[[float], tuple[Planned, Floats] | None],
    most: float,
) -> Stretched[Planned]:
    """Return the plan with the smallest factor of all durations found to respect the thrust limits.

    `excess` (N,) is the peak thrust of the unlimited plan divided by its limits.  `free` returns the same for
    the direct paths at a factor. `attempt` plans at a factor and returns None if no plan is clear. The factor
    is at most `most`.
    """
    short = long = weak = 1.0
    found = None
    for _ in range(STRETCHINGS):
        if long >= most:
            break
        short = long
        step = np.clip(np.sqrt(excess.max()), LEAST_STEP, LARGEST_STEP)  # thrust: as 1 / time^2
        long = min(long * float(step), most)
        peaks = free(long)
        if peaks.max() <= FULL:
            planned = attempt(long)
            if planned is None:
                continue
            found, peaks = planned
            if peaks.max() <= FULL:
                break
            found = None
        weak, excess = long, peaks
    if found is None:
        return Stretched(weak, None, excess)
    for _ in range(HALVINGS):
        middle = 0.5 * (short + long)
        planned = attempt(middle)
        if planned is not None and planned[1].max() <= FULL:
            found, long = planned[0], middle
        else:
            short = middle
    return Stretched(long, found, excess)
