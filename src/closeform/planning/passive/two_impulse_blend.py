"""Blending from a safe two-impulse plan to a safe path of low energy, where the search among planes fails.

The impulses are spread over burns.  A step then satisfies the planes of all failures of the current paths,
which is a convex program (theory 72), and covers part of the way to its solution.  Paths on that way satisfy
the same planes, and are safe as far as the planes represent all failures; the step is halved until the
sampled failures are clear.  Motion is linear in thrust, so that part of the way is a weighted sum of arcs.
"""

from itertools import islice
from math import inf
from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, MEAN_MOTION, PUSH, START, STATE, THRUST, WIDTH
from closeform.motion.path import path_of
from closeform.planning.loop import Descent, run
from closeform.planning.passive.passive_search import failures
from closeform.planning.passive.relaxation_rounds import BEYOND, SafeTask, pressing
from closeform.planning.passive.two_impulse_plans import HOPS, two_impulse_plans
from closeform.planning.problem.problem import Problem, Trajectories
from closeform.planning.problem.scene import Contacts

SPREADS = 0.25, 0.1, 0.03, 0.01, 1e-3  # of the drift between two impulses, over which each is spread
GIVING = 1e-7  # softness of planes, of their compliance: many are nearly equal
ROUNDING = 1e-12  # of all time: shorter arcs are dropped


class Arcs(NamedTuple):
    """Paths of all craft until the end of their drifts, with the planes that they satisfy."""

    cost: float
    clear: bool
    worst: float
    arcs: Floats
    offsets: Any
    planes: Contacts
    inside: Contacts  # failures that lead into a zone


class ArcTask:
    """Minimum energy with passive safety as a task of the loop, whose paths are sums of arcs."""

    least = 1.0 + BEYOND  # distance of planes, of the margin

    def __init__(self, problem: Problem, margin: float) -> None:
        self.problem, self.rounds = problem, SafeTask(problem, margin)
        self.exhausted = problem.effort.beyond

    def checked(self, arcs: Floats, offsets: Any, planes: Contacts) -> Arcs:
        """Return paths with their sampled failures inside zones, or else certified ones."""
        inside, short = self.rounds.inside(arcs, offsets, pressing(planes))
        inside = inside if inside.number else self.certain(arcs, offsets)
        energy = self.problem.energy((arcs, offsets))
        return Arcs(energy, not inside.number, min(1.0 - short, 1.0), arcs, offsets, planes, inside)

    def certain(self, arcs: Floats, offsets: Any) -> Contacts:
        """Return certified conflicts, with thrust and after its loss."""
        whole, planned = self.problem.with_obstacles(arcs, offsets), self.problem.arrived(arcs, offsets)
        met = self.problem.met(self.problem.conflicts(whole))
        paths = path_of(self.problem.orbit, *planned, (self.problem.count,))
        return met.joined(failures(self.problem, paths, self.problem.bodies(whole)))

    def relinearise(self, found: Arcs) -> Contacts:
        """Return the planes of all failures of paths, which these paths satisfy if they are clear."""
        return self.rounds.failures(found.arcs, found.offsets, Contacts.none())[0]

    def minimise(self, planes: Contacts, accuracy: float, aim: float, bar: float) -> Arcs | None:
        """Return the paths of minimum energy that satisfy planes; None above `bar` or without any."""
        energy = self.rounds.pressed(planes, aim, accuracy, most=inf)
        found = None if energy == inf else self.checked(*self.rounds.trajectories(planes), planes)
        return None if found is None or found.cost > bar else found

    def crowd(self, planes: Contacts) -> int:
        """Return 0: soft planes of arcs are solved fast, however many they are."""
        return 0

    def supported(self, clear: Arcs, found: Arcs, planes: Contacts) -> Contacts:
        """Return planes, with those at the failures of found paths that clear paths keep."""
        return planes.joined(self.rounds.turned(clear.arcs, clear.offsets, found.inside))

    def blend(self, one: Arcs, other: Arcs, share: float) -> Arcs:
        """Return paths a fraction of the way from one to the other."""
        each = [
            summed(self.problem, (one.arcs[a:b], other.arcs[c:d]), (1.0 - share, share))
            for a, b, c, d in zip(
                *(one.offsets[:-1], one.offsets[1:], other.offsets[:-1], other.offsets[1:]), strict=True
            )
        ]
        return self.checked(np.concatenate(each), np.cumsum([0, *map(len, each)]), Contacts.none())


