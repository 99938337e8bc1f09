"""Separating planes between a unit zone at the origin and an ellipsoid: the one with the largest gap.

The ellipsoid is that of k sigmas about r, with covariance S. Over all a on the zone's polar set (where the
largest a . q of the zone is 1: |a| = 1 for a ball, mixtures of the faces for half-spaces, hypot(a_0, a_1) +
|a_2| = 1 for a cylinder) the best plane has the largest

    g = a . r - k sqrt(a S a)                                                        # theory (52)

which is the minimum norm of the ellipsoid's points, at p = r - k S a / sqrt(a S a). Any other a gives less,
so that g above 1 is a proof for any a. A cube is represented by six faces.
"""

from math import inf, sqrt

import numpy as np

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import stack_matrix
from closeform.zones.shapes import CUBE, FACES
from closeform.zones.zone import Zone

CUBE_FACES = np.concatenate([np.eye(3), -np.eye(3)])

SETTLED = 1e-13  # relative gain of a plane below which it is rounding
SKETCHED = 1e-4  # the same where an approximate plane suffices


def faced(zone: Zone) -> tuple[int, Floats, Floats]:
    """Return a zone's `form` for the search of planes, with a cube as six faces."""
    return (FACES, zone.matrix, CUBE_FACES) if zone.shape == CUBE else zone.form


@kernel()
def times(s, x, y, z):
    """Return the product of a symmetric matrix (3, 3) and a vector."""
    return (
        s[0, 0] * x + s[0, 1] * y + s[0, 2] * z,
        s[0, 1] * x + s[1, 1] * y + s[1, 2] * z,
        s[0, 2] * x + s[1, 2] * y + s[2, 2] * z,
    )


@kernel()
def room(r, s, k, x, y, z):
    """Return g of (x, y, z) and the point p at which it is attained; p = r without uncertainty."""
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
    """Return the best unit normal a for a ball: along p = rho w, w = (S + rho I)^-1 r, sqrt(w S w) = k.

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
    """Return the share of the row g in the best plane between rows f and g; -1 if no mixture is best."""
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
        g, _, _, _ = room(r, s, k, faces[m, 0], faces[m, 1], faces[m, 2])
        if g > best[3]:
            best[0], best[1], best[2], best[3] = faces[m, 0], faces[m, 1], faces[m, 2], g
    copy_row(best, active[0])
    count = 1
    for _ in range(40):
        _, px, py, pz = room(r, s, k, best[0], best[1], best[2])
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
                copy_row(active[i], chosen[0])
                found = 1
        for i in range(count):
            for j in range(i):
                share, other = mixture_of_three(added, active[i], active[j], r, s, k)
                mixed = share > 0.0 and other > 0.0 and share + other < 1.0
                if mixed and try_mixture(added, active[i], active[j], share, other, r, s, k, best):
                    copy_row(active[i], chosen[0])
                    copy_row(active[j], chosen[1])
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
            copy_row(chosen[i], active[i])
        copy_row(added, active[found])
        count = found + 1


@kernel()
def try_mixture(f, g, h, share, other, r, s, k, best):
    """Return True if a mixture of three rows is better than the best so far, which it then replaces."""
    rest = 1.0 - share - other
    x = rest * f[0] + share * g[0] + other * h[0]
    y = rest * f[1] + share * g[1] + other * h[1]
    z = rest * f[2] + share * g[2] + other * h[2]
    found, _, _, _ = room(r, s, k, x, y, z)
    if found <= best[3]:
        return False
    best[0], best[1], best[2], best[3] = x, y, z, found
    return True


@kernel()
def copy_row(source, target):
    """Copy a vector of three components."""
    for i in range(3):
        target[i] = source[i]
