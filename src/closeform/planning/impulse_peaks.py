"""When a craft's primer is longest: the times at which it should fire."""

from math import sqrt

import numpy as np
from numba import float64

from closeform.compiled import kernel
from closeform.kernel_loans import lent
from closeform.motion.arc import END, MEAN_MOTION, START
from closeform.motion.hill import coast
from closeform.motion.primer import peaks
from closeform.planning.impulse_scene import DUAL, FLEET, PLANES, coast_state
from closeform.planning.scene import INDICES, ROWS


@kernel()
def add_push(n, planes, k, i, multiplier, t, state):
    """Add to the primer's state at time t what a plane does to it before the plane's time."""
    force = -multiplier if planes.first[k] == i else multiplier
    row = planes.rows[k]
    x, y, z, vx, vy, vz = coast(
        n, t - planes.times[k], 0.0, 0.0, 0.0, force * row[0], force * row[1], force * row[2]
    )
    state[0] += x
    state[1] += y
    state[2] += z
    state[3] += vx
    state[4] += vy
    state[5] += vz


@kernel(float64(FLEET, PLANES, DUAL, float64, ROWS, INDICES))
def find_peaks(fleet, planes, dual, level, times, counts):
    """Fill `times` (N, M) with where each craft's |p| is locally greatest and above `level`; the greatest.

    The latter is certain, and `level` at least: divided by it the point is feasible at all times.
    """
    fleet, planes = lent(fleet), lent(planes)
    room, number = times.shape[1], len(planes.times)
    instants, squares, state, order = np.empty(room), np.empty(room), np.empty(6), np.empty(number + 1)
    highest = level * level
    for i in range(len(fleet.base)):
        n, start, end = fleet.base[i, MEAN_MOTION], fleet.base[i, START], fleet.base[i, END]
        pieces = 0
        for k in range(number):
            if planes.first[k] == i or planes.second[k] == i:
                place = pieces
                while place > 0 and order[place - 1] > planes.times[k]:
                    order[place] = order[place - 1]
                    place -= 1
                order[place] = planes.times[k]
                pieces += 1
        order[pieces] = end
        counts[i] = 0
        t = start
        for piece in range(pieces + 1):
            if not order[piece] > t:
                continue
            coast_state(n, t - start, dual.starts[i], state)
            for k in range(number):
                if (planes.first[k] == i or planes.second[k] == i) and planes.times[k] >= order[piece]:
                    add_push(n, planes, k, i, dual.multipliers[k], t, state)
            found, high = peaks(n, order[piece] - t, state, level, instants, squares)
            highest = max(highest, high)
            for m in range(found):
                if counts[i] < room:
                    times[i, counts[i]] = min(t + instants[m], order[piece])
                    counts[i] += 1
            t = order[piece]
    return sqrt(highest)
