"""Path of one spacecraft past moving keep-out ellipsoids, by a sequence of convex programs (Clarabel).

Thrust is constant between nodes (exact discretisation), and the cost is its energy. At each node the
supporting plane at the last path replaces the zone. The plane is outside the zone, so every iterate keeps
its nodes clear; the planes are updated until the energy converges. Only the nodes are clear: `solve`
inflates the zone until dense sampling with refinement finds the path clear between them.

Lengths are scaled by LENGTH and times by 1/n. The sparse matrices are built once; only the numbers of the
planes change between programs.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter

import clarabel
import numpy as np
from scipy import sparse
from scipy.optimize import minimize_scalar

from peers.motion import Array, held

NODES = 200
LENGTH = 100.0  # m
TOLERANCE = 1e-8  # Clarabel's gap and feasibility
SETTLED = 1e-6  # relative change of energy between two programs
ROUNDS = 50  # programs from one start
STARTS = 8  # sides of the zone that are tried
CLEAR = 1e-6  # an inflated path's least norm ends between 1 and 1 + 2 CLEAR
INFLATIONS = 20  # at most; a path that is still not clear shows it in `ratio`
BETWEEN = 8  # samples between nodes, before refinement

Place = Callable[[Array], Array]  # times (T,) [s] -> positions (T, 3) [m]


@dataclass(frozen=True)
class Shaped:
    """The cheapest path found; energy [m^2/s^3], times in seconds, inflation a factor on the zone."""

    energy: float
    thrust: Array  # (NODES, 3) [m/s^2], constant between nodes
    ratio: float  # least zone norm between start and end
    node_ratio: float  # least zone norm at the nodes of the program with the zone as given
    inflation: float
    node_energy: float  # before inflation: cheaper, as it cuts corners between nodes
    starts: int  # of STARTS, how many led to a path
    programs: int
    solver_time: float
    wall_time: float


def settings() -> clarabel.DefaultSettings:
    """Quiet, to TOLERANCE, and such that a program's numbers can be changed."""
    chosen = clarabel.DefaultSettings()
    chosen.verbose = False
    chosen.presolve_enable = False  # or they could not
    for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        setattr(chosen, name, TOLERANCE)
    return chosen


class Program:
    """The quadratic program; variables are thrusts (NODES, 3), then states (NODES + 1, 6)."""

    def __init__(self, initial: Array, final: Array, duration: float, n: float, obstacles: int) -> None:
        self.n, self.dt = n, duration / NODES
        self.scale = LENGTH * np.array([1, 1, 1, n, n, n])
        phi, gamma = held(1.0, n * self.dt)
        thrusts = 3 * NODES
        previous = sparse.kron(sparse.eye(NODES, NODES + 1), phi)
        following = sparse.kron(sparse.eye(NODES, NODES + 1, k=1), sparse.eye(6))
        motion = sparse.hstack([sparse.kron(sparse.eye(NODES), gamma), previous - following])
        first = sparse.hstack([sparse.csr_matrix((6, thrusts)), sparse.eye(6, 6 * (NODES + 1))])
        last = sparse.hstack([sparse.csr_matrix((6, thrusts)), sparse.eye(6, 6 * (NODES + 1), k=6 * NODES)])
        inner = np.arange(1, NODES)
        planes = sparse.coo_matrix(
            (
                np.ones(3 * len(inner)),
                (np.repeat(np.arange(len(inner)), 3), (thrusts + 6 * inner[:, None] + np.arange(3)).ravel()),
            ),
            shape=(len(inner), thrusts + 6 * (NODES + 1)),
        )
        self.matrix = sparse.vstack([motion, first, last] + [planes] * obstacles).tocsc()
        self.equalities = 6 * NODES + 12
        rows = self.matrix.indices
        self.slots = np.flatnonzero(rows >= self.equalities)  # entries of the planes, column by column
        columns = np.repeat(np.arange(self.matrix.shape[1]), np.diff(self.matrix.indptr))[self.slots]
        self.plane = rows[self.slots] - self.equalities
        self.axis = (columns - thrusts) % 6
        self.bound = np.zeros(self.matrix.shape[0])
        self.bound[6 * NODES : 6 * NODES + 6] = np.asarray(initial) / self.scale
        self.bound[6 * NODES + 6 : self.equalities] = np.asarray(final) / self.scale
        weights = np.concatenate([np.ones(thrusts), np.zeros(6 * (NODES + 1))])
        self.cost = sparse.diags(weights).tocsc()
        self.settings = settings()
        self.solver: clarabel.DefaultSolver | None = None

    def solve(self, normals: Array, limits: Array) -> tuple[bool, float, Array, Array, float]:
        """Minimum energy with normals (P, 3) . position >= limits (P,) at the planes' nodes.

        Returns whether it is solved, the energy [m^2/s^3], thrusts, states and the solver's time.
        """
        self.matrix.data[self.slots] = -normals[self.plane, self.axis]
        self.bound[self.equalities :] = -limits / LENGTH
        begin = perf_counter()
        if self.solver is None:
            cones = [clarabel.ZeroConeT(self.equalities), clarabel.NonnegativeConeT(len(limits))]
            linear = np.zeros(self.matrix.shape[1])
            self.solver = clarabel.DefaultSolver(
                self.cost, linear, self.matrix, self.bound, cones, self.settings
            )
        else:
            self.solver.update(A=self.matrix, b=self.bound)
        solution = self.solver.solve()
        spent = perf_counter() - begin  # its own solve_time counts the set-up anew each time
        x = np.asarray(solution.x)
        thrust = x[: 3 * NODES].reshape(NODES, 3) * LENGTH * self.n**2
        states = x[3 * NODES :].reshape(NODES + 1, 6) * self.scale
        solved = solution.status in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
        return solved, 0.5 * self.dt * float(np.sum(thrust**2)), thrust, states, spent


