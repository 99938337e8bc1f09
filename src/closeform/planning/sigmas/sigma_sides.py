"""Sides of plans at k sigma: those of ordinary plans around zones enlarged by the sigmas."""

from collections.abc import Iterator

import numpy as np

from closeform.arrays import Floats
from closeform.planning.energy.side_search import Search
from closeform.planning.problem.problem import PairRow, Problem
from closeform.planning.problem.scene import Contacts
from closeform.planning.sigmas.sigma_problem import SigmaProblem

ENLARGED = 4  # maximum starts


def sides_of_enlarged(problem: SigmaProblem, margin: float) -> Iterator[Contacts]:
    """Yield contacts on the sides of the lowest-cost plans around enlarged zones."""
    enlarged = problem.enlarged(moments(problem, problem.direct_conflicts(margin)))
    if not enlarged.direct_conflicts(margin):
        return
    search = Search(enlarged, margin)
    search.run()
    clear = sorted((one for one in search.seen if one.clear), key=lambda one: one.energy)
    for one in clear[:ENLARGED]:
        which = np.array([problem.index[tuple(enlarged.pairs[k])] for k in one.contacts.which])
        known = one.contacts._replace(which=which)
        yield problem.sides(problem.direct, known, metres(enlarged, one.contacts))


def moments(problem: Problem, conflicts: list[PairRow]) -> Contacts:
    """Return for each pair the time of its deepest conflict, or else of its minimum distance."""
    states = problem.seen.states
    gaps = np.linalg.norm(states[problem.pairs[:, 0], :, :3] - states[problem.pairs[:, 1], :, :3], axis=2)
    times = problem.seen.times[np.nanargmin(np.where(np.isfinite(gaps), gaps, np.inf), axis=1)]
    start, end = problem.windows[1].T
    times = np.clip(times, start, end)
    deepest = np.full(len(times), np.inf)
    for pair, row in conflicts:
        k = problem.index[pair]
        if row[3] < deepest[k]:
            deepest[k], times[k] = row[3], row[2]
    return Contacts.at(np.arange(len(times)), times)


def metres(problem: Problem, contacts: Contacts) -> Floats:
    """Return the directions (K, 3) of contacts' normals in the rotating frame."""
    ways = np.einsum("ki,kij->kj", contacts.normals, problem.bare.matrices[problem.kinds[contacts.which]])
    return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))
