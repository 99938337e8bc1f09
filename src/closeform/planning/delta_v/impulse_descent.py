"""Descent from clear impulsive paths to cheaper ones, and steps from nearly clear paths to clear ones.

The planes of failures are placed at the current paths, which satisfy them.  Paths part of the way to the
cheapest that satisfy these planes cost less, and are clear as far as the planes represent all nearby
failures.  Where none is clear, the planes are moved out, so that the first steps lead away from the
zones.                                                                                      # theory (74)
"""

from collections.abc import Callable
from math import inf

from closeform.planning.delta_v.checks import Spent, arrive
from closeform.planning.delta_v.firing_times import Moments, blended
from closeform.planning.delta_v.impulse_solver import LAST, SAFER, SETTLED, ImpulseSolver
from closeform.planning.problem.scene import Contacts

ROUNDS, COMING = 20, 12  # maximum rounds to cheaper paths, and to clear ones
LIFTS = 0.0, 1e-3, 1e-2  # distances in zones by which planes are moved out
SHARES = 0.5, 0.25, 0.125  # of the way to paths that satisfy the planes
GAINED = 1e-4  # of the cost: minimum saving for another round
CUTS = 8  # maximum rounds that add violated planes
MOST = 250  # maximum planes


def descended(solver: ImpulseSolver, best: Spent) -> Spent:
    """Return clear paths of no higher cost than the given ones, fired at the same moments.

    Moments at the maxima of the primers, which are more, are used where they save more than few impulses may
    cost.
    """
    few = at_rest(solver, best, lambda found: found.moments)
    many = at_rest(solver, few, solver.following)
    return many if SAFER * many.delta_v < few.delta_v else few


def at_rest(solver: ImpulseSolver, best: Spent, moments: Callable[[Spent], list[Moments]]) -> Spent:
    """Return the last of the rounds from clear paths, each fired at the `moments` of the one before."""
    for _ in range(ROUNDS):
        if solver.problem.effort.beyond():
            break
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
    """Return clear paths that arrive, reached by steps from nearly clear ones at their moments; else None.

    If `moments` is given, each step fires at the moments that it returns for the previous paths.
    """
    here: Spent | None = near
    for _ in range(COMING):
        # pulses that are left when others are omitted may be clear only because they lead elsewhere
        if here is None or (here.checked.clear and arrive(solver.problem, here.flown, solver.finals)):
            return here
        if solver.problem.effort.beyond():
            return None
        here = step_near(solver, here, near.moments if moments is None else moments(here))
    return None


def step_down(solver: ImpulseSolver, here: Spent, moments: list[Moments]) -> Spent | None:
    """Return clear paths fired at moments that cost less than clear ones; None without any.

    They satisfy planes that the clear paths satisfy; planes violated on the way are added.
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
    """Return the contacts of conflicts of paths that were found, with normals that clear paths satisfy."""
    problem, lost, met = solver.problem, found.checked.lost, solver.problem.met(found.checked.missed)
    if solver.failures is not None:
        lost = lost._replace(normals=problem.normals(solver.failures.brief(clear.flown), lost, -inf))
    return lost.joined(met._replace(normals=problem.normals(clear.flown, met, -inf)))


def step_near(solver: ImpulseSolver, here: Spent, moments: list[Moments]) -> Spent | None:
    """Return paths fired at moments that are clear or nearest to it; None without any."""
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
