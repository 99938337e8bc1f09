"""The least delta-v of impulses that keep planes between craft: one dual of all craft, and its paths.

Of N craft with times at which they may fire, and K planes a_k . (r_i - r_j)(t_k) >= s_k,

    maximise   sum g_i . c_i + sum f_k m_k   over c_i and m_k >= 0, |p_i| <= 1 at each time   # theory (37)
               or d . p_i <= 1 where the impulse is along d
    p_i(t) = Psi(t) c_i + sum over t_k > t of +- m_k Phi_rv(t_k - t)^T a_k                    # theory (38)

or of burns within a limit, V at most of each, which cost V (|p_i| - 1) where that is positive, p_i in the
mean over the burn.  f_k is what the unforced paths miss of the plane.  The primer p_i is a natural motion
between its planes, at which its rate jumps.  Newton's method follows the centres of logarithmic barriers,
whose own impulses

    v_i(t) = 2 p_i / (1 - |p_i|^2) / sharpness   or   d / (1 - d . p_i) / sharpness           # theory (39)

reach the ends and keep the planes with room to spare; a face of equal optima is left in its middle.
Under a limit 1 becomes 1 + s in both, of a slack s > 0 that has a barrier of its own and is best for each p.
Craft meet in planes only, so a step costs a 6 x 6 system each and one of all planes.
"""

from math import inf, log, sqrt

import numpy as np
from numba import float64, types

from closeform.compiled import kernel
from closeform.kernel_loans import lent, stack_vector
from closeform.motion.linear import back_substitute, factorise
from closeform.planning.impulse_rows import begin, fill_members, fill_rows, normalise
from closeform.planning.impulse_scene import DUAL, FLEET, PLANES, gain, is_free
from closeform.planning.scene import BLOCKS

STEPS = 600  # of Newton's method, at most
SHARPER = 12.0  # from one sharpness to the next
CENTRED, EXACT = 0.5, 1e-9  # Newton decrement at which the next one, or the end, is due
FIRST = 0.3  # sharpness to start with, of that at which gains and barriers are of one size
INSIDE = 0.95  # of the way to where a multiplier vanishes, or of what a start may reach
ROOT = 1e-14  # of the diagonal, added
BEYOND = 1.0 + 1e-9  # times what limits allow: more is no rounding


@kernel()
def slack_of(r, free, sharp):
    """The slack s that is best for a primer of length `r`, or r = d . p; `sharp`: sharpness times V.

    Of log((1 + s)^2 - r^2) or log(1 + s - r), and log(s) - sharp s.
    """
    if not free:
        a = sharp * (1.0 - r)
        root = sqrt(a * a + 4.0)
        return (1.0 + 2.0 / (a + root)) / sharp if a > 0.0 else 0.5 * (2.0 - a + root) / sharp
    s = max(0.0, r - 1.0) + 1.0 / sharp
    for _ in range(40):  # from where the slope is too great down a convex curve
        a, b, c = 1.0 / s, 1.0 / (s + 1.0 - r), 1.0 / (s + 1.0 + r)
        step = (a + b + c - sharp) / (a * a + b * b + c * c)
        s += step
        if not step > 1e-14 * s:
            break
    return s


@kernel()
def room_of(rows, along, sharp, size, x, p):
    """Fill `p` (3,), the primer at one moment; returns 1 - |p|^2 or 1 - d . p with its slack, and that."""
    for axis in range(3):
        p[axis] = 0.0
        for k in range(size):
            p[axis] += rows[axis, k] * x[k]
    free = is_free(along)
    square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
    if sharp == inf:
        return (1.0 - square if free else 1.0 - p[0]), 0.0
    r = sqrt(square) if free else p[0]
    s = slack_of(r, free, sharp)
    return (1.0 + s - r) * (1.0 + s + r if free else 1.0), s


@kernel()
def barrier(rows, along, most, sharpness, count, size, x):
    """The sum of the logarithms of a craft's rooms, with what their slacks add; -inf outside."""
    total, p = 0.0, stack_vector(3)
    for j in range(count):
        sharp = sharpness * most[j]
        room, slack = room_of(rows[j], along[j], sharp, size, x, p)
        if not room > 0.0:
            return -inf
        total += log(room)
        if sharp < inf:
            total += log(slack) - sharp * slack
    return total


