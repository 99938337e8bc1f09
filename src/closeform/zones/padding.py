"""Keep-out margins: the distance by which the zone of each pair grows for tracking errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, Self, runtime_checkable

import numpy as np

from closeform.arrays import Floats, numbers, shown
from closeform.zones.zone import Zone, gradient

Groups = tuple[tuple[Zone, Any], ...]  # each zone with its pairs (M, 2)


@runtime_checkable
class OffPaths(Protocol):
    """Provider of tracking-error bounds: a `Tube`, or `TrackingMargins` along a plan."""

    def of_pairs(self, craft: int, fixed: int = 0) -> Floats:
        """Return the bounds (B, B) [m] of the error of the distance of each pair of bodies."""


class Short(NamedTuple):
    """Shortage of a pair: its distance `off` the zone [m], negative inside; its `margin` [m]; its `ratio`."""

    off: float
    margin: float
    ratio: float

    @classmethod
    def of(cls, zone: Zone, place: Floats, margin: float) -> Self:
        """Return the shortage at relative position `place` (3,) [m]."""
        return cls(float(gap(zone, place)[0]), margin, float(zone.norm(place)))

    @property
    def inside(self) -> bool:
        """True if the pair is inside the zone itself."""
        return self.off <= 0.0

    def __str__(self) -> str:
        if self.inside:
            return f"{self.ratio:.2f} x zone"
        return f"{self.off:.3g} m from their zone, less than the margin of {self.margin:.3g} m"


@dataclass(frozen=True, eq=False)
class Padding:
    """Keep-out margins (B, B) [m] of all pairs of bodies."""

    metres: Floats

    @classmethod
    def of(cls, margin: Any, craft: int, fixed: int = 0) -> Self | None:
        """Return the padding of a `margin` for spacecraft and fixed bodies; None if it is 0.

        Raises ValueError for an invalid margin or one for another number of bodies.
        """
        if isinstance(margin, int | float) and margin == 0.0:
            return None
        count = craft + fixed
        metres = numbers("margin", margin.of_pairs(craft, fixed) if isinstance(margin, OffPaths) else margin)
        if metres.shape not in ((), (count, count)):
            raise ValueError(
                f"margin: expected one number [m], a Tube, or shape ({count}, {count}) of all pairs, got "
                f"{shown(margin)}"
            )
        metres = np.broadcast_to(metres, (count, count))
        if not ((metres >= 0.0) & (metres < np.inf)).all() or (metres != metres.T).any():
            raise ValueError(f"margin: must be 0 m or more, finite and symmetric, got {shown(margin)}")
        return cls(metres) if metres[np.triu_indices(count, 1)].any() else None

    def groups(self, groups: Groups) -> Groups:
        """Return the groups of pairs with padded zones."""
        found: list[tuple[Zone, Any]] = []
        for zone, pairs in groups:
            each = self.metres[pairs[:, 0], pairs[:, 1]]
            found += [(zone.padded(m), pairs[each == m]) for m in np.unique(each)]
        return tuple(found)

    @property
    def told(self) -> Any:
        """Margin as one number [m] if it is equal for all pairs, else (B, B)."""
        each = self.metres[np.triu_indices(len(self.metres), 1)]
        return float(each[0]) if (each == each[0]).all() else self.metres

    def shortage(self, groups: Groups, pair: tuple[int, int], place: Floats) -> Short:
        """Return the shortage of a pair at relative position `place` (3,) [m]."""
        zone = next(zone for zone, pairs in groups if (pairs == pair).all(axis=1).any())
        return Short.of(zone, place, float(self.metres[pair]))


def gap(zone: Zone, place: Floats) -> tuple[Any, Floats]:
    """Return lower bounds (...) [m] of distances from the zone, negative inside, and normals (..., 3)."""
    rise = gradient(zone, place)
    steep = np.maximum(np.linalg.norm(rise, axis=-1), np.finfo(float).tiny)
    return (zone.norm(place) - 1.0) / steep, rise / steep[..., None]
