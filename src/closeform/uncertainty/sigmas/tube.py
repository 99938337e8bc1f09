"""k-sigma tube of a pair: its positions within k sigmas, along a window, for the march against a zone.

With a of unit polar norm and l_j = a . r_j of the columns r_j,

    g(t) = a . r_0 - k |l|,   g(t + h) >= g + h (a . v_0 - k l . l' / |l|) - h^2/2 C         # theory (53)
    C = sum |a_i| A_0i + k A + k |l' across l|^2 / (w |l|)

where A_0i bounds the mean's acceleration along axis i, and A that of all l (for settled columns along a
itself, an oscillation). w is 1 where |l| grows, and 1/2 as long as half of it remains where it shrinks. If
|l| is small, |l'| replaces l . l' / |l|, without the last term. White noise since the window's start is six
more columns, recomputed at each step; it adds at most k (sqrt(m^2 + c h^3) - m) within a step.
"""

from math import inf, sqrt
from typing import Any, NamedTuple

import numpy as np
from numba import float64, types

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import acceleration, derivatives_at
from closeform.motion.certified_march import bound, relative_state, store, window
from closeform.motion.hill import oscillation
from closeform.uncertainty.covariance_propagation import (
    add_noise,
    add_settled,
    burn_error_arc,
    burn_errors,
    compress,
    is_exact,
)
from closeform.uncertainty.sigmas.ellipsoid_planes import best_plane, faced, is_short, search_planes
from closeform.zones.shapes import FORM, norm, time_to_level
from closeform.zones.zone import Zone

NEVER = 1e4  # number of sigmas that counts as infinite
ALMOST = 1e-3  # of a level: planes with less margin beyond it are computed exactly
SKETCHED = 0.01  # relative deficit of an approximate level
DEEP, SHALLOW = 0.5, 0.75  # norms of a position well inside: the target, and the accepted value
COLUMNS = 20  # six settled, four of a burn in progress of either craft, six of noise
# Entries of `state`: order and mean motion of the mean, number of active columns, noise of both, length of
# the window, last step of a moving certificate, three times the number of columns at an instant, and the
# number of short steps of the pair.
ORDER, MEAN_RATE, ACTIVE, NOISY, REACH, HINT, WIDTH, STALLS = 0, 1, 2, 3, 4, 5, 6, 7


class Tube(NamedTuple):
    """Working memory of the kernels for one pair; in zone coordinates except `columns`.

    Of the zone `shape`, `matrix` and `faces`; `mean_motion` of the orbit. Of a window the derivatives of the
    mean (8, 3), of the settled columns (4, 18) and of those in progress (64, 3), `bounds` (6,) of the
    acceleration along the axes, of the mean and of columns that are not settled, and the numbers in `state`.
    At an instant `place` (6,) of the mean, `at` (2, 60) of the columns, their covariance `square` (3, 3), the
    `best` plane (4,) and the columns along it, `along` (3,): |l|^2, l . l' and |l'|^2.
    """

    shape: int
    matrix: Floats
    faces: Floats
    mean_motion: float
    mean: Floats
    settled: Floats
    active: Floats
    bounds: Floats
    state: Floats
    columns: Floats
    place: Floats
    at: Floats
    square: Floats
    best: Floats
    along: Floats


TUBE = types.NamedTuple(
    (
        *FORM.types,
        float64,
        *[float64[:, ::1]] * 3,
        *[float64[::1]] * 2,
        float64[:, ::1],
        float64[::1],
        *[float64[:, ::1]] * 2,
        *[float64[::1]] * 2,
    ),
    Tube,
)


def tube_for(zone: Zone, mean_motion: float) -> Tube:
    """Return working memory for pairs with a zone."""
    sizes: tuple[Any, ...] = ((8, 3), (4, 18), (64, 3), 6, 8, (6, 32), 6, (2, 3 * COLUMNS), (3, 3), 4, 3)
    return Tube(*faced(zone), mean_motion, *map(np.zeros, sizes))


@kernel()
def settled_rows(tube, width):
    """Compute the derivatives in zone coordinates of `width` columns of natural motion."""
    n, a, rows = tube.mean_motion, tube.columns, tube.settled
    for j in range(width):
        x, y, z, vx, vy, vz = a[0, j], a[1, j], a[2, j], a[3, j], a[4, j], a[5, j]
        for k in range(4):
            for i in range(3):
                rows[k, 3 * j + i] = tube.matrix[i, 0] * x + tube.matrix[i, 1] * y + tube.matrix[i, 2] * z
            ax, ay, az = acceleration(n, x, z, vx, vy)
            x, y, z, vx, vy, vz = vx, vy, vz, ax, ay, az


