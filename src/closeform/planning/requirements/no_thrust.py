"""Times without thrust, such as eclipses or ground contacts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, IMPULSE, PUSH, START
from closeform.motion.path import Path
from closeform.planning.requirements.requirement import Requirement, Worst


@dataclass(frozen=True, kw_only=True)
class NoThrust(Requirement):
    """Time between `start` and `end` [s] in which a spacecraft does not fire.

    Parameters
    ----------
    start, end : float [s]
        First and last time of the quiet time.

    Raises
    ------
    ValueError
        If the end is not after the start.

    Examples
    --------
    >>> eclipse = cf.requirements.NoThrust(start=600.0, end=2700.0)
    """

    called = "time without thrust"
    unit = "s"
    start: float = field()  # without the defaults of other requirements
    end: float = field()

    def __post_init__(self) -> None:
        if not self.start < self.end:
            raise ValueError(f"end: must be after start, got {self.start} to {self.end} s")

    def _holds(self, path: Path) -> bool:
        """Return whether a path does not fire in this time."""
        return self._worst(path).margin >= 0.0

    def _worst(self, path: Path) -> Worst:
        """Return the overlap [s] of a path's firings with this time, as a negative margin."""
        arcs = path.arcs
        impulses, burns = arcs[:, IMPULSE : IMPULSE + 3].any(axis=1), arcs[:, PUSH : PUSH + 3].any(axis=1)
        begins, ends = arcs[:, START], np.where(burns, arcs[:, END], arcs[:, START])
        inside = self._forbids(begins, ends) & (impulses | burns)
        if not inside.any():
            return Worst()
        depths = np.minimum(self.end - begins, ends - self.start)[inside]
        return Worst(-float(depths.max()), float(begins[inside][depths.argmax()]))

    def _forbids(self, begins: Floats, ends: Floats) -> Any:
        """Return whether firings (...) overlap this time, from `begins` to `ends` [s]."""
        return (begins < self.end) & (ends > self.start)
