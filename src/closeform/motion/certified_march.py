"""The certified march: time steps along an arc during which a norm provably stays on one side of a level.

A norm s is convex, so from s(t) outside a zone, with rate D and an acceleration below A,

    s(t + h) >= s(t) + D h - A h^2 / 2                                          # theory (10)

and the norm stays above the target until the right side has fallen to the target.  From inside, each flat
part of a norm and the square of a round one are smooth, and the same bound holds with the opposite sign (see
`zones.shapes`).  Both converge like Newton's method at a crossing.  Where they stall (a norm that is almost
constant, as between two spacecraft on one circular relative orbit), a Taylor model takes over.

All kernels work in zone coordinates: positions divided by the half-axes of the zone, and `q`, the
derivatives (8, 3) of the relative position at the start of a window (see `arc`).
"""

from math import sqrt

from closeform._jit import kernel
from closeform.motion.arc import (
    ANGLE,
    END,
    MEAN_MOTION,
    START,
    acceleration,
    derivatives_at,
    is_cubic,
    state_at,
    thrusts,
)
from closeform.motion.hill import inverse_transforms, oscillation

# Steps in one window before the Taylor model is tried: at first, and after it has been needed.
PATIENCE, LESS_PATIENCE = 60, 3
# Length of a window of natural motion in n t.  Half as much: twice as many windows in a hundred
# orbits.  Twice as much: wider bounds, and longer searches although `tracks` exclude half of each window.
COAST_ANGLE = 3.0
TAYLOR_DEGREE = 14
TAYLOR_ANGLE = 0.25  # reach in n t; the truncation error is below 1e-17 of the squared norm


@kernel()
def window_end(a, b, t, end):
    """Return the end of the window of arcs a and b from t on: the end of an arc, or where bounds get wide."""
    n = max(a[MEAN_MOTION], b[MEAN_MOTION])
    stop = min(end, a[END], b[END])
    if n == 0.0:
        return stop
    coasts = a[MEAN_MOTION] == b[MEAN_MOTION] and not (thrusts(a) or thrusts(b))
    return min(stop, t + (COAST_ANGLE if coasts else ANGLE) / n)


@kernel()
def window(a, b, t, matrix, q):
    """Fill `q` with the derivatives of the relative position of arcs a and b at t.

    Returns its order and mean motion.
    """
    na = a[MEAN_MOTION]
    nb = b[MEAN_MOTION]
    n = max(na, nb)
    if na == nb and n > 0.0 and not (thrusts(a) or thrusts(b)):
        ax, ay, az, avx, avy, avz = state_at(a, t)
        x, y, z, vx, vy, vz = state_at(b, t)
        x, y, z, vx, vy, vz = ax - x, ay - y, az - z, avx - vx, avy - vy, avz - vz
        for k in range(4):  # the difference of two natural motions is one
            store(q, k, matrix, x, y, z)
            ax, ay, az = acceleration(n, x, z, vx, vy)
            x, y, z, vx, vy, vz = vx, vy, vz, ax, ay, az
        return 4, n
    order = 4 if is_cubic(a) and is_cubic(b) else 8
    q[:order] = 0.0
    derivatives_at(a, t, order, q, 1.0)
    derivatives_at(b, t, order, q, -1.0)
    for k in range(order):
        store(q, k, matrix, q[k, 0], q[k, 1], q[k, 2])
    return order, n


@kernel()
def store(q, k, matrix, x, y, z):
    for axis in range(3):
        q[k, axis] = matrix[axis, 0] * x + matrix[axis, 1] * y + matrix[axis, 2] * z


@kernel()
def locate(arcs, first, last, t):
    """Return the index in [first, last) of the arc that applies just after time t."""
    while last - first > 1:
        middle = (first + last) // 2
        if arcs[middle, START] <= t:
            first = middle
        else:
            last = middle
    return first


@kernel()
def relative_state(q, order, n, t):
    """Return position and velocity at time t after the start of the window."""
    if order == 4:
        c2, c3, c4 = oscillation(n, t)
        return (
            q[0, 0] + q[1, 0] * t + q[2, 0] * c3 + q[3, 0] * c4,
            q[0, 1] + q[1, 1] * t + q[2, 1] * c3 + q[3, 1] * c4,
            q[0, 2] + q[1, 2] * t + q[2, 2] * c3 + q[3, 2] * c4,
            q[1, 0] + q[2, 0] * c2 + q[3, 0] * c3,
            q[1, 1] + q[2, 1] * c2 + q[3, 1] * c3,
            q[1, 2] + q[2, 2] * c2 + q[3, 2] * c3,
        )
    p0, p1, p2, p3, p4, qm2, qm1, q0, q1, q2, q3, q4 = inverse_transforms(n, t)
    b2 = 0.5 * t * t
    b3 = b2 * t / 3.0
    b4 = q1 + 2.0 * n * n * q3
    b5 = q2 + 2.0 * n * n * q4
    d4 = q0 + 2.0 * n * n * q2
    x = q[0, 0] + q[1, 0] * t + q[2, 0] * b2 + q[3, 0] * b3
    y = q[0, 1] + q[1, 1] * t + q[2, 1] * b2 + q[3, 1] * b3
    z = q[0, 2] + q[1, 2] * t + q[2, 2] * b2 + q[3, 2] * b3
    vx = q[1, 0] + q[2, 0] * t + q[3, 0] * b2 + q[4, 0] * d4
    vy = q[1, 1] + q[2, 1] * t + q[3, 1] * b2 + q[4, 1] * d4
    vz = q[1, 2] + q[2, 2] * t + q[3, 2] * b2 + q[4, 2] * d4
    return (
        x + q[4, 0] * b4 + q[5, 0] * b5 + q[6, 0] * q3 + q[7, 0] * q4,
        y + q[4, 1] * b4 + q[5, 1] * b5 + q[6, 1] * q3 + q[7, 1] * q4,
        z + q[4, 2] * b4 + q[5, 2] * b5 + q[6, 2] * q3 + q[7, 2] * q4,
        vx + q[5, 0] * b4 + q[6, 0] * q2 + q[7, 0] * q3,
        vy + q[5, 1] * b4 + q[6, 1] * q2 + q[7, 1] * q3,
        vz + q[5, 2] * b4 + q[6, 2] * q2 + q[7, 2] * q3,
    )


