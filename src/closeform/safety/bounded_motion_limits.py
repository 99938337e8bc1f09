"""Failures without drift along the track, and the limit of the norms of ever slower drifts next to them.

Slow drifts pass the zone's shadow along the track, the *tube*, in phases that are ever closer, and the
minimum norm in the tube is the limit of theirs.                                       # theory (49)
"""

from math import acos, atan2, inf, pi, sqrt

from closeform._jit import kernel
from closeform.safety.failure_cells import FROM, SIDE, column_of, single
from closeform.safety.failure_family import GENERATORS, OTHER, open_window
from closeform.safety.failure_motion import aim, note, propagate
from closeform.zones.shapes import FACES

BESIDE = 1e-3  # of a cell: distance from a failure without drift at which the direction of drifts is sampled
LEAST_STEP = 1e-9  # of a cell, along failures without drift


@kernel()
def along_track(matrix):
    """Return the direction of the track in zone coordinates, and its squared length there."""
    x, y, z = matrix[0, 1], matrix[1, 1], matrix[2, 1]
    return (x, y, z), x * x + y * y + z * z


@kernel()
def is_tube(tube):
    """Return True if a form is a tube along the track; for half-spaces it may be the zone itself."""
    return tube[0] != FACES or along_track(tube[1])[1] == 0.0


@kernel()
def drift_of(q, n, direction, square):
    """Return the drift along the track of one motion [m/s]."""
    x, y, z = q[1, 0] + q[3, 0] / (n * n), q[1, 1] + q[3, 1] / (n * n), q[1, 2] + q[3, 2] / (n * n)
    return (x * direction[0] + y * direction[1] + z * direction[2]) / square


@kernel()
def drift_range(one, two, cell, width, far, n, form, rest, room):
    """Return the minimum and maximum drift along the track in a cell, and the error of `drifts` [m/s]."""
    direction, square = along_track(form[1])
    window, _ = open_window(one, two, cell, width, cell[FROM], far, n, 4, rest[3], form, room)
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
def drift_at(one, two, cell, width, far, n, form, room):
    """Return the drift along the track [m/s] of the failure at `shares` of a cell, and open its window."""
    aim(one, two, cell, width, inf, room)
    point = room.point[0]
    single(one, point, SIDE, n, room.rows[0])
    single(two, point, SIDE + width, n, room.rows[1])
    open_window(one, two, point, width, cell[FROM], far, n, 1, cell[FROM], form, room)
    direction, square = along_track(form[1])
    return drift_of(room.motions[0], n, direction, square)


@kernel()
def remove_drift(one, two, cell, width, far, n, form, slow, count, room):
    """Move `shares` of a cell, one after another, to a failure without drift; return True if there is one."""
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
def remove_drift_at(one, two, cell, width, far, n, form, slow, k, share, room):
    """Move the other of two `shares` to a failure without drift; return True if there is one."""
    m = 1 - k
    room.shares[k], room.shares[m] = share, 0.0
    low, before = 0.0, drift_at(one, two, cell, width, far, n, form, room)
    room.shares[m] = 1.0
    high, after = 1.0, drift_at(one, two, cell, width, far, n, form, room)
    if (before > 0.0) == (after > 0.0):
        return False
    for turn in range(100):
        at = low + (high - low) * before / (before - after)
        if turn % 3 == 2 or not low < at < high:
            at = 0.5 * (low + high)
        room.shares[m] = at
        drift = drift_at(one, two, cell, width, far, n, form, room)
        if abs(drift) <= slow or high - low < LEAST_STEP:
            break
        if (drift > 0.0) == (before > 0.0):
            low, before = at, drift
        else:
            high, after = at, drift
    return True


@kernel()
def limit_ahead(one, two, t, width, n, form, tube, way, room, best):
    """Return the minimum norm of the region ahead of a closed ellipse, `room.point[0]`, if below `best`.

    Along the track the motion is at a - size cos(n t - middle). In the half before the zone, the region ahead
    is the tube; in the half past it, only the position itself counts.
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
            best = propagate(one, two, point, width, begin, end, n, seen, room, best)[0]
        begin = end
    return best


@kernel()
def ways_from(one, two, cell, width, far, n, form, slow, count, room):
    """Return True for each sense of drift, forward and backward, of failures near the one at `shares`."""
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
    """Return the norm that ever slower drifts in a cell approach at its fractions `shares`, if below `best`.

    Where they drift in only one sense, only the region ahead counts.
    """
    if not remove_drift(one, two, cell, width, far, n, form, slow, count, room):
        return inf
    forward, backward = ways_from(one, two, cell, width, far, n, form, slow, count, room)
    t, turn = cell[FROM], cell[FROM] + 2.0 * pi / n
    if not (forward or backward):
        return inf
    if forward != backward:
        return limit_ahead(one, two, t, width, n, form, tube, 1.0 if forward else -1.0, room, best)
    return propagate(one, two, room.point[0], width, t, turn, n, tube, room, best)[0]


@kernel()
def limit_downhill(one, two, cell, width, slow, far, n, form, tube, room, best):
    """Return the local minimum, from `room.point[1]`, of limits of slow drifts near failures without drift.

    One of two unknowns is varied, with steps that grow while the limit decreases and otherwise reverse and
    shrink. The other follows so that the failure does not drift. Both stay inside the cell.
    """
    t, turn = cell[FROM], cell[FROM] + 2.0 * pi / n
    for k in range(2):
        low, high = cell[column_of(one, width, k)], cell[column_of(one, width, k) + 1]
        if not low < high:
            continue
        here, step = (room.point[1, column_of(one, width, k)] - low) / (high - low), 0.1
        while abs(step) > LEAST_STEP:
            share, least = min(max(here + step, 0.0), 1.0), inf
            if share != here and remove_drift_at(one, two, cell, width, far, n, form, slow, k, share, room):
                least = propagate(one, two, room.point[0], width, t, turn, n, tube, room, best)[0]
            if least < best:
                best, here = least, share
                note(room, room.point[0])
                step *= 2.0
            else:
                step *= -0.3
    return best
