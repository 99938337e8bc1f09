"""Minimum energy by planes: at k sigma, or with requirements on the states of single craft.

As with impulses, a round solves the program of planes a . x(t) >= b in the states of craft, and turns them.
Thrust is continuous and equal to the primer p, a natural motion that jumps at a plane of multiplier m:

    p jumps by -m a_v,    p' by m (a_r + W a_v),    W = 2 n [[0, -1, 0], [1, 0, 0], [0, 0, 0]]

The state is linear in the primers' starts and jumps.  The ends fix the starts, so that the program is the
quadratic one of the multipliers.  It is solved exactly, and without planes of zones its minimum is a lower
bound on the energy of all paths that keep the requirements.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain, islice
from math import inf, nan
from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.pulses import extended
from closeform.motion.arc import END, MEAN_MOTION, PUSH, START, STATE, THRUST, WIDTH
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path, path_of
from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.delta_v_search import outcome_of, starts
from closeform.planning.delta_v.dual.fleet import Planes
from closeform.planning.delta_v.firing_times import Moments
from closeform.planning.delta_v.impulse_solver import SHARED, ImpulseSolver, Program, beside
from closeform.planning.energy.quadratic_program import solve_qp
from closeform.planning.energy.side_search import MARGINS
from closeform.planning.loop import Rounds, run
from closeform.planning.minimum_energy import Outcome, solve
from closeform.planning.problem.problem import Problem, Trajectories
from closeform.planning.problem.scene import Contacts

ONE, MANY, MORE = 8, 4, 3  # starts for one craft and for many; factor where none of these is clear
ROUNDS, SETTLED, NEARLY = 60, 1e-9, 1.0 - 1e-6  # of the loop: at most, and where they end or planes move out
TOUCHED = 1.02  # of zone and sigmas: closer pairs get a plane
ALIKE = 1e-4  # of a pair's window: closer contacts are merged
GIVEN_UP, FIRST = 1.3, 6  # times the energy to beat, after FIRST rounds
CROWDED = 250  # planes: more are incompatible
LEFT = 1e-7  # of a shortfall and a metre: planes that the solution misses by more are incompatible


def least_energy(
    problem: Problem, budget: int | None = None, more: bool = False, waiting: bool = True
) -> Outcome:
    """Return the best paths of minimum energy, from the search that the requirements need.

    See `minimum_energy.solve` for the arguments.
    """
    if problem.drift is not None or not (problem.sigmas or problem.requirements):
        return solve(problem, budget, more, waiting)
    solver = EnergySolver(problem)
    free, best, tried = solver.unconstrained(), None, 0
    solver.closest.note(free.checked.worst, free.trajectories, free.checked.outside)
    most = budget or (ONE if problem.count == 1 else MANY) * (MORE if more else 1)
    for start in islice(chain(sides(problem), starts(solver, free, lambda: solve(problem))), most):
        found = solver.solve(start, inf if best is None else best.cost)
        best = found if best is None or (found is not None and found.cost < best.cost) else best
        tried += 1
    least = solver.requirement_bound() if problem.requirements else 0.0
    if best is None:
        return Outcome(None, (), nan, MARGINS[0], False, tried, closest=solver.closest, least=least)
    clear = outcome_of(solver, best, tried)
    return replace(clear, extra=best.cost - solver.least_energy, delta_v=nan, least=min(least, best.cost))


def sides(problem: Problem) -> Iterator[Contacts]:
    """Yield starts for zones with sigmas."""
    if problem.sigmas:
        from closeform.planning.sigmas.sigma_problem import SigmaProblem
        from closeform.planning.sigmas.sigma_sides import sides_of_enlarged

        assert isinstance(problem, SigmaProblem)
        yield from sides_of_enlarged(problem, MARGINS[0])


class Solved(NamedTuple):
    """Solution of planes: contacts with multipliers, the energy beyond the least, and the paths."""

    contacts: Contacts
    extra: float
    trajectories: Callable[[], Trajectories]


class EnergySolver(ImpulseSolver):
    """Solver of one problem from any contacts, by continuous thrust; `delta_v` of results is their energy."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem, (None,) * problem.count, ("",) * problem.count)
        self.least_energy, self.least = problem.energy(problem.direct), MARGINS[0]

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
        solved = (self.by_states if self.problem.requirements else self.by_contacts)(program.contacts, aim)
        if solved is None or self.least_energy + solved.extra > bar:
            return None
        trajectories = solved.trajectories()
        checked = self.checked(trajectories, solved.contacts)
        self.requirements.relinearise(trajectories, checked.required)
        self.closest.note(checked.worst, trajectories, checked.outside)
        none, energy = np.empty((self.problem.count, 0, 3)), self.least_energy + solved.extra
        return Spent(trajectories, energy, energy, checked, solved.contacts, aim, [], none, [])

    def by_contacts(self, contacts: Contacts, aim: float) -> Solved | None:
        """Return the solution for planes of contacts, by the kernel of the problem; None without any."""
        (motions, kernel), normals = self.problem.unconstrained(contacts), contacts.normals
        kernel = kernel.reshape(contacts.number, 3, contacts.number, 3)
        gram = np.einsum("ki,kimj,mj->km", normals, kernel, normals)
        multipliers, extra = quadratic_minimum(gram, aim - (normals * motions[:, 0]).sum(axis=1))
        pushed = contacts._replace(multipliers=multipliers)
        return Solved(pushed, extra, lambda: self.problem.trajectories(pushed)) if extra < inf else None

    def by_states(self, contacts: Contacts, aim: float) -> Solved | None:
        """Return the solution for planes of contacts and of requirements; None without any."""
        planes, number = self.planes(contacts, aim), contacts.number
        if len(planes.times) > CROWDED:
            return None
        multipliers, begun, extra = self.multipliers(planes)
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
        pressing = found.contacts.some(found.contacts.multipliers > 0.0)
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
        return beside(problem, found.trajectories, planes.some(np.sort(once)))

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
        """Return a lower bound on the energy of all paths that keep the requirements."""
        self.requirements.inward = 0.0
        extra = self.multipliers(self.requirements.placed())[2]
        return self.least_energy + (0.0 if extra == inf else extra)

    def multipliers(self, planes: Planes) -> tuple[Floats, Floats, float]:
        """Return the planes' multipliers (K,), the primers' starts (N, 6), and the energy beyond the least.

        The energy is inf for incompatible planes.
        """
        count, base, orbit = len(planes.times), self.problem.base, self.problem.orbit
        gram, gaps, begun, ways = np.zeros((count, count)), planes.misses.copy(), [], []
        for i, (begin, end) in enumerate(base[:, [START, END]]):
            side = 1.0 * (planes.first == i) - 1.0 * (planes.second == i)
            felt, jumps = np.flatnonzero(side), side[:, None] * self.jumps(planes.rows)
            times, rows = planes.times[felt], side[felt, None] * planes.rows[felt]
            inverse = np.linalg.inv(responses(orbit, np.array([end - begin]))[0])
            missing = self.finals[i] - orbit.transition(end - begin) @ base[i, STATE:THRUST]
            start = inverse @ missing
            early, late = responses(orbit, times - begin), responses(orbit, end - times)
            between = responses(orbit, np.maximum(times[:, None] - times, 0.0).ravel())
            ahead = np.einsum("lmab,mb->lma", between.reshape(len(times), len(times), 6, 6), jumps[felt])
            back = np.einsum("ab,mbc,mc->ma", inverse, late, jumps[felt])  # of the start, by a multiplier
            moved = ahead - np.einsum("lab,mb->lma", early, back)
            gram[np.ix_(felt, felt)] += np.einsum("la,lma->lm", rows, moved)
            gaps[felt] -= np.einsum("la,lab,b->l", rows, early, start)
            begun.append(start)
            ways.append((felt, back))
        multipliers, energy = quadratic_minimum(0.5 * (gram + gram.T), gaps)
        for start, (felt, back) in zip(begun, ways, strict=True):
            start -= multipliers[felt] @ back
        return multipliers, np.array(begun), energy

    def jumps(self, rows: Floats) -> Floats:
        """Return the jumps (K, 6) of thrust and its rate at planes of rows (K, 6), for a multiplier of 1."""
        n, place, speed = self.problem.orbit.mean_motion, rows[:, :3], rows[:, 3:]
        turned = 2.0 * n * np.stack([-speed[:, 1], speed[:, 0], 0.0 * speed[:, 0]], axis=1)
        return np.hstack([-speed, place + turned])

    def thrusting(self, i: int, planes: Planes, multipliers: Floats, begun: Floats) -> Path:
        """Return the path of a craft from the start `begun` (6,) of its primer, which jumps at planes."""
        orbit, arc = self.problem.orbit, self.problem.base[i].copy()
        side = 1.0 * (planes.first == i) - 1.0 * (planes.second == i)
        pushes = (side * multipliers)[:, None] * self.jumps(planes.rows)
        arc[THRUST:PUSH], end, rows = begun, arc[END], []
        for k in np.argsort(planes.times, kind="stable"):
            if not pushes[k].any() or not arc[START] < planes.times[k] < end:
                if pushes[k].any() and planes.times[k] == arc[START]:
                    arc[THRUST:PUSH] += pushes[k]  # planes at one time share an arc
                continue
            rows.append(arc.copy())
            rows[-1][END] = planes.times[k]
            lasts, state, thrust = planes.times[k] - arc[START], arc[STATE:THRUST], arc[THRUST:PUSH]
            flow, response = orbit.transition(lasts), responses(orbit, np.array([lasts]))[0]
            state[:], thrust[:] = flow @ state + response @ thrust, flow @ thrust + pushes[k]
            arc[START] = planes.times[k]
        path = Path(orbit, np.array([*rows, arc]), np.array([0, len(rows) + 1]), ())
        return extended(path, self.problem.first, self.problem.arrival)


