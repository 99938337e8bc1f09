"""Inexpensive bounds that exclude pairs, so that the certified march need not search them.

**Chords.**  The spacecraft of a batch are sampled on one grid of times.  In an interval of length
h a spacecraft deviates from the chord between its two positions by

    e(t) = -integral of G(t, s) r''(s) ds,   G(t, s) = (min(t, s) - t_k) (t_k+1 - max(t, s)) / h

which is at most h^2/8 times its largest acceleration, plus |w| (s - t_k) (t_k+1 - s) / h for each
velocity jump w at time s.  The relative position of two spacecraft deviates from its chord by at most the
sum of their two deviations.  It therefore stays outside a ball if the chord stays outside the ball enlarged
by that sum.                                                                  # theory (23)
Positions and deviations belong to spacecraft, not to pairs; a pair takes some forty
operations for an interval, without a branch, whatever the paths.

**Ellipses.**  Natural motion is a drifting ellipse, which is bounded at once over any duration.
"""

from math import sqrt

from numba import float64, int64, void

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, stack_matrix
from closeform.motion.arc import END, MEAN_MOTION, START, derivatives_at, is_cubic, state_at, thrusts
from closeform.motion.certified_march import bounds, locate, store, window
from closeform.zones.shapes import BALL, CUBE, FACES, support

# Bounds on rounding, relative to the size of coordinates and to the ball.
ROUNDING, CLEAR = 1e-13, 1.0 + 1e-9
OFF_CHORD = 3  # row of a track after x, y and z: the largest deviation from the chord
FEW = 100  # intervals of a pair: more cost more than the bound of an ellipse


@kernel()
def see(arc, t, matrix, q):
    """Fill `q` with the derivatives of one arc at time t; return their order, and the scale of rounding."""
    order = 8 if thrusts(arc) and not is_cubic(arc) else 4
    q[:order] = 0.0
    derivatives_at(arc, t, order, q, 1.0)
    size = 0.0
    for axis in range(3):
        size += abs(q[0, axis]) + abs(q[1, axis] * (t - arc[START]))
    for k in range(order):
        store(q, k, matrix, q[k, 0], q[k, 1], q[k, 2])
    return order, size


@kernel()
def length(matrix, x, y, z):
    """Return the Euclidean length of the matrix times a vector."""
    square = 0.0
    for axis in range(3):
        part = matrix[axis, 0] * x + matrix[axis, 1] * y + matrix[axis, 2] * z
        square += part * part
    return sqrt(square)


@kernel()
def joint(arc, after, t, h, s, matrix):
    """Bound the deviation from the chord that a joint at time t causes, s into an interval of length h."""
    x, y, z, vx, vy, vz = state_at(arc, t)
    ax, ay, az, avx, avy, avz = state_at(after, t)
    place = length(matrix, ax - x, ay - y, az - z)  # rounding, or a jump that `join` accepts
    return place + length(matrix, avx - vx, avy - vy, avz - vz) * s * (h - s) / h


@kernel()
def fill_track(arcs, first, last, matrix, scale, times, q, track):
    """Fill one spacecraft's track; its first and last arcs are extended to the nearest times."""
    i = max(first, locate(arcs, first, last, times[0]) - 1)  # which may begin slightly too early
    for k in range(len(times)):
        begin = times[k]
        end = times[min(k + 1, len(times) - 1)]
        if end < arcs[first, START] or times[max(k - 1, 0)] > arcs[last - 1, END]:
            continue
        while i + 1 < last and arcs[i, END] <= begin:
            i += 1
        order, size = see(arcs[i], begin, matrix, q)
        for axis in range(3):
            track[axis, k] = q[0, axis]
        t = begin
        bend, joints = 0.0, 0.0
        while i + 1 < last and arcs[i, END] <= end:
            after = arcs[i, END]
            bend = max(bend, bounds(q, order, arcs[i, MEAN_MOTION], after - t)[3])
            joints += joint(arcs[i], arcs[i + 1], after, end - begin, after - begin, matrix)
            t = after
            i += 1
            order, _ = see(arcs[i], t, matrix, q)
        bend = max(bend, bounds(q, order, arcs[i, MEAN_MOTION], end - t)[3])
        track[OFF_CHORD, k] = 0.125 * bend * (end - begin) ** 2 + joints + ROUNDING * scale * size


