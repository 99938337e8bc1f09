"""Random pairs of spacecraft, each propagated by the package and by `truth.Flight`.

A batch shares its orbit, duration and kinds of path, so that the truth works on arrays.
"""

from dataclasses import dataclass
from math import pi

import numpy as np

import closeform as cf
from closeform.motion.arc import PUSH
from truth import Flight, Relative

MU, RADIUS = 3.986004418e14, 6.3781363e6
KINDS = ("coast", "transfer", "burn", "two impulses", "legs", "kicks", "sampled", "any push", "inertial burn")
FACES = 7  # of a zone, at most
ZONES = ("box", "tilted box", "ellipsoid", "tilted ellipsoid", "covariance", "sphere", "cylinder", "faces")


@dataclass
class Batch:
    """M pairs: paths of shape (M,), a zone each, and their true relative motion."""

    label: str
    path: cf.Path
    other: cf.Path
    zones: list
    relative: Relative


def carried(n, states, durations):
    """Natural motion of states (M, 6) over durations (M,), by the textbook's matrix (only to draw)."""
    x, y, z, vx, vy, vz = states.T
    t = np.asarray(durations, dtype=float)
    if n == 0:
        return np.concatenate([states[:, :3] + states[:, 3:] * t[:, None], states[:, 3:]], axis=1)
    c, s = np.cos(n * t), np.sin(n * t)
    ahead = 4 * s / n - 3 * t
    return np.stack(
        [
            (4 - 3 * c) * x + s / n * vx + 2 / n * (1 - c) * vy,
            6 * (s - n * t) * x + y - 2 / n * (1 - c) * vx + ahead * vy,
            c * z + s / n * vz,
            3 * n * s * x + c * vx + 2 * s * vy,
            6 * n * (c - 1) * x - 2 * s * vx + (4 * c - 3) * vy,
            -n * s * z + c * vz,
        ],
        axis=1,
    )


class Craft:
    """M craft on one course, leg by leg."""

    def __init__(self, n, state, start=0.0):
        self.orbit = cf.Orbit(n)
        self.flight = Flight(n, state, start)
        self.legs = []

    def leg(self, verb, duration, *arguments):
        before, start = self.flight.state.astype(float), self.flight.grid[-1]
        self.flight.state = before.astype(np.longdouble)  # both start from the same doubles
        getattr(self.flight, verb)(*arguments, duration)
        self.legs.append(getattr(self.orbit, verb)(before, *arguments, duration, start=start))
        return self

    def kick(self, jump):
        self.flight.kick(jump)
        return self

    def push(self, derivatives, duration):
        """Thrust by its first derivatives (M, 4, 3), as pieces of saturated thrust have it."""
        before, start = self.flight.state.astype(float), self.flight.grid[-1]
        self.flight.state = before.astype(np.longdouble)
        self.flight.push(derivatives, duration)
        arcs = self.orbit.coast(before, duration, start=start).arcs.copy()
        arcs[:, PUSH:] = derivatives.reshape(len(before), -1)
        self.legs.append(cf.Path(self.orbit, arcs, np.arange(len(arcs) + 1), (len(arcs),)))
        return self

    def inertial_burn(self, push, duration):
        """Thrust fixed in the axes that the orbit has at time 0."""
        n, start = self.orbit.mean_motion, self.flight.grid[-1]
        before = self.flight.state.astype(float)
        self.flight.state = before.astype(np.longdouble)
        c, s = np.cos(n * start), np.sin(n * start)
        turned = [np.stack([c * push[:, 0] + s * push[:, 1], c * push[:, 1] - s * push[:, 0], push[:, 2]], 1)]
        for _ in range(3):  # in the turning axes it turns backwards
            x, y, z = turned[-1].T
            turned.append(np.stack([n * y, -n * x, 0.0 * z], axis=1))
        self.flight.push(np.stack(turned, axis=1), duration)
        self.legs.append(self.orbit.burn(before, push, duration, start=start, frame="inertial"))
        return self

    def hermite(self, times, states):
        self.flight.hermite(times, states)
        self.legs.append(self.orbit.sampled(times, states))
        return self

    @property
    def path(self):
        return cf.join(self.legs)


def course(rng, kind, n, states, start, duration, size, swift):
    """A course of `kind` from `states` (M, 6): lengths about `size`, speeds about `swift`."""
    craft = Craft(n, states, start)
    count = len(states)

    def somewhere():
        return rng.normal(size=(count, 6)) * np.repeat([3 * size, swift], 3)

    push = rng.normal(size=(count, 3)) * swift / duration
    if kind == "coast":
        return craft.leg("coast", duration)
    if kind == "transfer":
        return craft.leg("transfer", duration, somewhere())
    if kind == "burn":
        return craft.leg("burn", duration, push)
    if kind == "any push":
        pace = max(n, 1.0 / duration)
        return craft.push(
            rng.normal(size=(count, 4, 3)) * swift / duration * pace ** np.arange(4)[:, None], duration
        )
    if kind == "inertial burn":
        return craft.inertial_burn(push, duration)
    if kind == "two impulses":  # short of half an orbit, where some points are out of reach
        drift = min(duration, 2.5 / n) if n else duration
        craft.leg("two_impulse", drift, somewhere())
        return craft.leg("coast", duration - drift) if drift < duration else craft
    first, second = np.sort(rng.uniform(0.1, 0.9, 2)) * duration
    if kind == "legs":
        craft.leg("coast", first).leg("transfer", second - first, somewhere())
        return craft.leg("coast", duration - second)
    if kind == "kicks":
        craft.leg("coast", first).kick(rng.normal(size=(count, 3)) * swift)
        craft.leg("coast", second - first).kick(rng.normal(size=(count, 3)) * swift)
        return craft.leg("burn", duration - second, push)
    nodes = max(3, int(n * duration / 0.2))
    times = start + np.linspace(0.0, duration, nodes)
    flown = np.stack([carried(n, states, np.full(count, t - start)) for t in times], axis=1)
    noise = np.repeat([1e-2 * size, 1e-2 * swift], 3)
    return craft.hermite(times, flown + rng.normal(size=flown.shape) * noise)


