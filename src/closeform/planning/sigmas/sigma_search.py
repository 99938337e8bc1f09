"""Plans at k sigma: rounds of the exact planes of zone and sigmas, from the sides of ordinary plans.

A round (`loop.Rounds`) solves the program of the known planes and finds all conflicts with a slightly larger
sum of zone and sigmas.  The sum's supporting plane at each closest approach is the next plane.  Active planes
are turned to their pairs' positions.                                                           # theory (56)
"""

from collections.abc import Iterator
from math import inf
from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.planning.energy.exit_directions import ranked_exits
from closeform.planning.energy.local_solver import AHEAD, Solution
from closeform.planning.energy.plane_program import TOGETHER, press
from closeform.planning.energy.side_search import FEW, Found, Search
from closeform.planning.loop import Rounds, run
from closeform.planning.problem.problem import PairRow, Problem, Trajectories
from closeform.planning.problem.scene import Contacts
from closeform.planning.sigmas.sigma_problem import SigmaProblem

ONE, MANY, MORE = 8, 4, 3  # starts for one craft and for many; factor with `more`
ENLARGED = 4  # maximum starts from the search with zones enlarged by the sigmas
ROUNDS = 60  # until the first clear paths
NEAR = 1.02  # of zone and sigmas: closer pairs get a plane
SAME = 1e-4  # of a pair's window: closer planes are merged
HARD = 1e-9  # softness of planes
SETTLED = 1e-7  # of the energy: change at which rounds end
SHORT = 1e-6  # shortfall below which paths are certified
GIVEN_UP, FIRST = 1.3, 6  # times the bar, after FIRST rounds
ROUNDING = 1e-9  # minimum shortfall of paths that are not certified


class Pressed(NamedTuple):
    """Paths of minimum energy for planes, the active ones, and approaches to zones with sigmas."""

    cost: float
    clear: bool
    worst: float
    pressing: Contacts
    trajectories: Trajectories
    near: list[PairRow]


