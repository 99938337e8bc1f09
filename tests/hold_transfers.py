"""Transfers from a hold on the track to a ring, or from a ring to such a hold, from fixed seeds.

The hold is ahead of the client or behind it, at rest; rings are those of `ring_transfers`.  All separation
by eccentricity and inclination vanishes at the hold, so that what drifts off near it crosses the track.
"""

from functools import lru_cache

import numpy as np

import closeform as cf
from ring_transfers import ALTITUDE, DRIFTS, RADIUS, RingTransfer, ring, sampled_ratio

SEED, NUMBER = 40, 10
AWAY = 150.0, 400.0  # m, from the client to the hold
ORBITS = 0.8, 2.0  # duration of the transfer


@lru_cache
def hold_transfers() -> tuple[RingTransfer, ...]:
    """Ten of them, every other one to a hold; without a plan some failure leads into the zone."""
    rng = np.random.default_rng(SEED)
    orbit = cf.Orbit.circular(ALTITUDE)
    found: list[RingTransfer] = []
    while len(found) < NUMBER:
        duration = rng.uniform(*ORBITS) * orbit.period
        drift = float(rng.choice(DRIFTS)) * orbit.period
        hold = np.array([0.0, rng.choice([-1.0, 1.0]) * rng.uniform(*AWAY), 0.0, 0.0, 0.0, 0.0])
        there = ring(orbit, rng)
        leaves = len(found) % 2 == 0
        ends = (hold, orbit.transition(duration) @ there) if leaves else (there, hold)
        name = f"{'from' if leaves else 'to'} a hold {len(found)}"
        case = RingTransfer(name, orbit, *ends, duration, drift)
        if sampled_ratio(case.path, RADIUS, duration + drift) < 1.0:
            found.append(case)
    return tuple(found)
