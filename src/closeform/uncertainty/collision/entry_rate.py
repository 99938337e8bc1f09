"""Mean rate of entries of a random motion into a ball at one time, and sampling of entries from it.

In zone coordinates along the principal axes of the position's covariance, the smallest deviation first, a
position is q = b + s d, with d three independent standard normals. Given q, the velocity is normal, with mean
v + G d and a covariance C that does not depend on q. So is the inward speed, -n . velocity, with mean mu(q)
and deviation sigma(n). The mean rate of entries is

    nu = integral over the surface of (density at q) E[(-n . velocity)+ | q]                     # theory (60)

over the part within `TAIL` of the largest density: a band of tilts from the minor axis, and arcs of each
quadrant in it. Gauss's rule is used for both, so that a thin covariance takes as many nodes as a round one.
Both are cut where mu changes sign, which is an edge if sigma is small.

`principal` fills the frame (13, 3): deviations, mean position and mean velocity, the axes (rows), the
regression of the velocity on the position's standard normals (GAIN), and its residual covariance (SPREAD). It
also fills rows (6, M), orthonormal: the errors that form each standard normal, and the residual errors of
each component of the velocity.
"""

from math import acos, asin, cos, erfc, exp, inf, pi, sin, sqrt

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector

SIGMA, MEAN, VELOCITY, AXES, GAIN, SPREAD = 0, 1, 2, 3, 6, 9
NEAREST = 12  # set by `nearest_square`: the nearest point, in standard normals
THINNEST = 1e-9  # of the zone: smallest deviation, for errors in one plane

RESIDUAL = 1e-12  # relative deviation below which it is rounding
TAIL = 40.0  # squared distance in deviations: densities down to 2e-9 of the largest
SHARP = 4.0  # inward speed over its deviation, above which a sign change is an edge
UNDERFLOW = 1400.0  # squared distance in deviations above which densities are below 1e-300
PARTS = 4  # parts of an arc at whose ends signs are compared
NODE = 4  # columns of a node: q in principal axes, and its part of the rate
ROWS, BLOCKS = float64[:, ::1], float64[:, :, ::1]


@kernel()
def principal(mean, factor, matrix, frame, rows):
    """Transform a state (6,) and a factor (6, M) of its covariance to the principal axes of its position."""
    size = factor.shape[1]
    for i in range(3):
        frame[SPREAD, i], frame[SPREAD + 1, i] = 0.0, 0.0
        for k in range(3):
            frame[SPREAD, i] += matrix[i, k] * mean[k]
            frame[SPREAD + 1, i] += matrix[i, k] * mean[3 + k]
            frame[AXES + i, k] = 1.0 if i == k else 0.0
        for j in range(size):
            rows[i, j], rows[3 + i, j] = 0.0, 0.0
            for k in range(3):
                rows[i, j] += matrix[i, k] * factor[k, j]
                rows[3 + i, j] += matrix[i, k] * factor[3 + k, j]
    make_orthogonal(frame, rows, size)
    for p in range(2):  # smallest deviation first
        for r in range(p + 1, 3):
            if frame[SIGMA, r] < frame[SIGMA, p]:
                frame[SIGMA, p], frame[SIGMA, r] = frame[SIGMA, r], frame[SIGMA, p]
                for k in range(3):
                    frame[AXES + p, k], frame[AXES + r, k] = frame[AXES + r, k], frame[AXES + p, k]
                for j in range(size):
                    rows[p, j], rows[r, j] = rows[r, j], rows[p, j]
    for i in range(3):
        frame[MEAN, i], frame[VELOCITY, i] = 0.0, 0.0
        for k in range(3):
            frame[MEAN, i] += frame[AXES + i, k] * frame[SPREAD, k]
            frame[VELOCITY, i] += frame[AXES + i, k] * frame[SPREAD + 1, k]
        known = frame[SIGMA, i] > RESIDUAL * frame[SIGMA, 2]
        for j in range(size):
            rows[i, j] = rows[i, j] / frame[SIGMA, i] if known else 0.0
        frame[SIGMA, i] = max(frame[SIGMA, i], THINNEST)
    for j in range(size):
        x, y, z = rows[3, j], rows[4, j], rows[5, j]
        for i in range(3):
            rows[3 + i, j] = frame[AXES + i, 0] * x + frame[AXES + i, 1] * y + frame[AXES + i, 2] * z
    part_velocity(frame, rows, size)


