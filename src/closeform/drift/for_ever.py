"""What comes after the first hundred orbits of drift, for ever.

Natural motion is an ellipse that drifts along the track, so that each orbit repeats the one before it,
moved on by the same way.  A cell of failures is clear for good if it is in the first few steps of the
march; or if its ellipses stay clear for one orbit of all that lies before them where they drift to, and
behind them too if they may drift either way.  Others are cut, down to those that do not drift.  Slower
and slower drifts beside such a one meet the zone's shadow along the track, the *tube*, in phases that are
closer and closer, and the least norm there is what theirs tend to.                    # theory (49)
"""

from math import acos, atan2, inf, nan, pi, sqrt

from closeform.compiled import kernel
from closeform.drift.cells import FROM, SIDE, parameter_count, single, span_both
from closeform.drift.fans import GENERATORS, OTHER, open_window
from closeform.drift.flown import NEAR, aim, cut, fly, near_by, note, target_below
from closeform.drift.planes import EITHER_WAY, march
from closeform.zones.shapes import BALL, FACES

FEW = 60  # steps of the march, after which a cell is cut, or gone on with
STILL = 1e-3  # of a zone: an ellipse that drifts by less in all of the time is closed
# Cells of balls, and of other zones, after which less is asked; the least norm of half-spaces is without a
# bound then, as the track may lead into them.
ENOUGH, LESS = (5_000, 1_000), (10.0, 100.0)
TURNS = 16  # between what is ahead of a zone and what is behind it, in one orbit
BESIDE = 1e-3  # of a cell: so far off a failure that does not drift others are asked which way they do


@kernel()
def along_track(matrix):
    """The direction of the track in zone coordinates, and its length there squared."""
    x, y, z = matrix[0, 1], matrix[1, 1], matrix[2, 1]
    return (x, y, z), x * x + y * y + z * z


@kernel()
def is_tube(tube):
    """Whether a form is a tube along the track; that of half-spaces may be these themselves."""
    return tube[0] != FACES or along_track(tube[1])[1] == 0.0


@kernel()
def drift_of(q, n, direction, square):
    """The drift along the track of one motion [m/s]."""
    x, y, z = q[1, 0] + q[3, 0] / (n * n), q[1, 1] + q[3, 1] / (n * n), q[1, 2] + q[3, 2] / (n * n)
    return (x * direction[0] + y * direction[1] + z * direction[2]) / square


@kernel()
def drift_range(one, two, cell, width, far, n, form, rest, room):
    """Least and greatest drift along the track in a cell [m/s]."""
    direction, square = along_track(form[1])
    window, _ = open_window(one, two, cell, width, cell[FROM], far, n, 4, rest[3], form, room)
    low, high, least, most = inf, -inf, inf, -inf
    for k in range(window.ones):
        drift = drift_of(room.motions[k], n, direction, square)
        low, high = min(low, drift), max(high, drift)
    for k in range(OTHER, OTHER + window.twos):
        drift = drift_of(room.motions[k], n, direction, square)
        least, most = min(least, drift), max(most, drift)
    low, high = low - most, high - least
    for k in range(GENERATORS, window.last):
        drift = drift_of(room.motions[k], n, direction, square)
        low, high = low + min(0.0, drift), high + max(0.0, drift)
    off = 6.0 * n * rest[0] + 3.0 * rest[1]
    return low - off, high + off


@kernel()
def drift_at(one, two, cell, width, far, n, form, room):
    """The drift along the track of the failure at `shares` of a cell [m/s]; its motion is seen."""
    aim(one, two, cell, width, inf, room)
    point = room.point[0]
    single(one, point, SIDE, n, room.rows[0])
    single(two, point, SIDE + width, n, room.rows[1])
    open_window(one, two, point, width, cell[FROM], far, n, 1, cell[FROM], form, room)
    direction, square = along_track(form[1])
    return drift_of(room.motions[0], n, direction, square)


