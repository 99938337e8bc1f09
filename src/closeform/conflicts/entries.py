"""The march over pairs of paths: their conflicts and closest approaches, as rows of floats."""

from math import inf, nan, sqrt

import numpy as np
from numba import float64, int64, void

from closeform.compiled import borrowed, kernel
from closeform.motion.arc import END, START
from closeform.motion.extrema import minimum_norm
from closeform.motion.march import (
    LESS_PATIENCE,
    PATIENCE,
    bounds,
    locate,
    relative_state,
    taylor_step,
    window,
)
from closeform.zones.shapes import (
    BALL,
    CUBE,
    CYLINDER,
    FACES,
    FORM,
    inside_flat,
    inside_step,
    norm,
    outside_step,
    rank,
    support,
)

# A norm within 1e-12 of 1 is on the surface.  Outside ends at ENTERED, inside only at LEFT, so
# that rounding cannot make the two searches chase each other; each aims a little further.
TOUCH = 1e-12
ENTRY_AIM, ENTERED, LEFT, EXIT_AIM = 1 + 0.08 * TOUCH, 1 + 0.16 * TOUCH, 1 + 0.4 * TOUCH, 1 + 0.5 * TOUCH
COLUMNS = 5  # of a row of conflicts: pair, start, end, time, ratio


@kernel()
def cross(shape, faces, q, order, n, t, stop, inside, patience):
    """March through a window until the norm changes sides: (time reached, whether it did)."""
    ax, ay, az, a, speed = bounds(q, order, n, stop)
    axes = rank(shape, 0)
    if axes > 1 and patience == LESS_PATIENCE and t == 0.0:
        t = taylor_step(axes, q, order, n, stop, EXIT_AIM if inside else ENTRY_AIM, inside)
        if inside and shape == CYLINDER:  # nor does it leave by an end
            t = min(t, inside_flat(q[0, 2], q[1, 2], az, EXIT_AIM))
    for _ in range(patience):
        x, y, z, vx, vy, vz = relative_state(q, order, n, t)
        s = norm(shape, faces, x, y, z)
        if (inside and s > LEFT) or (not inside and s <= ENTERED):
            return t, True
        if t >= stop:
            return stop, False
        if inside:
            h = inside_step(shape, faces, x, y, z, vx, vy, vz, ax, ay, az, a, speed, EXIT_AIM)
        else:
            h = outside_step(shape, faces, x, y, z, vx, vy, vz, ax, ay, az, a, ENTRY_AIM)
        t = min(stop, max(t + h, t * (1.0 + 2.3e-16)))
    return t, False


@kernel()
def closest(arcs, i, i_end, others, j, j_end, start, end, form, q):
    """Least norm over [start, end] and its time, between one path's arcs and another's."""
    shape, matrix, faces = form
    best, best_time = inf, nan
    i = locate(arcs, i, i_end, start)
    j = locate(others, j, j_end, start)
    t = start
    patience = PATIENCE
    while True:
        while i + 1 < i_end and arcs[i, END] <= t:
            i += 1
        while j + 1 < j_end and others[j, END] <= t:
            j += 1
        order, n, stop = window(arcs, i, others, j, t, end, matrix, q)
        least, when, reached = minimum_norm(shape, faces, q, order, n, 0.0, stop - t, patience, best, nan)
        if least < best:
            best, best_time = least, t + when
        if reached < stop - t:
            patience = LESS_PATIENCE
            t += reached
        else:
            t = stop
        if t >= end or (best == 0.0 and shape != FACES):
            return best, best_time


@kernel()
def apart_along(q, n, h, wx, wy, wz, reach, either):
    """Whether natural motion stays beyond reach along the direction w, or `either` way, all over [0, h].

    Along any direction it is centre + drift t + an oscillation.
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
    """A lower bound of the distance from the origin over [0, h] of natural motion.

    The motion is a drifting ellipse c + a cos nt + b sin nt.  Its squared distance is a
    trigonometric polynomial: the mean less the amplitudes of its two harmonics; the drift
    from mid-time on takes at most half of what it covers.
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
    least = mean * (1.0 - 1e-13) - first - second  # less what rounding can have taken
    return sqrt(least) - sqrt(dd) if least > 0.0 else -1.0