@kernel()
def settled_bound(tube, h, x, y, z):
    """Return the squared bound on the acceleration of all settled columns along a direction over [0, h]."""
    n, rows = tube.mean_motion, tube.settled
    b = c = 0.0
    for j in range(0, 18, 3):
        bend = x * rows[2, j] + y * rows[2, j + 1] + z * rows[2, j + 2]
        twist = x * rows[3, j] + y * rows[3, j + 1] + z * rows[3, j + 2]
        b, c = b + bend * bend, c + twist * twist
    grown = sqrt(b) + sqrt(c) * h
    grown *= grown
    return min(grown, b + c / (n * n)) if n > 0.0 else grown


@kernel()
def column_bound(tube, x, y, z):
    """Return a bound on the acceleration of all columns along a direction, over the window."""
    others = abs(x) * tube.bounds[3] + abs(y) * tube.bounds[4] + abs(z) * tube.bounds[5]
    return sqrt(settled_bound(tube, tube.state[REACH], x, y, z) + others * others)


@kernel()
def load_burn_errors(tube, arc, row, execution, t, h):
    """Compute the derivatives and bounds of the errors of one craft's burn."""
    out = stack_vector(30)
    for j in range(burn_errors(arc, execution)):
        burn_error_arc(tube.mean_motion, arc, row, execution, j, out)
        first = 8 * int(tube.state[ACTIVE])
        q = tube.active[first : first + 8]
        q[:] = 0.0
        derivatives_at(out, t, 8, q, 1.0)
        for k in range(8):
            store(q, k, tube.matrix, q[k, 0], q[k, 1], q[k, 2])
        for axis in range(3):
            a, _ = bound(q, 8, tube.mean_motion, h, axis)
            tube.bounds[3 + axis] += a * a
        tube.state[ACTIVE] += 1.0


@kernel()
def load_tube(tube, one, i, first, two, j, second, t, h):
    """Load arcs i and j of a pair from time t on, for at most h: mean, columns and their bounds."""
    a, row, execution = one.arcs[i], one.rows[i], one.execution[first]
    b, other_row, other_execution = two.arcs[j], two.rows[j], two.execution[second]
    order, n = window(a, b, t, tube.matrix, tube.mean)
    tube.state[ORDER], tube.state[MEAN_RATE], tube.state[ACTIVE] = order, n, 0.0
    for axis in range(3):
        tube.bounds[axis], _ = bound(tube.mean, order, n, h, axis)
        tube.bounds[3 + axis] = 0.0
    if tube.state[NOISY] > 0.0:
        add_noise(tube.mean_motion, h, tube.state[NOISY], tube.columns, 0)
        settled_rows(tube, 6)
        for axis in range(3):
            x, y, z = 1.0 * (axis == 0), 1.0 * (axis == 1), 1.0 * (axis == 2)
            tube.bounds[3 + axis] += settled_bound(tube, h, x, y, z)
    width = add_settled(tube.mean_motion, a, row, execution, t, tube.columns, 0)
    if not is_exact(other_row, other_execution):
        width = add_settled(tube.mean_motion, b, other_row, other_execution, t, tube.columns, width)
    if width > 6:
        compress(tube.columns, width)
    settled_rows(tube, 6)
    load_burn_errors(tube, a, row, execution, t, h)
    load_burn_errors(tube, b, other_row, other_execution, t, h)
    for axis in range(3):
        tube.bounds[3 + axis] = sqrt(tube.bounds[3 + axis])
    tube.state[REACH] = h


