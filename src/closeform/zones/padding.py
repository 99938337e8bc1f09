"""Padding: how far off their paths two craft may be together, by which the zone of the pair grows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, Self, runtime_checkable

import numpy as np

from closeform.arrays import Floats, numbers, shown
from closeform.zones.zone import Zone, gradient

Groups = tuple[tuple[Zone, Any], ...]  # each zone with the pairs (M, 2) that keep it


@runtime_checkable
class OffPaths(Protocol):
    """What knows how far bodies are off their paths: a `Tube`, or `TrackingMargins` along a plan."""

    def of_pairs(self, craft: int, fixed: int = 0) -> Floats:
        """How far the distance of each pair of bodies may be off (B, B) [m]."""


class Short(NamedTuple):
    """What a pair lacks that is `off` its zone [m], negative inside, and has a `margin` [m]; its `ratio`."""

    off: float
    margin: float
    ratio: float

    @classmethod
    def of(cls, zone: Zone, place: Floats, margin: float) -> Self:
        """Where it is `place` (3,) [m] apart."""
        return cls(float(gap(zone, place)[0]), margin, float(zone.norm(place)))

    @property
    def inside(self) -> bool:
        """Whether it is in the zone itself."""
        return self.off <= 0.0

    def __str__(self) -> str:
        if self.inside:
            return f"{self.ratio:.2f} x zone"
        return f"{self.off:.3g} m from their zone, less than the margin of {self.margin:.3g} m"


@dataclass(frozen=True, eq=False)
class Padding:
    """Metres (B, B) by which the zone of each pair of bodies grows."""

    metres: Floats

    @classmethod
    def of(cls, margin: Any, craft: int, fixed: int = 0) -> Self | None:
        """From a `margin` of some craft and bodies that are fixed; None where it is 0.

        Raises ValueError for what is no margin of so many.
        """
        if isinstance(margin, int | float) and margin == 0.0:
            return None
        count = craft + fixed
        metres = numbers("margin", margin.of_pairs(craft, fixed) if isinstance(margin, OffPaths) else margin)
        if metres.shape not in ((), (count, count)):
            raise ValueError(
                f"margin: one number [m], a Tube, or shape ({count}, {count}) of all pairs, got "
                f"{shown(margin)}"
            )
        metres = np.broadcast_to(metres, (count, count))
        if not ((metres >= 0.0) & (metres < np.inf)).all() or (metres != metres.T).any():
            raise ValueError(f"margin: metres, 0 or more, finite and symmetric, got {shown(margin)}")
        return cls(metres) if metres[np.triu_indices(count, 1)].any() else None

    def groups(self, groups: Groups) -> Groups:
        """The same pairs with zones that are padded, each by its own."""
        found: list[tuple[Zone, Any]] = []
        for zone, pairs in groups:
            each = self.metres[pairs[:, 0], pairs[:, 1]]
            found += [(zone.padded(m), pairs[each == m]) for m in np.unique(each)]
        return tuple(found)

    @property
    def told(self) -> Any:
        """The same as one number [m], where it is one."""
        each = self.metres[np.triu_indices(len(self.metres), 1)]
        return float(each[0]) if (each == each[0]).all() else self.metres

    def shortage(self, groups: Groups, pair: tuple[int, int], place: Floats) -> Short:
        """What a pair lacks where it is `place` (3,) [m] apart."""
        zone = next(zone for zone, pairs in groups if (pairs == pair).all(axis=1).any())
        return Short.of(zone, place, float(self.metres[pair]))


def gap(zone: Zone, place: Floats) -> tuple[Any, Floats]:
    """How far (...) [m] places (..., 3) are off the zone, at least, negative inside; and its normal."""
    rise = gradient(zone, place)
    steep = np.maximum(np.linalg.norm(rise, axis=-1), np.finfo(float).tiny)
    return (zone.norm(place) - 1.0) / steep, rise / steep[..., None]
