"""Reconfigurations from fixed seeds, drawn before there was a planner: swaps and random formations.

Craft are held by their task at their starts and before (coasting), and at their ends and after;
between them they are free.  A task's craft are clear of each other, by MARGIN, where they are held.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import pi

import numpy as np

import closeform as cf

MARGIN = 1.05  # least norm between any two that are held
CASES, CONFLICTING = 200, 50
SAMPLES = 400  # of the time in which craft coast
ALTITUDES = 400e3, 35_786e3  # m
DEEP_SPACE = cf.Orbit(0.0)
LOW_ORBIT = cf.Orbit.circular(500e3)
TRIES = 2000


@dataclass(frozen=True, eq=False)
class Task:
    """One call of `reconfigure`; `pair` are the two that are in conflict where they are held."""

    name: str
    orbit: cf.Orbit
    initial: np.ndarray
    final: np.ndarray
    duration: float | np.ndarray
    zone: object
    start: float | np.ndarray = 0.0
    obstacles: tuple = ()
    pair: tuple | None = None

    @property
    def arguments(self):
        names = "orbit", "initial", "final", "duration", "zone", "start", "obstacles"
        return {name: getattr(self, name) for name in names}

    @property
    def count(self):
        return len(self.initial)

    @property
    def starts(self):
        return np.broadcast_to(self.start, self.count).astype(float)

    @property
    def ends(self):
        return self.starts + self.duration

    def zone_of(self, first, second):
        """The zone between two craft, N + k for obstacle k; None where neither has one."""
        if isinstance(self.zone, cf.Zone):
            return self.zone
        mine = [self.zone[k] for k in (first, second) if k < len(self.zone) and self.zone[k]]
        return max(mine, key=lambda zone: zone.extents[0]) if mine else None

    @cached_property
    def grid(self):
        """The instants at which held craft are looked at."""
        begin, end = self.starts.min(), self.ends.max()
        if not self.obstacles and np.ptp(self.starts) == 0 == np.ptp(self.ends):
            return np.array([begin, end])
        return np.unique(np.concatenate([np.linspace(begin, end, SAMPLES), self.starts, self.ends]))

    def held(self, k):
        """Position (G, 3) of craft k, or obstacle k - N, on the grid; nan where the craft is free."""
        if k >= self.count:
            return self.obstacles[k - self.count].position(self.grid)
        where = np.full((len(self.grid), 3), np.nan)
        sides = (
            (self.grid <= self.starts[k], self.starts[k], self.initial[k]),
            (self.grid >= self.ends[k], self.ends[k], self.final[k]),
        )
        for now, time, state in sides:
            where[now] = (self.orbit.transition(self.grid[now] - time) @ state)[:, :3]
        return where

    def held_ratio(self, first, second, places=None):
        """Least norm between two where both are held; inf where they never are or have no zone."""
        zone = self.zone_of(first, second)
        places = places or {k: self.held(k) for k in (first, second)}
        apart = places[first] - places[second]
        apart = apart[~np.isnan(apart[:, 0])]
        return float(zone.norm(apart).min()) if zone and len(apart) else np.inf


def swap(count=12, radius_of_zone=15.0, radius=120.0, orbit=DEEP_SPACE, duration=None):
    """Craft on a circle in the y-z plane, each to the place opposite through the centre.

    At rest in the frame at both ends (in orbit too, where a craft off the y axis then does not stay
    by itself); in a quarter of an orbit, or 1000 s in deep space, unless told.
    """
    angles = 2 * pi * np.arange(count) / count
    initial = np.zeros((count, 6))
    initial[:, 1], initial[:, 2] = radius * np.cos(angles), radius * np.sin(angles)
    deep = orbit.mean_motion == 0
    duration = duration or (1000.0 if deep else orbit.period / 4)
    name = f"swap of {count} in {'deep space' if deep else 'orbit'}"
    return Task(name, orbit, initial, -initial, duration, cf.Sphere(radius_of_zone))


def cases():
    return [random_case(seed) for seed in range(CASES)]


def conflicting_cases():
    return [conflicting(seed) for seed in range(CONFLICTING)]


def random_case(seed):
    """4 to 30 craft, so dense that their shortest ways cross; even seeds in deep space, odd in orbit."""
    rng = np.random.Generator(np.random.Philox(key=[4, seed]))
    return filled(rng, outline(rng, seed))


def conflicting(seed):
    """A random case of which two craft, or a craft and an obstacle at the start, conflict where held."""
    rng = np.random.Generator(np.random.Philox(key=[50, seed]))
    for _ in range(TRIES):
        task = filled(rng, outline(rng, seed))
        zoned = [k for k in range(task.count) if task.zone_of(k, k)]
        windows = bool(np.ndim(task.start))
        at_start = windows or rng.random() < 0.5  # the ends of windows could be moved
        moved = int(rng.integers(task.count))
        if at_start and task.obstacles and not windows:
            others = range(task.count, task.count + len(task.obstacles))
        else:
            others = [k for k in zoned if k != moved]
        other = int(rng.choice(others))
        broken = collided(rng, task, moved, other, at_start)
        if conflicts_held(broken) == [tuple(sorted((moved, other)))]:
            pair = (min(moved, other), max(moved, other))
            return replace(broken, name=f"conflicting {seed}: {task.name}", pair=pair)
    raise RuntimeError(f"conflicting case {seed} does not come about")


def collided(rng, task, moved, other, at_start):
    """The task with one end of craft `moved` put at a norm of 0.1 to 0.95 from where `other` is held."""
    zone = task.zone_of(moved, other)
    gap = rng.normal(size=3)
    gap *= rng.uniform(0.1, 0.95) / zone.norm(gap)
    states = (task.initial if at_start else task.final).copy()
    if not at_start:
        states[moved, :3] = task.final[other, :3] + gap
        return replace(task, final=states)
    # both are held at the earliest start, whatever their own
    begin = task.starts.min()
    time = task.starts[moved]
    there = (task.orbit.transition(begin - time) @ task.initial[moved])[3:]
    if other < task.count:
        place = (task.orbit.transition(begin - task.starts[other]) @ task.initial[other])[:3]
    else:
        place = task.obstacles[other - task.count].position(begin)
    states[moved] = task.orbit.transition(time - begin) @ np.concatenate([place + gap, there])
    return replace(task, initial=states)


def conflicts_held(task, margin=1.0):
    """Pairs that are nearer than `margin` where both are held, in order."""
    everybody = range(task.count + len(task.obstacles))
    places = {k: task.held(k) for k in everybody}
    pairs = [(i, j) for j in everybody for i in range(min(j, task.count))]
    return sorted(pair for pair in pairs if task.held_ratio(*pair, places) < margin)


def reconfiguration(count, seed, orbit=DEEP_SPACE, spacing=5.0, radius_of_zone=10.0, duration=None):
    """Many craft from random places in a cube to others, on average `spacing` zone radii apart.

    At rest in deep space (2000 s unless told), on closed relative orbits otherwise (half an orbit).
    """
    rng = np.random.Generator(np.random.Philox(key=[200, seed]))
    deep = orbit.mean_motion == 0
    duration = duration or (2000.0 if deep else orbit.period / 2)
    zone = cf.Sphere(radius_of_zone)
    name = f"{count} craft, seed {seed}, in {'deep space' if deep else 'orbit'}"
    empty = Task(name, orbit, np.zeros((count, 6)), np.zeros((count, 6)), duration, zone)
    return filled(rng, empty, spacing, swift=0.0)


def outline(rng, seed):
    """A task without its states: orbit, times, zones and the number of craft and obstacles."""
    count = int(rng.integers(4, 31))
    deep = seed % 2 == 0
    low, high = np.log(ALTITUDES)
    orbit = DEEP_SPACE if deep else cf.Orbit.circular(np.exp(rng.uniform(low, high)))
    duration = np.exp(rng.uniform(np.log(300.0), np.log(6000.0)))
    duration = duration if deep else orbit.period * rng.uniform(0.1, 1.2)
    start = 0.0
    if rng.random() < 0.15:  # windows of their own
        start = duration * rng.uniform(0.0, 0.2, count)
        duration = duration * rng.uniform(0.7, 1.0, count)
    zone = drawn_zone(rng, count)
    obstacles = (None,) * int(rng.integers(1, 4) if rng.random() < 0.15 else 0)
    states = np.zeros((count, 6))
    place = "deep space" if deep else f"orbit of {orbit.period:.0f} s"
    extra = ", windows" * bool(np.ndim(start)) + f", {len(obstacles)} coasting" * bool(obstacles)
    name = f"case {seed}: {count} craft, {kind_of(zone)}, {place}{extra}"
    return Task(name, orbit, states, states, duration, zone, start, obstacles)


def drawn_zone(rng, count):
    """One zone for all, of 5 to 40 m; in one of ten tasks a size for each craft, and none for a few."""
    size = np.exp(rng.uniform(np.log(5.0), np.log(40.0)))
    kind = rng.choice(["sphere", "ellipsoid", "tilted", "box", "own"], p=[0.4, 0.25, 0.15, 0.1, 0.1])
    lengths = size * rng.uniform(0.6, 2.0, 3)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    if kind == "sphere":
        return cf.Sphere(size)
    if kind == "box":
        return cf.Box(lengths)
    if kind == "ellipsoid":
        return cf.Ellipsoid(lengths)
    if kind == "tilted":
        return cf.Ellipsoid(lengths, axes)
    shape = cf.Ellipsoid(lengths) if rng.random() < 0.5 else cf.Sphere(size)
    own = [None if rng.random() < 0.1 else shape.enlarged(s) for s in rng.uniform(0.5, 1.0, count)]
    own[0] = shape  # the greatest; obstacles have none of their own
    return own


def kind_of(zone):
    if isinstance(zone, list):
        return "own zones"
    kind = type(zone).__name__.lower()
    return "tilted ellipsoid" if kind == "ellipsoid" and np.count_nonzero(zone.matrix) > 3 else kind


def filled(rng, task, spacing=None, swift=None):
    """The task with states: in a volume of the zone's own shape, clear of each other where held.

    `spacing` in zones, `swift` the random speeds in spacings a duration; drawn unless given.  To them
    comes the speed of a closed relative orbit, always where there are windows, else in half of the tasks.
    """
    count, longest = task.count, float(np.max(task.duration))
    spacing = spacing or rng.uniform(1.6, 2.4 if count < 10 else 3.2)
    swift = rng.choice([0.0, rng.uniform(0.0, 1.0)]) if swift is None else swift
    zone = task.zone if isinstance(task.zone, cf.Zone) else task.zone[0]
    stretch = np.linalg.inv(zone.matrix) * spacing
    closed = bool(np.ndim(task.start)) or count > 30 or rng.random() < 0.5

    def somewhere():
        place = stretch @ rng.uniform(-0.5, 0.5, 3) * count ** (1 / 3)
        speed = stretch @ rng.normal(size=3) * swift / longest
        speed[1] -= 2 * task.orbit.mean_motion * place[0] * closed
        return np.concatenate([place, speed])

    middle = 0.5 * (task.starts.min() + task.ends.max())
    task = replace(task, obstacles=tuple(coasting(task, somewhere(), middle) for _ in task.obstacles))
    task = replace(task, initial=np.zeros((count, 6)), final=np.zeros((count, 6)))
    places = {count + k: task.held(count + k) for k in range(len(task.obstacles))}
    for k in range(count):
        for _ in range(TRIES):
            task.initial[k], task.final[k] = somewhere(), somewhere()
            places[k] = task.held(k)
            if all(task.held_ratio(k, other, places) >= MARGIN for other in places if other != k):
                break
        else:
            raise RuntimeError(f"{task.name}: no place for craft {k}")
    return task


def coasting(task, state, middle):
    """An obstacle in natural motion through `state` at time `middle`, for four times the task's length."""
    begin, end = task.starts.min(), task.ends.max()
    early = task.orbit.transition(begin - middle) @ state
    return task.orbit.coast(early, 4 * (end - begin), start=begin)
