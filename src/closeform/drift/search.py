"""The search over failures and drifts at once, by cells that are cut until each is clear or is met.

What a cell spans is marched (see `fans`); where that ends, the failure whose motion is nearest there is
flown, and the cell is cut along its longest edge.  Both halves go on from there.
"""

from math import inf, nan

from numba import float64, int64, void

from closeform.compiled import kernel
from closeform.drift.cells import (
    FROM,
    HIGH,
    LOW,
    SIDE_TYPE,
    choose,
    earliest,
    first_cells,
    parameter_count,
    single,
    span_cell,
)
from closeform.drift.fans import ROOM_TYPE, open_window
from closeform.drift.planes import march, widest
from closeform.kernel_loans import borrowed, lent, stack_vector
from closeform.motion.arc import START
from closeform.motion.certified_march import LESS_PATIENCE, PATIENCE
from closeform.motion.extrema import NIL, minimum_norm
from closeform.zones.shapes import FACES, FORM

NEAR = 0.5  # in n t: so far before and after where planes end a motion is followed
SAME = 3e-10  # of a least ratio, or of a tenth: what cells may hide of it
MEETS = 1.0 + 1e-12  # up to here a norm is on the surface
SMALLEST = 1e-13  # of a set's edges, in zones: failures in it are the same
TIME, RATIO, PLACE, FAILURE = 0, 1, 2, 5  # columns of what is told of a pair: in zone coordinates; a cell


@kernel()
def fly(one, two, cell, width, begin, end, n, form, room, best):
    """Least norm and its time of the failure at a cell's low ends, over [begin, end], if below `best`."""
    shape, _, faces = form
    single(one, cell, 1, n, room.rows[0])
    single(two, cell, 1 + width, n, room.rows[1])
    when, t, patience = nan, begin, PATIENCE
    while True:
        order, stop, _, _, _ = open_window(one, two, cell, width, t, end, n, 1, t, form, room)
        motion = room.motions[0]
        best, local, reached = minimum_norm(
            shape, faces, motion, order, n, 0.0, stop - t, patience, best, nan
        )
        if local == local:
            when = min(t + local, stop)
        if reached < stop - t:
            patience = LESS_PATIENCE
            t += reached
        else:
            t = stop
        if t >= end or (best == 0.0 and shape != FACES):
            return best, when


@kernel()
def aim(one, two, cell, width, at_middle, room):
    """Make `room.point` the failure of a cell that is nearest where its planes end, or its middle."""
    point, k = room.point[0], 0
    for c in range(len(cell)):
        point[c] = cell[c]
    for second in range(2):
        side, o = (two, 1 + width) if second else (one, 1)
        for j in range(parameter_count(side)):
            share = 0.5 if at_middle else room.shares[k]
            low, high = cell[o + LOW + 2 * j], cell[o + HIGH + 2 * j]
            at = min(max(low + share * (high - low), low), high)
            point[o + LOW + 2 * j], point[o + HIGH + 2 * j] = at, at
            k += 1
    return max(earliest(one, point, 1), earliest(two, point, 1 + width))


@kernel()
def has_extent(side, cell, o):
    """Whether a cell holds more than one failure of a side."""
    for k in range(parameter_count(side)):
        if cell[o + LOW + 2 * k] < cell[o + HIGH + 2 * k]:
            return True
    return False


@kernel()
def note(room, cell):
    """Keep a failure as the worst that was met."""
    for c in range(len(cell)):
        room.point[1, c] = cell[c]


@kernel()
def cut(one, two, width, top, t, room, count):
    """Put a cell's two halves in its place, to go on from time t; the half to be searched first is last."""
    cells = room.cells
    which, _ = widest(room, count)
    mine = parameter_count(one)
    column = 1 + LOW + 2 * which if which < mine else 1 + width + LOW + 2 * (which - mine)
    low, high = cells[top, column], cells[top, column + 1]
    middle = 0.5 * (low + high)
    if not low < middle < high:
        return top
    for c in range(cells.shape[1]):
        cells[top + 1, c] = cells[top, c]
    upper = room.shares[which] > 0.5
    cells[top, column], cells[top, column + 1] = (low, middle) if upper else (middle, high)
    cells[top + 1, column], cells[top + 1, column + 1] = (middle, high) if upper else (low, middle)
    for k in range(2):
        cell = cells[top + k]
        cell[FROM] = max(t, earliest(one, cell, 1), earliest(two, cell, 1 + width))
    return top + 2


