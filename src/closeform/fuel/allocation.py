"""Allocation of a thrust in any direction to thrusters, with the minimum sum of thrusts."""

from dataclasses import dataclass
from itertools import combinations
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats

FLAT = 1e-9  # of three directions' determinant: they lie in a plane
DEAR = 1e4  # cost of a push along an axis without a thruster, relative to that of a thruster
SPREAD = 1e-6  # relative spread of costs: it decides which three of four thrusters in one facet fire
ROUNDING = 1e-11


@dataclass(frozen=True, eq=False)
class Allocation:
    """Facets of the hull of all directions: a thrust in a facet's cone is composed of its corners.

    This is the linear program min sum of amounts with its bases computed once. `corners` (F, 3) are
    thrusters; indices from `count` on are pushes along the axes, which no thruster makes. `inverses` (F, 3,
    3) give the amounts.
    """

    corners: Any
    inverses: Floats
    count: int

    @classmethod
    def of(cls, directions: Floats) -> Self:
        """Return the allocation for thrusters' directions (m, 3)."""
        count = len(directions)
        every = np.concatenate([directions, np.eye(3), -np.eye(3)])
        costs = np.where(np.arange(len(every)) < count, 1.0, DEAR)
        costs *= 1.0 + SPREAD * np.modf(np.arange(len(every)) * (np.sqrt(5.0) - 1.0) / 2.0)[0]
        corners = np.array(list(combinations(range(len(every)), 3)))
        corners = corners[np.abs(np.linalg.det(every[corners])) > FLAT]
        prices = np.linalg.solve(every[corners], costs[corners][:, :, None])[:, :, 0]
        sizes = np.abs(prices).sum(axis=1, keepdims=True)
        corners = corners[(prices @ every.T <= costs + ROUNDING * sizes).all(axis=1)]
        return cls(corners, np.linalg.inv(every[corners]), count)

    def facets(self, thrust: Floats, negligible: float) -> Any:
        """Return the facet (K,) whose cone contains each thrust (K, 3), up to negligible amounts."""
        least = np.einsum("ki,fij->fkj", thrust, self.inverses).min(axis=2)
        fits = least >= -negligible
        return np.where(fits.any(axis=0), fits.argmax(axis=0), least.argmax(axis=0))

    def amounts(self, facets: Any, thrust: Floats) -> Floats:
        """Return the pushes of the corners of facets (K,) for thrusts (K, ..., 3)."""
        found: Floats = np.einsum("k...i,kij->k...j", thrust, self.inverses[facets])
        return found
