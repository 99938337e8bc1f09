"""Descent over all unknowns of a failure at once: its instant, degree and duration, and the time.

Norms have kinks where faces of a zone meet, and minima of the norm are often at a kink.  BFGS with a line
search that requires weak descent of the slope continues there, as its metric shrinks across a kink, and not
along it (A. S. Lewis and M. L. Overton, Nonsmooth optimization via quasi-Newton methods, 2013).  It starts
with the metric of positions, which makes it independent of the scales of the unknowns, and restarts with
shorter and shorter steps.  An unknown at its limit is reflected, or held there.
"""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import END, MEAN_MOTION, START, thrusts
from closeform.motion.linear import back_substitute, factorise
from closeform.safety.failure_cells import (
    HELD,
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
)
from closeform.safety.failure_motions import open_window
from closeform.safety.separating_planes import steepest
from closeform.safety.single_failures import is_instant, note
from closeform.zones.shapes import FACES

SCALE = 0.3  # first step of the unknowns: share of their range, and in n t for times
DIFFERENCE, AT_END = 1e-4, 1e-6  # of SCALE: step of derivatives; distance that counts as a limit
ROUNDS, HALVINGS = 300, 30  # of a descent, of a line search
LONGEST_STEP = 3.0  # of SCALE
SHORTER, SHORTEST = 0.03, 1e-7  # factor of the step at a restart, smallest step relative to the norm
SETTLED, IDLE = 1e-12, 3  # of a norm, or of 1: smaller progress, after so many steps, ends a start


@kernel()
def turned_back(x, low, high):
    """Return an unknown within its range, reflected at the limits; and the sign of its motion there."""
    way = 1.0
    if x < low:
        x, way = min(2.0 * low - x, high), -1.0
    elif x > high:
        x, way = max(2.0 * high - x, low), -1.0
    return x, way


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
def ranges(one, two, cell, end, n, low, high, scale):
    """Fill the limits and scales of all unknowns of a cell's pieces, the time last.

    Returns the number of unknowns without the time.
    """
    count, first = 0, max(earliest(one, cell), earliest(two, cell))
    for second in range(2):
        side = two if second else one
        for j in range(parameter_count(side)):
            low[count], high[count] = range_of(side, cell, j, n)
            scale[count] = SCALE * (high[count] - low[count])
            if j == 0 and is_instant(side, cell) and n > 0.0:
                scale[count] = min(scale[count], SCALE / n)
            count += 1
    low[count], high[count] = -inf, end
    scale[count] = SCALE / n if n > 0.0 else 0.05 * (end - first)
    return count


@kernel()
def seen_at(one, two, t, end, n, form, room):
    """Return the position of the failure `room.point[0]` at a time, in zone coordinates.

    `room.motions[0]` receives its derivatives.
    """
    single_failure(one, room.point[0], n, room.rows[0])
    single_failure(two, room.point[0], n, room.rows[1])
    open_window(one, two, room.point[0], t, end, n, 1, t, form, room)
    q = room.motions[0]
    return q[0, 0], q[0, 1], q[0, 2]


@kernel()
def norm_and_slope(one, two, u, count, low, high, scale, n, form, room, tangents, slope):
    """Return the norm at unknowns and the time; fill its `slope`, and `room.point[0]` with that failure.

    `tangents` (6, 3) receives the derivatives of the position by each unknown.
    """
    point, end = room.point[0], high[count]
    for k in range(count):
        x, way = turned_back(u[k], low[k], high[k])
        column = column_of(one, two, k)
        point[column] = point[column + 1] = x
        slope[k] = way
    first = max(earliest(one, point), earliest(two, point))
    if first > end:
        return inf, end
    t, way = turned_back(u[count], first, end)
    x, y, z = seen_at(one, two, t, end, n, form, room)
    s, ax, ay, az = steepest(form, x, y, z)
    v = room.motions[0, 1]
    for axis in range(3):
        tangents[count, axis] = way * v[axis]
    for k in range(count):
        column = column_of(one, two, k)
        here, by, turn = point[column], DIFFERENCE * scale[k], slope[k]
        below, above = max(here - by, low[k]), min(here + by, high[k])
        for axis in range(3):
            tangents[k, axis] = 0.0
        if not below < above:
            continue
        point[column] = point[column + 1] = above
        late = max(earliest(one, point), earliest(two, point))
        after = seen_at(one, two, t, end, n, form, room)
        point[column] = point[column + 1] = below
        late -= max(earliest(one, point), earliest(two, point))
        before = seen_at(one, two, t, end, n, form, room)
        point[column] = point[column + 1] = here
        for axis in range(3):
            tangents[k, axis] = turn * (after[axis] - before[axis]) / (above - below)
            if u[count] < first:  # the earliest time moves with it
                tangents[k, axis] -= 2.0 * tangents[count, axis] * turn * late / (above - below)
    for k in range(count + 1):
        slope[k] = ax * tangents[k, 0] + ay * tangents[k, 1] + az * tangents[k, 2]
    return s, t


@kernel()
def hold_at_ends(u, low, high, scale, slope, free, count):
    """Mark the free unknowns: those with a range that are not held at a limit by the slope."""
    for k in range(count + 1):
        free[k] = 1.0 if scale[k] > 0.0 else 0.0
    for k in range(count):
        end = low[k] if u[k] < 0.5 * (low[k] + high[k]) else high[k]
        outward = 1.0 if end == high[k] else -1.0
        inside = 1.0 if low[k] <= u[k] <= high[k] else -1.0  # reflected
        if abs(u[k] - end) < AT_END * scale[k] and outward * inside * slope[k] < 0.0:
            u[k], free[k] = end, 0.0


