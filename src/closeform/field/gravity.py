"""Accelerations about a flattened body with an atmosphere, and the motion of one craft in them.

The potential mu/r (1 - sum J_k (R/r)^k P_k(s)), s = z/r, k = 2 to 6, of a body whose pole is z, pulls with

    -mu/r^2 e_r + mu/r^2 sum J_k (R/r)^k (P'_{k+1}(s) e_r - P'_k(s) e_z)                    # theory (80)

and air that turns with the body, of a density that falls by e each scale height, with

    -B/2 rho |w| w,  w = v - spin e_z x r,  B = Cd A/m                                       # theory (81)
"""

from math import exp, sqrt

import numpy as np
from numba import float64, void
from scipy.integrate import DOP853

from closeform.arrays import Floats
from closeform.compiled import kernel
from closeform.kernel_loans import borrowed, stack_vector

MU, RADIUS, ZONALS, DENSITY, REFERENCE, SCALE_HEIGHT, SPIN, WIDTH = 0, 1, 2, 7, 8, 9, 10, 11  # of constants
DEGREES = 5  # of zonals, from the second on
TABLEAU: Floats = np.vstack([DOP853.A, DOP853.B])  # Hairer, Norsett and Wanner 1993, II.10


@kernel()
def pull(constants, ballistic, s, out):
    """Fill `out` (3,) with the acceleration of a craft of a ballistic coefficient in the state `s` (6,)."""
    x, y, z = s[0], s[1], s[2]
    r = sqrt(x * x + y * y + z * z)
    sine, share = z / r, constants[RADIUS] / r
    p0, p1, slope, power, outward, polar = 1.0, sine, 1.0, share, -1.0, 0.0
    for k in range(DEGREES):
        degree = k + 2.0
        power *= share
        p2 = ((2.0 * degree - 1.0) * sine * p1 - (degree - 1.0) * p0) / degree
        here = degree * p1 + sine * slope
        after = (degree + 1.0) * p2 + sine * here
        outward += constants[ZONALS + k] * power * after
        polar -= constants[ZONALS + k] * power * here
        p0, p1, slope = p1, p2, here
    strength = constants[MU] / (r * r)
    out[0], out[1] = strength * outward * x / r, strength * outward * y / r
    out[2] = strength * (outward * sine + polar)
    if ballistic * constants[DENSITY] > 0.0:
        density = constants[DENSITY] * exp((constants[REFERENCE] - r) / constants[SCALE_HEIGHT])
        wx, wy, wz = s[3] + constants[SPIN] * y, s[4] - constants[SPIN] * x, s[5]
        slowed = -0.5 * ballistic * density * sqrt(wx * wx + wy * wy + wz * wz)
        out[0] += slowed * wx
        out[1] += slowed * wy
        out[2] += slowed * wz


@kernel(void(float64[::1], float64[::1], float64[:, ::1], float64[:, ::1]))
def accelerate(constants, ballistics, states, out):
    """Fill `out` (M, 3) with the accelerations of craft of ballistic coefficients (M,) in states (M, 6)."""
    states, out = borrowed(states), borrowed(out)
    for m in range(len(states)):
        pull(constants, ballistics[m], states[m], out[m])


@kernel(void(float64[::1], float64, float64[::1], float64[::1], float64, float64[:, ::1], float64[:, ::1]))
def fly(constants, ballistic, start, times, longest, tableau, out):
    """Fill `out` (T, 6) with the states of a craft that is at `start` at 0, at times that go away from it.

    By steps of at most `longest` [s] of an explicit method, `tableau` (S + 1, S) its nodes and its weights.
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
