"""Path of one spacecraft past moving boxes by a mixed-integer linear program, after Richards et al. (2002).

Thrust is constant between 20 nodes, and the cost is the sum of |u| over axes and steps. At each inner node
six binary variables select the side of the box ("big M"). HiGHS solves the program through
scipy.optimize.milp. The program does not constrain the path between nodes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, milp

from peers.motion import Array, held

STEPS = 20
LENGTH = 100.0  # m
BIG = 100.0  # "big M", in units of LENGTH
GAP = 1e-4  # relative, HiGHS's own default
LIMIT = 60.0  # s

Place = Callable[[Array], Array]  # times (T,) [s] -> positions (T, 3) [m]


@dataclass(frozen=True)
class Mixed:
    """A solved program; fuel is the integral of |u_x| + |u_y| + |u_z|."""

    optimal: bool  # within GAP; else the best found within LIMIT
    fuel: float  # m/s
    delta_v: float  # integral of |u| [m/s]
    energy: float  # of its thrust [m^2/s^3]
    thrust: Array  # (STEPS, 3) [m/s^2]
    inside: float  # seconds within a box, between nodes
    least_ratio: float  # least norm of the boxes along the whole path
    wall_time: float


def positions(
    initial: Array, thrust: Array, duration: float, n: float, between: int = 1
) -> tuple[Array, Array]:
    """Times and positions on the exact path of held thrusts, `between` samples to a step."""
    dt = duration / len(thrust)
    steps = [held(n, dt * k / between) for k in range(1, between + 1)]
    state, path = np.asarray(initial, dtype=float), [np.asarray(initial, dtype=float)[:3]]
    for u in thrust:
        moved = [phi @ state + gamma @ u for phi, gamma in steps]
        path += [m[:3] for m in moved]
        state = moved[-1]
    return np.linspace(0, duration, len(path)), np.array(path)


def solve(
    initial: Array, final: Array, duration: float, n: float, obstacles: Sequence[Place], half_widths: Array
) -> Mixed | None:
    """Least-fuel path; None if HiGHS finds none within LIMIT."""
    begin = perf_counter()
    dt = duration / STEPS
    scale = LENGTH * np.array([1, 1, 1, n, n, n])
    phi, gamma = held(1.0, n * dt)
    # position at node k: free motion plus the sum of steps' effects; variables u+, u-, then sides
    powers = [np.linalg.matrix_power(phi, k) for k in range(STEPS + 1)]
    effect = np.zeros((STEPS + 1, 6, STEPS, 3))
    for k in range(1, STEPS + 1):
        for j in range(k):
            effect[k, :, j] = powers[k - 1 - j] @ gamma
    effect = effect.reshape(STEPS + 1, 6, 3 * STEPS)
    free = np.array([p @ (np.asarray(initial) / scale) for p in powers])
    nodes = np.linspace(0, duration, STEPS + 1)
    inner = range(1, STEPS)
    sides = 6 * len(inner) * len(obstacles)
    width = np.asarray(half_widths) / LENGTH
    rows, limits = [], []
    for o, place in enumerate(obstacles):
        centre = place(nodes) / LENGTH
        for k in inner:
            for axis in range(3):
                for sign in (1.0, -1.0):
                    row = np.zeros(6 * STEPS + sides)
                    row[: 3 * STEPS] = sign * effect[k, axis]
                    row[3 * STEPS : 6 * STEPS] = -sign * effect[k, axis]
                    row[6 * STEPS + 6 * (o * len(inner) + k - 1) + 2 * axis + (sign < 0)] = BIG
                    rows.append(row)
                    limits.append(width[axis] + sign * (centre[k, axis] - free[k, axis]))
    count = sparse.kron(sparse.eye(sides // 6), np.ones((1, 6)))
    one_side = sparse.hstack([sparse.csr_matrix((sides // 6, 6 * STEPS)), count])
    arrive = np.hstack([effect[STEPS], -effect[STEPS], np.zeros((6, sides))])
    missing = np.asarray(final) / scale - free[STEPS]
    solution = milp(
        np.concatenate([np.ones(6 * STEPS), np.zeros(sides)]),
        integrality=np.concatenate([np.zeros(6 * STEPS), np.ones(sides)]),
        bounds=Bounds(0, np.concatenate([np.full(6 * STEPS, np.inf), np.ones(sides)])),
        constraints=[
            LinearConstraint(sparse.csr_matrix(np.array(rows)), lb=np.array(limits)),
            LinearConstraint(one_side, ub=5),
            LinearConstraint(sparse.csr_matrix(arrive), lb=missing, ub=missing),
        ],
        options={"time_limit": LIMIT, "mip_rel_gap": GAP},
    )
    if solution.x is None:
        return None
    spent = perf_counter() - begin
    thrust = (solution.x[: 3 * STEPS] - solution.x[3 * STEPS : 6 * STEPS]).reshape(STEPS, 3) * LENGTH * n**2
    times, path = positions(initial, thrust, duration, n, between=1000)
    norms = np.min([np.max(np.abs(path - place(times)) / half_widths, axis=1) for place in obstacles], axis=0)
    return Mixed(
        optimal=solution.status == 0,
        fuel=float(np.abs(thrust).sum() * dt),
        delta_v=float(np.linalg.norm(thrust, axis=1).sum() * dt),
        energy=float(0.5 * dt * np.sum(thrust**2)),
        thrust=thrust,
        inside=float(np.mean(norms < 1 - 1e-6) * duration),
        least_ratio=float(norms.min()),
        wall_time=spent,
    )
