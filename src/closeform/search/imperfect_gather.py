"""Gatherings of craft that search imperfectly: each has its own attitude, clock, cone and range.

All else is as in `gather_events`: only the next lock of a pair is another.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import lent
from closeform.search.gather_events import FLOWN, fly_cases
from closeform.search.imperfect import imperfect_lock
from closeform.search.next_locks import Turns


class Astray(NamedTuple):
    """What craft see with: the search's `turns` (L, 29); a row of `craft` (N, 8) each; their `offset` [m].

    `swings` (2, 16) is room for how two of them turn.
    """

    turns: Floats
    craft: Floats
    offset: float
    swings: Floats


@kernel()
def astray(turns, i, j, t, position, velocity):
    """When craft i of A and j of B lock next; the position is that at time 0."""
    see = turns.see
    one, other = see.craft[i], see.craft[j]
    when, _ = imperfect_lock(see.turns, t, position, velocity, see.offset, one, other, see.swings)
    return when


@kernel(
    void(
        float64[:, ::1],
        int64[::1],
        int64[::1],
        float64[:, :, ::1],
        float64[:, ::1],
        float64[:, :, ::1],
        float64[::1],
        float64,
        *FLOWN,
    )
)
def fly_astray(
    legs: Floats,
    first: Any,
    second: Any,
    pushes: Floats,
    own: Floats,
    craft: Floats,
    ends: Floats,
    offset: float,
    ways: Any,
    keeps: bool,
    kinds: Any,
    table: Any,
    boxes: Any,
    matrices: Floats,
    fails: Floats,
    gates: Floats,
    normals: Floats,
    positions: Floats,
    velocities: Floats,
    events: Floats,
    labels: Any,
    results: Floats,
) -> None:
    """Fly gatherings whose craft (C, N, 8) differ, with `pushes` (C, P, 6), until `ends` (C,)."""
    swings = np.empty((2, 16))
    for c in range(len(positions)):
        see = lent(Astray(own, craft[c], offset, swings))
        turns = Turns(legs, first, second, ends[c], pushes[c], astray, see)
        one = slice(c, c + 1)
        kept, flaws = (keeps, kinds, table, boxes, matrices), (fails[one], gates, normals[one])
        flown = positions[one], velocities[one], events, labels[one], results[one]
        fly_cases(turns, ways, *kept, *flaws, *flown)
