"""Certified minimum of a norm along one window of an arc (see `certified_march`)."""

from math import sqrt

from closeform._jit import kernel
from closeform.motion.certified_march import (
    LESS_PATIENCE,
    bounds,
    relative_state,
    taylor_step,
)
from closeform.motion.hill import oscillation
from closeform.zones.shapes import BALL, FACES, norm, outside_step, part, rank, rate

# Minima are certified to this relative error; one below NIL counts as 0.
PRECISION = 1e-11
NIL = 1e-13
SMALLEST = 32  # fraction of a window below which it is no longer divided but marched
TURN_ANGLE = 0.3  # in n t: the longest step of the search for a local minimum


@kernel()
def slope(shape, faces, q, order, n, t):
    x, y, z, vx, vy, vz = relative_state(q, order, n, t)
    return rate(shape, faces, x, y, z, vx, vy, vz)


@kernel()
def next_minimum(shape, faces, q, order, n, t, stop):
    """Return the next time at which the rate turns from negative to positive: a local minimum."""
    high = -slope(shape, faces, q, order, n, t)
    longest = (stop - t) / 16.0 if n == 0.0 else min((stop - t) / 16.0, TURN_ANGLE / n)
    longest = max(longest, 1e-15 * stop)  # a step that time can resolve
    x, y, z, _, _, _ = relative_state(q, order, n, t)
    step = min(longest, 0.25 * abs(norm(shape, faces, x, y, z)) / abs(high))  # the time scale of a fly-by
    before = t
    after = t
    step = max(step, 1e-15 * stop)
    while after < stop:
        after = min(after + step, stop)
        low = -slope(shape, faces, q, order, n, after)
        if low <= 0.0:
            break
        before = after
        high = low
        step = min(1.5 * step, longest)
    else:
        return stop
    fine = 1e-12 if shape == BALL else 4e-16  # a smooth minimum is flat
    for k in range(200):
        width = after - before
        if width <= fine * (abs(after) + width):
            break
        # regula falsi (Illinois), with bisections: rates jump at kinks
        middle = before + 0.5 * width
        if k % 4 != 3 and high - low > 0.0:
            guess = before + width * high / (high - low)
            if before < guess < after:
                middle = guess
        here = -slope(shape, faces, q, order, n, middle)
        if here > 0.0:
            before, high = middle, here
            low *= 0.5
        else:
            after, low = middle, here
            high *= 0.5
            if here == 0.0:
                break
    return after


@kernel()
def local_minimum(shape, faces, q, order, n, t, stop, s):
    """Return time and norm of a local minimum that follows norm s at t.

    A minimum further away may lie above s, behind another one; the search then shortens.
    """
    for _ in range(60):
        there = next_minimum(shape, faces, q, order, n, t, stop)
        x, y, z, _, _, _ = relative_state(q, order, n, there)
        found = norm(shape, faces, x, y, z)
        if found < s:
            return there, found
        stop = t + 0.25 * (there - t)
        if stop <= t * (1.0 + 1e-15):
            break
    return t, s


@kernel()
def jerk_bound(q, n, h):
    """Return an upper bound on the length of the third derivative of an arc of order 4 over [0, h]."""
    square = 0.0
    for axis in range(3):
        b, c = n * q[2, axis], abs(q[3, axis])
        square += min(b * b + c * c, (c + n * h * abs(b)) ** 2)
    return sqrt(square)


@kernel()
def nearest_and_bend(q, order, n, t, h, a, jerk):
    """Return lower bounds within h of time t: of |q|, and of half the second derivative of |q|^2.

    The latter is v.v + r.r''; `a` and `jerk` bound |r''| and |r'''|, `jerk` for order 4 only.
    """
    x, y, z, vx, vy, vz = relative_state(q, order, n, t)
    distance = sqrt(x * x + y * y + z * z)
    speed = sqrt(vx * vx + vy * vy + vz * vz)
    fastest = speed + a * h
    farthest = distance + fastest * h
    if order == 4:
        p0, p1, _ = oscillation(n, t)
        c = 1.0 - n * n * p1
        along = x * (q[2, 0] * c + q[3, 0] * p0) + y * (q[2, 1] * c + q[3, 1] * p0)
        along += z * (q[2, 2] * c + q[3, 2] * p0)
        return distance - fastest * h, speed * speed + along - (3.0 * fastest * a + farthest * jerk) * h
    slowest = max(speed - a * h, 0.0)
    return distance - fastest * h, slowest * slowest - a * farthest


@kernel()
def half_slope(q, order, n, t):
    """Return half the rate of |q|^2."""
    x, y, z, vx, vy, vz = relative_state(q, order, n, t)
    return x * vx + y * vy + z * vz


