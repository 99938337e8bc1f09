"""Passages of one spacecraft past zones, and dense formations with boxes, from fixed seeds.

The direct path of a passage conflicts with every obstacle, and both of its ends are MARGIN zones away.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from math import log, pi

import numpy as np

import closeform as cf
from formations import DEEP_SPACE, Task

MARGIN = 1.05  # least norm between an end of the path and an obstacle there
GROUPS = {  # name: number of passages, shape, number of obstacles
    "one ellipsoid": (60, "ellipsoid", 1),
    "one box": (60, "box", 1),
    "three ellipsoids": (60, "ellipsoid", 3),
    "three boxes": (40, "box", 3),
    "six ellipsoids": (40, "ellipsoid", 6),
    "tilted": (200, None, None),
}
SIZES = 10.0, 60.0  # m, half-axes and half-widths
DISTANCES = 100.0, 500.0  # m, between the two ends of a path
LOW, MEDIUM, HIGH = (400e3, 700e3), (1000e3, 30_000e3), 35_786e3  # m, altitudes
COUNTS, KINDS = (4, 6, 8, 12), ("aligned in deep space", "aligned in orbit", "tilted in orbit")
TRIES = 2000


@dataclass(frozen=True, eq=False)
class Passage:
    """One craft past M obstacles, a Path of shape (M,), each with its own of the `zones`."""

    name: str
    orbit: cf.Orbit
    initial: np.ndarray
    final: np.ndarray
    duration: float
    obstacles: cf.Path
    zones: tuple

    @cached_property
    def path(self):
        """The direct transfer."""
        return self.orbit.transfer(self.initial, self.final, self.duration)

    def conflicts(self, path):
        """Obstacles whose zones `path` enters."""
        pairs = enumerate(zip(self.obstacles, self.zones, strict=True))
        return [k for k, (other, zone) in pairs if cf.find_conflicts(path, other, zone)]

    def ratios(self, path):
        """Least norm of `path` in the zone of each obstacle (M,)."""
        pairs = zip(self.obstacles, self.zones, strict=True)
        return np.array([cf.closest_approach(path, other, zone).ratio for other, zone in pairs])

    def end_ratio(self):
        """Least norm of either end of the path in the zone of any obstacle."""
        ends = 0.0, self.duration
        pairs = zip(self.obstacles, self.zones, strict=True)
        return min(zone.norm(gaps(self.path, other, ends)).min() for other, zone in pairs)


def passages(group):
    return [passage(group, seed) for seed in range(GROUPS[group][0])]


def passage(group, seed):
    """Passage `seed` of a group."""
    rng = np.random.Generator(np.random.Philox(key=[260 + list(GROUPS).index(group), seed]))
    _, shape, count = GROUPS[group]
    count = count or int(rng.integers(1, 7))
    shape = shape or ("ellipsoid", "box")[rng.integers(2)]
    orbit, duration = drawn_orbit(rng)
    zones = drawn_zones(rng, shape, count, tilted=group == "tilted")
    for _ in range(TRIES):
        initial, final = drawn_ends(rng, orbit, duration)
        path = orbit.transfer(initial, final, duration)
        others = [obstacle(rng, path, zone) for zone in zones]
        if None not in others:
            name = f"{group} {seed}"
            return Passage(name, orbit, initial, final, duration, cf.stack(others), zones)
    raise RuntimeError(f"passage {seed} of {group} does not come about")


def drawn_orbit(rng):
    """Return an orbit (half low, a tenth deep space, else higher) and a duration [s]."""
    kind = rng.choice(["low", "deep space", "medium", "high"], p=[0.5, 0.1, 0.2, 0.2])
    if kind == "deep space":
        return DEEP_SPACE, between(rng, 300.0, 6000.0)
    altitude = {"low": rng.uniform(*LOW), "medium": between(rng, *MEDIUM), "high": HIGH}[kind]
    orbit = cf.Orbit.circular(altitude)
    return orbit, orbit.period * rng.uniform(0.1, 1.0)


def drawn_zones(rng, shape, count, tilted):
    """Return mostly one zone for all, else one shape in several sizes or a zone for each."""

    def drawn():
        lengths = between(rng, *SIZES, 3)
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0] if tilted else None
        return cf.Box(lengths, axes) if shape == "box" else cf.Ellipsoid(lengths, axes)

    kind = rng.choice(["one", "sizes", "own"], p=[0.6, 0.25, 0.15])
    first = drawn()
    if kind == "one" or count == 1:
        return (first,) * count
    if kind == "sizes":
        return tuple(first.enlarged(size) for size in rng.uniform(0.5, 1.0, count))
    return (first, *(drawn() for _ in range(count - 1)))


def drawn_ends(rng, orbit, duration):
    """Return two states: at rest, on closed relative orbits, or with a random velocity."""
    way = direction(rng) * rng.uniform(*DISTANCES)
    middle = direction(rng) * rng.uniform(0.0, 200.0)
    places = middle + np.array([-0.5, 0.5])[:, None] * way
    speeds = rng.normal(size=(2, 3)) * rng.choice([0.0, 0.5]) * np.linalg.norm(way) / duration
    speeds[:, 1] -= 2 * orbit.mean_motion * places[:, 0] * (rng.random() < 0.6)
    return np.concatenate([places, speeds], axis=1)


def obstacle(rng, path, zone):
    """Return a path within the zone of a point of `path` and clear of its ends, or None.

    Most coast, a third on closed relative orbits; one in six thrusts; one in ten exists before and after.
    """
    orbit, duration = path.orbit, path.end
    for _ in range(50):
        time = duration * rng.uniform(0.15, 0.85)
        miss = direction(rng)
        place = path.position(time) + miss * rng.uniform(0.0, 0.95) / zone.norm(miss)
        velocity = rng.normal(size=3) * 50.0 * (orbit.mean_motion or 1 / duration)
        velocity[1] = -2 * orbit.mean_motion * place[0]
        drift = rng.normal(size=3) * rng.choice([0.0, 0.3, 1.0]) * 200.0 / duration
        state = np.concatenate([place, velocity + drift])
        longer = duration * (rng.random() < 0.1)
        if rng.random() < 1 / 6:
            other = thrusting(rng, orbit, duration, time, place)
        else:
            early = orbit.transition(-longer - time) @ state
            other = orbit.coast(early, duration + 2 * longer, start=-longer)
        if zone.norm(gaps(path, other, (0.0, duration))).min() >= MARGIN:
            return other
    return None


def thrusting(rng, orbit, duration, time, place):
    """Return another energy-optimal transfer through `place` at `time`."""
    initial, final = drawn_ends(rng, orbit, duration)
    off = place - orbit.transfer(initial, final, duration).position(time)
    moved = orbit.transition(-time) @ np.concatenate([off, np.zeros(3)])  # natural motion on top of it
    return orbit.transfer(initial + moved, final + orbit.transition(duration) @ moved, duration)


def crowds():
    """Return dense formations with boxes that swap places through the centre, for `reconfigure`."""
    return [
        crowd(count, ring, kind) for count in COUNTS for ring in (True, False) for kind in range(len(KINDS))
    ]


def crowd(count, ring, kind):
    """Return spacecraft at rest, on a ring or at random, each to the opposite place, with a box."""
    rng = np.random.Generator(np.random.Philox(key=[300 + count, 10 * ring + kind]))
    orbit, duration = DEEP_SPACE, 1000.0
    if kind:
        orbit = cf.Orbit.circular(rng.uniform(*LOW))
        duration = orbit.period * rng.uniform(0.2, 0.6)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    zone = cf.Box(between(rng, 5.0, 30.0, 3), axes if KINDS[kind].startswith("tilted") else None)
    if ring:
        angles = 2 * pi * np.arange(count) / count
        places = np.stack([np.zeros(count), np.cos(angles), np.sin(angles)], axis=1)
        places = places @ np.linalg.qr(rng.normal(size=(3, 3)))[0] if kind == 2 else places
    else:
        drawn = rng.uniform(-1.0, 1.0, (200, count, 3)) @ np.linalg.inv(zone.matrix).T
        places = max(drawn, key=lambda each: nearest(each, zone))
    places = places * rng.uniform(1.1, 1.6) / nearest(places, zone)
    states = np.concatenate([places, np.zeros((count, 3))], axis=1)
    name = f"{count} craft {'on a ring' if ring else 'at random points'}, {KINDS[kind]}"
    return Task(name, orbit, states, -states, duration, zone)


def nearest(places, zone):
    """Return the least clearance ratio between any two positions."""
    return min(zone.norm(one - other) for one, other in combinations(places, 2))


def gaps(path, other, times):
    """Return relative positions at times (T, 3)."""
    return path.position(times) - other.position(times)


def between(rng, low, high, size=None):
    """Return a log-uniform number."""
    return np.exp(rng.uniform(log(low), log(high), size))


def direction(rng):
    """Return a random unit vector."""
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)
