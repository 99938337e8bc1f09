"""Paths within a thrust limit: optimal arcs below it, short arcs of saturated thrust at it.

Saturated thrust U p/|p| has no finite basis.  It is approximated by arcs whose thrust has its value and
rate at both ends: if the thrust turns by an angle d, the error is at most d^4/384 of U, towards the inside of
the ball of radius U.  The last steps of Newton's method use the change of state that the arcs achieve. A path
therefore ends in its final state, respects the limit, and is certified like any other. Its cost is compared
with the bound of theory (31, 32).
"""

from math import inf, sqrt

from numba import boolean, float64, int64, void

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
from closeform.motion.arc import END, MEAN_MOTION, PUSH, START, STATE, THRUST, WIDTH, state_at
from closeform.motion.costates import COASTING, FREE, RISING, piece_end, side, sum_up
from closeform.motion.hill import coast, oscillation
from closeform.motion.linear import dot
from closeform.motion.minimum_delta_v.ascent import (
    DONE,
    IMPOSSIBLE,
    climb,
    distance,
    downhill,
    least_limit,
    sharpen,
)
from closeform.motion.minimum_delta_v.primer import NARROWEST, functional

# Largest error of an arc, as a share of the limit. Ten times as much: half as many arcs, and a limit exceeded
# by more than the promised 1e-9.
OFF = 3e-9
ROUNDING = 1e-14  # relative rounding of |p|, in thrust of size (|p| - 1) / e
NOISE = 1e-13  # relative rounding of states
CLOSE = 1e-6  # relative accuracy of the smallest feasible limit
WORST = 1e-6  # largest relative excess of a path's cost over its lower bound


@kernel()
def thrust_and_rate(n, c, t, region, low, e, limit, out):
    """Fill `out` (6,) with the thrust in a region of the primer of start `c` at time t, and its rate."""
    x, y, z, vx, vy, vz = coast(n, t, c[0], c[1], c[2], c[3], c[4], c[5])
    r = sqrt(x * x + y * y + z * z)
    thrust, rate = limit, 0.0
    if region == RISING:
        thrust, rate = min(max((r - low) / e, 0.0), limit), 1.0 / e
    swell = (x * vx + y * vy + z * vz) / (r * r)  # rate of r, over r
    grow = rate * swell - thrust * swell / r
    out[0], out[1], out[2] = thrust / r * x, thrust / r * y, thrust / r * z
    out[3], out[4], out[5] = (
        thrust / r * vx + grow * x,
        thrust / r * vy + grow * y,
        thrust / r * vz + grow * z,
    )


@kernel()
def push_along(n, h, first, middle, last, limit, arc):
    """Fit an arc's prescribed thrust to `first` at its start and `last` after h, within the limit.

    Both hold thrust and rate. Returns its deviation from the thrust `middle` at half time, as a fraction of
    the limit.
    """
    p0, p1, p2 = oscillation(n, h)
    gap = p1 * p1 - p0 * p2
    for i in range(3):
        value, rate = first[i], first[3 + i]
        rise, turn = last[i] - value - rate * h, last[3 + i] - rate
        arc[PUSH + i], arc[PUSH + 3 + i] = value, rate
        arc[PUSH + 6 + i], arc[PUSH + 9 + i] = (rise * p1 - turn * p2) / gap, (turn * p1 - rise * p0) / gap
    off, most = 0.0, 0.0
    for quarter in range(1, 4):
        t, square = 0.25 * quarter * h, 0.0
        p0, p1, p2 = oscillation(n, t)
        for i in range(PUSH, PUSH + 3):
            thrust = arc[i] + arc[i + 3] * t + arc[i + 6] * p1 + arc[i + 9] * p2
            square += thrust * thrust
            if quarter == 2:
                thrust -= middle[i - PUSH]
                off += thrust * thrust
        most = max(most, square)
    most = sqrt(most)
    if most > limit:
        for k in range(12):
            arc[PUSH + k] *= limit / most
    return sqrt(off) / limit


@kernel()
def store(row, k, x, y, z, vx, vy, vz):
    """Set six numbers of a row from column k onward."""
    row[k], row[k + 1], row[k + 2] = x, y, z
    row[k + 3], row[k + 4], row[k + 5] = vx, vy, vz


@kernel()
def begin_arc(n, row, start, end, before):
    """Fill the row of an arc that continues arc `before`."""
    for k in range(WIDTH):
        row[k] = 0.0
    row[START], row[END], row[MEAN_MOTION] = start, end, n
    x, y, z, vx, vy, vz = state_at(before, start)
    store(row, STATE, x, y, z, vx, vy, vz)


