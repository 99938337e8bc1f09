"""Minimum energy by planes: at k sigma, after a loss of thrust, or with requirements on single craft.

As with impulses, a round solves the program of planes a . x(t) >= b in the states of craft, and turns them.
Thrust is continuous and equal to the primer p, a natural motion that jumps at a plane of multiplier m:

    p jumps by -m a_v,    p' by m (a_r + W a_v),    W = 2 n [[0, -1, 0], [1, 0, 0], [0, 0, 0]]

The state is linear in the primers' starts and jumps.  The ends fix the starts, so that the program is the
quadratic one of the multipliers.  It is solved exactly, and without planes of zones its minimum is a lower
bound on the energy of all paths that keep the requirements.  After a loss of thrust a craft feels a plane at
that instant, with a propagated back by natural motion.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from math import inf
from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.pulses import extended
from closeform.motion.arc import END, MEAN_MOTION, PUSH, START, STATE, THRUST, WIDTH
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path, path_of
from closeform.planning.continuous.continuous_failures import ContinuousFailures
from closeform.planning.delta_v.checks import Checked, Spent
from closeform.planning.delta_v.dual.fleet import Planes
from closeform.planning.delta_v.firing_times import Moments
from closeform.planning.delta_v.impulse_solver import SHARED, ImpulseSolver, Program, beside
from closeform.planning.energy.local_solver import SURE
from closeform.planning.energy.plane_program import ALONE, press
from closeform.planning.energy.quadratic_program import fill_multipliers
from closeform.planning.energy.side_search import MARGINS
from closeform.planning.loop import Rounds, run
from closeform.planning.passive.certification import failures_with_norms
from closeform.planning.problem.problem import Problem, Trajectories
from closeform.planning.problem.scene import Contacts

ROUNDS, SETTLED, NEARLY = 60, 1e-9, 1.0 - 1e-6  # of the loop: at most, and where they end or planes move out
TOUCHED = 1.02  # of zone and sigmas: closer pairs get a plane
ALIKE = 1e-4  # of a pair's window: closer contacts are merged
GIVEN_UP, FIRST = 1.3, 6  # times the energy to beat, after FIRST rounds
FARTHEST = 100.0  # zones: maximum displacement by planes; beyond it they are incompatible
CROWDED = 250  # planes: more are incompatible
ROUNDING = 1e-12  # of all time: shorter arcs are dropped
LEFT = 1e-7  # of a shortfall and a metre: planes that the solution misses by more are incompatible
BOUNDING, RAISED = 8, 1e-4  # maximum rounds of the bound of requirements; share of it that pays for one more
HARD = 1e-7  # softness of planes up to which paths are certified
SAMPLED = 1.0 - 1e-4  # norm above which failures that samples missed are searched for
DEEPER = 1e-6  # zones, by which these are deeper than known ones
INSIDE = 1.0 - 1e-12  # largest norm of failures that samples missed, and of paths that are not certified


class Solved(NamedTuple):
    """Solution of planes: contacts with multipliers, the energy beyond the least, and the paths."""

    contacts: Contacts
    extra: float
    trajectories: Callable[[], Trajectories]


class EnergySolver(ImpulseSolver):
    """Solver of one problem from any contacts, by continuous thrust; the cost of results is their energy."""

    def __init__(self, problem: Problem, margin: float = MARGINS[0]) -> None:
        super().__init__(problem, (None,) * problem.count, ("",) * problem.count)
        self.least_energy = problem.energy(problem.direct)
        self.least = margin if problem.beside is None else max(margin, SURE)
        self.lost = None if problem.drift is None else ContinuousFailures(problem)

    def solve(self, contacts: Contacts, bar: float = inf, stride: float = inf) -> Spent | None:
        """Return the lowest-cost clear paths found from a start; None without any well below `bar`."""
        settled = SHARED if self.problem.requirements else SETTLED
        method: Rounds[Spent, Program] = Rounds(
            *(self, lambda turn: GIVEN_UP * bar if turn >= FIRST else inf, ROUNDS, stride),
            settled=settled,
            nearly=NEARLY,
        )
        found: Spent | None = run(method, Program(contacts, []))
        return found

    def unconstrained(self) -> Spent:
        """Return the paths of minimum energy without zones and requirements."""
        found = self.minimise(Program(Contacts.none(), []), 0.0, self.least, inf)
        assert found is not None
        return found

    def minimise(self, program: Program, accuracy: float, aim: float, bar: float) -> Spent | None:
        """Return the paths of minimum energy that satisfy a program's planes; None above `bar` or without."""
        solve = self.by_contacts if self.lost is None else self.pressed
        solve = self.by_states if self.problem.requirements else solve
        solved = solve(program.contacts, aim, accuracy)
        if solved is None or self.least_energy + solved.extra > bar:
            return None
        trajectories = solved.trajectories()
        checked = self.checked(trajectories, solved.contacts, accuracy <= HARD)
        self.requirements.relinearise(trajectories, checked.required)
        self.closest.note(checked.worst, trajectories, checked.outside)
        none, energy = np.empty((self.problem.count, 0, 3)), self.least_energy + solved.extra
        return Spent(trajectories, energy, energy, checked, solved.contacts, aim, [], none, [])

    def pressed(self, contacts: Contacts, aim: float, soft: float) -> Solved | None:
        """Return the solution for planes of contacts, fast and with softness; None without any."""
        assert self.lost is not None
        pushed = contacts.first(contacts.number)
        self.problem.effort.used += contacts.number**2  # a pair of planes costs as much as a sample
        extra = press(self.lost.scene, pushed, aim, soft, inf, FARTHEST)
        return Solved(pushed, extra, lambda: self.problem.trajectories(pushed)) if extra < inf else None

    def by_contacts(self, contacts: Contacts, aim: float, soft: float = 0.0) -> Solved | None:
        """Return the solution for planes of contacts, by the kernel of the problem; None without any."""
        (motions, kernel), normals = self.problem.unconstrained(contacts), contacts.normals
        kernel = kernel.reshape(contacts.number, 3, contacts.number, 3)
        gram = np.einsum("ki,kimj,mj->km", normals, kernel, normals)
        multipliers, extra = quadratic_minimum(gram, aim - (normals * motions[:, 0]).sum(axis=1))
        pushed = contacts._replace(multipliers=multipliers)
        return Solved(pushed, extra, lambda: self.problem.trajectories(pushed)) if extra < inf else None

    def by_states(self, contacts: Contacts, aim: float, soft: float = 0.0) -> Solved | None:
        """Return the solution for planes of contacts and of requirements; None without any."""
        planes, number = self.planes(contacts, aim), contacts.number
        if self.lost is not None:  # whose zones with edges are rounded
            planes.misses[:number] += aim * (self.lost.scene.aims[self.problem.kinds[contacts.which]] - 1.0)
        if len(planes.times) > CROWDED:
            return None
        self.problem.effort.used += len(planes.times) ** 2
        multipliers, begun, extra = self.multipliers(planes, soft)
        if extra == inf:
            return None
        self.requirements.keep(multipliers[number:])

        def trajectories() -> Trajectories:
            paths = (self.thrusting(i, planes, multipliers, begin) for i, begin in enumerate(begun))
            return self.problem.with_path(*paths)

        return Solved(contacts._replace(multipliers=multipliers[:number]), extra, trajectories)

    def turned(self, found: Spent, *nearer: float) -> Contacts:
        """Return active contacts at the closest approaches next to them, and those of other approaches.

        A contact that is farther from an approach also keeps its own time, which damps the rounds.
        """
        problem, fresh = self.problem, []
        if self.lost is not None and not problem.sigmas:
            return found.checked.lost
        pressing = found.contacts.some(found.contacts.multipliers > 0.0)
        if self.lost is not None:
            pressing = pressing.some(problem.with_errors(pressing))
        times, (start, end) = pressing.times.copy(), problem.windows[0].T
        for pair, row in problem.conflicts(found.trajectories, TOUCHED):
            k = problem.index[pair]
            time = min(max(row[2], start[k]), end[k])
            same = (pressing.which == k) & (np.abs(times - time) <= ALIKE * (end[k] - start[k]))
            times[same] = time
            if not same.any():
                fresh.append((pair, np.array([*row[:2], time, row[3]])))
        planes = pressing._replace(times=times).joined(problem.met(fresh))
        _, once = np.unique(np.column_stack([planes.which, planes.times]), axis=0, return_index=True)
        planes = beside(problem, found.trajectories, planes.some(np.sort(once)))
        return planes.joined(found.checked.lost)

    def supported(self, clear: Spent, found: Spent, program: Program) -> Program:
        """Return a program with added planes at conflicts of found paths that `clear` paths keep."""
        problem, lost, met = self.problem, found.checked.lost, self.problem.met(found.checked.missed)
        if self.lost is not None:
            lost = self.lost.turned(clear.trajectories, self.lost.inside(found.trajectories, lost))
        met = met._replace(normals=problem.normals(clear.trajectories, met, -inf))
        return program._replace(contacts=program.contacts.joined(lost.joined(met)))

    def checked(self, trajectories: Trajectories, contacts: Contacts, certified: bool = True) -> Checked:
        """Return conflicts of paths, with thrust and after its loss, and the checks of requirements.

        With a loss of thrust, conflicts that are not at k sigma are among the failures, and paths that are
        not to be `certified` are at most nearly safe.
        """
        if self.lost is None:
            return super().checked(trajectories, contacts)
        problem = self.problem
        known = contacts.some((contacts.multipliers > 0.0) & ~problem.with_errors(contacts))
        lost, nearest = self.lost.near(trajectories, known)
        sure = certified and nearest >= SAMPLED
        missed = problem.conflicts(trajectories) if sure or problem.sigmas else []
        fresh = problem.met(missed)
        fresh = fresh.some(~problem.with_errors(fresh))
        if sure and not missed:
            own = problem.path(self.arrived(trajectories))
            fresh, norms = failures_with_norms(problem, own, problem.bodies(trajectories))
            fresh = fresh.some(norms < min(nearest, 1.0) - DEEPER * (nearest < 1.0))
        if fresh.number:
            lost, nearest = self.lost.near(trajectories, known.joined(fresh))
        if fresh.number or not certified:
            nearest = min(nearest, INSIDE)
        required = problem.requirement_checks(self.arrived(trajectories)) if problem.requirements else []
        return Checked(missed, lost, nearest, required)

    def arrived(self, trajectories: Trajectories) -> Trajectories:
        """Return paths without the drift after the last arrival."""
        if self.lost is None:
            return trajectories
        own = self.problem.path(trajectories)
        return self.problem.with_obstacles(*self.problem.arrived(own.arcs, own.offsets))

    def of_arcs(self, arcs: list[Floats], known: Contacts, certified: bool) -> Spent:
        """Return the result of each craft's arcs, without contacts, checked at `known` ones."""
        offsets = np.cumsum([0, *map(len, arcs)])
        trajectories = self.problem.with_obstacles(np.concatenate(arcs), offsets)
        checked, energy = self.checked(trajectories, known, certified), self.problem.energy(trajectories)
        none = np.empty((self.problem.count, 0, 3))
        return Spent(trajectories, energy, energy, checked, Contacts.none(), self.least, [], none, [])

    def blend(self, one: Spent, other: Spent, share: float, certified: bool = True) -> Spent:
        """Return paths a `share` of the way from one to the other, or beyond."""
        paths, others = self.problem.path(one.trajectories), self.problem.path(other.trajectories)
        arcs = [
            summed(self.problem, (paths[i].arcs, others[i].arcs), (1.0 - share, share))
            for i in range(self.problem.count)
        ]
        return self.of_arcs(arcs, one.contacts.joined(other.contacts), certified)

    def following(self, found: Spent) -> list[Moments]:
        """Return no firing times: thrust is continuous."""
        return []

    def settled(self, best: Spent) -> Contacts:
        """Return the contacts with their multipliers, which are exact."""
        return best.contacts

    def below_bit(self, found: Spent) -> Floats:
        """Return a mask without impulses (N, 0)."""
        return np.empty((self.problem.count, 0), dtype=bool)

    def requirement_bound(self, best: Spent | None = None) -> float:
        """Return a lower bound on the energy of all paths that keep the requirements.

        Planes are added where the paths of the bound leave a requirement, until they raise it no more.
        """
        own, least = copy(self.requirements), -inf
        own.inward = 0.0  # of the requirements themselves, without reserve
        for _ in range(BOUNDING):
            planes = own.placed()
            multipliers, begun, extra = self.multipliers(planes)
            if not extra < inf:
                break
            gained, least = extra - least, max(extra, least)
            paths = (self.thrusting(i, planes, multipliers, begin) for i, begin in enumerate(begun))
            checked = self.problem.requirement_checks(self.arrived(self.problem.with_path(*paths)))
            if gained < RAISED * (self.least_energy + least) or not any(one.shortfall for one in checked):
                break
            own.keep(multipliers)
            own.add(checked)
        return self.least_energy + max(least, 0.0)

    def multipliers(self, planes: Planes, soft: float = 0.0) -> tuple[Floats, Floats, float]:
        """Return the planes' multipliers (K,), the primers' starts (N, 6), and the energy beyond the least.

        The energy is inf for incompatible planes.  Planes give way by `soft` of their own compliance.
        """
        count, base, orbit = len(planes.times), self.problem.base, self.problem.orbit
        gram, gaps, begun, ways = np.zeros((count, count)), planes.misses.copy(), [], []
        for i, (begin, end) in enumerate(base[:, [START, END]]):
            felt, times, rows = self.felt(i, planes)
            jumps = self.jumps(rows)
            inverse = np.linalg.inv(responses(orbit, np.array([end - begin]))[0])
            missing = self.finals[i] - orbit.transition(end - begin) @ base[i, STATE:THRUST]
            start = inverse @ missing
            early, late = responses(orbit, times - begin), responses(orbit, end - times)
            between = responses(orbit, np.maximum(times[:, None] - times, 0.0).ravel())
            ahead = np.einsum("lmab,mb->lma", between.reshape(len(times), len(times), 6, 6), jumps)
            back = np.einsum("ab,mbc,mc->ma", inverse, late, jumps)  # of the start, by a multiplier
            moved = ahead - np.einsum("lab,mb->lma", early, back)
            gram[np.ix_(felt, felt)] += np.einsum("la,lma->lm", rows, moved)
            gaps[felt] -= np.einsum("la,lab,b->l", rows, early, start)
            begun.append(start)
            ways.append((felt, back))
        multipliers, energy = quadratic_minimum(0.5 * (gram + gram.T), gaps, soft)
        for start, (felt, back) in zip(begun, ways, strict=True):
            start -= multipliers[felt] @ back
        return multipliers, np.array(begun), energy

    def felt(self, i: int, planes: Planes) -> tuple[Any, Floats, Floats]:
        """Return the indices (L,) of planes that craft i feels, and when, and their rows (L, 6) in its state.

        After a loss of thrust a plane is felt at that instant.
        """
        side = 1.0 * (planes.first == i) - 1.0 * (planes.second == i)
        felt = np.flatnonzero(side)
        times = np.where(planes.first[felt] == i, planes.cuts[felt, 0], planes.cuts[felt, 1])
        flow = self.problem.orbit.transition(planes.times[felt] - times)
        return felt, times, side[felt, None] * (planes.rows[felt, None] @ flow)[:, 0]

    def jumps(self, rows: Floats) -> Floats:
        """Return the jumps (K, 6) of thrust and its rate at planes of rows (K, 6), for a multiplier of 1."""
        n, place, speed = self.problem.orbit.mean_motion, rows[:, :3], rows[:, 3:]
        turned = 2.0 * n * np.stack([-speed[:, 1], speed[:, 0], 0.0 * speed[:, 0]], axis=1)
        return np.hstack([-speed, place + turned])

    def thrusting(self, i: int, planes: Planes, multipliers: Floats, begun: Floats) -> Path:
        """Return the path of a craft from the start `begun` (6,) of its primer, which jumps at planes."""
        orbit, arc = self.problem.orbit, self.problem.base[i].copy()
        felt, times, felt_rows = self.felt(i, planes)
        pushes = multipliers[felt, None] * self.jumps(felt_rows)
        arc[THRUST:PUSH], end, rows = begun, arc[END], []
        for k in np.argsort(times, kind="stable"):
            if not pushes[k].any() or not arc[START] < times[k] < end:
                if pushes[k].any() and times[k] == arc[START]:
                    arc[THRUST:PUSH] += pushes[k]  # planes at one time share an arc
                continue
            rows.append(arc.copy())
            rows[-1][END] = times[k]
            lasts, state, thrust = times[k] - arc[START], arc[STATE:THRUST], arc[THRUST:PUSH]
            flow, response = orbit.transition(lasts), responses(orbit, np.array([lasts]))[0]
            state[:], thrust[:] = flow @ state + response @ thrust, flow @ thrust + pushes[k]
            arc[START] = times[k]
        path = Path(orbit, np.array([*rows, arc]), np.array([0, len(rows) + 1]), ())
        return extended(path, self.problem.first, self.problem.last)


