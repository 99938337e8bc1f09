"""Minimum-delta-v impulses: at most six, with a certified lower bound on the cost of any plan.

The maximum of (27), g . c over primers with |p| <= 1, equals the minimum sum of |v_k|: the problem is
convex, with six unknowns for any number of times.                                               # theory (29)

A primer of constant length is tried first (28).  If it is optimal, every instant is, infinitely many
plans have the same cost, and nonnegative weights choose one.  Otherwise a barrier on a grid of times finds
an approximation, and Newton's method converges on the local maxima (`reduced`).  Where that stalls the maxima
are added to the grid and the barrier continues.  Every answer has a certified lower bound, g . c over the
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
from closeform.motion.linear import dot
from closeform.motion.minimum_delta_v.barrier import SLACK, TIME, WIDTH, climb, lay, orthonormal
from closeform.motion.minimum_delta_v.constant_primers import constant_primer
from closeform.motion.minimum_delta_v.nonnegative import MOST
from closeform.motion.minimum_delta_v.primer import gained, peaks
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
    keep_bound,
    natural,
    newton,
    weigh,
)

GRID, GRID_PER_TURN = 13, 12.0  # times of the barrier's grid
FINER = 4  # grids of times, each four times as fine as the last, around the times used
NEAR = 3e-3  # gap to which the barrier is solved at first
CLOSER = 0.05  # factor of that gap each time the barrier continues
ROUNDS = 12
ENOUGH = 1e-10  # gap at which no further method is tried
SPARING = 0.1  # cost of a weight where |p| is below 1
EXACT = 1e-15  # share of the states: a smaller change is rounding, for each radian
CHUNK = 64  # transfers that one thread takes at a time


@kernel()
def try_constant(n, metric, g, start, table, grid, times, columns, costs, weights, active, answer):
    """Try a primer of constant length: keep its bound, and a plan along it if there is one."""
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
        count = weigh(n, metric, y, g, times, size, columns, costs, weights, active, answer)
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
        lay(n, k / (grid - 1.0), metric, table, k)
    return grid


@kernel()
def optimise(n, start, metric, grid, table, times, squares, columns, bent, costs, weights, active, answer):
    """Fill the answer for a required change whose functional (6,) at the start has length one."""
    g, c, y, near = stack_vector(6), stack_vector(6), stack_vector(6), stack_vector(6)
    for i in range(6):
        g[i], y[i] = 0.0, 0.0
        for j in range(i + 1):
            g[i] += metric[j, i] * start[j]
    try_constant(n, metric, g, start, table, grid, times, columns, costs, weights, active, answer)
    answer[UNIQUE] = 0.0
    if answer[UPPER] - answer[LOWER] <= GAP * answer[LOWER]:
        return
    answer[UNIQUE] = 1.0
    gap, weight = NEAR, sqrt(2.0 * grid / dot(g, g))
    for turn in range(ROUNDS):
        weight = climb(table, grid, g, y, gap, weight)
        if turn:
            for k in range(grid):
                times[k], costs[k] = table[k, TIME], SPARING * table[k, SLACK]
            weigh(n, metric, y, g, times, grid, columns, costs, weights, active, answer)
        for i in range(6):
            near[i] = y[i]
        natural(metric, y, c)
        size, highest = peaks(n, 1.0, c, TOUCHING, times, squares)
        for i in range(6):
            y[i] *= 0.999 / sqrt(highest)
        grid = widen(n, metric, times, size, table, grid)
        size = newton(n, metric, g, near, times, squares, columns, bent, costs, weights, active, answer)
        if answer[UPPER] - answer[LOWER] <= ENOUGH * answer[LOWER]:
            return
        grid = widen(n, metric, times, size, table, grid)
        gap *= CLOSER


@kernel()
def widen(n, metric, times, size, table, grid):
    """Add times to the grid that are not yet on it; return its size."""
    for k in range(size):
        on = grid == len(table)
        for j in range(grid):
            on = on or abs(table[j, TIME] - times[k]) < 1e-9
        if not on:
            lay(n, times[k], metric, table, grid)
            grid += 1
    return grid


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
    times, squares, costs, weights = lines[0], lines[1], lines[2], lines[3]
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
        optimise(
            angle,
            start,
            metric,
            grid,
            table,
            times,
            squares,
            columns[0],
            columns[1],
            costs,
            weights,
            active,
            answer,
        )
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
