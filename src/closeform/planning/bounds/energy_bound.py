"""Lower bound on the energy of all clear plans: the Lagrangian dual of samples outside their zones."""

from collections.abc import Callable, Sequence
from math import inf

import numpy as np

from closeform.arrays import Floats
from closeform.planning.bounds.branch_and_bound import Answer, Node, Samples
from closeform.planning.bounds.dual_bound import dual_bound
from closeform.planning.bounds.zone_pieces import Piece
from closeform.planning.energy.local_solver import LocalSolver, Solution, nearer
from closeform.planning.energy.side_search import MARGINS
from closeform.planning.plan import Contact
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import Contacts

CLOSED = 1e-6  # of the multipliers' own energy: sufficient accuracy of the bound
NEARLY = 0.02  # accuracy of the bound: of itself or of what it lacks
LARGEST = 80  # maximum connected contacts of a bound
FEW, HOPEFUL = 24, 0.05  # more contacts only where FEW give this share of their multipliers' energy
SETTLED = 0.02  # of a node's bound: shortfall of its samples below which other times are examined
DEEP = 1e-3  # of the zone: tolerated conflict
IDLE = 1e-3  # of the largest work: samples below it are dropped in child nodes
UNFELT = 1e-9  # of the goal: shortfall in a zone's centre of a sample without multiplier
STARTS = 50  # nodes for each start that is solved


