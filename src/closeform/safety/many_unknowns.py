"""Search over failures with more unknowns than their instant: degree of degradation, or duration stuck on.

As in `search`, cells are divided until each is clear; but each failure found is followed downhill over all
unknowns at once, so that cells are compared with the minimum norm from the start.
"""

from math import inf, nan

from numba import float64, int64, void

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, lent
from closeform.motion.extrema import NIL
from closeform.safety.descent import descend_all
from closeform.safety.edges import widest
from closeform.safety.failure_cells import FROM, SIDE, SIDE_TYPE, parameter_count
from closeform.safety.failure_family import ROOM_TYPE
from closeform.safety.failure_motion import MEETS, glance, has_extent, note, target_below
from closeform.safety.search import (
    LESS,
    MANY,
    RETRIED,
    begin_pair,
    calm_from,
    continue_search,
    divide,
    sample,
    store_result,
    visit,
)
from closeform.zones.shapes import FACES, FORM


@kernel()
def least_downhill(one, two, top, width, end, n, form, room, best, when, most):
    """Return the minimum norm that descents from cells reach, if below `best`, and its time.

    Descents start in cells that seem to have a lower norm than that, or than `most`; `room.point[1]` receives
    the failure.
    """
    worst, kept = room.point[1], room.point[2]
    for c in range(len(worst)):
        kept[c] = worst[c]
    for k in range(top):
        if room.cells[k, FROM] > end:
            continue
        least, time = glance(one, two, room.cells[k], width, end, n, form, room, max(best, most))
        if least < max(best, most):
            least, time = descend_all(one, two, width, time, end, n, form, room, inf)
        if least < best:
            best, when = least, time
            for c in range(len(worst)):
                kept[c] = worst[c]
    for c in range(len(worst)):
        worst[c] = kept[c]
    return best, when


@kernel()
def search_downhill(one, two, top, width, end, n, form, scale, tube, floor, certain, most, room):
    """Return the minimum norm over failures and drifts, its time, and its accuracy, as `search` does."""
    best, when = most, nan
    if most == inf:
        if form[0] == FACES:  # adds another start
            best, when = sample(one, two, top, width, end, n, form, room)
        best, when = least_downhill(one, two, top, width, end, n, form, room, best, when, -inf)
    count = parameter_count(one) + parameter_count(two)
    for k in range(count):
        room.shares[k] = 0.5
    calm = max(calm_from(one, n), calm_from(two, n))
    spent = 0
    while top > 0:
        spent += 1
        if spent > MANY:
            if best == MEETS:
                return 1.0, nan, 0.0
            if most == inf:  # the remaining cells may contain a smaller norm
                best, when = least_downhill(one, two, top, width, end, n, form, room, best, when, inf)
            certain, spent = LESS * certain, 0
        target = target_below(best, certain)
        if certain > 1.0 or target <= floor + NIL:
            break
        top -= 1
        cell = room.cells[top]
        if cell[FROM] > end:
            continue
        clear, t, stop, least, time = visit(
            one, two, cell, width, calm, end, n, form, tube, scale, target, best, count, room
        )
        if clear:
            continue
        extended = has_extent(one, cell, SIDE) or has_extent(two, cell, SIDE + width)
        if least < best:
            much = best - least > RETRIED * widest(room, count)[1]
            best, when = least, time
            note(room, room.point[0])
            if certain == 0.0:
                break
            best, when = descend_all(one, two, width, when, end, n, form, room, best)
            if extended and much:  # it may be clear at the new target
                cell[FROM] = t
                top += 1
                continue
        if extended:
            if top + 2 > len(room.cells):
                return -inf, float(top), 0.0
            top = divide(one, two, width, top, t, stop, end, room, count)
    return best, when, certain


@kernel(
    void(
        SIDE_TYPE,
        SIDE_TYPE,
        int64[::1],
        int64[::1],
        float64[::1],
        float64,
        FORM,
        float64,
        float64,
        float64,
        float64,
        FORM,
        float64,
        ROOM_TYPE,
        float64[:, ::1],
    )
)
def worst_of_many(one, two, first, second, ends, n, form, scale, certain, most, far, tube, floor, room, out):
    """Do what `search.worst_failures` does for failures with two unknowns: degraded or stuck-on thrust."""
    one, two, room, out = lent(one), lent(two), lent(room), borrowed(out)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    tube = tube[0], borrowed(tube[1]), borrowed(tube[2])
    width = (room.cells.shape[1] - SIDE) // 2
    for p in range(len(first)):
        end = ends[p]
        top = begin_pair(one, two, first[p], second[p], end, n, room, out[p])
        if top <= 0:
            continue
        ratio, when, known = search_downhill(
            one, two, top, width, end, n, form, scale, tube, floor, certain, most, room
        )
        found = ratio, when, known
        if far > 0.0 and ratio > -inf and (certain > 0.0 or when != when):
            found = continue_search(
                one, two, found, width, end, far, n, form, scale, tube, floor, certain, room
            )
        store_result(one, two, found, end, n, form, floor, room, out[p])