def blended_plan(problem: Problem, margin: float) -> Trajectories | None:
    """Return the lowest-cost paths found that are certified safe; None without a safe two-impulse plan."""
    task = ArcTask(problem, margin)
    begin = spread_plan(task)
    if begin is None:
        return None
    found = run(Descent(task, task.relinearise, GIVING), begin)
    return problem.with_obstacles(*problem.arrived(found.arcs, found.offsets))


def spread_plan(task: ArcTask) -> Arcs | None:
    """Return the lowest-cost two-impulse plan that is clear, as sampled, with its impulses as burns."""
    problem = task.problem
    for times, _ in islice(two_impulse_plans(problem), HOPS):
        for share in SPREADS:
            own = [burned(problem, i, when[0], when[1], share) for i, when in enumerate(times)]
            plan = task.checked(np.concatenate(own), np.cumsum([0, *map(len, own)]), Contacts.none())
            if plan.clear:
                return plan
    return None


def burned(problem: Problem, i: int, first: float, last: float, share: float) -> Floats:
    """Return craft i's arcs, with burns for a `share` of the drift after `first` and before `last` [s]."""
    orbit, start, end = problem.orbit, *problem.base[i, [START, END]]
    state, final = problem.base[i, STATE : STATE + 6], problem.path(problem.direct)[i].state(end)
    begin = orbit.transition(problem.first - start, start) @ state
    lasts = share * (last - first)
    early, late = (
        orbit.burn(np.zeros((3, 6)), np.eye(3), lasts, at).state(at + lasts).T for at in (first, last - lasts)
    )
    pushed = np.hstack([orbit.transition(last - lasts - first, first + lasts) @ early, late])
    coasted = orbit.transition(last - problem.first, problem.first) @ begin
    missing = orbit.transition(last - end, end) @ final - coasted
    pushes = np.linalg.solve(pushed, missing).reshape(2, 3)
    edges = np.array([problem.first, first, first + lasts, last - lasts, last, problem.last])
    arcs = np.zeros((5, WIDTH))
    arcs[:, START], arcs[:, END], arcs[:, MEAN_MOTION] = edges[:-1], edges[1:], orbit._column
    arcs[[1, 3], PUSH : PUSH + 3] = pushes
    arcs[0, STATE : STATE + 6] = begin
    for before, after in zip(arcs[:-1], arcs[1:], strict=True):
        after[STATE : STATE + 6] = states(problem, before[None], before[None, END])[0]
    left: Floats = arcs[np.diff(edges) > ROUNDING * (edges[-1] - edges[0])]
    return left


def summed(problem: Problem, each: tuple[Floats, Floats], weights: tuple[float, float]) -> Floats:
    """Return the arcs of a weighted sum of two motions of one craft over the same time."""
    edges = np.unique(np.concatenate([own[:, [START, END]].ravel() for own in each]))
    short = ROUNDING * (edges[-1] - edges[0])
    edges = edges[np.append(True, np.diff(edges) > short)]
    arcs = np.zeros((len(edges) - 1, WIDTH))
    arcs[:, START], arcs[:, END], arcs[:, MEAN_MOTION] = edges[:-1], edges[1:], problem.orbit._column
    for own, weight in zip(each, weights, strict=True):
        rows = own[np.maximum(np.searchsorted(own[:, START], edges[:-1] + short, "right") - 1, 0)]
        passed = edges[:-1] - rows[:, START]
        turned = problem.orbit.transition(passed, rows[:, START]) @ rows[:, THRUST : THRUST + 6, None]
        arcs[:, STATE : STATE + 6] += weight * states(problem, rows, edges[:-1])
        arcs[:, THRUST : THRUST + 6] += weight * turned[..., 0]
        arcs[:, PUSH : PUSH + 3] += weight * rows[:, PUSH : PUSH + 3]
    return arcs


def states(problem: Problem, arcs: Floats, times: Floats) -> Floats:
    """Return the state (K, 6) on each arc at its own time."""
    rows = path_of(problem.orbit, np.ascontiguousarray(arcs), np.arange(len(arcs) + 1), (len(arcs),))
    found: Floats = rows._evaluate_rows(times[:, None])[:, 0]
    return found