@kernel()
def stand_still(one, two, cell, width, far, n, form, slow, count, room):
    """Move `shares` of a cell to a failure that does not drift, one after another; whether one is there."""
    drift = drift_at(one, two, cell, width, far, n, form, room)
    for k in range(count):
        if abs(drift) <= slow:
            return True
        here, kept, end = room.shares[k], drift, room.shares[k]
        for side in range(2):
            room.shares[k] = float(side)
            there = drift_at(one, two, cell, width, far, n, form, room)
            if abs(there) <= slow:
                return True
            if (there > 0.0) != (drift > 0.0):
                low, high = here, float(side)
                for _ in range(100):
                    room.shares[k] = 0.5 * (low + high)
                    middle = drift_at(one, two, cell, width, far, n, form, room)
                    if (middle > 0.0) == (drift > 0.0):
                        low = room.shares[k]
                    else:
                        high = room.shares[k]
                return True
            if abs(there) < abs(kept):
                kept, end = there, float(side)
        room.shares[k], drift = end, kept
    return abs(drift_at(one, two, cell, width, far, n, form, room)) <= slow


@kernel()
def limit_ahead(one, two, t, width, n, form, tube, way, room, best):
    """Least norm of all that is ahead of a closed ellipse, the failure `room.point[0]`, if below `best`.

    Along the track it is at a - size cos(n t - middle).  In the half in which that is before the zone all
    that is ahead is in the tube; where it is past it only where it is counts.
    """
    point = room.point[0]
    open_window(one, two, point, width, t, t, n, 1, t, form, room)
    q, (direction, square) = room.motions[0], along_track(form[1])
    a, c, s = 0.0, 0.0, 0.0
    for axis in range(3):
        share = direction[axis] / square
        a += share * (q[0, axis] + q[2, axis] / (n * n))
        c += share * q[2, axis] / (n * n)
        s += share * q[3, axis] / (n * n * n)
    size, middle = sqrt(c * c + s * s), atan2(s, c)
    behind = acos(max(-1.0, min(a / size, 1.0))) if size > abs(a) else (0.0 if a > 0.0 else pi)
    begin = t + ((middle - behind) % (2.0 * pi)) / n
    for k in range(2):
        end = begin + 2.0 * (behind if k == 0 else pi - behind) / n
        if end > begin:
            seen = tube if (way > 0.0) == (k == 0) else form
            best = fly(one, two, point, width, begin, end, n, seen, room, best)[0]
        begin = end
    return best


@kernel()
def stays_behind(one, two, cell, width, n, form, scale, tube, target, rest, away, room):
    """Whether all that is ahead of a cell's ellipses is clear, for one orbit and so for good.

    Where they are before the zone that is the tube; where they are past it, planes that lead away.  Of
    half-spaces, which have no tube that tells more than whether it is entered, such planes alone.
    """
    start = cell[FROM]
    turn, clear, t = start + 2.0 * pi / n, False, start
    if not is_tube(tube):
        return march(one, two, cell, width, turn, n, form, scale, target, -1.0, rest, -1, away, room)[1]
    for _ in range(TURNS):
        t, clear, _ = march(
            one, two, cell, width, turn, n, tube, scale, target, -1.0, rest, -1, EITHER_WAY, room
        )
        if clear:
            break
        cell[FROM] = t
        after, clear, _ = march(
            one, two, cell, width, turn, n, form, scale, target, -1.0, rest, -1, away, room
        )
        if clear or after <= t:
            break
        cell[FROM] = after
    cell[FROM] = start
    return clear


@kernel()
def ways_from(one, two, cell, width, far, n, form, slow, count, room):
    """Whether failures beside the one at `shares`, that does not drift, do so forward, and backward."""
    forward, backward = False, False
    for step in (BESIDE, 1.0):
        for k in range(count):
            share = room.shares[k]
            for sign in (-1.0, 1.0):
                room.shares[k] = min(max(share + sign * step, 0.0), 1.0)
                drift = drift_at(one, two, cell, width, far, n, form, room)
                forward, backward = forward or drift > slow, backward or drift < -slow
            room.shares[k] = share
        if forward or backward:
            break
    drift_at(one, two, cell, width, far, n, form, room)
    return forward, backward


