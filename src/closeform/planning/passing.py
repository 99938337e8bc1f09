"""The search over passing sides: which side of every zone the paths take, and when it ends."""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.planning.certify import LocalSolver, Solution, shifted
from closeform.planning.contacts import Sides
from closeform.planning.problem import Problem
from closeform.planning.scene import Contacts
from closeform.planning.sides import exit_normals

MARGINS = (1.0 + 1e-9, 1.001, 1.02)  # zones are enlarged by: the least that is certified, then more
DEEP, SHIFT, FAR = 0.3, 0.3, 1.0  # norm below which new sides are not the nearer ones; sizes of shifts
FEW = 6  # pairs in contact, up to which every way out of a contact is looked at
BUDGETS = ((FEW, 192), (12, 20), (30, 8), (80, 4), (200, 2))  # most candidates for so many pairs; else one
PATIENCE_ONE, PATIENCE_FEW, PATIENCE_MANY = 60, 10, 4  # candidates without a better one: the search ends
MORE = 24  # candidates beside them where none of the first is clear
SHALLOW = 0.3  # of the zone, by which a contact must push for its other side to be tried, of many
HOPELESS = (
    1.6  # times the best energy, beyond which a start that may cost so much is not looked at; 1.3: as good
)
SIMILAR = 1e-7  # share of its energy by which a solution must be better to count as such
DRAWN = 4  # every so many candidates begin with sides that are drawn, to be led elsewhere
ALIKE = 0.1  # of the window and of a normal, within which two starts are not both looked at
ANOTHER = 0.9  # cosine of the angle between two normals below which they are different sides


@dataclass(frozen=True, eq=False)
class Found:
    """What the search has come to: the best solution, or the one that it began with where none is clear.

    `margin`: the zones it was made for are so many times as large; `tried` candidates were examined.
    """

    best: Solution
    margin: float
    proven: bool
    tried: int