@kernel()
def lay_arcs(n, duration, origin, c, low, e, limit, rows, first):
    """Fill `rows` from row `first` on with arcs under the thrust of the primer that starts at `c`.

    Returns the row after the last, or -1 where there is no space.
    """
    values = stack_matrix(3, 6)
    start, high = origin[START], low + e * limit
    t, region, k = 0.0, side(n, c, 0.0, low, high), first
    pace = duration  # length of the next arc that probably meets the tolerance
    before = origin
    while t < duration:
        end, after = t, region
        while after == region and end < duration:
            end, after = piece_end(n, duration, c, end, region, low, high)
        natural = region == COASTING or (region == RISING and low == 0.0)
        if not natural:
            thrust_and_rate(n, c, t, region, low, e, limit, values[0])
        while t < end:
            if k == len(rows):
                return -1
            h = end - t if natural or end - t <= pace else min(pace, 0.5 * (end - t))
            row = rows[k]
            begins = before[END] if k > first else start
            ends = origin[END] if t + h >= duration else start + t + h
            if not ends > begins:  # shorter than the resolution of time
                t = end
                break
            begin_arc(n, row, begins, ends, before)
            if natural:
                if region == RISING:
                    x, y, z, vx, vy, vz = coast(n, t, c[0], c[1], c[2], c[3], c[4], c[5])
                    store(row, THRUST, x, y, z, vx, vy, vz)
            else:
                for q in range(1, 3):
                    thrust_and_rate(n, c, t + 0.5 * q * h, region, low, e, limit, values[q])
                off = push_along(n, h, values[0], values[1], values[2], limit, row)
                allowed = OFF + ROUNDING / (e * limit) if region == RISING else OFF
                factor = 0.9 * sqrt(sqrt(allowed / max(off, 1e-4 * allowed)))
                if off > allowed and h > NARROWEST * duration:
                    pace = h * max(0.1, min(factor, 0.9))
                    continue
                pace = h * factor
                for q in range(6):
                    values[0, q] = values[2, q]
            t = end if h == end - t else t + h
            before = row
            k += 1
        t, region = end, after
    rows[k - 1, END] = origin[END]
    return k


@kernel()
def add_thrust(n, c, rows, first, last):
    """Add the optimal thrust of start `c` to the arcs of rows [first, last)."""
    start, added = rows[first, START], stack_vector(6)
    for k in range(first, last):
        row = rows[k]
        if k > first:
            x, y, z, vx, vy, vz = state_at(rows[k - 1], row[START])
            store(row, STATE, x, y, z, vx, vy, vz)
        x, y, z, vx, vy, vz = coast(n, row[START] - start, c[0], c[1], c[2], c[3], c[4], c[5])
        store(added, 0, x, y, z, vx, vy, vz)
        for i in range(6):
            row[THRUST + i] += added[i]


@kernel()
def within(g, noise):
    """Return True if the functional `g` is zero up to `noise`, first and last three numbers apart."""
    place, speed = max(abs(g[0]), abs(g[1]), abs(g[2])), max(abs(g[3]), abs(g[4]), abs(g[5]))
    return place <= noise[0] and speed <= noise[1]


@kernel()
def meet_end(n, duration, origin, final, noise, scale, c, hessian, free, low, e, limit, rows, first):
    """Lay arcs as `lay_arcs` does, with `c` corrected so that the path ends in `final` (6,), up to `noise`.

    Where thrust of size (|p| - 1) / e rounds, an optimal thrust of relative size 1e-9 corrects the
    remainder; `free` (6, 6) maps such thrust to the change that it makes.
    """
    missing, nothing, step, work = stack_vector(6), stack_vector(6), stack_vector(6), stack_matrix(6, 6)
    for k in range(6):
        nothing[k] = 0.0
    last, before = -1, inf
    for _ in range(8):
        last = lay_arcs(n, duration, origin, c, low, e, limit, rows, first)
        if last < 0:
            return last
        x, y, z, vx, vy, vz = state_at(rows[last - 1], rows[last - 1, END])
        x, y, z = final[0] - x, final[1] - y, final[2] - z
        x, y, z, vx, vy, vz = coast(n, -duration, x, y, z, final[3] - vx, final[4] - vy, final[5] - vz)
        functional(n, x, y, z, vx, vy, vz, missing)
        if within(missing, noise):
            break
        off = distance(missing, nothing, scale)
        if not off < 0.5 * before:
            if low > 0.0 and e > 0.0:
                downhill(missing, nothing, free, scale, work, step)
                add_thrust(n, step, rows, first, last)
            break
        before = off
        downhill(missing, nothing, hessian, scale, work, step)
        for k in range(6):
            c[k] += step[k]
    return last


