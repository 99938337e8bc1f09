"""Gauge functions: norms whose unit ball is a zone plus an ellipsoid of k sigmas, and their gradients.

The gauge is the scale s at which s times both just touch the position r. Its gradient is a / (1 + k |l_a|)
for the a of the best plane, the supporting plane of the sum, a . r = 1 + k |l_a|.  # theory (52)
"""

from math import sqrt

from numba import float64, int64, void

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix
from closeform.uncertainty.cylinder_separation import plane
from closeform.uncertainty.golden_planes import is_short, search_planes
from closeform.zones.shapes import norm

MEET = 1e-9  # norm below which two craft coincide, and no direction is preferred
TURNS, MOST = 60, 1e6  # maximum numbers of steps and of sigmas


@kernel()
def spread_along(s, x, y, z):
    """Return sqrt(a S a)."""
    square = x * (s[0, 0] * x + 2.0 * (s[0, 1] * y + s[0, 2] * z))
    square += y * (s[1, 1] * y + 2.0 * s[1, 2] * z) + z * s[2, 2] * z
    return sqrt(max(square, 0.0))


@kernel()
def factor(s, root):
    """Fill the lower triangle of `root` (3, 3) with the Cholesky factor of S."""
    for j in range(3):
        for i in range(j, 3):
            root[i, j] = s[i, j]
            for m in range(j):
                root[i, j] -= root[i, m] * root[j, m]
            if i == j:
                root[j, j] = sqrt(max(root[j, j], 0.0))
            else:
                root[i, j] = root[i, j] / root[j, j] if root[j, j] > 0.0 else 0.0


@kernel()
def gauge(shape, faces, r, s, k, best):
    """Return the gauge of r in the sum of the unit zone and k sigmas of S.

    `best` (4,) receives a, then 1 + k |l_a|. k < 0: the number of sigmas that just touch the zone. Newton's
    method converges from below.
    """
    found, root = 0.0, stack_matrix(3, 3)
    for _ in range(TURNS):
        many = found if k < 0.0 else k * found
        plane(shape, faces, r, s, many, True, best)
        if is_short(shape, faces, r, s, many, best):
            factor(s, root)
            search_planes(shape, faces, r, root, many, best)
        wide = spread_along(s, best[0], best[1], best[2])
        ahead = best[0] * r[0] + best[1] * r[1] + best[2] * r[2]
        if k < 0.0:
            better = (ahead - 1.0) / wide if ahead - 1.0 < MOST * wide else MOST
        else:
            better = ahead / (1.0 + k * wide)
        better = max(better, 0.0)
        if not abs(better - found) > 1e-13 * better:
            break
        found = better
    best[3] = 1.0 + k * wide
    return better


@kernel(
    void(int64, float64[:, ::1], float64[:, ::1], float64[:, :, ::1], float64, float64[::1], float64[:, ::1])
)
def gauges(shape, faces, places, squares, k, sizes, gradients):
    """Fill the gauges (K,) and their gradients (K, 3) of positions (K, 3) with covariances (K, 3, 3).

    `gradients` (K, 4) end in 1 + k |l_a|; they are 0 where two craft coincide. k < 0: the maximum numbers of
    clear sigmas, 0 inside the zone.
    """
    for m in range(len(places)):
        r, best = places[m], gradients[m]
        inside = norm(shape, faces, r[0], r[1], r[2])
        if inside <= (1.0 if k < 0.0 else MEET):
            best[0] = best[1] = best[2] = sizes[m] = 0.0
            best[3] = 1.0
            continue
        sizes[m] = gauge(shape, faces, r, squares[m], k, best)
        for i in range(3):
            best[i] /= best[3]
