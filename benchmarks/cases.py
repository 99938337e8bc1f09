"""Shared tasks from fixed seeds: clusters, transfers past an obstacle, lost spacecraft."""

from dataclasses import dataclass

import numpy as np

from peers.motion import Array, held, natural, position, state, states_of, transfer

ALTITUDE = 500e3  # m
MEAN_MOTION = float(np.sqrt(3.986004418e14 / (6378137.0 + ALTITUDE) ** 3))  # rad/s
PERIOD = 2 * np.pi / MEAN_MOTION  # s
ZONE = np.array([20.0, 40.0, 20.0])  # semi-axes, or half-widths of a box [m]
RADIUS = 20.0  # of the sphere, for methods that know no other zone [m]


def cluster(craft: int, size: float, seed: int) -> Array:
    """Return states (craft, 6) of closed relative orbits with a small drift.

    Eccentricity and inclination vectors fill discs of radius `size`, centres are within `size` along the
    track, and the drift is at most 4 m per orbit.
    """
    rng = np.random.default_rng(seed)

    def disc() -> Array:
        angle, radius = rng.uniform(0, 2 * np.pi, craft), size * np.sqrt(rng.uniform(0, 1, craft))
        return radius * np.stack([np.cos(angle), np.sin(angle)])

    e, h = disc(), disc()
    d, along = rng.uniform(-0.2, 0.2, craft), rng.uniform(-size, size, craft)
    return states_of(np.stack([*e, d, along, *h], axis=-1), MEAN_MOTION)


@dataclass(frozen=True)
class Passage:
    """Transfer with a conflict on its direct path: states (6,), duration [s]."""

    initial: Array
    final: Array
    duration: float
    obstacle: Array  # its state at the start
    obstacle_final: Array | None  # where it is on a transfer of its own; None if it coasts

    @property
    def path(self) -> Array:
        return transfer(self.initial, self.final, self.duration, MEAN_MOTION)

    @property
    def obstacle_path(self) -> Array:
        if self.obstacle_final is None:
            return natural(self.obstacle, MEAN_MOTION)
        return transfer(self.obstacle, self.obstacle_final, self.duration, MEAN_MOTION)


def passages(count: int, seed: int) -> list[Passage]:
    """Return transfers of 0.4 to 1 orbit within a cluster; every third obstacle is on a transfer.

    The obstacle is inside the zone at some time in the middle half. Both ends are outside twice the box
    around the zone.
    """
    rng = np.random.default_rng(seed)
    found: list[Passage] = []
    while len(found) < count:
        initial, final = cluster(2, 200.0, int(rng.integers(2**31)))
        duration, when = rng.uniform(0.4, 1.0) * PERIOD, rng.uniform(0.25, 0.75)
        path = transfer(initial, final, duration, MEAN_MOTION)
        met = state(path, when * duration, MEAN_MOTION)
        met = met + np.concatenate([0.4 * ZONE * rng.uniform(-1, 1, 3), rng.uniform(-0.05, 0.05, 3)])
        start = held(MEAN_MOTION, -when * duration)[0] @ met
        end = None
        if len(found) % 3 == 2:
            end = held(MEAN_MOTION, duration)[0] @ start
            end = end + np.concatenate([rng.uniform(-60, 60, 3), rng.uniform(-0.05, 0.05, 3)])
        passage = Passage(initial, final, duration, start, end)
        if meets(passage):
            found.append(passage)
    return found


def meets(passage: Passage) -> bool:
    """Return True if the direct path enters the ellipsoid (ratio below 0.8) and both ends are far outside."""
    times = np.linspace(0, passage.duration, 2001)
    scaled = position(passage.path - passage.obstacle_path, times, MEAN_MOTION) / ZONE
    norms = np.linalg.norm(scaled, axis=1)
    return bool(norms.min() < 0.8 and np.abs(scaled[0]).max() > 2 and np.abs(scaled[-1]).max() > 2)


def lost_pairs(count: int, seed: int) -> tuple[Array, Array]:
    """Return relative positions [m] and velocities [m/s] (count, 3) as in S04 section V.

    Positions are uniform in a cube of 1 km, and velocity components within 20 cm/s.
    """
    rng = np.random.Generator(np.random.Philox(seed))
    craft = rng.uniform(-1.0, 1.0, (2, 2, count, 3)) * np.array([500.0, 0.2])[:, None, None, None]
    return craft[0, 1] - craft[0, 0], craft[1, 1] - craft[1, 0]


def lost_craft(cases: int, craft: int, seed: int) -> tuple[Array, Array]:
    """Return positions [m] and velocities [m/s] (cases, craft, 3) of lost spacecraft, uniform in balls.

    As in H03, five are up to 300 m apart with relative speeds up to 12 cm/s. More have the same density.
    """
    rng = np.random.Generator(np.random.Philox(seed))

    def ball(radius: float) -> Array:
        way = rng.normal(size=(cases, craft, 3))
        way /= np.linalg.norm(way, axis=-1, keepdims=True)
        return radius * way * np.cbrt(rng.uniform(0.0, 1.0, (cases, craft, 1)))

    return ball(150.0 * np.cbrt(craft / 5)), ball(0.06)
