"""Search over passing sides: the side of every zone on which the paths pass, and the stopping rules."""

import heapq
from dataclasses import dataclass
from itertools import count
from math import inf
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.planning.energy.exit_directions import exit_normals
from closeform.planning.energy.local_solver import LocalSolver, Solution, shifted
from closeform.planning.problem.contacts import Sides
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import Contacts

MARGINS = (1.0 + 1e-9, 1.001, 1.02)  # factors of the zones: smallest certifiable one, then larger ones
DEEP, SHIFT, FAR = 0.3, 0.3, 1.0  # norm below which new sides are chosen by shifts; sizes of shifts
FEW = 6  # pairs in contact up to which every exit of a contact is examined
BUDGETS = ((FEW, 192), (12, 20), (30, 8), (80, 4), (200, 2))  # (pairs, maximum candidates); else one
PATIENCE_ONE, PATIENCE_FEW, PATIENCE_MANY = 45, 24, 4  # candidates without a better one that end the search
EDGED = 3  # factor of the candidates where zones have edges, with many local optima
MORE = 24  # additional candidates where none is clear
SIMILAR = 1e-5  # relative saving by which a solution counts as better
DRAWN = 4  # every DRAWN-th candidate begins with random sides, for diversity
ALIKE = 0.1  # of the window and of a normal: closer starts are examined once
ANOTHER = -0.5  # cosine of the angle between two normals below which they are different sides


@dataclass(frozen=True, eq=False)
class Found:
    """Result of the search: the best solution, or the first one where none is clear.

    `margin` is the factor by which the zones were enlarged; `tried` candidates were examined.
    """

    best: Solution
    margin: float
    tried: int


