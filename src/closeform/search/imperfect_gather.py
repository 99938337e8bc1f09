"""Gatherings of craft with search errors: each has its own attitude, clock, cone and range.

The sequence of events is that of `gather_events`; only the prediction of locks differs.
"""

from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import lent
from closeform.search.gather_events import FLOWN, fly_cases
from closeform.search.lock_march import LockSensor
from closeform.search.next_locks import Astray, Turns


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
    """Simulate gatherings with errors `craft` (C, N, 8) and near-field burns `pushes`, until `ends` (C,)."""
    swings, see = np.empty((2, 16)), LockSensor(0.0, 0.0, 0.0)
    for c in range(len(positions)):
        turned = lent(Astray(own, craft[c], offset, swings))
        turns = Turns(legs, first, second, ends[c], pushes[c], False, see, turned)
        one = slice(c, c + 1)
        kept, flaws = (keeps, kinds, table, boxes, matrices), (fails[one], gates, normals[one])
        flown = positions[one], velocities[one], events, labels[one], results[one]
        fly_cases(turns, ways, *kept, *flaws, *flown)
