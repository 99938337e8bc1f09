"""Paths of minimum-delta-v impulses, as arcs."""

from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, START, STATE
from closeform.motion.arc import WIDTH as ARC
from closeform.motion.hill import coast
from closeform.motion.minimum_delta_v.nonnegative import MOST
from closeform.motion.minimum_delta_v.reduced import COUNT, FIRST


@kernel(void(float64, float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, :, ::1], int64[::1]))
def fill_arcs(n: float, rows: Floats, finals: Floats, answers: Floats, arcs: Floats, counts: Any) -> None:
    """Fill `arcs` (P, 8, 30) and their `counts` (P,) from the `answers` and the states of `rows` (P, 30)."""
    for p in range(len(rows)):
        row, answer = rows[p], answers[p]
        x, y, z, vx, vy, vz = row[STATE], row[7], row[8], row[9], row[10], row[11]
        duration, now, count = row[END] - row[START], 0.0, 0
        for k in range(int(answer[COUNT]) + 1):
            last = k == int(answer[COUNT])
            then = duration if last else answer[FIRST + 4 * k]
            arc = arcs[p, count]
            waits = arc[IMPULSE] != 0.0 or arc[IMPULSE + 1] != 0.0 or arc[IMPULSE + 2] != 0.0
            if then > now or (last and count == 0) or (waits and not last):  # simultaneous firings
                arc[START], arc[END] = row[START] + now, row[START] + then
                if then == duration:
                    arc[END] = row[END]
                arc[MEAN_MOTION] = n
                arc[STATE], arc[7], arc[8], arc[9], arc[10], arc[11] = x, y, z, vx, vy, vz
                x, y, z, vx, vy, vz = coast(n, then - now, x, y, z, vx, vy, vz)
                now = then
                count += 1
                arc = arcs[p, count]
            if last:
                break
            push = answer[FIRST + 4 * k + 1 : FIRST + 4 * k + 4]
            for axis in range(3):
                arc[IMPULSE + axis] += push[axis]
            vx, vy, vz = vx + push[0], vy + push[1], vz + push[2]
        if now > 0.0 and (
            arcs[p, count, IMPULSE] != 0.0 or arcs[p, count, 4] != 0.0 or arcs[p, count, 5] != 0.0
        ):
            arc = arcs[p, count]  # the last impulse is at the end
            arc[START] = arc[END] = row[END]
            arc[MEAN_MOTION] = n
            for i in range(6):
                arc[STATE + i] = finals[p, i]
            count += 1
        counts[p] = count


def impulse_trajectories(
    mean_motion: float, arcs: Floats, finals: Floats, found: Floats
) -> tuple[Floats, Any]:
    """Return the arcs of plans from their answers, and the offsets of each plan's arcs."""
    trajectories, offsets = np.zeros((len(arcs), MOST + 2, ARC)), np.zeros(len(arcs) + 1, dtype=np.int64)
    fill_arcs(mean_motion, arcs, finals, found, trajectories, offsets[1:])
    used = np.arange(MOST + 2) < offsets[1:, None]
    return trajectories[used], offsets.cumsum()