@kernel()
def worth(n, arc, final, g):
    """Fill `g` (6,), the functional of the change that leads an arc to the state `final` (6,), theory (27).

    Returns the rounding errors of its first three numbers and of its last three.
    """
    x, y, z, vx, vy, vz = coast(
        n, arc[START] - arc[END], final[0], final[1], final[2], final[3], final[4], final[5]
    )
    place, speed = abs(x) + abs(y) + abs(z), abs(vx) + abs(vy) + abs(vz)
    x, y, z = x - arc[STATE], y - arc[STATE + 1], z - arc[STATE + 2]
    vx, vy, vz = vx - arc[STATE + 3], vy - arc[STATE + 4], vz - arc[STATE + 5]
    functional(n, x, y, z, vx, vy, vz, g)
    return NOISE * (speed + 2.0 * n * place), NOISE * place


NEEDED, ENOUGH, BOUND, COST, PROOF = 0, 1, 2, 3, 4  # columns of the facts of each transfer, ten numbers
POSSIBLE, UNDECIDED = 0.0, -1.0


@kernel(
    void(
        float64,
        float64[:, ::1],
        float64[:, ::1],
        float64[::1],
        boolean,
        float64[:, ::1],
        int64[::1],
        float64[:, ::1],
    )
)
def limit_thrust(n, arcs, finals, limits, sparing, rows, offsets, facts):
    """Fill `rows` with the arcs of optimal transfers within thrust limits, as far as there is space.

    `arcs` (P, 30) are the optima without a limit, to `finals` (P, 6); `sparing` minimises delta-v instead of
    energy. `offsets` (P + 1,) receives the index of each path's first arc; after a path that is not POSSIBLE,
    or for which there is no space, offsets stay negative. `facts` (P, 10) receives for each transfer: a lower
    bound on the smallest feasible limit if that exceeds the given one (else POSSIBLE or UNDECIDED), a
    sufficient limit, a lower bound on the cost, the cost, and the start of a primer that proves the bound.
    """
    arcs, finals, rows = borrowed(arcs), borrowed(finals), borrowed(rows)
    g, scale, c = stack_vector(6), stack_vector(6), stack_vector(6)
    gained, hessian, free = stack_vector(6), stack_matrix(6, 6), stack_matrix(6, 6)
    for p in range(len(arcs)):
        arc, limit = arcs[p], limits[p]
        duration = arc[END] - arc[START]
        fast, far = noise = worth(n, arc, finals[p], g)
        facts[p, NEEDED] = POSSIBLE
        if within(g, noise):
            if offsets[p] == len(rows):
                break
            for k in range(WIDTH):  # no thrust is needed
                rows[offsets[p], k] = arc[k]
            offsets[p + 1] = offsets[p] + 1
            continue
        for k in range(6):
            c[k] = arc[THRUST + k]
        sum_up(n, duration, c, 0.0, 1.0, FREE, gained, free)
        for k in range(6):
            scale[k] = free[k, k]
        low, e = 0.0, 1.0
        status, _, spent, length = climb(n, duration, g, scale, c, low, e, limit, gained, hessian)
        if status == IMPOSSIBLE:
            facts[p, NEEDED], facts[p, ENOUGH] = least_limit(
                n, duration, g, scale, c, dot(g, c) / length, CLOSE
            )
            break
        bound = 0.0
        if status == DONE and sparing:
            low = 1.0
            status, e, bound, spent = sharpen(
                n, duration, g, scale, c, limit, spent, gained, hessian, facts[p, PROOF:]
            )
        if status != DONE:
            facts[p, NEEDED] = UNDECIDED
            break
        last = meet_end(
            n, duration, arc, finals[p], noise, scale, c, hessian, free, low, e, limit, rows, offsets[p]
        )
        offsets[p + 1] = last
        if last < 0:
            break
        total, _, spent, energy = sum_up(n, duration, c, low, e, limit, gained, hessian)
        facts[p, BOUND] = bound if low > 0.0 else dot(g, c) - total
        facts[p, COST] = spent if low > 0.0 else 0.5 * energy
        unsure = fast * (abs(c[0]) + abs(c[1]) + abs(c[2])) + far * (abs(c[3]) + abs(c[4]) + abs(c[5]))
        if not facts[p, COST] <= facts[p, BOUND] + WORST * facts[p, COST] + unsure:  # also refuses nan
            facts[p, NEEDED], offsets[p + 1] = UNDECIDED, -1
            break
