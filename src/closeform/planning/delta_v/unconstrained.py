"""Minimum delta-v of single craft without keep-out zones, with their thrusters."""

from collections.abc import Sequence
from math import inf

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.thrusters import Thrusters
from closeform.motion.construction.ends import arcs_between
from closeform.motion.minimum_delta_v.reduced import ANSWER, LOWER
from closeform.motion.orbit import Orbit


def answers_alone(
    orbit: Orbit,
    arcs: Floats,
    finals: Floats,
    thrusters: Sequence[Thrusters | None],
    names: Sequence[str],
) -> Floats:
    """Return the solutions (P, 34) of one transfer of each craft, as `Orbit._answers` does.

    Raises ValueError, naming the craft and the reason, if its thrusters cannot perform its transfer.
    """
    free = np.array([own is None for own in thrusters])
    if free.all():
        return orbit._answers(arcs, finals)
    # Imported here, because only thrusters need linear programs.
    from closeform.motion.minimum_delta_v.directed import answers_of

    found = np.empty((len(arcs), ANSWER))
    if free.any():
        found[free] = orbit._answers(arcs[free], finals[free])
    for i, own in enumerate(thrusters):
        if own is not None:
            one = slice(i, i + 1)
            found[one] = answers_of(own, orbit.mean_motion, arcs[one], finals[one], names[one])
    return found


def costs_alone(
    orbit: Orbit,
    initial: Floats,
    finals: Floats,
    durations: Floats,
    starts: Floats,
    thrusters: Sequence[Thrusters | None],
    names: Sequence[str],
) -> Floats:
    """Return the minimum delta-v (N, S) from each craft to each of its final states (N, S, 6).

    It is inf where the thrusters cannot perform the transfer.
    Raises ValueError for a craft that can reach none of its states.
    """
    given = orbit.mean_motion, initial[:, None], finals, durations[:, None], starts[:, None]
    arcs, ends = arcs_between(*given)
    costs = np.empty(arcs.shape[:2])
    for i, own in enumerate(thrusters):
        refused: list[ValueError] = []
        for s, (arc, end) in enumerate(zip(arcs[i], ends.reshape(*costs.shape, 6)[i], strict=True)):
            try:
                row = answers_alone(orbit, arc[None], end[None], (own,), (names[i],))
                costs[i, s] = row[0, LOWER]
            except ValueError as error:
                costs[i, s] = inf
                refused.append(error)
        if len(refused) == len(costs[i]):
            raise refused[0]
    return costs
