"""Certified lower bounds of all clear plans: from a plan's contacts, and by branch and bound over sides.

A node of the search contains samples (a pair at a time), and for each a piece of its zone's outside.  The
dual bound holds for all plans of a node, so the smallest bound of the open nodes holds for all plans.  The
node of smallest bound is opened next:

    a sample has a shortfall, its pair inside the zone on average ->  a node for each of its pieces
    the bound's own paths are in conflict at another time         ->  the same node with samples there
    neither                                                       ->  a start for the local solver

until no node is left whose bound is below the goal.                                           # theory 4
"""

from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf
from time import perf_counter
from typing import NamedTuple

import numpy as np

from closeform.planning.bounds.bound_samples import Answer, Samples
from closeform.planning.bounds.zone_pieces import Piece, outside, pieces
from closeform.planning.energy.local_solver import LocalSolver, Solution, nearer
from closeform.planning.energy.side_search import MARGINS
from closeform.planning.plan import Contact, Cost, gap
from closeform.planning.problem.problem import Problem

GAP = 1e-3  # of the lower bound: gap at which a proof ends by default
SPARE = 0.999  # of the gap, for rounding
PROVEN = 1e-6  # of the energy: gap of rounding
NEARLY = 0.05  # accuracy of a node's bound, of the bound or of what it lacks
LARGEST = 80  # maximum connected contacts of a bound
FEW, HOPEFUL = 24, 0.05  # more contacts only where FEW give this share of the extra energy
SETTLED = 0.02  # of a node's bound: shortfall of its samples below which other times are examined
DEEP, SAME = 1e-3, 5e-3  # of the zone: tolerated conflict; of all time: samples that are merged
FINER = 1e-3  # factor of both where no piece can be cut
IDLE = 1e-3  # of the largest work: samples below it are dropped in child nodes
STARTS = 50  # nodes for each start that is solved


@dataclass(frozen=True, eq=False)
class Proof:
    """Certified lower bound on the energy beyond the unconstrained optima [m^2/s^3].

    `better` is a plan of lower cost, if one was found on the way.
    """

    bound: float
    nodes: int
    better: Solution | None


class Node(NamedTuple):
    """Samples by number, each in a piece of its zone's outside; queued by bound, then by order."""

    bound: float
    order: int
    samples: list[int]
    pieces: list[Piece]
    answer: Answer


def lower_bound(problem: Problem, contacts: Sequence[Contact], extra: float | None = None) -> float:
    """Return a lower bound of every clear plan's energy beyond the unconstrained optima.

    It is computed from the contacts of one plan; `extra` is that plan's extra energy, if known.
    """
    total, groups = 0.0, _apart(problem, contacts)
    for group in groups:
        strongest = sorted(group, key=lambda contact: -contact.multiplier)[:LARGEST]
        energy = extra if len(groups) == 1 else None
        if energy is not None and len(strongest) > FEW:
            few = strongest[:FEW]
            if _bound(problem, few) <= HOPEFUL * energy:  # e.g. failures that touch over a range of times
                strongest = few
        total += max(_bound(problem, strongest, energy if len(strongest) == len(contacts) else None), 0.0)
    return total


def prove(
    problem: Problem,
    contacts: Sequence[Contact],
    extra: float,
    energy: float,
    seconds: float,
    *,
    gap: float = GAP,
    nodes: int = 1_000_000,
    fixed: bool = False,
) -> Proof:
    """Return the bound of a plan of `energy`, `extra` of it beyond the unconstrained optima [m^2/s^3].

    The search raises it for the given seconds, or nodes, until the optimality gap is at most `gap`; with
    `fixed` it does not look for a plan of lower cost.
    """
    bound, left = lower_bound(problem, contacts, extra), SPARE * gap / (1.0 + gap)
    if seconds == 0.0 or extra - bound <= left * energy:
        return Proof(min(bound, extra), 0, None)
    search = _Search(problem, _samples(problem, contacts), extra, energy - extra, left, fixed)
    over = perf_counter() + seconds
    while search.queue and search.nodes < nodes and perf_counter() < over:
        search.open(heappop(search.queue))
    return Proof(min(max(bound, search.bound), search.extra), search.nodes, search.better)


def is_proven(energy: float, bound: float) -> bool:
    """Return whether an energy equals its lower bound to rounding."""
    return energy - bound <= PROVEN * energy


def closeness(spent: float, bound: float, cost: Cost = "energy", limited: bool = False) -> str:
    """Return a description of the optimality gap; if `limited`, the bound holds only within a limit."""
    of = f"{cost} within the limit, for" if limited else f"{cost} for"
    if is_proven(spent, bound):
        return f"proven minimum {of} these ends and times"
    if not bound > 0.0:
        return f"compared with a {cost} of 0 without obstacles"
    return f"at most {100.0 * gap(spent, bound):.2g} % above the minimum {of} these ends and times"


