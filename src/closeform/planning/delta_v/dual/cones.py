"""Cone of a moment: a primer within its bound, the dual impulse, and steps of both.

An impulse of any direction has s = (1 + slack, p) and u = (t, -v), the first number of each no less than
the length of the rest; one along d has s = (1 + slack - d . p, 0, 0, 0) and u = (v, 0, 0, 0).  At the
barriers' centre s o u = (2 tau, 0, 0, 0), or (tau, 0, 0, 0), in the Jordan product.  Where an impulse has a
limit V, a slack is dual to the unused impulse V - t: their product is tau.  Steps of s and u are those of
Newton's method with Nesterov-Todd scaling, W u = s / W.                                # theory (37), (39)
"""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_vector

# Offsets of one moment's numbers: four of the primer's side, four of the impulse's, slack and unused
# impulse; the scaling w (4), and its inverse squared size, the growth of an impulse with its primer; the
# changes of the first ten; and the targets of u and the unused impulse.
PRIMER, IMPULSE, SLACK, SPARED, SCALING, GROWTH, CHANGE, AIM, ROW = 0, 4, 8, 9, 10, 14, 15, 25, 30


@kernel()
def square(cone, at):
    """Return a^2 - |b|^2 of a point (a, b), positive inside a cone, whose four numbers start at `at`."""
    a, x, y, z = cone[at], cone[at + 1], cone[at + 2], cone[at + 3]
    return a * a - (x * x + y * y + z * z)


@kernel()
def place(cone, free, most):
    """Set the impulse on the centre of tau = 1 for the given primer."""
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
    """Return the scalar product of a point and its dual."""
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
    """Return the decrease of the impulse and of the unused impulse per slack; inf without a limit."""
    if cone[SLACK] == 0.0:
        return inf
    return (2.0 * cone[SCALING] ** 2 - 1.0) * cone[GROWTH] + cone[SPARED] / cone[SLACK]


@kernel()
def weights(cone, free):
    """Return the growth of an impulse with its primer: isotropic, and along w."""
    share = cone[GROWTH] / stiffness(cone)
    if not free:
        return (1.0 - share) * cone[GROWTH], 0.0
    return cone[GROWTH], (2.0 - 4.0 * cone[SCALING] ** 2 * share) * cone[GROWTH]


@kernel()
def aim(cone, free, most, tau, share, v):
    """Fill `v` (3,), the target of the impulse at the centre of `tau` for a fixed primer.

    It is corrected by a `share` of the product of the previous changes.
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
    """Fill `out` (4,) with W times four values that start at `at`, or its inverse where `sign` is -1.

    `size` and `bend` are the factors of W, or of its inverse.
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
    """Subtract the scaled second-order term of the changes of s and u from the target of u."""
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
    """Fill the change of a cone towards its target for the change of its `primer` (3,), or of d . p first."""
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
    """Return the largest step of the point at `at` inside its cone, up to `most`."""
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
    """Return the largest step of the positive number at `at`."""
    return -cone[at] / cone[CHANGE + at] if cone[CHANGE + at] < 0.0 else inf


@kernel()
def primer_length(cone, free, most):
    """Return V |p|, or V d . p where that is positive; inf without a limit V."""
    if most == inf:
        return inf
    if not free:
        return most * max(1.0 + cone[SLACK] - cone[PRIMER], 0.0)
    return most * sqrt(cone[PRIMER + 1] ** 2 + cone[PRIMER + 2] ** 2 + cone[PRIMER + 3] ** 2)


@kernel()
def decrement(cone):
    """Return the squared length of the step in the barrier's local norm, times tau."""
    total = cone[CHANGE + SLACK] * (cone[AIM + 4] - cone[SPARED])
    for k in range(4):
        total += cone[CHANGE + k] * (cone[AIM + k] - cone[IMPULSE + k])
    return total


@kernel()
def advance(cone, limited, first, second):
    """Apply shares of the change: `first` of the primer's side, `second` of the impulse's."""
    for k in range(4):
        cone[PRIMER + k] += first * cone[CHANGE + PRIMER + k]
        cone[IMPULSE + k] += second * cone[CHANGE + IMPULSE + k]
    if limited:
        cone[SLACK] += first * cone[CHANGE + SLACK]
        cone[SPARED] += second * cone[CHANGE + SPARED]


@kernel()
def complement(cone):
    """Return the contribution of a cone to the gap."""
    return cone[SLACK] * cone[SPARED] + product(cone)
