"""Best separating plane between a zone and an ellipsoid by golden sections, where fast methods fail.

For a thin ellipsoid sqrt(a S a) has an edge, along which Newton's method does not climb. Its square has lost
half of the digits, and no point determines the best plane. Here planes are only compared, using a root of S
that is accurate to all digits. Over all planes that face r the gap g is quasi-concave, so that its maximum
over one angle is quasi-concave in the other; between three faces that meet it is concave.  # theory 3
"""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix
from closeform.uncertainty.planes import copy_row, room
from closeform.zones.shapes import CUBE, FACES, norm, support

GOLDEN, STEPS = 0.6180339887498949, 76  # steps that shrink a bracket to a relative 1e-16
LACKING, MOST_LACKING = 1e-9, 1e-7  # relative deficit of a plane's g before all planes are searched
LOST = 1e-12  # rounding, relative to the ellipsoid's size over its width
DEEP = 0.5  # norm of a point that is deep enough inside, if the ellipsoid contains the origin


@kernel()
def is_short(shape, faces, r, s, k, best):
    """Return True if a plane may be worse than the best: the ellipsoid's point there is not as near.

    That point is uncertain by the digits lost in an ellipsoid that is thin along the plane's normal. A point
    deep inside is accepted.
    """
    g, x, y, z = room(r, s, k, best[0], best[1], best[2])
    near = norm(shape, faces, x, y, z)
    wide = best[0] * r[0] + best[1] * r[1] + best[2] * r[2] - g
    trace = s[0, 0] + s[1, 1] + s[2, 2]
    lost = LOST * k * k * trace / wide if wide > 0.0 else inf
    allowed = min(LACKING + lost, MOST_LACKING) * (1.0 + abs(best[3]))
    return not near - best[3] <= allowed and (best[3] > 0.0 or near > DEEP)


@kernel()
def search_planes(shape, faces, r, root, k, best):
    """Write the best plane of all to `best` (4,), if it is better; `root` (3, 3) is lower triangular."""
    chart = stack_matrix(3, 3)
    best[3] = left(r, root, k, best[0], best[1], best[2])
    cube = shape == FACES and is_cube(faces)
    if shape == FACES and not cube:
        search_faces(faces, r, root, k, chart, best)
    else:
        axes_about(r, chart)
        best_of_all(CUBE if cube else shape, r, root, k, chart, best)


@kernel()
def is_cube(faces):
    """Return True if the faces are those of the unit cube, in the order of `faced`."""
    off = 0.0
    for m in range(len(faces)):
        for i in range(3):
            side = 1.0 if m < 3 else -1.0
            off += abs(faces[m, i] - (side if m % 3 == i else 0.0))
    return len(faces) == 6 and off == 0.0


@kernel()
def left(r, root, k, x, y, z):
    """Return g of (x, y, z)."""
    one = x * root[0, 0] + y * root[1, 0] + z * root[2, 0]
    two, three = y * root[1, 1] + z * root[2, 1], z * root[2, 2]
    return x * r[0] + y * r[1] + z * r[2] - k * sqrt(one * one + two * two + three * three)


@kernel()
def merit(shape, r, root, k, chart, u, v, best):
    """Return the merit of the plane at u and v, both in [0, 1]; update `best` (4,).

    For flat faces, the mixture of three and its g. Otherwise the plane on a half circle at an angle about r,
    both by the tangent of half the angle; if g is negative, it is scaled by a . r instead of the support.
    """
    if shape == FACES:
        one, two, three = 1.0 - u, u * (1.0 - v), u * v
    else:
        u, v = 2.0 * u - 1.0, 2.0 * v - 1.0
        one, two, three = (1.0 - v * v) * (1.0 - u * u), (1.0 - v * v) * 2.0 * u, 2.0 * v * (1.0 + u * u)
    x = one * chart[0, 0] + two * chart[1, 0] + three * chart[2, 0]
    y = one * chart[0, 1] + two * chart[1, 1] + three * chart[2, 1]
    z = one * chart[0, 2] + two * chart[1, 2] + three * chart[2, 2]
    if shape != FACES:
        size = support(shape, x, y, z)
        x, y, z = x / size, y / size, z / size
    g = left(r, root, k, x, y, z)
    if g > best[3]:
        best[0], best[1], best[2], best[3] = x, y, z, g
    if shape == FACES or g > 0.0:
        return g
    ahead = x * r[0] + y * r[1] + z * r[2]
    return g / ahead if ahead > 0.0 else -inf


