"""Separating planes between a unit zone at the origin and an ellipsoid: the one with the largest gap.

The ellipsoid is that of k sigmas about r, with covariance S. Over all a on the zone's polar set (where the
largest a . q of the zone is 1: |a| = 1 for a ball, mixtures of the faces for half-spaces, hypot(a_0, a_1) +
|a_2| = 1 for a cylinder) the best plane has the largest

    g = a . r - k sqrt(a S a)                                                        # theory (52)

which is the minimum norm of the ellipsoid's points, at p = r - k S a / sqrt(a S a). Any other a gives less,
so that g above 1 is a proof for any a. A cube is represented by six faces.

For a thin ellipsoid sqrt(a S a) has an edge, along which Newton's method does not climb. Its square has lost
half of the digits, and no point determines the best plane. Golden sections then only compare planes, with a
root of S that has kept its digits. Over all planes that face r the gap g is quasi-concave, so that its
maximum over one angle is quasi-concave in the other; between three faces that meet it is concave.  # theory 3

The gauge of r is the norm whose unit ball is the zone plus the ellipsoid: the scale at which both, multiplied
by it, just touch r. Its gradient is a / (1 + k |l_a|) for the a of the best plane, the supporting plane of
the sum, a . r = 1 + k |l_a|.
"""

from math import inf, sqrt

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import stack_matrix
from closeform.motion.linear import axes_across, copy, times
from closeform.zones.shapes import BALL, CUBE, FACES, norm, support
from closeform.zones.zone import Zone

CUBE_FACES = np.concatenate([np.eye(3), -np.eye(3)])
SETTLED = 1e-13  # relative gain of a plane below which it is rounding
SKETCHED = 1e-4  # the same where an approximate plane suffices
PLANE_ROUNDING = 1e-15  # relative rounding of the terms of g
GOLDEN, STEPS = 0.6180339887498949, 76  # steps that shrink a bracket to a relative 1e-16
LACKING, MOST_LACKING = 1e-9, 1e-7  # relative deficit of a plane's g before all planes are searched
LOST = 1e-12  # rounding, relative to the ellipsoid's size over its width
DEEP = 0.5  # norm of a point that is deep enough inside, if the ellipsoid contains the origin
MEET = 1e-9  # norm below which two craft coincide, and no direction is preferred
TURNS, MOST = 60, 1e6  # maximum numbers of steps and of sigmas
ROWS = float64[:, ::1]


def faced(zone: Zone) -> tuple[int, Floats, Floats]:
    """Return a zone's `form` for the search of planes, with a cube as six faces."""
    return (FACES, zone.matrix, CUBE_FACES) if zone.shape == CUBE else zone.form


@kernel()
def gap_of_plane(r, s, k, x, y, z):
    """Return g of (x, y, z) and the point p at which it is attained; r without uncertainty."""
    ux, uy, uz = times(s, x, y, z)
    wide = sqrt(max(x * ux + y * uy + z * uz, 0.0))
    h = k / wide if wide > 0.0 else 0.0
    px, py, pz = r[0] - h * ux, r[1] - h * uy, r[2] - h * uz
    return x * r[0] + y * r[1] + z * r[2] - k * wide, px, py, pz


@kernel()
def shifted_inverse(s, shift, x, y, z):
    """Return (S + shift I)^-1 times a vector, by L D L^T; cofactors would lose exactly known directions."""
    a, d, e = s[0, 0] + shift, s[0, 1], s[0, 2]
    low, lower = d / a, e / a
    b, f = s[1, 1] + shift - low * d, s[1, 2] - low * e
    b = max(b, shift)
    last = f / b
    c = max(s[2, 2] + shift - lower * e - last * f, shift)
    y -= low * x
    z -= lower * x + last * y
    wz = z / c
    wy = y / b - last * wz
    wx = x / a - low * wy - lower * wz
    return wx, wy, wz


