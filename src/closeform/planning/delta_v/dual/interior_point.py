"""Steps of the joint dual program: six unknowns of each craft, and one system of all planes.

The multiplier m of a plane and the plane's slack form a cone of one number and its dual.
"""

from math import inf
from typing import Any, NamedTuple

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import stack_vector
from closeform.motion.linear import back_substitute, factorise
from closeform.planning.delta_v.dual.cones import (
    IMPULSE,
    PRIMER,
    SCALING,
    SLACK,
    SPARED,
    advance,
    aim,
    complement,
    decrement,
    primer_length,
    reach,
    room,
    scale,
    turn,
    weights,
)
from closeform.planning.delta_v.dual.fleet import is_free

ROOT = 1e-14  # of the diagonal, added
BEYOND = 2.0  # of a step: upper limit of the search for the boundary


class Program(NamedTuple):
    """Dual program of N craft and K planes, in its own unit of delta-v.

    Primers are `rows` (N, J, 3, 6 + M) times each craft's unknowns, including the multipliers of its
    `members`.  Where the impulse is `along` a direction, the first of the three rows is d . p.
    """

    rows: Floats
    along: Floats  # (N, J, 3)
    most: Floats  # (N, J)
    counts: Any  # (N,) of J
    members: Any  # (N, K) planes of each craft
    sizes: Any  # (N,) of them
    gains: Floats  # (N, 6)
    misses: Floats  # (K,)


@kernel()
def weigh(rows, along, cones, count, size, hessian):
    """Scale a craft's cones; fill the Hessian of its unknowns."""
    for a in range(size):
        row = hessian[a]
        for b in range(size):
            row[b] = 0.0
    for j in range(count):
        cone, free = cones[j], is_free(along[j])
        scale(cone)
        straight, bend = weights(cone, free)
        r0, r1, r2 = rows[j, 0], rows[j, 1], rows[j, 2]
        if not free:
            for a in range(size):
                row, x0 = hessian[a], straight * r0[a]
                for b in range(size):
                    row[b] += x0 * r0[b]
            continue
        w0, w1, w2 = cone[SCALING + 1], cone[SCALING + 2], cone[SCALING + 3]
        for a in range(size):
            x0, x1, x2, row = r0[a], r1[a], r2[a], hessian[a]
            if x0 == 0.0 and x1 == 0.0 and x2 == 0.0:  # a plane that does not act on this moment
                continue
            lean = bend * (w0 * x0 + w1 * x1 + w2 * x2)
            y0, y1, y2 = straight * x0 + lean * w0, straight * x1 + lean * w1, straight * x2 + lean * w2
            for b in range(size):  # all, not the upper half: vector instructions
                row[b] += y0 * r0[b] + y1 * r1[b] + y2 * r2[b]


@kernel()
def eliminate(hessian, size):
    """Factorise a craft's own six unknowns; the remainder is the Schur complement of its planes."""
    for k in range(6):
        hessian[k, k] += ROOT * (1.0 + hessian[k, k])  # which may be zero
        for i in range(k + 1, size):
            share = hessian[k, i] / hessian[k, k]
            for j in range(i, size):  # along a row: vector instructions
                hessian[i, j] -= share * hessian[k, j]


@kernel()
def weigh_all(program, cones, planes, hessians, schur):
    """Factorise the system of a step, for each craft and for all planes."""
    number, sizes = len(planes), program.sizes
    for k in range(number):
        scale(planes[k])
        for m in range(k, number):
            schur[k, m] = 0.0
        schur[k, k], _ = weights(planes[k], False)
    for i in range(len(sizes)):
        count, size = program.counts[i], 6 + sizes[i]
        weigh(program.rows[i], program.along[i], cones[i], count, size, hessians[i])
        eliminate(hessians[i], size)
        for a in range(sizes[i]):
            k = program.members[i, a]
            for b in range(a, sizes[i]):
                m = program.members[i, b]
                schur[min(k, m), max(k, m)] += hessians[i, 6 + a, 6 + b]
    factorise(schur, number)