class _Search:
    """Open nodes of branch and bound, and the lowest-cost plan so far."""

    def __init__(
        self, problem: Problem, samples: Samples, extra: float, free: float, left: float, fixed: bool
    ) -> None:
        self.samples = samples
        self.extra, self.free, self.left, self.fixed = extra, free, left, fixed
        self.solver = LocalSolver(problem, MARGINS[0])
        self.better: Solution | None = None
        self.nodes = self.starts = 0
        self.queue: list[Node] = []
        self.least = inf  # bound of the nodes that cannot be opened
        self.examine(0.0, list(range(samples.contacts.number)), [outside(zone) for zone in samples.zones])

    @property
    def goal(self) -> float:
        """Bound at which a node is closed."""
        return self.extra - self.left * (self.free + self.extra)

    @property
    def bound(self) -> float:
        """Lower bound of all plans."""
        return min(self.goal, self.least, self.queue[0].bound if self.queue else inf)

    def examine(self, bound: float, samples: list[int], cut: list[Piece]) -> None:
        """Queue a child of a node with the given bound, unless the child's own bound reaches the goal."""
        self.nodes += 1
        answer = self.samples.answer(samples, cut, self.goal, NEARLY)
        bound = max(bound, answer.bound)
        if bound < self.goal:
            heappush(self.queue, Node(bound, self.nodes, samples, cut, answer))

    def open(self, node: Node) -> None:
        """Branch on the sample with the largest shortfall; if all are small, add samples at conflicts."""
        if node.bound >= self.goal:
            return
        short = node.answer.short
        if short.sum() < SETTLED * max(node.bound, self.goal - node.bound):
            if self.at_conflicts(node, 1.0):
                return
            self.start(node)
            if node.bound >= self.goal:
                return
        choices = [k for k in range(len(short)) if node.pieces[k].can_be_cut]
        if not choices:
            if not self.at_conflicts(node, FINER):
                self.least = min(self.least, node.bound)
            return
        k = max(choices, key=lambda k: short[k])
        work = np.abs(np.einsum("ki,ki->k", node.answer.forces, node.answer.reached))
        keep = [
            m for m in range(len(short)) if m == k or not node.pieces[m].whole or work[m] > IDLE * work.max()
        ]
        number = node.samples[k]
        if node.pieces[k].whole:
            smaller = pieces(self.samples.zones[number], self.samples.compliance(number))
        else:
            smaller = node.pieces[k].halves()
        for piece in smaller:
            cut = [piece if m == k else node.pieces[m] for m in keep]
            self.examine(node.bound, [node.samples[m] for m in keep], cut)

    def at_conflicts(self, node: Node, fine: float) -> bool:
        """Queue the node with samples at conflicts of the bound's paths; return whether there are any."""
        problem = self.samples.problem
        trajectories = problem.trajectories(self.samples.pushed(node.samples, node.answer.forces))
        found = [
            self.samples.near(problem.index[pair], row[2], SAME * fine)
            for pair, row in problem.conflicts(trajectories)
            if row[3] < 1.0 - DEEP * fine
        ]
        fresh = [number for number in dict.fromkeys(found) if number not in node.samples]
        if fresh:
            everywhere = [outside(self.samples.zones[number]) for number in fresh]
            self.examine(node.bound, node.samples + fresh, node.pieces + everywhere)
        return bool(fresh)

    def start(self, node: Node) -> None:
        """Solve for a plan on the sides of a node, which lowers the goal if it is cheaper than the best."""
        if self.fixed or self.starts * STARTS > self.nodes:
            return
        self.starts += 1
        problem = self.solver.problem
        contacts = self.samples.pushed(node.samples, node.answer.forces)
        solution = self.solver.solve(contacts, nearer(problem), self.extra)
        if solution.clear and solution.energy < self.extra:
            self.extra, self.better = solution.energy, solution


def _bound(problem: Problem, contacts: Sequence[Contact], energy: float | None = None) -> float:
    """Return the dual bound of the given contacts; `energy` is that of their multipliers, if known."""
    samples = _samples(problem, contacts)
    if not samples.gram.diagonal().max() > 0.0:  # contacts at the ends of their craft's time
        return 0.0
    return samples.bound(contacts, energy)


def _samples(problem: Problem, contacts: Sequence[Contact]) -> Samples:
    """Return samples at the contacts of a plan."""
    touched = problem.touched(contacts)
    return Samples(problem, touched.which, touched.times, touched.drifts)


def _apart(problem: Problem, contacts: Sequence[Contact]) -> list[list[Contact]]:
    """Return the contacts in groups without common craft; obstacles do not connect groups."""
    label = list(range(problem.count))
    for contact in contacts:
        if max(contact.first, contact.second) < problem.count:
            one, other = label[contact.first], label[contact.second]
            if one != other:
                label = [one if mine == other else mine for mine in label]
    groups: dict[int, list[Contact]] = {}
    for contact in contacts:
        groups.setdefault(label[min(contact.first, contact.second)], []).append(contact)
    return list(groups.values())
