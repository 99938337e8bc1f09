"""Minimum delta-v of impulses that satisfy planes between craft: one dual program of all craft.

Of N craft with times at which they may fire, and K planes a_k . (r_i - r_j)(t_k) >= s_k,

    maximise   sum g_i . c_i + sum f_k m_k   over c_i and m_k >= 0, |p_i| <= 1 at each time   # theory (37)
               or d . p_i <= 1 where the impulse is along d
    p_i(t) = Psi(t) c_i + sum over t_k > t of +- m_k Phi_rv(t_k - t)^T a_k                    # theory (38)

or of burns within a limit V each, which cost V (|p_i| - 1) where that is positive, with p_i the mean
over the burn.  f_k is the shortfall of the unforced paths from the plane.  The primer p_i is a natural motion
between its planes, at which its rate jumps.  Primers and impulses follow the centres of logarithmic
barriers, where

    v_i(t) = 2 tau p_i / (1 - |p_i|^2)   or   tau d / (1 - d . p_i)                          # theory (39)

by Mehrotra's predictor-corrector steps.  The last centre is computed accurately, so that among equal optima
the result is the centre of their face.
"""

from math import ceil, inf, log, sqrt

import numpy as np
from numba import float64, types

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, lent
from closeform.planning.delta_v.dual.cones import IMPULSE, PRIMER, ROW, place
from closeform.planning.delta_v.dual.fleet import DUAL, FLEET, PLANES, fill_effects, is_free
from closeform.planning.delta_v.dual.interior_point import Program, go, measure, step_towards, weigh_all
from closeform.planning.delta_v.dual.primer_rows import begin, fill_members, fill_rows, normalise
from closeform.planning.problem.scene import BLOCKS

STEPS = 100  # at most
BEGUN = 0.3  # of the first tau: minimum target while impulses do not reach the ends
LEAST = 1e-13  # of the first tau: lower limit
INSIDE = 0.95  # of the distance to the cones' boundary
NEAR = 2.0  # times the last tau: below it the last centre is the target
RUNGS, APART = 1.0 / 0.3, 12.0  # discrete values of the last tau, so that similar rounds end alike
EXACT = 1e-6  # squared length of the last step
BEYOND = 1.0 + 1e-9  # times the limits: above it the excess is not rounding
HOPELESS = 1e9  # units of delta-v: above any real plan


@kernel()
def rung(tau):
    """Return the largest of RUNGS, RUNGS / APART, RUNGS / APART^2, ... that is at most `tau`."""
    return RUNGS * APART ** -ceil(log(RUNGS / max(tau, LEAST)) / log(APART))


@kernel()
def barrier_terms(fleet, number):
    """Return the number of barrier terms of all moments and planes, and the degree of their cones."""
    terms = degrees = 1.0 * number
    for i in range(len(fleet.counts)):
        for j in range(fleet.counts[i]):
            limited = fleet.most[i, j] < inf
            terms += 3.0 if limited else 1.0
            degrees += (2.0 if is_free(fleet.along[i, j]) else 1.0) + (1.0 if limited else 0.0)
    return terms, degrees


@kernel()
def follow(program, terms, degrees, tolerance, bar, cones, planes, x):
    """Follow the centres to a relative gap; return the bound, and the factor that the limits require."""
    craft, number, width = len(program.counts), len(planes), x.shape[1]
    program, x = lent(program), borrowed(x)
    cones, planes = borrowed(cones), borrowed(planes)
    hessians, changes = np.empty((craft, width, width)), np.empty((craft, width))
    schur, ahead = np.empty((number, number)), np.empty(number)
    needed, last, met, done = 0.0, 0.0, False, False
    for _ in range(STEPS):
        bound, gained, length, gap = measure(program, cones, planes, x)
        if gained > 0.0:
            needed = max(needed, gained / length)
        if needed > BEYOND or not bound <= min(bar, HOPELESS):  # theory (33)
            return inf, needed
        if done:
            return bound, needed
        tau, enough = gap / degrees, rung(tolerance * bound / terms)
        if last == 0.0 and tau <= NEAR * enough:
            last = enough
        weigh_all(program, cones, planes, hessians, schur)
        goal, correction = last, 0.0
        if last == 0.0:
            first, second, _ = step_towards(program, cones, planes, hessians, schur, 0.0, 0.0, changes, ahead)
            goal = tau * (1.0 - min(first, second, 1.0)) ** 2
            goal, correction = max(goal, enough, 0.0 if met else BEGUN), 1.0
        first, second, left = step_towards(
            program, cones, planes, hessians, schur, goal, correction, changes, ahead
        )
        first, second = min(INSIDE * first, 1.0), min(INSIDE * second, 1.0)
        go(program, cones, planes, x, changes, first, second)
        met = met or second == 1.0
        done = last > 0.0 and left <= EXACT * last and min(first, second) == 1.0
    return (bound if met else inf), needed


