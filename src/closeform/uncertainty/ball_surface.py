"""Mean rate of entries through the surface of a ball.

In zone coordinates along the principal axes of the position's covariance, least first, a position is q = b +
s d, with d three independent standard normals. Given q, the velocity is normal, with mean v + G d and a
covariance C that does not depend on q. So is the inward speed, -n . velocity, with mean mu(q) and deviation
sigma(n). The mean rate of entries is

    nu = integral over the surface of (density at q) E[(-n . velocity)+ | q]                     # theory (60)

over the part within `TAIL` of the largest density: a band of tilts from the minor axis, and arcs of each
quadrant in it. Gauss's rule is used for both, so that a thin covariance takes as many nodes as a round one.
Both are divided where mu changes sign, because the integrand has an edge there if sigma is small.
"""

from math import acos, asin, cos, erfc, exp, inf, pi, sin, sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_vector
from closeform.uncertainty.whitened import GAIN, MEAN, NEAREST, SIGMA, SPREAD, VELOCITY

TAIL = 40.0  # squared distance in deviations: densities down to 2e-9 of the largest
SHARP = 4.0  # inward speed over its deviation, above which a sign change is an edge
UNDERFLOW = 1400.0  # squared distance in deviations above which densities are below 1e-300
PARTS = 4  # parts of an arc at whose ends signs are compared
NODE = 4  # columns of a node: q in principal axes, and its part of the rate


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
def sign_change(frame, tilt, e, f, low, high, at_low, at_high):
    """Return the angle between two at which the mean inward speed changes sign (Illinois method)."""
    for _ in range(14):
        angle = low + (high - low) * at_low / (at_low - at_high)
        mu = inward_on_arc(frame, tilt, e, f, angle)
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
def inward_on_meridian(frame, quadrant, tilt):
    """Return the mean inward speed at a tilt, in the middle of a quadrant."""
    e = 1.0 if quadrant % 2 == 0 else -1.0
    f = 1.0 if quadrant < 2 else -1.0
    return inward_on_arc(frame, tilt, e, f, 0.25 * pi)


@kernel()
def fill_panels(frame, begin, end, sharp, panels):
    """Fill `panels` with tilts between which the rate is smooth, and return their number.

    Sign changes are located on four meridians.
    """
    panels[0] = begin
    count = 1
    for quadrant in range(4 if sharp else 0):
        low, at_low = begin, inward_on_meridian(frame, quadrant, begin)
        for k in range(1, PARTS + 1):
            high = begin + (end - begin) * k / PARTS
            at_high = inward_on_meridian(frame, quadrant, high)
            if at_low * at_high < 0.0:
                u, w, at_u, at_w = low, high, at_low, at_high
                for _ in range(10):
                    middle = u + (w - u) * at_u / (at_u - at_w)
                    mu = inward_on_meridian(frame, quadrant, middle)
                    if mu * at_u > 0.0:
                        u, at_u, at_w = middle, mu, 0.5 * at_w
                    else:
                        w, at_w, at_u = middle, mu, 0.5 * at_u
                place = 0.5 * (u + w)
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
                    last = sign_change(frame, tilt, e, f, here - step, here, before, after)
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
