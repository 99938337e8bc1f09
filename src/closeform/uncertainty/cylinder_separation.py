"""Best separating plane between a zone and an ellipsoid, also of cylinders: at the side, an end or a rim."""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix
from closeform.uncertainty.planes import flat_plane, room, round_plane, times
from closeform.zones.shapes import BALL, FACES

ROUNDING = 1e-15  # relative rounding of the terms of g


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
        g, _, _, height = room(r, s, k, x, y, 0.0)
        best[0], best[1], best[2], best[3] = x, y, 0.0, g
        if abs(height) <= g:
            return
    g, px, py, _ = room(r, s, k, 0.0, 0.0, up)
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
        _, _, _, height = room(r, s, k, best[0], best[1], best[2])
        if best[2] * up > 0.0 and abs(best[2]) < 1.0 and height * up > 0.0:
            break
        up = -up


@kernel()
def rim_start(r, s, k, up, x, y, g):
    """Return a share of the side's plane (x, y) from which to climb: one with more than g, or the best.

    Between the plane of the side and that of the end g is concave.
    """
    most, share, tried = -inf, 0.5, 0.5
    for m in range(50):
        found, _, _, _ = room(r, s, k, tried * x, tried * y, up * (1.0 - tried))
        if found > most:
            most, share = found, tried
        if most > g:
            break
        tried = 0.5 * (1.0 - tried) if m % 2 == 0 else 1.0 - tried
    return share


@kernel()
def climb_rim(r, s, k, up, share, x, y, best):
    """Maximize g over a = (x, y, up (1 - hypot(x, y))) from a share of (x, y), by Newton's method.

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
                gained, px, py, pz = room(r, s, k, tx, ty, up * (1.0 - size))
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
        rounding = ROUNDING * (abs(g) + curve * (s[0, 0] + s[1, 1] + s[2, 2]))
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
def plane(shape, faces, r, s, k, fine, best):
    """Fill `best` (4,) with the best plane and its g; without `fine`, with an approximation."""
    if shape == FACES:
        flat_plane(faces, r, s, k, fine, best)
    elif shape == BALL:
        best[0], best[1], best[2] = round_plane(r[0], r[1], r[2], s, k, fine)
        best[3] = room(r, s, k, best[0], best[1], best[2])[0]
    else:
        cylinder_plane(r, s, k, fine, best)