class SigmaSearch:
    """Search among starts for plans at k sigma; the task of the loop for its cost and requirement."""

    least = 1.0  # distance of planes, in zones with sigmas

    def __init__(self, problem: SigmaProblem, margin: float, budget: int | None, more: bool) -> None:
        self.problem = problem
        self.margin = margin
        most = (ONE if problem.count == 1 else MANY) * (MORE if more else 1)
        self.budget = most if budget is None else budget
        seen = problem.seen
        self.scene = seen._replace(aims=np.full(len(seen.shapes), margin))
        start, end = problem.windows[0].T
        self.same = SAME * (end - start)

    def run(self) -> Found:
        """Return the best solution of all starts."""
        best: Solution | None = None
        tried = 0
        for start in self.starts():
            if tried == self.budget:
                break
            found = self.solve(start, inf if best is None else best.energy)
            if best is None or found.energy < best.energy:
                best = found
            tried += 1
        assert best is not None  # there is a conflict, and a budget is at least one start
        return Found(best, self.margin, False, tried)

    def starts(self) -> Iterator[Contacts]:
        """Yield sides of plans around enlarged zones, the nearer sides, and each exit of a conflict."""
        problem, direct = self.problem, self.problem.direct
        conflicts = problem.direct_conflicts(self.margin)
        enlarged = problem.enlarged(self.moments(conflicts))
        if enlarged.direct_conflicts(self.margin):
            search = Search(enlarged, self.margin)
            search.run()
            clear = sorted((one for one in search.seen if one.clear), key=lambda one: one.energy)
            if search.best is not None and not clear:
                clear = [search.best] if search.best.clear else []
            for one in clear[:ENLARGED]:
                which = np.array([problem.index[tuple(enlarged.pairs[k])] for k in one.contacts.which])
                ways = metres(enlarged, one.contacts)
                known = one.contacts._replace(which=which)
                yield problem.sides(direct, known, ways)
        near = self.turned(direct, problem.met(conflicts))
        yield near.first(near.number)
        if len(conflicts) > FEW:
            return
        inside = enlarged.met(conflicts)
        for _, k, normal in ranked_exits(enlarged, direct, inside):
            way = metres(enlarged, inside.some([k])._replace(normals=normal[None]))
            turned = near.first(near.number)
            turned.normals[k] = problem.sides(direct, near.some([k]), way).normals[0]
            yield turned

    def moments(self, conflicts: list[PairRow]) -> Contacts:
        """Return for each pair the time of its deepest conflict, or else of its minimum distance."""
        problem, states = self.problem, self.problem.seen.states
        gaps = np.linalg.norm(states[problem.pairs[:, 0], :, :3] - states[problem.pairs[:, 1], :, :3], axis=2)
        times = problem.seen.times[np.nanargmin(np.where(np.isfinite(gaps), gaps, inf), axis=1)]
        start, end = problem.windows[1].T
        times = np.clip(times, start, end)
        deepest = np.full(len(times), inf)
        for pair, row in conflicts:
            k = problem.index[pair]
            if row[3] < deepest[k]:
                deepest[k], times[k] = row[3], row[2]
        return Contacts.at(np.arange(len(times)), times)

    def solve(self, planes: Contacts, bar: float) -> Solution:
        """Return the certified solution from a start; stop well above the energy `bar`."""

        def most(turn: int) -> float:
            return GIVEN_UP * bar if turn >= FIRST else inf

        found: Pressed | None = run(Rounds(self, most, ROUNDS, settled=SETTLED, nearly=1.0 - SHORT), planes)
        if found is None:
            return Solution(self.problem, planes, inf, False, False)
        return Solution(self.problem, found.pressing, found.cost, True, False)

    def minimise(self, planes: Contacts, accuracy: float, aim: float, bar: float) -> Pressed | None:
        """Return the paths of minimum energy that satisfy planes; None above `bar` or without any."""
        energy, trajectories = self.pressed(planes, aim)
        if energy > bar or energy == inf:
            return None
        near = self.problem.conflicts(trajectories, NEAR)
        worst = min(1.0, *(NEAR * row[3] for _, row in near), inf)
        clear = worst > 1.0 - SHORT and not self.problem.conflicts(trajectories)
        kept = planes.some(planes.multipliers > 0.0)
        return Pressed(energy, clear, 1.0 if clear else min(worst, 1.0 - ROUNDING), kept, trajectories, near)

    def relinearise(self, found: Pressed) -> Contacts:
        """Return the planes of the next round."""
        return self.following(found.trajectories, found.pressing, found.near)

    def pressed(self, planes: Contacts, lift: float) -> tuple[float, Trajectories]:
        """Fill the planes' multipliers; return their energy and all paths."""
        energy = press(self.scene, planes, lift, HARD, inf, TOGETHER)
        return energy, self.problem.direct if energy == inf else self.problem.trajectories(planes)

    def following(self, trajectories: Trajectories, pressing: Contacts, near: list[PairRow]) -> Contacts:
        """Return active planes moved to the closest approaches near them, and planes of other conflicts."""
        times = pressing.times.copy()
        fresh: list[PairRow] = []
        start, end = self.problem.windows[0].T
        for pair, row in near:
            k = self.problem.index[pair]
            time = min(max(row[2], start[k]), end[k])
            same = (pressing.which == k) & (np.abs(times - time) <= self.same[k])
            if same.any():
                times[same] = time
            else:
                fresh.append((pair, np.array([row[0], row[1], time, row[3]])))
        planes = pressing._replace(times=times).joined(self.problem.met(fresh))
        _, once = np.unique(np.column_stack([planes.which, planes.times]), axis=0, return_index=True)
        return self.turned(trajectories, planes.some(np.sort(once)))

    def turned(self, trajectories: Trajectories, planes: Contacts) -> Contacts:
        """Return planes at their pairs' positions; ahead where two craft meet."""
        normals = self.problem.normals(trajectories, planes, -inf)
        lost = ~normals.any(axis=1)
        if lost.any():
            ways = np.repeat(AHEAD[None], int(lost.sum()), axis=0)
            normals[lost] = self.problem.sides(trajectories, planes.some(lost), ways).normals
        return planes._replace(normals=normals)


def metres(problem: Problem, contacts: Contacts) -> Floats:
    """Return the directions (K, 3) of contacts' normals in the rotating frame."""
    ways = np.einsum("ki,kij->kj", contacts.normals, problem.bare.matrices[problem.kinds[contacts.which]])
    return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))
