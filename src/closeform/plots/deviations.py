"""Deviations: where one craft is relative to another, and how far off it may be, at some times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from closeform.arrays import Floats, instance
from closeform.motion.path import Path
from closeform.plots.style import common_time, instants
from closeform.uncertainty.clearance import clearance_in_sigmas
from closeform.uncertainty.errors import Uncertainty
from closeform.zones.zone import Zone

BRIEF = 1e-6  # s, in which nothing changes: clearance at an instant


@dataclass(frozen=True, eq=False)
class Deviations:
    """Relative states (T, 6) of two craft at `times` (T,), and their covariances (T, 6, 6)."""

    path: Path
    times: Floats
    states: Floats
    covariances: Floats

    @classmethod
    def of(cls, path: Path, other: Path, errors: Any, other_errors: Any) -> Deviations:
        """Raises ValueError where two craft share no time, or errors are none."""
        start, end = common_time(path, other)
        times = instants(start, end, path, other)
        covariances = np.zeros((len(times), 6, 6))
        for name, one, craft in (("errors", errors, path), ("other_errors", other_errors, other)):
            if one is not None:
                covariances += instance(name, one, Uncertainty).covariance(craft, times)
        return cls(path, times, path.state(times) - other.state(times), covariances)

    def sigmas(self, zone: Zone) -> Floats:
        """How many just touch a zone at each time (T,); inf where none do."""
        still = self.path.orbit.coast(self.states, BRIEF)
        there = self.path.orbit.coast(np.zeros(6), BRIEF)
        places = np.zeros_like(self.covariances)  # by velocities nobody moves in so brief a time
        places[:, :3, :3] = self.covariances[:, :3, :3]
        errors = [Uncertainty(one) for one in places]
        return np.asarray(clearance_in_sigmas(still, there, zone, errors).sigmas)