@kernel()
def make_orthogonal(frame, rows, size):
    """Rotate axes until the three rows of positions are orthogonal; their lengths are the deviations.

    Jacobi rotations of the factor's rows: the smallest deviation keeps its digits, which it would lose in the
    covariance.
    """
    for _ in range(30):
        turned = False
        for p in range(2):
            for r in range(p + 1, 3):
                a, b, g = 0.0, 0.0, 0.0
                for j in range(size):
                    a += rows[p, j] * rows[p, j]
                    b += rows[r, j] * rows[r, j]
                    g += rows[p, j] * rows[r, j]
                if abs(g) <= 1e-15 * sqrt(a * b):
                    continue
                turned = True
                zeta = (b - a) / (2.0 * g)
                t = (1.0 if zeta >= 0.0 else -1.0) / (abs(zeta) + sqrt(1.0 + zeta * zeta))
                c = 1.0 / sqrt(1.0 + t * t)
                s = c * t
                for j in range(size):
                    x, y = rows[p, j], rows[r, j]
                    rows[p, j], rows[r, j] = c * x - s * y, s * x + c * y
                for k in range(3):
                    x, y = frame[AXES + p, k], frame[AXES + r, k]
                    frame[AXES + p, k], frame[AXES + r, k] = c * x - s * y, s * x + c * y
        if not turned:
            break
    for i in range(3):
        square = 0.0
        for j in range(size):
            square += rows[i, j] * rows[i, j]
        frame[SIGMA, i] = sqrt(square)


@kernel()
def part_velocity(frame, rows, size):
    """Split the velocity's rows into the regression on the position and the residual.

    A residual of rounding is set to 0: with at most three errors, positions usually determine the velocity.
    """
    for i in range(3):
        whole, left = 0.0, 0.0
        for j in range(size):
            whole += rows[3 + i, j] * rows[3 + i, j]
        for k in range(3):
            share = 0.0
            for j in range(size):
                share += rows[3 + i, j] * rows[k, j]
            for j in range(size):
                rows[3 + i, j] -= share * rows[k, j]
            frame[GAIN + i, k] = share
        for j in range(size):
            left += rows[3 + i, j] * rows[3 + i, j]
        if left <= RESIDUAL * RESIDUAL * whole:
            for j in range(size):
                rows[3 + i, j] = 0.0
    for i in range(3):
        for k in range(3):
            frame[SPREAD + i, k] = 0.0
            for j in range(size):
                frame[SPREAD + i, k] += rows[3 + i, j] * rows[3 + k, j]


@kernel()
def nearer(frame, x, y, z, best):
    """Return the squared distance, in deviations, from the mean to the sphere's point along (x, y, z).

    The result is at most `best`; a new minimum is stored in the frame.
    """
    scale = 1.0 / sqrt(x * x + y * y + z * z)
    dx = (x * scale - frame[MEAN, 0]) / frame[SIGMA, 0]
    dy = (y * scale - frame[MEAN, 1]) / frame[SIGMA, 1]
    dz = (z * scale - frame[MEAN, 2]) / frame[SIGMA, 2]
    square = dx * dx + dy * dy + dz * dz
    if square < best:
        frame[NEAREST, 0], frame[NEAREST, 1], frame[NEAREST, 2] = dx, dy, dz
    return min(square, best)


@kernel()
def nearest_square(frame):
    """Return the minimum squared distance to the sphere by Lagrange's condition q_i = b_i / (1 + x s_i^2)."""
    b0, b1, b2 = frame[MEAN, 0], frame[MEAN, 1], frame[MEAN, 2]
    s0, s1, s2 = frame[SIGMA, 0] ** 2, frame[SIGMA, 1] ** 2, frame[SIGMA, 2] ** 2
    out = sqrt(b0 * b0 + b1 * b1 + b2 * b2) - 1.0
    best = inf
    for axis in range(6):  # for a mean at the centre
        sign = 1.0 if axis < 3 else -1.0
        k = axis % 3
        best = nearer(frame, sign * (k == 0), sign * (k == 1), sign * (k == 2), best)
    if out == -1.0:
        return best
    best = nearer(frame, b0, b1, b2, best)
    # outside x > 0, in steps of its logarithm; inside -1 / s2 < x < 0
    low, high = (out / s2, out / s0) if out > 0.0 else (0.0, 1.0)
    for _ in range(60):
        middle = sqrt(low * high) if out > 0.0 else 0.5 * (low + high)
        x = middle if out > 0.0 else -middle / s2
        qx, qy, qz = b0 / (1.0 + x * s0), b1 / (1.0 + x * s1), b2 / (1.0 + x * s2)
        larger = qx * qx + qy * qy + qz * qz > 1.0
        if larger == (out > 0.0):
            low = middle
        else:
            high = middle
    if qx * qx + qy * qy + qz * qz > 0.0:
        best = nearer(frame, qx, qy, qz, best)
    if out < 0.0 and s0 < s2:  # x at its limit -1 / s2, for a mean off the centre along a thin axis
        qx, qy = b0 / (1.0 - s0 / s2), b1 / (1.0 - s1 / s2) if s1 < s2 else 0.0
        left = 1.0 - qx * qx - qy * qy
        if left > 0.0:
            best = nearer(frame, qx, qy, sqrt(left) if b2 >= 0.0 else -sqrt(left), best)
    return best