def zone(rng, shape, size):
    """A zone and, independently of it, the matrix to its coordinates."""
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    lengths = size * 10 ** rng.uniform(-0.5, 0.5, 3)
    if shape == "cylinder":
        lengths[1] = lengths[0]
        return cf.Cylinder(lengths[0], lengths[2], 3.0 * axes[2]), axes / lengths[:, None]
    if shape == "faces":  # a half-space, wedges, open and closed bodies
        count = rng.integers(1, FACES + 1)
        normals = rng.normal(size=(count, 3))
        offsets = size * 10 ** rng.uniform(-0.5, 0.5, count)
        rows = normals / np.linalg.norm(normals, axis=1)[:, None] / offsets[:, None]
        return cf.HalfSpaces(normals, offsets), rows[np.minimum(np.arange(FACES), count - 1)]
    if shape == "sphere":
        return cf.Sphere(size), np.eye(3) / size
    if shape == "covariance":
        made = cf.Ellipsoid.from_covariance((axes.T * (lengths / 3) ** 2) @ axes, 3.0)
        return made, axes / lengths[:, None]
    if not shape.startswith("tilted"):
        axes = np.eye(3)
    kind = cf.Box if shape.endswith("box") else cf.Ellipsoid
    return kind(lengths, axes if shape.startswith("tilted") else None), axes / lengths[:, None]


def of_parts(shape):
    """What `truth.parts` calls a zone's shape."""
    if shape.endswith("box"):
        return "box"
    return shape if shape in ("cylinder", "faces") else "ball"


def draw(rng, count, kinds=None, deep=None):
    """A batch of `count` pairs; orbit, duration, kinds and zones drawn."""
    deep = rng.random() < 0.1 if deep is None else deep
    n = 0.0 if deep else np.sqrt(MU / (RADIUS + 10 ** rng.uniform(5.3, 7.6)) ** 3)
    longest = 20 * pi / n if n else 6e4
    duration = np.exp(rng.uniform(np.log(5.0), np.log(longest)))
    kinds = rng.choice(KINDS, 2) if kinds is None else kinds
    size = 10 ** rng.uniform(0.5, 2.3)
    pace = min(duration, 1.0 / n) if n else duration
    swift = size / pace * 10 ** rng.uniform(-0.5, 1.0)
    if rng.random() < 0.1:  # a fly-by, inside for a small part of the time
        swift *= 10 ** rng.uniform(0, 3)
    shape = rng.choice(ZONES)
    made = [zone(rng, shape, size) for _ in range(count)]
    matrix = np.stack([m for _, m in made])
    base = rng.normal(size=(count, 6)) * np.repeat([3 * size, swift], 3)
    near = rng.normal(size=(count, 3))
    near *= (rng.uniform(0, 2.5, count) / np.linalg.norm(near, axis=1))[:, None]
    near = near * size if shape == "faces" else np.linalg.solve(matrix, near[..., None])[..., 0]
    gap = np.concatenate([near, base[:, 3:]], axis=1)
    gap[:, 3:] = rng.normal(size=(count, 3)) * swift
    still = rng.random(count) < 0.5  # no drift along the track
    gap[still, 4] = -2 * n * gap[still, 0]
    gap = carried(n, gap, -rng.uniform(0, duration, count))
    early, late = (0.0, duration) if rng.random() < 0.8 else np.sort(rng.uniform(0, duration, 2))
    first = course(rng, kinds[0], n, base + gap, 0.0, duration, size, swift)
    other_start = carried(n, base, np.full(count, early))
    second = course(rng, kinds[1], n, other_start, early, late - early, size, swift)
    relative = Relative.between(first.flight, second.flight, matrix, of_parts(shape))
    label = f"{kinds[0]} / {kinds[1]}, {shape}, n = {n:.3g}, {duration:.3g} s"
    return Batch(label, first.path, second.path, [z for z, _ in made], relative)


def graze(rng, batch, reach=None):
    """The same pairs with each zone scaled so that one extremum of its norm is 1 +- `reach`.

    At most 1 %, down to 1e-10.  Pairs without one between a hundredth and a hundred are left as
    they are.
    """
    _, _, (who, _, norms, _) = batch.relative.extrema()
    count = len(batch.zones)
    by = np.ones(count)
    for pair in range(count):
        mine = norms[(who == pair) & (norms > 1e-2) & (norms < 1e2)]
        if len(mine):
            chosen = mine.min() if rng.random() < 0.5 else rng.choice(mine)
            offset = 10 ** rng.uniform(-10, -2) if reach is None else reach
            by[pair] = chosen / (1 + rng.choice([-1.0, 1.0]) * offset)
    zones = [z.enlarged(f) for z, f in zip(batch.zones, by, strict=True)]
    old = batch.relative
    relative = Relative(old.grid, old.pieces / by[:, None, None, None], old.shape, old.rounding / by)
    return Batch(batch.label + ", grazing", batch.path, batch.other, zones, relative)
