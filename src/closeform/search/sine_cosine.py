"""Sine and cosine without branches, for vectorized loops."""

from math import factorial, floor, pi

from closeform._jit import kernel

S1, S2, S3, S4, S5, S6, S7 = ((-1) ** k / factorial(2 * k + 1) for k in range(1, 8))
C1, C2, C3, C4, C5, C6, C7, C8 = ((-1) ** k / factorial(2 * k) for k in range(1, 9))
QUARTER = 1.57079632673412561417  # pi / 2 to 33 bits, and its remainder
REST = 6.07710050650619224932e-11


@kernel(inline=True)
def sine_cosine(angle):
    """Return sine and cosine to 2e-16 of an angle up to a few turns, from series about a quarter turn.

    Without branches, as `ahead` requires for many pairs in parallel.
    """
    turns = floor(angle * (2.0 / pi) + 0.5)
    x = (angle - turns * QUARTER) - turns * REST
    z = x * x
    zz = z * z
    s = ((1.0 + S1 * z) + (S2 + S3 * z) * zz) + ((S4 + S5 * z) + (S6 + S7 * z) * zz) * (zz * zz)
    c = ((C4 + C5 * z) + (C6 + C7 * z) * zz + C8 * (zz * zz)) * (zz * zz)
    c += (1.0 + C1 * z) + (C2 + C3 * z) * zz
    s *= x
    half = floor(turns * 0.5)
    odd, sign = turns - 2.0 * half, 1.0 - 2.0 * (half - 2.0 * floor(half * 0.5))
    return sign * (s * (1.0 - odd) + c * odd), sign * (c * (1.0 - odd) - s * odd)
