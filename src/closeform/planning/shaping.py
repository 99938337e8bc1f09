"""Exact shaping: the least-energy path of one craft around keep-out zones, all sides searched."""

import heapq
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform.arrays import Floats
from closeform.compiled import kernel
from closeform.motion.arc import END, MEAN_MOTION, START, WIDTH
from closeform.motion.effort import ENERGY, totals
from closeform.motion.path import Path
from closeform.planning.contacts import IDLE, SETTLED, relax
from closeform.planning.kernel import influences, invert_response, relative
from closeform.planning.pressing import PROVEN, convex
from closeform.planning.result import PLANNED, Avoidance, Contact, Obstacles, Status, refused
from closeform.planning.sides import ways_out

NODES = 96  # partial plans examined before the search settles for the best it has
SHARPER = tuple(2.0 * 1.5**k for k in range(21))  # powers of the norms that stand in for a box
STRIDES = (1, 2, 3, 7)  # through them: each may end on another side of an edge
SPREAD = 3.0  # of the energies of blunt plans, within which a dearer one may end up the cheaper
BLUNT = (8.0, 27.0, 8.0)  # the first of them, for each of PLANNED
CONTACTS = 16  # of one path
TOO_DEAR = 1e8  # times the optimum: no plan to fly


@kernel(void(float64[::1], float64[:, ::1]))
def prepare(base: Floats, inverse: Floats) -> None:
    invert_response(base[MEAN_MOTION], base[END] - base[START], inverse, np.empty((6, 6)), np.empty(6))


@kernel(
    void(
        float64[::1],
        float64[:, ::1],
        float64[:, ::1],
        float64[:, ::1],
        int64,
        int64,
        float64[:, ::1],
        float64,
        float64[:, ::1],
        float64[:, ::1],
    )
)
def view(
    base: Floats,
    inverse: Floats,
    rows: Floats,
    others: Floats,
    first: int,
    last: int,
    matrix: Floats,
    t: float,
    motion: Floats,
    gram: Floats,
) -> None:
    """Relative motion (3, 3) at time t in zone coordinates, and the kernel K(t, t) there."""
    relative(rows, len(rows), others, first, last, matrix, t, motion)
    times = np.array([t])
    pulls = np.empty((1, 6, 3))
    blocks = np.empty((1, 1, 6, 3))
    influences(base, inverse, times, 1, pulls, blocks, np.empty((1, 1, 6, 3)))
    for i in range(3):
        for j in range(3):
            gram[i, j] = 0.0
            for a in range(3):
                for b in range(3):
                    gram[i, j] += matrix[i, a] * blocks[0, 0, a, b] * matrix[j, b]


@dataclass(frozen=True, eq=False)
class Draft:
    """Contacts (obstacle, time, normal in zone coordinates) and the path that they shape."""

    which: Any
    times: Floats
    normals: Floats
    force: Floats
    rows: Floats
    gram: Floats
    energy: float  # beyond the unconstrained optimum
    settled: bool

    def joined(self, obstacle: int, time: float, normal: Floats) -> tuple[Any, Floats, Floats]:
        """The contacts with one more."""
        more = np.append(self.which, obstacle), np.append(self.times, time)
        return *more, np.vstack([self.normals, normal])

    def same(self, other: "Draft") -> bool:
        """Whether two plans touch the same obstacles at the same times and on the same sides."""
        return (
            len(self.which) == len(other.which)
            and abs(self.energy - other.energy) <= 1e-7 * self.energy
            and bool((self.which == other.which).all())
            and np.allclose(self.times, other.times, rtol=1e-6)
            and np.allclose(self.normals, other.normals, atol=1e-4)
        )


def _energy(rows: Floats) -> float:
    total = np.empty(1)
    totals(np.ascontiguousarray(rows), np.array([0, len(rows)]), rows[0, MEAN_MOTION], ENERGY, total)
    return float(total[0])