class Shaping:
    """One task: its program, its zone and obstacles, and what it has cost so far."""

    def __init__(
        self,
        initial: Array,
        final: Array,
        duration: float,
        n: float,
        obstacles: Sequence[Place],
        shape: Array,
    ) -> None:
        self.initial, self.n, self.duration, self.shape = np.asarray(initial), n, duration, shape
        self.obstacles = obstacles
        self.program = Program(initial, final, duration, n, len(obstacles))
        self.nodes = np.linspace(0, duration, NODES + 1)
        self.places = np.stack([place(self.nodes) for place in obstacles])
        self.programs, self.solver_time = 0, 0.0

    def norm(self, positions: Array) -> Array:
        return np.sqrt(np.einsum("...a,ab,...b->...", positions, self.shape, positions))

    def planes(self, relative: Array, inflation: float) -> tuple[Array, Array]:
        """Supporting planes of the inflated zones in the directions of `relative` (K, NODES - 1, 3)."""
        gradients = relative @ self.shape / self.norm(relative)[..., None]
        limits = inflation + np.einsum("...a,...a->...", gradients, self.places[:, 1:-1])
        return gradients.reshape(-1, 3), limits.ravel()

    def step(self, relative: Array, inflation: float) -> tuple[bool, float, Array, Array]:
        solved, energy, thrust, states, spent = self.program.solve(*self.planes(relative, inflation))
        self.programs += 1
        self.solver_time += spent
        return solved, energy, thrust, states

    def settle(self, relative: Array, inflation: float) -> tuple[float, Array, Array] | None:
        """Programs from one start until the energy changes by less than SETTLED; None if infeasible."""
        last = np.inf
        for _ in range(ROUNDS):
            solved, energy, thrust, states = self.step(relative, inflation)
            if not solved:
                return None
            relative = states[1:-1, :3] - self.places[:, 1:-1]
            if abs(last - energy) <= SETTLED * energy:
                break
            last = energy
        return energy, thrust, relative

    def unconstrained(self) -> Array:
        """The optimal path without zones, relative to each obstacle at the inner nodes."""
        count = len(self.obstacles) * (NODES - 1)
        normals = np.tile([1.0, 0.0, 0.0], (count, 1))
        _, _, _, states, spent = self.program.solve(normals, np.full(count, -1e3 * LENGTH))
        self.programs += 1
        self.solver_time += spent
        return states[:, :3] - self.places

    def starts(self) -> list[Array]:
        """Paths shifted to STARTS sides, in the plane across the relative velocity at closest approach."""
        free = self.unconstrained()
        k, node = np.unravel_index(np.argmin(self.norm(free[:, 1:-1])), (len(free), NODES - 1))
        along = free[k, node + 2] - free[k, node]
        across = np.linalg.svd(along[None])[2][1:]
        bump = np.sin(np.pi * np.linspace(0, 1, NODES + 1)[1:-1]) ** 2
        paths = []
        for angle in 2 * np.pi * np.arange(STARTS) / STARTS:
            side = np.cos(angle) * across[0] + np.sin(angle) * across[1]
            side *= 2 / self.norm(side)  # to twice the zone's surface
            paths.append(free[:, 1:-1] + bump[:, None] * side)
        return paths

    def least_ratio(self, thrust: Array) -> float:
        """Least norm on the exact path of held thrusts: samples between nodes, each low one refined."""
        dt = self.duration / NODES
        offsets = dt * np.arange(BETWEEN + 1) / BETWEEN
        steps = [held(self.n, t) for t in offsets]
        phi = np.stack([s[0] for s in steps])
        gamma = np.stack([s[1] for s in steps])
        state, nodes = self.initial, []
        for u in thrust:
            nodes.append(state)
            state = phi[-1] @ state + gamma[-1] @ u
        states = np.einsum("mab,kb->kma", phi, np.array(nodes)) + np.einsum("mab,kb->kma", gamma, thrust)
        times = self.nodes[:-1, None] + offsets
        least = np.inf
        for place in self.obstacles:
            norms = self.norm(states[..., :3] - place(times.ravel()).reshape(*times.shape, 3))
            least = min(least, float(norms.min()))
            flat = norms[:, :-1].ravel()
            inner = np.flatnonzero((flat[1:-1] <= flat[:-2]) & (flat[1:-1] <= flat[2:])) + 1
            for index in inner[flat[inner] < 1.01 * flat.min()]:
                least = min(least, self.refined(place, index, nodes, thrust))
        return least

    def refined(self, place: Place, index: int, nodes: list[Array], thrust: Array) -> float:
        """Least norm within a sample's width of sample `index`."""
        width = self.duration / NODES / BETWEEN

        def norm_at(t: float) -> float:
            k = min(int(t / self.duration * NODES), NODES - 1)
            phi, gamma = held(self.n, t - self.nodes[k])
            return float(self.norm((phi @ nodes[k] + gamma @ thrust[k])[:3] - place(np.array([t]))[0]))

        bounds = (max((index - 1) * width, 0.0), min((index + 1) * width, self.duration))
        return float(
            minimize_scalar(norm_at, bounds=bounds, method="bounded", options={"xatol": 1e-6 * width}).fun
        )


