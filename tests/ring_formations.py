"""Formations that move from one ring of separated e- and i-vectors to another, from fixed seeds.

Both rings are safe however craft drift, by LEAST to MOST zones; without a plan the loss of one craft's
thrust leads it into another's zone: cases of which no failure does are drawn again.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import pi, sin

import numpy as np

import closeform as cf

SEEDS = {4: 412, 8: 812, 12: 1212}  # by number of craft
HELD_OUT = {12: 261122}  # planned once, when their search was done
NUMBER = 10  # of cases of each
ALTITUDE = 500e3  # m
RADIUS = 30.0  # m, of the zone around each craft
LEAST, MOST = 1.6, 3.0  # zones between neighbours' e-vectors, and their i-vectors
TURN = 0.5  # of a slot, either way: how far the ring is turned; farther on, another craft is nearer
ORBITS = 1.0, 2.0  # duration of the transfer
DRIFT = 1  # orbits after arrival


@dataclass(frozen=True, eq=False)
class RingFormation:
    """From `initial` to `final` (N, 6) in `duration` [s], to be safe for `drift` [s] after arrival."""

    name: str
    orbit: cf.Orbit
    initial: np.ndarray
    final: np.ndarray
    duration: float
    drift: float

    @cached_property
    def zone(self) -> cf.Sphere:
        return cf.Sphere(RADIUS)

    @cached_property
    def paths(self) -> cf.Path:
        """The unconstrained optima."""
        return self.orbit.transfer(self.initial, self.final, self.duration)


@lru_cache
def ring_formations(count: int, held_out: bool = False) -> tuple[RingFormation, ...]:
    """All cases of so many craft."""
    rng = np.random.default_rng((HELD_OUT if held_out else SEEDS)[count])
    orbit = cf.Orbit.circular(ALTITUDE)
    apart = 2.0 * sin(pi / count)  # of a ring's size, between neighbours
    found: list[RingFormation] = []
    while len(found) < NUMBER:
        sizes = RADIUS * rng.uniform(LEAST, MOST, 4) / apart
        first, turn = rng.uniform(0.0, 2.0 * pi), rng.uniform(-TURN, TURN) * 2.0 * pi / count
        duration = rng.uniform(*ORBITS) * orbit.period
        initial = cf.targets.separated_ring(orbit, count, *sizes[:2], first)
        there = cf.targets.separated_ring(orbit, count, *sizes[2:], first + turn)
        final = (orbit.transition(duration) @ there[:, :, None])[..., 0]
        name = f"{count} craft {len(found)}"
        case = RingFormation(name, orbit, initial, final, duration, DRIFT * orbit.period)
        if len(cf.drift_screen(case.paths, case.zone, duration + case.drift)):
            found.append(case)
    return tuple(found)