def responses(orbit: Orbit, times: Floats) -> Floats:
    """Return the responses (T, 6, 6) of the state to thrust and its rate, `times` (T,) [s] before."""
    arcs = np.zeros((6, WIDTH))
    arcs[:, END], arcs[:, MEAN_MOTION] = max(float(times.max(initial=0.0)), 1.0), orbit.mean_motion
    arcs[:, THRUST:PUSH] = np.eye(6)
    paths = path_of(orbit, arcs, np.arange(7), (6,))
    return paths._evaluate_rows(np.broadcast_to(times, (6, len(times)))).transpose(1, 2, 0)


def quadratic_minimum(gram: Floats, gaps: Floats) -> tuple[Floats, float]:
    """Return multipliers m >= 0 (K,) with gram m >= gaps, and m . gram m / 2; inf without any."""
    scale = 1.0 / np.sqrt(np.maximum(gram.diagonal(), np.finfo(float).tiny))
    scaled, target = scale[:, None] * gram * scale, scale * gaps
    found, count = np.zeros(len(gaps)), len(gaps)
    solve_qp(scaled, target, count, np.zeros(count, dtype=bool), 0.0, np.empty((count, count)), found)
    short = ((target - scaled @ found) / (scale * (1.0 + np.abs(gaps)))).max(initial=0.0)
    multipliers: Floats = scale * found
    return multipliers, 0.5 * float(found @ scaled @ found) if short <= LEFT else inf
