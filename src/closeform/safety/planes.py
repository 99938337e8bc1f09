"""Planes that separate the motions of a cell from a zone: proof that no motion in their span meets it.

A plane separates them while

    min a.q_k - max a.w_m + sum min(0, a.g_j) > target + ball                          # theory (47)

for the gradient `a` of a part of the zone's norm.  Each term is the motion of one arc and obeys theory (10).
The sum is concave in time as long as its bounds hold.
"""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.motion.certified_march import bound
from closeform.motion.hill import oscillation
from closeform.safety.active_faces import EDGES, mixed_normal
from closeform.safety.edges import find_edges, nearest, norm_at, place_at, sink, widest
from closeform.safety.failure_cells import FROM
from closeform.safety.failure_family import GENERATORS, OTHER, PATH, next_seen, open_window, place_all
from closeform.safety.remainders import growth
from closeform.zones.shapes import BALL, CYLINDER, part, part_count, time_to_level

STEPS = 200  # in a window, before a cell is divided although planes still separate
LEAST_STEP = 2.3e-16
# No direction in which planes must lead away, no required sign of drifts, and no error of these.
EITHER_WAY = (0.0, 0.0, 0.0, 0.0, 0.0)


@kernel()
def project(room, window, ax, ay, az, lean):
    """Fill the terms of every motion along the sum of a plane's normal and `lean` times its drift.

    Returns the minimum sum.
    """
    least, most, rest = inf, -inf, 0.0
    k = 0
    while k < window.last:
        place, bend, q, term = room.places[k], room.bends[k], room.motions[k], room.terms[k]
        x = ax * place[0] + ay * place[1] + az * place[2] + lean * room.drifts[k]
        term[0] = x
        term[1] = ax * place[3] + ay * place[4] + az * place[5]
        term[2] = abs(ax) * bend[0] + abs(ay) * bend[1] + abs(az) * bend[2]
        term[3] = ax * q[2, 0] + ay * q[2, 1] + az * q[2, 2]
        term[4] = ax * q[3, 0] + ay * q[3, 1] + az * q[3, 2]
        if k < OTHER:
            least = min(least, x)
        elif k < PATH:
            most = max(most, x)
        else:
            rest += min(0.0, x)
        k = next_seen(window, k)
    return least - most + rest


@kernel()
def pair_step(gap, rate, bend, b, c, window, sine, cosine, wanted):
    """Return how long one motion provably stays above a plane, as a parabola or a drifting oscillation.

    `sine` (over n) and `cosine` are those of the time since the window's start.
    """
    h = time_to_level(gap, rate, bend)
    n = window.n
    if h >= wanted or window.order == 8 or n * wanted < 1.0:
        return h
    nn = n * n
    drift = rate + (c * cosine - nn * b * sine) / nn
    swing = sqrt(b * b + c * c / nn) / nn
    clear = gap + (b * cosine + c * sine) / nn - swing * (1.0 + 1e-12)
    if clear > 0.0:
        h = max(h, inf if drift >= 0.0 else clear / -drift)
    return h


@kernel()
def least_after(room, window, h):
    """Return a lower bound on the sum of all terms after a time h, without the level."""
    least, most, rest = inf, -inf, 0.0
    for k in range(window.last):
        term = room.terms[k]
        if k < window.ones:
            least = min(least, term[0] + h * (term[1] - 0.5 * h * term[2]))
        elif OTHER <= k < OTHER + window.twos:
            most = max(most, term[0] + h * (term[1] + 0.5 * h * term[2]))
        elif k >= GENERATORS:
            rest += min(0.0, term[0] + h * (term[1] - 0.5 * h * term[2]))
    return least - most + rest


@kernel()
def plane_step(room, window, level, local, wanted):
    """Return how long the whole set provably stays above a plane whose terms have been filled."""
    rest, slower, bends, h = 0.0, 0.0, 0.0, inf
    sine, versed, _ = oscillation(window.n, local)
    cosine = 1.0 - window.n * window.n * versed
    for j in range(GENERATORS, window.last):
        term = room.terms[j]
        rest, slower, bends = rest + min(0.0, term[0]), slower + min(0.0, term[1]), bends + term[2]
    for k in range(window.ones):
        one = room.terms[k]
        for m in range(OTHER, OTHER + window.twos):
            two = room.terms[m]
            gap, rate, bend = one[0] - two[0] - level + rest, one[1] - two[1], one[2] + two[2]
            if window.last == GENERATORS:
                b, c = one[3] - two[3], one[4] - two[4]
                h = min(h, pair_step(gap, rate, bend, b, c, window, sine, cosine, wanted))
            else:
                h = min(h, time_to_level(gap, rate + slower, bend + bends))
    if window.last > GENERATORS:  # not all of them turn at once; the sum is concave
        while 0.0 < h < wanted and least_after(room, window, 2.0 * h) >= level:
            h *= 2.0
    return h


@kernel()
def mixed_plane(room, count, form, x, y, z):
    """Return the mix of parts' normals for which the parallelotope is farthest, approximately.

    Parts are mixed in one after another, each to the share that makes an edge parallel to the plane: at a
    kink of the norm no part alone gives the distance of the set. Gradients are those at (x, y, z).
    """
    shape, _, faces = form
    edges = room.edges
    cx, cy, cz = place_at(room, count, 0.5)
    best, bx, by, bz = -inf, 0.0, 0.0, 0.0
    for turn in range(2):
        for k in range(part_count(shape, faces)):
            _, gx, gy, gz = part(shape, faces, k, x, y, z)
            ox, oy, oz = bx, by, bz
            for j in range(-1, count if turn > 0 else 0):
                mu = 1.0
                if j >= 0:
                    e = edges[j]
                    old = ox * e[0] + oy * e[1] + oz * e[2]
                    turned = old - (gx * e[0] + gy * e[1] + gz * e[2])
                    mu = old / turned if turned != 0.0 else 1.0
                    if not 0.0 < mu < 1.0:
                        continue
                ax, ay, az = ox + mu * (gx - ox), oy + mu * (gy - oy), oz + mu * (gz - oz)
                value = ax * cx + ay * cy + az * cz
                for m in range(count):
                    value -= 0.5 * abs(ax * edges[m, 0] + ay * edges[m, 1] + az * edges[m, 2])
                if value > best:
                    best, bx, by, bz = value, ax, ay, az
    return bx, by, bz


