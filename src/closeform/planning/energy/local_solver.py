"""Certified solutions from contacts: the local solver, until the march finds no conflict."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import inf

import numpy as np

from closeform.arrays import Floats
from closeform.planning.energy.contact_solver import SOFT, Workspace, solve_local
from closeform.planning.energy.quadratic_program import is_definite
from closeform.planning.problem.contacts import Sides
from closeform.planning.problem.problem import Problem, Trajectories
from closeform.planning.problem.scene import Contacts
from closeform.zones.shapes import BALL

SAME = 1e-3  # relative difference of the energies of equal solutions
NOISE = 1e-5  # of the energy: accuracy of a candidate
EXACT = 1e-9  # of windows and normals: accuracy of the contacts of the best solution
POWER = 4.0  # of the norms that round edges
FINER = 3  # maximum rounds with conflicts that samples missed
ROOM = 8, 24  # contacts of a workspace: constant, and for each craft
LARGE = 150  # contacts beyond which convexity is not examined, and which are not settled exactly
PROVEN = 1e-9  # tolerance of the proof
# Least margin about a chief that is not on a circle: under strong thrust the error bound of its table is up
# to 1e-8 of a zone, and nearer paths count as conflicts.
SURE = 1.0 + 1e-7
AHEAD = np.array([1.0, 0.0, 0.0])  # arbitrary side where two craft meet


@dataclass(frozen=True, eq=False)
class Solution:
    """Paths that are certified clear, or not (`clear`), and their contacts.

    A solution that costs more than the given bar is not certified between the samples.  `energy` is the
    energy beyond the unconstrained optima [m^2/s^3], inf if not clear.
    """

    problem: Problem
    contacts: Contacts
    energy: float

    @property
    def clear(self) -> bool:
        """True if the paths are clear."""
        return self.energy < inf

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
            and abs(self.energy - other.energy) <= SAME * self.energy
            and sorted(self.contacts.which.tolist()) == sorted(other.contacts.which.tolist())
        )


class LocalSolver:
    """Solver of one problem from any start, with its zones enlarged by the factor `margin`."""

    def __init__(self, problem: Problem, margin: float) -> None:
        self.problem = problem
        self.margin = margin if problem.beside is None else max(margin, SURE)
        self.scene = problem.seen._replace(aims=np.full(len(problem.zones), self.margin))
        self._workspace: Workspace | None = None

    def solve(self, start: Contacts, sides: Sides, bar: float = inf) -> Solution:
        """Return the lowest-cost certified solution from a start; stop if its energy stays above `bar`.

        Conflicts that the samples have missed become contacts.
        """
        if not start.number and not self.problem.round:
            start = self.on_rounded_sides(sides)
        solution = self.relaxed(start, sides, bar)
        for _ in range(FINER):
            if not solution.clear or solution.energy > bar:
                return solution
            missed = self.problem.conflicts(solution.trajectories)
            if not missed:
                return solution
            more = self.problem.met(missed)
            self.scene = self.problem.sampled(self.scene, np.union1d(self.scene.times, more.times))
            start = solution.contacts.joined(self.nearest(solution.trajectories, more))
            solution = self.relaxed(start, nearer(self.problem), bar)
        return replace(solution, energy=inf)

    def on_rounded_sides(self, sides: Sides) -> Contacts:
        """Return the contacts of paths around zones whose edges are rounded, to choose sides."""
        exact, edged = self.scene, self.scene.shapes != BALL
        powers, sizes = np.where(edged, POWER, inf), np.where(edged, 2.0 ** (1.0 / POWER), 1.0)
        self.scene = exact._replace(powers=powers, aims=sizes * exact.aims)
        contacts = self.relaxed(Contacts.none(), sides, inf).contacts
        self.scene = exact
        return contacts

    def settled(self, solution: Solution) -> Solution:
        """Return a certified solution with its contacts at the closest approaches, where these settle.

        A crowd has none of the proofs that need exact contacts, which save a millionth of its cost.
        """
        if solution.contacts.number > LARGE:
            return solution
        exact = self.relaxed(solution.contacts, nearer(self.problem), inf, 0.0, EXACT)
        as_cheap = exact.energy <= (1.0 + NOISE) * solution.energy
        return exact if as_cheap and not self.problem.conflicts(exact.trajectories) else solution

    def relaxed(
        self, start: Contacts, sides: Sides, bar: float, soft: float = SOFT, accuracy: float = inf
    ) -> Solution:
        """Return the solution of the local solver, not yet certified."""
        room, samples = self._workspace, len(self.scene.times)
        if room is None or room.samples.states.shape[1] != samples or len(room.gaps) < 2 * start.number:
            room = Workspace.of(self.scene, ROOM[0] + ROOM[1] * self.problem.count + 2 * start.number)
            self._workspace = room
        for column, given in zip(room.hand, start, strict=True):
            column[: start.number] = given
        count, energy = solve_local(self.scene, sides, start.number, bar, soft, accuracy, room)
        return Solution(self.problem, room.best.first(count), energy)

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
        if not solution.clear or contacts.number > LARGE:
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
