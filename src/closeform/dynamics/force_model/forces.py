"""Acceleration of a spacecraft by gravity and drag, and propagation of its state.

The potential mu/r (1 - sum J_k (R/r)^k P_k(s)), s = z/r, k = 2 to 6, of a body with pole z gives

    -mu/r^2 e_r + mu/r^2 sum J_k (R/r)^k (P'_{k+1}(s) e_r - P'_k(s) e_z)                    # theory (80)

An exponential atmosphere that rotates with the body gives

    -B/2 rho |w| w,  w = v - spin e_z x r,  B = Cd A/m                                       # theory (81)

The integrator is the eighth-order method of Dormand and Prince (Hairer, Norsett, Wanner 1993, II.10).
"""

from math import exp, sqrt

import numpy as np
from numba import float64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import borrowed, stack_vector

DEGREES = 5  # number of zonals, from the second degree on
# Indices of the constants of a force model: gravity, then density [kg/m^3] at a radius [m], scale height [m]
# and rotation rate [rad/s] of the atmosphere.
MU, RADIUS, ZONALS = 0, 1, 2
DENSITY = ZONALS + DEGREES
REFERENCE, SCALE_HEIGHT, SPIN = DENSITY + 1, DENSITY + 2, DENSITY + 3

ROWS = float64[:, ::1]
STAGES = 12
# weights of earlier stages in each stage, and of all stages in the step
WEIGHTS: tuple[dict[int, float], ...] = (
    {},
    {0: 0.05260015195876773},
    {0: 0.0197250569845379, 1: 0.0591751709536137},
    {0: 0.02958758547680685, 2: 0.08876275643042054},
    {0: 0.2413651341592667, 2: -0.8845494793282861, 3: 0.924834003261792},
    {0: 0.037037037037037035, 3: 0.17082860872947386, 4: 0.12546768756682242},
    {0: 0.037109375, 3: 0.17025221101954405, 4: 0.06021653898045596, 5: -0.017578125},
    {
        0: 0.03709200011850479,
        3: 0.17038392571223998,
        4: 0.10726203044637328,
        5: -0.015319437748624402,
        6: 0.008273789163814023,
    },
    {
        0: 0.6241109587160757,
        3: -3.3608926294469414,
        4: -0.868219346841726,
        5: 27.59209969944671,
        6: 20.154067550477894,
        7: -43.48988418106996,
    },
    {
        0: 0.47766253643826434,
        3: -2.4881146199716677,
        4: -0.590290826836843,
        5: 21.230051448181193,
        6: 15.279233632882423,
        7: -33.28821096898486,
        8: -0.020331201708508627,
    },
    {
        0: -0.9371424300859873,
        3: 5.186372428844064,
        4: 1.0914373489967295,
        5: -8.149787010746927,
        6: -18.52006565999696,
        7: 22.739487099350505,
        8: 2.4936055526796523,
        9: -3.0467644718982196,
    },
    {
        0: 2.273310147516538,
        3: -10.53449546673725,
        4: -2.0008720582248625,
        5: -17.9589318631188,
        6: 27.94888452941996,
        7: -2.8589982771350235,
        8: -8.87285693353063,
        9: 12.360567175794303,
        10: 0.6433927460157636,
    },
    {
        0: 0.054293734116568765,
        5: 4.450312892752409,
        6: 1.8915178993145003,
        7: -5.801203960010585,
        8: 0.3111643669578199,
        9: -0.1521609496625161,
        10: 0.20136540080403034,
        11: 0.04471061572777259,
    },
)


def tableau() -> Floats:
    """Return the coefficients, the matrix A above the weights b, (13, 12)."""
    table = np.zeros((STAGES + 1, STAGES))
    for row, weights in zip(table, WEIGHTS, strict=True):
        row[list(weights)] = list(weights.values())
    return table


TABLEAU: Floats = tableau()