class Search:
    """Search with the best solution so far, and a queue of starts ranked by estimated cost."""

    def __init__(
        self, problem: Problem, margin: float, budget: int | None = None, more: bool = False
    ) -> None:
        """Set up a search of at most `budget` candidates; the default depends on the pairs in contact."""
        self.problem = problem
        self.solver = LocalSolver(problem, margin)
        self.budget = budget
        self.more = more
        self.tried = 0
        self.drawn = 0
        self.best: Solution | None = None
        self.proven = False
        self.seen: list[Solution] = []
        self.unranked: list[Solution] = []  # whose other sides are not in the queue yet
        self.queue: list[tuple[float, int, Contacts, int, Floats]] = []  # cost, order, arguments of `turned`
        self.order = count()
        self.starts: set[Any] = set()
        self.alone = False  # one conflict: every exit is examined
        self.first: Solution | None = None
        self.nearby = shifted(problem, 0, DEEP, SHIFT)

    def run(self) -> Found:
        """Examine candidates until one is proven, none is left, or the budget is spent."""
        conflicts = self.problem.direct_conflicts(self.solver.margin)
        self.alone = len(conflicts) == 1
        if self.alone:
            self.push_exits(*conflicts[0])
            pairs, few = 1, True
        else:
            root = self.examine(Contacts.none(), self.nearby)
            pairs = len(np.unique(root.contacts.which))
            few = pairs <= FEW
            for pair, conflict in conflicts if few else ():
                self.push_exits(pair, conflict)
        budget, patience = self.allowed(pairs)
        improved = self.tried
        while self.tried < budget and not self.proven:
            if self.best is not None and self.tried - improved >= patience:
                break
            before = self.best
            while self.unranked:
                self.push_turns(self.unranked.pop())
            if self.queue and (self.alone or self.tried % DRAWN):
                _, _, contacts, k, side = heapq.heappop(self.queue)
                if self.is_new(start := turned(contacts, k, side)):
                    self.examine(start, self.nearby)
            elif self.best is not None and (self.alone or (few and not self.queue)):
                break
            else:
                self.drawn += 1
                self.examine(Contacts.none(), shifted(self.problem, self.drawn, 1.0, FAR))
            improved = improved if self.best is before else self.tried
        best = self.best or self.first
        assert best is not None  # a budget is at least one candidate
        best = self.solver.settled(best) if best.clear else best
        return Found(best, self.solver.margin, self.tried)

    def allowed(self, pairs: int) -> tuple[int, float]:
        """Return the maximum number of candidates, in total and without gain, for `pairs` in contact."""
        budget = next((number for most, number in BUDGETS if pairs <= most), 1)
        patience: float = PATIENCE_FEW if pairs <= FEW else PATIENCE_MANY
        if self.problem.count == 1:
            patience = PATIENCE_ONE
        if self.problem.count > 1 and not self.problem.round:
            budget, patience = EDGED * budget, EDGED * patience
        if self.budget is not None:
            return self.budget, inf
        return (budget + MORE, inf) if self.more else (budget, patience)

    def examine(self, start: Contacts, sides: Sides) -> Solution:
        """Solve from a start; keep a better solution, and note those with other sides to examine."""
        bar = self.best.energy if self.best is not None else inf
        solution = self.solver.solve(start, sides, bar)
        self.tried += 1
        self.first = self.first or solution
        if not solution.clear:
            return solution
        if solution.energy < bar * (1.0 - SIMILAR) or self.best is None:
            self.best = solution
            self.proven = self.solver.proven(solution)
        if not any(solution.same(other) for other in self.seen):
            self.seen.append(solution)
            if not self.proven and not (self.alone and solution.contacts.number == 1):
                self.unranked.append(solution)
        return solution

    def push(self, cost: float, contacts: Contacts, k: int, side: Floats) -> None:
        """Add a start to the queue; of those with equal costs, the earlier comes first."""
        heapq.heappush(self.queue, (cost, next(self.order), contacts, k, side))

    def is_new(self, start: Contacts) -> bool:
        """Return whether no similar start was examined before."""
        windows = self.problem.windows[0][start.which]
        when = (start.times - windows[:, 0]) / (windows[:, 1] - windows[:, 0])
        rows = np.rint(np.concatenate([when[:, None], start.normals], axis=1) / ALIKE).tolist()
        like = frozenset(zip(start.which.tolist(), map(tuple, rows), strict=True))
        before = len(self.starts)
        self.starts.add(like)
        return len(self.starts) > before

    def push_exits(self, pair: tuple[int, int], conflict: Floats) -> None:
        """Queue every exit of a conflict of the unconstrained paths."""
        contact = self.clipped(self.problem.at(pair, conflict[2]))
        motions, compliance = self.problem.unconstrained(contact)
        for cost, normal in self.ways_out(contact.which[0], motions[0], compliance):
            self.push(cost, contact, 0, normal)

    def push_turns(self, solution: Solution) -> None:
        """Queue each contact's pair on its other sides, with the other contacts unchanged.

        The exits are those from the pair's position without the contact; of many pairs, only the cheapest.
        """
        contacts = solution.contacts
        few = len(np.unique(contacts.which)) <= FEW
        motions = self.problem.motions(solution.trajectories, contacts)
        kernel = self.problem.kernel(contacts).reshape(contacts.number, 3, contacts.number, 3)
        for k, (normal, force) in enumerate(zip(contacts.normals, contacts.multipliers, strict=True)):
            compliance = kernel[k, :, k]
            moved = force * compliance @ normal
            motions[k, 0] -= moved
            others = solution.energy - 0.5 * force * float(normal @ moved)
            limit = ANOTHER * float(np.linalg.norm(normal))
            ways = self.ways_out(contacts.which[k], motions[k], compliance)
            other = [way for way in ways if way[1] @ normal < limit * np.linalg.norm(way[1])]
            for cost, side in other if few else other[:1]:
                self.push(others + cost, contacts, k, side)

    def ways_out(self, which: int, motion: Floats, compliance: Floats) -> list[tuple[float, Floats]]:
        """Return exits of a pair's zone at a relative motion: (rough cost, normal)."""
        zone = self.problem.zones[self.problem.kinds[which]]
        return exit_normals(zone.shape, zone.faces, self.solver.margin, motion[0], motion[1], compliance)

    def clipped(self, contacts: Contacts) -> Contacts:
        """Return contacts within the windows of their pairs."""
        return contacts._replace(times=np.clip(contacts.times, *self.problem.windows[0][contacts.which].T))


def turned(contacts: Contacts, k: int, side: Floats) -> Contacts:
    """Return contacts with the k-th contact's pair on another side; that pair has no other contacts."""
    alone = contacts.number == 1
    one = (contacts if alone else contacts.some([k]))._replace(normals=side[None], multipliers=np.ones(1))
    return one if alone else contacts.some(contacts.which != contacts.which[k]).joined(one)
