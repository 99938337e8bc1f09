"""The primer of a transfer: its thrust direction and marginal value of delta-v, itself a natural motion.

A primer over [0, T] is determined by six numbers c, its start p(0) and its start rate p'(0):

    p(t) = Psi(t) c                Psi, the rows of the transition matrix that give positions    # theory (26)

By weak duality any thrust u and impulses v_k that make a transfer obey

    g . c = integral of p . u dt + sum of p(t_k) . v_k                                           # theory (27)

with g linear in the required change of state.  So |p| <= 1 throughout makes g . c a lower bound on delta-v,
and only the largest |p| has to be certified.  It is found piece by piece: on each the Taylor
series of |p|^2 with its remainder shows that |p| stays below a level, has no maximum inside, is
concave and has one, or is constant up to rounding.
"""

from math import sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import END, START, acceleration
from closeform.motion.hill import coast, oscillation

WIDEST = 0.5  # half of a piece in n t: more, and most are cut; less, and there are more
FLAT = 1e-13  # relative change of |p|^2 below which a piece is not divided
DEGREE = 8  # of the series of |p|^2
NARROWEST = 1e-6  # share of the widest piece: by then |p|^2 is flat where its slope and curvature are zero
APART = 1e-9  # share of their time: maxima closer than that are one


@kernel()
def position_rows(n, t, psi):
    """Fill `psi` (3, 6), which maps the initial state of a natural motion to the position after time t."""
    p0, p1, p2 = oscillation(n, t)
    nn = n * n
    for i in range(3):
        for j in range(6):
            psi[i, j] = 0.0
    psi[0, 0], psi[0, 3], psi[0, 4] = 1.0 + 3.0 * nn * p1, p0, 2.0 * n * p1
    psi[1, 0], psi[1, 1], psi[1, 3] = -6.0 * n * nn * p2, 1.0, -2.0 * n * p1
    psi[1, 4] = t - 4.0 * nn * p2
    psi[2, 2], psi[2, 5] = 1.0 - nn * p1, p0


@kernel()
def rate_rows(n, t, rates):
    """Fill `rates` (3, 6), which maps the initial state of a natural motion to the velocity after time t."""
    p0, p1, _ = oscillation(n, t)
    nn = n * n
    for i in range(3):
        for j in range(6):
            rates[i, j] = 0.0
    c = 1.0 - nn * p1
    rates[0, 0], rates[0, 3], rates[0, 4] = 3.0 * nn * p0, c, 2.0 * n * p0
    rates[1, 0], rates[1, 3], rates[1, 4] = -6.0 * n * nn * p1, -2.0 * n * p0, 1.0 - 4.0 * nn * p1
    rates[2, 2], rates[2, 5] = -nn * p0, c


@kernel()
def functional(n, x, y, z, vx, vy, vz, g):
    """Fill `g` (6,): a change of state at time 0 is worth g . c to the primer that starts at c, theory (27).

    The required change over a duration T, seen at time 0, is coast(n, -T, final) - initial.
    """
    g[0], g[1], g[2] = vx - 2.0 * n * y, vy + 2.0 * n * x, vz
    g[3], g[4], g[5] = -x, -y, -z


@kernel()
def gained(n, arc, final, g):
    """Fill `g` (6,), the `functional` of a transfer from an arc's state to a final one in the arc's time."""
    x, y, z, vx, vy, vz = coast(
        n, arc[START] - arc[END], final[0], final[1], final[2], final[3], final[4], final[5]
    )
    functional(n, x - arc[6], y - arc[7], z - arc[8], vx - arc[9], vy - arc[10], vz - arc[11], g)


@kernel()
def square_at(n, c, t):
    """Return |p|^2 / 2 at time t and its first two derivatives."""
    x, y, z, vx, vy, vz = coast(n, t, c[0], c[1], c[2], c[3], c[4], c[5])
    ax, ay, az = acceleration(n, x, z, vx, vy)
    bend = vx * vx + vy * vy + vz * vz + x * ax + y * ay + z * az
    return 0.5 * (x * x + y * y + z * z), x * vx + y * vy + z * vz, bend


@kernel()
def series(n, c, t, h, p, sizes, f):
    """Fill `f` (9,): |p|^2 = f_0 + f_1 s + ... at time t + h s; return a bound on the remainder for |s| <= 1.

    `p` (9, 3) is work space for the terms of p, `sizes` (10,) for bounds on its derivatives in the piece.
    """
    x, y, z, vx, vy, vz = coast(n, t, c[0], c[1], c[2], c[3], c[4], c[5])
    for k in range(4):
        p[k, 0], p[k, 1], p[k, 2] = x, y, z
        ax, ay, az = acceleration(n, x, z, vx, vy)
        x, y, z, vx, vy, vz = vx, vy, vz, ax, ay, az
    scale = 1.0
    for k in range(4):
        for axis in range(3):
            p[k, axis] *= scale
        sizes[k] = sqrt(p[k, 0] * p[k, 0] + p[k, 1] * p[k, 1] + p[k, 2] * p[k, 2])
        scale *= h / (k + 1.0)
    turn = n * n * h * h
    for k in range(4, DEGREE + 1):  # the fourth derivative is -n^2 times the second, and so on
        factor = -turn / (k * (k - 1.0))
        for axis in range(3):
            p[k, axis] = factor * p[k - 2, axis]
    for k in range(DEGREE + 1):
        f[k] = 0.0
        for i in range(k + 1):
            f[k] += p[i, 0] * p[k - i, 0] + p[i, 1] * p[k - i, 1] + p[i, 2] * p[k - i, 2]
    a, b = sizes[2], sizes[3]
    sizes[2], sizes[3] = a + 3.0 * b, b + turn * a / 3.0
    sizes[1] += 2.0 * sizes[2]
    sizes[0] += sizes[1]
    rest = 0.0
    for k in range(4, DEGREE + 2):
        sizes[k] = sizes[k - 2] * turn / (k * (k - 1.0))
    for k in range(5):
        rest += 2.0 * sizes[k] * sizes[DEGREE + 1 - k]
    return rest


