"""Paths of minimum energy around plain zones, and the outcome of any search, with contacts in metres."""

from dataclasses import dataclass, field, replace
from math import inf, nan
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.planning.energy.local_solver import LocalSolver, nearer
from closeform.planning.energy.side_search import MARGINS, Found, Search
from closeform.planning.plan import Contact
from closeform.planning.problem.problem import Closest, Problem, Trajectories, deepest
from closeform.planning.problem.scene import Contacts


@dataclass(frozen=True, eq=False)
class Outcome:
    """Outcome of a search: clear paths with their contacts, or None with the pair in the deepest conflict.

    `extra` is the energy beyond the unconstrained optima, and `margin` the factor by which the zones were
    enlarged.  `order` is the planning order of sequential planning, if it differs from the requested one.
    `delta_v` [m/s] is set where it was minimised, summed over thrusters.  `enough` (N,) [m/s^2] is the thrust
    of clear paths where none was found within limits; `limited` is True if clear paths exist without limits.
    `needed` is the smallest factor of the limits that planes without a solution require, inf without any.
    `least` [m^2/s^3] is a lower bound on the energy, where requirements on single craft raise it.
    `priced` is True if the multipliers are slopes of the minimised cost.  `closest` are the
    paths nearest to being clear where none is; `unfired` is True if impulses are clear but pulses are not.
    """

    trajectories: Trajectories | None
    contacts: tuple[Contact, ...]
    extra: float
    margin: float
    tried: int
    blocked: tuple[int, int] | None = None
    order: tuple[int, ...] = ()
    delta_v: float = nan
    priced: bool = True
    enough: Floats | None = None
    limited: bool = False
    needed: float = inf
    least: float = 0.0
    closest: Closest = field(default_factory=Closest)
    unfired: bool = False
    below_bit: int = 0  # impulses that thrusters cannot give, where no clear plan without any was found
    reason: str = ""  # of a method that gives its own

    @property
    def unfireable(self) -> str:
        """Return as text how many impulses are below the minimum bit, empty without any."""
        count = self.below_bit
        return f"; no plan found without the {count} impulses below minimum_bit" if count else ""


def solve(problem: Problem, budget: int | None = None, more: bool = False) -> Outcome:
    """Return the best of at most `budget` candidates; the default budget depends on the pairs in contact.

    The problem has zones alone.  They are enlarged only by what rounding requires, and by more only if no
    clear path is found.
    """
    searches = []
    for margin in MARGINS if problem.count == 1 else MARGINS[:1]:
        searches.append(Search(problem, margin, budget, more).run())
        if searches[-1].best.clear:
            break
    found = searches[-1] if searches[-1].best.clear else searches[0]
    return replace(outcome(found), tried=sum(search.tried for search in searches))


def is_passive(problem: Problem, own: Path, trajectories: Trajectories) -> bool:
    """Return whether paths (N,) are passively safe among all bodies; True for a problem without `drift`."""
    if problem.drift is None:
        return True
    from closeform.planning.passive.certification import failures

    return not failures(problem, own, problem.bodies(trajectories)).number


def outcome(found: Found) -> Outcome:
    """Return the outcome of a search."""
    best = found.best
    if not best.clear:
        conflicts = best.problem.conflicts(best.trajectories)
        blocked = deepest(conflicts)[0] if conflicts else None
        near = Closest(trajectories=best.trajectories)
        return Outcome(None, (), nan, found.margin, found.tried, blocked, closest=near)
    touched = contacts_of(best.problem, best.contacts, best.trajectories)
    return Outcome(best.planned, touched, best.energy, found.margin, found.tried)


def joined(problem: Problem, alone: Outcome, before: Outcome) -> Outcome:
    """Return sequentially planned paths re-optimised jointly on the same sides, or the outcome `before`."""
    tried = before.tried + alone.tried
    if alone.trajectories is None:
        return replace(before, tried=tried)
    solver = LocalSolver(problem, MARGINS[0])
    start = solver.nearest(alone.trajectories, problem.touched(alone.contacts))
    together = solver.solve(start, nearer(problem))
    if not together.clear or problem.energy(together.trajectories) > problem.energy(alone.trajectories):
        return replace(alone, tried=tried)
    return outcome(Found(solver.settled(together), MARGINS[0], tried + 1))


def contacts_of(problem: Problem, contacts: Contacts, trajectories: Trajectories) -> tuple[Contact, ...]:
    """Return the contacts in metres, in order of time."""
    if not contacts.number:
        return ()
    contacts = contacts.some(np.argsort(contacts.times, kind="stable"))
    pairs, kinds = problem.pairs[contacts.which], problem.kinds[contacts.which]
    pushes = (contacts.normals[:, None] @ problem.bare.matrices[kinds])[:, 0]
    sizes = np.sqrt((pushes * pushes).sum(axis=1))
    second = contacts.drifts[:, 1] > 0.0  # the craft without thrust is listed first
    pairs = np.where(second[:, None], pairs[:, ::-1], pairs)
    pushes[second] *= -1.0
    drifts = contacts.drifts.max(axis=1)
    failed, lost = drifts > 0.0, contacts.times - drifts
    ways = pushes / sizes[:, None]
    spread = problem.deviations(trajectories, contacts, ways)
    reaches = 1.0 / sizes - problem.sigmas * spread
    places = problem.path(trajectories)._at(pairs[:, 0], lost)
    if failed.any():
        places[failed] = (problem.orbit.transition(drifts[failed], lost[failed]) @ places[failed, :, None])[
            ..., 0
        ]
    # normals are means of gradients of the norm; along each gradient a zone's extent is 1
    forces = contacts.multipliers * sizes
    columns = contacts.times, *pairs.T, forces, reaches, np.where(failed, lost, nan), spread
    rows = zip(*(column.tolist() for column in columns), places[:, :3], ways, strict=True)
    return tuple(
        Contact(time, first, second, place, normal, multiplier, reach, failed_at, sigma)
        for time, first, second, multiplier, reach, failed_at, sigma, place, normal in rows
    )


def once(contacts: tuple[Contact, ...]) -> tuple[Contact, ...]:
    """Return the contacts without duplicates, whose multipliers are added."""
    found: dict[Any, Contact] = {}
    for one in contacts:
        failed = None if one.failed_at != one.failed_at else round(one.failed_at, 6)
        key = one.first, one.second, round(one.time, 6), failed, *one.normal.round(6).tolist()
        held = found.get(key)
        found[key] = one if held is None else replace(held, multiplier=held.multiplier + one.multiplier)
    return tuple(found.values())
