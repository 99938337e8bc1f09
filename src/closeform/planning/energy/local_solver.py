"""Certified solutions from contacts: the local solver with rounded edges first, then with the zones."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import inf

import numpy as np

from closeform.arrays import Floats
from closeform.planning.energy.contact_solver import BLOCKED, OPTIMAL, Workspace, solve_local
from closeform.planning.energy.quadratic_program import is_definite
from closeform.planning.problem.contacts import Sides
from closeform.planning.problem.problem import Problem, Trajectories
from closeform.planning.problem.scene import Contacts, Scene
from closeform.zones.shapes import BALL

BLUNT = ((8.0, 2.0 ** (1.0 / 8.0)), (4.0, 1.0))  # powers of the norms that round edges at first; sizes
SHARPER = 32.0, 512.0  # next powers, where the zones themselves are not solved directly
ROUNDED = 1.02  # cost ratio up to which exact zones are preferred to rounded ones
FINER = 3  # maximum rounds with conflicts that samples missed
ROOM = 8, 24  # contacts of a workspace: constant, and for each craft
CROWDED = 8  # contacts beyond which exact edges are not tried directly
LARGE = 150  # contacts beyond which convexity is not examined
PROVEN = 1e-9  # tolerance of the proof
# Least margin about a chief that is not on a circle: under strong thrust the error bound of its table is up
# to 1e-8 of a zone, and nearer paths count as conflicts.
SURE = 1.0 + 1e-7
AHEAD = np.array([1.0, 0.0, 0.0])  # arbitrary side where two craft meet


@dataclass(frozen=True, eq=False)
class Solution:
    """Paths that are certified clear, or not (`clear`), and their contacts.

    A solution that costs more than the given bar is not certified between the samples.  `energy` is the
    energy beyond the unconstrained optima [m^2/s^3], inf if not clear; `optimal` is True if the conditions of
    optimality hold up to rounding.
    """

    problem: Problem
    contacts: Contacts
    energy: float
    clear: bool
    optimal: bool

    @cached_property
    def trajectories(self) -> Trajectories:
        """The paths of all bodies."""
        return self.problem.trajectories(self.contacts)

    @property
    def planned(self) -> Trajectories:
        """The paths of all bodies up to the last arrival, without the drift after it."""
        return self.trajectories if self.problem.drift is None else self.problem.planned(self.contacts)

    def same(self, other: "Solution") -> bool:
        """Return whether both solutions have the same contacts on the same sides."""
        return (
            self.contacts.number == other.contacts.number
            and abs(self.energy - other.energy) <= 1e-7 * self.energy
            and sorted(self.contacts.which.tolist()) == sorted(other.contacts.which.tolist())
        )


class LocalSolver:
    """Solver of one problem from any start, with its zones enlarged by the factor `margin`."""

    def __init__(self, problem: Problem, margin: float) -> None:
        self.problem = problem
        self.margin = margin if problem.beside is None else max(margin, SURE)
        self.scene = problem.seen
        self._workspace: Workspace | None = None

    def aimed(self, power: float, rounding: float) -> Scene:
        """Return the scene with edges rounded by a power norm, and rounded zones enlarged by `rounding`."""
        if self.problem.round:
            return self.scene._replace(aims=np.full(len(self.scene.shapes), self.margin))
        edged = self.scene.shapes != BALL
        powers = np.where(edged, power, inf)
        return self.scene._replace(powers=powers, aims=np.where(edged, self.margin * rounding, self.margin))

    def solve(self, start: Contacts, sides: Sides, bar: float = inf, blunt: int = 0) -> Solution:
        """Return the lowest-cost certified solution from a start; stop if its energy is well above `bar`.

        `blunt` selects the rounding with which sides are chosen, where zones have edges.
        """
        sharp = self.aimed(inf, 1.0)
        if self.problem.round:
            return self.certified(self.relaxed(sharp, start, sides, bar), bar)
        rough = self.relaxed(self.aimed(*BLUNT[blunt]), start, sides, inf)
        found = [
            self.relaxed(sharp, one, sides, bar)
            for one in (start, rough.contacts)
            if 0 < one.number <= CROWDED
        ]
        best = self.cheapest(found, bar)
        if best is not None:
            return best
        holding: list[Solution] = []
        for power in SHARPER:  # rounded zones that contain a corner of three faces, ever closer to it
            finer = self.relaxed(self.aimed(power, 3.0 ** (1.0 / power)), rough.contacts, sides, bar)
            if finer.clear:
                rough = finer
                holding = [finer]
        last = self.relaxed(sharp, rough.contacts, sides, bar)
        if holding and last.energy <= ROUNDED * holding[0].energy:
            holding = []
        return self.cheapest([last, *holding], bar) or replace(last, clear=False, energy=inf)

    def cheapest(self, found: list[Solution], bar: float) -> Solution | None:
        """Return the lowest-cost clear solution; those that cost more than `bar` are not certified."""
        for one in sorted(found, key=lambda one: one.energy):
            last = self.certified(one, bar)
            if last.clear:
                return last
        return None

    def workspace(self, scene: Scene, count: int) -> Workspace:
        """Return a workspace for at least `count` contacts, which is reused."""
        room, samples = self._workspace, len(scene.times)
        if room is None or room.states.shape[1] != samples or len(room.gaps) < 2 * count:
            room = Workspace.of(scene, ROOM[0] + ROOM[1] * self.problem.count + 2 * count)
            self._workspace = room
        return room

    def relaxed(self, scene: Scene, start: Contacts, sides: Sides, bar: float) -> Solution:
        """Return the solution of the local solver, not yet certified."""
        workspace = self.workspace(scene, start.number)
        for column, given in zip(workspace.hand, start, strict=True):
            column[: start.number] = given
        ended, count, energy = solve_local(scene, sides, start.number, bar, workspace)
        kept = workspace.best.first(count)
        return Solution(self.problem, kept, energy, ended != BLOCKED, ended == OPTIMAL)

    def certified(self, solution: Solution, bar: float) -> Solution:
        """Return a solution that the march certifies; conflicts missed by samples become contacts."""
        for turn in range(FINER + 1):
            if not solution.clear or solution.energy > bar:
                return solution
            missed = self.problem.conflicts(solution.trajectories)
            if not missed:
                return solution
            if turn == FINER:
                break
            more = self.problem.met(missed)
            self.scene = self.problem.sampled(self.scene, np.union1d(self.scene.times, more.times))
            start = solution.contacts.joined(self.nearest(solution.trajectories, more))
            solution = self.relaxed(self.aimed(inf, 1.0), start, nearer(self.problem), bar)
        return replace(solution, clear=False, energy=inf)

    def nearest(self, trajectories: Trajectories, contacts: Contacts) -> Contacts:
        """Return the contacts with normals on the sides on which the paths pass."""
        places = self.problem.motions(trajectories, contacts)[:, 0]
        sizes = np.linalg.norm(places, axis=1, keepdims=True)
        return contacts._replace(
            normals=np.where(sizes > 0.0, places, AHEAD) / np.where(sizes > 0.0, sizes, 1.0)
        )

    def proven(self, solution: Solution) -> bool:
        """Return True if no path that is clear at the contact times costs less.

        The solution minimises |d|^2 / 2 subject to |q + d| >= aim at each contact, d in the span of the
        kernel.  Where the multipliers are so weak that the Lagrangian is convex, it is the global optimum of
        this relaxation, and so of the problem.  Only for zones without edges.       # theory 4
        """
        contacts = solution.contacts
        if not (solution.clear and solution.optimal) or contacts.number > LARGE:
            return False
        if not contacts.number:
            return True
        if (self.scene.shapes[self.scene.kinds[contacts.which]] != BALL).any():
            return False
        weight = np.repeat(np.sqrt(contacts.multipliers / self.margin), 3)
        matrix = (1.0 + PROVEN) * np.eye(len(weight)) - weight[:, None] * self.problem.kernel(
            contacts
        ) * weight
        return bool(is_definite(matrix))


def nearer(problem: Problem) -> Sides:
    """Return the rule that places all new contacts on the nearer side."""
    return Sides(np.zeros((len(problem.direct[1]) - 1, 3)), -inf, False)


def shifted(problem: Problem, seed: int, depth: float, size: float) -> Sides:
    """Return the rule that shifts bodies at random for norms below `depth`; even seeds along the motion."""
    shifts = size * directions(seed, len(problem.direct[1]) - 1)
    return Sides(shifts, depth, seed % 2 == 0 and depth >= 1.0)


@lru_cache(maxsize=64)
def directions(seed: int, count: int) -> Floats:
    """Return normally distributed random vectors (count, 3)."""
    return np.random.default_rng(seed).normal(size=(count, 3))