@kernel()
def solve(hessians, schur, members, sizes, x, multipliers):
    """Solve the system of a step in place: for each craft (N, 6 + M), and for all planes (K,)."""
    for i in range(len(sizes)):
        for k in range(6):
            share = x[i, k] / hessians[i, k, k]
            for j in range(k + 1, 6 + sizes[i]):
                x[i, j] -= share * hessians[i, k, j]
        for m in range(sizes[i]):
            multipliers[members[i, m]] += x[i, 6 + m]
    back_substitute(schur, multipliers, len(multipliers))
    for i in range(len(sizes)):
        for m in range(sizes[i]):
            x[i, 6 + m] = multipliers[members[i, m]]
        for k in range(5, -1, -1):
            for j in range(k + 1, 6 + sizes[i]):
                x[i, k] -= hessians[i, k, j] * x[i, j]
            x[i, k] /= hessians[i, k, k]


@kernel()
def measure(program, cones, planes, x):
    """Return the bound, the gain without the cost of limits, the sum of V |p|, and the gap."""
    gained, spent, length, gap = 0.0, 0.0, 0.0, 0.0
    for k in range(len(planes)):
        gained += program.misses[k] * planes[k, PRIMER]
        gap += complement(planes[k])
    for i in range(len(program.counts)):
        for a in range(6):
            gained += program.gains[i, a] * x[i, a]
        for j in range(program.counts[i]):
            cone, most = cones[i, j], program.most[i, j]
            gap += complement(cone)
            length += primer_length(cone, is_free(program.along[i, j]), most)
            if most < inf:
                spent += most * cone[SLACK]
    return gained - spent, gained, length, gap


@kernel()
def step_towards(program, cones, planes, hessians, schur, tau, correction, changes, ahead):
    """Fill the changes of all unknowns and cones towards the centre of `tau`.

    `correction` is the fraction of the second-order term of the previous changes.  Returns the maximum step
    of the primers, that of the impulses, and the squared length of the step.
    """
    p, first, second, left = stack_vector(3), BEYOND, BEYOND, 0.0
    for k in range(len(planes)):
        aim(planes[k], False, inf, tau, correction, p)
        ahead[k] = program.misses[k] + p[0]
    for i in range(len(program.counts)):
        size, rows = 6 + program.sizes[i], program.rows[i]
        for a in range(size):
            changes[i, a] = program.gains[i, a] if a < 6 else 0.0
        for j in range(program.counts[i]):
            aim(cones[i, j], is_free(program.along[i, j]), program.most[i, j], tau, correction, p)
            for a in range(size):
                changes[i, a] -= p[0] * rows[j, 0, a] + p[1] * rows[j, 1, a] + p[2] * rows[j, 2, a]
    solve(hessians, schur, program.members, program.sizes, changes, ahead)
    p[1] = p[2] = 0.0
    for k in range(len(planes)):
        p[0] = -ahead[k]
        turn(planes[k], False, inf, p)
        left += decrement(planes[k])
        first, second = reach(planes[k], PRIMER, first), reach(planes[k], IMPULSE, second)
    for i in range(len(program.counts)):
        for j in range(program.counts[i]):
            cone, row, most = cones[i, j], program.rows[i, j], program.most[i, j]
            p[0] = p[1] = p[2] = 0.0
            for a in range(6 + program.sizes[i]):
                for axis in range(3):
                    p[axis] += row[axis, a] * changes[i, a]
            turn(cone, is_free(program.along[i, j]), most, p)
            left += decrement(cone)
            first, second = reach(cone, PRIMER, first), reach(cone, IMPULSE, second)
            if most < inf:
                first, second = min(first, room(cone, SLACK)), min(second, room(cone, SPARED))
    return first, second, left


@kernel()
def go(program, cones, planes, x, changes, first, second):
    """Apply shares of the changes: `first` of the primers', `second` of the impulses'."""
    for k in range(len(planes)):
        advance(planes[k], False, first, second)
    for i in range(len(program.counts)):
        for a in range(6 + program.sizes[i]):
            x[i, a] += first * changes[i, a]
        for j in range(program.counts[i]):
            advance(cones[i, j], program.most[i, j] < inf, first, second)
