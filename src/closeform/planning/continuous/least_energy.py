"""Paths of minimum energy: choice of the search by requirement."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, islice
from math import inf, nan

from closeform.planning.continuous.energy_solver import EnergySolver
from closeform.planning.continuous.safe_energy import safe_energy
from closeform.planning.delta_v.delta_v_search import outcome_of, starts
from closeform.planning.energy.side_search import MARGINS
from closeform.planning.minimum_energy import Outcome, solve
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import Contacts

ONE, MANY, MORE = 8, 4, 3  # starts for one craft and for many; factor where none of these is clear


def least_energy(
    problem: Problem, budget: int | None = None, more: bool = False, waiting: bool = True
) -> Outcome:
    """Return the best paths of minimum energy, from the search that the requirements need.

    See `minimum_energy.solve` for the arguments.  With `waiting`, passively safe paths are also sought near
    a two-impulse plan with waits.
    """
    if problem.drift is not None:
        return safe_energy(problem, budget, more, waiting)
    if not (problem.sigmas or problem.requirements):
        return solve(problem, budget, more)
    solver = EnergySolver(problem)
    free, best, tried = solver.unconstrained(), None, 0
    solver.closest.note(free.checked.worst, free.trajectories, free.checked.outside)
    most = budget or (ONE if problem.count == 1 else MANY) * (MORE if more else 1)
    for start in islice(chain(sides(problem), starts(solver, free, lambda: solve(problem))), most):
        found = solver.solve(start, inf if best is None else best.cost)
        best = found if best is None or (found is not None and found.cost < best.cost) else best
        tried += 1
    least = solver.requirement_bound() if problem.requirements else 0.0
    if best is None:
        return Outcome(None, (), nan, MARGINS[0], tried, closest=solver.closest, least=least)
    clear = outcome_of(solver, best, tried)
    return replace(clear, extra=best.cost - solver.least_energy, delta_v=nan, least=min(least, best.cost))


def sides(problem: Problem) -> Iterator[Contacts]:
    """Yield starts for zones with sigmas."""
    if problem.sigmas:
        from closeform.planning.sigmas.sigma_problem import SigmaProblem
        from closeform.planning.sigmas.sigma_sides import sides_of_enlarged

        assert isinstance(problem, SigmaProblem)
        yield from sides_of_enlarged(problem, MARGINS[0])
