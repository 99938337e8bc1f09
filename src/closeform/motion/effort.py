"""Thrust, control energy, delta-v and peak thrust of arcs."""

from math import sqrt

from numba import float64, int64, void

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import (
    END,
    MEAN_MOTION,
    PUSH,
    START,
    WIDTH,
    acceleration,
    has_primer,
    primer_at,
    push_at,
    pushes,
    state_at,
    thrusts,
)
from closeform.motion.extrema import maximum_norm
from closeform.motion.hill import costate, driven


@kernel()
def thrust_at(arc, n, t):
    """Return the thrust acceleration at time t that the arc requires in an orbit of mean motion n.

    For an interpolated arc (n = 0 in an orbit with n > 0) it follows from the motion of the arc.
    """
    ux, uy, uz, _, _, _ = primer_at(arc, t)
    if pushes(arc):
        ux, uy, uz = ux + push_at(arc, 0, t)[0], uy + push_at(arc, 1, t)[0], uz + push_at(arc, 2, t)[0]
    if arc[MEAN_MOTION] != n:
        x, _, z, vx, vy, _ = state_at(arc, t)
        ax, ay, az = acceleration(n, x, z, vx, vy)
        ux, uy, uz = ux - ax, uy - ay, uz - az
    return ux, uy, uz


@kernel()
def thrust_squared(arc, n, t):
    x, y, z = thrust_at(arc, n, t)
    return x * x + y * y + z * z


@kernel()
def gauss4(arc, n, middle, half):
    """Integrate |thrust|^2 by four Gauss points: exact for a cubic thrust."""
    a = 0.33998104358485626 * half
    b = 0.8611363115940526 * half
    inner = thrust_squared(arc, n, middle - a) + thrust_squared(arc, n, middle + a)
    outer = thrust_squared(arc, n, middle - b) + thrust_squared(arc, n, middle + b)
    return half * (0.6521451548625461 * inner + 0.34785484513745385 * outer)


# Kronrod's 15 points and weights and the 7 Gauss weights among them (QUADPACK, positive half).
NODES: tuple[float, ...] = (0.9914553711208126, 0.9491079123427585, 0.8648644233597691, 0.7415311855993945)
NODES += (0.5860872354676911, 0.4058451513773972, 0.2077849550078985, 0.0)
KRONROD: tuple[float, ...] = (0.0229353220105292, 0.0630920926299786, 0.1047900103222502, 0.1406532597159259)
KRONROD += (0.1690047266392679, 0.1903505780647854, 0.2044329400752989, 0.2094821410847278)
GAUSS = (0.0, 0.1294849661688697, 0.0, 0.2797053914892767, 0.0, 0.3818300505051189, 0.0, 0.4179591836734694)


@kernel()
def integral(arc, n, squared, stack):
    """Integrate |thrust| or its square by adaptive Gauss-Kronrod quadrature, to a relative 1e-10."""
    if not thrusts(arc) and arc[MEAN_MOTION] == n:
        return 0.0
    duration = arc[END] - arc[START]
    total = 0.0
    scale = 0.0
    stack[0] = 0.0  # left edges of the remaining intervals; each is 2^-depth long
    stack[1] = 0.0  # and their depths
    top = 1
    while top > 0:
        top -= 1
        left = stack[2 * top]
        depth = stack[2 * top + 1]
        half = 0.5 * duration * 0.5**depth
        middle = arc[START] + left * duration + half
        fine = 0.0
        coarse = 0.0
        for k in range(8):
            f = thrust_squared(arc, n, middle - half * NODES[k])
            g = thrust_squared(arc, n, middle + half * NODES[k]) if k < 7 else 0.0
            f = f + g if squared else sqrt(f) + sqrt(g)
            fine += KRONROD[k] * f
            coarse += GAUSS[k] * f
        if depth == 0.0:
            scale = half * fine
        if depth > 40.0 or half * abs(fine - coarse) <= 1e-11 * scale:
            total += half * fine
        else:
            stack[2 * top] = left
            stack[2 * top + 1] = depth + 1.0
            stack[2 * top + 2] = left + 0.5 ** (depth + 1.0)
            stack[2 * top + 3] = depth + 1.0
            top += 2
    return total


@kernel()
def arc_energy(arc, n, stack):
    duration = arc[END] - arc[START]
    if arc[MEAN_MOTION] != n:
        return 0.5 * gauss4(arc, n, 0.5 * (arc[START] + arc[END]), 0.5 * duration)
    if pushes(arc):
        return 0.5 * integral(arc, n, True, stack)
    energy = 0.0
    if has_primer(arc):
        # d(costate . state)/dt = |u|^2, with the state that the thrust alone produces
        x, y, z, vx, vy, vz = driven(n, duration, arc[12], arc[13], arc[14], arc[15], arc[16], arc[17])
        ux, uy, uz, wx, wy, wz = primer_at(arc, arc[END])
        lx, ly, lz = costate(n, ux, uy, uz, wx, wy, wz)
        energy += 0.5 * (lx * x + ly * y + lz * z + ux * vx + uy * vy + uz * vz)
    return energy


@kernel()
def arc_peak(arc, n, q):
    """Return the largest thrust along an arc, which is natural motion, or a cubic if interpolated."""
    duration = arc[END] - arc[START]
    q[:] = 0.0
    ux, uy, uz, wx, wy, wz = primer_at(arc, arc[START])
    order_n = arc[MEAN_MOTION]
    for k in range(4):
        q[k, 0], q[k, 1], q[k, 2] = ux, uy, uz
        ax, ay, az = acceleration(order_n, ux, uz, wx, wy)
        ux, uy, uz, wx, wy, wz = wx, wy, wz, ax, ay, az
    if order_n != n:
        x, _, z, vx, vy, vz = state_at(arc, arc[START])
        ux, uy, uz, wx, wy, wz = primer_at(arc, arc[START])
        for k in range(4):
            ax, ay, az = acceleration(n, x, z, vx, vy)
            q[k, 0] -= ax
            q[k, 1] -= ay
            q[k, 2] -= az
            x, _, z, vx, vy, vz = vx, vy, vz, ux, uy, uz
            ux, uy, uz, wx, wy, wz = wx, wy, wz, 0.0, 0.0, 0.0
    for k in range(WIDTH - PUSH):
        q[k // 3, k % 3] += arc[PUSH + k]
    return maximum_norm(q, order_n, duration)


ENERGY, DELTA_V, PEAK, HIDDEN = 0, 1, 2, 3

# Factor of a h^2: the largest distance between a spacecraft and a path that share two states h apart, if
# their accelerations differ by at most a: +a for a quarter of the time, -a for half, and +a again.
BANG_BANG = 1.0 / 16.0


@kernel(void(float64[:, ::1], int64[::1], float64, int64, float64[::1]))
def totals(arcs, offsets, n, what, out):
    """Fill `out` with energy, delta-v, peak thrust or interpolation error of each path, without impulses."""
    stack = stack_vector(200)
    q = stack_matrix(8, 3)
    for p in range(len(offsets) - 1):
        total = 0.0
        for a in range(offsets[p], offsets[p + 1]):
            arc = arcs[a]
            if arc[END] > arc[START]:
                if what == ENERGY:
                    total += arc_energy(arc, n, stack)
                elif what == DELTA_V:
                    total += integral(arc, n, False, stack)
                else:
                    peak = arc_peak(arc, n, q)
                    if what == HIDDEN:
                        peak *= BANG_BANG * (arc[END] - arc[START]) ** 2
                    total = max(total, peak)
        out[p] = total
