"""Certified lower bounds on the cost of all clear plans, by branch and bound over sides.

A sample is a pair at a time, perhaps after a loss of thrust.  At any sample, every clear plan has the pair in
one of the pieces that cover the outside of its zone.  A node contains samples, each in a piece.  Its bound
holds for all plans of the node, so the smallest bound of the open nodes holds for all plans.  The node of
smallest bound is opened next:

    the bound's own paths are in conflict at another time         ->  the same node with samples there
    a sample has a shortfall, its pair inside the zone on average ->  a node for each of its pieces
    neither                                                       ->  a start for a local solver

until no node is left whose bound is below the goal.                                           # theory 4

A `Bound` is that of one cost: `EnergyBound` or `ImpulseBound`.  Any thrust is a measure of impulses, so the
second holds for burns and pulses too.  A requirement that a bound omits makes it lower, but not wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf
from time import perf_counter
from typing import Any, NamedTuple, Protocol

import numpy as np

from closeform.arrays import Floats
from closeform.planning.bounds.zone_pieces import Piece, outside, pieces
from closeform.planning.plan import Contact, Cost, gap
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import Contacts

GAP = 1e-3  # of the lower bound: gap at which a proof ends by default
SPARE = 0.999  # of the gap, for rounding
PROVEN = 1e-6  # of the energy: gap of rounding
FINER = 1e-3  # factor of the tolerances of conflicts where no piece can be cut


class Samples:
    """Pairs at times as `contacts`, and ellipsoids |insides q| <= 1 (K, 3, 3) in their keep-out regions."""

    def __init__(self, problem: Problem, contacts: Contacts) -> None:
        self.problem, self.contacts, self.insides = problem, Contacts.none(), np.empty((0, 3, 3))
        self.add(contacts)

    @classmethod
    def of_plan(cls, problem: Problem, contacts: Sequence[Contact]) -> "Samples":
        """Return samples at the contacts of a plan, with its normals and multipliers there."""
        found = problem.touched(contacts)
        metres = problem.bare.matrices[problem.kinds[found.which]].transpose(0, 2, 1)
        pushes = np.array([one.normal for one in contacts]).reshape(-1, 3)
        pushes[[one.first > one.second for one in contacts]] *= -1.0
        extents = np.array([one.reach + problem.sigmas * one.sigma for one in contacts])
        normals = np.linalg.solve(metres, pushes[:, :, None])[..., 0] / extents[:, None]
        multipliers = extents * [one.multiplier for one in contacts]
        return cls(problem, found._replace(normals=normals, multipliers=multipliers))

    def zone(self, sample: int) -> Any:
        """Return the zone of a sample's pair."""
        return self.problem.zones[self.problem.kinds[self.contacts.which[sample]]]

    def add(self, contacts: Contacts) -> None:
        """Add samples at contacts, moved into the windows of their pairs."""
        inside = np.clip(contacts.times, *self.problem.windows[0][contacts.which].T)
        times = np.where(contacts.drifts.any(axis=1), contacts.times, inside)
        fresh = contacts._replace(times=times)
        self.contacts = self.contacts.joined(fresh)
        self.insides = np.concatenate([self.insides, self.problem.insides(fresh)])

    def near(self, contact: Contacts, same: float) -> int:
        """Return the number of the sample near a contact, within `same` of all time; add one if missing."""
        known = self.contacts
        alike = (known.which == contact.which) & ((known.drifts > 0.0) == (contact.drifts > 0.0)).all(axis=1)
        apart = np.abs(np.column_stack([known.times - contact.times, known.drifts - contact.drifts]))
        apart = np.where(alike, apart.max(axis=1), inf)
        if apart.min(initial=inf) > same * (self.problem.last - self.problem.first):
            self.add(contact)
            return self.contacts.number - 1
        return int(apart.argmin())

    def outside(self, sample: int) -> Piece:
        """Return all possible positions of a sample's pair as one piece."""
        return outside(self.zone(sample), self.insides[sample])

    def parts(self, sample: int, piece: Piece) -> list[Piece]:
        """Return smaller pieces of a sample that together cover a piece."""
        if not piece.whole:
            return piece.halves()
        compliance = self.problem.kernel(self.contacts.some([sample]))
        return pieces(self.zone(sample), self.insides[sample], compliance)


@dataclass(frozen=True, eq=False)
class Answer:
    """Lower bound on all plans of a node, and the paths of the bound as `found`.

    `short` (K,) are shortfalls of the node's samples: the largest is cut first, and none below 0.  `idle`
    (K,) is True for samples that hardly raise the bound.  If `settled`, other times are examined first.
    """

    bound: float
    short: Floats
    idle: Any
    settled: bool
    found: Any


