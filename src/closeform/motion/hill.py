"""Hill's equations in closed form, floats only, for any mean motion n >= 0.

Rotating frame on a circular orbit: x radial outward, y along the velocity, z along the
orbit normal.  With N = diag(3n^2, 0, -n^2) and S v = (2n vy, -2n vx, 0),

    r'' = N r + S r' + u                                                       # theory (1)

The thrust that minimises the integral of |u|^2 obeys u'' = N u + S u', so the optimal
thrust is itself a natural motion, and an arc is determined by its initial state, thrust
and thrust rate.  All formulas are built from the inverse Laplace transforms

    P_m = 1/(s^m (s^2 + n^2)),    Q_m = 1/(s^m (s^2 + n^2)^2)

which are smooth at n = 0 (P_m -> t^(m+1)/(m+1)!, Q_m -> t^(m+3)/(m+3)!) and appear only with
non-negative powers of n: no digit is lost as n t -> 0, and n = 0 is not a special case.
"""

from math import cos, sin

from closeform._jit import kernel

# Coefficients in (n t)^2 of P_2, P_3 and P_4, Q_3, Q_4 over their leading power of t, by term; at n t =
# SERIES_BELOW the first omitted term is below 1e-19 of the sum.
SERIES_BELOW = 2.0


def _series(first: int, doubled: bool) -> tuple[float, ...]:
    """Return (-1)^j (j+1 if doubled else 1) / (first + 2j)! for j = 12 ... 0 (Horner's order)."""
    terms = []
    factorial = 1.0
    for k in range(2, first + 1):
        factorial *= k
    for j in range(13):
        terms.append((-1.0) ** j * (j + 1 if doubled else 1) / factorial)
        factorial *= (first + 2 * j + 1) * (first + 2 * j + 2)
    return tuple(reversed(terms))


P1_NEAR, P2_NEAR = _series(2, doubled=False)[-9:], _series(3, doubled=False)[-9:]  # up to n t = 1
P3 = _series(4, doubled=False)
P4 = _series(5, doubled=False)
Q3 = _series(6, doubled=True)
Q4 = _series(7, doubled=True)


@kernel()
def horner(series, z):
    total = 0.0
    for coefficient in series:
        total = total * z + coefficient
    return total


@kernel()
def oscillation(n, t):
    """Return sin(nt)/n, (1 - cos nt)/n^2 and (nt - sin nt)/n^3: P_0, P_1, P_2."""
    angle = n * t
    if abs(angle) < 1.0:
        p2 = t * t * t * horner(P2_NEAR, angle * angle)
        return t - n * n * p2, t * t * horner(P1_NEAR, angle * angle), p2
    s = sin(angle)
    c = cos(angle)
    return s / n, (1.0 - c) / (n * n), (angle - s) / (n * n * n)


@kernel()
def inverse_transforms(n, t):
    """Return P_0 ... P_4 and Q_-2 ... Q_4 at time t."""
    nn = n * n
    z = nn * t * t
    tt = t * t
    if z < SERIES_BELOW * SERIES_BELOW:  # downward recurrences, stable for small nt
        p3 = tt * tt * horner(P3, z)
        p4 = tt * tt * t * horner(P4, z)
        q3 = tt * tt * tt * horner(Q3, z)
        q4 = tt * tt * tt * t * horner(Q4, z)
        p1 = 0.5 * tt - nn * p3
        p2 = tt * t / 6.0 - nn * p4
        p0 = t - nn * p2
        q2 = p4 - nn * q4
        q1 = p3 - nn * q3
        q0 = p2 - nn * q2
        qm1 = p1 - nn * q1
        qm2 = p0 - nn * q0
    else:  # upward, stable for large nt
        s = sin(n * t)
        c = cos(n * t)
        p0 = s / n
        p1 = (1.0 - c) / nn
        p2 = (t - p0) / nn
        p3 = (0.5 * tt - p1) / nn
        p4 = (tt * t / 6.0 - p2) / nn
        qm2 = 0.5 * (p0 + t * c)
        qm1 = 0.5 * t * p0
        q0 = (p0 - qm2) / nn
        q1 = (p1 - qm1) / nn
        q2 = (p2 - q0) / nn
        q3 = (p3 - q1) / nn
        q4 = (p4 - q2) / nn
    return p0, p1, p2, p3, p4, qm2, qm1, q0, q1, q2, q3, q4


@kernel()
def coast(n, t, x, y, z, vx, vy, vz):
    """Return the state after time t of natural motion."""
    return _coast(n, t, oscillation(n, t), x, y, z, vx, vy, vz)