@kernel()
def inward(frame, x, y, z):
    """Return the mean inward speed at q = (x, y, z), where q is also the outward normal."""
    dx = (x - frame[MEAN, 0]) / frame[SIGMA, 0]
    dy = (y - frame[MEAN, 1]) / frame[SIGMA, 1]
    dz = (z - frame[MEAN, 2]) / frame[SIGMA, 2]
    vx = frame[VELOCITY, 0] + frame[GAIN, 0] * dx + frame[GAIN, 1] * dy + frame[GAIN, 2] * dz
    vy = frame[VELOCITY, 1] + frame[GAIN + 1, 0] * dx + frame[GAIN + 1, 1] * dy + frame[GAIN + 1, 2] * dz
    vz = frame[VELOCITY, 2] + frame[GAIN + 2, 0] * dx + frame[GAIN + 2, 1] * dy + frame[GAIN + 2, 2] * dz
    return -(x * vx + y * vy + z * vz)


@kernel()
def deviation(frame, nx, ny, nz):
    """Return the standard deviation of the speed along n, given the position."""
    xx, yy, zz = frame[SPREAD, 0], frame[SPREAD + 1, 1], frame[SPREAD + 2, 2]
    xy, xz, yz = frame[SPREAD, 1], frame[SPREAD, 2], frame[SPREAD + 1, 2]
    square = nx * nx * xx + ny * ny * yy + nz * nz * zz + 2.0 * (nx * ny * xy + nx * nz * xz + ny * nz * yz)
    return sqrt(max(square, 0.0))


@kernel()
def inflow(mu, sigma):
    """Return the mean of the positive part of a normal number."""
    if abs(mu) > 30.0 * sigma:
        return max(mu, 0.0)
    u = mu / sigma
    return sigma * exp(-0.5 * u * u) / sqrt(2.0 * pi) + 0.5 * mu * erfc(-u / sqrt(2.0))


@kernel()
def inward_on_arc(frame, tilt, e, f, angle):
    """Return the mean inward speed at an angle of a quadrant, on the circle at a tilt from the minor axis."""
    height, width = cos(tilt), sin(tilt)
    x, y = e * width * cos(angle), f * width * sin(angle)
    return inward(frame, height, x, y)


@kernel()
def inward_on_meridian(frame, quadrant, _, __, tilt):
    """Return the mean inward speed at a tilt, in the middle of a quadrant."""
    e = 1.0 if quadrant % 2 == 0 else -1.0
    f = 1.0 if quadrant < 2 else -1.0
    return inward_on_arc(frame, tilt, e, f, 0.25 * pi)


@kernel()
def sign_change(speed, frame, where, e, f, low, high, at_low, at_high):
    """Return the angle between two at which the mean inward speed changes sign (Illinois method).

    `speed` is `inward_on_arc` or `inward_on_meridian`, whose arguments are `where`, e and f.
    """
    for _ in range(14):
        angle = low + (high - low) * at_low / (at_low - at_high)
        mu = speed(frame, where, e, f, angle)
        if mu * at_low > 0.0:
            low, at_low, at_high = angle, mu, 0.5 * at_high
        else:
            high, at_high, at_low = angle, mu, 0.5 * at_low
        if mu == 0.0 or high - low < 1e-9:
            break
    return 0.5 * (low + high)


