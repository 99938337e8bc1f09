"""Gravity of an oblate body.

The potential mu/r (1 - sum J_k (R/r)^k P_k(s)), s = z/r, k = 2 to 6, of a body with pole z gives

    -mu/r^2 e_r + mu/r^2 sum J_k (R/r)^k (P'_{k+1}(s) e_r - P'_k(s) e_z)                    # theory (80)
"""

from math import sqrt

from closeform._jit import kernel

DEGREES = 5  # number of zonals, from the second degree on
MU, RADIUS, ZONALS = 0, 1, 2  # indices of the constants of a force model


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
