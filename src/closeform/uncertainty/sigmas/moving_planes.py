"""Moving certificates: a plane or a position on a chord between two times, where a fixed one stalls.

A tube can touch a zone, or nearly, for a long time. Each fixed plane then loses its small gap within a step
of about its root, a millionth of a turn. Between the best planes a of now and b of a step later

    a(u) = a + u (b - a),   0 <= u <= 1,

loses only the fourth power of the step, and all terms are polynomials of u by Taylor's series: theory (54),
with l_j = a(u) . r_j of the columns and a bound on the zone's support along a(u). From inside, errors on a
chord between two that lead into the zone are also within k sigmas.
"""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.uncertainty.sigmas.tube import (
    ACTIVE,
    COLUMNS,
    HINT,
    MEAN_RATE,
    NOISY,
    ORDER,
    STALLS,
    evaluate_tube,
    gap_at_sigmas,
)
from closeform.zones.shapes import BALL, CYLINDER, FACES

TERMS = 9  # number of terms of a series
ANGLE = 0.04  # maximum step in n t; the truncated terms are below 1e-18 of the motion
LOST = 2e-15  # relative rounding of the terms of a polynomial
HALVINGS = 40
# of a window or of 1 / n: a short step, and how many of them in a pair are accepted
BRIEF, STALLED = 1e-4, 5000


@kernel()
def series(rows, top, left, order, n, h, out):
    """Fill `out` (9, 3) with the series in u of a motion at the time u h, from its derivatives in `rows`."""
    nn = n * n
    factor = 1.0
    for m in range(TERMS):
        for i in range(3):
            if m < order:
                out[m, i] = rows[top + m, left + i]
            else:
                older = nn * out[m - 4, i] if order == 8 else 0.0
                out[m, i] = -nn * ((2.0 if order == 8 else 1.0) * out[m - 2, i] + older)
    for m in range(TERMS):
        for i in range(3):
            out[m, i] *= factor
        factor *= h / (m + 1)


@kernel()
def column_series(tube, j, h, out):
    """Fill `out` with the series of column j: settled columns first, then those of burns in progress."""
    if j < 6:
        series(tube.settled, 0, 3 * j, 4, tube.mean_motion, h, out)
    else:
        series(tube.active, 8 * (j - 6), 0, 8, tube.mean_motion, h, out)


@kernel()
def add_product(factor, p, size, q, count, out):
    """Add a factor times the product of two polynomials."""
    for i in range(size):
        for j in range(count):
            out[i + j] += factor * p[i] * q[j]


@kernel()
def is_above(p, size, least):
    """Return True if a polynomial stays above `least` over [0, 1], because all its partial sums do."""
    total = 0.0
    for i in range(size):
        total += p[i]
        if not total > least:
            return False
    return True


@kernel()
def along_chord(a, b, motion, out):
    """Fill `out` (10,) with the polynomial of a(u) . motion(u)."""
    for m in range(TERMS + 1):
        out[m] = 0.0
        for i in range(3):
            if m < TERMS:
                out[m] += a[i] * motion[m, i]
            if m > 0:
                out[m] += (b[i] - a[i]) * motion[m - 1, i]


@kernel()
def support_along(shape, a, b, target, ahead, ring, out):
    """Fill `out` (11,) with a(u) . r_0 minus `target` times the support along a(u), times `ring` (2,).

    The support is convex, so that it is at most 1 on the chord. For round zones ring >= hypot(...) by at most
    the fourth power of the step: 2 ring hypot(...) <= ring^2 + hypot(...)^2.  # theory (54)
    """
    out[:] = 0.0
    axes = 3 if shape == BALL else (2 if shape == CYLINDER else 0)
    near = far = 0.0
    for i in range(axes):
        near, far = near + a[i] * a[i], far + b[i] * b[i]
    ring[0], ring[1] = sqrt(near), sqrt(far) - sqrt(near)
    if min(near, far) <= 0.01 * max(near, far):
        ring[0], ring[1], axes = 1.0, 0.0, 0
    add_product(1.0, ring, 2, ahead, TERMS + 1, out)
    chord = stack_vector(2)
    if axes == 0:
        out[0] -= target
        return
    for i in range(axes):
        chord[0], chord[1] = a[i], b[i] - a[i]
        add_product(-0.5 * target, chord, 2, chord, 2, out)
    add_product(-0.5 * target, ring, 2, ring, 2, out)
    if axes == 2:
        chord[0], chord[1] = abs(a[2]), abs(b[2]) - abs(a[2])
        add_product(-target, chord, 2, ring, 2, out)


@kernel()
def keeps_gap(tube, k, target, a, b, h):
    """Return True if planes on a chord from a to b certainly keep k sigmas beyond `target` for h.

    theory (54)
    """
    motion, along, square = stack_matrix(9, 3), stack_vector(10), stack_vector(19)
    margin, ring, rings, p = stack_vector(11), stack_vector(2), stack_vector(3), stack_vector(21)
    series(tube.mean, 0, 0, int(tube.state[ORDER]), tube.state[MEAN_RATE], h, motion)
    along_chord(a, b, motion, along)
    support_along(tube.shape, a, b, target, along, ring, margin)
    square[:] = 0.0
    for j in range(6 + int(tube.state[ACTIVE])):
        column_series(tube, j, h, motion)
        along_chord(a, b, motion, along)
        add_product(1.0, along, TERMS + 1, along, TERMS + 1, square)
    m, near, far = tube.matrix, 0.0, 0.0
    for i in range(3):
        one = a[0] * m[0, i] + a[1] * m[1, i] + a[2] * m[2, i]
        two = b[0] * m[0, i] + b[1] * m[1, i] + b[2] * m[2, i]
        near, far = near + one * one, far + two * two
    square[3] += 4.0 / 3.0 * tube.state[NOISY] * max(near, far) * h * h * h  # as in `tube.plane_time`
    rings[:] = 0.0
    p[:] = 0.0
    add_product(1.0, ring, 2, ring, 2, rings)
    add_product(1.0, margin, 11, margin, 11, p)
    add_product(-k * k, rings, 3, square, 19, p)
    return margin[0] > 0.0 and is_above(p, 21, LOST * (margin[0] * margin[0] + rings[0] * k * k * square[0]))