@kernel()
def inverse(s, shift, x, y, z, fine):
    """Return (S + shift I)^-1 times a vector, with one step of iterative refinement if `fine`."""
    wx, wy, wz = shifted_inverse(s, shift, x, y, z)
    if not fine:
        return wx, wy, wz
    ux, uy, uz = times(s, wx, wy, wz)
    dx, dy, dz = shifted_inverse(s, shift, x - ux - shift * wx, y - uy - shift * wy, z - uz - shift * wz)
    return wx + dx, wy + dy, wz + dz


@kernel()
def round_plane(x, y, z, s, k, fine):
    """Return the best unit a of a ball: towards p = rho w, w = (S + rho I)^-1 r, where sqrt(w S w) = k.

    Newton's method on the inverse of that root, which is almost linear in rho; accurate to a thousandth
    unless `fine`.
    """
    ux, uy, uz = times(s, x, y, z)
    spread = x * ux + y * uy + z * uz
    if k == 0.0 or not spread > 0.0:
        size = sqrt(x * x + y * y + z * z)
        return x / size, y / size, z / size
    trace = s[0, 0] + s[1, 1] + s[2, 2]
    least = 1e-12 * trace  # below it, exactly known directions are lost in rounding
    shift = max(sqrt(spread) / k - trace, least)  # from below
    wx = wy = wz = 0.0
    for _ in range(60):
        wx, wy, wz = inverse(s, shift, x, y, z, fine)
        ux, uy, uz = times(s, wx, wy, wz)
        square = wx * ux + wy * uy + wz * uz
        if not square > 0.0:
            break
        vx, vy, vz = inverse(s, shift, ux, uy, uz, fine)
        size = sqrt(square)
        step = square / (wx * vx + wy * vy + wz * vz) * (size - k) / k
        if abs(step) <= (1e-10 if fine else 1e-3) * shift or (shift == least and step < 0.0):
            break
        shift = max(shift + step, 1e-3 * shift, least)
    size = sqrt(wx * wx + wy * wy + wz * wz)
    return wx / size, wy / size, wz / size


@kernel()
def mixture(f, g, r, s, k):
    """Return the fraction of the row g in the best plane between rows f and g; -1 if no mixture is best."""
    dx, dy, dz = g[0] - f[0], g[1] - f[1], g[2] - f[2]
    ux, uy, uz = times(s, dx, dy, dz)
    bend = dx * ux + dy * uy + dz * uz
    along = f[0] * ux + f[1] * uy + f[2] * uz
    vx, vy, vz = times(s, f[0], f[1], f[2])
    rest = f[0] * vx + f[1] * vy + f[2] * vz - along * along / bend if bend > 0.0 else -inf
    slope = dx * r[0] + dy * r[1] + dz * r[2]
    left = k * k - slope * slope / bend if bend > 0.0 else -1.0
    if not (left > 0.0 and rest > -inf):
        return -1.0
    return (sqrt(max(rest, 0.0) / left) * slope - along) / bend


@kernel()
def mixture_of_three(f, g, h, r, s, k):
    """Return the shares of the rows g and h in the best plane between three; negative without all three."""
    dx, dy, dz = g[0] - f[0], g[1] - f[1], g[2] - f[2]
    ex, ey, ez = h[0] - f[0], h[1] - f[1], h[2] - f[2]
    ux, uy, uz = times(s, dx, dy, dz)
    vx, vy, vz = times(s, ex, ey, ez)
    a, b, c = dx * ux + dy * uy + dz * uz, dx * vx + dy * vy + dz * vz, ex * vx + ey * vy + ez * vz
    determinant = a * c - b * b
    if not determinant > 1e-14 * a * c:
        return -1.0, -1.0
    p, q = f[0] * ux + f[1] * uy + f[2] * uz, f[0] * vx + f[1] * vy + f[2] * vz
    m, n = dx * r[0] + dy * r[1] + dz * r[2], ex * r[0] + ey * r[1] + ez * r[2]
    hp, hq = (c * p - b * q) / determinant, (a * q - b * p) / determinant
    hm, hn = (c * m - b * n) / determinant, (a * n - b * m) / determinant
    wx, wy, wz = times(s, f[0], f[1], f[2])
    rest = max(f[0] * wx + f[1] * wy + f[2] * wz - p * hp - q * hq, 0.0)
    left = k * k - m * hm - n * hn
    if not left > 0.0:
        return -1.0, -1.0
    scale = sqrt(rest / left)
    return scale * hm - hp, scale * hn - hq