@kernel()
def is_sharp(frame):
    """Return True if the speed's smallest deviation is small relative to its mean, at the largest density."""
    square = 0.0
    for i in range(3):
        speed = frame[VELOCITY, i]
        for k in range(3):
            speed += frame[GAIN + i, k] * frame[NEAREST, k]
        square += speed * speed
    least = min(frame[SPREAD, 0], frame[SPREAD + 1, 1], frame[SPREAD + 2, 2])
    return square > SHARP * SHARP * least


@kernel()
def fill_panels(frame, begin, end, sharp, panels):
    """Fill `panels` with tilts between which the rate is smooth, and return their number.

    Sign changes are located on four meridians.
    """
    panels[0] = begin
    count = 1
    for quadrant in range(4 if sharp else 0):
        low, at_low = begin, inward_on_meridian(frame, quadrant, 0.0, 0.0, begin)
        for k in range(1, PARTS + 1):
            high = begin + (end - begin) * k / PARTS
            at_high = inward_on_meridian(frame, quadrant, 0.0, 0.0, high)
            if at_low * at_high < 0.0:
                place = sign_change(inward_on_meridian, frame, quadrant, 0.0, 0.0, low, high, at_low, at_high)
                j = count
                while panels[j - 1] > place:  # sort it in
                    panels[j] = panels[j - 1]
                    j -= 1
                panels[j] = place
                count += 1
            low, at_low = high, at_high
    panels[count] = end
    return count


@kernel()
def gap(mean, reach, sigma):
    """Return the squared distance, in sigmas, from the mean to the nearest point within `reach` of 0."""
    away = max(0.0, abs(mean) - reach) / sigma
    return away * away


@kernel()
def node_count(fineness, base, deviations, most):
    """Return the number of quadrature nodes for an interval of a width in standard deviations."""
    return min(most, int(fineness * (base + 0.6 * deviations)) + 1)


@kernel()
def side(mean, reach, sigma, width):
    """Return the part of [0, width] within `reach` deviations of the mean, as fractions of it."""
    low = (mean - reach * sigma) / width
    high = (mean + reach * sigma) / width
    return min(1.0, max(0.0, low)), max(0.0, min(1.0, high))


@kernel()
def arc_rate(frame, tilt, weight, e, f, begin, end, rules, fineness, nodes, count):
    """Return the rate along an arc of a quadrant at one tilt, and the new count of nodes."""
    rate = 0.0
    height, width = cos(tilt), sin(tilt)
    b1, s1, b2, s2 = frame[MEAN, 1], frame[SIGMA, 1], frame[MEAN, 2], frame[SIGMA, 2]
    along = (cos(begin) - cos(end)) / s1 + (sin(end) - sin(begin)) / s2
    size = node_count(fineness, 2.5, width * along, len(rules) - 1)
    for k in range(size):
        angle = 0.5 * (begin + end) + 0.5 * (end - begin) * rules[size, k, 0]
        x, y = e * width * cos(angle), f * width * sin(angle)
        d1, d2 = (x - b1) / s1, (y - b2) / s2
        share = 0.5 * (end - begin) * rules[size, k, 1] * weight * exp(-0.5 * (d1 * d1 + d2 * d2))
        mu = inward(frame, height, x, y)
        part = share * inflow(mu, deviation(frame, height, x, y))
        rate += part
        if count < len(nodes) and part > 0.0:
            nodes[count, 0], nodes[count, 1], nodes[count, 2], nodes[count, 3] = height, x, y, part
            count += 1
    return rate, count


