"""Search for passively safe plans: starts on different sides, and the certification of a plan."""

from collections.abc import Iterator
from math import inf

import numpy as np

from closeform.arrays import Floats
from closeform.motion.elements.palmer import state_from_palmer
from closeform.motion.path import Path
from closeform.planning.energy.local_solver import Solution
from closeform.planning.energy.side_search import Found
from closeform.planning.passive.energy_descent import held, settled
from closeform.planning.passive.relaxation_rounds import Relaxed, SafeTask
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import Contacts
from closeform.safety.drift_approach import SAME, failures_at, passively_safe, worst_loss
from closeform.safety.drift_screen import worst_drifts
from closeform.safety.failure_cells import side_of
from closeform.safety.failure_search import RATIO, TIME
from closeform.safety.failures import ThrustLost

STARTS = 24  # examined at most
PATIENCE = 8  # starts without a better plan that end the search
FORMATION, STARTS_OF_MANY = 4, 2  # number of craft from which the starts are few, and their number
SEARCHING = 0.6  # of the effort: the rest is for the descent from the best start
FARTHER = 1e-5  # zones, by which planes are raised where samples missed failures; then ten times as far
FINER = 4  # maximum rounds with failures that samples missed
FEW_LOSSES = 60, 21, 21  # beside any chief, to find one of them that leads into a zone
SIZE = 1.2  # of the zone: amplitudes of the natural motions that shift a start
DRIFT = 0.2  # and their change of the semi-major axis


def failures(problem: Problem, planned: Path, trajectories: Path) -> Contacts:
    """Return the deepest conflict after a loss of thrust of each pair and failing craft; empty if safe.

    `planned` (N,) are the craft's paths until they arrive, `trajectories` (N + M,) all, with the drift.
    """
    return failures_with_norms(problem, planned, trajectories)[0]


def failures_with_norms(problem: Problem, planned: Path, trajectories: Path) -> tuple[Contacts, Floats]:
    """Return the contacts of `failures`, and the norms (K,) there."""
    found, norms, end = Contacts.none(), [np.empty(0)], problem.last
    if problem.beside is not None:
        return failures_beside_chief(problem, planned, trajectories)
    sides = side_of(planned, ThrustLost(), end), side_of(trajectories, None, end)
    for kind, zone in enumerate(problem.zones):
        those = np.flatnonzero(problem.kinds == kind)
        for side in range(2):
            which = those[problem.pairs[those, side] < problem.count]
            craft, others = problem.pairs[which, side], problem.pairs[which, 1 - side]
            around = zone.mirrored if side else zone
            unsafe, rows = worst_drifts(sides, craft, others, end, problem.orbit, around, SAME)
            drifts, time = np.zeros((len(unsafe), 2)), rows[:, TIME]
            drifts[:, side] = time - failures_at("path", rows, sides, (craft[unsafe], others[unsafe]))
            found = found.joined(Contacts.at(which[unsafe], time, drifts))
            norms.append(rows[:, RATIO])
    return found, np.concatenate(norms)


def failures_beside_chief(problem: Problem, planned: Path, trajectories: Path) -> tuple[Contacts, Floats]:
    """Return `failures_with_norms` about a chief that is not on a circle."""
    which, times, drifts, norms = [], [], [], []
    for k, pair in enumerate(problem.pairs.tolist()):
        for side in range(2):
            craft, other = pair[side], pair[1 - side]
            if craft >= problem.count:
                continue
            zone = problem.zones[problem.kinds[k]]
            given = planned[craft], trajectories[other], zone.mirrored if side else zone, problem.last
            if passively_safe(*given):
                continue
            lost, time, norm, _ = worst_loss(*given, True, FEW_LOSSES, 1)
            lost = lost if lost == lost else float(planned[craft].start)
            which.append(k)
            times.append(time)
            drifts.append([0.0, time - lost] if side else [time - lost, 0.0])
            norms.append(norm)
    found = np.array(which, dtype=np.int64), np.array(times, dtype=float)
    return Contacts.at(*found, np.array(drifts).reshape(-1, 2)), np.array(norms)


