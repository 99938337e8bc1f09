"""The reproducing kernel of paths with fixed ends, and paths shaped by forces at contacts.

Paths between fixed end states form a Hilbert space with energy as its norm.  A force f at
time s, felt as a jump f of the thrust rate, deflects the least-energy path by

    K(t, s) f,   K(t, s) = -F_r(t) F(T)^-1 F_w(T - s) + [t > s] F_w(t - s)_r     # theory (12)

with F the response to a start thrust (columns u) and thrust rate (columns w), and rows r of
the position.  No Gramian is inverted in Palmer's coordinates, so nothing cancels as n T -> 0.
"""

import numpy as np

from closeform.compiled import kernel
from closeform.motion.arc import (
    END,
    MEAN_MOTION,
    START,
    STATE,
    THRUST,
    derivatives_at,
    primer_at,
    state_at,
)
from closeform.motion.hill import response
from closeform.motion.linear import copy, solve
from closeform.motion.march import locate


@kernel()
def invert_response(n, duration, inverse, matrix, rhs):
    """Fill `inverse` with F(T)^-1: the start thrust and rate that reach a state."""
    for k in range(6):
        response(n, duration, matrix)
        rhs[:] = 0.0
        rhs[k] = 1.0
        solve(matrix, rhs, 6)
        for i in range(6):
            inverse[i, k] = rhs[i]


@kernel()
def force_columns(n, t, matrix, jump, jump_rate):
    """Response after time t to a unit jump of the thrust rate, and its derivative in t (6, 3)."""
    if t <= 0.0:
        jump[:] = 0.0
        jump_rate[:] = 0.0
        return
    response(n, t, matrix)
    for i in range(6):
        for k in range(3):
            jump[i, k] = matrix[i, 3 + k]
            jump_rate[i, k] = matrix[i, k]
        jump_rate[i, 0] -= 2.0 * n * matrix[i, 4]
        jump_rate[i, 1] += 2.0 * n * matrix[i, 3]


@kernel()
def pull(n, duration, inverse, matrix, jump, jump_rate, out, out_rate):
    """What a force adds to the start thrust and rate, `duration` before the end, and its rate."""
    force_columns(n, duration, matrix, jump, jump_rate)
    for i in range(6):
        for k in range(3):
            total, slope = 0.0, 0.0
            for j in range(6):
                total -= inverse[i, j] * jump[j, k]
                slope += inverse[i, j] * jump_rate[j, k]
            out[i, k] = total
            out_rate[i, k] = slope


@kernel()
def influences(base, inverse, times, count, pulls, blocks, rates):
    """Influence of a force at each contact on the state at each, and its derivative in the force's time.

    `pulls` (count, 6, 3): what each force adds to the start thrust and rate; `blocks` and
    `rates` (count, count, 6, 3).
    """
    n = base[MEAN_MOTION]
    matrix = np.empty((6, 6))
    jump = np.empty((6, 3))
    jump_rate = np.empty((6, 3))
    pull_rate = np.empty((6, 3))
    for s in range(count):
        pull(n, base[END] - times[s], inverse, matrix, jump, jump_rate, pulls[s], pull_rate)
        for t in range(count):
            force_columns(n, times[t] - times[s], matrix, jump, jump_rate)
            response(n, times[t] - base[START], matrix)
            for i in range(6):
                for k in range(3):
                    total, slope = jump[i, k], -jump_rate[i, k]
                    for j in range(6):
                        total += matrix[i, j] * pulls[s, j, k]
                        slope += matrix[i, j] * pull_rate[j, k]
                    blocks[t, s, i, k] = total
                    rates[t, s, i, k] = slope


@kernel()
def shape(base, pulls, times, forces, count, rows):
    """Arcs of the base path deflected by the forces (count, 3): count + 1 rows, in order of time."""
    copy(base, rows[0])
    for s in range(count):
        for i in range(6):
            for k in range(3):
                rows[0, THRUST + i] += pulls[s, i, k] * forces[s, k]
    last = base[START]
    done = 0
    while done < count:
        following = -1
        for s in range(count):  # contacts at one instant share an arc
            if times[s] > last and (following < 0 or times[s] < times[following]):
                following = s
        if following < 0:
            break
        t = times[following]
        rows[done, END] = t
        copy(base, rows[done + 1])
        rows[done + 1, START] = t
        state = state_at(rows[done], t)
        steering = primer_at(rows[done], t)
        for i in range(6):
            rows[done + 1, STATE + i] = state[i]
            rows[done + 1, THRUST + i] = steering[i]
        for s in range(count):
            if times[s] == t:
                for k in range(3):
                    rows[done + 1, THRUST + 3 + k] += forces[s, k]
        last = t
        done += 1
    return done + 1


@kernel()
def relative(rows, count, others, first, last, matrix, t, out):
    """Relative position, velocity and acceleration at time t in zone coordinates, rows of `out`."""
    out[:3] = 0.0
    derivatives_at(rows[locate(rows, 0, count, t)], t, 3, out, 1.0)
    derivatives_at(others[locate(others, first, last, t)], t, 3, out, -1.0)
    for k in range(3):
        x, y, z = out[k, 0], out[k, 1], out[k, 2]
        for i in range(3):
            out[k, i] = matrix[i, 0] * x + matrix[i, 1] * y + matrix[i, 2] * z