@kernel(void(float64[:, ::1], int64[::1], float64[:, ::1], float64[::1], float64[:, :, ::1]))
def fill_tracks(arcs, offsets, matrix, times, tracks):
    """Fill the tracks (N, 4, K + 1) of all spacecraft; entries outside of a path stay unchanged."""
    arcs, matrix, times, tracks = borrowed(arcs), borrowed(matrix), borrowed(times), borrowed(tracks)
    q = stack_matrix(8, 3)
    scale = 0.0
    for axis in range(3):
        for other in range(3):
            scale += abs(matrix[axis, other])
    for craft in range(len(offsets) - 1):
        fill_track(arcs, offsets[craft], offsets[craft + 1], matrix, scale, times, q, tracks[craft])


@kernel()
def interval(times, t):
    """Return the interval that contains time t, the later one of two."""
    last = len(times) - 2
    step = (times[last + 1] - times[0]) / (last + 1)
    k = min(max(int((t - times[0]) / step), 0), last) if step > 0.0 else 0
    while k > 0 and times[k] > t:
        k -= 1
    while k < last and times[k + 1] <= t:
        k += 1
    return k


@kernel()
def count_near(tracks, i, others, j, first, last):
    """Count the intervals of [first, last) in which i and j may be in the unit ball around each other.

    The loop has no branch and no store, so that eight intervals are processed together.
    """
    count = 0
    first = max(first, 0)  # no change; but an index that might be negative would be a branch
    for m in range(last - first):
        k = max(first + m, 0)
        x = tracks[i, 0, k] - others[j, 0, k]
        y = tracks[i, 1, k] - others[j, 1, k]
        z = tracks[i, 2, k] - others[j, 2, k]
        ex = tracks[i, 0, k + 1] - others[j, 0, k + 1]
        ey = tracks[i, 1, k + 1] - others[j, 1, k + 1]
        ez = tracks[i, 2, k + 1] - others[j, 2, k + 1]
        reach = CLEAR + tracks[i, OFF_CHORD, k] + others[j, OFF_CHORD, k]
        ball = reach * reach
        dx, dy, dz = ex - x, ey - y, ez - z
        along = x * dx + y * dy + z * dz
        square = dx * dx + dy * dy + dz * dz
        begin = x * x + y * y + z * z
        # the line, if its nearest point is on the chord; and the chord's ends
        line = (begin * (1.0 - 1e-14) - ball) * square > along * along
        line = line | (along >= 0.0) | (along + square <= 0.0)
        clear = line & (begin > ball) & (ex * ex + ey * ey + ez * ez > ball)
        count += 0 if clear else 1
    return count


@kernel()
def mark_near(tracks, i, others, j, first, last, near):
    """Mark the intervals of [first, last) in which spacecraft i and j may be in the ball."""
    for k in range(first, last):
        near[k] = count_near(tracks, i, others, j, k, k + 1) > 0


@kernel()
def is_clear(times, near, k, stop):
    """Return True if no interval from k on that begins before `stop` may bring the spacecraft together."""
    while True:
        if near[k]:
            return False
        k += 1
        if k == len(near) or times[k] >= stop:
            return True


