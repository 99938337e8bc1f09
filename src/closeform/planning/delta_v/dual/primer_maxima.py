"""Maxima of a craft's primer, or of its component along a thruster: the best firing times."""

from math import cos, inf, sin, sqrt

import numpy as np
from numba import float64

from closeform._jit import kernel
from closeform.motion.arc import END, MEAN_MOTION, START, acceleration
from closeform.motion.hill import coast
from closeform.motion.minimum_delta_v.primer import peaks
from closeform.planning.delta_v.dual.fleet import DUAL, FLEET, PLANES, coast_state, cut_of, is_free
from closeform.planning.problem.scene import INDICES, PAIRS, ROWS

BETWEEN = 1e-7  # maximum difference of d . p from cubics between its samples


@kernel()
def add_push(n, planes, k, i, multiplier, t, state):
    """Add the effect of a plane to the primer's state at time t before the plane's time.

    At that time the primer is the plane's row in the velocity, and its rate follows from Hill's equations.
    """
    force = -multiplier if planes.first[k] == i else multiplier
    row = planes.rows[k]
    x, y, z, vx, vy, vz = coast(
        *(n, t - planes.times[k], -force * row[3], -force * row[4], -force * row[5]),
        *(force * (row[0] - 2.0 * n * row[4]), force * (row[1] + 2.0 * n * row[3]), force * row[2]),
    )
    state[0] += x
    state[1] += y
    state[2] += z
    state[3] += vx
    state[4] += vy
    state[5] += vz


@kernel()
def share_along(n, t, c, spin, angle, d):
    """Return d . p and its rate at time t after the primer's state `c`; d (3,) rotates backwards."""
    x, y, z, vx, vy, vz = coast(n, t, c[0], c[1], c[2], c[3], c[4], c[5])
    cosine, sine = cos(angle + spin * t), sin(angle + spin * t)
    dx, dy = d[0] * cosine + d[1] * sine, d[1] * cosine - d[0] * sine
    return dx * x + dy * y + d[2] * z, dx * vx + dy * vy + d[2] * vz + spin * (dy * x - dx * y)


@kernel()
def fourth_derivative(n, duration, c, spin):
    """Return a bound on the fourth derivative of d . p, for any unit vector d that rotates by `spin`."""
    ax, ay, az = acceleration(n, c[0], c[2], c[3], c[4])
    jx, jy, jz = acceleration(n, c[3], c[5], ax, ay)
    a, b = sqrt(ax * ax + ay * ay + az * az), sqrt(jx * jx + jy * jy + jz * jz)
    bend = a + b * (min(duration, 1.0 / n) if n > 0.0 else duration)  # |p''| of a natural motion:
    jerk = b + a * n * min(n * duration, 1.0)  # p'' cos + p''' sin / n
    speed = sqrt(c[3] * c[3] + c[4] * c[4] + c[5] * c[5]) + duration * bend
    place = sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) + duration * speed
    return n * n * bend + spin * (4.0 * jerk + spin * (6.0 * bend + spin * (4.0 * speed + spin * place)))


@kernel()
def peaks_along(n, duration, c, spin, angle, d, level, instants):
    """Fill `instants` with local maxima of d . p over [0, duration] of at least `level`.

    Returns their number, and a certified bound on d . p: between samples h apart it differs from the cubic of
    its values and rates by at most h^4/384 of its fourth derivative.
    """
    rest = fourth_derivative(n, duration, c, spin) * duration**4 / 384.0
    pieces = int((rest / BETWEEN) ** 0.25) + 2
    h = duration / pieces
    rest /= float(pieces) ** 4
    low, a, count, highest, before, when, rises = 0.0, 0.0, 0, -inf, -inf, 0.0, True
    for k in range(pieces + 1):
        high, b = share_along(n, k * h, c, spin, angle, d)
        if k > 0:
            top, at = (high, 1.0) if high > low else (low, 0.0)
            q, r = 3.0 * (high - low) - h * (2.0 * a + b), 2.0 * (low - high) + h * (a + b)
            square = q * q - 3.0 * r * h * a  # of the cubic low + h a s + q s^2 + r s^3: falls at s
            s = h * a / (sqrt(square) - q) if square > 0.0 else 0.0
            value = low + s * (h * a + s * (q + s * r))
            if 0.0 < s < 1.0 and value > top:
                top, at = value, s
            if rises and top < before and before >= level and count < len(instants):
                instants[count] = when
                count += 1
            rises, before, when = top >= before, top, (k - 1 + at) * h
            highest = max(highest, top)
        low, a = high, b
    if rises and before >= level and count < len(instants):
        instants[count] = when
        count += 1
    return count, highest + rest


@kernel(float64(FLEET, PLANES, DUAL, float64, ROWS, PAIRS, INDICES))
def find_peaks(fleet, planes, dual, level, times, which, counts):
    """Fill the times and directions of local maxima above `level` of each craft's |p|, or d . p of thrusters.

    They are filled in `times` (N, M) and `which` (N, M).  Returns a certified bound on the largest, at least
    `level`: divided by it, the dual point is feasible at all times.
    """
    room, number = times.shape[1], len(planes.times)
    instants, squares, state, order = np.empty(room), np.empty(room), np.empty(6), np.empty(number + 1)
    highest = level
    for i in range(len(fleet.base)):
        n, start, end = fleet.base[i, MEAN_MOTION], fleet.base[i, START], fleet.base[i, END]
        spin = fleet.spins[i]
        pieces = 0
        for k in range(number):
            if planes.first[k] == i or planes.second[k] == i:
                place, cut = pieces, min(cut_of(planes, k, i), end)
                while place > 0 and order[place - 1] > cut:
                    order[place] = order[place - 1]
                    place -= 1
                order[place] = cut
                pieces += 1
        order[pieces] = end
        counts[i] = 0
        t = start
        for piece in range(pieces + 1):
            if not order[piece] > t:
                continue
            coast_state(n, t - start, dual.starts[i], state)
            for k in range(number):
                if (planes.first[k] == i or planes.second[k] == i) and cut_of(planes, k, i) >= order[piece]:
                    add_push(n, planes, k, i, dual.multipliers[k], t, state)
            for one in range(fleet.numbers[i]):
                d, duration = fleet.directions[i, one], order[piece] - t
                if is_free(d):
                    found, high = peaks(n, duration, state, level, instants, squares)
                    high = sqrt(high)
                else:
                    found, high = peaks_along(n, duration, state, spin, spin * t, d, level, instants)
                highest = max(highest, high)
                for m in range(found):
                    if counts[i] < room:
                        times[i, counts[i]] = min(t + instants[m], order[piece])
                        which[i, counts[i]] = one
                        counts[i] += 1
            t = order[piece]
    return highest