def shifts(problem: Problem, seed: int) -> Floats:
    """Return random natural motions (N + M, 6) of about one zone's size for the craft; zero for obstacles."""
    draws = np.random.default_rng(seed).uniform(size=(problem.count, 6))
    size = max((float(zone.radius) for zone in problem.zones), default=0.0)
    moved = np.zeros((problem.count + len(problem.other_offsets) - 1, 6))
    n = problem.orbit._rate
    if not n:
        spread = np.array([size] * 3 + [size / (problem.arrival - problem.first)] * 3)
        moved[: problem.count] = spread * (2.0 * draws - 1.0)
        return moved
    swing, phase, across, cross_phase, along, d = draws.T
    swing, across, phase, cross_phase = (
        SIZE * swing,
        SIZE * across,
        2.0 * np.pi * phase,
        2.0 * np.pi * cross_phase,
    )
    parts = (
        *(swing * np.cos(phase), swing * np.sin(phase), DRIFT * (d - 0.5), along - 0.5),
        *(across * np.cos(cross_phase), across * np.sin(cross_phase)),
    )
    moved[: problem.count] = state_from_palmer(size * np.stack(parts, axis=1), n)
    return moved


class PassiveSearch:
    """Search among starts: the first without a shift, the others with random shifts by seed."""

    def __init__(self, problem: Problem, margin: float, budget: int | None, more: bool) -> None:
        self.problem = problem
        self.rounds = SafeTask(problem, margin)
        self.margin = margin
        self.few = problem.count < FORMATION
        starts = STARTS if self.few else STARTS_OF_MANY
        self.budget = starts * (1 + more) if budget is None else budget
        self.limited = budget is not None
        problem.effort.allow(problem.count, budget, starts)
        self.patience = inf if self.limited else PATIENCE
        self.best: Solution | None = None
        self.tried = 0

    def run(self) -> Found:
        """Examine starts until no better plan is found, or the budget is spent."""
        improved = 0
        for seed, walking in self.starts():
            if self.best is not None and self.problem.effort.beyond(SEARCHING):
                break
            found = self.examine(seed, walking)
            self.tried += 1
            if self.best is None or found.energy < self.best.energy:
                self.best, improved = found, self.tried
                if found.clear and not found.contacts.number:  # the unconstrained paths are the cheapest
                    break
            elif self.best.clear and self.tried - improved >= self.patience:
                break
        assert self.best is not None  # a budget is at least one start
        return Found(self.settled(self.best), self.margin, False, self.tried)

    def starts(self) -> Iterator[tuple[int, bool]]:
        """Yield seeds, and whether steps are short, as for a formation or after other starts have failed."""
        if self.few:
            yield from ((seed, False) for seed in range(self.budget))
            if not self.limited and not (self.best is not None and self.best.clear):
                yield from ((seed, True) for seed in range(STARTS))
        else:
            every = [(0, True), (0, False), *((seed, True) for seed in range(1, self.budget))]
            yield from every[: self.budget]

    def examine(self, seed: int, walking: bool = False) -> Solution:
        """Return the certified solution from a start; failures missed by samples become contacts."""
        bar = self.best.energy if self.best is not None else inf
        planes = self.rounds.shifted(shifts(self.problem, seed) if seed else self.rounds.unshifted)
        relaxed = (self.rounds.walked if walking else self.rounds.relaxed)(planes, bar)
        for _ in range(FINER):
            solution = Solution(self.problem, relaxed.contacts, relaxed.energy)
            if not relaxed.energy < bar:
                return solution
            missed = self.missed(solution)
            if not missed.number:
                return solution
            own = self.problem.path(solution.trajectories)
            planes, _ = self.rounds.failures(own.arcs, own.offsets, missed.joined(relaxed.contacts))
            again = self.rounds.relaxed(planes, bar, soft=0.0)
            relaxed = again if again.energy < inf else self.rounds.stepped(relaxed.contacts, planes)[0]
        return Solution(self.problem, relaxed.contacts, inf)

    def settled(self, best: Solution) -> Solution:
        """Return the certified solution of the descent from the best paths."""
        if not (best.clear and best.contacts.number and self.few):
            return best
        relaxed = settled(self.rounds, Relaxed(best.contacts, best.energy))
        for turn in range(FINER):
            solution = Solution(self.problem, relaxed.contacts, relaxed.energy)
            if not relaxed.energy < best.energy:
                break
            missed = self.missed(solution)
            if not missed.number:
                return solution
            own = self.problem.path(solution.trajectories)
            relaxed = held(
                self.rounds, own.arcs, own.offsets, missed.joined(relaxed.contacts), FARTHER * 10.0**turn
            )
        return best

    def missed(self, solution: Solution) -> Contacts:
        """Return conflicts, with thrust or after its loss, that the samples have missed."""
        bodies = self.problem.bodies(solution.trajectories)
        met = self.problem.met(self.problem.conflicts(solution.trajectories))
        return met.joined(failures(self.problem, self.problem.path(solution.planned), bodies))