@kernel()
def limit_of(one, two, cell, width, slow, far, n, form, tube, count, room, best):
    """What the norms of slower and slower drifts in a cell tend to, if below `best`, at `shares` of it.

    Where they drift but one way only what is ahead counts.
    """
    if not stand_still(one, two, cell, width, far, n, form, slow, count, room):
        return inf
    forward, backward = ways_from(one, two, cell, width, far, n, form, slow, count, room)
    t, turn = cell[FROM], cell[FROM] + 2.0 * pi / n
    if not (forward or backward):
        return inf
    if forward != backward:
        return limit_ahead(one, two, t, width, n, form, tube, 1.0 if forward else -1.0, room, best)
    return fly(one, two, room.point[0], width, t, turn, n, tube, room, best)[0]


@kernel()
def is_clear(one, two, cell, width, low, high, slow, n, form, scale, tube, target, rest, room):
    """Whether a cell is clear for good by what it does in one orbit, as it drifts."""
    direction, _ = along_track(form[1])
    way = 0.0
    if low >= -slow:
        way = 1.0
    elif high <= slow:
        way = -1.0
    if way != 0.0:
        away = (way * direction[0], way * direction[1], way * direction[2])
        return stays_behind(one, two, cell, width, n, form, scale, tube, target, rest, away, room)
    if not is_tube(tube):
        return False
    turn = cell[FROM] + 2.0 * pi / n
    return march(one, two, cell, width, turn, n, tube, scale, target, -1.0, rest, -1, EITHER_WAY, room)[1]


@kernel()
def search_tail(one, two, top, width, far, n, form, scale, tube, floor, certain, room, best):
    """Least norm after the first hundred orbits, if below `best`: its time, and how certain it is.

    The time is inf where slower and slower drifts tend to it, and nan where nothing is below.  The
    failure stands in `room.point[1]`; a time of -inf asks for more room.
    """
    when, spent = nan, 0
    kind = 0 if form[0] == BALL else 1
    count = parameter_count(one) + parameter_count(two)
    _, square = along_track(form[1])
    while top > 0:
        spent += 1
        if spent > ENOUGH[kind]:
            if not is_tube(tube):
                return best, when, inf
            if certain == 0.0:
                return 1.0, inf, 0.0
            certain, spent = LESS[kind] * certain, 0
        target = target_below(best, certain)
        if certain > 1.0 or target <= floor:
            break
        top -= 1
        cell = room.cells[top]
        rest = span_both(one, two, cell, width, n, room.rows)
        low, high, slow = 0.0, 0.0, 0.0
        if square > 0.0:
            low, high = drift_range(one, two, cell, width, far, n, form, rest, room)
            slow = STILL / (sqrt(square) * (far - cell[FROM]))
        if low >= -slow and high <= slow:
            continue
        if is_clear(one, two, cell, width, low, high, slow, n, form, scale, tube, target, rest, room):
            continue
        t, clear, near = march(
            one, two, cell, width, far, n, form, scale, target, best, rest, FEW, EITHER_WAY, room
        )
        if clear:
            continue
        begin, stop = near_by(one, two, cell, width, t, near, far, n, count, room)
        if not is_tube(tube):  # it only sinks on the way there
            begin = max(begin, near - NEAR / n)
        least, time = fly(one, two, room.point[0], width, begin, stop, n, form, room, best)
        if least < best:
            best, when = least, time
            note(room, room.point[0])
            if not is_tube(tube) and time > far - 2.0 * pi / n:
                return best, when, inf
            if certain == 0.0:
                break
        if low <= slow and high >= -slow and is_tube(tube):
            least = limit_of(one, two, cell, width, slow, far, n, form, tube, count, room, best)
            if least < best:
                best, when = least, inf
                note(room, room.point[0])
                if certain == 0.0:
                    break
        if top + 2 > len(room.cells):
            return best, -inf, certain
        parts = cut(one, two, width, top, t, room, count) if count > 0 else top
        if parts == top:  # all in it is one failure
            cell[FROM] = max(t, stop)
            parts += cell[FROM] < far
        top = parts
    return best, when, certain
