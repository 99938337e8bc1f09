"""Table of zones between many kinds of own zones, each made when a pair first requires it."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from closeform.zones.combined_zones import CovarianceZone, OwnZone, enlarged, key, pair_zone
from closeform.zones.shapes import BALL
from closeform.zones.zone import Zone

NONE = -1  # index of a pair without a zone
ROUND = 1e-12  # relative difference that a sphere's axes may have


class MadeTable:
    """Table (K + 1, K + 1) of the zones between kinds of `own` zones, the last of which is None.

    `zones` and their `rules` grow with the kinds that are looked up.
    """

    def __init__(self, own: Sequence[OwnZone | None]) -> None:
        self.own = list(own)
        self.zones: list[Zone] = []
        self.rules: list[str] = []
        self._found: dict[tuple[int, int], int] = {}
        self._held: dict[Any, int] = {}

    def __getitem__(self, kinds: tuple[Any, Any]) -> Any:
        first, second = np.broadcast_arrays(*kinds)
        count = len(self.own)
        codes, where = np.unique((first % count) * count + second % count, return_inverse=True)
        made = [self._made(*divmod(code, count)) for code in codes.tolist()]
        return np.array(made, dtype=np.int64)[where].reshape(first.shape)

    def _made(self, one: int, other: int) -> int:
        """Return the index of the zone between two kinds, -1 for none."""
        if (one, other) not in self._found:
            around, seen = self.own[other], self.own[one]
            if around is None and seen is None:
                return NONE
            zone, rule = pair_zone(around, seen)
            number = self._held.setdefault((rule, key(zone)), len(self.zones))
            if number == len(self.zones):
                self.zones.append(zone)
                self.rules.append(rule)
            self._found[one, other] = number
        return self._found[one, other]

    @property
    def reach(self) -> float:
        """Distance [m] beyond which no pair is in its zone."""
        far = [set_of(one).radius for one in self.own if one is not None]
        return float(np.sort([0.0, 0.0, *far])[-2:].sum())

    def enlarged(self, factor: float) -> Self:
        """Return the table for own zones scaled by `factor`."""
        return type(self)([None if one is None else enlarged(one, factor) for one in self.own])


def set_of(own: OwnZone) -> Zone:
    """Return the set of relative positions of an own zone alone."""
    return own if isinstance(own, Zone) else own.zone


def never_refused(own: Sequence[OwnZone | None]) -> bool:
    """Return True if any two own zones combine: spheres, and covariances of equal sigmas."""
    given = [one for one in own if one is not None]
    sigmas = {one.sigmas for one in given if isinstance(one, CovarianceZone)}
    regions = [one for one in given if not isinstance(one, CovarianceZone)]
    return len(sigmas) < 2 and all(isinstance(one, Zone) and is_sphere(one) for one in regions)


def is_sphere(zone: Zone) -> bool:
    """Return True if a zone is a sphere."""
    matrix = zone.matrix
    alike = np.abs(matrix - matrix[0, 0] * np.eye(3)).max() <= ROUND * abs(matrix[0, 0])
    return zone.shape == BALL and bool(alike)
