"""ErrorBounds: how far craft may be off what a search asks of them, and what that makes of their turns."""

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

DIFFERING = ("slew_rate", "start", "half_angle", "slew_acceleration")  # fields that differ among the worst
ALONG = 1e-9  # rad: of a cone, at least this is left by a boresight that leans away


@dataclass(frozen=True)
class ErrorBounds:
    """The most by which boresights [rad], clocks [s] and slew rates (of the search's, below 1) are off.

    And the least slew acceleration [rad/s^2].
    """

    pointing: float = 0.0
    timing: float = 0.0
    rate: float = 0.0
    acceleration: float = inf

    @property
    def slowest(self) -> dict[str, float]:
        """The errors of who is behind all others, as the keys of SearchErrors: late, slow, with ramps."""
        return {"start": self.timing, "slew_rate": -self.rate, "slew_acceleration": self.acceleration}

    @property
    def fastest(self) -> dict[str, float]:
        """The errors of who is ahead of all others."""
        return {"start": -self.timing, "slew_rate": self.rate, "slew_acceleration": inf}

    def searched(self, search: Search, times: Floats) -> Floats:
        """How far the slowest and the fastest have come at some times: when the search is there (2, T) [s].

        Everybody makes the same turns, so all others are between them.                  # theory (57)
        """
        return OwnTurns(search, ("A", "A"), of_two(self.slowest, self.fastest)).searched(times)

    def worst(self, sensor: Sensor) -> list[SearchErrors]:
        """Errors (2,) of the craft in A and in B that are as bad as the bounds allow.

        Boresights lean away from the other craft, which leaves so much less of the cone; not those of sensors
        with an offset, which move with them.  One is behind all others and one ahead, or both are on time.
        """
        lean = min(self.pointing, sensor.half_angle - ALONG) if sensor.offset == 0.0 else 0.0
        right = {"start": 0.0, "slew_rate": 0.0, "slew_acceleration": inf}
        apart = [(self.slowest, self.fastest), (self.fastest, self.slowest)] if self.slowest != right else []
        return [of_two(*both, half_angle=-lean) for both in [*apart, (right, right)]]


def of_two(one: dict[str, float], other: dict[str, float], **alike: Any) -> SearchErrors:
    """The errors (2,) of two craft from those of each, and those that both have."""
    return SearchErrors(**{name: [one[name], other[name]] for name in one}, **alike)


def errors_numbered(some: list[SearchErrors], which: Any) -> SearchErrors:
    """For each number (C,) the errors (2,) of which it is: (C, 2)."""
    each = [of_each(errors, (2,)) for errors in some]
    return SearchErrors(**{name: np.stack([getattr(one, name) for one in each])[which] for name in DIFFERING})
