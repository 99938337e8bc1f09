"""Lower bound on the delta-v of all clear plans, by branch and bound over pieces of the zones' outsides.

At any time, every clear plan has each pair in one of the pieces that cover the outside of its zone, and in
each piece a plane bounds the relative position.  A node contains pairs at times, each in a piece; the dual
program of its planes bounds the delta-v of all plans of the node.  The smallest bound of the open nodes
therefore holds for all plans.  The node of smallest bound is opened next:

    its own paths leave a requirement                     ->  the same node with the planes there
    its own paths are inside a zone at one of its times   ->  a node for each half of that piece
    they are in conflict at another time                  ->  a node for each piece at that time
    neither                                               ->  a clear plan, perhaps of lowest cost

until no node is left whose bound is below the goal.
"""

from heapq import heappop, heappush
from math import inf
from time import perf_counter
from typing import NamedTuple

import numpy as np

from closeform.motion.arc import END, START
from closeform.planning.bounds.zone_pieces import Piece, pieces
from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.firing_times import Moments
from closeform.planning.delta_v.impulse_solver import LAST, ImpulseSolver
from closeform.planning.problem.problem import Trajectories, deepest
from closeform.planning.problem.scene import Contacts
from closeform.zones.zone import scaled_norm

SPARE = 0.999  # of the gap, for rounding
PRICINGS = 3  # rounds that add firing times at the maxima of primers
FINER = 6  # factor of the firing times where few allow no impulses
SHORT = 1e-3  # level of primers above 1 that is not reduced further
INSIDE = 1e-4  # of a zone: a pair that is deeper inside is not clear
GAINED = 1e-4  # of the delta-v: smaller rises of a bound do not pay for more planes of requirements
FELT = 1e-3  # of the largest multiplier of these planes: planes below it are dropped
OUTSIDE = 1.0  # reserves: shortfall of requirements beyond rounding of the bound


class Node(NamedTuple):
    """Pairs at times, each in a piece of its zone's outside, and the paths of its bound [m/s].

    `tight` is True if more planes of requirements no longer raise the bound.
    """

    bound: float
    order: int
    contacts: Contacts
    held: tuple[Piece, ...]
    trajectories: Trajectories
    tight: bool


class DeltaVProof:
    """Branch and bound for one problem of impulses; `bound` [m/s] holds for all clear plans."""

    def __init__(self, solver: ImpulseSolver, spent: float, gap: float) -> None:
        self.solver, self.spent, self.gap = solver, spent, gap
        self.better: Spent | None = None
        self.queue: list[Node] = []
        self.nodes = 0
        self.least = inf  # bound of the nodes that cannot be opened
        base, counts = solver.problem.base, solver.pushes.counts
        fine = FINER * len(solver.grid[0].times)
        times = solver.problem.orbit._spaced(base[:, START], base[:, END], fine)
        self.finer = solver.requirements.allowed(list(map(Moments.every, times, counts)))
        self.examine(Contacts.none(), (), 0.0)

    @property
    def goal(self) -> float:
        """Bound [m/s] at which a node is closed."""
        return self.spent * (1.0 - SPARE * self.gap / (1.0 + self.gap))

    @property
    def bound(self) -> float:
        """Lower bound [m/s] of all plans."""
        return min(self.goal, self.least, self.queue[0].bound if self.queue else inf)

    def run(self, seconds: float) -> None:
        """Open nodes until none is below the goal, or the time is over."""
        over = perf_counter() + seconds
        while self.queue and self.queue[0].bound < self.goal and perf_counter() < over:
            self.open(heappop(self.queue))

    def examine(
        self, contacts: Contacts, held: tuple[Piece, ...], before: float, tightened: bool = False
    ) -> None:
        """Queue a node whose parent has the bound `before`, unless its own reaches the goal."""
        self.nodes += 1
        solver, bound, found = self.solver, before, None
        moments = list(map(Moments.joined, solver.grid, solver.requirements.moments(solver.pushes.counts)))
        solver.requirements.inward = 0.0  # of the requirements themselves, without reserve
        planes = solver.planes(contacts, 1.0)
        for turn in range(PRICINGS):
            fleet = solver.fleet(moments)
            found = solver.priced(fleet, planes, LAST, inf)
            if found is None and turn == 0:  # contradictory for impulses at few times
                moments = self.finer
                continue
            if found is None:  # nothing is proven beyond the parent's bound
                self.least = min(self.least, bound)
                return
            bound = max(bound, found.least)
            if bound >= self.goal:
                return
            if found.longest <= 1.0 + SHORT:
                break
            moments = list(map(Moments.joined, moments, found.peaks))
        assert found is not None
        solver.requirements.keep(found.multipliers[contacts.number :], FELT)
        trajectories = solver.trajectories(fleet, found.impulses)
        tight = tightened and bound - before < GAINED * self.spent
        heappush(self.queue, Node(bound, self.nodes, contacts, held, trajectories, tight))

    def open(self, node: Node) -> None:
        """Branch on the pair that is deepest inside its zone, at a time of the node or at another one.

        Where the node's paths leave a requirement, its planes there hold for all plans, and tighten the node.
        """
        problem, depth, which = self.solver.problem, INSIDE, -1
        required = [] if node.tight else problem.requirement_checks(node.trajectories)
        if any(one.shortfall > OUTSIDE for one in required):
            self.solver.requirements.add(required)
            self.examine(node.contacts, node.held, node.bound, tightened=True)
            return
        places = problem.motions(node.trajectories, node.contacts)[:, 0]
        for k, (place, piece) in enumerate(zip(places, node.held, strict=True)):
            zone = problem.zones[problem.kinds[node.contacts.which[k]]]
            short = 1.0 - float(scaled_norm(zone, place))
            if short > depth and piece.can_be_cut:
                depth, which = short, k
        met = problem.conflicts(node.trajectories)
        if which < 0 and (not met or deepest(met)[1][3] > 1.0 - INSIDE):
            self.finish(node)
        elif which < 0:
            fresh = problem.met([deepest(met)])
            zone = problem.zones[problem.kinds[fresh.which[0]]]
            for piece in pieces(zone, problem.kernel(fresh)):
                self.examine(node.contacts.joined(placed(fresh, piece)), (*node.held, piece), node.bound)
        else:
            rest = np.arange(node.contacts.number) != which
            kept = tuple(piece for k, piece in enumerate(node.held) if k != which)
            for half in node.held[which].halves():
                own = placed(node.contacts.some([which]), half)
                self.examine(node.contacts.some(rest).joined(own), (*kept, half), node.bound)

    def finish(self, node: Node) -> None:
        """Close a node whose own paths are clear; keep them if they are cheaper than the plan."""
        self.least = min(self.least, node.bound)
        solver = self.solver
        solver.requirements.inward = 1.0
        found = solver.solve(node.contacts, self.spent)
        if found is not None and found.delta_v < self.spent:
            self.spent, self.better = found.delta_v, found


def placed(contacts: Contacts, piece: Piece) -> Contacts:
    """Return one contact with the plane of a piece."""
    assert piece.normal is not None
    return contacts._replace(normals=(piece.normal / piece.floor)[None])