BELOW, SMOOTH, CONCAVE, LEVEL, UNCLEAR = 0, 1, 2, 3, 4


@kernel()
def kind_of(f, rest, floor):
    """Classify |p|^2 on a piece of series `f`; return the class and an upper bound."""
    high, slope, bend = f[0] + abs(f[1]) + max(f[2], 0.0) + rest, 9.0 * rest, 72.0 * rest
    change = abs(f[1]) + abs(f[2]) + rest
    for k in range(3, DEGREE + 1):
        size = abs(f[k])
        high += size
        change += size
        slope += k * size
        bend += k * (k - 1.0) * size
    if not high >= floor:
        return BELOW, high
    if 2.0 * f[2] + bend < 0.0:
        return CONCAVE, high
    if 2.0 * f[2] - bend > 0.0 or abs(f[1]) > slope + 2.0 * abs(f[2]):
        return SMOOTH, high  # convex or monotone: largest at its ends
    return (LEVEL if change <= FLAT * f[0] else UNCLEAR), high


@kernel()
def top(n, c, start, end):
    """Return the time of the maximum of |p|^2 / 2 in a piece where it is concave, its value and slope."""
    low, high = start, end
    t = 0.5 * (start + end)
    value, slope, bend = square_at(n, c, t)
    for _ in range(60):
        if slope > 0.0:
            low = t
        else:
            high = t
        there = min(max(t - slope / bend, start), end) if bend < 0.0 else 0.5 * (low + high)
        if abs(there - t) <= 2e-16 * (end - start + t):
            break
        t = there if low <= there <= high else 0.5 * (low + high)
        value, slope, bend = square_at(n, c, t)
    return t, value, slope


@kernel()
def keep(times, squares, count, t, square):
    """Append a maximum, replacing the lowest one where there is no space; return their number."""
    if count and abs(times[count - 1] - t) <= APART * t:
        squares[count - 1] = max(squares[count - 1], square)
        return count
    k = count
    if count == len(times):
        k = 0
        for i in range(count):
            if squares[i] < squares[k]:
                k = i
        if squares[k] >= square:
            return count
        for i in range(k, count - 1):
            times[i], squares[i] = times[i + 1], squares[i + 1]
        k, count = count - 1, count - 1
    times[k], squares[k] = t, square
    return count + 1


@kernel()
def peaks(n, duration, c, level, times, squares):
    """Find the local maxima of |p| over [0, duration] that reach `level`, in order of time, ends included.

    Returns their number, and a certified bound on |p|^2 over the duration, at least `level`^2. `times` and
    `squares` receive times and |p|^2; where they are too short, the highest are kept.
    """
    p, sizes, f = stack_matrix(9, 3), stack_vector(10), stack_vector(9)
    floor = level * level
    count, highest = 0, floor
    value, slope, _ = square_at(n, c, 0.0)
    if slope <= 0.0 and 2.0 * value >= floor:
        count = keep(times, squares, count, 0.0, 2.0 * value)
        highest = 2.0 * value
    widest = duration if n == 0.0 else min(duration, 2.0 * WIDEST / n)
    t, width = 0.0, widest
    while t < duration:
        end = t + width
        if end > duration or duration - end < 1e-9 * width:
            end = duration
        middle = 0.5 * (t + end)
        rest = series(n, c, middle, 0.5 * (end - t), p, sizes, f)
        kind, high = kind_of(f, rest, floor)
        if kind == UNCLEAR and width > NARROWEST * widest:
            width *= 0.5
            continue
        if kind == CONCAVE:
            when, value, slope = top(n, c, t, end)
            short = abs(slope) * (end - t)  # bound on the excess over `value`
            if t < when < end or (short <= 1e-14 * value and 0.0 < when < duration):
                highest = max(highest, 2.0 * (value + short))
                if 2.0 * value >= floor:
                    count = keep(times, squares, count, when, 2.0 * value)
        elif kind >= LEVEL:
            count = keep(times, squares, count, middle, f[0])
            highest = max(highest, high)
        t = end
        width = min(2.0 * width, widest)
    value, slope, _ = square_at(n, c, duration)
    if slope >= 0.0 and 2.0 * value >= floor:
        count = keep(times, squares, count, duration, 2.0 * value)
        highest = max(highest, 2.0 * value)
    return count, highest