@kernel()
def bound(q, order, n, h, axis):
    """Return upper bounds on |acceleration| and |velocity| along one axis over [0, h]."""
    b = abs(q[2, axis])
    c = abs(q[3, axis])
    if order == 4:
        if n == 0.0:
            a = max(b, abs(q[2, axis] + q[3, axis] * h))
            return a, abs(q[1, axis]) + a * h
        if n * h < 0.1:
            return b + c * h, abs(q[1, axis]) + (b + c * h) * h
        swing = sqrt(b * b + c * c / (n * n))
        mean = abs(q[1, axis] + q[3, axis] / (n * n))
        a = min(swing, b + c * h)
        return a, min(abs(q[1, axis]) + a * h, mean + swing / n)
    # A cubic within the hull of its Bernstein coefficients, and the remainder for n h <= 1: |b4'' -
    # t^2/2| <= (nt)^4/360 t^2/2, |b5'' - t^3/6| <= (nt)^4/840 t^3/6, and the last two second derivatives
    # are below t^4/24 and t^5/120.
    c1 = q[3, axis] * h
    c2 = 0.5 * q[4, axis] * h * h
    c3 = q[5, axis] * h * h * h / 6.0
    m0 = q[2, axis]
    m1 = m0 + c1 / 3.0
    m2 = m0 + (2.0 * c1 + c2) / 3.0
    m3 = m0 + c1 + c2 + c3
    rest = (abs(c2) + abs(c3)) * (n * h) ** 4 / 360.0
    rest += abs(q[6, axis]) * h**4 / 24.0 + abs(q[7, axis]) * h**5 / 120.0
    a = max(abs(m0), abs(m1), abs(m2), abs(m3)) + rest
    return a, abs(q[1, axis]) + a * h


@kernel()
def bounds(q, order, n, h):
    """Return upper bounds over [0, h] on the acceleration along each axis, on its norm, and on the speed."""
    ax, vx = bound(q, order, n, h, 0)
    ay, vy = bound(q, order, n, h, 1)
    az, vz = bound(q, order, n, h, 2)
    return ax, ay, az, sqrt(ax * ax + ay * ay + az * az), sqrt(vx * vx + vy * vy + vz * vz)


@kernel()
def taylor_step(axes, q, order, n, longest, target, inside):
    """Return the time that a part, round over the first `axes`, provably stays on its side of `target`."""
    c = [(0.0, 0.0, 0.0)] * (TAYLOR_DEGREE + 1)
    factorial = 1.0
    d = [(0.0, 0.0, 0.0)] * (TAYLOR_DEGREE + 1)
    nn = n * n
    for k in range(TAYLOR_DEGREE + 1):
        if k < order:
            d[k] = (q[k, 0], q[k, 1], q[k, 2])
        elif order == 4:
            e = d[k - 2]
            d[k] = (-nn * e[0], -nn * e[1], -nn * e[2])
        else:
            e = d[k - 2]
            g = d[k - 4]
            d[k] = (
                -nn * (2.0 * e[0] + nn * g[0]),
                -nn * (2.0 * e[1] + nn * g[1]),
                -nn * (2.0 * e[2] + nn * g[2]),
            )
        factorial *= max(k, 1)
        c[k] = (d[k][0] / factorial, d[k][1] / factorial, d[k][2] / factorial)
    sign = -1.0 if inside else 1.0
    f = [0.0] * (TAYLOR_DEGREE + 1)
    for k in range(TAYLOR_DEGREE + 1):
        for i in range(k + 1):
            product = c[i][0] * c[k - i][0] + c[i][1] * c[k - i][1]
            f[k] += sign * (product + c[i][2] * c[k - i][2] if axes == 3 else product)
    gap = f[0] - sign * target * target
    h = longest if n == 0.0 else min(longest, TAYLOR_ANGLE / n)
    for _ in range(80):
        lowest = 0.0
        power = 1.0
        for k in range(1, TAYLOR_DEGREE + 1):
            power *= h
            lowest += min(0.0, f[k] * power)
        if gap + lowest > 0.0:
            return h
        h *= 0.6
    return 0.0