class Shaping:
    """One search: a base arc, obstacles, and the tree of sides on which to pass them."""

    def __init__(self, base: Floats, obstacles: Obstacles, margin: float, blunt: float) -> None:
        self.base = base
        self.obstacles = obstacles
        self.margin = margin
        self.blunt = blunt  # power of the norm that stands in for a box at first
        self.inverse = np.empty((6, 6))
        prepare(base, self.inverse)

    def relaxed(self, which: Any, times: Floats, normals: Floats, power: float) -> Draft | None:
        """The plan that the given contacts slide to; None where their forces vanish.

        Boxes are rounded to balls of a `power` norm, enlarged so that they hold the edges.
        """
        while len(which):
            count = len(which)
            force, rows, gram = (
                np.empty(count),
                np.zeros((count + 1, WIDTH)),
                np.empty((3 * count, 3 * count)),
            )
            o = self.obstacles
            times, normals = times.copy(), normals.copy()
            powers = np.where(o.boxes, power, 2.0)
            aims = self.margin * np.where(o.boxes, 2.0 ** (1.0 / power), 1.0)
            scene = (o.arcs, o.offsets, o.matrices, powers, aims)
            contacts = (which, times, normals, force)
            status = relax(self.base, self.inverse, scene, contacts, rows, gram)
            if status != IDLE:
                keep = rows[: 1 + len(np.unique(times))]
                if status == SETTLED:
                    push = (normals * force[:, None]).ravel()
                    energy = float(0.5 * push @ gram @ push)
                else:  # the contacts have moved on from those that shaped the path
                    energy = _energy(keep) - _energy(self.base[None])
                return Draft(which, times, normals, force, keep, gram, energy, status == SETTLED)
            pressed = force > 0.0
            if pressed.all():
                return None
            which, times, normals = which[pressed], times[pressed], normals[pressed]
        return None

    def sharpened(self, plan: Draft) -> Draft:
        """A clear plan with its boxes sharpened, ever closer to their edges while it stays clear."""
        if not self.obstacles.boxes[plan.which].any():
            return plan
        ends = [self._sharpened(plan, [p for p in SHARPER[::stride] if p > self.blunt]) for stride in STRIDES]
        return min(ends, key=lambda end: end.energy)

    def _sharpened(self, plan: Draft, powers: list[float]) -> Draft:
        last = plan
        for power in (*powers, np.inf):
            following = self.relaxed(last.which, last.times, last.normals, power)
            for _ in range(3):  # a sharper edge may want another contact
                deepest = self.obstacles.deepest(following.rows) if following else None
                if following is None or deepest is None:
                    break
                normal = self.sides(following.rows, *deepest)[0][1]
                following = self.relaxed(*following.joined(*deepest, normal), power)
            if following is None or deepest is not None:
                continue
            if following.energy < plan.energy:
                plan = following
            if following.settled:
                last = following
        return plan

    def proven(self, plan: Draft) -> bool:
        """Whether no path that is clear at the times of a plan's contacts can cost less.

        With ellipsoids the plan solves min d.G^-1.d / 2 subject to |q + d|^2 >= aim^2 at each
        contact.  Where G^-1 - diag(force / aim) is positive semidefinite its Lagrangian is
        convex, so the plan is the global optimum of this relaxation, and of the problem.  For
        a single contact with a box the six faces are compared.
        """
        if not plan.settled:
            return False
        if not self.obstacles.boxes[plan.which].any():
            return convex(plan.gram, plan.force / self.margin)
        if len(plan.which) > 1:
            return False
        sides = self.sides(self.base[None], int(plan.which[0]), float(plan.times[0]))
        least = min(cost for cost, normal in sides if np.count_nonzero(normal) == 1)
        return bool(plan.energy <= least * (1.0 + PROVEN))

    def sides(self, rows: Floats, obstacle: int, time: float) -> list[tuple[float, Floats]]:
        """Ways to pass an obstacle: (rough cost, outward normal in zone coordinates), cheapest first."""
        o = self.obstacles
        motion, gram = np.empty((3, 3)), np.empty((3, 3))
        first, last = int(o.offsets[obstacle]), int(o.offsets[obstacle + 1])
        view(self.base, self.inverse, rows, o.arcs, first, last, o.matrices[obstacle], time, motion, gram)
        return ways_out(bool(o.boxes[obstacle]), self.margin, motion[0], motion[1], gram)

    def search(self) -> tuple[Draft | None, bool, int]:
        """Best clear plan, whether every side was searched, and how many plans were examined.

        Best first: a plan that still conflicts branches over the sides of its deepest conflict.
        """
        empty = np.empty((0, 3))
        root = Draft(
            np.empty(0, int), np.empty(0), empty, np.empty(0), self.base[None], np.empty((0, 0)), 0.0, True
        )
        queue: list[tuple[float, int, Draft, int, float, Floats]] = []
        seen: list[Draft] = []
        best: Draft | None = None
        bar = np.inf  # partial plans only get dearer; those with rounded boxes get cheaper at the end
        examined = order = 0

        def branch(plan: Draft, obstacle: int, time: float) -> None:
            nonlocal order
            for cost, normal in self.sides(plan.rows, obstacle, time):
                order += 1
                heapq.heappush(queue, (plan.energy + cost, order, plan, obstacle, time, normal))

        deepest = self.obstacles.deepest(self.base[None])
        if deepest is None:
            return root, True, 0
        branch(root, *deepest)
        while queue and examined < NODES:
            _, _, parent, obstacle, time, normal = heapq.heappop(queue)
            examined += 1
            plan = self.relaxed(*parent.joined(obstacle, time, normal), self.blunt)
            if plan is None or plan.energy >= bar:
                continue
            if any(plan.same(other) for other in seen):
                continue
            seen.append(plan)
            deepest = self.obstacles.deepest(plan.rows)
            if deepest is None:
                rounded = self.obstacles.boxes.any()
                bar = min(bar, plan.energy * (SPREAD if rounded else 1.0 - 1e-12))
                plan = self.sharpened(plan)
                if best is None or plan.energy < best.energy:
                    best = plan
                if self.proven(plan):
                    break
            elif len(plan.which) < CONTACTS:
                branch(plan, *deepest)
        return best, not queue, examined


