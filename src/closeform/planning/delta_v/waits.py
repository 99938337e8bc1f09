"""Waits: shorter plans that coast on the natural motions at their ends.

A schedule is a time in which the craft may fire: after a wait on their initial natural motion, and before a
coast into their final states.  It is the same problem with quiet times, allowed where these coasts keep all
zones and requirements.  The times to fire are multiples of a fixed part of the orbit, whatever the duration,
so that where waiting is free a longer duration has the schedules of a shorter one.

Waits matter where a loss of thrust is planned for: the longer a plan lasts, the more of its free drifts
return to a zone, so that the minimum delta-v without zones is safe only over shorter times.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import ceil, inf

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START, STATE
from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.impulse_solver import ImpulseSolver
from closeform.planning.passive.two_impulse_plans import PARTS
from closeform.planning.problem.problem import Problem
from closeform.planning.requirements.no_thrust import NoThrust
from closeform.planning.requirements.requirement import largest_shortfall

LONGEST = 2.0  # orbits, of the times to fire that are tried
HALVINGS = 4  # bisections between two times to fire: the delta-v changes by 7 % from one to the next
ROUNDING = 1e-9  # of the duration: shorter waits are none
COARSE = 3  # of these times, every third one is searched, and used for a descent


def waiting(solver: ImpulseSolver, bar: float) -> tuple[Spent | None, float]:
    """Return the minimum delta-v with waits if it is clear and below `bar`, with its time to fire [s].

    It is the one of the longest time to fire over which the minimum delta-v without zones is clear.
    """
    after, found = inf, None
    for firing in firing_times(solver.problem):
        least = least_over(solver, firing)
        if least is not None and least.cost >= bar:
            break
        if least is not None and least.clear:
            found = least
            break
        after = firing
    if found is None:
        return None, 0.0
    for _ in range(HALVINGS if after < inf else 0):
        middle = 0.5 * (firing + after)
        least = least_over(solver, middle)
        if least is not None and least.clear:
            found, firing = least, middle
        else:
            after = middle
    return found, firing


def least_over(solver: ImpulseSolver, firing: float) -> Spent | None:
    """Return the minimum delta-v without zones over a time to fire [s]; None without any."""
    short = scheduled(solver, firing)
    return None if short is None else short.required


def firing_times(problem: Problem, step: int = 1) -> Iterator[float]:
    """Yield times to fire [s] that are shorter than the duration, the longest first, or each `step`th."""
    lasts = float(np.ptp(problem.base[:, [START, END]], axis=1).min())
    part = (problem.orbit.period if np.isfinite(problem.orbit.period) else lasts) / PARTS
    for number in range(min(ceil((1.0 - ROUNDING) * lasts / part), ceil(LONGEST * PARTS)) - 1, 0, -1):
        if number % step == 0:
            yield number * part


def scheduled(solver: ImpulseSolver, firing: float) -> ImpulseSolver | None:
    """Return the solver whose craft fire only for a time, after a wait or else before a coast.

    None if neither the wait nor the coast keeps all zones and requirements.
    """
    problem, orbit = solver.problem, solver.problem.orbit
    starts, ends = problem.base[:, START], problem.base[:, END]
    rests = ends - starts - firing
    begun = problem.base[:, STATE : STATE + 6]
    arriving = (orbit.transition(-rests, ends) @ solver.finals[:, :, None])[..., 0]
    if is_clear(problem, begun, rests, starts):
        edges = np.column_stack([starts + rests, ends])
    elif is_clear(problem, arriving, rests, ends - rests):
        edges = np.column_stack([starts, ends - rests])
    else:
        return None
    quiet = [
        (*own, NoThrust(start=-inf, end=first), NoThrust(start=last, end=inf))
        for own, (first, last) in zip(problem.requirements or [()] * problem.count, edges, strict=True)
    ]
    quiet_problem = replace(problem, requirements=tuple(quiet))
    short = ImpulseSolver(quiet_problem, solver.thrusters, solver.names, solver.failures)
    short.grid = short.spaced(*edges.T)
    return short


def is_clear(problem: Problem, states: Floats, lasts: Floats, since: Floats) -> bool:
    """Return whether coasts from states (N, 6) keep all zones and requirements, by proof."""
    coasts = problem.with_path(*map(problem.orbit.coast, states, lasts, since))
    return not (problem.conflicts(coasts) or largest_shortfall(problem.requirement_checks(coasts)))
