"""Minimum-delta-v impulses: at most six, with a certified lower bound on the cost of any plan.

The maximum of (27), g . c over primers with |p| <= 1, equals the minimum sum of |v_k|: the problem is
convex, with six unknowns for any number of times.                                               # theory (29)

A primer of constant length is tried first (28).  If it is optimal, every instant is, infinitely many
plans have the same cost, and nonnegative weights choose one.  Otherwise a barrier and Newton's method find
one (`reduced`).  Every answer has a certified lower bound, g . c over the
largest |p|, and the cost of a plan that ends in its final state: the gap between them is valid however the
plan was found.

Here time runs from 0 to 1, lengths are divided by the duration, and n is the angle in a duration.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from math import inf, sqrt

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
from closeform.motion.arc import END, START, STATE
from closeform.motion.duration import MOST_TURNS
from closeform.motion.linear import dot, factorise
from closeform.motion.minimum_delta_v.barrier import TIME, WIDTH
from closeform.motion.minimum_delta_v.constant_primers import constant_primer
from closeform.motion.minimum_delta_v.nonnegative import MOST
from closeform.motion.minimum_delta_v.primer import gained, peaks, position_rows, rate_rows, square_at
from closeform.motion.minimum_delta_v.reduced import (
    ANSWER,
    COUNT,
    FIRST,
    GAP,
    LOWER,
    PRIMER,
    TOUCHING,
    UNIQUE,
    UPPER,
    improve,
    keep_bound,
    lay,
    natural,
    weigh,
)

GRID, GRID_PER_TURN = 13, 12.0  # times of the barrier's grid
FINER = 4  # grids of times, each four times as fine as the last, around the times used
EXACT = 1e-15  # share of the states: a smaller change is rounding, for each radian
CHUNK = 64  # transfers that one thread takes at a time


@kernel()
def orthonormal(n, duration, count, metric):
    """Fill the upper triangular `metric` (6, 6).

    With c = metric y, |y|^2 is the mean of |p|^2 at equal intervals.
    """
    psi, mean = stack_matrix(3, 6), stack_matrix(6, 6)
    for i in range(6):
        for j in range(6):
            mean[i, j] = metric[i, j] = 0.0
    for k in range(count):
        position_rows(n, duration * k / (count - 1.0), psi)
        for axis in range(3):
            for i in range(6):
                for j in range(i, 6):
                    mean[i, j] += psi[axis, i] * psi[axis, j]
    factorise(mean, 6)  # mean = R' R with rows of R those of `mean` over the roots of the diagonal
    for j in range(6):
        metric[j, j] = sqrt(count / mean[j, j])
        for i in range(j - 1, -1, -1):
            for k in range(i + 1, j + 1):
                metric[i, j] -= mean[i, k] / mean[i, i] * metric[k, j]


@kernel()
def through(psi, metric, rows):
    """Fill `rows` (18,), shape (3, 6): the product psi metric, which maps y as `psi` (3, 6) maps c."""
    for i in range(3):
        for j in range(6):
            total = 0.0
            for k in range(j + 1):
                total += psi[i, k] * metric[k, j]
            rows[6 * i + j] = total


@kernel()
def hill_rows(scene, t, rows):
    """Fill `rows` (18,), which map y to the primer at time t."""
    n, metric = scene
    psi = stack_matrix(3, 6)
    position_rows(n, t, psi)
    through(psi, metric, rows)


@kernel()
def hill_bend(scene, t, y, rows, rates):
    """Fill `rows` and `rates` (18,), and return the second derivative of |p|^2 / 2."""
    n, metric = scene
    psi, c = stack_matrix(3, 6), stack_vector(6)
    hill_rows(scene, t, rows)
    rate_rows(n, t, psi)
    through(psi, metric, rates)
    natural(metric, y, c)
    return square_at(n, c, t)[2]


@kernel()
def hill_maxima(scene, y, times, squares):
    """Find the local maxima of |p|^2, as `primer.peaks`."""
    n, metric = scene
    c = stack_vector(6)
    natural(metric, y, c)
    return peaks(n, 1.0, c, TOUCHING, times, squares)


@kernel()
def try_constant(scene, g, start, table, grid, work, answer):
    """Try a primer of constant length: keep its bound, and a plan along it if there is one."""
    n, metric = scene
    times, _, columns, _, costs, weights, active = work
    c, y = stack_vector(6), stack_vector(6)
    worth, constant = constant_primer(n, start, c)
    keep_bound(answer, c, worth)
    if not constant:
        return
    for i in range(5, -1, -1):
        y[i] = c[i]
        for j in range(i + 1, 6):
            y[i] -= metric[i, j] * y[j]
        y[i] /= metric[i, i]
    size, apart = grid, 1.0 / (grid - 1.0)
    for k in range(grid):
        times[k] = table[k, TIME]
    for _ in range(FINER):
        for k in range(size):
            costs[k] = 0.0
        count = weigh(hill_rows, scene, y, g, times, size, columns, costs, weights, active, answer)
        if answer[UPPER] - answer[LOWER] <= GAP * answer[LOWER]:
            return
        size = 0
        for a in range(count):
            for k in range(9):
                weights[size] = times[active[a]] + 0.25 * (k - 4) * apart
                size += 0.0 <= weights[size] <= 1.0
        for k in range(size):
            times[k] = weights[k]
        apart *= 0.25


@kernel()
def spread(n, metric, table):
    """Fill `metric` and the time grid of a transfer in which the orbit turns by n.

    Returns the size of the grid.
    """
    grid = int(GRID + GRID_PER_TURN * n / 6.283185307179586)
    orthonormal(n, 1.0, grid, metric)
    for k in range(grid):
        lay(hill_rows, (n, metric), k / (grid - 1.0), table, k)
    return grid


@kernel()
def optimise(n, start, metric, grid, table, work, answer):
    """Fill the answer for a required change whose functional (6,) at the start has length one."""
    g, scene = stack_vector(6), (n, metric)
    for i in range(6):
        g[i] = 0.0
        for j in range(i + 1):
            g[i] += metric[j, i] * start[j]
    try_constant(scene, g, start, table, grid, work, answer)
    answer[UNIQUE] = 0.0
    if answer[UPPER] - answer[LOWER] <= GAP * answer[LOWER]:
        return
    answer[UNIQUE] = 1.0
    improve(hill_rows, hill_bend, hill_maxima, scene, 1.0, metric, g, table, grid, work, answer)


@kernel(
    void(
        float64,
        float64[:, ::1],
        float64[:, ::1],
        float64[:, ::1],
        float64[:, ::1],
        float64[:, :, ::1],
        int64[::1],
        float64[:, ::1],
    )
)
def least_impulses(n, arcs, finals, table, lines, columns, active, answers):
    """Fill `answers` (P, 34), zeros so far, for P transfers, each from its arc's state and in its time.

    The other arrays are work space: the grid (K, 47), times (4, K), columns (2, K, 9) and indices (6,).
    """
    arcs, finals, answers = borrowed(arcs), borrowed(finals), borrowed(answers)
    table, lines, columns, active = borrowed(table), borrowed(lines), borrowed(columns), borrowed(active)
    work = lines[0], lines[1], columns[0], columns[1], lines[2], lines[3], active
    metric, start, angle, grid = stack_matrix(6, 6), stack_vector(6), 0.0, 0
    for p in range(len(arcs)):
        arc, answer = arcs[p], answers[p]
        t = arc[END] - arc[START]
        gained(n, arc, finals[p], start)
        scale = 0.0
        for k in range(6):
            unit = t if k < 3 else 1.0
            start[k] *= unit / t  # positions over the duration, like the primer's rates
            scale += (abs(arc[STATE + k]) + abs(finals[p, k])) / unit
        size = sqrt(dot(start, start))
        if size <= EXACT * (1.0 + 6.0 * n * t) * scale:
            answer[UNIQUE] = 1.0
            continue
        for k in range(6):
            start[k] /= size
        if n * t != angle:  # transfers of one duration share a grid
            angle = n * t
            grid = spread(angle, metric, table)
        answer[UPPER] = inf
        optimise(angle, start, metric, grid, table, work, answer)
        answer[UPPER] *= size
        answer[LOWER] = min(size * answer[LOWER], answer[UPPER])  # a plan may leave 1e-11 of the change
        for axis in range(3):
            answer[PRIMER + 3 + axis] /= t
        for k in range(int(answer[COUNT])):
            place = FIRST + 4 * k
            answer[place] *= t
            for axis in range(1, 4):
                answer[place + axis] *= size
            while place > FIRST and answer[place - 4] > answer[place]:  # in order of time
                for i in range(place, place + 4):
                    answer[i], answer[i - 4] = answer[i - 4], answer[i]
                place -= 4


def longest_turn(mean_motion: float, arcs: Floats) -> float:
    """Return the angle [rad] that the orbit turns in the longest transfer; raise ValueError if too large."""
    angle = float((arcs[:, END] - arcs[:, START]).max(initial=0.0)) * mean_motion
    if angle > MOST_TURNS * 2 * np.pi:
        raise ValueError(
            f"duration: the minimum delta-v is computed over at most {MOST_TURNS:g} orbits, got "
            f"{angle / (2 * np.pi):g}; coast for the rest"
        )
    return angle


def at_both_ends(arcs: Floats, finals: Floats, answers: Floats) -> None:
    """Fill `answers` in deep space: p is linear, |p| largest at an end, two impulses are optimal."""
    t, states = (arcs[:, END] - arcs[:, START])[:, None], arcs[:, STATE : STATE + 6]
    last = (states[:, :3] - finals[:, :3]) / t + finals[:, 3:]
    pushes = np.stack([finals[:, 3:] - states[:, 3:] - last, last], axis=1)
    scale = ((np.abs(states) + np.abs(finals)) / np.where(np.arange(6) < 3, t, 1.0)).sum(axis=1)
    pushes[np.sqrt((pushes**2).sum(axis=(1, 2))) <= EXACT * scale] = 0.0
    sizes = np.sqrt((pushes**2).sum(axis=2))
    fired = sizes > 0.0
    units = pushes / np.where(fired, sizes, 1.0)[..., None]
    units = np.where(fired[..., None], units, units[:, ::-1])
    answers[:, LOWER] = answers[:, UPPER] = sizes.sum(axis=1)
    answers[:, COUNT] = fired.sum(axis=1)
    answers[:, UNIQUE] = ~(fired.all(axis=1) & ((units[:, 0] * units[:, 1]).sum(axis=1) > 1.0 - 1e-15))
    answers[:, PRIMER : PRIMER + 3], answers[:, PRIMER + 3 : FIRST] = (
        units[:, 0],
        (units[:, 1] - units[:, 0]) / t,
    )
    impulses = np.concatenate([t[:, None] * [[0.0], [1.0]], pushes], axis=2)
    impulses = np.where(fired[:, :1, None], impulses, impulses[:, ::-1])  # fired impulses first
    answers[:, FIRST : FIRST + 8] = impulses.reshape(-1, 8)


def answers(mean_motion: float, arcs: Floats, finals: Floats) -> Floats:
    """Return answers (P, 34) to P transfers, computed on all cores; see `reduced` for their columns."""
    angle = longest_turn(mean_motion, arcs)
    found = np.zeros((len(arcs), ANSWER))
    if mean_motion == 0.0:
        at_both_ends(arcs, finals, found)
        return found
    room = int(GRID + 2.0 * GRID_PER_TURN * angle / 6.0) + 200

    def solve(first: int) -> None:
        some = slice(first, first + CHUNK)
        table, lines, columns = np.empty((room, WIDTH)), np.empty((4, room)), np.empty((2, room, 9))
        active = np.empty(MOST, dtype=np.int64)
        least_impulses(mean_motion, arcs[some], finals[some], table, lines, columns, active, found[some])

    if len(arcs) <= CHUNK:
        solve(0)
        return found
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(solve, range(0, len(arcs), CHUNK)))
    return found