@kernel()
def evaluate_tube(tube, t):
    """Compute the mean, the columns and their covariance at time t of the window; return the mean's norm."""
    n, rows, at = tube.mean_motion, tube.settled, tube.at
    x, y, z, vx, vy, vz = relative_state(tube.mean, int(tube.state[ORDER]), tube.state[MEAN_RATE], t)
    place = tube.place
    place[0], place[1], place[2], place[3], place[4], place[5] = x, y, z, vx, vy, vz
    c0, c1, c2 = oscillation(n, t)
    for j in range(18):
        at[0, j] = rows[0, j] + rows[1, j] * t + rows[2, j] * c1 + rows[3, j] * c2
        at[1, j] = rows[1, j] + rows[2, j] * c0 + rows[3, j] * c1
    width = 18
    for j in range(int(tube.state[ACTIVE])):
        moved = relative_state(tube.active[8 * j : 8 * j + 8], 8, n, t)
        for i in range(3):
            at[0, width + i], at[1, width + i] = moved[i], moved[3 + i]
        width += 3
    if tube.state[NOISY] > 0.0 and t > 0.0:
        a, m = tube.columns, tube.matrix
        add_noise(n, t, tube.state[NOISY], a, 0)
        for j in range(6):
            for i in range(3):
                at[0, width + i] = m[i, 0] * a[0, j] + m[i, 1] * a[1, j] + m[i, 2] * a[2, j]
                at[1, width + i] = m[i, 0] * a[3, j] + m[i, 1] * a[4, j] + m[i, 2] * a[5, j]
            width += 3
    tube.state[WIDTH] = width
    fill_square(tube)
    return norm(tube.shape, tube.faces, x, y, z)


@kernel()
def fill_square(tube):
    """Compute the covariance of the columns at the instant."""
    at, s, width = tube.at, tube.square, int(tube.state[WIDTH])
    xx = xy = xz = yy = yz = zz = 0.0
    for j in range(0, width, 3):
        px, py, pz = at[0, j], at[0, j + 1], at[0, j + 2]
        xx, xy, xz = xx + px * px, xy + px * py, xz + px * pz
        yy, yz, zz = yy + py * py, yz + py * pz, zz + pz * pz
    s[0, 0], s[0, 1], s[0, 2], s[1, 0], s[1, 1], s[1, 2] = xx, xy, xz, xy, yy, yz
    s[2, 0], s[2, 1], s[2, 2] = xz, yz, zz
    for i in range(3):  # regularization: without uncertainty the plane would not be unique
        s[i, i] += 1e-16 * (xx + yy + zz)


@kernel()
def gap_at_sigmas(tube, k, enough):
    """Return g at k sigmas of the best plane, from its columns; store them in `along`.

    With `enough`, an approximate plane suffices if it leaves more than that; inf requires the best.
    """
    shape, faces, r, s, best = tube.shape, tube.faces, tube.place, tube.square, tube.best
    if enough < inf:
        best_plane(shape, faces, r, s, k, False, best)
        if evaluate_plane(tube, k) > enough + ALMOST * abs(enough):
            return best[3]
    best_plane(shape, faces, r, s, k, True, best)
    evaluate_plane(tube, k)
    if is_short(shape, faces, r, s, k, best):
        root = stack_matrix(6, COLUMNS)
        root_of_columns(tube, root)
        search_planes(shape, faces, r, root, k, best)
        evaluate_plane(tube, k)
    return best[3]


@kernel()
def position_inside(tube, norm, k):
    """Return the sigmas of a position well inside the zone, or of the deepest one, and its norm."""
    if norm <= DEEP:
        return 0.0, norm
    used = 0.0
    while True:
        g = gap_at_sigmas(tube, used, inf)
        if g <= SHALLOW or used >= k:
            return used, g
        best, place = tube.best, tube.place
        ahead = best[0] * place[0] + best[1] * place[1] + best[2] * place[2]
        wide = sqrt(tube.along[0])
        more = (ahead - DEEP) / wide if wide > 0.0 else k
        used = min(k, max(more, 1.01 * used))


@kernel()
def evaluate_plane(tube, k):
    """Return g at k sigmas of the current plane, from the columns along it, which are stored in `along`."""
    best, at, along, place = tube.best, tube.at, tube.along, tube.place
    x, y, z = best[0], best[1], best[2]
    square = turn = rate = 0.0
    for j in range(0, int(tube.state[WIDTH]), 3):
        length = x * at[0, j] + y * at[0, j + 1] + z * at[0, j + 2]
        speed = x * at[1, j] + y * at[1, j + 1] + z * at[1, j + 2]
        square, turn, rate = square + length * length, turn + length * speed, rate + speed * speed
    along[0], along[1], along[2] = square, turn, rate
    best[3] = x * place[0] + y * place[1] + z * place[2] - k * sqrt(square)
    return best[3]


@kernel()
def root_of_columns(tube, root):
    """Fill `root` (6, 20), of which (3, 3) is non-zero, with a root of the covariance at the instant."""
    width = int(tube.state[WIDTH]) // 3
    root[:] = 0.0
    for j in range(width):
        for i in range(3):
            root[i, j] = tube.at[0, 3 * j + i]
    compress(root, width)