@kernel()
def flat_plane(faces, r, s, k, fine, best):
    """Write the best mixture of faces, at most three, and its g to `best` (4,).

    From the best mixture, the face with the largest violation is added.
    """
    best[3] = -inf
    active = stack_matrix(4, 3)
    chosen = stack_matrix(3, 3)
    for m in range(len(faces)):
        g, _, _, _ = gap_of_plane(r, s, k, faces[m, 0], faces[m, 1], faces[m, 2])
        if g > best[3]:
            best[0], best[1], best[2], best[3] = faces[m, 0], faces[m, 1], faces[m, 2], g
    copy(best, active[0])
    count = 1
    for _ in range(40):
        _, px, py, pz = gap_of_plane(r, s, k, best[0], best[1], best[2])
        most, worst = -inf, 0
        for m in range(len(faces)):
            reach = faces[m, 0] * px + faces[m, 1] * py + faces[m, 2] * pz
            if reach > most:
                most, worst = reach, m
        before = best[3]
        if most <= before + (SETTLED if fine else SKETCHED) * (1.0 + abs(before)):
            return
        added = faces[worst]
        found = 0
        for i in range(count):
            share = mixture(added, active[i], r, s, k)
            if 0.0 < share < 1.0 and try_mixture(added, active[i], added, share, 0.0, r, s, k, best):
                copy(active[i], chosen[0])
                found = 1
        for i in range(count):
            for j in range(i):
                share, other = mixture_of_three(added, active[i], active[j], r, s, k)
                mixed = share > 0.0 and other > 0.0 and share + other < 1.0
                if mixed and try_mixture(added, active[i], active[j], share, other, r, s, k, best):
                    copy(active[i], chosen[0])
                    copy(active[j], chosen[1])
                    found = 2
        if found == 0:  # the best, or one of many if nothing is uncertain along it: compare all mixtures
            for i in range(len(faces)):
                for j in range(i):
                    share = mixture(faces[i], faces[j], r, s, k)
                    if 0.0 < share < 1.0:
                        try_mixture(faces[i], faces[j], faces[i], share, 0.0, r, s, k, best)
                    for m in range(j):
                        share, other = mixture_of_three(faces[i], faces[j], faces[m], r, s, k)
                        if share > 0.0 and other > 0.0 and share + other < 1.0:
                            try_mixture(faces[i], faces[j], faces[m], share, other, r, s, k, best)
            return
        for i in range(found):
            copy(chosen[i], active[i])
        copy(added, active[found])
        count = found + 1


@kernel()
def try_mixture(f, g, h, share, other, r, s, k, best):
    """Return True if a mixture of three rows is better than the best so far, which it then replaces."""
    rest = 1.0 - share - other
    x = rest * f[0] + share * g[0] + other * h[0]
    y = rest * f[1] + share * g[1] + other * h[1]
    z = rest * f[2] + share * g[2] + other * h[2]
    found, _, _, _ = gap_of_plane(r, s, k, x, y, z)
    if found <= best[3]:
        return False
    best[0], best[1], best[2], best[3] = x, y, z, found
    return True


@kernel()
def cylinder_plane(r, s, k, fine, best):
    """Write the best plane of a cylinder, at its side, an end or the rim, and its g to `best` (4,)."""
    best[3] = -inf
    side = stack_matrix(3, 3)
    for i in range(3):
        for j in range(3):
            side[i, j] = s[i, j] if i < 2 and j < 2 else 0.0
    up = 1.0 if r[2] >= 0.0 else -1.0
    height = 0.0
    if r[0] != 0.0 or r[1] != 0.0:
        x, y, _ = round_plane(r[0], r[1], 0.0, side, k, fine)
        g, _, _, height = gap_of_plane(r, s, k, x, y, 0.0)
        best[0], best[1], best[2], best[3] = x, y, 0.0, g
        if abs(height) <= g:
            return
    g, px, py, _ = gap_of_plane(r, s, k, 0.0, 0.0, up)
    if g > best[3]:
        best[0], best[1], best[2], best[3] = 0.0, 0.0, up, g
    flat = sqrt(px * px + py * py)
    if flat <= g:
        return
    if best[2] == 0.0:
        px, py, up = best[0], best[1], 1.0 if height > 0.0 else -1.0
        flat = 1.0
    for _ in range(2):  # at the rim that seems nearer, else at the other
        climb_rim(
            r, s, k, up, rim_start(r, s, k, up, px / flat, py / flat, best[3]), px / flat, py / flat, best
        )
        _, _, _, height = gap_of_plane(r, s, k, best[0], best[1], best[2])
        if best[2] * up > 0.0 and abs(best[2]) < 1.0 and height * up > 0.0:
            break
        up = -up


