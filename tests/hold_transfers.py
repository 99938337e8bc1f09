"""Transfers from a hold on the track to a ring, or from a ring to such a hold, from fixed seeds.

The hold is ahead of the client or behind it, at rest; rings are those of `ring_transfers`.  All separation
by eccentricity and inclination vanishes at the hold, so that what drifts off near it crosses the track.
"""

import json
from functools import lru_cache
from pathlib import Path

import numpy as np

import closeform as cf
from ring_transfers import RingTransfer, ring, unsafe_transfers

SEED, NUMBER = 40, 10
AWAY = 150.0, 400.0  # m, from the client to the hold
ORBITS = 0.8, 2.0  # duration of the transfer


def hold_and_ring(orbit: cf.Orbit, rng: np.random.Generator, k: int) -> tuple[str, np.ndarray, np.ndarray]:
    """The k-th transfer's name, and the motions that it leaves and joins: every other one joins a hold."""
    hold = np.array([0.0, rng.choice([-1.0, 1.0]) * rng.uniform(*AWAY), 0.0, 0.0, 0.0, 0.0])
    there = ring(orbit, rng)
    return (f"from a hold {k}", hold, there) if k % 2 == 0 else (f"to a hold {k}", there, hold)


@lru_cache
def hold_transfers() -> tuple[RingTransfer, ...]:
    """Ten of them; without a plan some failure leads into the zone."""
    return unsafe_transfers(SEED, NUMBER, ORBITS, hold_and_ring)


COSTS = json.loads((Path(__file__).parent / "data" / "hold_costs.json").read_text(encoding="utf-8"))
DEARER = 1.01
SEVERAL = {2: 1.03, 3: 1.4, 6: 1.25}  # neighbouring local optima