@kernel()
def moving_plane_time(tube, k, target, longest):
    """Return the time from the window's start that moving planes keep k sigmas beyond `target`, proven."""
    a, b = stack_vector(3), stack_vector(3)
    evaluate_tube(tube, 0.0)
    gap_at_sigmas(tube, k, inf)
    for i in range(3):
        a[i] = tube.best[i]
    h = first_try(tube, longest)
    for _ in range(HALVINGS):
        if evaluate_tube(tube, h) > target and gap_at_sigmas(tube, k, inf) > target:
            for i in range(3):
                b[i] = tube.best[i]
            if keeps_gap(tube, k, target, a, b, h):
                tube.state[HINT] = h
                return h
        h *= 0.5
    return 0.0


@kernel()
def first_try(tube, longest):
    """Return the first step to try: twice the last one."""
    h = min(longest, 2.0 * tube.state[HINT])
    n = max(tube.mean_motion, tube.state[MEAN_RATE])
    return min(h, ANGLE / n) if n > 0.0 else h


@kernel()
def short_step(tube, longest):
    """Return the step below which progress stalls."""
    n = max(tube.mean_motion, tube.state[MEAN_RATE])
    return BRIEF * (min(longest, 1.0 / n) if n > 0.0 else longest)


@kernel()
def reset_stalls(tube):
    """Reset the count of short steps."""
    tube.state[STALLS] = 0.0


@kernel()
def count_stalls(tube, h, longest):
    """Count a step; return the number of consecutive short steps beyond the accepted number."""
    if h < short_step(tube, longest):
        tube.state[STALLS] += 1.0
    else:
        tube.state[STALLS] = min(tube.state[STALLS], STALLED)
    return tube.state[STALLS] - STALLED


@kernel()
def errors_of_point(tube, used, out):
    """Write the errors, of size `used` sigmas, that reach the last plane's point; zero for future noise."""
    best, at = tube.best, tube.at
    share = used / sqrt(tube.along[0]) if tube.along[0] > 0.0 else 0.0
    out[:] = 0.0
    for j in range(6 + int(tube.state[ACTIVE])):
        length = best[0] * at[0, 3 * j] + best[1] * at[0, 3 * j + 1] + best[2] * at[0, 3 * j + 2]
        out[j] = -share * length


@kernel()
def stays_inside(tube, xi, eta, h, aim):
    """Return True if errors on a chord from xi to eta certainly keep the norm below `aim` for h."""
    motion, place, p = stack_matrix(9, 3), stack_matrix(3, 12), stack_vector(23)
    chord, stretch, term, moved = stack_vector(2), stack_vector(3), stack_vector(4), stack_vector(9)
    size, other = 0.0, 0.0
    for j in range(COLUMNS - 6):
        size, other = size + xi[j] * xi[j], other + eta[j] * eta[j]
    size = max(size, other)
    stretch[:] = 0.0
    stretch[0] = 1.5 if size > 0.0 else 1.0
    width = 6 + int(tube.state[ACTIVE])
    for j in range(width):  # (3 - y) / 2 <= 1 / sqrt(y), so that they are not longer than the longer end
        chord[0], chord[1] = xi[j], eta[j] - xi[j]
        if size > 0.0:
            add_product(-0.5 / size, chord, 2, chord, 2, stretch)
    series(tube.mean, 0, 0, int(tube.state[ORDER]), tube.state[MEAN_RATE], h, motion)
    place[:] = 0.0
    for i in range(3):
        for m in range(TERMS):
            place[i, m] = motion[m, i]
    for j in range(width):
        column_series(tube, j, h, motion)
        chord[0], chord[1] = xi[j], eta[j] - xi[j]
        term[:] = 0.0
        add_product(1.0, chord, 2, stretch, 3, term)
        for i in range(3):
            for m in range(TERMS):
                moved[m] = motion[m, i]
            add_product(1.0, term, 4, moved, TERMS, place[i])
    if tube.shape == FACES:
        for f in range(len(tube.faces)):
            for m in range(12):
                p[m] = 0.0
                for i in range(3):
                    p[m] -= tube.faces[f, i] * place[i, m]
            p[0] += aim
            if not is_above(p, 12, LOST):
                return False
        return True
    p[:] = 0.0
    p[0] = aim * aim
    for i in range(2 if tube.shape == CYLINDER else 3):
        add_product(-1.0, place[i], 12, place[i], 12, p)
    inside = is_above(p, 23, LOST)
    for side in range(2 if tube.shape == CYLINDER else 0):
        for m in range(12):
            p[m] = (1.0 - 2.0 * side) * place[2, m]
        p[0] += aim
        inside = inside and is_above(p, 12, LOST)
    return inside