@kernel()
def rim_start(r, s, k, up, x, y, g):
    """Return a fraction of the side's plane (x, y) from which to climb: one with more than g, or the best.

    Between the plane of the side and that of the end g is concave.
    """
    most, share, tried = -inf, 0.5, 0.5
    for m in range(50):
        found, _, _, _ = gap_of_plane(r, s, k, tried * x, tried * y, up * (1.0 - tried))
        if found > most:
            most, share = found, tried
        if most > g:
            break
        tried = 0.5 * (1.0 - tried) if m % 2 == 0 else 1.0 - tried
    return share


@kernel()
def climb_rim(r, s, k, up, share, x, y, best):
    """Maximize g over a = (x, y, up (1 - hypot(x, y))) from a fraction of (x, y), by Newton's method.

    The gain of the last step is within rounding, but it makes the ellipsoid's point accurate.
    """
    x, y = share * x, share * y
    g, rounding = -inf, 0.0
    stepx = stepy = 0.0
    for _ in range(60):
        part = 1.0
        while True:  # the step, shorter until it gains
            tx, ty = x + part * stepx, y + part * stepy
            size = sqrt(tx * tx + ty * ty)
            if 0.0 < size < 1.0:
                gained, px, py, pz = gap_of_plane(r, s, k, tx, ty, up * (1.0 - size))
                if gained > g or (part == 1.0 and gained >= g - rounding):
                    break
            part *= 0.5
            if part < 1e-9:
                return
        settled = gained <= g
        ax, ay, az = tx, ty, up * (1.0 - size)
        if gained > best[3] or (settled and g == best[3]):
            best[0], best[1], best[2], best[3] = ax, ay, az, gained
        if settled:
            return
        x, y, g = tx, ty, gained
        ex, ey = x / size, y / size
        gx, gy = px - up * pz * ex, py - up * pz * ey
        ux, uy, uz = times(s, ax, ay, az)
        square = ax * ux + ay * uy + az * uz
        # the rates of a along x and y are (1, 0, -up ex) and (0, 1, -up ey)
        bx, by, bz = times(s, 1.0, 0.0, -up * ex)
        cx, cy, cz = times(s, 0.0, 1.0, -up * ey)
        slope_x, slope_y = ux - up * ex * uz, uy - up * ey * uz
        curve = k / sqrt(square) if square > 0.0 else 0.0
        rounding = PLANE_ROUNDING * (abs(g) + curve * (s[0, 0] + s[1, 1] + s[2, 2]))
        turn = max(up * pz, 0.0) / size  # otherwise the remaining curvature still gives an ascent
        inverse = 1.0 / square if square > 0.0 else 0.0
        hxx = -curve * (bx - up * ex * bz - slope_x * slope_x * inverse) - turn * (1.0 - ex * ex)
        hyy = -curve * (cy - up * ey * cz - slope_y * slope_y * inverse) - turn * (1.0 - ey * ey)
        hxy = -curve * (by - up * ey * bz - slope_x * slope_y * inverse) + turn * ex * ey
        determinant = hxx * hyy - hxy * hxy
        if determinant > 1e-14 * hxx * hyy and hxx < 0.0:
            stepx = -(hyy * gx - hxy * gy) / determinant
            stepy = -(hxx * gy - hxy * gx) / determinant
        else:
            steep = sqrt(gx * gx + gy * gy)
            stepx, stepy = 0.5 * gx / steep, 0.5 * gy / steep


