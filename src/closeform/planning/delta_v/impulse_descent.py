"""Descent from clear impulsive paths to cheaper ones, and steps from nearly clear paths to clear ones."""

from collections.abc import Callable

from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.firing_times import Moments
from closeform.planning.delta_v.impulse_solver import LAST, SAFER, ImpulseSolver, Program
from closeform.planning.loop import Approach, Descent, run


def descended(solver: ImpulseSolver, best: Spent) -> Spent:
    """Return clear paths of no higher cost than the given ones, fired at the same moments.

    The moments at the maxima of the primers are more, and are used where they save more than few impulses may
    cost.
    """
    few = at_rest(solver, best, lambda found: found.moments)
    many = at_rest(solver, few, solver.following)
    return many if SAFER * many.delta_v < few.delta_v else few


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