@kernel()
def _coast(n, t, transforms, x, y, z, vx, vy, vz):
    p0, p1, p2 = transforms
    c = 1.0 - n * n * p1
    ax = n * (3.0 * n * x + 2.0 * vy)
    moved = vx * p1 + ax * p2  # the integral of x - x(0)
    return (
        x + vx * p0 + ax * p1,
        y + vy * t - 2.0 * n * moved,
        z * c + vz * p0,
        vx * c + ax * p0,
        vy - 2.0 * n * (vx * p0 + ax * p1),
        vz * c - n * n * z * p0,
    )


@kernel()
def step_on(n, t, transforms, state, thrust):
    """Return the state, and optimal thrust with its rate, after time t; `transforms` are those of t."""
    x, y, z, vx, vy, vz = _coast(n, t, transforms[:3], *state)
    fx, fy, fz, gx, gy, gz = _driven(n, t, transforms, *thrust)
    reached = x + fx, y + fy, z + fz, vx + gx, vy + gy, vz + gz
    return reached, _coast(n, t, transforms[:3], *thrust)


@kernel()
def driven(n, t, ux, uy, uz, wx, wy, wz):
    """Return the state reached from rest at the origin under optimal thrust that starts at u with rate w."""
    return _driven(n, t, inverse_transforms(n, t), ux, uy, uz, wx, wy, wz)


@kernel()
def _driven(n, t, transforms, ux, uy, uz, wx, wy, wz):
    p0, p1, p2, p3, p4, qm2, qm1, q0, q1, q2, q3, q4 = transforms
    m = 2.0 * n
    a = n * (3.0 * n * ux + 2.0 * wy)
    x = ux * p1 + wx * q0 + a * q1 + m * (uy * p2 + wy * p3 - m * (wx * q2 + a * q3))
    vx = ux * p0 + wx * qm1 + a * q0 + m * (uy * p1 + wy * p2 - m * (wx * q1 + a * q2))
    moved = ux * p2 + wx * q1 + a * q2 + m * (uy * p3 + wy * p4 - m * (wx * q3 + a * q4))
    return (
        x,
        -m * moved + uy * t * t / 2.0 + wy * t * t * t / 6.0 - m * (wx * p3 + a * p4),
        uz * qm1 + wz * q0,
        vx,
        -m * x + uy * t + wy * t * t / 2.0 - m * (wx * p2 + a * p3),
        uz * qm2 + wz * qm1,
    )


@kernel()
def pushed(n, t, u, k):
    """Return the state reached from rest under a thrust u0 + u1 t + u2 P_1 + u3 P_2 along each axis.

    `u` holds the derivatives at the start from index k on: three of u0, then of u1, u2 and u3.
    """
    p0, p1, p2, p3, p4, qm2, qm1, q0, q1, q2, q3, q4 = inverse_transforms(n, t)
    m = 2.0 * n
    y1 = u[k + 1] * t + u[k + 4] * t * t / 2.0 + u[k + 7] * p2 + u[k + 10] * p3  # integral of the thrust
    y2 = u[k + 1] * t * t / 2.0 + u[k + 4] * t * t * t / 6.0 + u[k + 7] * p3 + u[k + 10] * p4
    across = u[k + 1] * p2 + u[k + 4] * p3 + u[k + 7] * q2 + u[k + 10] * q3
    x = u[k] * p1 + u[k + 3] * p2 + u[k + 6] * q1 + u[k + 9] * q2 + m * across
    moved = u[k + 1] * p3 + u[k + 4] * p4 + u[k + 7] * q3 + u[k + 10] * q4
    moved = u[k] * p2 + u[k + 3] * p3 + u[k + 6] * q2 + u[k + 9] * q3 + m * moved
    gained = u[k + 1] * p1 + u[k + 4] * p2 + u[k + 7] * q1 + u[k + 10] * q2
    return (
        x,
        y2 - m * moved,
        u[k + 2] * p1 + u[k + 5] * p2 + u[k + 8] * q1 + u[k + 11] * q2,
        u[k] * p0 + u[k + 3] * p1 + u[k + 6] * q0 + u[k + 9] * q1 + m * gained,
        y1 - m * x,
        u[k + 2] * p0 + u[k + 5] * p1 + u[k + 8] * q0 + u[k + 11] * q1,
    )


@kernel()
def response(n, t, matrix):
    """Fill the 6x6 `matrix` that maps initial thrust and thrust rate to the state of `driven`."""
    transforms = inverse_transforms(n, t)
    unit = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(6):
        column = _driven(
            n, t, transforms, unit[5 - k], unit[6 - k], unit[7 - k], unit[8 - k], unit[9 - k], unit[10 - k]
        )
        for i in range(6):
            matrix[i, k] = column[i]


@kernel()
def costate(n, ux, uy, uz, wx, wy, wz):
    """Return the costate of the position, S u - w; that of the velocity is the thrust itself."""
    return 2.0 * n * uy - wx, -2.0 * n * ux - wy, -wz
