"""Bounds on the search errors of craft, and their effect on the turns."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.search.imperfect_attitude import OwnTurns
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors, of_each
from closeform.search.sensor import Sensor

# fields that differ between the worst cases
DIFFERING = ("slew_rate", "start", "half_angle", "slew_acceleration")
ALONG = 1e-9  # rad: smallest half-angle that remains of a cone with a tilted boresight


@dataclass(frozen=True)
class ErrorBounds:
    """Bounds on the errors of boresights [rad], clocks [s] and slew rates (relative, below 1).

    Also the minimum slew acceleration [rad/s^2].
    """

    pointing: float = 0.0
    timing: float = 0.0
    rate: float = 0.0
    acceleration: float = inf

    @property
    def slowest(self) -> dict[str, float]:
        """Errors of a craft behind all others, as the keys of SearchErrors: late, slow, with ramps."""
        return {"start": self.timing, "slew_rate": -self.rate, "slew_acceleration": self.acceleration}

    @property
    def fastest(self) -> dict[str, float]:
        """Errors of a craft ahead of all others."""
        return {"start": -self.timing, "slew_rate": self.rate, "slew_acceleration": inf}

    def searched(self, search: Search, times: Floats) -> Floats:
        """Return the search times (2, T) [s] reached by the slowest and the fastest craft at `times`.

        All craft make the same turns, so every other craft lies between these two.  # theory (57)
        """
        return OwnTurns(search, ("A", "A"), of_two(self.slowest, self.fastest)).searched(times)

    def worst(self, sensor: Sensor) -> list[SearchErrors]:
        """Return errors (2,) of the craft in A and in B that are as bad as the bounds allow.

        Boresights tilt away from the other craft, which narrows the cone by the same angle. Sensors with an
        offset do not tilt, because they would move. One craft is behind all others and one ahead, or both are
        on time.
        """
        lean = min(self.pointing, sensor.half_angle - ALONG) if sensor.offset == 0.0 else 0.0
        right = {"start": 0.0, "slew_rate": 0.0, "slew_acceleration": inf}
        apart = [(self.slowest, self.fastest), (self.fastest, self.slowest)] if self.slowest != right else []
        return [of_two(*both, half_angle=-lean) for both in [*apart, (right, right)]]


def of_two(one: dict[str, float], other: dict[str, float], **alike: Any) -> SearchErrors:
    """Return the errors (2,) of two craft from those of each and the common ones."""
    return SearchErrors(**{name: [one[name], other[name]] for name in one}, **alike)


def errors_numbered(some: list[SearchErrors], which: Any) -> SearchErrors:
    """Return the errors (C, 2) that the indices `which` (C,) select."""
    each = [of_each(errors, (2,)) for errors in some]
    return SearchErrors(**{name: np.stack([getattr(one, name) for one in each])[which] for name in DIFFERING})
