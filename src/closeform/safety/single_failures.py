"""Motion after single failures, and division of cells that are not proven clear."""

from math import ceil, cos, inf, nan

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import END, MEAN_MOTION, START, thrusts
from closeform.motion.certified_march import LESS_PATIENCE, PATIENCE
from closeform.motion.extrema import minimum_norm, step_on
from closeform.motion.hill import oscillation
from closeform.safety.failure_cells import (
    FROM,
    HELD,
    HIGH,
    INTACT,
    KIND,
    LOW,
    MEASURE,
    MISSED,
    OFFSET,
    PIECE,
    STUCK,
    column_of,
    earliest,
    parameter_count,
    single_failure,
    span_both,
)
from closeform.safety.failure_motions import OTHER, arc_end, arc_of, is_natural, open_window
from closeform.safety.separating_planes import make_edges, nearest_by_norm, widest
from closeform.zones.shapes import FACES, norm

MEETS = 1.0 + 1e-12  # up to here a norm is on the surface
LEAST_SHARE = 0.2  # of a cell, minimum part on either side of a cut
FIRST_STEP, LAST_STEP = 0.1, 1e-3  # of the descent: in n t, and relative to the first
# Rounds of a descent, and its next step and last one, as shares of the first, after a round with less gain
ROUNDS, SHORTER, SHORTEST, GAIN = 100, 0.03, 1e-11, 1e-3
TURN = 2.399963  # of the last way, the golden angle: no two ways agree
FIRST_SHARE = 0.1  # of the range of an unknown: first step of a descent
NEAR = 0.5  # in n t: range around the end of planes in which a motion is followed
GLANCE, GLANCES = 0.5, 16  # in n t, and per window in deep space: spacing and number of samples
SMALLEST = 1e-13  # of a set's edges, in zones: failures in it are equal


@kernel()
def target_below(best, certain):
    """Return the norm up to which cells must be clear for `best` to be the minimum of all.

    Cells may be lower by the share `certain` of it, or of 1. If only entry matters, it is 1 until a conflict
    is found.
    """
    return best - certain * max(abs(best), 1.0) if certain > 0.0 and best != MEETS else 1.0


