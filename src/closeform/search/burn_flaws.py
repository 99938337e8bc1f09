"""BurnFlaws: thrust that craft of a gathering lose, and errors of their burns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats

FEW = 4  # burns of each craft for which random numbers are drawn at first


@dataclass(frozen=True, eq=False)
class BurnFlaws:
    """How the burns of craft (N,) go wrong in some cases (C,).

    `fails` (C, N) [s]: from when on each has no thrust, inf for who does not lose it; `gates` (N, 4): the
    sigmas of Gates' model of its burns; `normals`: from a number B normal random numbers (C, N, B, 3) for the
    first B burns, along each and two across, None where burns are exact.
    """

    fails: Floats
    gates: Floats
    normals: Callable[[int], Floats] | None = None

    @classmethod
    def of_thrust(cls, fails: Floats) -> Self:
        """Thrust is lost, and burns are exact."""
        return cls(fails, np.zeros((fails.shape[1], 4)))

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> Self:
        """All is well with craft (C, N)."""
        return cls.of_thrust(np.full(shape, inf))

    @property
    def any(self) -> bool:
        """Whether anything goes wrong."""
        return self.normals is not None or bool(np.isfinite(self.fails).any())

    def drawn(self, burns: int) -> tuple[Any, ...]:
        """The arrays that kernels take, with random numbers for so many burns of each craft."""
        exact = np.empty((*self.fails.shape, 0, 3))
        numbers = exact if self.normals is None else np.ascontiguousarray(self.normals(burns))
        return np.ascontiguousarray(self.fails), self.gates, numbers
