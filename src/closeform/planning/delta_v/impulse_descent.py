"""Descent from clear impulsive paths to cheaper ones, and steps from nearly clear paths to clear ones."""

from collections.abc import Callable
from math import inf, sqrt

from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.firing_times import Moments
from closeform.planning.delta_v.impulse_solver import LAST, SAFER, ImpulseSolver, Program
from closeform.planning.loop import Approach, Descent, run

LEVELS, CLOSER = 14, 1.07  # intermediate thrusts tried, and the minimum ratio between them


def descended(solver: ImpulseSolver, best: Spent) -> Spent:
    """Return clear paths of no higher cost than the given ones, fired at the same moments.

    The moments at the maxima of the primers are more, and are used where they save more than few impulses may
    cost.
    """
    few = at_rest(solver, best, lambda found: found.moments)
    many = at_rest(solver, few, solver.following)
    return many if SAFER * many.cost < few.cost else few


def at_rest(solver: ImpulseSolver, best: Spent, moments: Callable[[Spent], list[Moments]]) -> Spent:
    """Return the end of a descent from clear paths, in steps that fire at `moments` of the paths before."""
    found: Spent = run(Descent(solver, lambda one: Program(solver.turned(one), moments(one)), LAST), best)
    return found


def cleared(
    solver: ImpulseSolver, near: Spent, moments: Callable[[Spent], list[Moments]] | None = None
) -> Spent | None:
    """Return clear paths to the final states, in steps from nearly clear ones; None without any.

    A step fires at `moments` of the paths before, by default always at those of the first paths.
    """

    def program(one: Spent) -> Program:
        return Program(solver.turned(one), near.moments if moments is None else moments(one))

    found: Spent | None = run(Approach(solver, program, LAST), near)
    return found


def tightened(
    about: Callable[[float, Spent], tuple[ImpulseSolver, Spent] | None],
    safe: Spent,
    reached: float,
    tried: float = 1.0,
) -> tuple[Spent | None, float]:
    """Return clear paths near safe ones whose thrust is `reached` times as large; None without any.

    `about` returns a solver for a multiple of the thrust, and its paths near given ones.  Where these cannot
    be made clear by short steps, the thrust is reduced gradually, with bisection from `tried`.  The
    second result is the smallest multiple of the thrust for which clear paths were found, inf without any.
    """
    enough = inf
    for _ in range(LEVELS):
        near = about(tried, safe)
        found = None if near is None else cleared(*near)
        if found is not None:
            if tried == 1.0:
                return found, tried
            enough = reached = tried
            safe, tried = found, 1.0
        elif reached < CLOSER * tried:
            break
        else:
            tried = sqrt(tried * reached)
    return None, enough
