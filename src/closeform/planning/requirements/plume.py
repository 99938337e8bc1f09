"""Exhaust that must not hit other spacecraft."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, pi
from typing import Any

import numpy as np

from closeform.arrays import Floats, instance, number
from closeform.motion.arc import IMPULSE
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.planning.requirements.requirement import Requirement
from closeform.planning.requirements.thrust_directions import ThrustRequirement, checked_half_angle


@dataclass(frozen=True, kw_only=True, eq=False)
class Plume(ThrustRequirement):
    """Cone of exhaust in which no other spacecraft may be while a spacecraft fires.

    The exhaust leaves opposite to the thrust.

    Parameters
    ----------
    start, end : float [s], default always
        Times between which the requirement holds.
    half_angle : float [rad]
        Between the axis of the exhaust and its edge, above 0 and below pi/2.
    range : float [m]
        Distance beyond which the exhaust does no harm; positive.
    others : Path, or sequence of Path, default all other spacecraft of the plan
        Spacecraft that the exhaust must not hit, while their paths last.

    Raises
    ------
    ValueError
        If a number is out of its range, or another spacecraft is not a path.

    Examples
    --------
    >>> plume = cf.requirements.Plume(half_angle=np.radians(20), range=50.0)
    """

    called = "plume limit"
    half_angle: float
    range: float
    others: Any = None

    def __post_init__(self) -> None:
        checked_half_angle(self.half_angle)
        if not number("range", self.range) > 0.0:
            raise ValueError(f"range: must be positive, got {self.range} m")
        if isinstance(self.others, list | tuple):
            object.__setattr__(self, "others", stack([instance("others", one, Path) for one in self.others]))
        elif self.others is not None:
            instance("others", self.others, Path)

    def _among(self, bodies: Path, i: int) -> Requirement:
        """Return the requirement for spacecraft i towards all other `bodies`, unless it has its own."""
        if self.others is not None:
            return self
        return replace(
            self, others=bodies._gathered(np.delete(np.arange(len(bodies)), i), (len(bodies) - 1,))
        )

    def _cones(self, times: Floats, places: Floats, about: Floats, speeds: Floats) -> tuple[Floats, Floats]:
        """Return axes (C, J, 3) away from the others in range, and half-angles (C, J) [rad]."""
        if self.others is None:
            raise ValueError("others: give the paths of the other spacecraft, which are known only in a plan")
        others, first = self.others, self.others.offsets[:-1]
        starts, ends = np.reshape(others.start, (-1, 1)), np.reshape(others.end, (-1, 1))
        states = others._evaluate_rows(np.clip(times, starts, ends))
        jumps = np.add.reduceat(np.linalg.norm(others.arcs[:, IMPULSE : IMPULSE + 3], axis=1), first)
        bend = np.maximum.reduceat(others.orbit._bends(others.arcs)[0], first)
        pace = speeds + np.linalg.norm(states[..., 3:], axis=-1) + (jumps[:, None] + bend[:, None] * about)
        away, moved = places - states[..., :3], pace * about
        distances = np.maximum(np.linalg.norm(away, axis=-1), np.finfo(float).tiny)
        spread = np.where(moved < distances, np.arcsin(np.minimum(moved / distances, 1.0)), pi)
        near = (times + about >= starts) & (times - about <= ends) & (distances - moved < self.range)
        return away / distances[..., None], np.where(near, self.half_angle + spread, -inf)