@kernel()
def best_across(shape, r, root, k, chart, u, best):
    """Return the largest merit at some u."""
    low, high = 0.0, 1.0
    near, far = 1.0 - GOLDEN, GOLDEN
    worth = merit(shape, r, root, k, chart, u, near, best)
    other = merit(shape, r, root, k, chart, u, far, best)
    for _ in range(STEPS):
        if worth > other:
            high, far, other = far, near, worth
            near = high - GOLDEN * (high - low)
            worth = merit(shape, r, root, k, chart, u, near, best)
        else:
            low, near, worth = near, far, other
            far = low + GOLDEN * (high - low)
            other = merit(shape, r, root, k, chart, u, far, best)
    return max(worth, other)


@kernel()
def best_of_all(shape, r, root, k, chart, best):
    """Search the best plane of a chart over all u and v."""
    low, high = 0.0, 1.0
    near, far = 1.0 - GOLDEN, GOLDEN
    worth = best_across(shape, r, root, k, chart, near, best)
    other = best_across(shape, r, root, k, chart, far, best)
    for _ in range(STEPS):
        if worth > other:
            high, far, other = far, near, worth
            near = high - GOLDEN * (high - low)
            worth = best_across(shape, r, root, k, chart, near, best)
        else:
            low, near, worth = near, far, other
            far = low + GOLDEN * (high - low)
            other = best_across(shape, r, root, k, chart, far, best)


@kernel()
def search_faces(faces, r, root, k, chart, best):
    """Search the best mixture of two faces, or of three that meet in a corner of the zone."""
    for i in range(len(faces)):
        copy_row(faces[i], chart[0])
        for j in range(i):
            copy_row(faces[j], chart[1])
            copy_row(faces[i], chart[2])
            best_across(FACES, r, root, k, chart, 1.0, best)
            for m in range(j):
                copy_row(faces[m], chart[2])
                if is_corner(faces, chart):
                    best_of_all(FACES, r, root, k, chart, best)


@kernel()
def is_corner(faces, chart):
    """Return True if the three faces of a chart meet in a point of the zone."""
    f, g, h = chart[0], chart[1], chart[2]
    # q = (g x h + h x f + f x g) / f . (g x h)
    x = g[1] * h[2] - g[2] * h[1] + h[1] * f[2] - h[2] * f[1] + f[1] * g[2] - f[2] * g[1]
    y = g[2] * h[0] - g[0] * h[2] + h[2] * f[0] - h[0] * f[2] + f[2] * g[0] - f[0] * g[2]
    z = g[0] * h[1] - g[1] * h[0] + h[0] * f[1] - h[1] * f[0] + f[0] * g[1] - f[1] * g[0]
    volume = f[0] * (g[1] * h[2] - g[2] * h[1]) + f[1] * (g[2] * h[0] - g[0] * h[2])
    volume += f[2] * (g[0] * h[1] - g[1] * h[0])
    return volume != 0.0 and norm(FACES, faces, x / volume, y / volume, z / volume) <= 1.0 + LACKING


@kernel()
def axes_about(r, axes):
    """Fill `axes` (3, 3) with r / |r| and two unit vectors across it."""
    size = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    x, y, z = r[0] / size, r[1] / size, r[2] / size
    side = 1.0 if z >= 0.0 else -1.0
    part = -1.0 / (side + z)
    axes[0, 0], axes[0, 1], axes[0, 2] = x, y, z
    axes[1, 0], axes[1, 1], axes[1, 2] = 1.0 + side * x * x * part, side * x * y * part, -side * x
    axes[2, 0], axes[2, 1], axes[2, 2] = x * y * part, side + y * y * part, -y
