"""Minimum delta-v inside an approach cone and a speed limit as a cone program (Clarabel).

Impulses fire at equal times, and the requirements hold at equal times; nothing is known in between.
"""

from dataclasses import dataclass
from time import perf_counter

import clarabel
import numpy as np
from scipy import sparse
from scipy.linalg import expm

from peers.motion import Array


@dataclass(frozen=True)
class Approach:
    """Approach along -y, in a cone of `half_angle` [rad] on a disc, at a speed that falls with the range."""

    n: float  # mean motion [rad/s]
    initial: Array
    final: Array
    duration: float  # s
    half_angle: float
    radius: float  # m
    limit: float  # m/s at the target
    rate: float  # 1/s


@dataclass(frozen=True)
class Solved:
    """Delta-v [m/s] of the program, its solver's time [s], and the largest violations between its times."""

    delta_v: float
    time: float
    outside: float  # m
    faster: float  # m/s


def solve(task: Approach, count: int, samples: int) -> Solved:
    """Return the least impulses at `count` times that keep the requirements at `samples` times."""
    fires, seen = np.linspace(0.0, task.duration, count), np.linspace(0.0, task.duration, samples)
    rates = hill(task.n)
    pushes = [[expm(rates * (t - s))[:, 3:] if s <= t else np.zeros((6, 3)) for s in fires] for t in seen]
    moves = np.array([np.hstack(row) for row in pushes])
    coasts = np.array([expm(rates * t) @ task.initial for t in seen])
    width, tan = 4 * count, np.tan(task.half_angle)
    outer = np.array([[0, -tan, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0]])
    speed = np.zeros((4, 6))
    speed[0, 1], speed[1:, 3:] = -task.rate, np.eye(3)
    rows, given = [np.hstack([moves[-1], np.zeros((6, count))])], [task.final - coasts[-1]]
    cones = [clarabel.ZeroConeT(6)]
    for k in range(count):  # |impulse k| <= its size
        block = np.zeros((4, width))
        block[0, 3 * count + k], block[1:, 3 * k : 3 * k + 3] = -1.0, -np.eye(3)
        rows.append(block)
        given.append(np.zeros(4))
        cones.append(clarabel.SecondOrderConeT(4))
    for move, coast in zip(moves, coasts, strict=True):
        for matrix, bound in ((outer, [task.radius, 0, 0]), (speed, [task.limit, 0, 0, 0])):
            rows.append(np.hstack([-matrix @ move, np.zeros((len(matrix), count))]))
            given.append(matrix @ coast + bound)
            cones.append(clarabel.SecondOrderConeT(len(matrix)))
    cost = np.append(np.zeros(3 * count), np.ones(count))
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    program = clarabel.DefaultSolver(
        sparse.csc_matrix((width, width)),
        *(cost, sparse.csc_matrix(np.vstack(rows)), np.concatenate(given), cones, settings),
    )
    begin = perf_counter()
    found = program.solve()
    took = perf_counter() - begin
    impulses = np.array(found.x[: 3 * count]).reshape(count, 3)
    return Solved(found.obj_val, took, *violations(task, fires, impulses))


def violations(task: Approach, times: Array, impulses: Array) -> tuple[float, float]:
    """Return how far a path leaves the cone [m] and the speed limit [m/s], at fifty times of each coast."""
    state, outside, faster = task.initial.copy(), 0.0, 0.0
    for begin, end, impulse in zip(times[:-1], times[1:], impulses, strict=False):
        state[3:] += impulse
        for step in np.linspace(0.0, end - begin, 50):
            x, y, z, *velocity = expm(hill(task.n) * step) @ state
            room = (task.radius - y * np.tan(task.half_angle) - np.hypot(x, z)) * np.cos(task.half_angle)
            outside = max(outside, -room)
            faster = max(faster, np.linalg.norm(velocity) - task.limit + task.rate * y)
        state = expm(hill(task.n) * (end - begin)) @ state
    return outside, float(faster)


def hill(n: float) -> Array:
    """Return the matrix (6, 6) of Hill's equations, x radial and y along the track."""
    rates = np.zeros((6, 6))
    rates[:3, 3:] = np.eye(3)
    rates[3, 0], rates[3, 4], rates[4, 3], rates[5, 2] = 3 * n * n, 2 * n, -2 * n, -n * n
    return rates
