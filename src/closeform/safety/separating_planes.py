"""Planes that separate the motions of a cell from a zone: proof that no motion in their span meets it.

A plane with normal `a` separates them while

    min a.q_k - max a.w_m + sum min(0, a.g_j) > target + ball                          # theory (47)

with motions q_k of one spacecraft, w_m of the other, and burns g_j that may be missed.  Each term is the
motion of one arc, so that each obeys theory (10), and the sum is concave in time within the validity of its
bounds.  Candidates for `a` are the gradients of the parts of the zone's norm.  Where parts meet, their best
mix is the solution of a linear program (see `mixed_normal`) on the set of positions at one time, which is
taken as a parallelotope: a corner and one edge for each parameter of the failure.
"""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.motion.certified_march import bound
from closeform.motion.hill import oscillation
from closeform.safety.failure_cells import BURN, BURNS, FROM, INTACT, KIND, LOST, MISSED, STUCK
from closeform.safety.failure_motions import GENERATORS, OTHER, PATH, next_motion, open_window, place_all
from closeform.safety.remainders import growth
from closeform.zones.shapes import BALL, norm, part, part_count, time_to_level

PIVOTS, LEVEL = 8, 1e-14  # of the linear program: pivots for each share, and rounding
# Columns of `PairRoom.mix` after the normals: drift in a normal, its share and cost; the column to enter,
# the same in terms of the basis, and the multipliers.
LEAN, SHARE, COST, COLUMN, TURNED, MULTIPLIER = 3, 4, 5, 6, 7, 8
AGAINST = 1e-12  # of the drifts in a cell
STEPS = 200  # in a window, before a cell is divided although planes still separate
LEAST_STEP = 2.3e-16
TOUCH = 1e-11  # of a norm: a set at the surface of the zone, which is not followed further
FINE = 1e-10  # relative accuracy of the time at which a set is nearest
# No direction in which planes must lead away, no required sign of drifts, and no error of these.
EITHER_WAY = (0.0, 0.0, 0.0, 0.0, 0.0)


@kernel()
def find_edges(one, two, room, window):
    """Fill the edges of the set, one for each parameter of one side, then of the other.

    Returns their number.
    """
    edges, places, count = room.edges, room.places, 0
    for second in range(2):
        kind = two.now[KIND] if second else one.now[KIND]
        base = OTHER if second else 0
        sign = -1.0 if second else 1.0
        if kind == MISSED:
            first = window.generators if second else GENERATORS
            side = two if second else one
            for j in range(side.now[BURNS] - side.now[BURN]):
                for axis in range(3):
                    edges[count, axis] = places[first + j, axis]
                edges[count, 3] = room.drifts[first + j]
                count += 1
        elif kind != INTACT:
            for k in range(1 if kind == LOST else 2):
                corner = base + (3 if k == 0 else (8 if kind == STUCK else 4))
                for axis in range(3):
                    edges[count, axis] = sign * (places[corner, axis] - places[base, axis])
                edges[count, 3] = sign * (room.drifts[corner] - room.drifts[base])
                count += 1
    return count


@kernel()
def make_edges(one, two, room, window):
    """Replace the motions by that of a corner of the set followed by those of its edges.

    Returns their number.
    """
    count = 0
    for m in range(window.order):
        k = 0
        while k < window.last:
            for axis in range(3):
                room.places[k, axis] = room.motions[k, m, axis]
            k = next_motion(window, k)
        count = find_edges(one, two, room, window)
        for axis in range(3):
            room.motions[0, m, axis] = room.places[0, axis] - room.places[OTHER, axis]
            for j in range(count):
                room.motions[1 + j, m, axis] = room.edges[j, axis]
    return count


@kernel()
def place_at(room, count, share):
    """Return a point of the parallelotope: at `share` of all edges, or at `shares` if that is negative."""
    x = room.places[0, 0] - room.places[OTHER, 0]
    y = room.places[0, 1] - room.places[OTHER, 1]
    z = room.places[0, 2] - room.places[OTHER, 2]
    for k in range(count):
        by = share if share >= 0.0 else room.shares[k]
        x, y, z = x + by * room.edges[k, 0], y + by * room.edges[k, 1], z + by * room.edges[k, 2]
    return x, y, z


@kernel()
def nearest(room, count):
    """Return the point of a parallelotope nearest to the origin; `shares` receives its edge coordinates."""
    edges, shares = room.edges, room.shares
    x, y, z = place_at(room, count, -1.0)
    for _ in range(1 if count == 1 else 12):  # one coordinate after another
        moved = 0.0
        for k in range(count):
            ex, ey, ez = edges[k, 0], edges[k, 1], edges[k, 2]
            square = ex * ex + ey * ey + ez * ez
            if square > 0.0:
                share = min(1.0, max(0.0, shares[k] - (x * ex + y * ey + z * ez) / square))
                by = share - shares[k]
                x, y, z = x + by * ex, y + by * ey, z + by * ez
                shares[k] = share
                moved = max(moved, abs(by))
        if moved < 1e-3:
            break
    return x, y, z