@kernel()
def level_time(gap, slope, k, along, most, spread):
    """Return the time for which the gap provably lasts, by the better of both bounds.

    theory (53)
    """
    h = time_to_level(gap, slope - k * sqrt(along[2]), most + k * spread)
    if along[0] > 0.0:
        wide = sqrt(along[0])
        turn = along[1] / wide
        left = 1.0 if turn >= 0.0 else 0.5  # of |l|, whose curvature grows as it shrinks
        bend = max(along[2] - turn * turn, 0.0) / (left * wide)
        last = (left - 1.0) * wide / turn if turn < 0.0 else inf
        h = max(h, min(last, time_to_level(gap, slope - k * turn, most + k * (spread + bend))))
    return h


@kernel()
def plane_time(tube, k, gap):
    """Return the time for which the current plane provably keeps its gap at k sigmas."""
    best, b, along, m = tube.best, tube.bounds, tube.along, tube.matrix
    x, y, z = best[0], best[1], best[2]
    most = abs(x) * b[0] + abs(y) * b[1] + abs(z) * b[2]
    spread = column_bound(tube, x, y, z)
    slope = x * tube.place[3] + y * tube.place[4] + z * tube.place[5]
    h = level_time(gap, slope, k, along, most, spread)
    if tube.state[NOISY] > 0.0 and k > 0.0:
        square = 0.0
        for i in range(3):
            part = x * m[0, i] + y * m[1, i] + z * m[2, i]
            square += part * part
        # noise over h adds at most c h^3 to the variance of a . r: |Phi_rv(s)| <= s (1 + n s) up to n s = 1
        cubic = 4.0 / 3.0 * tube.state[NOISY] * square
        if tube.mean_motion > 0.0:
            h = min(h, 1.0 / tube.mean_motion)
        for _ in range(200):
            least = max(sqrt(along[0]) - h * sqrt(along[2]) - 0.5 * h * h * spread, 0.0)
            fresh = cubic * h * h * h
            lost = k * fresh / (least + sqrt(least * least + fresh))
            if lost <= 0.5 * gap:
                return min(h, level_time(gap - lost, slope, k, along, most, spread))
            h *= 0.5
    return h


@kernel()
def level_of_plane(tube, k):
    """Return the level up to which the current plane separates both."""
    ahead = tube.best[0] * tube.place[0] + tube.best[1] * tube.place[1] + tube.best[2] * tube.place[2]
    wide = sqrt(tube.along[0])
    if k < 0.0:
        if ahead <= 1.0:  # also the null plane of opposite faces, if sigmas reach far into the zone
            return 0.0
        return (ahead - 1.0) / wide if wide > 0.0 else inf
    return max(ahead / (1.0 + k * wide), 0.0)


@kernel()
def level(tube, t, k, start, enough, fine):
    """Return the level of the zone, or the sigmas, at contact at time t, from a lower bound `start` or 0."""
    if evaluate_tube(tube, t) <= (1.0 if k < 0.0 else 0.0):
        return 0.0
    return level_here(tube, k, start, enough, fine)


@kernel()
def level_here(tube, k, start, enough, fine):
    """Return the level at the instant at which the tube was evaluated.

    k < 0: the number of sigmas that touch the zone; otherwise the scale of zone and k sigmas together, which
    is the mean's norm in their sum. It is inf if it is at least `enough`, and approximate unless `fine`.
    Newton's method: g is convex in either, so that it converges from below.
    """
    s, better = start, start
    for _ in range(40):
        sigmas = s if k < 0.0 else s * k
        if fine:
            gap_at_sigmas(tube, sigmas, inf)
        else:
            best_plane(tube.shape, tube.faces, tube.place, tube.square, sigmas, False, tube.best)
            evaluate_plane(tube, sigmas)
        better = level_of_plane(tube, k)
        if better >= enough:
            return inf
        if not abs(better - s) > (1e-13 if fine else SKETCHED) * better:
            break
        s = better
    return better


@kernel()
def level_rate(tube, k, s):
    """Return the rate of `level` at its plane, up to a positive factor."""
    slope = tube.best[0] * tube.place[3] + tube.best[1] * tube.place[4] + tube.best[2] * tube.place[5]
    wide = sqrt(tube.along[0])
    turn = tube.along[1] / wide if wide > 0.0 else sqrt(tube.along[2])
    if k < 0.0:
        return (slope - s * turn) / wide if wide > 0.0 else slope - s * turn
    return (slope - s * k * turn) / (1.0 + k * wide)