@kernel()
def propagate(one, two, cell, begin, end, n, form, room, best):
    """Return the minimum norm over [begin, end] at a cell's low ends, if below `best`, and its time."""
    shape, _, faces = form
    single_failure(one, cell, n, room.rows[0])
    single_failure(two, cell, n, room.rows[1])
    when, t, patience = nan, begin, PATIENCE
    while True:
        window, stop = open_window(one, two, cell, t, end, n, 1, t, form, room)
        motion = room.motions[0]
        best, local, reached = minimum_norm(
            shape, faces, motion, window.order, n, 0.0, stop - t, patience, best, nan
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
def is_instant(side, cell):
    """Return True if a cell's first parameter is the time at which thrust fails."""
    o = side.now[OFFSET]
    kind = side.now[KIND]
    return kind != INTACT and kind != MISSED and int(cell[o + PIECE]) % 2 == 0


@kernel()
def aim(one, two, cell, latest, room):
    """Fill `room.point` with the failure of a cell at `shares` of its edges; return the earliest valid time.

    The failure must have happened by the time `latest`; the span of the cell extends beyond that.
    """
    point, k = room.point[0], 0
    for c in range(len(cell)):
        point[c] = cell[c]
    for second in range(2):
        side = two if second else one
        o = side.now[OFFSET]
        for j in range(parameter_count(side)):
            share = room.shares[k]
            low, high = cell[o + LOW + 2 * j], cell[o + HIGH + 2 * j]
            at = min(max(low + share * (high - low), low), high)
            if j == 0 and is_instant(side, cell):
                at = max(low, min(at, latest - (cell[o + LOW + 2] if side.now[KIND] == STUCK else 0.0)))
            elif j == 1 and side.now[KIND] == STUCK:
                at = max(low, min(at, latest - earliest(side, point) + point[o + LOW + 2]))
            point[o + LOW + 2 * j], point[o + HIGH + 2 * j] = at, at
            k += 1
    return max(earliest(one, point), earliest(two, point))


@kernel()
def has_extent(side, cell):
    """Return True if a cell contains more than one failure of a side."""
    o = side.now[OFFSET]
    for k in range(parameter_count(side)):
        if cell[o + LOW + 2 * k] < cell[o + HIGH + 2 * k]:
            return True
    return False


@kernel()
def note(room, cell):
    """Store a failure as the worst one found."""
    for c in range(len(cell)):
        room.point[1, c] = cell[c]


@kernel()
def glance(one, two, cell, end, n, form, room, best):
    """Estimate the minimum norm of the span of a cell at times GLANCE apart, if below `best`.

    Also returns its time.

    `room.point[1]` receives the failure.
    """
    shape, _, faces = form
    rest = span_both(one, two, cell, n, room.rows)
    t, when, motions = cell[FROM], nan, room.motions
    while True:
        window, stop = open_window(one, two, cell, t, end, n, 4, rest[3], form, room)
        i, j = arc_of(one, t), arc_of(two, t)
        if is_natural(one, i, n) and is_natural(two, j, n):  # its window is short for bounds alone
            stop = min(arc_end(one, i, end), arc_end(two, j, end))
        elif n > 0.0:
            stop = min(stop, t + GLANCE / n)
        steps = max(1, ceil((stop - t) * n / GLANCE)) if n > 0.0 else GLANCES
        if window.order == 8:
            steps = 1
        h = (stop - t) / steps
        transforms, count = oscillation(n, h), make_edges(one, two, room, window)
        for k in range(steps):
            for axis in range(3):
                room.places[0, axis], room.places[OTHER, axis] = motions[0, 0, axis], 0.0
                for m in range(count):
                    room.edges[m, axis] = motions[1 + m, 0, axis]
            x, y, z = nearest_by_norm(room, count, form)
            s = norm(shape, faces, x, y, z)
            if s < best:
                best, when = s, min(t + k * h, stop)
                aim(one, two, cell, when, room)
                note(room, room.point[0])
            for m in range(count + 1 if k + 1 < steps else 0):
                step_on(motions[m], n, h, transforms)
        t = stop
        if t >= end:
            return best, when


@kernel()
def around(one, two, cell, when, end, n):
    """Return the interval near a time in which a failure is followed."""
    first = max(earliest(one, cell), earliest(two, cell))
    reach = NEAR / n if n > 0.0 else 0.05 * (end - first)
    begin = max(when - reach, first)
    return begin, min(end, max(when, begin) + reach)


@kernel()
def near_by(one, two, cell, t, near, end, n, count, room):
    """Aim at the failure that is nearest where planes end; return the interval in which it is followed."""
    size = widest(room, count)[1] if near < inf else inf
    s = aim(one, two, cell, near if size > SMALLEST else t, room)
    if near == inf:
        return max(t, s), end
    begin, stop = around(one, two, room.point[0], near, end, n)
    return max(cell[FROM], s, min(t, begin) if size <= SMALLEST else begin), stop


@kernel()
def range_of(side, cell, j, n):
    """Return the minimum and maximum of a side's j-th unknown in the piece of a cell."""
    o = side.now[OFFSET]
    piece, kind = int(cell[o + PIECE]), side.now[KIND]
    if j == 1:
        return (0.0, side.numbers[MEASURE]) if kind == STUCK else (side.numbers[MEASURE], 1.0)
    if piece % 2 == 1:
        return 0.0, 1.0
    arc, held = side.arcs[piece // 2], kind == STUCK and side.numbers[HELD] >= 0.0
    if held or thrusts(arc) or arc[MEAN_MOTION] != n:
        return arc[START], arc[END]
    return cell[o + LOW], cell[o + LOW]


@kernel()
def first_steps(one, two, cell, n, low, high, ways):
    """Fill the limits of all unknowns of a cell's pieces and a first step along each; return their number."""
    count = parameter_count(one)
    for k in range(count + parameter_count(two)):
        side, j = (one, k) if k < count else (two, k - count)
        low[k], high[k] = range_of(side, cell, j, n)
        ways[k, k] = FIRST_SHARE * (high[k] - low[k])
        if j == 0 and is_instant(side, cell) and n > 0.0:
            ways[k, k] = min(FIRST_STEP / n, ways[k, k])
    return count + parameter_count(two)


@kernel()
def descend(one, two, when, end, n, form, room, best):
    """Follow the worst failure `room.point[1]` downhill; return the minimum norm and its time.

    Pieces of paths stay the same, and so do shares of missed burns.  The search goes along each unknown,
    along the sum of their moves, and another way, by steps that grow downhill and turn back smaller uphill
    (R. Hooke and T. A. Jeeves, "Direct search" solution of numerical and statistical problems, 1961).
    Rounds with shorter and shorter steps follow where there are several unknowns.
    """
    cell, worst = room.point[0], room.point[1]
    low, high, start, ways = stack_vector(4), stack_vector(4), stack_vector(4), stack_matrix(6, 4)
    for k in range(6):
        for m in range(4):
            ways[k, m] = 0.0
    if best == inf:
        for c in range(len(cell)):
            cell[c] = worst[c]
        begin, until = around(one, two, cell, when, end, n)
        best, when = propagate(one, two, cell, begin, until, n, form, room, inf)
    if one.now[KIND] == MISSED or two.now[KIND] == MISSED:
        return best, when
    count = first_steps(one, two, worst, n, low, high, ways)
    reach, spent = 1.0, 0
    while reach > SHORTEST and spent < ROUNDS and (best > 0.0 or form[0] == FACES):
        before = best
        spent += 1
        for k in range(count):
            start[k] = worst[column_of(one, two, k)]
            ways[count + 1, k] = ways[k, k] * cos(TURN * (k + 1.0) * spent) if count > 1 else 0.0
        for way in range(count + 2):
            size = 0.0
            for k in range(count):
                size += abs(ways[way, k])
            step = 1.0 if way == count else reach
            least_step = LAST_STEP * step
            while size > 0.0 and abs(step) > least_step:
                for c in range(len(cell)):
                    cell[c] = worst[c]
                moved = False
                for k in range(count):
                    column = column_of(one, two, k)
                    at = min(max(worst[column] + step * ways[way, k], low[k]), high[k])
                    moved = moved or at != worst[column]
                    cell[column] = cell[column + 1] = at
                begin, until = around(one, two, cell, when, end, n)
                least, time = best, when
                if moved and begin <= end:
                    least, time = propagate(one, two, cell, begin, until, n, form, room, best)
                if least < best:
                    best, when = least, time
                    note(room, cell)
                    step *= 2.0
                else:
                    step *= -0.3
        for k in range(count):
            ways[count, k] = worst[column_of(one, two, k)] - start[k]
        if count <= 1:
            break
        if before - best <= GAIN * abs(best):
            reach *= SHORTER
    return best, when


@kernel()
def cut(one, two, top, t, room, count):
    """Replace a cell by its two parts, to continue from time t; the part to search first is last.

    The cell is cut at the nearest point of the set, or near that end, so that parts farther away are clear
    sooner. Returns the new number of cells, which is the number without it if it contains a single failure.
    """
    cells = room.cells
    which, _ = widest(room, count)
    for _ in range(count):
        column = column_of(one, two, which)
        low, high = cells[top, column], cells[top, column + 1]
        share = room.shares[which]
        if not LEAST_SHARE < share < 1.0 - LEAST_SHARE:
            share = LEAST_SHARE if share < 0.5 else 1.0 - LEAST_SHARE
        middle = low + share * (high - low)
        if low < middle < high:
            break
        which = (which + 1) % count  # floats end here: use another edge
    if not low < middle < high:
        return top
    for c in range(cells.shape[1]):
        cells[top + 1, c] = cells[top, c]
    upper = room.shares[which] > (middle - low) / (high - low)
    cells[top, column], cells[top, column + 1] = (low, middle) if upper else (middle, high)
    cells[top + 1, column], cells[top + 1, column + 1] = (middle, high) if upper else (low, middle)
    for k in range(2):
        cell = cells[top + k]
        cell[FROM] = max(t, earliest(one, cell), earliest(two, cell))
    return top + 2
