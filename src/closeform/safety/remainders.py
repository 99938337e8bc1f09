"""Bounds on the deviation of a motion after a failure from the span of its control motions.

Thrust that is lost at time s leaves the natural motion r(t; s) = E Phi(t - s) x(s).  With the thrust u
of the path at s, its derivatives with respect to s are

    d^k r/ds^k = E Phi(t - s) z_k,   z_1 = (0, u),   z_(k+1) = z_k' - A z_k                # theory (44)

so that it deviates from the cubic of the values and slopes at two instants h apart by at most h^4/384 of the
largest fourth derivative.  Each component of that is in the function space of arcs' thrusts, and is bounded
by its Taylor series.
"""

from math import sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix
from closeform.motion.arc import (
    MEAN_MOTION,
    acceleration,
    derivatives_at,
    has_primer,
    primer_at,
    push_at,
    pushes,
)

SWING_RATE = 4.2  # |d Phi_vv/dt| is at most n sqrt(17), and each derivative n times that


@kernel()
def thrust_derivatives(arc, n, t, u):
    """Fill `u` (7, 3) with the thrust that an arc requires at mean motion n, and its derivatives."""
    m = arc[MEAN_MOTION]
    for k in range(7):
        u[k, 0] = u[k, 1] = u[k, 2] = 0.0
    if m != n:  # the thrust of a cubic follows from its motion
        r = stack_matrix(8, 3)
        for k in range(8):
            r[k, 0] = r[k, 1] = r[k, 2] = 0.0
        derivatives_at(arc, t, 6, r, 1.0)
        for k in range(4):
            ax, ay, az = acceleration(n, r[k, 0], r[k, 2], r[k + 1, 0], r[k + 1, 1])
            u[k, 0], u[k, 1], u[k, 2] = r[k + 2, 0] - ax, r[k + 2, 1] - ay, r[k + 2, 2] - az
    elif has_primer(arc):
        x, y, z, vx, vy, vz = primer_at(arc, t)
        for k in range(4):
            u[k, 0], u[k, 1], u[k, 2] = x, y, z
            ax, ay, az = acceleration(n, x, z, vx, vy)
            x, y, z, vx, vy, vz = vx, vy, vz, ax, ay, az
    if m == n and pushes(arc):
        for axis in range(3):
            value, rate, bend, twist = push_at(arc, axis, t)
            u[0, axis] += value
            u[1, axis] += rate
            u[2, axis] += bend
            u[3, axis] += twist
    for k in range(4, 7):
        for axis in range(3):
            u[k, axis] = -m * m * u[k - 2, axis]


@kernel()
def largest(f0, f1, f2, f3, h):
    """Return the largest |f| over [0, h] of f0 + f1 t + f2 P_1 + f3 P_2: P_1 <= t^2/2, P_2 <= t^3/6."""
    return max(abs(f0), abs(f0 + f1 * h)) + 0.5 * abs(f2) * h * h + abs(f3) * h * h * h / 6.0


@kernel()
def coriolis(n, u, k, axis):
    """Return one component of S u for the k-th derivative."""
    if axis == 2:
        return 0.0
    return 2.0 * n * u[k, 1] if axis == 0 else -2.0 * n * u[k, 0]


@kernel()
def greatest(u, k, h):
    """Return the largest length of the k-th derivative of thrust over [0, h]."""
    square = 0.0
    for axis in range(3):
        f = largest(u[k, axis], u[k + 1, axis], u[k + 2, axis], u[k + 3, axis], h)
        square += f * f
    return sqrt(square)


@kernel()
def lost_remainder(n, u, h):
    """Return the largest h^4/384 |z_4| over [0, h], of its position and of its velocity.

    z_4 = (-3u'' + 3Su' - (N + S^2) u, u''' - 3Su'' + 3 (N + S^2) u' + n^2 S u), and N + S^2 = -n^2 diag(1, 4,
    1); theory (45).
    """
    place, speed = 0.0, 0.0
    f, g = stack_matrix(4, 3), stack_matrix(4, 3)
    for k in range(4):
        for axis in range(3):
            w = n * n * (4.0 if axis == 1 else 1.0)
            f[k, axis] = -3.0 * u[k + 2, axis] + 3.0 * coriolis(n, u, k + 1, axis) + w * u[k, axis]
            g[k, axis] = u[k + 3, axis] - 3.0 * coriolis(n, u, k + 2, axis) - 3.0 * w * u[k + 1, axis]
            g[k, axis] += n * n * coriolis(n, u, k, axis)
    for axis in range(3):
        a = largest(f[0, axis], f[1, axis], f[2, axis], f[3, axis], h)
        b = largest(g[0, axis], g[1, axis], g[2, axis], g[3, axis], h)
        place += a * a
        speed += b * b
    share = h * h * h * h / 384.0
    return share * sqrt(place), share * sqrt(speed)


@kernel()
def growth(n, t):
    """Return bounds, growing with time, of the norms of Phi_rr(t) and Phi_rv(t), theory (46)."""
    if n == 0.0:
        return 1.0, t
    x = n * t
    place = min(1.0 + 1.5 * x * x, 7.0) + min(x * x * x, 6.0 * (x + 1.0))
    speed = (x if x <= 1.89 else 3.0 * x + 4.0) + min(x * x, 4.0)
    return place, speed / n


@kernel()
def stuck_remainder(n, m, u, h, held, longest, span):
    """Return bounds on the deviation of a stuck-on-thrust path from that of its cell's twelve points.

    The deviation is h^4/384 |d^4 r/ds^4| + 2 span^3/81 (|d^3 r/dd^3| + h/4 |d^4 r/ds dd^3|) for instants h
    apart and a range `span` of durations up to `longest`: parts that grow with Phi_rr and Phi_rv, and a
    constant one. `m` is the mean motion of the thrust's function space, theory (48).
    """
    turn = SWING_RATE * n  # of Phi_vv and, times n, of its derivatives
    push, rate, bend, twist = greatest(u, 0, h), greatest(u, 1, h), greatest(u, 2, h), greatest(u, 3, h)
    place, speed = lost_remainder(n, u, h)
    share, cube = h * h * h * h / 384.0, 2.0 * span * span * span / 81.0
    if held >= 0.0:  # a thrust that does not depend on s
        late = min(2.0, n * longest) * n * turn
        return place, speed, held * (share * late + cube * turn * (1.0 + 0.25 * n * h))
    swing = 1.0 if n == 0.0 else 9.0  # of Phi_vv = d Phi_rv/dt
    late = 4.0 * swing * twist + turn * (6.0 * bend + 4.0 * n * rate + n * n * push)
    always = share * longest * late + cube * turn * (push + 0.25 * h * (rate + n * push))
    return place, speed + share * longest * m * m * bend, always
