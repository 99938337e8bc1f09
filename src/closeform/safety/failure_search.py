"""Search for the worst failure, by cells that are divided until each is clear or has a conflict.

The span of a cell is marched (see `separating_planes`); where that ends, the failure whose motion is nearest
there is propagated, and the cell is cut across its longest edge.  Both parts continue from there.  For a
minimum norm, descents over all unknowns at once start in the cells that seem to come closest, so that cells
are compared with it from the start.
"""

from math import inf, nan, pi

from numba import float64, int64, void

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, lent
from closeform.motion.arc import START
from closeform.motion.extrema import NIL
from closeform.safety.failure_cells import (
    FIRST,
    FROM,
    KIND,
    LAST,
    LOST,
    MISSED,
    OFFSET,
    SIDE_TYPE,
    STUCK,
    choose,
    earliest,
    first_cells,
    parameter_count,
    single_failure,
    span_both,
)
from closeform.safety.failure_motions import ROOM_TYPE, is_natural, open_window
from closeform.safety.separating_planes import EITHER_WAY, march, widest
from closeform.safety.shadow import is_shadow
from closeform.safety.single_failures import (
    MEETS,
    cut,
    descend,
    glance,
    has_extent,
    near_by,
    note,
    propagate,
    target_below,
)
from closeform.zones.shapes import FORM

RETRIED = 0.1  # of a set's widest edge: a cell is marched again, uncut, if the minimum falls by more
# Cells after which a safety check is undecided, and the accuracy of a minimum norm is reduced.
MANY, LESS = 5_000, 10.0
LONG = 6.0 * pi  # of a drift, in n t: the zone's shadow is checked first
# Columns of the result of a pair; the position in zone coordinates, the failure as a cell.
TIME, RATIO, ACCURACY, LOWER, PLACE, FAILURE = 0, 1, 2, 3, 4, 7
# Types of the arguments of a search, from `one` to `floor`.
TASK = (*(SIDE_TYPE,) * 2, *(int64[::1],) * 2, float64[::1], float64, FORM, *(float64,) * 3, FORM, float64)


@kernel()
def fill_cells(one, two, begin, n, cells):
    """Fill all cells of a pair, each of one side with each of the other; return their number.

    If there is not enough space the cells are only counted.
    """
    ones = first_cells(one, n, cells)
    twos = first_cells(two, n, cells[:0])
    if ones * twos > len(cells):
        return ones * twos
    for k in range(ones - 1, -1, -1):
        for m in range(twos):
            for c in range(one.now[OFFSET], two.now[OFFSET]):
                cells[k * twos + m, c] = cells[k, c]
    first_cells(two, n, cells)
    for k in range(ones * twos):
        for c in range(two.now[OFFSET], cells.shape[1]):
            cells[k, c] = cells[k % twos, c]
        cell = cells[k]
        cell[FROM] = max(begin, earliest(one, cell), earliest(two, cell))
    return ones * twos


@kernel(inline=True)
def least_downhill(one, two, top, end, n, form, room, best, when, most):
    """Return the minimum norm that descents from cells reach, if below `best`, and its time.

    Descents start in cells that seem to come closer than that, or than `most`; `room.point[1]` receives the
    failure.
    """
    worst, kept = room.point[1], room.point[2]
    for c in range(len(worst)):
        kept[c] = worst[c]
    for k in range(top):
        if room.cells[k, FROM] > end:
            continue
        level = max(best, most)
        least, time = glance(one, two, room.cells[k], end, n, form, room, level)
        if least < level:
            least, time = descend(one, two, time, end, n, form, room, inf)
        if least < best:
            best, when = least, time
            for c in range(len(worst)):
                kept[c] = worst[c]
    for c in range(len(worst)):
        worst[c] = kept[c]
    return best, when


@kernel()
def calm_from(side, n):
    """Return the time from which a side moves without thrust for any failure."""
    kind, last = side.now[KIND], side.now[LAST] - 1
    if kind == LOST or kind == STUCK:
        return -inf
    return side.arcs[last, START] if is_natural(side, last, n) else inf


@kernel(inline=True)
def march_drift(one, two, cell, calm, end, n, form, shadow, scale, target, best, rest, room):
    """Do what `march` does to the end of a drift; a long drift ends after one orbit if the shadow is clear.

    Both sides are without thrust from `calm` onward. In the shadow natural motion is periodic, theory (49).
    """
    if is_shadow(shadow) and n * (end - max(calm, cell[FROM])) > LONG:
        if cell[FROM] < calm:
            t, clear, near = march(
                one, two, cell, calm, n, form, scale, target, best, rest, -1, EITHER_WAY, room
            )
            if not clear:
                return t, clear, near
            cell[FROM] = calm
        turn = cell[FROM] + 2.0 * pi / n
        if march(one, two, cell, turn, n, shadow, scale, target, -1.0, rest, -1, EITHER_WAY, room)[1]:
            return end, True, end
    return march(one, two, cell, end, n, form, scale, target, best, rest, -1, EITHER_WAY, room)


