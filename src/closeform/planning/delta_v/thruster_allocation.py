"""Allocation of impulses in any direction to thrusters: same paths, up to √3 times the delta-v with six."""

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.allocation import Allocation
from closeform.fuel.thrusters import Thrusters
from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.firing_times import Moments, pushes_table, some_of_each
from closeform.planning.delta_v.impulse_solver import ImpulseSolver

NOTHING = 1e-12  # of the largest impulse: smaller ones are zero


def shared(solver: ImpulseSolver, free: Spent) -> Spent | None:
    """Return the same paths with the craft's thrusters; None where they cannot produce an impulse."""
    fired = np.linalg.norm(free.impulses, axis=2) > 0.0
    every = some_of_each(free.moments, fired)
    moments, pushes = [], []
    for own, given, some, thrusters in zip(every, free.impulses, fired, solver.thrusters, strict=True):
        given = given[some]
        if thrusters is not None:
            among = allotted(own, given, thrusters, solver.problem.orbit._rate)
            if among is None:
                return None
            own, given = among
        moments.append(own)
        pushes.append(given)
    return solver.fired_at(moments, pushes_table(pushes), free)


def allotted(
    own: Moments, pushes: Floats, thrusters: Thrusters, mean_motion: float
) -> tuple[Moments, Floats] | None:
    """Return one craft's impulses `pushes` (J, 3), shared among thrusters with the minimum sum."""
    allocation = Allocation.of(thrusters.directions)
    angles = mean_motion * own.times * (thrusters.frame == "inertial")
    c, s, x, y = np.cos(angles), np.sin(angles), pushes[:, 0], pushes[:, 1]
    turned = np.column_stack([c * x - s * y, s * x + c * y, pushes[:, 2]])  # to the thrusters' axes
    nothing = NOTHING * float(np.linalg.norm(pushes, axis=1).max(initial=0.0))
    facets = allocation.facets(turned, nothing)
    amounts, which = allocation.amounts(facets, turned).ravel(), allocation.corners[facets].ravel()
    used = np.flatnonzero(amounts > nothing)
    if (which[used] >= len(thrusters)).any():
        return None
    times = np.repeat(own.times, 3)
    used = used[np.lexsort((which[used], times[used]))]
    found = Moments.instants(times[used], which[used])
    x, y, z = (thrusters.directions[found.which] * amounts[used, None]).T
    c, s = np.repeat(c, 3)[used], np.repeat(s, 3)[used]
    return found, np.column_stack([c * x + s * y, c * y - s * x, z])