class Node(NamedTuple):
    """Samples by number, each in a piece of its zone's outside; queued by bound, then by order."""

    bound: float
    order: int
    samples: list[int]
    pieces: list[Piece]
    answer: Answer


class Bound(Protocol):
    """Lower bound of one cost."""

    samples: Samples
    same: float  # of all time: samples that are merged
    until: float  # value of `perf_counter` from which bounds are not refined

    def solve(
        self, samples: list[int], cut: list[Piece], goal: float, parent: Answer | None
    ) -> Answer | None:
        """Return the answer of samples in pieces, as accurate as `goal` requires.

        None without any: the bound of the parent then holds, and the node is not opened.
        """

    def conflicts(self, node: Node, fine: float) -> Contacts:
        """Return conflicts of a node's paths, with normals, at `fine` times the usual tolerance."""

    def better(self, node: Node, cost: float) -> tuple[float, Any] | None:
        """Return a clear plan on the sides of a node that costs less than `cost`, and its cost; else None."""


class Proof(NamedTuple):
    """Certified lower bound, and a plan of lower cost if one was found.

    If `exhausted`, no sides are left whose bound could rise.
    """

    bound: float
    nodes: int
    better: Any = None
    exhausted: bool = False


def prove(
    bound: Bound, cost: float, least: float, seconds: float, *, gap: float = GAP, nodes: int = 1_000_000
) -> Proof:
    """Return the lower bound of all clear plans, of which one costs `cost` and none less than `least`.

    The search raises it for the given seconds, or nodes, until the optimality gap is at most `gap`.
    """
    bound.until = perf_counter() + seconds
    search = _Search(bound, cost, SPARE * gap / (1.0 + gap))
    while search.queue and search.nodes < nodes and perf_counter() < bound.until:
        search.open(heappop(search.queue))
    return Proof(min(max(least, search.bound), search.cost), search.nodes, search.better, not search.queue)


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
    """Open nodes of branch and bound, and the lowest cost of a plan so far."""

    def __init__(self, bound: Bound, cost: float, share: float) -> None:
        self.of, self.cost, self.share = bound, cost, share
        self.better: Any = None
        self.nodes = 0
        self.queue: list[Node] = []
        self.least = inf  # bound of the nodes that cannot be opened
        every = list(range(bound.samples.contacts.number))
        self.examine(None, every, [bound.samples.outside(k) for k in every])

    @property
    def goal(self) -> float:
        """Bound at which a node is closed."""
        return self.cost * (1.0 - self.share)

    @property
    def bound(self) -> float:
        """Lower bound of all plans."""
        return min(self.goal, self.least, self.queue[0].bound if self.queue else inf)

    def examine(self, parent: Node | None, samples: list[int], cut: list[Piece]) -> None:
        """Queue a child of a node, unless the child's own bound reaches the goal."""
        self.nodes += 1
        before = 0.0 if parent is None else parent.bound
        answer = self.of.solve(samples, cut, self.goal, None if parent is None else parent.answer)
        if answer is None:
            self.least = min(self.least, before)
        elif max(before, answer.bound) < self.goal:
            heappush(self.queue, Node(max(before, answer.bound), self.nodes, samples, cut, answer))

    def open(self, node: Node) -> None:
        """Branch on the sample with the largest shortfall; if all are small, add samples at conflicts."""
        if node.answer.settled and node.bound < self.goal:
            if self.at_conflicts(node, 1.0):
                return
            better = self.of.better(node, self.cost)
            if better is not None:
                self.cost, self.better = better
        if node.bound >= self.goal:
            return
        short = node.answer.short
        choices = [k for k, piece in enumerate(node.pieces) if piece.can_be_cut and short[k] >= 0.0]
        if not any(short[k] for k in choices) and self.at_conflicts(node, FINER):
            return
        if not choices:
            self.least = min(self.least, node.bound)
            return
        chosen = max(choices, key=lambda k: short[k])
        kept = [k for k in range(len(short)) if k == chosen or not node.answer.idle[k]]
        for part in self.of.samples.parts(node.samples[chosen], node.pieces[chosen]):
            cut = [part if k == chosen else node.pieces[k] for k in kept]
            self.examine(node, [node.samples[k] for k in kept], cut)

    def at_conflicts(self, node: Node, fine: float) -> bool:
        """Queue the node with samples at conflicts of the bound's paths; return whether there are any."""
        samples, met = self.of.samples, self.of.conflicts(node, fine)
        found = [samples.near(met.some([k]), self.of.same * fine) for k in range(met.number)]
        fresh = [number for number in dict.fromkeys(found) if number not in node.samples]
        if fresh:
            everywhere = [samples.outside(number) for number in fresh]
            self.examine(node, node.samples + fresh, node.pieces + everywhere)
        return bool(fresh)