@kernel()
def widest(room, count):
    """Return the index of the longest edge of a set, and its length."""
    which, longest = 0, 0.0
    for k in range(count):
        x, y, z = room.edges[k, 0], room.edges[k, 1], room.edges[k, 2]
        length = sqrt(x * x + y * y + z * z)
        if length > longest:
            which, longest = k, length
    return which, longest


@kernel()
def steepest(form, x, y, z):
    """Return the norm, and the gradient of its largest part."""
    shape, _, faces = form
    s, ax, ay, az = -inf, 0.0, 0.0, 0.0
    for k in range(part_count(shape, faces)):
        value, gx, gy, gz = part(shape, faces, k, x, y, z)
        if value > s:
            s, ax, ay, az = value, gx, gy, gz
    return s, ax, ay, az


@kernel()
def along(room, j, x, y, z):
    """Return the component of a direction along the j-th edge."""
    return x * room.edges[j, 0] + y * room.edges[j, 1] + z * room.edges[j, 2]


@kernel()
def begin_mix(room, count, x, y, z, cost):
    """Start with a basis of one normal with the whole share, and its components along the edges."""
    inverse, mix = room.inverse, room.mix
    for i in range(count + 1):
        mix[i, LEAN], mix[i, COST] = 0.0, 0.5
        for k in range(count + 1):
            inverse[i, k] = 0.0
        for axis in range(3):
            mix[i, axis] = 0.0
    inverse[0, 0], mix[0, SHARE], mix[0, COST] = 1.0, 1.0, cost
    mix[0, 0], mix[0, 1], mix[0, 2] = x, y, z
    for j in range(count):
        dot = along(room, j, x, y, z)
        sign = 1.0 if dot >= 0.0 else -1.0
        inverse[j + 1, 0], inverse[j + 1, j + 1], mix[j + 1, SHARE] = sign * dot, -sign, sign * dot


@kernel()
def exchange(room, size):
    """Bring `COLUMN` into the basis; return the index that it replaces, or -1 if the program is unbounded."""
    inverse, mix, row, least = room.inverse, room.mix, -1, inf
    for i in range(size):
        turned = 0.0
        for k in range(size):
            turned += inverse[i, k] * mix[k, COLUMN]
        mix[i, TURNED] = turned
        if turned > LEVEL and mix[i, SHARE] < least * turned:
            row, least = i, mix[i, SHARE] / turned
    if row >= 0:
        for k in range(size):
            inverse[row, k] /= mix[row, TURNED]
        for i in range(size):
            if i != row:
                mix[i, SHARE] = max(0.0, mix[i, SHARE] - least * mix[i, TURNED])
                for k in range(size):
                    inverse[i, k] -= mix[i, TURNED] * inverse[row, k]
        mix[row, SHARE] = least
    return row


@kernel()
def point_of(room, count):
    """Return the point of the basis, and the edge that it exceeds most, or -1.

    `MULTIPLIER` receives the norm and the point's shares of the edges from the centre.
    """
    x, y, z = place_at(room, count, 0.5)
    beyond, which, mix = 0.5 + LEVEL, -1, room.mix
    for k in range(count + 1):
        mix[k, MULTIPLIER] = 0.0
        for i in range(count + 1):
            mix[k, MULTIPLIER] -= mix[i, COST] * room.inverse[i, k]
    for j in range(count):
        share, edge = -mix[j + 1, MULTIPLIER], room.edges[j]
        x, y, z = x + share * edge[0], y + share * edge[1], z + share * edge[2]
        if abs(share) > beyond:
            beyond, which = abs(share), j
    return x, y, z, which


@kernel()
def leaning(room, count, way):
    """Return the weight of drift in the mix if a basis' point drifts against `way`, and the centre's drift.

    The weight is 0 elsewhere. It is scaled by the drifts of the edges, so that normals and drifts are of one
    size.
    """
    centre = room.drifts[0] - room.drifts[OTHER]
    drift, unit = centre, 0.0
    for j in range(count):
        centre += 0.5 * room.edges[j, 3]
        drift += (0.5 - room.mix[j + 1, MULTIPLIER]) * room.edges[j, 3]
        unit += abs(room.edges[j, 3])
    return -way / unit if way * drift < -AGAINST * unit else 0.0, centre