@kernel()
def fill_cells(one, two, begin, width, n, cells):
    """Fill all cells of a pair, each of one side with each of the other; how many, if there is room."""
    ones = first_cells(one, 1, n, cells)
    twos = first_cells(two, 1 + width, n, cells[:0])
    if ones * twos > len(cells):
        return ones * twos
    for k in range(ones - 1, -1, -1):
        for m in range(twos):
            for c in range(1, 1 + width):
                cells[k * twos + m, c] = cells[k, c]
    first_cells(two, 1 + width, n, cells)
    for k in range(ones * twos):
        for c in range(1 + width, 1 + 2 * width):
            cells[k, c] = cells[k % twos, c]
        cell = cells[k]
        cell[FROM] = max(begin, earliest(one, cell, 1), earliest(two, cell, 1 + width))
    return ones * twos


@kernel()
def sample(one, two, top, width, end, n, form, room):
    """Fly the middle of each cell, and put the worst last: the least norm, its time."""
    best, when, worst = inf, nan, 0
    for k in range(top):
        t = max(room.cells[k, FROM], aim(one, two, room.cells[k], width, True, room))
        if t <= end:
            least, time = fly(one, two, room.point[0], width, t, end, n, form, room, best)
            if least < best:
                best, when, worst = least, time, k
                note(room, room.point[0])
    for c in range(room.cells.shape[1]):
        swap = room.cells[worst, c]
        room.cells[worst, c] = room.cells[top - 1, c]
        room.cells[top - 1, c] = swap
    return best, when


@kernel()
def search(one, two, top, width, end, n, form, scale, certain, room):
    """Least norm over all failures and drifts, and its time; if not `certain`, any up to 1 or none.

    The failure stands in `room.point[1]`.
    """
    shape, rest = form[0], stack_vector(8)
    best, when = sample(one, two, top, width, end, n, form, room) if certain else (MEETS, nan)
    mine = parameter_count(one)
    count = mine + parameter_count(two)
    for k in range(count):
        room.shares[k] = 0.5
    while top > 0:
        target = best - SAME * max(abs(best), 0.1) if certain else best
        if target <= NIL and shape != FACES:
            break
        top -= 1
        cell = room.cells[top]
        if cell[FROM] > end:
            continue
        rest[0], rest[1], rest[2], rest[3] = span_cell(one, cell, 1, n, room.rows[0])
        rest[4], rest[5], rest[6], rest[7] = span_cell(two, cell, 1 + width, n, room.rows[1])
        t, extended = cell[FROM], has_extent(one, cell, 1) or has_extent(two, cell, 1 + width)
        if extended:
            t, clear = march(one, two, cell, width, end, n, form, scale, target, rest, room)
            if clear:
                continue
        s = aim(one, two, cell, width, False, room)
        if not extended:
            begin, until = max(t, s), end
        else:
            _, size = widest(room, count)
            reach = NEAR / n if n > 0.0 else 0.05 * (end - s)
            begin = max(cell[FROM], s, t - reach)
            until = min(end, max(t, begin) + reach)
        least, time = fly(one, two, room.point[0], width, begin, until, n, form, room, best)
        if least < best:
            best, when = least, time
            note(room, room.point[0])
            if not certain:
                break
        if extended:
            if size > SMALLEST and top + 2 <= len(room.cells):
                top = cut(one, two, width, top, t, room, count)
            elif until < end:  # of a motion by itself all up to there is known
                cell[FROM] = until
                top += 1
    return best, when


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
        int64,
        ROOM_TYPE,
        float64[:, ::1],
    )
)
def worst_failures(one, two, first, second, ends, n, form, scale, certain, room, out):
    """Of each pair the time and ratio of its worst failure, and its columns (see `cells`).

    With 0 for `certain` the first that meets the zone, or inf.  A pair without a common time has nan and
    inf; one that needs more room than there is has minus as many cells for a ratio.
    """
    one, two, room, out = lent(one), lent(two), lent(room), borrowed(out)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    width = (room.cells.shape[1] - 1) // 2
    for p in range(len(first)):
        choose(one, first[p])
        choose(two, second[p])
        end = ends[p]
        begin = max(one.arcs[one.now[1], START], two.arcs[two.now[1], START])
        out[p, TIME], out[p, RATIO] = nan, inf
        if begin > end:
            continue
        top = fill_cells(one, two, begin, width, n, room.cells)
        if 2 * top > len(room.cells):
            out[p, RATIO] = -inf
            out[p, TIME] = top
            continue
        ratio, when = search(one, two, top, width, end, n, form, scale, certain == 1, room)
        if when != when:
            continue
        worst = room.point[1]
        single(one, worst, 1, n, room.rows[0])
        single(two, worst, 1 + width, n, room.rows[1])
        open_window(one, two, worst, width, when, end, n, 1, when, form, room)
        out[p, TIME], out[p, RATIO] = when, ratio
        for axis in range(3):
            out[p, PLACE + axis] = room.motions[0, 0, axis]
        for c in range(len(worst)):
            out[p, FAILURE + c] = worst[c]
