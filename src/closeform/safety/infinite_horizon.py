"""Drift without an end, after the first hundred orbits.

Natural motion is an ellipse that drifts along the track, so that each orbit repeats the previous one,
shifted by a constant step.  A cell of failures is clear for good if the first few steps of the march show it;
or if its ellipses stay clear for one orbit of the region ahead of them in the direction of drift, and of
the region behind them too if they may drift in either sense.  Others are divided, down to those without
drift.  Next to these, slow drifts pass the zone's *shadow* along the track in phases that are ever closer,
and the minimum norm in the shadow is the limit of theirs.                             # theory (49)
"""

from math import acos, atan2, inf, nan, pi, sqrt

from numba import float64, void

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, lent
from closeform.motion.arc import START
from closeform.safety.failure_cells import (
    FIRST,
    FROM,
    choose,
    column_of,
    parameter_count,
    single_failure,
    span_both,
)
from closeform.safety.failure_motions import GENERATORS, OTHER, ROOM_TYPE, open_window
from closeform.safety.failure_search import ACCURACY, FAILURE, RATIO, TASK, TIME, fill_cells, store_result
from closeform.safety.separating_planes import EITHER_WAY, march
from closeform.safety.shadow import along_track, is_shadow
from closeform.safety.single_failures import NEAR, aim, cut, near_by, note, propagate, target_below
from closeform.zones.shapes import BALL

BESIDE = 1e-3  # of a cell: distance from a failure without drift at which the direction of drifts is sampled
SHORTEST = 1e-9  # of a cell: smallest step along failures without drift
FEW = 60  # steps of the march after which a cell is divided or continued
STILL = 1e-3  # of a zone: an ellipse that drifts by less in the whole time is closed
# Cells of balls, of other zones, and of these for a minimum norm over several unknowns, after which the
# accuracy is reduced; for half-spaces that the track leads into the norm then has no bound.
ENOUGH, LESS = (5_000, 1_000, 4_000), (10.0, 100.0, 100.0)
TURNS = 16  # alternations between the regions ahead of a zone and behind it, in one orbit


@kernel()
def drift_of(q, n, direction, square):
    """Return the drift along the track of one motion [m/s]."""
    x, y, z = q[1, 0] + q[3, 0] / (n * n), q[1, 1] + q[3, 1] / (n * n), q[1, 2] + q[3, 2] / (n * n)
    return (x * direction[0] + y * direction[1] + z * direction[2]) / square


@kernel(inline=True)
def drift_range(one, two, cell, far, n, form, rest, room):
    """Return the minimum and maximum drift along the track in a cell, and the error of `drifts` [m/s]."""
    direction, square = along_track(form[1])
    window, _ = open_window(one, two, cell, cell[FROM], far, n, 4, rest[3], form, room)
    low, high, least, most, drifts = inf, -inf, inf, -inf, room.drifts
    for k in range(window.ones):
        drifts[k] = drift_of(room.motions[k], n, direction, square)
        low, high = min(low, drifts[k]), max(high, drifts[k])
    for k in range(OTHER, OTHER + window.twos):
        drifts[k] = drift_of(room.motions[k], n, direction, square)
        least, most = min(least, drifts[k]), max(most, drifts[k])
    low, high = low - most, high - least
    for k in range(GENERATORS, window.last):
        drifts[k] = drift_of(room.motions[k], n, direction, square)
        low, high = low + min(0.0, drifts[k]), high + max(0.0, drifts[k])
    off = 6.0 * n * rest[0] + 3.0 * rest[1]
    return low - off, high + off, off


@kernel()
def drift_at(one, two, cell, far, n, form, room):
    """Return the drift along the track [m/s] of the failure at `shares` of a cell, and open its window."""
    aim(one, two, cell, inf, room)
    point = room.point[0]
    single_failure(one, point, n, room.rows[0])
    single_failure(two, point, n, room.rows[1])
    open_window(one, two, point, cell[FROM], far, n, 1, cell[FROM], form, room)
    direction, square = along_track(form[1])
    return drift_of(room.motions[0], n, direction, square)


@kernel()
def remove_drift_by(one, two, cell, far, n, form, slow, m, room):
    """Move the m-th of `shares` to a failure without drift, or the slowest; return True if there is one."""
    room.shares[m] = 0.0
    low, before = 0.0, drift_at(one, two, cell, far, n, form, room)
    room.shares[m] = 1.0
    high, after = 1.0, drift_at(one, two, cell, far, n, form, room)
    if (before > 0.0) == (after > 0.0):
        room.shares[m] = 0.0 if abs(before) < abs(after) else 1.0
        return min(abs(before), abs(after)) <= slow
    for turn in range(100):
        at = low + (high - low) * before / (before - after)
        if turn % 3 == 2 or not low < at < high:
            at = 0.5 * (low + high)
        room.shares[m] = at
        drift = drift_at(one, two, cell, far, n, form, room)
        if abs(drift) <= slow or high - low < SHORTEST:
            break
        if (drift > 0.0) == (before > 0.0):
            low, before = at, drift
        else:
            high, after = at, drift
    return True