@kernel()
def mixed_normal(room, count, form, x, y, z, way):
    """Return the mix of normals and drift that keeps the parallelotope farthest, starting at (x, y, z).

    With normals g_k of the norm's parts, the centre c and the edges e_j, the shares l_k solve

        max sum l_k g_k.c - sum |w_j| / 2,   w_j = sum l_k g_k.e_j,   sum l_k = 1,   l >= 0     # theory (47a)

    which equals the minimum norm in the parallelotope.  The multipliers are a point, which `shares` receives;
    the steepest part of the norm at that point enters the basis next, round parts with their gradient there.
    A weaker condition suffices for failures that drift one `way`, 1 or -1, along the track: where the point
    drifts the other way, enough of the drift is mixed in to compensate it.                  # theory (49a)
    """
    mix, size = room.mix, count + 1
    cx, cy, cz = place_at(room, count, 0.5)
    _, ax, ay, az = steepest(form, x, y, z)
    begin_mix(room, count, ax, ay, az, -(ax * cx + ay * cy + az * cz))
    for _ in range(PIVOTS * size):
        px, py, pz, which = point_of(room, count)
        s, gx, gy, gz = steepest(form, px, py, pz)
        cost = -(gx * cx + gy * cy + gz * cz)
        lean, drift = leaning(room, count, way) if which < 0 else (0.0, 0.0)
        if which < 0 and lean == 0.0 and s - mix[0, MULTIPLIER] <= LEVEL * max(abs(s), 1.0):
            break
        mix[0, COLUMN] = 1.0 if which < 0 and lean == 0.0 else 0.0
        if lean != 0.0:
            gx, gy, gz, cost = 0.0, 0.0, 0.0, -lean * drift
        for j in range(count):
            mix[j + 1, COLUMN] = along(room, j, gx, gy, gz) + lean * room.edges[j, 3] if which < 0 else 0.0
        if which >= 0:  # first back into the parallelotope
            gx, gy, gz, cost = 0.0, 0.0, 0.0, 0.5
            mix[which + 1, COLUMN] = -1.0 if mix[which + 1, MULTIPLIER] > 0.0 else 1.0
        row = exchange(room, size)
        if row < 0:
            break
        mix[row, COST], mix[row, LEAN] = cost, lean
        mix[row, 0], mix[row, 1], mix[row, 2] = gx, gy, gz
    ax, ay, az, lean = 0.0, 0.0, 0.0, 0.0
    for i in range(size):
        share = mix[i, SHARE]
        ax, ay, az = ax + share * mix[i, 0], ay + share * mix[i, 1], az + share * mix[i, 2]
        lean += share * mix[i, LEAN]
    for j in range(count):
        room.shares[j] = min(max(0.5 - mix[j + 1, MULTIPLIER], 0.0), 1.0)
    return ax, ay, az, lean


@kernel()
def project(room, window, ax, ay, az, lean):
    """Fill the terms of every motion along a plane's normal and `lean` times its drift.

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
        k = next_motion(window, k)
    return least - most + rest


@kernel()
def pair_step(gap, rate, bend, b, c, window, sine, cosine, wanted):
    """Return the time that one motion provably stays above a plane, as a parabola or drifting oscillation.

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
    """Return the time for which the whole set provably stays above a plane whose terms have been filled."""
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
def best_plane(room, window, count, form, level, x, y, z, local, wanted, away):
    """Return the time for which the best plane of a norm's parts and of their mix separates, and the gap.

    The direction `away` must not point back through the plane.
    """
    shape, _, faces = form
    longest, gap, parts = 0.0, -inf, part_count(shape, faces)
    for k in range(parts + 1):
        lean = 0.0
        if k < parts:
            _, ax, ay, az = part(shape, faces, k, x, y, z)
        elif parts > 1 or (count > 1 and away[3] != 0.0):
            ax, ay, az, lean = mixed_normal(room, count, form, x, y, z, away[3])
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
def nearest_by_norm(room, count, form):
    """Return the point of the parallelotope with the minimum norm; fill `shares`."""
    x, y, z = nearest(room, count)
    if form[0] != BALL and count > 0:
        mixed_normal(room, count, form, x, y, z, 0.0)
        x, y, z = place_at(room, count, -1.0)
    return x, y, z


@kernel()
def deepest(one, two, room, window, local, form):
    """Return approximately the minimum norm of the parallelotope at one time of a window; fill `shares`."""
    place_all(room, window, local)
    count = find_edges(one, two, room, window)
    x, y, z = nearest_by_norm(room, count, form)
    return norm(form[0], form[2], x, y, z)


@kernel(inline=True)
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
    for _ in range(60):
        if high - low <= FINE * (span + local):
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
def march(one, two, cell, end, n, form, scale, target, best, rest, most, away, room):
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
        window, stop = open_window(one, two, cell, t, end, n, 4, epoch, form, room)
        span = stop - t
        k = 0
        while k < window.last:
            for axis in range(3):
                room.bends[k, axis] = bound(room.motions[k], window.order, n, span, axis)[0]
            k = next_motion(window, k)
        for_place, for_speed = growth(n, stop - epoch)
        level = target + scale * (always + place * for_place + speed * for_speed)
        local, steps = 0.0, 0
        while True:
            place_all(room, window, local)
            count = find_edges(one, two, room, window)
            x, y, z = nearest(room, count)
            wanted = span - local
            h, gap = best_plane(room, window, count, form, level, x, y, z, local, wanted, away)
            steps, taken = steps + 1, taken + 1
            if taken == most:
                return t + local, False, t + local
            if h == 0.0 or (steps > STEPS and widest(room, count)[1] > gap):
                when = local
                if deepest(one, two, room, window, local, form) < best - TOUCH:
                    when = valley(one, two, room, window, local, span, form)
                return t + local, False, t + when
            if h >= wanted:
                break
            local += max(h, LEAST_STEP * (t + local))
        t = stop
        if t >= end:
            return t, True, t
