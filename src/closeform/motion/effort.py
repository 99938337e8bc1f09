"""Thrust, control energy, delta-v and peak thrust of arcs."""

from math import ceil, sqrt

from numba import float64, int64, void

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
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
from closeform.motion.chief.bernstein import SQUARE, TERMS, from_powers
from closeform.motion.chief.segments import DEEPEST, highest
from closeform.motion.extrema import advance
from closeform.motion.hill import costate, driven
from closeform.motion.quadrature import integral

PIECE = 0.5  # in n t, of a Taylor polynomial, whose remainder is below 1e-12


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
def sampled(scene, t):
    """Return |thrust| or its square at time t."""
    arc, n, squared = scene
    square = thrust_squared(arc, n, t)
    return square if squared else sqrt(square)


@kernel()
def arc_energy(arc, n):
    duration = arc[END] - arc[START]
    if arc[MEAN_MOTION] != n or pushes(arc):
        return 0.5 * integral(sampled, (arc, n, True), arc[START], arc[END])
    energy = 0.0
    if has_primer(arc):
        # d(costate . state)/dt = |u|^2, with the state that the thrust alone produces
        x, y, z, vx, vy, vz = driven(n, duration, arc[12], arc[13], arc[14], arc[15], arc[16], arc[17])
        ux, uy, uz, wx, wy, wz = primer_at(arc, arc[END])
        lx, ly, lz = costate(n, ux, uy, uz, wx, wy, wz)
        energy += 0.5 * (lx * x + ly * y + lz * z + ux * vx + uy * vy + uz * vz)
    return energy


@kernel()
def largest_norm(q, n, stop, stack):
    """Return the largest norm over [0, stop] of an arc of order 4, by its Taylor polynomials.

    Overwrites `q`.
    """
    c, powers, best = stack_matrix(3, TERMS), stack_vector(TERMS), 0.0
    pieces = ceil(n * stop / PIECE) if n > 0.0 else 1
    h = stop / pieces
    for _ in range(pieces):
        for axis in range(3):
            factor = 1.0
            for k in range(TERMS):
                if k < 4:
                    powers[k] = factor * q[k, axis]
                    factor *= h / (k + 1.0)
                else:
                    powers[k] = -((n * h) ** 2) / (k * (k - 1.0)) * powers[k - 2]
            from_powers(powers, c[axis])
        best = highest(c, stack, best)
        advance(q, n, h)
    return best


@kernel()
def arc_peak(arc, n, q, stack):
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
    return largest_norm(q, order_n, duration, stack)


ENERGY, DELTA_V, PEAK, HIDDEN = 0, 1, 2, 3

# Factor of a h^2: the largest distance between a spacecraft and a path that share two states h apart, if
# their accelerations differ by at most a: +a for a quarter of the time, -a for half, and +a again.
BANG_BANG = 1.0 / 16.0


@kernel(void(float64[:, ::1], int64[::1], float64, int64, float64[::1]))
def totals(arcs, offsets, n, what, out):
    """Fill `out` with energy, delta-v, peak thrust or interpolation error of each path, without impulses."""
    arcs, q, stack = borrowed(arcs), stack_matrix(8, 3), stack_matrix(DEEPEST, SQUARE)
    for p in range(len(offsets) - 1):
        total = 0.0
        for a in range(offsets[p], offsets[p + 1]):
            arc = arcs[a]
            if arc[END] > arc[START]:
                if what == ENERGY:
                    total += arc_energy(arc, n)
                elif what == DELTA_V:
                    if thrusts(arc) or arc[MEAN_MOTION] != n:
                        total += integral(sampled, (arc, n, False), arc[START], arc[END])
                else:
                    peak = arc_peak(arc, n, q, stack)
                    if what == HIDDEN:
                        peak *= BANG_BANG * (arc[END] - arc[START]) ** 2
                    total = max(total, peak)
        out[p] = total
