"""Path of one spacecraft past any zones, from many starts, by exchange of supporting planes.

Thrust is linear between nodes and continuous (first-order hold). At some times the supporting plane at the
last path replaces each near zone; for a box it is the plane of the nearest face. The minimum thrust that
keeps all planes is a least distance problem (Lawson and Hanson 1974, chapter 23), solved by non-negative
least squares. New times are added at the closest approaches of the new path. Planes are updated until the
energy and the minimum norm converge. Where a path rounds an edge of a box, the time of the change of faces
is searched in addition. Starts are random: each zone is passed on a random side, first on the direct path,
then on the best path found.

Lengths are scaled by LENGTH, times by the duration.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import linalg
from scipy.optimize import nnls

from peers.motion import Array

NODES = 100
LENGTH = 100.0  # m
GRID = 6 * NODES  # times at which norms are evaluated
COARSE = 3  # every so many of them may get a plane
NEAR = 1.15  # where the norm is below
DIPS = 1.02  # and least norms below this, at their own times
ROUNDS = 60  # from one start
SETTLED = 1e-7  # relative change of the energy
TOUCHING = 1e-6  # by how much a settled path may be inside
EARLY, DEAR = 8, 3.0  # rounds, and times the best energy at which a start is then given up
REFINED = 4  # refinements around a minimum norm
SAME = 1e-6  # of the duration: times that are one
ORDER = 10  # of the power series of a step
FREE, AGAIN = (8, 4), (4, 4)  # starts from the direct and the best path, and more for each obstacle
SHARPENED = 6  # of the best paths past boxes, whose turns around edges are moved
TURNS = 80  # of their planes
WINDOW = 0.03  # of the duration, within which a path that changes faces is at an edge
GAIN = 5.0  # how fast planes turn at first
BLUNT = 8.0  # power of the norm by whose gradients planes of boxes are taken from every other start
EDGED = 3  # of the best paths past boxes, whose changes of faces are searched
SHIFTS = 0.05, 0.02, 0.01, 0.004, 0.002, 0.0008, 0.0003  # of the duration
TAKEN = 24  # shifts from one path at most

Places = Callable[[Array], Array]  # times (T,) [s] -> positions of the obstacles (K, T, 3) [m]


@dataclass(frozen=True)
class Passed:
    """A path whose planes have settled; `extra` [m^2/s^3] is its energy beyond that without zones.

    `times` (C,) [s] and `states` (C, 6) [m, m/s] at its contacts, in order; `least` the norm of the
    closest approach to each obstacle, in the zones as they were inflated.
    """

    extra: float
    times: Array
    states: Array
    least: Array
    steer: Array  # scaled
    rows: tuple[tuple[int, float, Array, float], ...]  # obstacle, time, plane and force of each contact


class Edge:
    """Where a path rounds an edge of box `k`: a time, the normals of two faces, and their shares."""

    def __init__(self, k: int, time: float, before: Array, after: Array, weights: Array) -> None:
        self.k, self.time, self.faces = k, time, np.stack([before, after])
        self.odds = float(np.log(weights[0] / weights[1]))
        self.gain, self.sign = GAIN, 0.0

    @property
    def plane(self) -> Array:
        share = 1 / (1 + np.exp(-self.odds))
        return share * self.faces[0] + (1 - share) * self.faces[1]

    def turn(self, task: "Exchange", y: Array) -> None:
        """To where the path is nearest to the plane, which turns towards the face that is further off."""
        times = np.clip(self.time + WINDOW * np.linspace(-1, 1, 41), SAME, 1 - SAME)
        for _ in range(3):
            gaps = task.states(y, times)[:, :3] - task.seen(times)[self.k]
            inside = gaps @ task.forms[self.k].T / task.factors[self.k]
            best = min(max(int((inside @ self.plane).argmin()), 1), len(times) - 2)
            there, self.time = inside[best], float(times[best])
            times = np.linspace(times[best - 1], times[best + 1], 41)
        change = float(there @ (self.faces[0] - self.faces[1]))
        self.gain *= 1.5 if change * self.sign > 0 else 0.4
        self.sign = change
        self.odds = float(np.clip(self.odds + np.clip(self.gain * change, -1, 1), -12, 12))


class Exchange:
    """One task: its motion, reduced to what the fixed ends leave free, and its zones |zone r| <= 1."""

    def __init__(
        self,
        initial: Array,
        final: Array,
        duration: float,
        n: float,
        places: Places,
        zones: Array,
        boxes: Sequence[bool],
    ) -> None:
        self.duration, self.places = duration, places
        self.forms, self.boxes = LENGTH * np.asarray(zones), np.asarray(boxes)
        self.factors = np.ones(len(zones))  # by which zones are inflated
        self.power = np.inf  # planes of boxes: inf for their faces, less for oblique ones near edges
        self.unit = LENGTH * np.repeat([1, 1 / duration], 3)
        full = np.zeros((12, 12))
        full[:3, 3:6] = full[3:6, 6:9] = full[6:9, 9:12] = np.eye(3)
        a = n * duration
        full[3, 0], full[3, 4], full[4, 3], full[5, 2] = 3 * a**2, 2 * a, -2 * a, -(a**2)  # theory (1)
        powers = [np.eye(12)]
        for k in range(1, ORDER + 1):
            powers.append(powers[-1] @ full / k)
        self.series = np.stack([power[:6] for power in powers])
        self._reduce(np.asarray(initial) / self.unit, np.asarray(final) / self.unit)
        self.grid = np.linspace(0, 1, GRID + 1)
        self.others = self.seen(self.grid)
        self.strides = self.steps(self.grid[: GRID // NODES])[:, :3]

    def _reduce(self, initial: Array, final: Array) -> None:
        """Node states and thrusts as affine functions of `y`, whose square is twice the extra energy."""
        dt, width = 1 / NODES, 3 * (NODES + 1)
        step = self.steps(np.array([dt]))[0]
        maps = np.zeros((NODES + 1, 6, width))
        natural = np.zeros((NODES + 1, 6))
        natural[0] = initial
        thrusts = np.eye(width).reshape(NODES + 1, 3, width)
        for k in range(NODES):
            rate = (thrusts[k + 1] - thrusts[k]) / dt
            maps[k + 1] = step[:, :6] @ maps[k] + step[:, 6:9] @ thrusts[k] + step[:, 9:] @ rate
            natural[k + 1] = step[:, :6] @ natural[k]
        side, middle = np.full(NODES, dt / 6), dt / 3 * np.r_[1, np.full(NODES - 1, 2), 1]
        mass = np.diag(middle) + np.diag(side, 1) + np.diag(side, -1)  # of a linear thrust's square
        whiten = np.kron(np.linalg.inv(np.linalg.cholesky(mass)).T, np.eye(3))
        ends = maps[-1] @ whiten
        least = np.linalg.lstsq(ends, final - natural[-1], rcond=None)[0]
        freedom = whiten @ linalg.null_space(ends)
        base = whiten @ least
        self.base = np.concatenate([natural + maps @ base, base.reshape(-1, 3)], axis=1)
        self.free = np.concatenate([maps @ freedom, freedom.reshape(NODES + 1, 3, -1)], axis=1)

    def steps(self, times: Array) -> Array:
        """From states, thrust and its rate to states after `times`: (T, 6, 12)."""
        return np.einsum("tk,kab->tab", times[:, None] ** np.arange(ORDER + 1), self.series)

    def seen(self, times: Array) -> Array:
        """Scaled positions of the obstacles (K, T, 3)."""
        return self.places(self.duration * times) / LENGTH

    def states(self, y: Array, times: Array) -> Array:
        """Scaled states (T, 6)."""
        nodes = self.base + self.free @ y
        return self._between(nodes[..., None], times)[..., 0]

    def _between(self, nodes: Array, times: Array) -> Array:
        k = np.minimum((times * NODES).astype(int), NODES - 1)
        steps = self.steps(times - k / NODES)
        rate = (nodes[k + 1, 6:] - nodes[k, 6:]) * NODES
        return steps[..., :9] @ nodes[k] + steps[..., 9:] @ rate

    def norm(self, k: int, gaps: Array) -> Array:
        """Norms of relative positions (T, 3) in zone `k` as inflated."""
        inside = np.abs(gaps @ self.forms[k].T) / self.factors[k]
        return inside.max(axis=-1) if self.boxes[k] else np.linalg.norm(inside, axis=-1)

    def plane(self, k: int, gap: Array) -> Array:
        """Normal of the supporting plane in zone coordinates."""
        inside = self.forms[k] @ gap
        if self.boxes[k]:
            size = np.abs(inside)
            share = (size / size.max()) ** self.power
            return np.sign(inside) * share / share.sum()
        return inside / np.linalg.norm(inside)

    def least(self, rows: list[tuple[int, float, Array]]) -> tuple[Array, Array] | None:
        """The least `y` that keeps all planes, and the forces at them; None if there is none."""
        times = np.array([time for _, time, _ in rows])
        which = np.array([k for k, _, _ in rows])
        normals = np.einsum("ra,rab->rb", [plane for *_, plane in rows], self.forms[which])
        base = self._between(self.base[..., None], times)[:, :3, 0]
        other = self.seen(times)[which, np.arange(len(rows))]
        gap = self.factors[which] - np.einsum("ra,ra->r", normals, base - other)
        matrix = np.einsum("ra,rab->rb", normals, self._between(self.free, times)[:, :3])
        size = np.linalg.norm(matrix, axis=1)
        if (size < 1e-14).any():
            return None
        scale = np.abs(gap / size).max() or 1.0
        basis, triangle = np.linalg.qr((matrix / size[:, None]).T)
        system = np.concatenate([triangle, (gap / size / scale)[None]])
        aim = np.append(np.zeros(len(triangle)), 1.0)
        try:
            force, rest = nnls(system, aim, maxiter=20 * len(rows))
        except RuntimeError:
            return None
        if rest < 1e-7:
            return None
        left = system @ force - aim
        return basis @ (-left[:-1] / left[-1]) * scale, force / size

    def dips(self, y: Array) -> tuple[list[tuple[int, float]], list[tuple[int, float]], Array]:
        """Where planes are wanted: (obstacle, time) on the grid, and of least norms; the least of each."""
        nodes = self.base + self.free @ y
        gaps = self.on_grid(nodes) - self.others
        norms = np.stack([self.norm(k, gap) for k, gap in enumerate(gaps)])
        least = norms.min(axis=1)
        which, index = np.nonzero(norms[:, COARSE:-1:COARSE] < NEAR)
        near = list(zip(which.tolist(), self.grid[COARSE * (index + 1)].tolist(), strict=True))
        inner = norms[:, 1:-1]
        which, index = np.nonzero((inner <= norms[:, :-2]) & (inner <= norms[:, 2:]) & (inner < NEAR))
        if not len(which):
            return near, [], least
        early, late, rank = self.grid[index], self.grid[index + 2], np.arange(len(which))
        for _ in range(REFINED):
            times = early[:, None] + (late - early)[:, None] * np.linspace(0, 1, 17)
            places = self._between(nodes[..., None], times.ravel())[:, :3, 0]
            gaps = (places - self.seen(times.ravel())).reshape(len(self.boxes), *times.shape, 3)[which, rank]
            here = np.stack([self.norm(k, gap) for k, gap in zip(which, gaps, strict=True)])
            best = here.argmin(axis=1).clip(1, 15)
            early, late = times[rank, best - 1], times[rank, best + 1]
        np.minimum.at(least, which, here.min(axis=1))
        low = here.min(axis=1) < DIPS
        return near, list(zip(which[low].tolist(), times[rank, best][low].tolist(), strict=True)), least

    def on_grid(self, nodes: Array) -> Array:
        """Positions (GRID + 1, 3) from states and thrusts at the nodes."""
        first, last = nodes[:-1], nodes[1:]
        known = np.concatenate([first, (last - first)[:, 6:] * NODES], axis=1)
        inner = np.einsum("tab,kb->kta", self.strides, known).reshape(-1, 3)
        return np.concatenate([inner, nodes[-1:, :3]])

    def rows(self, y: Array, wanted: list[tuple[int, float]], moved: Array | None = None) -> list:
        """Planes at (obstacle, time), as seen from the path, or from one `moved` (K, 3) half way."""
        kept: dict[tuple[int, int], tuple[int, float]] = {}
        for k, time in wanted:
            if SAME < time < 1 - SAME:
                kept[k, round(time / SAME)] = k, time
        some = list(kept.values())
        if not some:
            return []
        times = np.array([time for _, time in some])
        places = self.states(y, times)[:, :3]
        others = self.seen(times)
        rows = []
        for i, (k, time) in enumerate(some):
            gap = places[i] - others[k, i]
            if moved is not None:
                gap = gap + moved[k] * np.sin(np.pi * time) ** 0.5
            rows.append((k, time, self.plane(k, gap)))
        return rows

    def settle(self, rows: list, bar: float = np.inf) -> Passed | None:
        """Planes taken anew from one start until nothing changes; None where that fails or is dear."""
        last = np.inf
        for turn in range(ROUNDS):
            found = self.least(rows) if rows else (np.zeros(self.free.shape[-1]), np.zeros(0))
            if found is None:
                return None
            y, force = found
            energy = 0.5 * float(y @ y)
            near, low, least = self.dips(y)
            clear = least.min() > 1 - TOUCHING
            if clear and abs(energy - last) <= SETTLED * energy:
                return self.passed(y, [(*row, on) for row, on in zip(rows, force, strict=True) if on], least)
            if turn >= EARLY and energy > DEAR * bar:
                return None
            last = energy
            active = [(k, time) for (k, time, _), on in zip(rows, force, strict=True) if on]
            rows = self.rows(y, near + active + low)
        if clear:  # it creeps
            return self.passed(y, [(*row, 1.0) for row in self.rows(y, active)], least)
        return None

    def passed(self, y: Array, rows: list, least: Array) -> Passed:
        times = np.unique([row[1] for row in rows])
        times = times[np.append(True, np.diff(times) > SAME)] if len(times) else times
        scale = LENGTH**2 / self.duration**3
        states = self.states(y, times) * self.unit if len(times) else np.empty((0, 6))
        return Passed(0.5 * float(y @ y) * scale, times * self.duration, states, least, y, tuple(rows))

    def drawn(self, rng: np.random.Generator, y: Array, share: float) -> list:
        """Planes of zones that a path is near, each passed on a random side with a chance of `share`."""
        near, low, _ = self.dips(y)
        sides = rng.normal(size=(len(self.boxes), 3))
        sides *= (rng.uniform(0.5, 2.5, len(sides)) / np.linalg.norm(sides, axis=1))[:, None]
        sides[rng.random(len(sides)) > share] = 0.0
        moved = np.einsum("kab,kb->ka", np.linalg.inv(self.forms), sides)
        return self.rows(y, near + low, moved)

    def sharpened(self, path: Passed) -> Passed:
        """The path with each change from face to face of a box made at the best point of their edge.

        There it touches an oblique plane through the edge, turned until the path is at the edge itself.
        """
        edges = self.edges(path)
        if not edges:
            return path
        best, y, wanted = path, path.steer, [row[:2] for row in path.rows]
        last = np.inf
        for _ in range(TURNS):
            at = [(k, time, edge_at(edges, k, time)) for k, time in wanted]
            rows = self.rows(y, [(k, time) for k, time, edge in at if edge is None])
            rows += [(edge.k, edge.time, edge.plane) for edge in edges]
            rows += [(k, time, edge.plane) for k, time, edge in at if edge is not None]
            found = self.least(rows)
            if found is None:
                return best
            y, force = found
            energy = 0.5 * float(y @ y)
            near, low, least = self.dips(y)
            if least.min() > 1 - TOUCHING:
                other = self.passed(y, [(*row, on) for row, on in zip(rows, force, strict=True) if on], least)
                best = min(best, other, key=lambda one: one.extra)
                if abs(energy - last) < SETTLED * energy:
                    break
            last = energy
            active = [(k, time) for (k, time, _), on in zip(rows, force, strict=True) if on]
            wanted = [each for each in near + active if edge_at(edges, *each) is None] + low
            for edge in edges:
                edge.turn(self, y)
        return best

    def edges(self, path: Passed) -> "list[Edge]":
        """Where a path changes from face to face of a box, with the plane through their edge along it."""
        found = []
        for before, after in pairwise(sorted(path.rows, key=lambda row: row[:2])):
            k, time = before[0], 0.5 * (before[1] + after[1])
            if not self.boxes[k] or after[0] != k or (before[2] == after[2]).all():
                continue
            times = np.clip(time + np.array([-1e-4, 1e-4]), 0, 1)
            gaps = self.states(path.steer, times)[:, :3] - self.seen(times)[k]
            pace = np.stack([before[2], after[2]]) @ self.forms[k] @ (gaps[1] - gaps[0])
            if pace[0] * pace[1] < 0:
                found.append(Edge(k, time, before[2], after[2], np.abs(pace[::-1])))
        return found

    def edged(self, path: Passed) -> Passed:
        """The path with the times at which it changes the faces of boxes searched to and fro."""
        taken = 0
        for shift in SHIFTS:
            improved = True
            while improved and taken < TAKEN:
                improved = False
                for rows in self.shifted(path, shift):
                    other = self.settle(rows, 0.5 * float(path.steer @ path.steer))
                    if other is not None and other.extra < (1 - 1e-5) * path.extra:
                        path, improved = other, True
                        taken += 1
                        break
        return path

    def shifted(self, path: Passed, shift: float) -> list[list]:
        """Its planes with one change of faces earlier or later by `shift`."""
        found = []
        ordered = sorted((row[:3] for row in path.rows), key=lambda row: row[:2])
        for i, (before, after) in enumerate(pairwise(ordered)):
            k = before[0]
            if not self.boxes[k] or after[0] != k or (before[2] == after[2]).all():
                continue
            for move in (shift, -shift):
                middle = 0.5 * (before[1] + after[1])
                low, high = sorted((middle, middle + move))
                if low < 0.01 or high > 0.99:
                    continue
                face = (before if move > 0 else after)[2]  # of the planes in between
                rows = [
                    (row[0], row[1], face) if row[0] == k and low <= row[1] <= high else row
                    for j, row in enumerate(ordered)
                    if j not in (i, i + 1)
                ]
                at = middle + move
                found.append([*rows, (k, at, before[2]), (k, at + SAME, after[2])])
        return found

    def solve(self, seed: int) -> list[Passed]:
        """Settled paths from all starts, the cheapest first."""
        rng = np.random.Generator(np.random.Philox(seed))
        nothing = np.zeros(self.free.shape[-1])
        found = [self.settle(self.drawn(rng, nothing, 0.0))]
        count = len(self.boxes)
        for k in range(FREE[0] + FREE[1] * count):
            found.append(self.begun(rng, nothing, 1.0 if k % 4 < 2 else 0.5, found))
        for _ in range(AGAIN[0] + AGAIN[1] * count):
            best = cheapest(found)
            if best is not None:
                found.append(self.begun(rng, best.steer, 1.5 / count, found))
        paths = distinct(found)
        if self.boxes.any():
            paths = distinct([self.sharpened(path) for path in paths[:SHARPENED]] + paths[SHARPENED:])
            paths = distinct([self.edged(path) for path in paths[:EDGED]] + paths[EDGED:])
        return paths

    def begun(self, rng: np.random.Generator, y: Array, share: float, found: list) -> Passed | None:
        """The path from a start that is drawn; past boxes, from every other, first with oblique planes."""
        rows = self.drawn(rng, y, share)
        if not self.boxes.any() or rng.random() < 0.5:
            return self.settle(rows, bar(found))
        path = replaced(self, power=BLUNT).settle(rows, bar(found))
        if path is None:
            return None
        near, low, _ = self.dips(path.steer)
        return self.settle(self.rows(path.steer, near + low + [row[:2] for row in path.rows]), bar(found))

    def inflated(self, path: Passed, factors: Array) -> Passed | None:
        """The path held by the same planes of zones of other sizes; None where it cannot be."""
        other = replaced(self, factors=factors)
        found = other.least([row[:3] for row in path.rows])
        if found is None:
            return None
        y, force = found
        rows = [(*row[:3], one) for row, one in zip(path.rows, force, strict=True)]
        return other.passed(y, rows, other.dips(y)[2])


def edge_at(edges: list[Edge], k: int, time: float) -> Edge | None:
    """The edge of box `k` that a path is at."""
    near = [edge for edge in edges if edge.k == k and abs(edge.time - time) < WINDOW]
    return min(near, key=lambda edge: abs(edge.time - time), default=None)


def replaced(task: Exchange, **changed: object) -> Exchange:
    """The task with other sizes of its zones, or another sharpness."""
    other = object.__new__(Exchange)
    other.__dict__.update(task.__dict__, **changed)
    return other


def cheapest(found: list) -> Passed | None:
    return min((path for path in found if path is not None), key=lambda path: path.extra, default=None)


def distinct(found: list) -> list:
    """Paths of different energies, the cheapest first."""
    paths = sorted((path for path in found if path is not None), key=lambda path: path.extra)
    return [path for k, path in enumerate(paths) if not k or path.extra > (1 + 1e-5) * paths[k - 1].extra]


def bar(found: list) -> float:
    best = cheapest(found)
    return np.inf if best is None else 0.5 * float(best.steer @ best.steer)