def shaped(path: Path, obstacles: Obstacles) -> Avoidance:
    """`avoid` by method "exact"."""
    orbit = path.orbit
    optimum = orbit.transfer(path.state(path.start), path.state(path.end), path.end - path.start, path.start)
    search = Shaping(optimum.arcs[0], obstacles, PLANNED[0], BLUNT[0])
    plan, exhausted, tried = search.search()
    if plan is None:
        for margin, blunt in zip(PLANNED[1:], BLUNT[1:], strict=True):
            other, _, examined = Shaping(optimum.arcs[0], obstacles, margin, blunt).search()
            tried += examined
            if other is not None and (plan is None or other.energy < plan.energy):
                plan = other
        proven = exhausted = False
    else:
        proven = not len(plan.which) or search.proven(plan)
    if plan is None:
        return refused(Status.NOT_FOUND, f"no clear path among {tried} ways tried; allow more time", tried)
    # rest to rest over one zone in a hundredth of the time costs 1e6 of these
    zone = 1.0 / np.abs(obstacles.matrices).max()
    if plan.energy > TOO_DEAR * (optimum.energy + 6.0 * zone**2 / (path.end - path.start) ** 3):
        reason = f"the cheapest of {tried} ways tried costs {plan.energy:.3g} m²/s³ more; allow more time"
        return refused(Status.NOT_FOUND, reason, tried)
    result = Path(orbit, np.ascontiguousarray(plan.rows), np.array([0, len(plan.rows)]), ())
    ways = "proven the global optimum" if proven else f"the best of {tried} ways tried"
    return Avoidance(
        path=result,
        energy=result.energy,
        extra_energy=plan.energy,
        delta_v=result.delta_v,
        contacts=_contacts(plan, result, obstacles),
        status=Status.AVOIDED,
        reason=f"{len(plan.which)} contact{'s' * (len(plan.which) != 1)}, {ways}",
        proven=proven,
        exhausted=exhausted,
        tried=tried,
    )


def _contacts(plan: Draft, path: Path, obstacles: Obstacles) -> tuple[Contact, ...]:
    found = []
    for k in np.argsort(plan.times):
        matrix = obstacles.matrices[plan.which[k]]
        push = matrix.T @ plan.normals[k]
        found.append(
            Contact(
                time=float(plan.times[k]),
                obstacle=int(plan.which[k]),
                position=path.state(plan.times[k])[:3],
                normal=push / np.linalg.norm(push),
                force=float(plan.force[k] * np.linalg.norm(push)),
            )
        )
    return tuple(found)
