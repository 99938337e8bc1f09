"""Adaptive Gauss-Kronrod quadrature in compiled kernels."""

from closeform._jit import kernel
from closeform.kernel_loans import stack_vector

# Kronrod's 15 points and weights and the 7 Gauss weights among them (QUADPACK, positive half).
NODES: tuple[float, ...] = (0.9914553711208126, 0.9491079123427585, 0.8648644233597691, 0.7415311855993945)
NODES += (0.5860872354676911, 0.4058451513773972, 0.2077849550078985, 0.0)
KRONROD: tuple[float, ...] = (0.0229353220105292, 0.0630920926299786, 0.1047900103222502, 0.1406532597159259)
KRONROD += (0.1690047266392679, 0.1903505780647854, 0.2044329400752989, 0.2094821410847278)
GAUSS = (0.0, 0.1294849661688697, 0.0, 0.2797053914892767, 0.0, 0.3818300505051189, 0.0, 0.4179591836734694)
PRECISION = 1e-11  # relative, of the first estimate
DEEPEST = 42  # intervals in work: near a zero of the thrust its norm has a kink


@kernel()
def integral(sample, scene, first, last):
    """Return the integral over [first, last] of `sample(scene, t)`, to a relative 1e-11."""
    lefts, depths = stack_vector(DEEPEST), stack_vector(DEEPEST)
    lefts[0], depths[0] = 0.0, 0.0  # left edges of the remaining intervals; each is 2^-depth long
    top, total, scale = 1, 0.0, 0.0
    while top > 0:
        top -= 1
        left, depth = lefts[top], depths[top]
        half = 0.5 * (last - first) * 0.5**depth
        middle = first + left * (last - first) + half
        fine, coarse = 0.0, 0.0
        for k in range(8):
            f = sample(scene, middle - half * NODES[k])
            if k < 7:
                f += sample(scene, middle + half * NODES[k])
            fine += KRONROD[k] * f
            coarse += GAUSS[k] * f
        if depth == 0.0:
            scale = half * fine
        if top + 2 > DEEPEST or half * abs(fine - coarse) <= PRECISION * scale:
            total += half * fine
        else:
            lefts[top], depths[top] = left, depth + 1.0
            lefts[top + 1], depths[top + 1] = left + 0.5 ** (depth + 1.0), depth + 1.0
            top += 2
    return total
