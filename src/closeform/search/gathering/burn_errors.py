"""Losses of thrust and execution errors of the burns of a gathering."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats


@dataclass(frozen=True, eq=False)
class BurnErrors:
    """Errors of the burns of craft (N,) in the given cases (C,).

    `losses` (C, N) [s]: the time from which each has no thrust, inf if it keeps it; `gates` (N, 4): the
    sigmas of Gates' model of its burns; `normals`: a function of B that returns normal random numbers (C, N,
    B, 3) for the first B burns, one along the burn and two across, None if burns are exact.
    """

    losses: Floats
    gates: Floats
    normals: Callable[[int], Floats] | None = None

    @classmethod
    def of_losses(cls, losses: Floats) -> Self:
        """Return losses of thrust, with exact burns."""
        return cls(losses, np.zeros((losses.shape[1], 4)))

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> Self:
        """Return the absence of errors for craft (C, N)."""
        return cls.of_losses(np.full(shape, inf))

    @property
    def any(self) -> bool:
        """True if there is any error."""
        return self.normals is not None or bool(np.isfinite(self.losses).any())

    def sampled(self, burns: int) -> tuple[Any, ...]:
        """Return the arrays for kernels, with random numbers for a number of burns of each craft."""
        exact = np.empty((*self.losses.shape, 0, 3))
        numbers = exact if self.normals is None else np.ascontiguousarray(self.normals(burns))
        return np.ascontiguousarray(self.losses), self.gates, numbers