@kernel()
def remove_drift(one, two, cell, far, n, form, slow, count, room):
    """Move `shares` of a cell, one after another, to a failure without drift; return True if there is one."""
    if abs(drift_at(one, two, cell, far, n, form, room)) <= slow:
        return True
    for k in range(count):
        if remove_drift_by(one, two, cell, far, n, form, slow, k, room):
            return True
    return False


@kernel(inline=True)
def limit_ahead(one, two, t, n, form, shadow, way, room, best):
    """Return the minimum norm of the region ahead of a closed ellipse, `room.point[0]`, if below `best`.

    Along the track the motion is at a - size cos(n t - middle). In the half before the zone all that is ahead
    is the shadow; in the half past it only the position itself counts.
    """
    point = room.point[0]
    open_window(one, two, point, t, t, n, 1, t, form, room)
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
            seen = shadow if (way > 0.0) == (k == 0) else form
            best = propagate(one, two, point, begin, end, n, seen, room, best)[0]
        begin = end
    return best


@kernel(inline=True)
def ways_from(one, two, cell, far, n, form, slow, count, room):
    """Return True for each sense of drift, forward and backward, of failures near the one at `shares`."""
    forward, backward = False, False
    for step in (BESIDE, 1.0):
        for k in range(count):
            share = room.shares[k]
            for sign in (-1.0, 1.0):
                room.shares[k] = min(max(share + sign * step, 0.0), 1.0)
                drift = drift_at(one, two, cell, far, n, form, room)
                forward, backward = forward or drift > slow, backward or drift < -slow
            room.shares[k] = share
        if forward or backward:
            break
    drift_at(one, two, cell, far, n, form, room)
    return forward, backward


@kernel(inline=True)
def limit_of(one, two, cell, slow, far, n, form, shadow, count, room, best):
    """Return the limit of the norms of ever slower drifts in a cell, if below `best`, at `shares` of it.

    Where they drift in only one sense, only the region ahead counts.
    """
    if not remove_drift(one, two, cell, far, n, form, slow, count, room):
        return inf
    forward, backward = ways_from(one, two, cell, far, n, form, slow, count, room)
    t, turn = cell[FROM], cell[FROM] + 2.0 * pi / n
    if not (forward or backward):
        return inf
    if forward != backward:
        return limit_ahead(one, two, t, n, form, shadow, 1.0 if forward else -1.0, room, best)
    return propagate(one, two, room.point[0], t, turn, n, shadow, room, best)[0]


@kernel(inline=True)
def limit_downhill(one, two, cell, slow, far, n, form, shadow, room, best):
    """Return the minimum of the limits of slow drifts along failures without drift from `room.point[1]`.

    Of two unknowns one is moved, by steps that grow downhill and turn back smaller uphill, and the other
    follows so that the failure does not drift; both stay inside the cell.
    """
    t, turn = cell[FROM], cell[FROM] + 2.0 * pi / n
    for k in range(2):
        low, high = cell[column_of(one, two, k)], cell[column_of(one, two, k) + 1]
        if not low < high:
            continue
        here, step = (room.point[1, column_of(one, two, k)] - low) / (high - low), 0.1
        while abs(step) > SHORTEST:
            share, least = min(max(here + step, 0.0), 1.0), inf
            room.shares[k] = share
            if share != here and remove_drift_by(one, two, cell, far, n, form, slow, 1 - k, room):
                drift_at(one, two, cell, far, n, form, room)
                least = propagate(one, two, room.point[0], t, turn, n, shadow, room, best)[0]
            if least < best:
                best, here = least, share
                note(room, room.point[0])
                step *= 2.0
            else:
                step *= -0.3
    return best


@kernel(inline=True)
def stays_behind(one, two, cell, n, form, scale, shadow, target, rest, away, room):
    """Return True if the region ahead of a cell's ellipses is clear for one orbit, and so for good.

    Where they are before the zone the region is the shadow; where they are past it, planes that lead away
    bound it. Half-spaces without a useful shadow use such planes alone.
    """
    start = cell[FROM]
    turn, clear, t = start + 2.0 * pi / n, False, start
    if not is_shadow(shadow):
        return march(one, two, cell, turn, n, form, scale, target, -1.0, rest, -1, away, room)[1]
    before = (0.0, 0.0, 0.0, away[3], away[4])
    for _ in range(TURNS):
        t, clear, _ = march(one, two, cell, turn, n, shadow, scale, target, -1.0, rest, -1, before, room)
        if clear:
            break
        cell[FROM] = t
        after, clear, _ = march(one, two, cell, turn, n, form, scale, target, -1.0, rest, -1, away, room)
        if clear or after <= t:
            break
        cell[FROM] = after
    cell[FROM] = start
    return clear


