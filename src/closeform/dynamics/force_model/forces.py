"""Acceleration of a spacecraft by gravity and drag, and propagation of its state.

The potential mu/r (1 - sum J_k (R/r)^k P_k(s)), s = z/r, k = 2 to 6, of a body with pole z gives

    -mu/r^2 e_r + mu/r^2 sum J_k (R/r)^k (P'_{k+1}(s) e_r - P'_k(s) e_z)                    # theory (80)

An exponential atmosphere that rotates with the body gives

    -B/2 rho |w| w,  w = v - spin e_z x r,  B = Cd A/m                                       # theory (81)

The integrator extrapolates the midpoint rule, to eighth order (Hairer, Norsett, Wanner 1993, II.9).
"""

from math import exp, sqrt

from numba import float64, void

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector

DEGREES = 5  # number of zonals, from the second degree on
# Indices of the constants of a force model: gravity, then density [kg/m^3] at a radius [m], scale height [m]
# and rotation rate [rad/s] of the atmosphere.
MU, RADIUS, ZONALS = 0, 1, 2
DENSITY = ZONALS + DEGREES
REFERENCE, SCALE_HEIGHT, SPIN = DENSITY + 1, DENSITY + 2, DENSITY + 3

ROWS = float64[:, ::1]
SHORT = 10.0  # s: a step up to which three sequences of substeps suffice, else four


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


@kernel(void(float64[::1], float64[::1], ROWS, float64[::1], float64, float64[:, :, ::1]))
def propagate_states(constants, ballistics, starts, times, longest, out):
    """Fill `out` (M, T, 6) with the states of spacecraft that are at `starts` (M, 6) at time 0.

    `times` (T,) are sorted. Steps are at most `longest` [s], forward and backward from time 0.
    """
    starts, out = borrowed(starts), borrowed(out)
    count, state, work = len(times), stack_vector(6), stack_matrix(9, 6)
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
                    extrapolated_step(constants, ballistics[m], h, state, work)
                now = times[row]
                for k in range(6):
                    out[m, row, k] = state[k]


@kernel()
def extrapolated_step(constants, ballistic, h, state, work):
    """Advance a state (6,) by a step `h` [s]; overwrite the rows of `work` (9, 6).

    The midpoint rule with n = 2, 4, 6 and 8 substeps has errors in even powers of the substep. The increments
    of the state are extrapolated to a substep of zero by Neville's scheme; `work` holds its last row.
    """
    first, rates, there, before, now = work[4], work[5], work[6], work[7], work[8]
    rates_at(constants, ballistic, state, first)
    sequences = 3 if abs(h) <= SHORT else 4
    for row in range(sequences):
        substep = h / (2 * row + 2)
        for k in range(6):
            before[k], now[k] = 0.0, substep * first[k]
        for _ in range(2 * row + 1):
            for k in range(6):
                there[k] = state[k] + now[k]
            rates_at(constants, ballistic, there, rates)
            for k in range(6):
                before[k], now[k] = now[k], before[k] + 2.0 * substep * rates[k]
        for k in range(6):
            for column in range(row):
                finer = ((row + 1.0) / (row - column)) ** 2
                now[k], work[column, k] = now[k] + (now[k] - work[column, k]) / (finer - 1.0), now[k]
            work[row, k] = now[k]
    for k in range(6):
        state[k] += work[sequences - 1, k]


@kernel()
def rates_at(constants, ballistic, state, out):
    """Fill `out` (6,) with the rates of a state (6,)."""
    accelerate_one(constants, ballistic, state, out[3:])
    for k in range(3):
        out[k] = state[3 + k]
