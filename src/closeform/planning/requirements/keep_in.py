"""Keep-in zone: a convex region that a spacecraft must not leave, or a waypoint with a tolerance."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from closeform.arrays import Floats, finite, instance, numbers
from closeform.planning.requirements.requirement import StateRequirement
from closeform.zones.zone import Zone, gradient


@dataclass(frozen=True, kw_only=True, eq=False)
class KeepIn(StateRequirement):
    """Keep-in zone; with `start` equal to `end` it is a waypoint, and the zone its tolerance.

    Parameters
    ----------
    start, end : float [s], default always
        Times between which the spacecraft must be inside.
    zone : Zone
        Region that contains the spacecraft.
    centre : array_like of shape (3,) [m], default the origin
        Position of the zone in the rotating frame.

    Raises
    ------
    ValueError
        If `zone` is not a zone, or the centre has another shape.

    Examples
    --------
    >>> waypoint = cf.requirements.KeepIn(zone=cf.Sphere(5.0), centre=[0, -500, 0], start=900, end=900)
    >>> float(waypoint.margin([0, -498, 0, 0, 0, 0]))
    3.0
    """

    zone: Zone
    centre: Any = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        instance("zone", self.zone, Zone)
        centre = finite("centre", numbers("centre", self.centre))
        if centre.shape != (3,):
            raise ValueError(f"centre: expected a position of shape (3,), got {centre.tolist()}")
        if not isfinite(self.zone.inner_radius):
            raise ValueError("zone: must hold a largest ball; give a sphere, ellipsoid, box or cylinder")
        object.__setattr__(self, "centre", centre)

    @property
    def called(self) -> str:  # type: ignore[override]
        """Name in messages."""
        return "waypoint" if self.start == self.end else "keep-in zone"

    def _margin(self, states: Floats) -> Floats:
        """Return a lower bound (...) [m] on the distance of states (..., 6) from the surface."""
        found: Floats = self.zone.inner_radius * (1.0 - self.zone.norm(states[..., :3] - self.centre))
        return found

    def _slope(self, states: Floats) -> Floats:
        """Return the slopes (..., 6) of the margin at states (..., 6)."""
        found = np.zeros_like(states)
        for k in np.ndindex(states.shape[:-1]):
            found[k][:3] = -self.zone.inner_radius * gradient(self.zone, states[k][:3] - self.centre)
        return found