def responses(orbit: Orbit, times: Floats) -> Floats:
    """Return the responses (T, 6, 6) of the state to thrust and its rate, `times` (T,) [s] before."""
    arcs = np.zeros((6, WIDTH))
    arcs[:, END], arcs[:, MEAN_MOTION] = max(float(times.max(initial=0.0)), 1.0), orbit.mean_motion
    arcs[:, THRUST:PUSH] = np.eye(6)
    paths = path_of(orbit, arcs, np.arange(7), (6,))
    return paths._evaluate_rows(np.broadcast_to(times, (6, len(times)))).transpose(1, 2, 0)


def quadratic_minimum(gram: Floats, gaps: Floats, soft: float = 0.0) -> tuple[Floats, float]:
    """Return multipliers m >= 0 (K,) with gram m >= gaps, and m . gram m / 2; inf without any.

    Planes give way by `soft` of their own compliance.
    """
    scale = 1.0 / np.sqrt(np.maximum(gram.diagonal(), np.finfo(float).tiny))
    scaled, target = scale[:, None] * gram * scale, scale * gaps
    found = np.zeros(len(gaps))
    fill_multipliers(np.ascontiguousarray(scaled), target, soft, found)
    short = ((target - scaled @ found) / (scale * (1.0 + np.abs(gaps)))).max(initial=0.0)
    pulled = (found / (scale * (1.0 + np.abs(gaps)))).max(initial=0.0)  # by the plane itself
    compatible = pulled < ALONE if soft else short <= LEFT
    multipliers: Floats = scale * found
    return multipliers, 0.5 * float(found @ scaled @ found) if compatible else inf


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
