"""The cone of a moment: a primer within its bound, the impulse dual to that, and steps of both.

An impulse of any direction has s = (1 + slack, p) and u = (t, -v), the first number of each no less than
the length of the rest; one along d has s = (1 + slack - d . p, 0, 0, 0) and u = (v, 0, 0, 0).  At the
barriers' centre s o u = (2 tau, 0, 0, 0), or (tau, 0, 0, 0), in Jordan's product.  A slack, where an impulse
has a limit V, is dual to what the impulse spares, V - t: their product is tau.  Steps of s and u are those of
Newton's method with both scaled to one point, W u = s / W (Nesterov and Todd).         # theory (37), (39)
"""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_vector

# One moment's numbers: four of the primer's side and four of the impulse's, slack and what is spared; the
# scaling, w (4), and one over the square of its size, by which an impulse grows with its primer; how the
# first ten change; and where u and what is spared tend to.
PRIMER, IMPULSE, SLACK, SPARED, SCALING, GROWTH, CHANGE, AIM, ROW = 0, 4, 8, 9, 10, 14, 15, 25, 30


@kernel()
def square(cone, at):
    """a^2 - |b|^2 of a point (a, b), above 0 inside a cone, whose four numbers begin `at` some place."""
    a, x, y, z = cone[at], cone[at + 1], cone[at + 2], cone[at + 3]
    return a * a - (x * x + y * y + z * z)


@kernel()
def place(cone, free, most):
    """Put the impulse on the centre of a primer that is there, of tau = 1, as though that were short."""
    order = 2.0 if free else 1.0
    if most < inf:
        middle = 0.5 * (most + order + 1.0)
        cone[IMPULSE] = order * most / (middle + sqrt(middle * middle - order * most))
        cone[SPARED] = most - cone[IMPULSE]
        cone[SLACK] = 1.0 / cone[SPARED]
        cone[PRIMER] += cone[SLACK]
    else:
        cone[IMPULSE] = order * cone[PRIMER] / square(cone, PRIMER)
    for axis in range(1, 4):
        cone[IMPULSE + axis] = -cone[IMPULSE] * cone[PRIMER + axis] / cone[PRIMER]


@kernel()
def product(cone):
    """The scalar product of a point and its dual."""
    total = 0.0
    for k in range(4):
        total += cone[PRIMER + k] * cone[IMPULSE + k]
    return total


@kernel()
def scale(cone):
    """Fill the scaling of a point and its dual."""
    s, u = 1.0 / sqrt(square(cone, PRIMER)), 1.0 / sqrt(square(cone, IMPULSE))
    both = 1.0 / sqrt(2.0 * (1.0 + s * u * product(cone)))
    for k in range(4):
        sign = 1.0 if k == 0 else -1.0
        cone[SCALING + k] = both * (s * cone[PRIMER + k] + sign * u * cone[IMPULSE + k])
    cone[GROWTH] = s / u


@kernel()
def stiffness(cone):
    """By how much the impulse's first number and what is spared fall with a slack; inf without a limit."""
    if cone[SLACK] == 0.0:
        return inf
    return (2.0 * cone[SCALING] ** 2 - 1.0) * cone[GROWTH] + cone[SPARED] / cone[SLACK]


@kernel()
def weights(cone, free):
    """How an impulse grows with its primer: by the first of these, and by the second along w."""
    share = cone[GROWTH] / stiffness(cone)
    if not free:
        return (1.0 - share) * cone[GROWTH], 0.0
    return cone[GROWTH], (2.0 - 4.0 * cone[SCALING] ** 2 * share) * cone[GROWTH]


@kernel()
def aim(cone, free, most, tau, share, v):
    """Fill `v` (3,), to which the impulse tends while its primer stays, at a centre of `tau`.

    Corrected by a `share` of the product of the changes before.
    """
    inverse = (2.0 if free else 1.0) * tau / square(cone, PRIMER)
    for k in range(4):
        sign = 1.0 if k == 0 else -1.0
        cone[AIM + k] = sign * inverse * cone[PRIMER + k]
    product = share * cone[CHANGE + SLACK] * cone[CHANGE + SPARED]
    if share > 0.0:
        correct(cone, share)
    lower = 0.0
    if most < inf:
        cone[AIM + 4] = (tau - product) / cone[SLACK]
        lower = (cone[AIM] + cone[AIM + 4] - most) / stiffness(cone)
    if free:
        for axis in range(3):
            pull = -2.0 * cone[SCALING] * cone[SCALING + 1 + axis] * cone[GROWTH]
            v[axis] = lower * pull - cone[AIM + 1 + axis]
    else:
        v[0], v[1], v[2] = cone[AIM] - lower * cone[GROWTH], 0.0, 0.0


