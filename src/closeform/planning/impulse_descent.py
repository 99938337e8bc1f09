"""From clear paths to cheaper ones, and to clear ones from near by: steps that stay, or come, clear.

Planes of failures are those of the paths at hand, which keep them.  Paths part of the way to the cheapest
that keep these planes cost less, and are clear as far as the planes stand for what is near: where none
is, planes are moved out, so that the way leads off the zones at first.                     # theory (74)
"""

from collections.abc import Callable
from math import inf

from closeform.planning.impulse_checks import Spent
from closeform.planning.impulse_local import AIM, LAST, SAFER, SETTLED, ImpulseSolver
from closeform.planning.impulse_moments import Moments

ROUNDS, COMING = 20, 12  # to cheaper paths, and to clear ones, at most
LIFTS = 0.0, 1e-3, 1e-2  # zones by which planes are moved out
SHARES = 1.0, 0.5, 0.25, 0.125  # of the way to what keeps the planes
GAINED = 1e-4  # of the cost: a round that gains less is the last


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
        better = step_from(solver, best, moments(best))
        if better is None:
            break
        gained, best = best.delta_v - better.delta_v, better
        if gained < GAINED * best.delta_v:
            break
    return best


def cleared(solver: ImpulseSolver, near: Spent) -> Spent | None:
    """Clear paths to which steps lead from near ones, fired at their moments; None where they do not."""
    here: Spent | None = near
    for _ in range(COMING):
        if here is None or here.checked.clear:
            return here
        here = step_from(solver, here, near.moments)
    return None


def step_from(solver: ImpulseSolver, here: Spent, moments: list[Moments]) -> Spent | None:
    """Clear paths fired at moments that cost less than clear ones, or are clear where these are not.

    None where there are none; from paths that are not clear those that come nearest to it.
    """
    contacts, clear = solver.turned(here), here.checked.clear
    bar, best = (1.0 - SETTLED) * here.delta_v if clear else inf, None
    for lift in LIFTS:
        solver.aim = AIM + lift
        found = solver.priced(moments, contacts, LAST, bar)
        if found is None:
            break
        for share in SHARES:
            part = found if share == 1.0 else solver.part_way(here, found, share)
            if part.checked.clear and (not clear or part.delta_v < here.delta_v):
                return part
            if not clear and (best is None or part.checked.worst > best.checked.worst):
                best = part
    return best