@kernel()
def best_plane(room, window, count, form, level, x, y, z, local, wanted, away):
    """Return how long the best plane, of a norm's parts or of their mix, separates, and its gap.

    The direction `away` must not lead back through the plane.
    """
    shape, _, faces = form
    longest, gap, parts = 0.0, -inf, part_count(shape, faces)
    for k in range(parts + 1):
        lean = 0.0
        if k < parts:
            _, ax, ay, az = part(shape, faces, k, x, y, z)
        elif 1 < count <= EDGES and (parts > 1 or away[3] != 0.0):
            ax, ay, az, lean = mixed_normal(room, count, form, x, y, z, away[3])
        elif parts > 1:
            ax, ay, az = mixed_plane(room, count, form, x, y, z)
        else:
            break
        if ax * away[0] + ay * away[1] + az * away[2] < 0.0:
            continue
        over = level + abs(lean) * away[4]
        above = project(room, window, ax, ay, az, lean) - over
        gap = max(gap, above)
        if above > 0.0:
            longest = max(longest, plane_step(room, window, over, local, wanted))
            if longest >= wanted:
                break
    return longest, gap


@kernel()
def sink_all(room, count, form):
    """Move `shares` to the minimum of the norm on the parallelotope."""
    x, y, z = nearest(room, count)
    if form[0] != BALL and 1 < count <= EDGES:
        mixed_normal(room, count, form, x, y, z, 0.0)
    elif form[0] != BALL:
        sink(room, count, form, 1e-8)


@kernel()
def deepest(one, two, room, window, local, form):
    """Return approximately the minimum norm of the parallelotope at one time of a window; fill `shares`."""
    place_all(room, window, local)
    count = find_edges(one, two, room, window)
    sink_all(room, count, form)
    return norm_at(room, count, form)


@kernel()
def valley(one, two, room, window, local, span, form):
    """Follow the minimum norm of the parallelotope downhill from a time of a window; return its time."""
    n = window.n
    low, value = local, deepest(one, two, room, window, local, form)
    step = 1e-3 / n if n > 0.0 else 1e-4 * span
    middle, high = local, local
    while high < span:  # downhill, in longer and longer steps
        high = min(span, middle + step)
        there = deepest(one, two, room, window, high, form)
        if there >= value:
            break
        low, middle, value = middle, high, there
        step *= 2.0
    fine = 1e-9 if form[0] == BALL else 1e-13  # a smooth minimum is flat, one at an edge is not
    for _ in range(60):
        if high - low <= fine * (span + local):
            break
        upper = high - middle > middle - low
        at = middle + 0.381966 * (high - middle) if upper else middle - 0.381966 * (middle - low)
        there = deepest(one, two, room, window, at, form)
        if there < value:
            if upper:
                low = middle
            else:
                high = middle
            middle, value = at, there
        elif upper:
            high = at
        else:
            low = at
    deepest(one, two, room, window, middle, form)
    return middle


@kernel()
def march(one, two, cell, width, end, n, form, scale, target, best, rest, most, away, room):
    """March until a cell is not provably clear of the zone enlarged by `target`.

    Returns time and True if clear.

    `rest` holds the deviation of motions from their span (see `span_both`). Where the march ends, `room`
    receives the edges of the set and its nearest point; if that is nearer than `best`, for the time at which
    it is nearest, which is the third result. The march takes at most `most` steps if that is not negative.
    The result also holds if all is moved in the direction `away` of zone coordinates. If a sign follows
    there, only failures that drift along the track with that sign are considered; the last number is the
    error of `room.drifts`.
    """
    t, taken = cell[FROM], 0
    place, speed, always, epoch = rest
    while True:
        window, stop = open_window(one, two, cell, width, t, end, n, 4, epoch, form, room)
        span = stop - t
        k = 0
        while k < window.last:
            for axis in range(3):
                room.bends[k, axis] = bound(room.motions[k], window.order, n, span, axis)[0]
            k = next_seen(window, k)
        for_place, for_speed = growth(n, stop - epoch)
        level = target + scale * (always + place * for_place + speed * for_speed)
        local, steps = 0.0, 0
        while True:
            place_all(room, window, local)
            count = find_edges(one, two, room, window)
            x, y, z = nearest(room, count)
            wanted = span - local
            h, gap = best_plane(room, window, count, form, level, x, y, z, local, wanted, away)
            if h == 0.0 and form[0] == CYLINDER:  # its gradient depends on the position
                sink(room, count, form, 1e-5)
                x, y, z = place_at(room, count, -1.0)
                h, gap = best_plane(room, window, count, form, level, x, y, z, local, wanted, away)
            steps, taken = steps + 1, taken + 1
            if taken == most:
                return t + local, False, t + local
            if h == 0.0 or (steps > STEPS and widest(room, count)[1] > gap):
                when = local
                if deepest(one, two, room, window, local, form) < best:
                    when = valley(one, two, room, window, local, span, form)
                return t + local, False, t + when
            if h >= wanted:
                break
            local += max(h, LEAST_STEP * (t + local))
        t = stop
        if t >= end:
            return t, True, t
