"""Times without thrust, such as eclipses or ground contacts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, IMPULSE, PUSH, START
from closeform.motion.path import Path
from closeform.planning.requirements.requirement import Requirement


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

    start: float = field()  # without the defaults of other requirements
    end: float = field()

    def __post_init__(self) -> None:
        if not self.start < self.end:
            raise ValueError(f"end: must be after start, got {self.start} to {self.end} s")

    def _holds(self, path: Path) -> bool:
        """Return whether a path does not fire in this time."""
        arcs = path.arcs
        impulses, burns = arcs[:, IMPULSE : IMPULSE + 3].any(axis=1), arcs[:, PUSH : PUSH + 3].any(axis=1)
        ends = np.where(burns, arcs[:, END], arcs[:, START])
        return not (self._forbids(arcs[:, START], ends) & (impulses | burns)).any()

    def _forbids(self, begins: Floats, ends: Floats) -> Any:
        """Return whether firings (...) overlap this time, from `begins` to `ends` [s]."""
        return (begins < self.end) & (ends > self.start)