@kernel()
def scaled(cone, values, at, sign, size, bend, out):
    """Fill `out` (4,): W times four values that begin `at` some place, or its inverse where `sign` is -1.

    Its `size`, or one over that, and its `bend` are given.
    """
    along = 0.0
    for k in range(1, 4):
        along += cone[SCALING + k] * values[at + k]
    out[0] = size * (cone[SCALING] * values[at] + sign * along)
    lean = along * bend + sign * values[at]
    for k in range(1, 4):
        out[k] = size * (values[at + k] + cone[SCALING + k] * lean)


@kernel()
def correct(cone, share):
    """Take from the aim of u what lines miss of the product of the changes of s and u, scaled."""
    s, u, x, y = stack_vector(4), stack_vector(4), stack_vector(4), stack_vector(4)
    small = sqrt(cone[GROWTH])
    large, bend = 1.0 / small, 1.0 / (1.0 + cone[SCALING])
    scaled(cone, cone, CHANGE + PRIMER, -1.0, small, bend, s)
    scaled(cone, cone, CHANGE + IMPULSE, 1.0, large, bend, u)
    scaled(cone, cone, IMPULSE, 1.0, large, bend, x)
    one, both = 1.0 / x[0], x[0] * s[0] * u[0]
    for k in range(1, 4):
        both += x[0] * s[k] * u[k] - x[k] * (s[0] * u[k] + u[0] * s[k])
    y[0] = both / square(x, 0)
    for k in range(1, 4):
        y[k] = (s[0] * u[k] + u[0] * s[k] - y[0] * x[k]) * one
    scaled(cone, y, 0, -1.0, small, bend, x)
    for k in range(4):
        cone[AIM + k] -= share * x[k]


@kernel()
def turn(cone, free, most, primer):
    """Fill how a cone changes with its `primer` (3,), or with d . p, the first of them, towards its aim."""
    slack = 0.0
    if most < inf:
        slack = cone[AIM] + cone[AIM + 4] - most
        if free:
            for axis in range(3):
                slack += 2.0 * cone[SCALING] * cone[SCALING + 1 + axis] * primer[axis] * cone[GROWTH]
        else:
            slack += primer[0] * cone[GROWTH]
        slack /= stiffness(cone)
        cone[CHANGE + SPARED] = cone[AIM + 4] - cone[SPARED] * (1.0 + slack / cone[SLACK])
    cone[CHANGE + SLACK] = slack
    cone[CHANGE] = slack if free else slack - primer[0]
    along = cone[SCALING] * cone[CHANGE]
    for axis in range(3):
        cone[CHANGE + 1 + axis] = primer[axis] if free else 0.0
        along -= cone[SCALING + 1 + axis] * cone[CHANGE + 1 + axis]
    for k in range(4):
        sign = 1.0 if k == 0 else -1.0
        pushed = sign * (2.0 * cone[SCALING + k] * along - cone[CHANGE + k]) * cone[GROWTH]
        cone[CHANGE + IMPULSE + k] = cone[AIM + k] - pushed - cone[IMPULSE + k]


@kernel()
def reach(cone, at, most):
    """How far the point `at` some place can change inside its cone, up to `most`."""
    ahead = cone[CHANGE + at]
    a, b, c = square(cone, CHANGE + at), cone[at] * ahead, square(cone, at)
    for k in range(at + 1, at + 4):
        b -= cone[k] * cone[CHANGE + k]
    if cone[at] + most * ahead > 0.0 and (a * most + 2.0 * b) * most + c > 0.0:
        return most
    root = sqrt(max(b * b - a * c, 0.0))
    if b < 0.0:
        return min(most, c / (root - b))
    return min(most, -(b + root) / a) if a < 0.0 else most


@kernel()
def room(cone, at):
    """How far a positive number `at` some place can change."""
    return -cone[at] / cone[CHANGE + at] if cone[CHANGE + at] < 0.0 else inf


@kernel()
def primer_length(cone, free, most):
    """V |p|, or V d . p where that is positive; inf without a limit V."""
    if most == inf:
        return inf
    if not free:
        return most * max(1.0 + cone[SLACK] - cone[PRIMER], 0.0)
    return most * sqrt(cone[PRIMER + 1] ** 2 + cone[PRIMER + 2] ** 2 + cone[PRIMER + 3] ** 2)


@kernel()
def decrement(cone):
    """The square of how far the step goes, in the barrier's own measure, times tau."""
    total = cone[CHANGE + SLACK] * (cone[AIM + 4] - cone[SPARED])
    for k in range(4):
        total += cone[CHANGE + k] * (cone[AIM + k] - cone[IMPULSE + k])
    return total


@kernel()
def advance(cone, limited, first, second):
    """Go a share of the change: the `first` of the primer's side, the `second` of the impulse's."""
    for k in range(4):
        cone[PRIMER + k] += first * cone[CHANGE + PRIMER + k]
        cone[IMPULSE + k] += second * cone[CHANGE + IMPULSE + k]
    if limited:
        cone[SLACK] += first * cone[CHANGE + SLACK]
        cone[SPARED] += second * cone[CHANGE + SPARED]


@kernel()
def complement(cone):
    """What a cone adds to the gap."""
    return cone[SLACK] * cone[SPARED] + product(cone)