@kernel(inline=True)
def gravity_acceleration(constants, x, y, z):
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
def drag_acceleration(constants, ballistic, x, y, z, vx, vy, vz):
    """Return the acceleration by drag of a spacecraft with a ballistic coefficient."""
    r = sqrt(x * x + y * y + z * z)
    density = constants[DENSITY] * exp((constants[REFERENCE] - r) / constants[SCALE_HEIGHT])
    wx, wy = vx + constants[SPIN] * y, vy - constants[SPIN] * x
    slowed = -0.5 * ballistic * density * sqrt(wx * wx + wy * wy + vz * vz)
    return slowed * wx, slowed * wy, slowed * vz


@kernel(inline=True)
def accelerate_lanes(constants, ballistics, s, out):
    """Fill `out` (3, M) with accelerations, for ballistic coefficients (M,) and states `s` (6, M)."""
    for m in range(len(ballistics)):
        out[0, m], out[1, m], out[2, m] = gravity_acceleration(constants, s[0, m], s[1, m], s[2, m])
    if constants[DENSITY] > 0.0:
        for m in range(len(ballistics)):
            x, y, z = drag_acceleration(
                constants, ballistics[m], s[0, m], s[1, m], s[2, m], s[3, m], s[4, m], s[5, m]
            )
            out[0, m], out[1, m], out[2, m] = out[0, m] + x, out[1, m] + y, out[2, m] + z


@kernel()
def accelerate_one(constants, ballistic, s, out):
    """Fill `out` (3,) with the acceleration of a spacecraft in the state `s` (6,)."""
    out[0], out[1], out[2] = gravity_acceleration(constants, s[0], s[1], s[2])
    if ballistic * constants[DENSITY] > 0.0:
        x, y, z = drag_acceleration(constants, ballistic, s[0], s[1], s[2], s[3], s[4], s[5])
        out[0], out[1], out[2] = out[0] + x, out[1] + y, out[2] + z


@kernel(void(float64[::1], float64[::1], ROWS, ROWS))
def accelerate(constants, ballistics, states, out):
    """Fill `out` (M, 3) with accelerations, for ballistic coefficients (M,) and states (M, 6)."""
    states, out = borrowed(states), borrowed(out)
    for m in range(len(states)):
        accelerate_one(constants, ballistics[m], states[m], out[m])


@kernel(void(float64[::1], float64[::1], ROWS, float64[::1], float64, ROWS, float64[:, :, ::1]))
def propagate_states(constants, ballistics, starts, times, longest, tableau, out):
    """Fill `out` (M, T, 6) with the states of spacecraft that are at `starts` (M, 6) at time 0.

    `times` (T,) are sorted. An explicit Runge-Kutta method with `tableau` (S + 1, S) takes steps of at most
    `longest` [s], forward and backward from time 0.
    """
    starts, out, tableau = borrowed(starts), borrowed(out), borrowed(tableau)
    stages, count = tableau.shape[1], len(times)
    state, middle, rates, force = stack_vector(6), stack_vector(6), np.empty((stages, 6)), stack_vector(3)
    for m in range(len(starts)):
        for direction in range(2):
            now = 0.0
            for k in range(6):
                state[k] = starts[m, k]
            for place in range(count):
                row = count - 1 - place if direction else place
                if (times[row] < 0.0) != (direction == 1):
                    continue
                steps = int(abs(times[row] - now) / longest) + 1
                h = (times[row] - now) / steps
                for _ in range(steps if h != 0.0 else 0):
                    runge_kutta_step(constants, ballistics[m], tableau, h, state, middle, rates, force)
                now = times[row]
                for k in range(6):
                    out[m, row, k] = state[k]


@kernel()
def runge_kutta_step(constants, ballistic, tableau, h, state, middle, rates, force):
    """Advance a state (6,) by a step `h` [s]; overwrite the working arrays after it."""
    stages = tableau.shape[1]
    for stage in range(stages):
        for k in range(6):
            middle[k] = state[k]
            for before in range(stage):
                middle[k] += h * tableau[stage, before] * rates[before, k]
        accelerate_one(constants, ballistic, middle, force)
        for k in range(3):
            rates[stage, k], rates[stage, 3 + k] = middle[3 + k], force[k]
    for k in range(6):
        for stage in range(stages):
            state[k] += h * tableau[stages, stage] * rates[stage, k]
