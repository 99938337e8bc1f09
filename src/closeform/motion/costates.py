"""Gain and cost of thrust along a primer under a thrust limit: the dual of transfers, in six numbers.

Of all thrusts |u| <= U that make a transfer, those of minimum energy or delta-v follow the primer p
of theory (26) with a size a(|p|) that is zero below one level and U above another:

    energy         a = min(|p|, U)                                                       # theory (31)
    delta-v        a = U where |p| > 1, else 0                                           # theory (32)
    between both   a = min((|p| - 1)/e, U) where |p| > 1, else 0

The start c of p maximises g.c - integral of h(|p|), h' = a, whose gradient is the change still to be
gained, g - integral of Psi' u.  Where g.c > U integral of |p|, no thrust within U makes the transfer.
                                                                                         # theory (33)
"""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.hill import coast, oscillation
from closeform.motion.minimum_delta_v.primer import NARROWEST, UNCLEAR, kind_of, series

FREE = 1e200  # thrust limit of unlimited thrust
COASTING, RISING, SATURATED = 0, 1, 2  # |p| below both levels, between them, above both

# Six Gauss points and their weights on [0, 1]. A piece turns the direction of p by TURN at most and the orbit
# by ANGLE, or by twice that where thrust is p: the quadrature error is below 1e-12.
POINTS: tuple[float, ...] = (0.033765242898423975, 0.16939530676686776, 0.38069040695840156)
POINTS += (0.6193095930415985, 0.8306046932331322, 0.966234757101576)
WEIGHTS: tuple[float, ...] = (0.08566224618958525, 0.1803807865240693, 0.23395696728634552)
WEIGHTS += (0.23395696728634552, 0.1803807865240693, 0.08566224618958525)
TURN, ANGLE = 0.35, 0.5
SHORTEST = 1e-14  # piece, as a share of the duration
SQUARED = 1e-9  # share of a piece: after so short a Newton step the next one is rounding


@kernel()
def square(n, c, t, level):
    """Return |p|^2 - level^2 and half its rate, at time t."""
    x, y, z, vx, vy, vz = coast(n, t, c[0], c[1], c[2], c[3], c[4], c[5])
    return x * x + y * y + z * z - level * level, x * vx + y * vy + z * vz


@kernel()
def turning(n, c, start, end, before):
    """Return the time at which the rate of |p|^2 is zero, between two times at which its signs differ."""
    low, high = start, end
    a, b = before, square(n, c, end, 0.0)[1]
    t = 0.5 * (low + high)
    for k in range(60):
        t = low + (high - low) * a / (a - b) if k % 3 != 2 and a != b else 0.5 * (low + high)
        slope = square(n, c, t, 0.0)[1]
        if (slope > 0.0) == (before > 0.0):
            low, a = t, slope
            b *= 0.5
        else:
            high, b = t, slope
            a *= 0.5
        if high - low <= 1e-9 * (end - start) or slope == 0.0:
            break
    return t


@kernel()
def crossing(n, c, start, end, level):
    """Return the time between `start` and `end`, on different sides of `level`, at which |p| is `level`."""
    low, high = start, end
    outside = square(n, c, end, level)[0] > 0.0
    t = 0.5 * (low + high)
    for _ in range(80):
        f, half = square(n, c, t, level)
        if (f > 0.0) == outside:
            high = t
        else:
            low = t
        there = t - 0.5 * f / half if half != 0.0 else low
        if low < there < high and abs(there - t) <= SQUARED * (end - start):
            return there
        if not low < there < high:
            there = 0.5 * (low + high)
        if abs(there - t) <= 1e-15 * end:
            break
        t = there
    return t


@kernel()
def left(n, c, start, end, level, outside):
    """Return the time at which |p| first leaves its side of `level`, or `end`; |p| may turn once before."""
    away = 1.0 if outside else -1.0
    last, after = square(n, c, end, level)
    if last * away < 0.0:
        return crossing(n, c, start, end, level)
    before = square(n, c, start, level)[1]
    if before * away < 0.0 and after * away > 0.0:
        turn = turning(n, c, start, end, before)
        if square(n, c, turn, level)[0] * away < 0.0:
            return crossing(n, c, start, turn, level)
    return end


@kernel()
def side(n, c, t, low, high):
    """Return the region of |p| at time t."""
    f, _ = square(n, c, t, 0.0)
    r = sqrt(f)
    return COASTING if r < low else (RISING if r < high else SATURATED)


@kernel()
def piece_end(n, duration, c, t, region, low, high):
    """Return the end of the piece that begins at time t in a region of |p|, and the next region."""
    bent = region == SATURATED or (region == RISING and low > 0.0)  # thrust differs from p
    end = duration if n == 0.0 else min(duration, t + (ANGLE if bent else 2.0 * ANGLE) / n)
    if bent:
        x, y, z, vx, vy, vz = coast(n, t, c[0], c[1], c[2], c[3], c[4], c[5])
        speed = sqrt(vx * vx + vy * vy + vz * vz)
        if speed * (end - t) > TURN * sqrt(x * x + y * y + z * z):
            end = t + TURN * sqrt(x * x + y * y + z * z) / speed
    lower = 0.0 if region == COASTING else (low if region == RISING else high)
    upper = inf if region == SATURATED else (high if region == RISING else low)
    terms, sizes, f = stack_matrix(9, 3), stack_vector(10), stack_vector(9)
    while True:
        rest = series(n, c, 0.5 * (t + end), 0.5 * (end - t), terms, sizes, f)
        kind, most = kind_of(f, rest, 0.0)
        least = 2.0 * f[0] - most - abs(f[2])
        if most < upper * upper and (least > lower * lower or lower == 0.0):
            return end, region
        if kind != UNCLEAR or end - t <= NARROWEST * duration:
            break
        end = 0.5 * (t + end)
    after = region
    if lower > 0.0:
        there = left(n, c, t, end, lower, True)
        if there < end:
            end, after = there, COASTING if region == RISING or low == high else RISING
    if upper < inf:
        there = left(n, c, t, end, upper, False)
        if there < end:
            end, after = there, SATURATED if region == RISING or low == high else RISING
    return min(max(end, t + SHORTEST * duration), duration), after