@kernel()
def curvature(rows, along, most, sharpness, count, size, x, slope, hessian):
    """Fill the gradient of `barrier` and the upper half of its negative Hessian.

    Returns its value, what slacks cost, and the sum of all V |p|, or V d . p where that is positive.
    """
    p, e = stack_vector(3), np.empty(size)
    for a in range(size):
        slope[a] = 0.0
        for b in range(a, size):
            hessian[a, b] = 0.0
    total, cost, length = 0.0, 0.0, 0.0
    for j in range(count):
        sharp = sharpness * most[j]
        room, slack = room_of(rows[j], along[j], sharp, size, x, p)
        if not room > 0.0:
            return -inf, 0.0, 0.0
        total += log(room)
        free = is_free(along[j])
        square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
        bend = 1.0  # of how fast the slope grows along p: less where the slack gives way
        if sharp < inf:
            total += log(slack) - sharp * slack
            cost += most[j] * slack
            stiff = room * room / (slack * slack)
            if free:
                y = 1.0 + slack
                bend -= 4.0 * y * y / (2.0 * (y * y + square) + stiff)
            else:
                bend -= 1.0 / (1.0 + stiff)
        length += most[j] * (sqrt(square) if free else max(p[0], 0.0))
        if not free:
            for a in range(size):
                e[a] = rows[j, 0, a] / room
                slope[a] -= e[a]
            for a in range(size):
                for b in range(a, size):
                    hessian[a, b] += bend * e[a] * e[b]
            continue
        f = 2.0 / room
        for a in range(size):
            e[a] = f * (rows[j, 0, a] * p[0] + rows[j, 1, a] * p[1] + rows[j, 2, a] * p[2])
            slope[a] -= e[a]
        for a in range(size):
            x0, x1, x2 = f * rows[j, 0, a], f * rows[j, 1, a], f * rows[j, 2, a]
            for b in range(a, size):
                across = x0 * rows[j, 0, b] + x1 * rows[j, 1, b] + x2 * rows[j, 2, b]
                hessian[a, b] += across + bend * e[a] * e[b]
    return total, cost, length


@kernel()
def eliminate(hessian, rhs, size):
    """Solve for a craft's own six unknowns; what is left after them is for the planes."""
    for k in range(6):
        hessian[k, k] += ROOT * (1.0 + hessian[k, k])  # which may be zero
        for i in range(k + 1, size):
            share = hessian[k, i] / hessian[k, k]
            rhs[i] -= share * rhs[k]
            for j in range(i, size):  # along a row: vector instructions
                hessian[i, j] -= share * hessian[k, j]


@kernel()
def climb(
    rows, along, most, counts, members, sizes, gains, misses, sharpness, tolerance, bar, x, multipliers
):
    """Follow the barriers' centres to a relative gap; returns the bound, and the sharpness there.

    `x` (N, 6 + M) is a point inside, with the multipliers' copies; inf where no impulses keep the planes,
    or the bound passes `bar`.  Last returned is how many times the limits they need at least.
    """
    craft, number = len(counts), len(multipliers)
    width = x.shape[1]
    hessians, rhs, trial = np.empty((craft, width, width)), np.empty((craft, width)), np.empty(width)
    schur, rise, ahead = np.empty((number, number)), np.empty(number), np.empty(number)
    terms = 1.0 * number
    for i in range(craft):
        terms += terms_of(most[i], counts[i])
    bound, needed = 0.0, 0.0
    for _ in range(STEPS):
        here, bound, spare, length = 0.0, 0.0, 0.0, 0.0
        for k in range(number):
            bound += misses[k] * multipliers[k]
            here += log(multipliers[k])
            rise[k] = sharpness * misses[k] + 1.0 / multipliers[k]
            for m in range(k + 1, number):
                schur[k, m] = 0.0
            schur[k, k] = 1.0 / multipliers[k] ** 2
        for i in range(craft):
            size = 6 + sizes[i]
            value, cost, reach = curvature(
                rows[i], along[i], most[i], sharpness, counts[i], size, x[i], rhs[i], hessians[i]
            )
            here, spare, length = here + value, spare + cost, length + reach
            for a in range(6):
                bound += gains[i, a] * x[i, a]
                rhs[i, a] += sharpness * gains[i, a]
            eliminate(hessians[i], rhs[i], size)
            for a in range(sizes[i]):
                k = members[i, a]
                rise[k] += rhs[i, 6 + a]
                for b in range(a, sizes[i]):
                    m = members[i, b]
                    schur[min(k, m), max(k, m)] += hessians[i, 6 + a, 6 + b]
        here += sharpness * bound
        if bound > 0.0:
            needed = max(needed, bound / length)
        if needed > BEYOND:
            return inf, sharpness, needed  # theory (33)
        bound -= spare
        for k in range(number):
            ahead[k] = rise[k]
        factorise(schur, number)
        back_substitute(schur, ahead, number)
        decrement, step = 0.0, 1.0
        for k in range(number):
            decrement += rise[k] * ahead[k]
            if ahead[k] < 0.0:
                step = min(step, -INSIDE * multipliers[k] / ahead[k])
        for i in range(craft):
            size = 6 + sizes[i]
            for k in range(5, -1, -1):
                decrement += rhs[i, k] ** 2 / hessians[i, k, k]
                for j in range(k + 1, 6):
                    rhs[i, k] -= hessians[i, k, j] * rhs[i, j]
                for m in range(sizes[i]):
                    rhs[i, k] -= hessians[i, k, 6 + m] * ahead[members[i, m]]
                rhs[i, k] /= hessians[i, k, k]
            for m in range(sizes[i]):
                rhs[i, 6 + m] = ahead[members[i, m]]
        if not decrement < inf or bound > bar:
            return inf, sharpness, needed
        close = terms <= tolerance * sharpness * bound
        if decrement <= (EXACT if close else CENTRED):
            if close:
                return bound, sharpness, needed
            sharpness *= SHARPER
            continue
        for _ in range(60):
            there = 0.0
            for k in range(number):
                value = multipliers[k] + step * ahead[k]
                there += log(value) + sharpness * misses[k] * value
            for i in range(craft):
                size = 6 + sizes[i]
                for a in range(size):
                    trial[a] = x[i, a] + step * rhs[i, a]
                for a in range(6):
                    there += sharpness * gains[i, a] * trial[a]
                there += barrier(rows[i], along[i], most[i], sharpness, counts[i], size, trial)
            if there >= here + 0.1 * step * decrement - 1e-13 * abs(here):
                break
            step *= 0.6
        for k in range(number):
            multipliers[k] += step * ahead[k]
        for i in range(craft):
            for a in range(6 + sizes[i]):
                x[i, a] += step * rhs[i, a]
        if close and step < 1e-6:
            return bound, sharpness, needed
    return bound, sharpness, needed


