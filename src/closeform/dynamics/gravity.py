"""Accelerations near an oblate body with an atmosphere, and the motion of one craft.

The potential mu/r (1 - sum J_k (R/r)^k P_k(s)), s = z/r, k = 2 to 6, of a body with pole z gives

    -mu/r^2 e_r + mu/r^2 sum J_k (R/r)^k (P'_{k+1}(s) e_r - P'_k(s) e_z)                    # theory (80)

and an exponential atmosphere that rotates with the body gives

    -B/2 rho |w| w,  w = v - spin e_z x r,  B = Cd A/m                                       # theory (81)
"""

from math import exp, sqrt

import numpy as np
from numba import float64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.dynamics.dormand_prince import tableau
from closeform.kernel_loans import borrowed, stack_vector

# indices of the constants
MU, RADIUS, ZONALS, DENSITY, REFERENCE, SCALE_HEIGHT, SPIN, WIDTH = 0, 1, 2, 7, 8, 9, 10, 11
DEGREES = 5  # number of zonals, from the second degree on
TABLEAU: Floats = tableau()


@kernel(inline=True)
def gravity(constants, x, y, z):
    """Return the acceleration by a body with zonals; without branches, for vectorized loops."""
    inverse = 1.0 / sqrt(x * x + y * y + z * z)
    sine, share = z * inverse, constants[RADIUS] * inverse
    p0, p1, slope, power, outward, polar = 1.0, sine, 1.0, share, -1.0, 0.0
    for k in range(DEGREES):
        degree = k + 2.0
        power *= share
        p2 = (2.0 - 1.0 / degree) * sine * p1 - (1.0 - 1.0 / degree) * p0
        here = degree * p1 + sine * slope
        after = (degree + 1.0) * p2 + sine * here
        outward += constants[ZONALS + k] * power * after
        polar -= constants[ZONALS + k] * power * here
        p0, p1, slope = p1, p2, here
    strength = constants[MU] * inverse * inverse
    across = strength * outward * inverse
    return across * x, across * y, strength * (outward * sine + polar)


@kernel(inline=True)
def drag(constants, ballistic, x, y, z, vx, vy, vz):
    """Return the acceleration by drag of a craft with a ballistic coefficient."""
    r = sqrt(x * x + y * y + z * z)
    density = constants[DENSITY] * exp((constants[REFERENCE] - r) / constants[SCALE_HEIGHT])
    wx, wy = vx + constants[SPIN] * y, vy - constants[SPIN] * x
    slowed = -0.5 * ballistic * density * sqrt(wx * wx + wy * wy + vz * vz)
    return slowed * wx, slowed * wy, slowed * vz


@kernel(inline=True)
def pull_all(constants, ballistics, s, out):
    """Fill `out` (3, M) with accelerations, for ballistic coefficients (M,) and states `s` (6, M)."""
    for m in range(len(ballistics)):
        out[0, m], out[1, m], out[2, m] = gravity(constants, s[0, m], s[1, m], s[2, m])
    if constants[DENSITY] > 0.0:
        for m in range(len(ballistics)):
            x, y, z = drag(constants, ballistics[m], s[0, m], s[1, m], s[2, m], s[3, m], s[4, m], s[5, m])
            out[0, m], out[1, m], out[2, m] = out[0, m] + x, out[1, m] + y, out[2, m] + z


@kernel()
def pull(constants, ballistic, s, out):
    """Fill `out` (3,) with the acceleration of a craft with a ballistic coefficient in the state `s` (6,)."""
    out[0], out[1], out[2] = gravity(constants, s[0], s[1], s[2])
    if ballistic * constants[DENSITY] > 0.0:
        x, y, z = drag(constants, ballistic, s[0], s[1], s[2], s[3], s[4], s[5])
        out[0], out[1], out[2] = out[0] + x, out[1] + y, out[2] + z


@kernel(void(float64[::1], float64[::1], float64[:, ::1], float64[:, ::1]))
def accelerate(constants, ballistics, states, out):
    """Fill `out` (M, 3) with the accelerations of craft with ballistic coefficients (M,) in states (M, 6)."""
    states, out = borrowed(states), borrowed(out)
    for m in range(len(states)):
        pull(constants, ballistics[m], states[m], out[m])


@kernel(void(float64[::1], float64, float64[::1], float64[::1], float64, float64[:, ::1], float64[:, ::1]))
def fly(constants, ballistic, start, times, longest, tableau, out):
    """Fill `out` (T, 6) with the states of a craft that is at `start` at time 0.

    `times` (T,) are sorted by distance from 0. An explicit Runge-Kutta method with `tableau` (S + 1, S) takes
    steps of at most `longest` [s].
    """
    out, tableau = borrowed(out), borrowed(tableau)
    stages = tableau.shape[1]
    state, middle, rates, force = stack_vector(6), stack_vector(6), np.empty((stages, 6)), stack_vector(3)
    for k in range(6):
        state[k] = start[k]
    now = 0.0
    for row in range(len(times)):
        steps = int(abs(times[row] - now) / longest) + 1
        h = (times[row] - now) / steps
        for _ in range(steps if h != 0.0 else 0):
            for stage in range(stages):
                for k in range(6):
                    middle[k] = state[k]
                    for before in range(stage):
                        middle[k] += h * tableau[stage, before] * rates[before, k]
                pull(constants, ballistic, middle, force)
                for k in range(3):
                    rates[stage, k], rates[stage, 3 + k] = middle[3 + k], force[k]
            for k in range(6):
                for stage in range(stages):
                    state[k] += h * tableau[stages, stage] * rates[stage, k]
        now = times[row]
        for k in range(6):
            out[row, k] = state[k]