@kernel(inline=True)
def is_clear(one, two, cell, low, high, off, slow, n, form, scale, shadow, target, rest, room):
    """Return True if one orbit shows that a cell is clear for good as it drifts."""
    (x, y, z), _ = along_track(form[1])
    forward, backward = high > slow, low < -slow
    if forward and backward:
        if not is_shadow(shadow):
            return False
        if parameter_count(one) + parameter_count(two) <= 1:
            turn = cell[FROM] + 2.0 * pi / n
            return march(one, two, cell, turn, n, shadow, scale, target, -1.0, rest, -1, EITHER_WAY, room)[1]
    for way in (1.0, -1.0):  # those that drift forward, and those backward
        if forward if way > 0.0 else backward:
            only = way if forward and backward else 0.0
            away = (way * x, way * y, way * z, only, abs(only) * off)
            if not stays_behind(one, two, cell, n, form, scale, shadow, target, rest, away, room):
                return False
    return True


@kernel(inline=True)
def search_tail(one, two, top, far, n, form, scale, shadow, floor, certain, room, best):
    """Return the minimum norm after the first hundred orbits, if below `best`, its time, and its accuracy.

    The time is inf where ever slower drifts approach the norm as a limit, and nan where none is below. The
    failure is stored in `room.point[1]`; a time of -inf requests more work space.
    """
    when, spent = nan, 0
    count = parameter_count(one) + parameter_count(two)
    kind = 0 if form[0] == BALL else (2 if count > 1 and certain > 0.0 else 1)
    _, square = along_track(form[1])
    while top > 0:
        spent += 1
        if spent > ENOUGH[kind]:
            if not is_shadow(shadow):
                return best, when, inf
            if certain == 0.0:
                return 1.0, inf, 0.0
            certain, spent = LESS[kind] * certain, 0
        target = target_below(best, certain)
        if certain > 1.0 or target <= floor:
            break
        top -= 1
        cell = room.cells[top]
        rest = span_both(one, two, cell, n, room.rows)
        low, high, off, slow = 0.0, 0.0, 0.0, 0.0
        if square > 0.0:
            low, high, off = drift_range(one, two, cell, far, n, form, rest, room)
            slow = STILL / (sqrt(square) * (far - cell[FROM]))
        if low >= -slow and high <= slow:
            continue
        if is_clear(one, two, cell, low, high, off, slow, n, form, scale, shadow, target, rest, room):
            continue
        t, clear, near = march(one, two, cell, far, n, form, scale, target, best, rest, FEW, EITHER_WAY, room)
        if clear:
            continue
        begin, stop = near_by(one, two, cell, t, near, far, n, count, room)
        if not is_shadow(shadow):  # it only decreases towards that time
            begin = max(begin, near - NEAR / n)
        least, time = propagate(one, two, room.point[0], begin, stop, n, form, room, best)
        if least < best:
            best, when = least, time
            note(room, room.point[0])
            if not is_shadow(shadow) and time > far - 2.0 * pi / n:
                return best, when, inf
            if certain == 0.0:
                break
        if low <= slow and high >= -slow and is_shadow(shadow):
            least = limit_of(one, two, cell, slow, far, n, form, shadow, count, room, best)
            if least < best:
                best, when = least, inf
                note(room, room.point[0])
                if certain == 0.0:
                    break
                if count == 2:
                    best = limit_downhill(one, two, cell, slow, far, n, form, shadow, room, best)
        if top + 2 > len(room.cells):
            return best, -inf, certain
        parts = cut(one, two, top, t, room, count) if count > 0 else top
        if parts == top:  # the cell is a single failure
            cell[FROM] = max(t, stop)
            parts += cell[FROM] < far
        top = parts
    return best, when, certain


@kernel(inline=True)
def continue_pair(one, two, end, n, form, scale, certain, most, shadow, floor, far, room, result):
    """Update the columns of the current pair, as `continue_failures`."""
    when, ratio, known = result[TIME], min(result[RATIO], most), result[ACCURACY]
    begin = max(one.arcs[one.now[FIRST], START], two.arcs[two.now[FIRST], START])
    if begin > end or ratio == -inf or (certain == 0.0 and when == when):
        return
    for c in range(room.point.shape[1]):
        room.point[1, c] = result[FAILURE + c]
    top = fill_cells(one, two, end, n, room.cells)
    ratio, later, late = search_tail(one, two, top, far, n, form, scale, shadow, floor, certain, room, ratio)
    if later == -inf:
        ratio, when = -inf, 2.0 * len(room.cells)
    elif later == later:
        when = later
    store_result(one, two, ratio, when, max(known, late), end, n, form, floor, room, result)


@kernel(void(*TASK, float64, ROOM_TYPE, float64[:, ::1]))
def continue_failures(
    one, two, first, second, ends, n, form, scale, certain, most, shadow, floor, far, room, out
):
    """Continue the drifts of `worst_failures` from their ends to the time `far`, and update `out`.

    Norms in the shadow have the time inf.
    """
    one, two, room, out = lent(one), lent(two), lent(room), borrowed(out)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    shadow = shadow[0], borrowed(shadow[1]), borrowed(shadow[2])
    for p in range(len(first)):
        choose(one, first[p])
        choose(two, second[p])
        continue_pair(one, two, ends[p], n, form, scale, certain, most, shadow, floor, far, room, out[p])