@kernel(inline=True)
def visit(one, two, cell, calm, end, n, form, shadow, scale, target, best, count, room):
    """Return True if a cell is clear, else the interval in which a failure in it was propagated instead.

    Also returns the minimum norm of that failure, `room.point[0]`, if below `best`, and its time.
    """
    rest = span_both(one, two, cell, n, room.rows)
    t, near = cell[FROM], inf
    if has_extent(one, cell) or has_extent(two, cell):
        t, clear, near = march_drift(
            one, two, cell, calm, end, n, form, shadow, scale, target, best, rest, room
        )
        if clear:
            return True, t, end, best, nan
    begin, stop = near_by(one, two, cell, t, near, end, n, count, room)
    least, time = propagate(one, two, room.point[0], begin, stop, n, form, room, best)
    return False, t, stop, least, time


@kernel(inline=True)
def search(one, two, top, end, n, form, scale, shadow, floor, certain, most, room):
    """Return the minimum norm over all failures and drifts, its time, and its accuracy.

    The accuracy is reduced after MANY cells. If `most` is MEETS only norms up to that are searched, and the
    result is 1 without a time where undecided; if `certain` is 0 any of these suffices. The failure is stored
    in `room.point[1]`.
    """
    best, when, spent, level = most, nan, 0, -inf
    count, descends = parameter_count(one) + parameter_count(two), most == inf
    calm = max(calm_from(one, n), calm_from(two, n))
    while top > 0:
        if spent > MANY:
            if best == MEETS:
                return 1.0, nan, 0.0
            certain, spent = LESS * certain, 0
            # the remaining cells may contain a smaller norm
            descends = most == inf and one.now[KIND] != MISSED and two.now[KIND] != MISSED
        if descends:
            best, when = least_downhill(one, two, top, end, n, form, room, best, when, level)
            descends, level = False, inf
        if spent == 0:
            for k in range(count):
                room.shares[k] = 0.5
        spent += 1
        target = target_below(best, certain)
        if certain > 1.0 or target <= floor + NIL:
            break
        top -= 1
        cell = room.cells[top]
        if cell[FROM] > end:
            continue
        clear, t, stop, least, time = visit(
            one, two, cell, calm, end, n, form, shadow, scale, target, best, count, room
        )
        if clear:
            continue
        extended = has_extent(one, cell) or has_extent(two, cell)
        if least < best:
            much = best - least > RETRIED * widest(room, count)[1]
            best, when = least, time
            note(room, room.point[0])
            if certain == 0.0:
                break
            if count > 1 or much:
                best, when = descend(one, two, when, end, n, form, room, best)
            if extended and much:  # it may be clear at the new target
                cell[FROM] = t
                top += 1
                continue
        if extended:
            if top + 2 > len(room.cells):
                return -inf, float(top), 0.0
            parts = cut(one, two, top, t, room, count)
            if parts == top and stop < end:  # a single failure, which is followed from there on
                cell[FROM] = stop
                parts += 1
            top = parts
    return best, when, certain


@kernel()
def begin_pair(one, two, end, n, room, result):
    """Fill the cells of a pair; return their number, 0 without a common time or enough space."""
    begin = max(one.arcs[one.now[FIRST], START], two.arcs[two.now[FIRST], START])
    result[TIME], result[RATIO], result[ACCURACY], result[LOWER] = nan, inf, 0.0, inf
    if begin > end:
        return 0
    top = fill_cells(one, two, begin, n, room.cells)
    if 2 * top > len(room.cells):
        result[TIME], result[RATIO] = top, -inf
        return 0
    return top


@kernel()
def store_result(one, two, ratio, when, known, end, n, form, floor, room, result):
    """Fill the columns of a pair with its worst failure, `room.point[1]`, if there is one."""
    result[ACCURACY] = known
    if ratio == -inf or (ratio == 1.0 and when != when):  # too little space, or undecided
        result[TIME], result[RATIO] = when, ratio
    if ratio == -inf or when != when:
        return
    worst = room.point[1]
    single_failure(one, worst, n, room.rows[0])
    single_failure(two, worst, n, room.rows[1])
    seen = when if when < inf else end
    open_window(one, two, worst, seen, end, n, 1, seen, form, room)
    lower = ratio - known * max(abs(ratio), 1.0)
    result[TIME], result[RATIO], result[LOWER] = when, ratio, max(lower, floor)
    for axis in range(3):
        result[PLACE + axis] = room.motions[0, 0, axis]
    for c in range(len(worst)):
        result[FAILURE + c] = worst[c]


@kernel(void(*TASK, ROOM_TYPE, float64[:, ::1]))
def worst_failures(one, two, first, second, ends, n, form, scale, certain, most, shadow, floor, room, out):
    """Fill `out` with time and ratio of each pair's worst failure, and its columns (see `failure_cells`).

    The ratio is `certain` to that fraction of itself, or of 1, or less accurate if that takes too many cells:
    no failure leads below LOWER. If `most` is MEETS, pairs that stay out of the zone have inf, and 1 without
    a time where undecided; if `certain` is 0 the first failure that meets the zone suffices. A pair without a
    common time has nan and inf; one that needs more space has -inf, and the number of its cells as a time.
    `shadow` is that of the zone along the track, and `floor` a lower bound on all norms.
    """
    one, two, room, out = lent(one), lent(two), lent(room), borrowed(out)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    shadow = shadow[0], borrowed(shadow[1]), borrowed(shadow[2])
    for p in range(len(first)):
        choose(one, first[p])
        choose(two, second[p])
        top = begin_pair(one, two, ends[p], n, room, out[p])
        if top > 0:
            ratio, when, known = search(
                one, two, top, ends[p], n, form, scale, shadow, floor, certain, most, room
            )
            store_result(one, two, ratio, when, known, ends[p], n, form, floor, room, out[p])
