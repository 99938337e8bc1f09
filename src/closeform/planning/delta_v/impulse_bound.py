"""Lower bound on the delta-v of all clear plans: the dual program of planes that bound a node's pieces.

Any thrust is a measure of impulses, so the bound holds for burns within limits and for pulses as well.
Planes of requirements on states hold for all plans.  They are added where the bound's paths leave a
requirement.
"""

from collections.abc import Sequence
from math import inf
from time import perf_counter
from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START
from closeform.planning.bounds.branch_and_bound import Answer, Node, Samples
from closeform.planning.bounds.zone_pieces import Piece
from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.dual.fleet import Fleet, Priced
from closeform.planning.delta_v.firing_times import Moments
from closeform.planning.delta_v.impulse_solver import LAST, ImpulseSolver
from closeform.planning.plan import Contact
from closeform.planning.problem.problem import Trajectories, deepest
from closeform.planning.problem.scene import Contacts
from closeform.zones.zone import scaled_norm

PRICINGS = 3  # rounds that add firing times at the maxima of primers
FINER = 6  # factor of the firing times where few allow no impulses
SHORT = 1e-3  # level of primers above 1 that is not reduced further
UNPRICED = 0.01  # of the largest multiplier: weight of samples that the plan does not touch
INSIDE = 1e-4  # of a zone: a pair that is deeper inside is not clear
GAINED = 1e-4  # of the delta-v: smaller rises of a bound do not pay for more planes of requirements
FELT = 1e-3  # of the largest multiplier of these planes: planes below it are dropped
OUTSIDE = 1.0  # reserves: shortfall of requirements beyond rounding of the bound


class Found(NamedTuple):
    """Planes of a node, the samples and pieces that they bound, and the bound's paths.

    Impulses of the paths `wide` are brief burns, amid which thrust may be lost.
    """

    held: list[tuple[int, Piece]]
    planes: Contacts
    trajectories: Trajectories
    wide: Trajectories


class ImpulseBound:
    """Lower bound on the delta-v [m/s] of all clear plans of a solver's problem, from the contacts of one.

    `plans` solves for plans of lower cost, if it is given.
    """

    same, until = 0.0, inf

    def __init__(
        self, solver: ImpulseSolver, contacts: Sequence[Contact], plans: ImpulseSolver | None = None
    ) -> None:
        self.solver, self.plans = solver, plans
        self.problem, self.failures = solver.problem, solver.failures
        self.samples = Samples.of_plan(self.problem, contacts)
        base, counts = self.problem.base, solver.pushes.counts
        fine = FINER * len(solver.grid[0].times)
        times = self.problem.orbit._spaced(base[:, START], base[:, END], fine)
        self.finer = solver.requirements.allowed(list(map(Moments.every, times, counts)))

    def solve(
        self, samples: list[int], cut: list[Piece], goal: float, parent: Answer | None
    ) -> Answer | None:
        """Return the answer of samples in pieces, None for planes that contradict each other.

        The shortfall of a sample is its depth in the zone, if a smaller piece would exclude it, times its
        multiplier in the plan: to first order, what the cost depends on.
        """
        held = [(k, piece) for k, piece in zip(samples, cut, strict=True) if not piece.whole]
        if parent is not None and held == parent.found.held:  # a piece that is whole has no plane
            bound, found = parent.bound, parent.found
        else:
            planes = self.samples.contacts.some([k for k, _ in held])
            normals = [piece.normal / piece.floor for _, piece in held if piece.normal is not None]
            planes = planes._replace(normals=np.array(normals).reshape(-1, 3))
            answer = self.minimum(planes, goal)
            if answer is None:
                return None
            bound, paths = answer
            found = Found(held, planes, paths, self.failures.brief(paths) if self.failures else paths)
        places = self.problem.motions(found.wide, self.samples.contacts.some(samples))[:, 0]
        short = np.array([self.depth(*one) for one in zip(samples, cut, places, strict=True)]) - INSIDE
        priced = self.samples.contacts.multipliers
        short *= UNPRICED + priced[samples] / max(priced.max(initial=0.0), np.finfo(float).tiny)
        return Answer(bound, short, np.zeros(len(samples), dtype=bool), not (short >= 0.0).any(), found)

    def depth(self, sample: int, piece: Piece, place: Floats) -> float:
        """Return how deep a place is in its zone; below 0 outside, or where no smaller piece excludes it."""
        if not piece.can_be_cut:
            return -1.0
        exact = piece.exact or not piece.whole
        zone = self.samples.zone(sample)
        return 1.0 - float(np.linalg.norm(piece.rows @ place) if exact else scaled_norm(zone, place))

    def minimum(self, planes: Contacts, goal: float) -> tuple[float, Trajectories] | None:
        """Return the bound of planes and its paths, with planes of requirements as far as these raise it."""
        solver, before = self.solver, -np.inf
        while True:
            answer = self.priced(planes, goal)
            if answer is None:
                return None
            fleet, found = answer
            trajectories, bound = solver.trajectories(fleet, found.impulses), max(before, found.least)
            raised = bound - before >= GAINED * goal and perf_counter() < self.until
            if not self.problem.requirements or bound >= goal or not raised:
                return bound, trajectories
            required = self.problem.requirement_checks(trajectories)
            if not any(one.shortfall > OUTSIDE for one in required):
                return bound, trajectories
            solver.requirements.add(required)
            before = bound

    def priced(self, planes: Contacts, goal: float) -> tuple[Fleet, Priced] | None:
        """Return the solution for planes, with firing times added until it is accurate or at the goal."""
        solver, best, last = self.solver, 0.0, None
        solver.requirements.inward = 0.0  # of the requirements themselves, without reserve
        moments = list(map(Moments.joined, solver.grid, solver.requirements.moments(solver.pushes.counts)))
        every = solver.planes(planes, 1.0)
        for turn in range(PRICINGS):
            fleet = solver.fleet(moments)
            found = solver.priced(fleet, every, LAST, np.inf)
            if found is None:  # contradictory for impulses at these times
                if turn > 0:
                    break
                moments = self.finer
                continue
            best = max(best, found.least)
            last = fleet, found._replace(least=best)
            if best >= goal or found.longest <= 1.0 + SHORT or perf_counter() > self.until:
                break
            moments = list(map(Moments.joined, moments, found.peaks))
        if last is not None:
            solver.requirements.keep(last[1].multipliers[planes.number :], FELT)
        return last

    def conflicts(self, node: Node, fine: float) -> Contacts:
        """Return the deepest conflict of a node's paths; if there is none, those after a loss of thrust."""
        problem, found = self.problem, node.answer.found
        met = problem.conflicts(found.trajectories)
        if met and deepest(met)[1][3] < 1.0 - INSIDE:
            at = problem.met([deepest(met)])
        elif self.failures is not None:
            at, _ = self.failures.near(found.trajectories, Contacts.none())
            zones = [problem.zones[kind] for kind in problem.kinds[at.which]]
            places = problem.motions(found.wide, at)[:, 0]
            norms = np.array([scaled_norm(*one) for one in zip(zones, places, strict=True)])
            at = at.some(norms < 1.0 - INSIDE)
        else:
            return Contacts.none()
        return at._replace(normals=problem.normals(found.wide, at, -np.inf))

    def better(self, node: Node, cost: float) -> tuple[float, Spent] | None:
        """Return clear paths on the sides of a node that cost less; None without any."""
        if self.plans is None:
            return None
        self.plans.requirements.inward = 1.0
        found = self.plans.solve(node.answer.found.planes, cost)
        return (found.cost, found) if found is not None and found.cost < cost else None
