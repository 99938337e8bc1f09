"""Paths from optimal impulses: end states met to rounding, with no more impulses than necessary."""

from math import inf, sqrt

import numpy as np
from numba import int64, void

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, PUSH, START, STATE, state_at
from closeform.motion.linear import triangle
from closeform.planning.delta_v.dual.fleet import (
    FLEET,
    PLANES,
    fill_effects,
    forces,
    is_free,
    mean_rows,
    project,
)
from closeform.planning.problem.natural_motion import rate_of, state_after, state_at_first
from closeform.planning.problem.scene import BLOCKS, INDICES, ROWS

REPAIRS = 3  # corrections of the ends for rounding
NOTHING, ROUNDING = 1e-9, 1e-4  # tolerance of terms that add up to zero, and the weight of their scale
DEPENDENT = 1e-12  # of the largest pivot: below it columns are dependent
SLIGHT = 1e-16  # of the squared scale of a natural motion: below it impulses have no effect


@kernel()
def repair(fleet, i, impulses):
    """Correct a craft's impulses to reach its end: sizes, and directions where these are free.

    The correction is minimal, and larger for large impulses.
    """
    n, lasts = rate_of(fleet), fleet.base[i, END] - fleet.base[i, START]
    matrix, left, psi = stack_matrix(6, 6), stack_vector(6), stack_matrix(3, 6)
    away = lasts if n * lasts < 1.0 else 1.0 / n  # displacement by a speed of 1
    for _ in range(REPAIRS):
        total = 0.0
        for a in range(6):
            left[a] = fleet.gains[i, a]  # minus the sum of Psi^T v, theory (27)
            for b in range(6):
                matrix[a, b] = 0.0
        for j in range(fleet.counts[i]):
            v = impulses[i, j]
            weight = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
            if weight == 0.0:
                continue
            total += weight
            mean_rows(fleet, fleet.times[i, j], fleet.widths[i, j], psi)
            project(fleet.along[i, j], psi)
            for a in range(6):
                for axis in range(3):
                    left[a] -= psi[axis, a] * v[axis]
                    for b in range(6):
                        matrix[a, b] += weight * psi[axis, a] * psi[axis, b]
        for a in range(6):  # two impulses half an orbit apart control fewer than six components
            if matrix[a, a] < SLIGHT * total * (1.0 if a < 3 else away * away):
                for b in range(6):
                    matrix[a, b] = matrix[b, a] = 0.0
        triangle(matrix, 6)  # uncontrolled components stay as they are
        for a in range(6):
            for b in range(a):
                left[a] -= matrix[a, b] * left[b]
            left[a] /= matrix[a, a]
        for a in range(5, -1, -1):
            for b in range(a + 1, 6):
                left[a] -= matrix[b, a] * left[b]
            left[a] /= matrix[a, a]
        for j in range(fleet.counts[i]):
            v = impulses[i, j]
            weight = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
            if weight == 0.0:
                continue
            mean_rows(fleet, fleet.times[i, j], fleet.widths[i, j], psi)
            project(fleet.along[i, j], psi)
            change = stack_vector(3)
            for axis in range(3):
                change[axis] = 0.0
                for a in range(6):
                    change[axis] += weight * psi[axis, a] * left[a]
            grown = weight * weight + change[0] * v[0] + change[1] * v[1] + change[2] * v[2]
            pulls = grown < 0.0 and not is_free(fleet.along[i, j])
            for axis in range(3):
                v[axis] = 0.0 if pulls else v[axis] + change[axis]


@kernel()
def clear(row):
    """Fill an arc with zeros."""
    for k in range(len(row)):
        row[k] = 0.0


@kernel()
def begin_arc(n, row, start, end, state):
    """Set times, mean motion and initial state of an arc."""
    row[START], row[END], row[MEAN_MOTION] = start, end, n
    for a in range(6):
        row[STATE + a] = state[a]


