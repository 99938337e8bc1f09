"""Maxima of a craft's primer, or of its component along a thruster: the best firing times."""

from math import cos, inf, sin, sqrt

import numpy as np
from numba import float64

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix
from closeform.motion.arc import END, MEAN_MOTION, START, acceleration
from closeform.motion.chief.bernstein import PRODUCT, SQUARE, TERMS, keep_piece
from closeform.motion.chief.clock import angle_at, time_at
from closeform.motion.chief.impulses import DEPTH, note, primer_in, window_maxima
from closeform.motion.chief.segments import squared, window_at
from closeform.motion.hill import coast
from closeform.motion.minimum_delta_v.primer import peaks
from closeform.planning.delta_v.dual.fleet import DUAL, FLEET, PLANES, cut_of, fill_effects, is_free
from closeform.planning.problem.natural_motion import state_after
from closeform.planning.problem.scene import INDICES, PAIRS, ROWS

BETWEEN = 1e-7  # maximum difference of d . p from cubics between its samples


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


@kernel()
def part_along(d, p, f):
    """Fill `f` (SQUARE,) with the coefficients of d . p, the polynomial of `p` (3, 12) along a direction."""
    f[:] = 0.0
    for i in range(TERMS):
        share = d[0] * p[0, i] + d[1] * p[1, i] + d[2] * p[2, i]
        for j in range(TERMS):
            f[i + j] += PRODUCT[i, j] * share


@kernel()
def peaks_beside(fleet, c, d, t, end, level, work, instants, heights):
    """Find the local maxima of |p|, or of d . p, of at least `level` about a chief, in times since t.

    `c` (6,) is the primer at the first time.  Returns the number of maxima, ends included, and a certified
    bound on |p| or d . p.
    """
    joints, p, free = fleet.joints, stack_matrix(3, 12), is_free(d)
    floor = level * level if free else level
    stack, _, spare = work
    first, last = angle_at(fleet.clock, t), angle_at(fleet.clock, end)
    most, value, rose, count = floor, 0.0, True, 0
    opening, final = window_at(joints, 0.0, first)[0], window_at(joints, 0.0, last)[0]
    if final > opening and not last > joints[final]:
        final -= 1
    for w in range(opening, final + 1):
        low, length = joints[w], joints[w + 1] - joints[w]
        primer_in(fleet.flows[w], c, p)
        for axis in range(3):
            keep_piece(p[axis], max((first - low) / length, 0.0), min((last - low) / length, 1.0), spare)
        if free:
            squared(p, stack[0])
        else:
            part_along(d, p, stack[0])
        count, high, value, rose = window_maxima(w, floor, rose, work, instants, heights, count)
        most = max(most, high)
    if value >= floor and rose:
        count = note(instants, heights, count, final + 1.0, value)
    for m in range(count):
        w = min(int(instants[m]), final)
        low, high = max(joints[w], first), min(joints[w + 1], last)
        instants[m] = time_at(fleet.clock, low + (instants[m] - w) * (high - low)) - t
    return count, sqrt(most) if free else most


@kernel(float64(FLEET, PLANES, DUAL, float64, ROWS, PAIRS, INDICES))
def find_peaks(fleet, planes, dual, level, times, which, counts):
    """Fill the times and directions of local maxima above `level` of each craft's |p|, or d . p of thrusters.

    They are filled in `times` (N, M) and `which` (N, M).  Returns a certified bound on the largest, at least
    `level`: divided by it, the dual point is feasible at all times.
    """
    room, number = times.shape[1], len(planes.times)
    instants, heights, state, order = np.empty(room), np.empty(room), np.empty(6), np.empty(number + 1)
    work = np.empty((DEPTH, SQUARE)), np.empty(DEPTH), np.empty(SQUARE)
    effects, highest = np.empty((number, 6)), level
    fill_effects(fleet, planes, effects)
    for i in range(len(fleet.base)):
        start, end = fleet.base[i, START], fleet.base[i, END]
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
            for a in range(6):
                state[a] = dual.starts[i, a]
            for k in range(number):
                if (planes.first[k] == i or planes.second[k] == i) and cut_of(planes, k, i) >= order[piece]:
                    force = dual.multipliers[k] if planes.first[k] == i else -dual.multipliers[k]
                    for a in range(6):
                        state[a] += force * effects[k, a]
            if len(fleet.clock) == 0:
                state_after(fleet, fleet.span[0], t, state)
            for one in range(fleet.numbers[i]):
                d, until = fleet.directions[i, one], order[piece]
                if len(fleet.clock) > 0:
                    found, high = peaks_beside(fleet, state, d, t, until, level, work, instants, heights)
                elif is_free(d):
                    n = fleet.base[i, MEAN_MOTION]
                    found, high = peaks(n, until - t, state, level, instants, heights)
                    high = sqrt(high)
                else:
                    n, spin = fleet.base[i, MEAN_MOTION], fleet.spins[i]
                    found, high = peaks_along(n, until - t, state, spin, spin * t, d, level, instants)
                highest = max(highest, high)
                for m in range(found):
                    if counts[i] < room:
                        times[i, counts[i]] = min(t + instants[m], until)
                        which[i, counts[i]] = one
                        counts[i] += 1
            t = order[piece]
    return highest
