"""Collision avoidance in a gathering: the smallest burn that keeps a craft clear of all others of its set.

In zone coordinates (R = M r) the velocities that lead into a ball lie within a cone about -R of half-angle
asin(1 / |R|). The smallest burn that leaves this cone is found along its generators. A box is passed at one
of its edges.
"""

from math import asin, cos, inf, pi, sin, sqrt

from closeform._jit import kernel
from closeform.motion.linear import axes_across, times
from closeform.search.gathering.craft_state import ESTIMATE, VELOCITY
from closeform.search.gathering.keep_out_monitor import index_of_zone, within, zone_at

SPOKES = 48  # generators of the cone tried before the best is refined
REFINED = 40  # halvings of the angle between generators
ENLARGED = 1.0 + 1e-9  # factor on an avoided zone, so that rounding keeps the path clear of the zone itself
# kinds of burn relative to another craft; for a box, three axes from AROUND on, its edges from EDGES on
STOP, NOT_NEARER, AROUND, EDGES, WAYS = 0, 1, 2, 5, 17


@kernel()
def enters(zone, r, v, duration):
    """Return True if r + v t enters the zone, or approaches its centre if it begins inside."""
    x, y, z = times(zone.matrix, r[0], r[1], r[2])
    ux, uy, uz = times(zone.matrix, v[0], v[1], v[2])
    nears = x * ux + y * uy + z * uz < 0.0
    if zone.box:
        nears, farthest = False, max(abs(x), abs(y), abs(z))
        for s, u in ((x, ux), (y, uy), (z, uz)):
            nears = nears or (s * u < 0.0 and (abs(s) >= 1.0 or abs(s) == farthest))
    return nears and within(zone, r, v, duration)


@kernel()
def zone_of_set(zones, craft, i, m):
    """Return the index of the zone that craft i keeps to craft m of its set; -1 for none."""
    return index_of_zone(zones, i, m) if m != i and craft.labels[m] == craft.labels[i] else -1


@kernel()
def relative_state(craft, i, m, velocity, r, v):
    """Write the estimated state of craft i relative to craft m, if i had the estimated velocity."""
    one, other = craft.rows[i], craft.rows[m]
    for k in range(3):
        r[k] = one[k] + one[ESTIMATE + k] - (other[k] + other[ESTIMATE + k])
        v[k] = velocity[k] - (other[VELOCITY + k] + other[ESTIMATE + 3 + k])


@kernel()
def clear_of_all(zones, craft, i, velocity, duration, r, v):
    """Return True if craft i, with this velocity, keeps clear of all craft of its set."""
    for m in range(len(craft.labels)):
        which = zone_of_set(zones, craft, i, m)
        if which >= 0:
            relative_state(craft, i, m, velocity, r, v)
            if enters(zone_at(zones, which), r, v, duration):
                return False
    return True