@kernel()
def best_plane(shape, faces, r, s, k, fine, best):
    """Fill `best` (4,) with the best plane and its g; without `fine`, with an approximation."""
    if shape == FACES:
        flat_plane(faces, r, s, k, fine, best)
    elif shape == BALL:
        best[0], best[1], best[2] = round_plane(r[0], r[1], r[2], s, k, fine)
        best[3] = gap_of_plane(r, s, k, best[0], best[1], best[2])[0]
    else:
        cylinder_plane(r, s, k, fine, best)


@kernel()
def is_short(shape, faces, r, s, k, best):
    """Return True if a plane may be worse than the best: the ellipsoid's point there is not as near.

    That point is uncertain by the digits lost in an ellipsoid that is thin along the plane's normal. A point
    deep inside is accepted.
    """
    g, x, y, z = gap_of_plane(r, s, k, best[0], best[1], best[2])
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
    best[3] = gap_from_root(r, root, k, best[0], best[1], best[2])
    cube = shape == FACES and is_cube(faces)
    if shape == FACES and not cube:
        search_faces(faces, r, root, k, chart, best)
    else:
        axes_about(r, chart)
        golden_maximum(best_across, CUBE if cube else shape, r, root, k, chart, 0.0, best)


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
def gap_from_root(r, root, k, x, y, z):
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
    g = gap_from_root(r, root, k, x, y, z)
    if g > best[3]:
        best[0], best[1], best[2], best[3] = x, y, z, g
    if shape == FACES or g > 0.0:
        return g
    ahead = x * r[0] + y * r[1] + z * r[2]
    return g / ahead if ahead > 0.0 else -inf


@kernel()
def golden_maximum(function, shape, r, root, k, chart, u, best):
    """Return the maximum over v in [0, 1] of a function, which updates `best`, by golden sections."""
    low, high = 0.0, 1.0
    near, far = 1.0 - GOLDEN, GOLDEN
    worth = function(shape, r, root, k, chart, u, near, best)
    other = function(shape, r, root, k, chart, u, far, best)
    for _ in range(STEPS):
        if worth > other:
            high, far, other = far, near, worth
            near = high - GOLDEN * (high - low)
            worth = function(shape, r, root, k, chart, u, near, best)
        else:
            low, near, worth = near, far, other
            far = low + GOLDEN * (high - low)
            other = function(shape, r, root, k, chart, u, far, best)
    return max(worth, other)


@kernel()
def best_across(shape, r, root, k, chart, _, u, best):
    """Return the largest merit at some u."""
    return golden_maximum(merit, shape, r, root, k, chart, u, best)


@kernel()
def search_faces(faces, r, root, k, chart, best):
    """Search the best mixture of two faces, or of three that meet in a corner of the zone."""
    for i in range(len(faces)):
        copy(faces[i], chart[0])
        for j in range(i):
            copy(faces[j], chart[1])
            copy(faces[i], chart[2])
            golden_maximum(merit, FACES, r, root, k, chart, 1.0, best)
            for m in range(j):
                copy(faces[m], chart[2])
                if is_corner(faces, chart):
                    golden_maximum(best_across, FACES, r, root, k, chart, 0.0, best)


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
    one, other = axes_across(x, y, z)
    axes[0, 0], axes[0, 1], axes[0, 2] = x, y, z
    axes[1, 0], axes[1, 1], axes[1, 2] = one
    axes[2, 0], axes[2, 1], axes[2, 2] = other


@kernel()
def spread_along(s, x, y, z):
    """Return sqrt(a S a)."""
    square = x * (s[0, 0] * x + 2.0 * (s[0, 1] * y + s[0, 2] * z))
    square += y * (s[1, 1] * y + 2.0 * s[1, 2] * z) + z * s[2, 2] * z
    return sqrt(max(square, 0.0))


@kernel()
def cholesky(s, root):
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
        best_plane(shape, faces, r, s, many, True, best)
        if is_short(shape, faces, r, s, many, best):
            cholesky(s, root)
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


@kernel(void(int64, ROWS, ROWS, float64[:, :, ::1], float64, float64[::1], ROWS))
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
