"""Plain Monte Carlo of a coasting pair: sampled states, propagated by matrices, checked every ten seconds."""

import numpy as np

import closeform as cf
from peers.motion import Array

STEP = 10.0  # s


def sampled(
    orbit: cf.Orbit, state: Array, deviations: Array, duration: float, radius: float, samples: int
) -> float:
    """The share of states that are within a sphere at one of the times."""
    random = np.random.default_rng(1)
    moved = orbit.transition(np.arange(0.0, duration, STEP))[:, :3]
    met = 0
    for _ in range(samples // 1000):
        states = state + random.standard_normal((1000, 6)) * deviations
        positions = np.einsum("tij,sj->sti", moved, states)
        met += (np.einsum("sti,sti->st", positions, positions) <= radius**2).any(axis=1).sum()
    return float(met / (samples // 1000 * 1000))
