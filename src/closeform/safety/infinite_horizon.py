"""Search of unlimited drift, after the first hundred orbits.

Natural motion is an ellipse that drifts along the track, so that each orbit repeats the previous one,
shifted by a constant step.  A cell of failures is clear for good if the first few steps of the march show it;
or if its ellipses stay clear for one orbit of the region ahead of them in the direction of drift, and of
the region behind them too if they may drift in either sense.  Others are divided, down to those without drift
(see `bounded_motion_limits`).
"""

from math import inf, nan, pi, sqrt

from closeform._jit import kernel
from closeform.safety.active_faces import EDGES
from closeform.safety.bounded_motion_limits import along_track, drift_range, is_tube, limit_downhill, limit_of
from closeform.safety.failure_cells import FROM, parameter_count, span_both
from closeform.safety.failure_motion import NEAR, cut, near_by, note, propagate, target_below
from closeform.safety.planes import EITHER_WAY, march
from closeform.zones.shapes import BALL

FEW = 60  # steps of the march after which a cell is divided or continued
STILL = 1e-3  # of a zone: an ellipse that drifts by less in the whole time is closed
# Cells of balls, of other zones, and of these for a minimum norm over several unknowns, after which the
# accuracy is reduced; for half-spaces that the track leads into the norm then has no bound.
ENOUGH, LESS = (5_000, 1_000, 4_000), (10.0, 100.0, 100.0)
TURNS = 16  # alternations between the regions ahead of a zone and behind it, in one orbit


@kernel()
def stays_behind(one, two, cell, width, n, form, scale, tube, target, rest, away, room):
    """Return True if the region ahead of a cell's ellipses is clear for one orbit, and so for good.

    For motions before the zone the region is the tube; for motions past it, planes from which they drift away
    bound the region. Half-spaces without a useful tube use such planes alone.
    """
    start = cell[FROM]
    turn, clear, t = start + 2.0 * pi / n, False, start
    if not is_tube(tube):
        return march(one, two, cell, width, turn, n, form, scale, target, -1.0, rest, -1, away, room)[1]
    before = (0.0, 0.0, 0.0, away[3], away[4])
    for _ in range(TURNS):
        t, clear, _ = march(one, two, cell, width, turn, n, tube, scale, target, -1.0, rest, -1, before, room)
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
def is_clear(one, two, cell, width, low, high, off, slow, n, form, scale, tube, target, rest, room):
    """Return True if one orbit shows that a cell is clear for good as it drifts."""
    (x, y, z), _ = along_track(form[1])
    way = 0.0
    if low >= -slow:
        way = 1.0
    elif high <= slow:
        way = -1.0
    if way != 0.0:
        away = (way * x, way * y, way * z, 0.0, 0.0)
        return stays_behind(one, two, cell, width, n, form, scale, tube, target, rest, away, room)
    if not is_tube(tube):
        return False
    if not 1 < parameter_count(one) + parameter_count(two) <= EDGES:
        turn = cell[FROM] + 2.0 * pi / n
        return march(one, two, cell, width, turn, n, tube, scale, target, -1.0, rest, -1, EITHER_WAY, room)[1]
    for way in (1.0, -1.0):  # those that drift forward, and those backward
        away = (way * x, way * y, way * z, way, off)
        if not stays_behind(one, two, cell, width, n, form, scale, tube, target, rest, away, room):
            return False
    return True


@kernel()
def search_tail(one, two, top, width, far, n, form, scale, tube, floor, certain, room, best):
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
        low, high, off, slow = 0.0, 0.0, 0.0, 0.0
        if square > 0.0:
            low, high, off = drift_range(one, two, cell, width, far, n, form, rest, room)
            slow = STILL / (sqrt(square) * (far - cell[FROM]))
        if low >= -slow and high <= slow:
            continue
        if is_clear(one, two, cell, width, low, high, off, slow, n, form, scale, tube, target, rest, room):
            continue
        t, clear, near = march(
            one, two, cell, width, far, n, form, scale, target, best, rest, FEW, EITHER_WAY, room
        )
        if clear:
            continue
        begin, stop = near_by(one, two, cell, width, t, near, far, n, count, room)
        if not is_tube(tube):  # it only decreases towards that time
            begin = max(begin, near - NEAR / n)
        least, time = propagate(one, two, room.point[0], width, begin, stop, n, form, room, best)
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
                if count == 2:
                    best = limit_downhill(one, two, cell, width, slow, far, n, form, tube, room, best)
        if top + 2 > len(room.cells):
            return best, -inf, certain
        parts = cut(one, two, width, top, t, room, count) if count > 0 else top
        if parts == top:  # the cell is a single failure
            cell[FROM] = max(t, stop)
            parts += cell[FROM] < far
        top = parts
    return best, when, certain