@kernel()
def first_metric(metric, scale, free, tangents, slope, count, size, reach):
    """Fill `metric` from positions and the unknowns' scales: steps of at most one scale and `reach` sizes."""
    ball, square = max(reach * size, SETTLED), 0.0
    for k in range(count):
        for m in range(count):
            metric[k, m] = 0.0
    column, normal = stack_vector(6), stack_matrix(6, 6)
    for k in range(count):
        for m in range(count):
            dot = (
                tangents[k, 0] * tangents[m, 0]
                + tangents[k, 1] * tangents[m, 1]
                + tangents[k, 2] * tangents[m, 2]
            )
            normal[k, m] = dot / (ball * ball) if free[k] * free[m] > 0.0 else 0.0
        normal[k, k] += 1.0 / scale[k] ** 2 if free[k] > 0.0 else 1.0
    factorise(normal, count)
    for k in range(count):
        if free[k] > 0.0:
            for m in range(count):
                column[m] = 1.0 if k == m else 0.0
            back_substitute(normal, column, count)
            for m in range(count):
                metric[m, k] = column[m]
                square += slope[m] * slope[k] * column[m]
    share = min(1.0 / sqrt(square), size / square) if square > 0.0 else 0.0
    for k in range(count):
        for m in range(count):
            metric[k, m] *= share


@kernel()
def turn_metric(metric, step, change, size):
    """Apply the BFGS update to an inverse metric for a step and the change of slope along it."""
    along, whole, spread = 0.0, 0.0, stack_vector(6)
    for k in range(size):
        along += step[k] * change[k]
    if not along > 0.0:
        return
    for k in range(size):
        spread[k] = 0.0
        for m in range(size):
            spread[k] += metric[k, m] * change[m]
        whole += spread[k] * change[k]
    share = (1.0 + whole / along) / along
    for k in range(size):
        for m in range(size):
            metric[k, m] += share * step[k] * step[m] - (spread[k] * step[m] + step[k] * spread[m]) / along


@kernel()
def step_down(one, two, s, u, v, count, low, high, scale, metric, n, form, room, found, slope, after):
    """Step from unknowns `u` to `v` so that the norm s and its slope fall; return the norm there.

    `found`, the smallest norm and its time, and `room.point[1]` are updated.
    """
    step, tangents, descent, length = stack_vector(6), stack_matrix(6, 3), 0.0, 0.0
    for k in range(count + 1):
        step[k] = 0.0
        for m in range(count + 1):
            step[k] -= metric[k, m] * slope[m]
        descent += step[k] * slope[k]
        if scale[k] > 0.0:
            length = max(length, abs(step[k]) / scale[k])
    short, long, share, there = 0.0, inf, min(1.0, LONGEST_STEP / length), inf
    for _ in range(HALVINGS if descent < 0.0 else 0):
        for k in range(count + 1):
            v[k] = u[k] + share * step[k]
        there, time = norm_and_slope(one, two, v, count, low, high, scale, n, form, room, tangents, after)
        if there < found[0]:
            found[0], found[1] = there, time
            note(room, room.point[0])
        along = 0.0
        for k in range(count + 1):
            along += step[k] * after[k]
        if not there < s + 1e-4 * share * descent:
            long = share
        elif along < 0.5 * descent:
            short = share
        else:
            break
        share = 0.5 * (short + long) if long < inf else 2.0 * share
    return there


@kernel()
def descend(one, two, when, end, n, form, room, best):
    """Follow the failure `room.point[1]`, met at time `when`, downhill over all unknowns.

    Returns norm and time; `room.point[1]` receives the result if it is below `best`. Pieces of paths stay the
    same. Shares of missed burns are not changed.
    """
    if one.now[KIND] == MISSED or two.now[KIND] == MISSED:
        return best, when
    u, v, slope, after = stack_vector(6), stack_vector(6), stack_vector(6), stack_vector(6)
    low, high, scale, free = stack_vector(6), stack_vector(6), stack_vector(6), stack_vector(6)
    metric, tangents, found = stack_matrix(6, 6), stack_matrix(6, 3), stack_vector(2)
    worst = room.point[1]
    for c in range(len(worst)):
        room.point[0, c] = worst[c]
    count = ranges(one, two, worst, end, n, low, high, scale)
    for k in range(count):
        u[k] = worst[column_of(one, two, k)]
    u[count], found[0], found[1] = when, best, when
    spent, reach = 0, 1.0
    while reach > SHORTEST and spent < ROUNDS:
        s, time = norm_and_slope(one, two, u, count, low, high, scale, n, form, room, tangents, slope)
        if s < found[0]:
            found[0], found[1] = s, time
            note(room, room.point[0])
        hold_at_ends(u, low, high, scale, slope, free, count)
        size = max(abs(s), 1.0 if form[0] == FACES else SETTLED)  # half-spaces have no minimum norm at 0
        first_metric(metric, scale, free, tangents, slope, count + 1, size, reach)
        idle = 0
        while idle < IDLE and spent < ROUNDS and (s >= SETTLED or form[0] == FACES):
            spent += 1
            there = step_down(
                one, two, s, u, v, count, low, high, scale, metric, n, form, room, found, slope, after
            )
            if not there < s:
                break
            idle = idle + 1 if s - there < SETTLED * max(abs(s), 1.0) else 0
            s = there
            for k in range(count + 1):  # `v` and `after` become the step and the change of slope
                u[k], v[k] = v[k], v[k] - u[k]
                slope[k], after[k] = after[k], after[k] - slope[k]
            turn_metric(metric, v, after, count + 1)
        reach *= SHORTER
    return found[0], found[1]