@kernel()
def terms_of(most, count):
    """By how much, times the sharpness, a craft's impulses and its primer are apart at most."""
    terms = 0.0
    for j in range(count):
        terms += 1.0 if most[j] == inf else 3.0
    return terms


@kernel()
def primers_to_impulses(rows, along, most, count, size, x, sharpness, impulses):
    """Fill a craft's impulses (J, 3) from its primers at the barriers' centre.          # theory (39)"""
    p = stack_vector(3)
    for j in range(count):
        room, _ = room_of(rows[j], along[j], sharpness * most[j], size, x, p)
        free = is_free(along[j])
        for axis in range(3):
            impulses[j, axis] = (2.0 * p[axis] if free else along[j, axis]) / (room * sharpness)


@kernel(types.UniTuple(float64, 2)(FLEET, PLANES, float64, float64, DUAL, BLOCKS))
def price(fleet, planes, tolerance, bar, dual, impulses):
    """The least delta-v of a fleet that keeps planes, at its times, to a relative `tolerance`.

    Fills `impulses` (N, J, 3) and the `dual`.  inf where it is above `bar`, or no impulses keep the planes.
    Second is how many times their limits all craft need for that at least, as far as that was seen.
    """
    fleet, planes, dual = lent(fleet), lent(planes), lent(dual)
    craft, number = len(fleet.base), len(planes.times)
    sizes, members = np.zeros(craft, dtype=np.int64), np.empty((craft, number), dtype=np.int64)
    widest = fill_members(planes, members, sizes)
    rows = np.empty((craft, fleet.times.shape[1], 3, 6 + widest))
    gains, roots, x = np.empty((craft, 6)), np.empty((craft, 6, 6)), np.zeros((craft, 6 + widest))
    total, terms = 0.0, 1.0 * number
    for k in range(number):
        dual.multipliers[k] = inf
    for i in range(craft):
        gain(fleet, i, gains[i])
        fill_rows(fleet, planes, i, members[i], sizes[i], rows[i])
        if not normalise(rows[i], fleet.counts[i], gains[i], roots[i]):
            return inf, 0.0
        begin(rows[i], fleet.counts[i], members[i], sizes[i], dual.multipliers)
        terms += terms_of(fleet.most[i], fleet.counts[i])
        for a in range(6):
            total += gains[i, a] ** 2
    for k in range(number):
        if dual.multipliers[k] == inf:  # nobody can give way
            dual.multipliers[k] = 1.0
        total += (planes.misses[k] * dual.multipliers[k]) ** 2
    if total == 0.0:
        return 0.0, 0.0
    for i in range(craft):
        for m in range(sizes[i]):
            x[i, 6 + m] = dual.multipliers[members[i, m]]
    first = FIRST * sqrt(2.0 * terms / total)
    cost, sharpness, needed = climb(
        rows,
        fleet.along,
        fleet.most,
        fleet.counts,
        members,
        sizes,
        gains,
        planes.misses,
        first,
        tolerance,
        bar,
        x,
        dual.multipliers,
    )
    if cost == inf:
        return inf, needed
    for i in range(craft):
        size = 6 + sizes[i]
        primers_to_impulses(
            rows[i], fleet.along[i], fleet.most[i], fleet.counts[i], size, x[i], sharpness, impulses[i]
        )
        for a in range(5, -1, -1):  # from orthonormal unknowns back to c
            dual.starts[i, a] = x[i, a]
            for b in range(a + 1, 6):
                dual.starts[i, a] -= roots[i, b, a] * dual.starts[i, b]
            dual.starts[i, a] /= roots[i, a, a]
    return cost, needed