class Search:
    """One search: the best solution so far, and a queue of starts ranked by what they may cost."""

    def __init__(
        self, problem: Problem, margin: float, budget: int | None = None, more: bool = False
    ) -> None:
        """`budget`: how many candidates are examined at most; by default by how many pairs are in contact."""
        self.problem = problem
        self.solver = LocalSolver(problem, margin)
        self.budget = budget
        self.more = more
        self.tried = 0
        self.drawn = 0
        self.best: Solution | None = None
        self.proven = False
        self.seen: list[Solution] = []
        self.queue: list[tuple[float, int, Contacts]] = []
        self.starts: set[Any] = set()
        self.alone = False  # one conflict: every way out of it is looked at
        self.first: Solution | None = None
        self.nearby = shifted(problem, 0, DEEP, SHIFT)

    def run(self) -> Found:
        """Examine candidates until one is proven, none is left, or the budget is over."""
        conflicts = self.problem.conflicts(self.problem.direct, self.solver.margin)
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
        patience = (
            inf
            if self.budget or self.more
            else (PATIENCE_MANY if not few else PATIENCE_ONE if self.problem.count == 1 else PATIENCE_FEW)
        )
        budget = self.budget or next((number for most, number in BUDGETS if pairs <= most), 1)
        budget += MORE if self.more else 0
        improved = self.tried
        while self.tried < budget and not self.proven:
            if self.best is not None and self.tried - improved >= patience:
                break
            before = self.best
            if self.queue and (self.alone or self.tried % DRAWN):
                cost, _, start = heapq.heappop(self.queue)
                if self.best is not None and cost > HOPELESS * self.best.energy and not self.more:
                    self.queue.clear()
                    continue
                self.examine(start, self.nearby)
            elif self.best is not None and (self.alone or (few and not self.queue)):
                break
            else:
                self.drawn += 1
                self.examine(Contacts.none(), shifted(self.problem, self.drawn, 1.0, FAR))
            improved = improved if self.best is before else self.tried
        best = self.best or self.first
        assert best is not None  # a budget is at least one candidate
        return Found(best, self.solver.margin, self.proven, self.tried)

    def examine(self, start: Contacts, sides: Sides) -> Solution:
        """Solve from a start; keep what is better, and rank the ways around it."""
        bar = self.best.energy if self.best is not None else inf
        blunt = self.tried % 2 if self.problem.count > 1 else 0
        solution = self.solver.solve(start, sides, bar, blunt)
        self.tried += 1
        self.first = self.first or solution
        if solution.clear and not any(solution.same(other) for other in self.seen):
            self.seen.append(solution)
            if solution.energy < bar * (1.0 - SIMILAR) or self.best is None:
                self.best = solution
                self.proven = self.solver.proven(solution)
            if not self.proven and not (self.alone and solution.contacts.number == 1):
                self.push_turns(solution)
        return solution

    def push(self, cost: float, start: Contacts) -> None:
        """Put a start in the queue that no other is like; of equal costs the earlier goes first."""
        rows = zip(*(column.tolist() for column in start[:3]), strict=True)
        like = frozenset(
            (which, self.moment(which, time), *map(alike, normal)) for which, time, normal in rows
        )
        if like not in self.starts:
            self.starts.add(like)
            heapq.heappush(self.queue, (cost, len(self.starts), start))

    def moment(self, which: int, time: float) -> int:
        """Which of the short times it is, of those in which a pair's contact can lie."""
        start, end = self.problem.windows[0][which]
        return alike((time - start) / (end - start))

    def push_exits(self, pair: tuple[int, int], conflict: Floats) -> None:
        """Every way out of a conflict of the unconstrained paths."""
        contact = self.clipped(self.problem.at(pair, conflict[2]))
        for cost, normal in self.ways_out(contact, self.problem.motions(self.problem.direct, contact)[0]):
            self.push(cost, contact._replace(normals=normal[None], multipliers=np.ones(1)))

    def push_turns(self, solution: Solution) -> None:
        """Each contact's pair on its other sides, the other contacts as they are."""
        contacts = solution.contacts
        if not contacts.number:
            return
        motions = self.problem.motions(solution.flown, contacts)
        kernel = self.problem.kernel(contacts)
        few = len(np.unique(contacts.which)) <= FEW
        for k in range(contacts.number):
            block = kernel[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
            push = contacts.multipliers[k] * block @ contacts.normals[k]
            rest = contacts.some(contacts.which != contacts.which[k])
            one = contacts.some([k])._replace(multipliers=np.ones(1))
            saved = solution.energy - 0.5 * contacts.multipliers[k] * push @ contacts.normals[k]
            motion = motions[k].copy()
            motion[0] -= push  # where the pair would pass without this contact
            if few:
                for cost, normal in self.ways_out(one, motion):
                    size = np.linalg.norm(normal) * np.linalg.norm(contacts.normals[k])
                    if normal @ contacts.normals[k] < ANOTHER * size:
                        self.push(saved + cost, rest.joined(one._replace(normals=normal[None])))
            elif (depth := push @ contacts.normals[k]) > SHALLOW:
                self.push(-depth, rest.joined(one._replace(normals=-one.normals)))

    def ways_out(self, contact: Contacts, motion: np.ndarray) -> Iterator[tuple[float, np.ndarray]]:
        """Ways out of a pair's zone at a relative motion: (rough cost, normal)."""
        scene = self.solver.scene
        kind = scene.kinds[contact.which[0]]
        faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
        kernel = self.problem.kernel(contact)
        yield from exit_normals(
            int(scene.shapes[kind]), faces, self.solver.margin, motion[0], motion[1], kernel
        )

    def clipped(self, contacts: Contacts) -> Contacts:
        """Contacts within the times at which they can lie."""
        return contacts._replace(times=np.clip(contacts.times, *self.problem.windows[0][contacts.which].T))


def alike(value: float) -> int:
    """The same number for what is nearly the same."""
    return round(value / ALIKE)
