"""Clearance of craft that coast: who would enter whose keep-out zone, and the least burn against it.

Relative motion is a straight line.  In zone coordinates (R = M r) the velocities that lead into
a ball are those within a cone about -R of half-angle asin(1 / |R|); the burn that leaves that
cone at least |delta-v| is sought along its generators.
"""

from math import asin, cos, inf, pi, sin, sqrt

from closeform.compiled import kernel

SPOKES = 48  # generators of the cone that are tried before the best is refined
REFINED = 40  # halvings


@kernel()
def times(matrix, x, y, z):
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
    )


@kernel()
def enters(box, matrix, r, v, duration):
    """Whether r + v t comes to a norm below 1 within (0, duration]; r, v (3,)."""
    if not box:
        rr = rv = vv = 0.0
        for k in range(3):
            x = matrix[k, 0] * r[0] + matrix[k, 1] * r[1] + matrix[k, 2] * r[2]
            u = matrix[k, 0] * v[0] + matrix[k, 1] * v[1] + matrix[k, 2] * v[2]
            rr += x * x
            rv += x * u
            vv += u * u
        if rv >= 0.0:
            return False
        t = min(duration, -rv / vv)
        return rr + (2.0 * rv + vv * t) * t < 1.0 and rr + rv * t < rr
    begin, end, closing = 0.0, duration, False
    for k in range(3):
        x = matrix[k, 0] * r[0] + matrix[k, 1] * r[1] + matrix[k, 2] * r[2]
        u = matrix[k, 0] * v[0] + matrix[k, 1] * v[1] + matrix[k, 2] * v[2]
        if x < 0.0:
            x, u = -x, -u
        closing = closing or (x >= 1.0 and u < 0.0)
        if u == 0.0:
            if x >= 1.0:
                return False
            continue
        one, other = (1.0 - x) / u, (-1.0 - x) / u
        begin, end = max(begin, min(one, other)), min(end, max(one, other))
    return closing and begin < end


@kernel()
def clear_of_all(box, matrix, craft, labels, i, velocity, duration, r, v):
    """Whether craft i, at this velocity, keeps clear of all of its set."""
    for m in range(len(labels)):
        if m != i and labels[m] == labels[i]:
            for k in range(3):
                r[k] = craft[i, k] - craft[m, k]
                v[k] = velocity[k] - craft[m, 3 + k]
            if enters(box, matrix, r, v, duration):
                return False
    return True


@kernel()
def along_generator(inverse, frame, tangent, angle, v, out):
    """The velocity along one generator of the cone that is nearest to v: its distance, itself in `out`."""
    ca, sa, ct, st = cos(angle), sin(angle), cos(tangent), sin(tangent)
    gv = gg = 0.0
    for k in range(3):
        out[k] = 0.0
        for m in range(3):
            g = ct * frame[0, m] + st * (ca * frame[1, m] + sa * frame[2, m])
            out[k] += inverse[k, m] * g
        gv += out[k] * v[k]
        gg += out[k] * out[k]
    scale = max(0.0, gv) / gg
    away = 0.0
    for k in range(3):
        out[k] *= scale
        away += (out[k] - v[k]) ** 2
    return away


@kernel()
def past(matrix, inverse, frame, r, v, out):
    """The nearest velocity to v that passes the ball |M r| = 1 tangentially, in `out`; False from inside."""
    bx, by, bz = times(matrix, -r[0], -r[1], -r[2])
    size = sqrt(bx * bx + by * by + bz * bz)
    if size <= 1.0:
        return False
    bx, by, bz = bx / size, by / size, bz / size
    # two axes that complete the one from the ball's centre, without loss of digits
    sign = 1.0 if bz >= 0.0 else -1.0
    u = -1.0 / (sign + bz)
    w = bx * by * u
    frame[0, 0], frame[0, 1], frame[0, 2] = bx, by, bz
    frame[1, 0], frame[1, 1], frame[1, 2] = 1.0 + sign * bx * bx * u, sign * w, -sign * bx
    frame[2, 0], frame[2, 1], frame[2, 2] = w, sign + by * by * u, -by
    tangent = asin(1.0 / size)
    best, at = inf, 0.0
    for s in range(SPOKES):
        away = along_generator(inverse, frame, tangent, 2.0 * pi * s / SPOKES, v, out)
        if away < best:
            best, at = away, 2.0 * pi * s / SPOKES
    step = pi / SPOKES
    for _ in range(REFINED):
        for side in (-step, step):
            away = along_generator(inverse, frame, tangent, at + side, v, out)
            if away < best:
                best, at = away, at + side
        step *= 0.5
    along_generator(inverse, frame, tangent, at, v, out)
    return True


@kernel()
def not_nearer(matrix, r, v, axis, out):
    """The nearest velocity to v that does not bring r nearer, in the norm or along one axis of it."""
    x, y, z = times(matrix, r[0], r[1], r[2])
    if axis >= 0:
        x, y, z = x * (axis == 0), y * (axis == 1), z * (axis == 2)
    wv = ww = 0.0
    for k in range(3):
        out[k] = x * matrix[0, k] + y * matrix[1, k] + z * matrix[2, k]
        wv += out[k] * v[k]
        ww += out[k] * out[k]
    closing = min(0.0, wv) / ww if ww > 0.0 else 0.0
    for k in range(3):
        out[k] = v[k] - closing * out[k]


AROUND, STOP, NOT_NEARER = -2, 3, -1  # ways of a burn; 0, 1, 2: not nearer along that axis


@kernel()
def correction(box, matrix, ball, inverse, craft, labels, i, duration, best, frame, scratch):
    """The least burn of craft i that keeps it clear of its set for `duration`: its size; velocity in `best`.

    0 where none is needed, inf where none was found among those that pass one of the others
    tangentially (a box: around the smallest ellipsoid that holds it), do not come nearer to it,
    or stop relative to it.  `ball` and its `inverse` are the zone, or that ellipsoid, enlarged.
    """
    r, v, out, tried = scratch[0], scratch[1], scratch[2], scratch[3]
    if clear_of_all(box, matrix, craft, labels, i, craft[i, 3:6], duration, r, v):
        return 0.0
    least = inf
    for m in range(len(labels)):
        if m == i or labels[m] != labels[i]:
            continue
        for way in range(AROUND, STOP + 1):
            for k in range(3):
                r[k] = craft[i, k] - craft[m, k]
                v[k] = craft[i, 3 + k] - craft[m, 3 + k]
                out[k] = 0.0
            if way == AROUND:
                if not past(ball, inverse, frame, r, v, out):
                    continue
            elif way == NOT_NEARER or (box and way != STOP):
                not_nearer(matrix, r, v, way, out)
            elif way != STOP:
                continue
            size = 0.0
            for k in range(3):
                size += (out[k] - v[k]) ** 2
                tried[k] = out[k] + craft[m, 3 + k]
            size = sqrt(size)
            if size < least and clear_of_all(box, matrix, craft, labels, i, tried, duration, r, v):
                least = size
                for k in range(3):
                    best[k] = tried[k]
    return least