@kernel()
def stays_apart(shape, faces, q, n, h):
    """Whether natural motion keeps two craft apart all over [0, h], by bounds in closed form.

    As a drifting ellipse; along each of the zone's axes (SP11's radial test and last time of
    contact, SP11 eq. 15, theory 6, for any zone); and across the plane of the ellipse.  Of
    half-spaces along each normal.
    """
    if n * h < 1e-3:  # centre and oscillation cancel, and nothing is gained
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
def pair_conflicts(arcs, i, i_end, others, j, j_end, form, q, pair, rows, count):
    """Append the conflicts of one pair to `rows`; the new count, beyond len(rows) if they do not fit."""
    shape, matrix, faces = form
    start = max(arcs[i, START], others[j, START])
    end = min(arcs[i_end - 1, END], others[j_end - 1, END])
    if not start <= end:
        return count
    i = locate(arcs, i, i_end, start)
    j = locate(others, j, j_end, start)
    inside = False
    entry = start
    patience = PATIENCE
    t = start
    while True:
        while i + 1 < i_end and arcs[i, END] <= t:
            i += 1
        while j + 1 < j_end and others[j, END] <= t:
            j += 1
        order, n, stop = window(arcs, i, others, j, t, end, matrix, q)
        whole = order == 4 and n > 0.0 and not inside and stop == end
        if whole and stays_apart(shape, faces, q, n, stop - t):
            return count
        local = 0.0
        while True:
            local, crossed = cross(shape, faces, q, order, n, local, stop - t, inside, patience)
            if not crossed:
                break
            inside = not inside
            if inside:
                entry = t + local
            else:
                if count < len(rows):
                    rows[count, 0], rows[count, 1], rows[count, 2] = pair, entry, t + local
                count += 1
        if local < stop - t:
            patience = LESS_PATIENCE
            t += local
        else:
            t = stop
        if t >= end:
            break
    if inside:
        if count < len(rows):
            rows[count, 0], rows[count, 1], rows[count, 2] = pair, entry, end
        count += 1
    return count


@kernel(
    int64(
        float64[:, ::1],
        int64[::1],
        float64[:, ::1],
        int64[::1],
        int64[::1],
        int64[::1],
        int64,
        FORM,
        float64[:, ::1],
        int64[::1],
    )
)
def conflicts_of_pairs(arcs, offsets, others, other_offsets, first, second, pair, form, rows, done):
    """Conflicts of pairs (first[k], second[k]) from k = `pair` on, as many as fit in `rows`.

    Returns how many rows were filled; `done` gets the pair to go on with.
    """
    arcs, others, rows = borrowed(arcs), borrowed(others), borrowed(rows)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    q = np.empty((8, 3))
    count = 0
    while pair < len(first):
        i, i_end = offsets[first[pair]], offsets[first[pair] + 1]
        j, j_end = other_offsets[second[pair]], other_offsets[second[pair] + 1]
        total = pair_conflicts(arcs, i, i_end, others, j, j_end, form, q, pair, rows, count)
        if total > len(rows):
            done[1] = total - count
            break
        for k in range(count, total):
            ratio, when = closest(arcs, i, i_end, others, j, j_end, rows[k, 1], rows[k, 2], form, q)
            rows[k, 3], rows[k, 4] = when, ratio
        count = total
        pair += 1
    done[0] = pair
    return count


@kernel(
    void(
        float64[:, ::1],
        int64[::1],
        float64[:, ::1],
        int64[::1],
        int64[::1],
        int64[::1],
        FORM,
        float64[:, ::1],
    )
)
def approaches_of_pairs(arcs, offsets, others, other_offsets, first, second, form, out):
    """Time and least norm of every pair over its common time."""
    arcs, others = borrowed(arcs), borrowed(others)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    q = np.empty((8, 3))
    for pair in range(len(first)):
        i, i_end = offsets[first[pair]], offsets[first[pair] + 1]
        j, j_end = other_offsets[second[pair]], other_offsets[second[pair] + 1]
        start = max(arcs[i, START], others[j, START])
        end = min(arcs[i_end - 1, END], others[j_end - 1, END])
        out[pair, 0], out[pair, 1] = nan, inf
        if start <= end:
            ratio, when = closest(arcs, i, i_end, others, j, j_end, start, end, form, q)
            out[pair, 0], out[pair, 1] = when, ratio
