"""From clear paths to cheaper ones, and to clear ones from near by: steps that stay, or come, clear.

Planes of failures are those of the paths at hand, which keep them.  Paths part of the way to the cheapest
that keep these planes cost less, and are clear as far as the planes stand for what is near: where none
is, planes are moved out, so that the way leads off the zones at first.                     # theory (74)
"""

from collections.abc import Callable
from math import inf

from closeform.planning.firing_times import Moments, blended
from closeform.planning.impulse_checks import Spent
from closeform.planning.impulse_local import LAST, SAFER, SETTLED, ImpulseSolver
from closeform.planning.scene import Contacts

ROUNDS, COMING = 20, 12  # to cheaper paths, and to clear ones, at most
LIFTS = 0.0, 1e-3, 1e-2  # zones by which planes are moved out
SHARES = 0.5, 0.25, 0.125  # of the way to what keeps the planes
GAINED = 1e-4  # of the cost: a round that gains less is the last
CUTS = 8  # times that planes are joined, which the cheapest paths break that keep the others
MOST = 250  # planes, beyond which no more are joined


def descended(solver: ImpulseSolver, best: Spent) -> Spent:
    """Clear paths that are no dearer than clear ones, fired when these are.

    Or when primers ask for it, which is more often, where that is cheaper by more than few impulses may cost.
    """
    few = at_rest(solver, best, lambda found: found.moments)
    many = at_rest(solver, few, solver.following)
    return many if SAFER * many.delta_v < few.delta_v else few


def at_rest(solver: ImpulseSolver, best: Spent, moments: Callable[[Spent], list[Moments]]) -> Spent:
    """What rounds come to from clear paths, fired at `moments` of those before."""
    for _ in range(ROUNDS):
        better = step_down(solver, best, moments(best))
        if better is None:
            break
        gained, best = best.delta_v - better.delta_v, better
        if gained < GAINED * best.delta_v:
            break
    return best


def cleared(
    solver: ImpulseSolver, near: Spent, moments: Callable[[Spent], list[Moments]] | None = None
) -> Spent | None:
    """Clear paths to which steps lead from near ones, fired at their moments; None where they do not.

    Or at `moments` of those before.
    """
    here: Spent | None = near
    for _ in range(COMING):
        if here is None or here.checked.clear:
            return here
        here = step_near(solver, here, near.moments if moments is None else moments(here))
    return None


def step_down(solver: ImpulseSolver, here: Spent, moments: list[Moments]) -> Spent | None:
    """Clear paths fired at moments that cost less than clear ones; None where there are none.

    The cheapest that keep planes which these keep, those that paths on the way break among them.
    """
    contacts, least = solver.turned(here), None
    solver.aim = solver.least
    for _ in range(CUTS):
        if contacts.number > MOST:
            break
        found = solver.priced(moments, contacts, LAST, (1.0 - SETTLED) * here.delta_v)
        if found is None:
            break
        if found.checked.clear:
            return found
        least, contacts = found, found.contacts.joined(kept_by(solver, here, found))
    if least is not None:
        for share in SHARES:
            both = (here.moments, least.moments), (here.impulses, least.impulses)
            part = solver.fired_at(*blended(*both, share), least)
            if part.checked.clear and part.delta_v < here.delta_v:
                return part
    return None


def kept_by(solver: ImpulseSolver, clear: Spent, found: Spent) -> Contacts:
    """The contacts of conflicts of paths that were found, turned to where clear ones are: these keep them."""
    problem, lost, met = solver.problem, found.checked.lost, solver.problem.met(found.checked.missed)
    if solver.failures is not None:
        lost = lost._replace(normals=problem.normals(solver.failures.brief(clear.flown), lost, -inf))
    return lost.joined(met._replace(normals=problem.normals(clear.flown, met, -inf)))


def step_near(solver: ImpulseSolver, here: Spent, moments: list[Moments]) -> Spent | None:
    """Paths fired at moments that are clear, or come nearest to it from some that are not; None without."""
    contacts, best = solver.turned(here), None
    for lift in LIFTS:
        solver.aim = solver.least + lift
        found = solver.priced(moments, contacts, LAST, inf)
        if found is None:
            break
        for share in (1.0, *SHARES):
            part = found if share == 1.0 else solver.part_way(here, found, share)
            if part.checked.clear:
                return part
            if best is None or part.checked.worst > best.checked.worst:
                best = part
    return best
