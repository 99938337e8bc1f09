"""Blending from a safe two-impulse plan to a safe path of low energy, where the search among planes fails.

The impulses are spread over burns.  A step then satisfies the planes of all failures of the current paths,
which is a convex program (theory 72), and covers part of the way to its solution.  Paths on that way satisfy
the same planes, and are safe as far as the planes represent all failures; the step is halved until the
sampled failures are clear.  Motion is linear in thrust, so that part of the way is a weighted sum of arcs.
"""

from itertools import islice
from math import inf
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, MEAN_MOTION, PUSH, START, STATE, THRUST, WIDTH
from closeform.motion.path import path_of
from closeform.planning.passive.passive_search import failures
from closeform.planning.passive.relaxation_rounds import BEYOND, SafeTask, arrived, pressing
from closeform.planning.passive.two_impulse_plans import HOPS, two_impulse_plans
from closeform.planning.problem.problem import Flown, Problem
from closeform.planning.problem.scene import Contacts

SPREADS = 0.25, 0.1, 0.03, 0.01, 1e-3  # of the drift between two impulses, over which each is spread
STEPS, CUTS = 16, 4  # maximum steps, and rounds that add violated planes
GIVING = 1e-7  # softness of planes, of their compliance: many are nearly equal
SHORTEST = 2.0**-8  # of the way: minimum step
STEADY = 1e-3  # of the energy: minimum saving for another step
ROUNDING = 1e-12  # of all time: shorter arcs are dropped


def blended_plan(problem: Problem, margin: float) -> Flown | None:
    """Return the cheapest paths found that are certified safe; None without a safe two-impulse plan."""
    rounds, energy = SafeTask(problem, margin), inf
    here = found = spread_plan(rounds)
    for _ in range(STEPS):
        if here is None or problem.effort.beyond() or not problem.energy(here) < (1.0 - STEADY) * energy:
            break
        energy, found = problem.energy(here), here
        here = stepped(rounds, *here)
    return None if found is None else problem.with_obstacles(*arrived(problem, *found))


def spread_plan(rounds: SafeTask) -> Flown | None:
    """Return the cheapest two-impulse plan that is clear, as sampled, with its impulses as burns."""
    problem = rounds.problem
    for times, _ in islice(two_impulse_plans(problem), HOPS):
        for share in SPREADS:
            own = [burned(problem, i, when[0], when[1], share) for i, when in enumerate(times)]
            plan = np.concatenate(own), np.cumsum([0, *map(len, own)])
            if not missed(rounds, *plan).number:
                return plan
    return None


def burned(problem: Problem, i: int, first: float, last: float, share: float) -> Floats:
    """Return craft i's arcs, with burns for a `share` of the drift after `first` and before `last` [s]."""
    orbit, start, end = problem.orbit, *problem.base[i, [START, END]]
    state, final = problem.base[i, STATE : STATE + 6], problem.path(problem.direct)[i].state(end)
    begin = orbit.transition(problem.first - start) @ state
    drift, lasts = last - first, share * (last - first)
    burn = orbit.burn(np.zeros((3, 6)), np.eye(3), lasts).state(lasts).T
    pushed = np.hstack([orbit.transition(drift - lasts) @ burn, burn])
    missing = orbit.transition(last - end) @ final - orbit.transition(last - problem.first) @ begin
    pushes = np.linalg.solve(pushed, missing).reshape(2, 3)
    edges = np.array([problem.first, first, first + lasts, last - lasts, last, problem.last])
    arcs = np.zeros((5, WIDTH))
    arcs[:, START], arcs[:, END], arcs[:, MEAN_MOTION] = edges[:-1], edges[1:], orbit.mean_motion
    arcs[[1, 3], PUSH : PUSH + 3] = pushes
    arcs[0, STATE : STATE + 6] = begin
    for before, after in zip(arcs[:-1], arcs[1:], strict=True):
        after[STATE : STATE + 6] = states(problem, before[None], before[None, END])[0]
    left: Floats = arcs[np.diff(edges) > ROUNDING * (edges[-1] - edges[0])]
    return left


def stepped(rounds: SafeTask, arcs: Floats, offsets: Any) -> Flown | None:
    """Return safe paths part of the way to the cheapest that satisfy the planes of some; None without any."""
    problem, planes = rounds.problem, rounds.failures(arcs, offsets, Contacts.none())[0]
    for _ in range(CUTS):
        energy, toward, begins = rounds.pressed(planes, 1.0 + BEYOND, GIVING, most=inf)
        if energy == inf:
            return None
        inside, short = rounds.inside(toward, begins, pressing(planes))
        if short == 0.0:
            break
        planes = planes.joined(rounds.turned(arcs, offsets, inside))
    share = 1.0
    while share >= SHORTEST:
        each = [
            summed(problem, (arcs[a:b], toward[c:d]), (1.0 - share, share))
            for a, b, c, d in zip(offsets[:-1], offsets[1:], begins[:-1], begins[1:], strict=True)
        ]
        part = np.concatenate(each), np.cumsum([0, *map(len, each)])
        if not missed(rounds, *part).number:
            return part
        share *= 0.5
    return None


def missed(rounds: SafeTask, arcs: Floats, offsets: Any) -> Contacts:
    """Return sampled failures inside zones; without any, conflicts and certified failures."""
    problem, found = rounds.problem, rounds.inside(arcs, offsets, Contacts.none())[0]
    if found.number:
        return found
    whole, planned = problem.with_obstacles(arcs, offsets), arrived(problem, arcs, offsets)
    met = problem.met(problem.conflicts(whole))
    paths = path_of(problem.orbit, *planned, (problem.count,))
    return met.joined(failures(problem, paths, problem.bodies(whole)))


def summed(problem: Problem, each: tuple[Floats, Floats], weights: tuple[float, float]) -> Floats:
    """Return the arcs of a weighted sum of two motions of one craft over the same time."""
    edges = np.unique(np.concatenate([own[:, [START, END]].ravel() for own in each]))
    short = ROUNDING * (edges[-1] - edges[0])
    edges = edges[np.append(True, np.diff(edges) > short)]
    arcs = np.zeros((len(edges) - 1, WIDTH))
    arcs[:, START], arcs[:, END], arcs[:, MEAN_MOTION] = edges[:-1], edges[1:], problem.orbit.mean_motion
    for own, weight in zip(each, weights, strict=True):
        rows = own[np.maximum(np.searchsorted(own[:, START], edges[:-1] + short, "right") - 1, 0)]
        turned = problem.orbit.transition(edges[:-1] - rows[:, START]) @ rows[:, THRUST : THRUST + 6, None]
        arcs[:, STATE : STATE + 6] += weight * states(problem, rows, edges[:-1])
        arcs[:, THRUST : THRUST + 6] += weight * turned[..., 0]
        arcs[:, PUSH : PUSH + 3] += weight * rows[:, PUSH : PUSH + 3]
    return arcs


def states(problem: Problem, arcs: Floats, times: Floats) -> Floats:
    """Return the state (K, 6) on each arc at its own time."""
    rows = path_of(problem.orbit, np.ascontiguousarray(arcs), np.arange(len(arcs) + 1), (len(arcs),))
    found: Floats = rows._evaluate_rows(times[:, None])[:, 0]
    return found