@kernel()
def apart_along(q, n, h, wx, wy, wz, reach, either):
    """Return True if natural motion stays beyond `reach` along the direction w all over [0, h].

    With `either`, separation along -w counts as well. Along any direction the motion is centre + drift t + an
    oscillation.
    """
    square = 1.0 / (n * n)
    place = wx * q[0, 0] + wy * q[0, 1] + wz * q[0, 2]
    speed = wx * q[1, 0] + wy * q[1, 1] + wz * q[1, 2]
    cosine = (wx * q[2, 0] + wy * q[2, 1] + wz * q[2, 2]) * square
    sine = (wx * q[3, 0] + wy * q[3, 1] + wz * q[3, 2]) * square
    first = place + cosine
    last = first + (speed + sine) * h
    least = -max(first, last) if either and first < 0.0 else min(first, last)
    clear = least - reach * (1.0 + 1e-9)
    return clear > 0.0 and clear * clear > (cosine * cosine + sine * sine * square) * (1.0 + 1e-9)


@kernel()
def ring_clearance(q, n, h):
    """Return a lower bound on the distance from the origin over [0, h] of natural motion.

    The motion is a drifting ellipse c + a cos nt + b sin nt. Its squared distance is a trigonometric
    polynomial, at least the mean less the amplitudes of its two harmonics; the drift relative to mid-time
    reduces it by at most half of the drift over h.
    """
    square = 1.0 / (n * n)
    cc, ca, cb, aa, bb, ab, dd = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for axis in range(3):
        a = -q[2, axis] * square
        b = -q[3, axis] * square / n
        d = 0.5 * (q[1, axis] + q[3, axis] * square) * h
        c = q[0, axis] - a + d
        cc, dd, ca, cb = cc + c * c, dd + d * d, ca + c * a, cb + c * b
        aa, bb, ab = aa + a * a, bb + b * b, ab + a * b
    mean = cc + 0.5 * (aa + bb)
    first = 2.0 * sqrt(ca * ca + cb * cb)
    second = sqrt(0.25 * (aa - bb) * (aa - bb) + ab * ab)
    least = mean * (1.0 - 1e-13) - first - second  # less rounding
    return sqrt(least) - sqrt(dd) if least > 0.0 else -1.0


@kernel()
def stays_apart(shape, faces, q, n, h):
    """Return True if natural motion keeps two spacecraft apart all over [0, h], by closed-form bounds.

    The bounds are the drifting ellipse; each of the zone's axes (SP11's radial test and last time of contact,
    SP11 eq. 15, theory 6, for any zone); and the normal of the ellipse's plane. Half-spaces use each normal.
    """
    if n * h < 1e-3:  # centre and oscillation cancel, the bounds are useless
        return False
    if shape == FACES:
        for k in range(len(faces)):
            if apart_along(q, n, h, faces[k, 0], faces[k, 1], faces[k, 2], 1.0, False):
                return True
        return False
    farthest = 1.0 if shape == BALL else (1.7320509 if shape == CUBE else 1.4142136)
    if ring_clearance(q, n, h) > farthest * (1.0 + 1e-9):
        return True
    wx = q[2, 1] * q[3, 2] - q[2, 2] * q[3, 1]
    wy = q[2, 2] * q[3, 0] - q[2, 0] * q[3, 2]
    wz = q[2, 0] * q[3, 1] - q[2, 1] * q[3, 0]
    return (
        apart_along(q, n, h, wx, wy, wz, support(shape, wx, wy, wz), True)
        or apart_along(q, n, h, 1.0, 0.0, 0.0, 1.0, True)
        or apart_along(q, n, h, 0.0, 1.0, 0.0, 1.0, True)
        or apart_along(q, n, h, 0.0, 0.0, 1.0, 1.0, True)
    )


@kernel()
def coasts_apart(a, b, start, end, form, q):
    """Return True if arcs a and b are natural motion over [start, end] and stay apart by `stays_apart`."""
    n = a[MEAN_MOTION]
    if n == 0.0 or n != b[MEAN_MOTION] or thrusts(a) or thrusts(b) or min(a[END], b[END]) < end:
        return False
    shape, matrix, faces = form
    window(a, b, start, matrix, q)
    return stays_apart(shape, faces, q, n, end - start)