@kernel()
def circle_rate(frame, tilt, weight, left, sharp, rules, fineness, nodes, count):
    """Return the rate around the circle at one tilt, and the new count of nodes.

    It consists of arcs of each quadrant, where both coordinates are monotonic, on which the squared distance
    across the minor axis is at most `left`; they are cut at edges of the inflow.
    """
    rate = 0.0
    width = sin(tilt)
    b1, s1, b2, s2 = frame[MEAN, 1], frame[SIGMA, 1], frame[MEAN, 2], frame[SIGMA, 2]
    reach1, reach2 = left - gap(b2, width, s2), left - gap(b1, width, s1)
    if not (reach1 > 0.0 and reach2 > 0.0):
        return rate, count
    reach1, reach2 = sqrt(reach1), sqrt(reach2)
    for quadrant in range(4):
        e = 1.0 if quadrant % 2 == 0 else -1.0
        f = 1.0 if quadrant < 2 else -1.0
        x_low, x_high = side(e * b1, reach1, s1, width)
        y_low, y_high = side(f * b2, reach2, s2, width)
        begin, end = max(acos(x_high), asin(y_low)), min(acos(x_low), asin(y_high))
        if not begin < end:
            continue
        first = begin
        before = inward_on_arc(frame, tilt, e, f, begin) if sharp else 0.0
        for k in range(1, PARTS + 1 if sharp else 2):
            last = end
            if sharp:
                here = begin + (end - begin) * k / PARTS
                after = inward_on_arc(frame, tilt, e, f, here)
                if before * after < 0.0:
                    step = (end - begin) / PARTS
                    last = sign_change(inward_on_arc, frame, tilt, e, f, here - step, here, before, after)
                elif k < PARTS:
                    last = first
                before = after
            if first < last:
                more, count = arc_rate(frame, tilt, weight, e, f, first, last, rules, fineness, nodes, count)
                rate += more
                first = last
        if first < end:
            more, count = arc_rate(frame, tilt, weight, e, f, first, end, rules, fineness, nodes, count)
            rate += more
    return rate, count


@kernel()
def band(frame, left):
    """Return the tilts from the minor axis between which the squared distance is at most `left`."""
    b0, b1, b2 = frame[MEAN, 0], frame[MEAN, 1], frame[MEAN, 2]
    across = gap(b1, 1.0, frame[SIGMA, 1]) + gap(b2, 1.0, frame[SIGMA, 2])
    reach = sqrt(left - across)
    bottom = max(-1.0, b0 - reach * frame[SIGMA, 0])
    top = min(1.0, b0 + reach * frame[SIGMA, 0])
    begin, end = acos(top), acos(bottom)
    centre, side_reach = sqrt(b1 * b1 + b2 * b2), sqrt(left) * frame[SIGMA, 2]
    narrow, wide = asin(min(1.0, max(0.0, centre - side_reach))), asin(min(1.0, centre + side_reach))
    if bottom > 0.0:  # all on one side of the equator
        begin, end = max(begin, narrow), min(end, wide)
    elif top < 0.0:
        begin, end = max(begin, pi - wide), min(end, pi - narrow)
    return begin, end


@kernel()
def ball_rate(frame, rules, fineness, nodes):
    """Return the rate of entries, and the number of nodes stored in `nodes`.

    `rules` (K, K, 2) are Gauss's nodes in (-1, 1) and weights by their number; nodes are stored while there
    is room.
    """
    rate, count = 0.0, 0
    least = nearest_square(frame)
    if least > UNDERFLOW:
        return rate, count
    b0, s0, s1 = frame[MEAN, 0], frame[SIGMA, 0], frame[SIGMA, 1]
    left = least + TAIL
    begin, end = band(frame, left)
    sharp = is_sharp(frame)
    panels = stack_vector(18)  # the ends, and at most one sign change in each part of a meridian
    count_of_panels = fill_panels(frame, begin, end, sharp, panels)
    scale = 1.0 / ((2.0 * pi) ** 1.5 * s0 * s1 * frame[SIGMA, 2])
    most = 2.0 * sqrt(left)
    for panel in range(count_of_panels):
        low, high = panels[panel], panels[panel + 1]
        if not high - low > 1e-6 * (end - begin):
            continue
        along = min(most, (cos(low) - cos(high)) / s0)
        along += min(most, abs(sin(high) - sin(low)) / s1)
        size = node_count(fineness, 1.0 + 3.0 * min(1.0, high - low), along, len(rules) - 1)
        for a in range(size):
            tilt = 0.5 * (low + high) + 0.5 * (high - low) * rules[size, a, 0]
            d0 = (cos(tilt) - b0) / s0
            weight = 0.5 * (high - low) * rules[size, a, 1] * sin(tilt) * scale * exp(-0.5 * d0 * d0)
            more, count = circle_rate(
                frame, tilt, weight, left - d0 * d0, sharp, rules, fineness, nodes, count
            )
            rate += more
    return rate, count