@kernel()
def onto(g, v, out):
    """Write the point nearest to v on the half-line along g to `out`; return the squared distance."""
    scale = max(0.0, g[0] * v[0] + g[1] * v[1] + g[2] * v[2]) / (g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
    away = 0.0
    for k in range(3):
        out[k] = scale * g[k]
        away += (out[k] - v[k]) ** 2
    return away


@kernel()
def generator(half_axes, frame, tangent, angle, out):
    """Write the direction of one generator of the cone about frame[0] of half-angle `tangent` to `out`."""
    ca, sa, ct, st = cos(angle), sin(angle), cos(tangent), sin(tangent)
    gx = ct * frame[0, 0] + st * (ca * frame[1, 0] + sa * frame[2, 0])
    gy = ct * frame[0, 1] + st * (ca * frame[1, 1] + sa * frame[2, 1])
    gz = ct * frame[0, 2] + st * (ca * frame[1, 2] + sa * frame[2, 2])
    out[0], out[1], out[2] = times(half_axes, gx, gy, gz)


@kernel()
def past_ball(zone, r, v, out, scratch):
    """Write the velocity nearest to v that passes an ellipsoid tangentially to `out`; False from inside."""
    frame, g = scratch[5:8], scratch[3]
    bx, by, bz = times(zone.matrix, -r[0], -r[1], -r[2])
    size = sqrt(bx * bx + by * by + bz * bz)
    if size <= ENLARGED:
        return False
    bx, by, bz = bx / size, by / size, bz / size
    one, other = axes_across(bx, by, bz)
    frame[0, 0], frame[0, 1], frame[0, 2] = bx, by, bz
    frame[1, 0], frame[1, 1], frame[1, 2] = one
    frame[2, 0], frame[2, 1], frame[2, 2] = other
    tangent = asin(ENLARGED / size)
    best, at, stride = inf, 0.0, 2.0 * pi / SPOKES
    for s in range(SPOKES):
        generator(zone.half_axes, frame, tangent, stride * s, g)
        away = onto(g, v, out)
        if away < best:
            best, at = away, stride * s
    stride *= 0.5
    for _ in range(REFINED):
        for side in (-stride, stride):
            generator(zone.half_axes, frame, tangent, at + side, g)
            away = onto(g, v, out)
            if away < best:
                best, at = away, at + side
        stride *= 0.5
    generator(zone.half_axes, frame, tangent, at, g)
    onto(g, v, out)
    return True


@kernel()
def past_edge(half_axes, edge, r, v, out, scratch):
    """Write the velocity nearest to v in the plane sector from -r to one of the 12 box edges to `out`."""
    one, other, g = scratch[5], scratch[6], scratch[7]
    a = edge // 4
    b, c = (a + 1) % 3, (a + 2) % 3
    sb, sc = 1.0 - 2.0 * (edge & 1), 1.0 - (edge & 2)
    for k in range(3):
        middle = sb * half_axes[k, b] + sc * half_axes[k, c] - r[k]
        one[k], other[k] = middle - half_axes[k, a], middle + half_axes[k, a]
    nearest = onto(one, v, out)
    if onto(other, v, g) < nearest:
        for k in range(3):
            out[k] = g[k]
    aa = ab = bb = av = bv = 0.0
    for k in range(3):
        aa, ab, bb = aa + one[k] * one[k], ab + one[k] * other[k], bb + other[k] * other[k]
        av, bv = av + one[k] * v[k], bv + other[k] * v[k]
    p, q = av * bb - bv * ab, bv * aa - av * ab  # over the determinant, which is not negative
    if p > 0.0 and q > 0.0:
        for k in range(3):
            out[k] = (p * one[k] + q * other[k]) / (aa * bb - ab * ab)


@kernel()
def not_nearer(matrix, r, v, axis, out):
    """Write the velocity nearest to v that does not reduce the norm of r, or one axis of it, to `out`."""
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


@kernel()
def candidate(zone, way, r, v, out, scratch):
    """Write a relative velocity that may keep clear to `out`; False if there is none of this kind."""
    if way == STOP:
        out[0] = out[1] = out[2] = 0.0
    elif way == NOT_NEARER:
        not_nearer(zone.matrix, r, v, -1, out)
    elif not zone.box:
        return way == AROUND and past_ball(zone, r, v, out, scratch)
    elif way < EDGES:
        not_nearer(zone.matrix, r, v, way - AROUND, out)
    else:
        past_edge(zone.half_axes, way - EDGES, r, v, out, scratch)
    return True


@kernel()
def smallest_correction(zones, craft, i, duration, best, scratch):
    """Return the size of the smallest burn that keeps craft i clear of its set for `duration`.

    The estimated velocity goes to `best`. The result is 0 if no burn is needed, and inf if none was found
    among those that pass one of the others tangentially, do not approach it, or stop relative to it.
    """
    r, v, out, tried, velocity = scratch[0], scratch[1], scratch[2], scratch[4], scratch[10]
    for k in range(3):
        velocity[k] = craft.rows[i, VELOCITY + k] + craft.rows[i, ESTIMATE + 3 + k]
    if clear_of_all(zones, craft, i, velocity, duration, r, v):
        return 0.0
    least = inf
    for m in range(len(craft.labels)):
        which = zone_of_set(zones, craft, i, m)
        if which < 0:
            continue
        zone = zone_at(zones, which)
        for way in range(WAYS):
            relative_state(craft, i, m, velocity, r, v)
            if not candidate(zone, way, r, v, out, scratch):
                continue
            size = 0.0
            for k in range(3):
                size += (out[k] - v[k]) ** 2
                tried[k] = out[k] + craft.rows[m, VELOCITY + k] + craft.rows[m, ESTIMATE + 3 + k]
            size = sqrt(size)
            if size < least and clear_of_all(zones, craft, i, tried, duration, r, v):
                least = size
                for k in range(3):
                    best[k] = tried[k]
    return least
