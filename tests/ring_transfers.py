"""Transfers between relative rings around a client, from fixed seeds: clear themselves, not if thrust fails.

Start and end ring are those of natural motion without drift, clear of the client's zone by CLEAR for
ever: they are passively safe by themselves.  Without a plan some failure of thrust on the way leads into
the zone; cases of which no sampled failure does are drawn again.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import tau

import numpy as np

import closeform as cf

GROUPS = {"thirty": (12, 30), "hundred": (2012, 100)}  # seed and number of transfers
ALTITUDE = 500e3  # m
RADIUS = 30.0  # m, of the zone
SIZES = 60.0, 200.0  # m, amplitudes of a ring, radial and across the track
ALONG = 60.0  # m, standard deviation of a ring's centre along the track
CLEAR = 1.2  # least norm of a ring, for ever
ORBITS = 0.5, 2.0  # duration of the transfer
DRIFTS = 1, 2  # orbits after arrival
FAILURES, EACH_ORBIT = 240, 120  # samples of the time of failure, and of the drift after it


@dataclass(frozen=True, eq=False)
class RingTransfer:
    """From `initial` to `final` (6,) in `duration` [s], to be safe for `drift` [s] after arrival."""

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
    def path(self) -> cf.Path:
        """The unconstrained optimum."""
        return self.orbit.transfer(self.initial, self.final, self.duration)

    @cached_property
    def client(self) -> cf.Path:
        return self.orbit.coast(np.zeros(6), self.duration + self.drift)


def ring(orbit: cf.Orbit, rng: np.random.Generator) -> np.ndarray:
    """State of a ring that stays clear for ever: it has no drift, so that one turn shows all of it."""
    while True:
        radial, across = rng.uniform(*SIZES, 2)
        phase, cross_phase = rng.uniform(0.0, tau, 2)
        along = ALONG * rng.normal()
        lengths = radial * np.cos(phase), radial * np.sin(phase), 0.0, along
        palmer = *lengths, across * np.cos(cross_phase), across * np.sin(cross_phase)
        state = cf.elements.state_from_palmer(palmer, orbit.mean_motion)
        both = orbit.coast(state, orbit.period), orbit.coast(np.zeros(6), orbit.period)
        if cf.closest_approach(*both, cf.Sphere(RADIUS)).ratio > CLEAR:
            return state


def sampled_ratio(path: cf.Path, radius: float, until: float) -> float:
    """Least distance from the origin, in zones, of sampled failures of a path and the drifts after them."""
    orbit = path.orbit
    failures = np.linspace(path.start, path.end, FAILURES)
    count = int(EACH_ORBIT * (until - path.start) / orbit.period) + 1
    times = np.linspace(path.start, until, count)
    epoch = (orbit.transition(path.start - failures) @ path.state(failures)[:, :, None])[..., 0]
    places = np.einsum("tij,sj->sti", orbit.transition(times - path.start)[:, :3], epoch)
    distances = np.linalg.norm(places, axis=2)
    distances[times[None, :] < failures[:, None]] = np.inf
    return float(distances.min()) / radius


def unsafe_transfers(
    seed: int,
    number: int,
    orbits: tuple[float, float],
    drawn: Callable[[cf.Orbit, np.random.Generator, int], tuple[str, np.ndarray, np.ndarray]],
) -> tuple[RingTransfer, ...]:
    """So many of which some failure leads into the zone, each lasting some `orbits`.

    The k-th is `drawn` as its name and the natural motions that it leaves and joins, at time 0.
    """
    rng = np.random.default_rng(seed)
    orbit = cf.Orbit.circular(ALTITUDE)
    found: list[RingTransfer] = []
    while len(found) < number:
        duration = rng.uniform(*orbits) * orbit.period
        drift = float(rng.choice(DRIFTS)) * orbit.period
        name, initial, there = drawn(orbit, rng, len(found))
        final = orbit.transition(duration) @ there
        case = RingTransfer(name, orbit, initial, final, duration, drift)
        if sampled_ratio(case.path, RADIUS, duration + drift) < 1.0:
            found.append(case)
    return tuple(found)


@lru_cache
def ring_transfers(group: str) -> tuple[RingTransfer, ...]:
    """All transfers of one of the GROUPS."""
    seed, number = GROUPS[group]
    return unsafe_transfers(
        seed, number, ORBITS, lambda orbit, rng, k: (f"{group} {k}", ring(orbit, rng), ring(orbit, rng))
    )
