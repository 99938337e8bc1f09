"""What comes after the first hundred orbits of drift, for ever.

Natural motion is an ellipse that drifts along the track.  Either its drift carries it past the zone
within a few steps of the march, for good; or the ellipse stays clear of the zone's shadow along the
track, the *tube*, whatever its phase is; or it is so slow that it sweeps the tube in almost all
phases, and the least norm in the tube counts: what it tends to as the drift gets slower,
from below.                                                                            # theory (49)
"""

from math import inf, pi, sqrt

from closeform.compiled import kernel
from closeform.drift.cells import FROM, parameter_count, span_both
from closeform.drift.edges import widest
from closeform.drift.fans import open_window
from closeform.drift.flown import SMALLEST, aim, cut, fly, note, target_below
from closeform.drift.planes import march
from closeform.zones.shapes import FACES

FEW = 60  # steps of the march, in which a drift is found to lead away for good
STILL = 1e-3  # of a zone: an ellipse that drifts by less in all of the time is closed


@kernel()
def is_closed(one, two, cell, width, t, far, n, form, room):
    """Whether the motion at a cell's low ends is a closed ellipse, as that lasts until `far`."""
    window, _ = open_window(one, two, cell, width, t, far, n, 1, t, form, room)
    q, square = room.motions[0], 0.0
    for axis in range(3):
        drift = q[1, axis] + q[3, axis] / (n * n)
        square += drift * drift
    return window.order == 4 and sqrt(square) * (far - t) < STILL


@kernel()
def search_tail(one, two, top, width, far, n, form, scale, tube, certain, room, best):
    """Least norm in the tube of failures that drift slowly, if below `best`; it stands in `room.point[1]`."""
    found = False
    count = parameter_count(one) + parameter_count(two)
    while top > 0:
        target = target_below(best, certain)
        if target <= 0.0 and form[0] != FACES:
            break
        top -= 1
        cell = room.cells[top]
        t = cell[FROM]
        rest = span_both(one, two, cell, width, n, room.rows)
        if march(one, two, cell, width, far, n, form, scale, target, -1.0, rest, FEW, room)[1]:
            continue
        turn = t + 2.0 * pi / n
        _, clear, _ = march(one, two, cell, width, turn, n, tube, scale, target, -1.0, rest, -1, room)
        if clear:
            continue
        _, size = widest(room, count)
        aim(one, two, cell, width, inf, room)
        if size <= SMALLEST and is_closed(one, two, room.point[0], width, t, far, n, form, room):
            continue
        least, time = fly(one, two, room.point[0], width, t, turn, n, tube, room, best)
        if least < best:
            best, found = least, True
            note(room, room.point[0])
            if certain == 0.0:
                break
        if size > SMALLEST:
            if top + 2 > len(room.cells):
                return best, False, True
            top = cut(one, two, width, top, t, room, count)
    return best, found, False
