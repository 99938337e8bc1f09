"""Where the paths of a formation come close: a quick look between the certified ones.

Samples find the dips of every pair's norm, which are then followed to their lowest point.  A
dip that is missed costs a round of planning, not safety: the march has the last word.
"""

from math import inf, sqrt

import numpy as np
from numba import float64, int64, void

from closeform.compiled import kernel
from closeform.motion.arc import END, START, state_at
from closeform.motion.march import locate
from closeform.planning.contacts import slide
from closeform.planning.kernel import relative
from closeform.planning.newton import approach_rate, p_norm
from closeform.zones.shapes import BALL, CUBE, norm

LEVEL = 1e-13  # slope times width, in zones, at which a dip's lowest point is known
SETTLED = 1e-8  # of its window, to which a contact's time is settled


@kernel(void(float64[:, ::1], int64[::1], float64[::1], float64[:, :, ::1]))
def sample(arcs, offsets, times, states):
    """States (B, T, 6) of all bodies at `times`; the first is inf where a body is not there."""
    for c in range(len(offsets) - 1):
        first, last = offsets[c], offsets[c + 1]
        for k in range(len(times)):
            if not arcs[first, START] <= times[k] <= arcs[last - 1, END]:
                states[c, k, 0] = inf
                continue
            state = state_at(arcs[locate(arcs, first, last, times[k])], times[k])
            for i in range(6):
                states[c, k, i] = state[i]


@kernel()
def apart(one, other, matrix, shape):
    """Norm of two bodies' relative position, and its speed in zones a second."""
    if one[0] == inf or other[0] == inf:
        return inf, 0.0
    x, y, z, vx, vy, vz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(3):
        gap, speed = one[j] - other[j], one[3 + j] - other[3 + j]
        x, y, z = x + matrix[0, j] * gap, y + matrix[1, j] * gap, z + matrix[2, j] * gap
        vx, vy, vz = vx + matrix[0, j] * speed, vy + matrix[1, j] * speed, vz + matrix[2, j] * speed
    return norm(shape, matrix, x, y, z), sqrt(vx * vx + vy * vy + vz * vz)


@kernel()
def spread(states, places):
    """Positions (B, 3, T), axis by axis, for loops that become vector instructions; greatest speeds (B,)."""
    fastest = np.zeros(len(states))
    for c in range(len(states)):
        for k in range(states.shape[1]):
            for i in range(3):
                places[c, i, k] = states[c, k, i] if states[c, k, 0] < inf else 1e150
            if states[c, k, 0] < inf:
                vx, vy, vz = states[c, k, 3], states[c, k, 4], states[c, k, 5]
                fastest[c] = max(fastest[c], sqrt(vx * vx + vy * vy + vz * vz))
    return fastest


@kernel()
def nearest_sample(one, other, squares):
    """Least squared distance of two bodies over the samples."""
    for k in range(len(squares)):
        x, y, z = one[0, k] - other[0, k], one[1, k] - other[1, k], one[2, k] - other[2, k]
        squares[k] = x * x + y * y + z * z
    least = squares[0]
    for k in range(1, len(squares)):
        least = squares[k] if squares[k] < least else least
    return least


@kernel()
def lowest_between(rows, others, first, last, matrix, power, start, end, work, normal):
    """Time of the least norm between two times that hold one dip: false position (Illinois)."""
    a, b = start, end
    relative(rows, len(rows), others, first, last, matrix, a, work)
    falling = approach_rate(power, work, normal)
    if falling >= 0.0:
        return a
    relative(rows, len(rows), others, first, last, matrix, b, work)
    rising = approach_rate(power, work, normal)
    if rising <= 0.0:
        return b
    side = 0
    for _ in range(40):
        t = (a * rising - b * falling) / (rising - falling)
        relative(rows, len(rows), others, first, last, matrix, t, work)
        slope = approach_rate(power, work, normal)
        if abs(slope) * (b - a) < LEVEL:
            return t
        if slope < 0.0:
            a, falling = t, slope
            rising *= 0.5 if side < 0 else 1.0
            side = -1
        else:
            b, rising = t, slope
            falling *= 0.5 if side > 0 else 1.0
            side = 1
    return t


@kernel(
    int64(
        float64[:, ::1],
        int64[::1],
        float64[::1],
        float64[:, :, ::1],
        int64[:, ::1],
        float64[:, :, ::1],
        float64[::1],
        float64[::1],
        float64[::1],
        float64[:, ::1],
    )
)
def dips(arcs, offsets, times, states, pairs, matrices, radii, powers, aims, found):
    """Fill `found` with rows (pair, time, ratio) of dips below the aimed norm; how many there are.

    Of each pair: the matrix, greatest half-axis, power and aimed norm of its zone.  More dips than rows
    are counted, not kept.  A rounded box is sampled as the box that it is in, whose norm is less.
    """
    work, normal = np.empty((3, 3)), np.empty(3)
    widest = np.diff(times).max()
    count, last = 0, len(times) - 1
    places, squares = np.empty((len(states), 3, len(times))), np.empty(len(times))
    fastest = spread(states, places)
    for p in range(len(pairs)):
        i, j = pairs[p]
        reach = aims[p] * radii[p] + widest * (fastest[i] + fastest[j])
        if nearest_sample(places[i], places[j], squares) > reach * reach:
            continue
        matrix, power, aim = matrices[p], powers[p], aims[p]
        shape = CUBE if power > 2.0 else BALL
        before, here = inf, inf
        after, speed = apart(states[i, 0], states[j, 0], matrix, shape)
        for k in range(len(times)):
            before, here, pace = here, after, speed
            after = inf
            if k < last:
                after, speed = apart(states[i, k + 1], states[j, k + 1], matrix, shape)
            if here == inf or here > before or here > after or here - pace * widest > aim:
                continue
            start = max(times[max(k - 1, 0)], arcs[offsets[i], START], arcs[offsets[j], START])
            end = min(times[min(k + 1, last)], arcs[offsets[i + 1] - 1, END], arcs[offsets[j + 1] - 1, END])
            rows = arcs[offsets[i] : offsets[i + 1]]
            a, b = offsets[j], offsets[j + 1]
            when = times[k]
            if start < end:
                when = lowest_between(rows, arcs, a, b, matrix, power, start, end, work, normal)
            relative(rows, len(rows), arcs, a, b, matrix, when, work)
            ratio = p_norm(power, work[0, 0], work[0, 1], work[0, 2])
            if ratio < aim:
                if count < len(found):
                    found[count, 0], found[count, 1], found[count, 2] = p, when, ratio
                count += 1
    return count


@kernel(
    void(
        float64[:, ::1],
        int64[::1],
        int64[:, ::1],
        float64[:, :, ::1],
        float64[::1],
        float64[:, ::1],
        float64[::1],
    )
)
def settle(arcs, offsets, pairs, matrices, powers, windows, times):
    """Move each contact's time to the dip of its pair's norm that lies downhill, within its window."""
    work, normal = np.empty((3, 3)), np.empty(3)
    for k in range(len(times)):
        i, j = pairs[k]
        rows = arcs[offsets[i] : offsets[i + 1]]
        times[k] = slide(
            rows,
            len(rows),
            arcs,
            offsets[j],
            offsets[j + 1],
            matrices[k],
            powers[k],
            times[k],
            windows[k, 0],
            windows[k, 1],
            SETTLED,
            work,
            normal,
        )
