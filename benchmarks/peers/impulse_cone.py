"""Minimum delta-v at equal times as a cone program (Clarabel), without certificate between these times."""

from dataclasses import dataclass
from typing import Any

import clarabel
import numpy as np
from scipy import sparse
from scipy.linalg import expm

from peers.motion import Array


@dataclass
class ConeProgram:
    """A transfer's program, its matrices made: what is timed is the solver."""

    given: tuple[Any, ...]
    size: float

    def solve(self) -> float:
        """The least sum of impulses [m/s]."""
        return float(clarabel.DefaultSolver(*self.given).solve().obj_val * self.size)


def build(n: float, initial: Array, final: Array, duration: float, count: int) -> ConeProgram:
    """Impulses at `count` equal times, by powers of the matrix exponential; lengths over the duration."""
    rates = np.zeros((6, 6))
    rates[:3, 3:] = np.eye(3)
    rates[3, 0], rates[3, 4], rates[4, 3], rates[5, 2] = 3 * n * n, 2 * n, -2 * n, -n * n
    step, effects = expm(rates * duration / (count - 1)), [np.eye(6)[:, 3:]]
    for _ in range(count - 1):
        effects.append(step @ effects[-1])
    scale = np.array([1 / duration] * 3 + [1.0] * 3)
    gap = scale * (final - expm(rates * duration) @ initial)
    size = float(np.linalg.norm(gap))
    rows, costs = np.zeros((6, 4 * count)), np.zeros(4 * count)
    for k, effect in enumerate(reversed(effects)):
        rows[:, 4 * k + 1 : 4 * k + 4] = scale[:, None] * effect
    costs[::4] = 1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    given = (
        sparse.csc_matrix((4 * count, 4 * count)),
        costs,
        sparse.csc_matrix(np.vstack([rows, -np.eye(4 * count)])),
        np.concatenate([gap / size, np.zeros(4 * count)]),
        [clarabel.ZeroConeT(6), *[clarabel.SecondOrderConeT(4)] * count],
        settings,
    )
    return ConeProgram(given, size)