@kernel()
def place_cones(program, multipliers, cones, planes, x):
    """Fill initial primers from the planes alone, and impulses on the centre of tau = 1 for these."""
    for k in range(len(planes)):
        for a in range(ROW):
            planes[k, a] = 0.0
        planes[k, PRIMER] = multipliers[k]
        place(planes[k], False, inf)
    for i in range(len(cones)):
        for a in range(6):
            x[i, a] = 0.0
        for m in range(program.sizes[i]):
            x[i, 6 + m] = multipliers[program.members[i, m]]
        for j in range(program.counts[i]):
            cone, free = cones[i, j], is_free(program.along[i, j])
            for a in range(ROW):
                cone[a] = 0.0
            cone[PRIMER] = 1.0
            for axis in range(3):
                p = 0.0
                for m in range(program.sizes[i]):
                    p += program.rows[i, j, axis, 6 + m] * x[i, 6 + m]
                if free:
                    cone[PRIMER + 1 + axis] = p
                else:
                    cone[PRIMER] -= p
            place(cone, free, program.most[i, j])


@kernel(types.UniTuple(float64, 2)(FLEET, PLANES, float64, float64, DUAL, BLOCKS))
def price(fleet, planes, tolerance, bar, dual, impulses):
    """Return the minimum delta-v of a fleet that satisfies planes, to a relative `tolerance`.

    Fills `impulses` (N, J, 3) and the `dual`.  The cost is inf if it is above `bar`, or if the planes are
    infeasible. The second number is a lower bound on the factor by which the limits must be increased, as far
    as known.
    """
    craft, number = len(fleet.base), len(planes.times)
    sizes, members = np.empty(craft, dtype=np.int64), np.empty((craft, number), dtype=np.int64)
    widest = fill_members(planes, members, sizes)
    rows = np.empty((craft, fleet.times.shape[1], 3, 6 + widest))
    gains, roots, pulls = np.empty((craft, 6)), np.empty((craft, 6, 6)), np.empty(number)
    effects = np.empty((number, 6))
    fill_effects(fleet, planes, effects)
    total = 0.0
    for k in range(number):
        pulls[k] = inf
    for i in range(craft):
        for a in range(6):
            gains[i, a] = fleet.gains[i, a]
        fill_rows(fleet, planes, effects, i, members[i], sizes[i], rows[i])
        if not normalise(rows[i], fleet.counts[i], gains[i], roots[i]):
            return inf, 0.0
        begin(rows[i], fleet.counts[i], members[i], sizes[i], pulls)
        for a in range(6):
            total += gains[i, a] ** 2
    for k in range(number):
        if pulls[k] == inf:  # no controllable craft
            pulls[k] = 1.0
        total += (planes.misses[k] * pulls[k]) ** 2
    if total == 0.0:
        return 0.0, 0.0
    terms, degrees = barrier_terms(fleet, number)
    unit = sqrt(total / (2.0 * terms))  # of delta-v: at tau = 1 gains and barriers are of one size
    most, misses = np.empty((craft, fleet.times.shape[1])), np.empty(number)
    for i in range(craft):
        for a in range(6):
            gains[i, a] /= unit
        for j in range(fleet.counts[i]):
            most[i, j] = fleet.most[i, j] / unit
    for k in range(number):
        misses[k] = planes.misses[k] / unit
    program = Program(rows, fleet.along, most, fleet.counts, members, sizes, gains, misses)
    cones, walls = np.empty((craft, fleet.times.shape[1], ROW)), np.empty((number, ROW))
    x = np.empty((craft, 6 + widest))
    place_cones(program, pulls, cones, walls, x)
    cost, needed = follow(program, terms, degrees, tolerance, bar / unit, cones, walls, x)
    if cost == inf:
        return inf, needed
    for k in range(number):
        dual.multipliers[k] = walls[k, PRIMER]
    for i in range(craft):
        for j in range(fleet.counts[i]):
            fill_impulse(cones[i, j], fleet.along[i, j], unit, impulses[i, j])
        for a in range(5, -1, -1):  # from orthonormal unknowns back to c
            dual.starts[i, a] = x[i, a]
            for b in range(a + 1, 6):
                dual.starts[i, a] -= roots[i, b, a] * dual.starts[i, b]
            dual.starts[i, a] /= roots[i, a, a]
    return unit * cost, needed


@kernel()
def fill_impulse(cone, along, unit, impulse):
    """Fill the impulse (3,) that is dual to a primer."""
    free = is_free(along)
    for axis in range(3):
        impulse[axis] = unit * (-cone[IMPULSE + 1 + axis] if free else cone[IMPULSE] * along[axis])