@kernel()
def burn_after(fleet, v, arc, state):
    """Replace a state at the start of a burn of delta-v `v` by that at its end."""
    if len(fleet.clock) == 0:
        x, y, z, vx, vy, vz = state_at(arc, arc[END])
        state[0], state[1], state[2], state[3], state[4], state[5] = x, y, z, vx, vy, vz
        return
    psi, moved = stack_matrix(3, 6), stack_vector(6)
    mean_rows(fleet, arc[START], arc[END] - arc[START], psi)
    for a in range(6):  # the change of state, seen at the first time: see `effect_of`
        moved[a] = psi[0, a] * v[0] + psi[1, a] * v[1] + psi[2, a] * v[2]
    state_at_first(fleet, arc[START], state)
    for a in range(3):
        state[a] -= moved[3 + a]
        state[3 + a] += moved[a]
        for b in range(3):
            state[3 + a] += fleet.form[a, b] * moved[3 + b]
    state_after(fleet, fleet.span[0], arc[END], state)


@kernel(int64(FLEET, BLOCKS, ROWS, INDICES))
def fill_trajectories(fleet, impulses, arcs, offsets):
    """Fill the craft's paths with repaired ends over the whole time span; return the number of arcs."""
    row, state = 0, stack_vector(6)
    for i in range(len(fleet.base)):
        offsets[i] = row
        repair(fleet, i, impulses)
        n, t = fleet.base[i, MEAN_MOTION], fleet.span[0]
        for a in range(6):
            state[a] = fleet.base[i, STATE + a]
        state_after(fleet, fleet.base[i, START], t, state)
        clear(arcs[row])
        for j in range(fleet.counts[i] + 1):
            last = j == fleet.counts[i]
            if not last and not (impulses[i, j, 0] or impulses[i, j, 1] or impulses[i, j, 2]):
                continue
            there = fleet.span[1] if last else max(fleet.times[i, j], t)
            begin_arc(n, arcs[row], t, there, state)
            state_after(fleet, t, there, state)
            if there > t:
                row += 1
                clear(arcs[row])
            if last:
                if t >= there and (arcs[row, IMPULSE] or arcs[row, IMPULSE + 1] or arcs[row, IMPULSE + 2]):
                    row += 1  # an impulse at the very end
                break
            t = there
            if fleet.widths[i, j] == 0.0:
                for axis in range(3):
                    state[3 + axis] += impulses[i, j, axis]
                    arcs[row, IMPULSE + axis] += impulses[i, j, axis]
                continue
            t = min(fleet.times[i, j] + fleet.widths[i, j], fleet.base[i, END])
            begin_arc(n, arcs[row], there, t, state)
            for axis in range(3):
                arcs[row, PUSH + axis] = impulses[i, j, axis] / (t - there)
            burn_after(fleet, impulses[i, j], arcs[row], state)
            row += 1
            clear(arcs[row])
    offsets[len(fleet.base)] = row
    return row


@kernel()
def null_vector(matrix, size, columns, z, order):
    """Fill `z` with a null vector of the matrix, by elimination with complete pivoting; overwrite it."""
    for c in range(columns):
        order[c] = c
    rank, first = 0, 0.0
    while rank < min(size, columns - 1):
        row, column, largest = rank, rank, -1.0
        for i in range(rank, size):
            for j in range(rank, columns):
                if abs(matrix[i, j]) > largest:
                    row, column, largest = i, j, abs(matrix[i, j])
        first = max(first, largest)
        if largest <= DEPENDENT * first:
            break
        for j in range(columns):
            matrix[rank, j], matrix[row, j] = matrix[row, j], matrix[rank, j]
        for i in range(size):
            matrix[i, rank], matrix[i, column] = matrix[i, column], matrix[i, rank]
        order[rank], order[column] = order[column], order[rank]
        for i in range(rank + 1, size):
            factor = matrix[i, rank] / matrix[rank, rank]
            for j in range(rank, columns):
                matrix[i, j] -= factor * matrix[rank, j]
        rank += 1
    for c in range(columns):
        z[order[c]] = 1.0 if c == rank else 0.0
    for k in range(rank - 1, -1, -1):
        total = -matrix[k, rank]
        for j in range(k + 1, rank):
            total -= matrix[k, j] * z[order[j]]
        z[order[k]] = total / matrix[k, k]