class EnergyBound:
    """Lower bound on the energy of all clear plans of one problem.

    `missed` returns the conflicts after a loss of thrust under contacts' multipliers, and their clearance
    ratios.  A `fixed` plan is not replaced by one of lower cost.
    """

    same, until = 5e-3, inf

    def __init__(
        self,
        problem: Problem,
        contacts: Sequence[Contact],
        missed: Callable[[Contacts], tuple[Contacts, Floats]] | None = None,
        fixed: bool = False,
    ) -> None:
        self.problem, self.missed, self.fixed = problem.relaxed, missed, fixed
        self.samples = Samples.of_plan(self.problem, contacts)
        self.gram, self.places = np.empty((0, 0)), np.empty((0, 3))
        self.free, self.nodes, self.starts = self.problem.least_energy, 0, 0

    def of_plan(self) -> tuple[float, float]:
        """Return the bound of a plan's contacts beyond the free energy, and their multipliers' energy."""
        held, every = self.samples.contacts, range(self.samples.contacts.number)
        forces = (held.multipliers[:, None] * held.normals).ravel()
        energy = 0.5 * float(forces @ self.problem.kernel(held) @ forces)
        goal = self.free + (1.0 - CLOSED) * energy
        answer = self.solve(every, [self.samples.outside(k) for k in every], goal)
        return answer.bound - self.free, energy

    def solve(
        self, samples: Sequence[int], cut: Sequence[Piece], goal: float, parent: Answer | None = None
    ) -> Answer:
        """Return the answer of samples in pieces of their zones' outside: the dual bound, by its forces.

        The shortfall of a sample is the gain of the bound, to first order, if the place were on the surface
        of its zone instead of inside.
        """
        self.nodes, goal = self.nodes + 1, goal - self.free
        if 3 * self.samples.contacts.number > len(self.gram):
            motions, gram = self.problem.unconstrained(self.samples.contacts)
            self.places, self.gram = motions[:, 0], 0.5 * (gram + gram.T)
        count, held = len(samples), np.array(samples, dtype=np.int64)
        round_ones = [k for k in range(count) if len(cut[k].rows)]
        planes = [k for k in range(count) if not cut[k].whole]
        offsets = np.cumsum([0, *(len(cut[k].rows) for k in round_ones)])
        rows = np.zeros((offsets[-1] + len(planes), count, 3))
        for first, k in zip(offsets, round_ones, strict=False):
            rows[first : first + len(cut[k].rows), k] = cut[k].rows
        for row, k in enumerate(planes, offsets[-1]):
            rows[row, k] = cut[k].normal
        rows = rows.reshape(len(rows), 3 * count)
        index = (3 * held[:, None] + np.arange(3)).ravel()
        gram, places = self.gram[np.ix_(index, index)], self.places[held].ravel()
        between = rows @ gram @ rows.T
        multipliers, floors = np.zeros((2, count)), np.array([cut[k].floor for k in planes])
        multipliers[0] = self.samples.contacts.multipliers[held]  # those of a plan may suffice
        given = np.concatenate([multipliers[0, round_ones], multipliers[1, planes]])
        bound, forces = 0.0, np.zeros(len(rows))
        if between.diagonal().max(initial=0.0) > 0.0:  # else all are at the ends of their craft's time
            between = 0.5 * (between + between.T)
            bound = dual_bound(rows @ places, between, offsets, floors, goal, NEARLY, given, forces)
        multipliers[0, round_ones], multipliers[1, planes] = np.split(given, [len(round_ones)])
        forces = rows.T @ forces
        reached, pushes = (places + gram @ forces).reshape(count, 3), forces.reshape(count, 3)
        short, idle = np.zeros(count), np.zeros(count, dtype=bool)
        work = np.abs((pushes * reached).sum(axis=1))
        for k in round_ones:
            missing, felt = cut[k].missing(reached[k]), UNFELT * goal
            short[k] = 0.5 * multipliers[0, k] * missing + felt * max(missing, 0.0)
            short[k] += multipliers[1, k] * (1.0 - np.linalg.norm(cut[k].rows @ reached[k]))
            idle[k] = cut[k].whole and not work[k] > IDLE * work.max()
        short = np.maximum(short, 0.0)
        settled = short.sum() < SETTLED * max(bound, goal - bound)
        return Answer(self.free + bound, short, idle, bool(settled), pushes)

    def conflicts(self, node: Node, fine: float) -> Contacts:
        """Return the conflicts of a node's paths, also after a loss of thrust."""
        problem, pushed, least = self.problem, self.pushed(node), 1.0 - DEEP * fine
        trajectories = problem.trajectories(pushed)
        met = problem.met([one for one in problem.conflicts(trajectories) if one[1][3] < least])
        if self.missed is not None:
            lost, ratios = self.missed(pushed)
            met = met.joined(lost.some(ratios < least))
        return met._replace(normals=problem.normals(trajectories, met, -np.inf))

    def better(self, node: Node, cost: float) -> tuple[float, Solution] | None:
        """Return a plan on the sides of a node that costs less; only for every STARTS-th node."""
        if self.fixed or self.starts * STARTS > self.nodes:
            return None
        self.starts += 1
        solver = LocalSolver(self.problem, MARGINS[0])
        found = solver.solve(self.pushed(node), nearer(self.problem), cost - self.free)
        energy = self.free + found.energy
        return (energy, found) if found.clear and energy < cost else None

    def pushed(self, node: Node) -> Contacts:
        """Return the samples of a node with nonzero forces as contacts."""
        forces = node.answer.found
        sizes = np.linalg.norm(forces, axis=1)
        bear = sizes > 0.0
        contacts = self.samples.contacts.some(np.array(node.samples, dtype=np.int64)[bear])
        return contacts._replace(normals=forces[bear] / sizes[bear, None], multipliers=sizes[bear])


def lower_bound(problem: Problem, contacts: Sequence[Contact]) -> float:
    """Return a bound on all clear plans' energy beyond the unconstrained optima, from one's contacts."""
    total = 0.0
    for group in _apart(problem, contacts):
        strongest = sorted(group, key=lambda contact: -contact.multiplier)[:LARGEST]
        bound, energy = EnergyBound(problem, strongest[:FEW]).of_plan()
        if len(strongest) > FEW and bound > HOPEFUL * energy:  # not failures that touch over a range of times
            bound, _ = EnergyBound(problem, strongest).of_plan()
        total += max(bound, 0.0)
    return total


def _apart(problem: Problem, contacts: Sequence[Contact]) -> list[list[Contact]]:
    """Return the contacts in groups without common craft; obstacles do not connect groups."""
    groups: list[tuple[set[int], list[Contact]]] = []
    for contact in contacts:
        craft = {k for k in (contact.first, contact.second) if k < problem.count}
        joined = [group for group in groups if group[0] & craft]
        groups = [group for group in groups if not group[0] & craft]
        held = [one for _, group in joined for one in group]
        groups.append((craft.union(*(near for near, _ in joined)), [*held, contact]))
    return [group for _, group in groups]