@kernel(void(ROWS, BLOCKS, ROWS, BLOCKS, float64, float64, ROWS))
def surface_integrals(means, factors, matrix, rules, fineness, farthest, out):
    """Write the rate of entries into the unit ball, and the mean's distance, for each time (T, 2).

    From states (T, 6) and factors (T, 6, M) of their covariance, in zone coordinates. The distance to the
    ball is in standard deviations, 0 from inside; with a fineness of 0 only it is computed. The rate is 0
    beyond `farthest`.
    """
    means, factors, matrix, out = borrowed(means), borrowed(factors), borrowed(matrix), borrowed(out)
    rules = borrowed(rules)
    frame = stack_matrix(13, 3)
    rows = np.empty((6, factors.shape[2]))
    nodes = np.empty((0, NODE))
    for k in range(len(out)):
        principal(means[k], factors[k], matrix, frame, rows)
        b0, b1, b2 = frame[MEAN, 0], frame[MEAN, 1], frame[MEAN, 2]
        out[k, 0], out[k, 1] = 0.0, 0.0
        if b0 * b0 + b1 * b1 + b2 * b2 > 1.0:
            out[k, 1] = sqrt(nearest_square(frame))
        if fineness > 0.0 and out[k, 1] <= farthest:
            out[k, 0], _ = ball_rate(frame, rules, fineness, nodes)


@kernel()
def speed_of_entry(mu, sigma, share):
    """Return the inward speed that a fraction of entries exceeds: density ~ w N(w; mu, sigma), w > 0."""
    if sigma <= 1e-12 * abs(mu):
        return abs(mu)
    u = mu / sigma
    total = exp(-0.5 * u * u) / sqrt(2.0 * pi) + 0.5 * u * erfc(-u / sqrt(2.0))
    low, high = 0.0, max(u, 0.0) + 40.0
    w = 0.5 * (u + sqrt(u * u + 4.0))  # the mode
    for _ in range(60):
        y = w - u
        density = exp(-0.5 * y * y) / sqrt(2.0 * pi)
        excess = (density + 0.5 * u * erfc(y / sqrt(2.0))) / total - share
        if excess > 0.0:
            low = w
        else:
            high = w
        slope = w * density / total
        step = excess / slope if slope > 0.0 else inf
        if abs(step) <= 1e-12 * w:
            break
        w = w + step if low < w + step < high else 0.5 * (low + high)
    return sigma * w


@kernel(void(ROWS, BLOCKS, ROWS, BLOCKS, float64, int64[::1], ROWS, ROWS))
def fill_entry_errors(means, factors, matrix, rules, fineness, first, shares, errors):
    """Turn standard normals (N, M) in `errors` into the errors of trajectories that enter at given times.

    Those of time k are `first[k]` to `first[k + 1]`. `shares` (N, 2) give the place on the surface, rising
    from 0 to 1 for each time, and the speed. Given position and inward speed, the rest keeps its
    distribution: errors are moved only along the directions that determine these.  # theory (63)
    """
    means, factors, matrix, errors = borrowed(means), borrowed(factors), borrowed(matrix), borrowed(errors)
    rules = borrowed(rules)
    frame = stack_matrix(13, 3)
    size = factors.shape[2]
    rows = np.empty((6, size))
    along = np.empty(size)
    nodes = np.empty((24 * len(rules) ** 2, NODE))
    for k in range(len(means)):
        if first[k] == first[k + 1]:
            continue
        principal(means[k], factors[k], matrix, frame, rows)
        rate, count = ball_rate(frame, rules, fineness, nodes)
        node, reached = 0, nodes[0, 3]
        for p in range(first[k], first[k + 1]):
            while reached < shares[p, 0] * rate and node + 1 < count:
                node += 1
                reached += nodes[node, 3]
            x, y, z = nodes[node, 0], nodes[node, 1], nodes[node, 2]
            place_errors(frame, rows, errors[p], along, x, y, z, shares[p, 1])


@kernel()
def place_errors(frame, rows, xi, along, x, y, z, share):
    """Change errors to those of a trajectory that enters at q = (x, y, z)."""
    size = len(xi)
    for i in range(3):
        q = x if i == 0 else (y if i == 1 else z)
        move = (q - frame[MEAN, i]) / frame[SIGMA, i]
        for j in range(size):
            move -= rows[i, j] * xi[j]
        for j in range(size):
            xi[j] += move * rows[i, j]
    mu = inward(frame, x, y, z)
    here, square = mu, 0.0
    for j in range(size):
        along[j] = -(x * rows[3, j] + y * rows[4, j] + z * rows[5, j])
        here += along[j] * xi[j]
        square += along[j] * along[j]
    if square > 0.0:
        lift = (speed_of_entry(mu, sqrt(square), share) - here) / square
        for j in range(size):
            xi[j] += lift * along[j]