@kernel()
def bottom(q, order, n, low, high):
    """Return the time of the minimum of |q|^2 in [low, high], where it is convex, by secants of its slope."""
    u, slope_u = low, half_slope(q, order, n, low)
    if slope_u >= 0.0:
        return low
    w, slope_w = high, half_slope(q, order, n, high)
    if slope_w <= 0.0:
        return high
    fine = 1e-9 * (high - low)  # a secant from this close is exact
    for k in range(100):
        t = w - slope_w * (w - u) / (slope_w - slope_u) if slope_w != slope_u else w
        if abs(t - w) <= fine:
            return min(max(t, low), high)
        if not low < t < high or k % 8 == 7:
            t = 0.5 * (low + high)
        u, slope_u = w, slope_w
        w, slope_w = t, half_slope(q, order, n, t)
        if slope_w == 0.0:
            break
        if slope_w > 0.0:
            high = t
        else:
            low = t
    return w


@kernel()
def least_length(q, order, n, stop, a, best, best_time):
    """Return the minimum of |q| over [0, stop], by pieces where |q|^2 is convex or large.

    Stops at a piece of 1/SMALLEST of the window that is neither.
    """
    jerk = jerk_bound(q, n, stop) if order == 4 else 0.0
    t = 0.0
    piece = stop
    while True:
        end = min(t + piece, stop)
        nearest, bend = nearest_and_bend(q, order, n, 0.5 * (t + end), 0.5 * (end - t), a, jerk)
        if nearest < best and not bend > 0.0:
            piece *= 0.5
            if piece * SMALLEST < stop:
                return best, best_time, t
            continue
        if nearest < best:
            when = bottom(q, order, n, t, end)
            x, y, z, _, _, _ = relative_state(q, order, n, when)
            s = sqrt(x * x + y * y + z * z)
            if s < best * (1.0 - PRECISION):  # of equal minima keep the first, as in periodic motion
                best, best_time = s, when
            if best <= NIL:
                return 0.0, best_time, stop
        if end == stop:
            return best, best_time, stop
        t = end
        piece *= 2.0


@kernel()
def minimum_norm(shape, faces, q, order, n, t, stop, patience, best, best_time):
    """Return the minimum norm over [t, stop] of the window's own time, if below `best`.

    Returns the norm, its time, and the time reached: before `stop` where the march stalls.
    """
    ax, ay, az, a, _ = bounds(q, order, n, stop)
    if shape == BALL and t == 0.0 < stop:
        best, best_time, t = least_length(q, order, n, stop, a, best, best_time)
        if t == stop:
            return best, best_time, stop
    axes = rank(shape, 0)
    if axes > 1 and patience == LESS_PATIENCE:
        aim = best * (1.0 - PRECISION)
        if t == 0.0 and part(shape, faces, 0, q[0, 0], q[0, 1], q[0, 2])[0] > aim > 0.0:
            t = taylor_step(axes, q, order, n, stop, aim, False)
    for _ in range(patience):
        x, y, z, vx, vy, vz = relative_state(q, order, n, t)
        s = norm(shape, faces, x, y, z)
        if s < best:
            best = s
            best_time = t
            if (s > NIL or shape == FACES) and rate(shape, faces, x, y, z, vx, vy, vz) < 0.0:
                best_time, best = local_minimum(shape, faces, q, order, n, t, stop, s)
        aim = best * (1.0 - PRECISION)
        if best <= NIL:
            if shape != FACES:
                return 0.0, best_time, stop
            aim = best * (1.0 + PRECISION) - NIL  # outside half-spaces norms fall below zero
        if t >= stop:
            return best, best_time, stop
        h = outside_step(shape, faces, x, y, z, vx, vy, vz, ax, ay, az, a, aim)
        t = min(stop, max(t + h, t * (1.0 + 2.3e-16)))
    return best, best_time, t


@kernel()
def advance(q, n, t):
    """Move the expansion point of the derivatives (order 4) to time t."""
    step_on(q, n, t, oscillation(n, t))


@kernel()
def step_on(q, n, t, transforms):
    """Move the expansion point to time t, as `advance` does, given the `oscillation` of t."""
    p0, p1, p2 = transforms
    c = 1.0 - n * n * p1
    for i in range(3):
        v, a, b = q[1, i], q[2, i], q[3, i]
        q[0, i] += v * t + a * p1 + b * p2
        q[1, i] += a * p0 + b * p1
        q[2, i] = a * c + b * p0
        q[3, i] = b * c - n * n * a * p0
