"""The two passing sides of one obstacle, each at its own minimum energy: SP11's figure 2."""

import numpy as np

from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.planning.energy.local_solver import Solution, nearer
from closeform.planning.energy.side_search import MARGINS, Search, turned
from closeform.planning.infeasible_ends import end_conflict
from closeform.planning.problem.problem import Problem, deepest, transfer_of
from closeform.zones.zone import Zone


def ways_around(path: Path, obstacle: Path, zone: Zone) -> list[Path]:
    """Return clear paths between the ends of `path` on either side of the obstacle, the cheaper first.

    The second path is the one of lowest cost found on the other side.  A side without its own path is
    omitted, for example if paths slide around the zone to the other side.  The list is empty where the
    unconstrained path is clear.
    """
    problem = Problem.of(stack([transfer_of(path)]), stack([obstacle]), [(zone, np.array([[0, 1]]))])
    search = Search(problem, MARGINS[0])
    conflicts = problem.conflicts(problem.direct)
    if end_conflict(problem) or not conflicts:
        return []
    search.push_exits(*deepest(conflicts))
    found: list[Solution] = []
    for _, _, contact, k, side in sorted(search.queue, key=lambda one: one[:2]):
        solution = search.solver.solve(turned(contact, k, side), nearer(problem))
        if solution.clear and solution.contacts.number:
            found.append(search.solver.settled(solution))
    found.sort(key=lambda solution: solution.energy)
    other = [one for one in found if _side(one, zone) @ _side(found[0], zone) < 0.0]
    return [problem.path(solution.trajectories)[0] for solution in (*found[:1], *other[:1])]


def _side(solution: Solution, zone: Zone) -> np.ndarray:
    """Return the direction of the strongest contact's force, in metres."""
    hardest = int(np.argmax(solution.contacts.multipliers))
    push: np.ndarray = zone.matrix.T @ solution.contacts.normals[hardest]
    return push