@kernel(void(FLEET, PLANES, BLOCKS))
def keep_fewest(fleet, planes, impulses):
    """Reduce each craft's impulses to the number that ends and planes require, without a larger sum of sizes.

    The effect of many impulses along fixed directions is a sum in few dimensions, so that some can be
    replaced by others (Caratheodory), in the direction in which the sum of sizes does not grow.  Of burns
    within a limit, few remain that are neither zero nor at the limit.
    """
    number, most = len(planes.times), fleet.times.shape[1]
    effects, work = np.empty((6 + number, most)), np.empty((6 + number, 7 + number))
    sizes, z = np.empty(most), np.empty(7 + number)
    used, order = np.empty(most, dtype=np.int64), np.empty(7 + number, dtype=np.int64)
    psi, pushed, drawn = stack_matrix(3, 6), stack_vector(3), np.empty((number, 6))
    fill_effects(fleet, planes, drawn)
    for i in range(len(fleet.base)):
        height = 6
        for k in range(number):
            if planes.first[k] == i or planes.second[k] == i:
                height += 1
        count = 0
        for j in range(fleet.counts[i]):
            v = impulses[i, j]
            size = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) ** 0.5
            sizes[j] = size
            if size == 0.0 or size >= fleet.most[i, j]:
                continue
            used[count] = j
            count += 1
            mean_rows(fleet, fleet.times[i, j], fleet.widths[i, j], psi)
            for a in range(6):
                effects[a, j] = (psi[0, a] * v[0] + psi[1, a] * v[1] + psi[2, a] * v[2]) / size
            row = 6
            for k in range(number):
                if planes.first[k] == i or planes.second[k] == i:
                    forces(fleet, planes, drawn, k, i, j, psi, pushed)
                    effects[row, j] = (pushed[0] * v[0] + pushed[1] * v[1] + pushed[2] * v[2]) / size
                    row += 1
        scale_rows(effects, height, used, count)
        while count > 1:
            columns = min(height + 1, count)
            for a in range(height):
                for c in range(columns):
                    work[a, c] = effects[a, used[c]]
            null_vector(work, height, columns, z, order)
            if not is_null(effects, height, used, columns, z):
                break
            drop_one(impulses[i], sizes, fleet.most[i], used, columns, z)
            left = 0
            for c in range(count):
                if 0.0 < sizes[used[c]] < fleet.most[i, used[c]]:
                    used[left] = used[c]
                    left += 1
            count = left


@kernel()
def scale_rows(matrix, size, used, count):
    """Scale rows of different units to the same size."""
    for a in range(size):
        largest = 0.0
        for c in range(count):
            largest = max(largest, abs(matrix[a, used[c]]))
        for c in range(count):
            matrix[a, used[c]] /= largest if largest > 0.0 else 1.0


@kernel()
def is_null(matrix, size, used, columns, z):
    """Return whether the columns of a matrix with scaled rows add up to zero when weighted by z."""
    weight = 0.0
    for c in range(columns):
        weight += abs(z[c])
    for a in range(size):
        total, terms = 0.0, ROUNDING * weight
        for c in range(columns):
            total += matrix[a, used[c]] * z[c]
            terms += abs(matrix[a, used[c]] * z[c])
        if abs(total) > NOTHING * terms:
            return False
    return True


@kernel()
def drop_one(impulses, sizes, most, used, columns, z):
    """Change sizes along z or against it, without a larger sum, until one is zero or at its limit."""
    total = 0.0
    for c in range(columns):
        total += z[c]
    sign = 1.0 if total <= 0.0 else -1.0
    step, gone, left = inf, 0, 0.0
    for c in range(columns):
        pull, j = sign * z[c], used[c]
        room = sizes[j] if pull < 0.0 else most[j] - sizes[j]
        if pull != 0.0 and room < abs(pull) * step:
            step, gone, left = room / abs(pull), c, 0.0 if pull < 0.0 else most[j]
    for c in range(columns):
        j = used[c]
        size = min(max(sizes[j] + sign * step * z[c], 0.0), most[j]) if c != gone else left
        for axis in range(3):
            impulses[j, axis] *= size / sizes[j]
        sizes[j] = size
