"""Bounds on the search errors of craft, their effect on the turns, and the instants of a proof."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, inf, pi
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors, errors_of_each
from closeform.search.sensor import Sensor
from closeform.search.slew_profile import ExecutedTurns

# fields that differ between the worst cases
DIFFERING = ("slew_rate", "start", "half_angle", "slew_acceleration")
STEP = pi / 90.0  # rad, turn of the boresight between two instants
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

    def search_times(self, search: Search, times: Floats) -> Floats:
        """Return the search times (2, T) [s] reached by the slowest and the fastest craft at `times`.

        All craft make the same turns, so every other craft lies between these two.  # theory (57)
        """
        return ExecutedTurns(search, ("A", "A"), of_two(self.slowest, self.fastest)).search_times(times)

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
    each = [errors_of_each(errors, (2,)) for errors in some]
    return SearchErrors(**{name: np.stack([getattr(one, name) for one in each])[which] for name in DIFFERING})


def instants_of(search: Search, until: float, bounds: ErrorBounds) -> Floats:
    """Return the instants of a dense test of boxes, with the cone in which both certainly see each other.

    Rows (N, 6): time [s], boresight of A midway between the slowest and the fastest craft, cosine of the
    narrowed cone, and the displacement [m] of the two sensors by errors.  # theory (57)
    """
    times = [0.0]
    for leg in search.legs:
        count = ceil(abs(leg.angle) / STEP)
        times += [leg.start + (leg.end - leg.start) * k / count for k in range(1, count)] + [leg.end]
    when = np.array([t for t in times if t < until] + [until])
    behind, ahead = bounds.search_times(search, when)
    error = bounds.pointing + search.slew_rate * 0.5 * (ahead - behind)
    half_angle = search.sensor.half_angle - error
    # the cone is convex up to half of the sky; a wider one is replaced by that half
    cosines = np.where(half_angle < pi / 2.0, np.cos(half_angle), 0.0)
    shift = 2.0 * search.sensor.baseline * np.sin(np.minimum(error, pi) / 2.0)
    rows = np.column_stack([when, search.boresight(0.5 * (behind + ahead)), cosines, shift])
    return np.ascontiguousarray(rows[half_angle > 0.0])