def solve(
    initial: Array, final: Array, duration: float, n: float, obstacles: Sequence[Place], shape: Array
) -> Shaped | None:
    """Best of STARTS starts past zones r' `shape` r <= 1 around the obstacles, certified clear.

    States (6,) [m, m/s], shape (3, 3) [1/m^2]. None if no start leads to a path.
    """
    begin = perf_counter()
    task = Shaping(initial, final, duration, n, obstacles, shape)
    found = [path for start in task.starts() if (path := task.settle(start, 1.0)) is not None]
    if not found:
        return None
    best = min(found, key=lambda path: path[0])
    node_energy, node_ratio = best[0], float(task.norm(best[2]).min())
    inflation, ratio = 1.0, task.least_ratio(best[1])
    for _ in range(INFLATIONS):
        if ratio >= 1.0 and (inflation == 1.0 or ratio <= 1.0 + 2 * CLEAR):
            break
        inflation *= (1.0 + CLEAR) / ratio
        again = task.settle(best[2], inflation)
        if again is None:
            return None
        best, ratio = again, task.least_ratio(again[1])
    return Shaped(
        energy=best[0],
        thrust=best[1],
        ratio=ratio,
        node_ratio=node_ratio,
        inflation=inflation,
        node_energy=node_energy,
        starts=len(found),
        programs=task.programs,
        solver_time=task.solver_time,
        wall_time=perf_counter() - begin,
    )