@kernel()
def size(r, low, e, limit):
    """Return the thrust along a primer of length r, and its derivative by r: theory (31, 32) and between."""
    if r <= low:
        return 0.0, 0.0
    if r - low >= e * limit:
        return limit, 0.0
    return (r - low) / e, 1.0 / e


@kernel()
def add_outer(weight, a, b, s, m, k, c, hessian):
    """Add weight Psi' Psi, lower half; Psi = (a, 0, 0, s, m, 0), (b, 1, 0, -m, k, 0), (0, 0, c, 0, 0, s)."""
    hessian[0, 0] += weight * (a * a + b * b)
    hessian[1, 0] += weight * b
    hessian[1, 1] += weight
    hessian[2, 2] += weight * c * c
    hessian[3, 0] += weight * (a * s - b * m)
    hessian[3, 1] -= weight * m
    hessian[3, 3] += weight * (s * s + m * m)
    hessian[4, 0] += weight * (a * m + b * k)
    hessian[4, 1] += weight * k
    hessian[4, 3] += weight * (s * m - m * k)
    hessian[4, 4] += weight * (m * m + k * k)
    hessian[5, 2] += weight * c * s
    hessian[5, 5] += weight * s * s


@kernel()
def add_point(n, t, w, c, low, e, limit, gained, hessian):
    """Add the contribution of an instant of weight w to `gained` and `hessian`; return |p| and the thrust.

    If e < 0 the instant is a switch: thrust begins or ends there, at a time that moves with c.
    """
    p0, p1, p2 = oscillation(n, t)
    nn = n * n
    a, b, m, k, z = 1.0 + 3.0 * nn * p1, -6.0 * n * nn * p2, 2.0 * n * p1, t - 4.0 * nn * p2, 1.0 - nn * p1
    x = a * c[0] + p0 * c[3] + m * c[4]
    y = b * c[0] + c[1] - m * c[3] + k * c[4]
    v = z * c[2] + p0 * c[5]
    r = sqrt(x * x + y * y + v * v)
    if e < 0.0:
        thrust, rate, along = 0.0, 0.0, w / (r * r)
    else:
        thrust, rate = size(r, low, e, limit)
        if thrust == 0.0:
            return r, 0.0
        along = w * (rate - thrust / r) / (r * r)
    e0, e1, e2 = a * x + b * y, y, z * v
    e3, e4, e5 = p0 * x - m * y, m * x + k * y, p0 * v
    across = w * thrust / r
    vector = (e0, e1, e2, e3, e4, e5)
    for i in range(6):
        gained[i] += across * vector[i]
        if along != 0.0:
            for j in range(i + 1):
                hessian[i, j] += along * vector[i] * vector[j]
    if across != 0.0:
        add_outer(across, a, b, p0, m, k, z, hessian)
    return r, thrust


@kernel()
def sum_up(n, duration, c, low, e, limit, gained, hessian):
    """Fill `gained` (6,), the integral of Psi' u, and its `hessian` (6, 6) for the primer that starts at `c`.

    Returns the integrals of h(|p|), of |p| (an upper bound), of |u| and of |u|^2.
    """
    for i in range(6):
        gained[i] = 0.0
        for j in range(6):
            hessian[i, j] = 0.0
    high = low + e * limit
    total, length, spent, energy = 0.0, 0.0, 0.0, 0.0
    t, region = 0.0, side(n, c, 0.0, low, high)
    while t < duration:
        end, after = piece_end(n, duration, c, t, region, low, high)
        w = end - t
        if region == COASTING:
            length += w * low
        else:
            sum_r, sum_rr = 0.0, 0.0
            for q in range(6):
                r, thrust = add_point(n, t + w * POINTS[q], w * WEIGHTS[q], c, low, e, limit, gained, hessian)
                g = w * WEIGHTS[q]
                sum_r += g * r
                sum_rr += g * r * r
                spent += g * thrust
                energy += g * thrust * thrust
                total += g * (thrust * (r - low) - 0.5 * e * thrust * thrust)
            # for a piece in which |p| may vanish, by Cauchy and Schwarz
            length += sum_r if region == SATURATED or low > 0.0 else sqrt(w * sum_rr)
        if e == 0.0 and after != region:
            half = square(n, c, end, low)[1]
            if half != 0.0:  # |p| is 1 at a switch, so its rate is `half`
                add_point(n, end, limit * low / abs(half), c, low, -1.0, limit, gained, hessian)
        t, region = end, after
    for i in range(6):
        for j in range(i):
            hessian[j, i] = hessian[i, j]
    return total, length, spent, energy
