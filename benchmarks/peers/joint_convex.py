"""Plan of a whole formation by a sequence of convex programs (Clarabel).

All spacecraft share one zone and one time span. Thrust is linear between nodes and continuous (first-order
hold, exact discretisation). Without conflicts its cost is within some 1e-7 of the optimum; constant thrust
would cost 1/NODES^2 more. At each node the supporting plane at the last paths replaces the zone of each near
pair. The plane is outside the zone, so every iterate keeps these nodes clear, and pairs that come close
elsewhere get planes there. The planes are updated until the energy converges. Between nodes pairs may still
conflict: `solve` inflates the zone of each pair until dense sampling with refinement finds it clear.

Lengths are scaled by LENGTH, times by the duration.
"""

from dataclasses import dataclass
from time import perf_counter

import clarabel
import numpy as np
from scipy import sparse
from scipy.linalg import expm

from peers.convex import settings
from peers.motion import Array

NODES = 60
LENGTH = 100.0  # m
SETTLED = 1e-6  # relative change of energy between two programs
ROUNDS = 60  # programs from one start
NEAR = 1.2  # pairs get planes at nodes where their norm is below
CLEAR = 1e-4  # above a norm of 1: what inflated pairs first aim at; it costs some 1e-5 of the energy
INFLATIONS = 30  # at most; a pair that is still not clear shows it in `ratio`
BETWEEN = 16  # samples between nodes, before refinement
REFINED = 33  # points of each of two refinements


@dataclass(frozen=True)
class Formed:
    """The cheapest paths found; energies [m^2/s^3], times in seconds.

    `free_energy` is that without zones in the same discretisation; `inflation` the greatest factor
    on a pair's zone; `one_start` the solver's time from the best start alone.
    """

    energy: float
    free_energy: float
    thrust: Array  # (N, NODES + 1, 3) [m/s^2], linear between nodes
    states: Array  # (N, NODES + 1, 6)
    ratio: float  # least norm of any pair
    inflation: float
    node_energy: float  # before inflation: cheaper, as it cuts corners between nodes
    starts: int  # that led to paths
    programs: int
    planes: int
    solver_time: float
    one_start: float
    wall_time: float


def steps(n: float, times: Array) -> Array:
    """Over each of `times` from states, thrust and its rate to states: (T, 6, 12)."""
    full = np.zeros((12, 12))
    full[:3, 3:6] = full[3:6, 6:9] = full[6:9, 9:12] = np.eye(3)
    full[3, 0], full[3, 4], full[4, 3], full[5, 2] = 3 * n**2, 2 * n, -2 * n, -(n**2)  # theory (1)
    return np.stack([expm(full * t)[:6] for t in times])


class Program:
    """The quadratic program; variables are thrusts (N, K, 3), then states (N, K, 6), K = nodes + 1."""

    def __init__(self, initial: Array, final: Array, duration: float, n: float, nodes: int) -> None:
        self.count, self.nodes = len(initial), nodes
        self.shape = (self.count, nodes + 1)
        self.scale = LENGTH * np.repeat([1, 1 / duration], 3)
        self.push = LENGTH / duration**2
        self.power = self.push**2 * duration
        self.thrusts = 3 * self.count * (nodes + 1)
        self.width = 3 * self.thrusts
        dt = 1.0 / nodes
        step = steps(n * duration, np.array([dt]))[0]
        here, there = sparse.eye(nodes, nodes + 1), sparse.eye(nodes, nodes + 1, k=1)
        ramp = step[:, 9:12] / dt
        forced = sparse.kron(here, step[:, 6:9] - ramp) + sparse.kron(there, ramp)
        free = sparse.kron(here, step[:, :6]) - sparse.kron(there, np.eye(6))
        ends = sparse.csr_matrix((np.ones(2), ([0, 1], [0, nodes])), shape=(2, nodes + 1))
        craft = sparse.eye(self.count)
        motion = sparse.hstack([sparse.kron(craft, forced), sparse.kron(craft, free)])
        held = sparse.kron(craft, sparse.kron(ends, np.eye(6)))
        held = sparse.hstack([sparse.csr_matrix((held.shape[0], self.thrusts)), held])
        self.fixed = sparse.vstack([motion, held])
        both = np.stack([initial, final], axis=1) / self.scale
        self.values = np.concatenate([np.zeros(motion.shape[0]), both.ravel()])
        side = np.full(nodes, dt / 6)
        middle = dt / 3 * np.r_[1, np.full(nodes - 1, 2), 1]
        mass = sparse.diags([side, middle, side], [-1, 0, 1])  # of a piecewise linear thrust's square
        cost = sparse.kron(craft, sparse.kron(mass, np.eye(3)))
        nothing = sparse.csr_matrix((2 * self.thrusts, 2 * self.thrusts))
        self.whole_cost = sparse.block_diag([cost, nothing]).tocsc()
        self.cost = sparse.triu(self.whole_cost).tocsc()
        self.settings = settings()
        self.solver: clarabel.DefaultSolver | None = None
        self.where: tuple[Array, Array, Array] | None = None

    def solve(
        self, where: tuple[Array, Array, Array], normals: Array, limits: Array
    ) -> tuple[bool, float, Array, Array, float]:
        """Minimise energy; normals (Q, 3) . (r_i - r_j) >= limits (Q,); `where` is (i, j, node), each (Q,).

        Returns whether it is solved, the energy [m^2/s^3], thrusts, states and the solver's time.
        """
        first, second, node = where
        row = np.repeat(np.arange(len(node)), 3)
        columns = [
            (self.thrusts + 6 * (craft * (self.nodes + 1) + node)[:, None] + np.arange(3)).ravel()
            for craft in (first, second)
        ]
        entries = LENGTH * np.concatenate([-normals.ravel(), normals.ravel()])
        shape = (len(node), self.width)
        planes = sparse.coo_matrix((entries, (np.r_[row, row], np.concatenate(columns))), shape=shape)
        matrix = sparse.vstack([self.fixed, planes]).tocsc()
        bound = np.concatenate([self.values, -limits])
        same = self.where is not None and np.array_equal(where, self.where)
        begin = perf_counter()
        if same and self.solver is not None:
            self.solver.update(A=matrix, b=bound)
        else:
            cones = [clarabel.ZeroConeT(len(self.values)), clarabel.NonnegativeConeT(len(limits))]
            linear = np.zeros(self.width)
            self.solver = clarabel.DefaultSolver(self.cost, linear, matrix, bound, cones, self.settings)
            self.where = where
        solution = self.solver.solve()
        spent = perf_counter() - begin  # its own solve_time counts the set-up anew each time
        x = np.asarray(solution.x)
        energy = 0.5 * self.power * float(x @ (self.whole_cost @ x))
        thrust = x[: self.thrusts].reshape(*self.shape, 3) * self.push
        states = x[self.thrusts :].reshape(*self.shape, 6) * self.scale
        solved = solution.status in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
        return solved, energy, thrust, states, spent


@dataclass
class Settled:
    """Paths whose planes no longer change the energy; `near` (P, nodes - 1) are those with planes."""

    energy: float
    thrust: Array
    states: Array
    near: Array


class Forming:
    """One task: its program, its pairs, and what it has cost so far."""

    def __init__(
        self, initial: Array, final: Array, duration: float, n: float, zone: Array, box: bool, nodes: int
    ) -> None:
        self.zone, self.box, self.nodes = zone, box, nodes
        self.first, self.second = np.triu_indices(len(initial), 1)
        self.program = Program(initial, final, duration, n, nodes)
        self.dt = duration / nodes
        self.steps = steps(n, self.dt * np.arange(BETWEEN) / BETWEEN)
        self.programs, self.solver_time = 0, 0.0

    def norm(self, relative: Array) -> Array:
        inside = relative @ self.zone.T
        return np.abs(inside).max(axis=-1) if self.box else np.linalg.norm(inside, axis=-1)

    def gradients(self, relative: Array) -> Array:
        """Normals of the zone's supporting planes in the directions of `relative` (Q, 3)."""
        inside = relative @ self.zone.T
        if self.box:
            face = np.abs(inside).argmax(axis=-1)
            return self.zone[face] * np.sign(inside[np.arange(len(face)), face])[:, None]
        return inside @ self.zone / np.linalg.norm(inside, axis=-1)[:, None]

    def relative(self, states: Array) -> Array:
        """Relative positions of all pairs at the inner nodes: (P, nodes - 1, 3)."""
        inner = states[:, 1:-1, :3]
        return inner[self.first] - inner[self.second]

    def step(self, relative: Array, near: Array, inflation: Array) -> tuple[bool, float, Array, Array]:
        pair, node = np.nonzero(near)
        where = self.first[pair], self.second[pair], node + 1
        normals = self.gradients(relative[pair, node])
        solved, energy, thrust, states, spent = self.program.solve(where, normals, inflation[pair])
        self.programs += 1
        self.solver_time += spent
        return solved, energy, thrust, states

    def settle(self, relative: Array, near: Array, inflation: Array) -> Settled | None:
        """Programs from one start until the energy changes by less than SETTLED; None if infeasible."""
        last = np.inf
        for _ in range(ROUNDS):
            solved, energy, thrust, states = self.step(relative, near, inflation)
            if not solved:
                return None
            relative = self.relative(states)
            norms = self.norm(relative)
            missed = (norms < (1 - 1e-6) * inflation[:, None]) & ~near
            if missed.any():
                near = near | (norms < NEAR)
            elif abs(last - energy) <= SETTLED * energy:
                return Settled(energy, thrust, states, near)
            last = energy
        return None if missed.any() else Settled(energy, thrust, states, near)

    def start(self, free: Array, seed: int) -> tuple[Array, Array]:
        """`near` of the free paths, each spacecraft displaced at random by about a zone."""
        rng = np.random.default_rng(seed)
        bump = np.sin(np.pi * np.linspace(0, 1, self.nodes + 1)) ** 2
        sides = rng.normal(size=(len(free), 3)) / np.sqrt(3)
        moved = free.copy()
        moved[..., :3] += bump[:, None] * (sides @ np.linalg.inv(self.zone).T)[:, None]
        return self.near(moved)

    def near(self, states: Array) -> tuple[Array, Array]:
        """Relative positions of all pairs, and where they are near."""
        relative = self.relative(states)
        return relative, self.norm(relative) < NEAR

    def least_ratios(self, thrust: Array, states: Array) -> Array:
        """Least norm of each pair (P,): samples between nodes, each low one refined."""
        rate = np.diff(thrust, axis=1) / self.dt
        known = np.concatenate([states[:, :-1], thrust[:, :-1], rate], axis=-1)
        fine = np.einsum("mab,ckb->ckma", self.steps, known).reshape(len(states), -1, 6)
        fine = np.concatenate([fine, states[:, -1:]], axis=1)
        least = np.empty(len(self.first))
        lows = []
        for p, (i, j) in enumerate(zip(self.first, self.second, strict=True)):
            apart = fine[i] - fine[j]
            norms = self.norm(apart[:, :3])
            least[p] = norms.min()
            low = np.flatnonzero((norms[:-1] < 1.1) | (norms[1:] < 1.1)) if least[p] < 1.1 else []
            lows += [(p, apart[k], apart[k + 1]) for k in low]
        if lows:
            pairs, ends = np.array([p for p, *_ in lows]), np.array([pair for _, *pair in lows])
            np.minimum.at(least, pairs, self.refined(ends[:, 0], ends[:, 1]))
        return least

    def refined(self, left: Array, right: Array) -> Array:
        """Least norm between relative states (Q, 6) one sample apart; cubics there are exact to rounding."""
        h = self.dt / BETWEEN
        low, high = np.zeros(len(left)), np.ones(len(left))
        for _ in range(2):
            s = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, REFINED)
            t = s[..., None]
            cubic = (1 + 2 * t) * (1 - t) ** 2 * left[:, None, :3] + t**2 * (3 - 2 * t) * right[:, None, :3]
            cubic += h * t * (1 - t) * ((1 - t) * left[:, None, 3:] - t * right[:, None, 3:])
            norms = self.norm(cubic)
            best = norms.argmin(axis=1)
            rows = np.arange(len(s))
            low, high = s[rows, np.maximum(best - 1, 0)], s[rows, np.minimum(best + 1, REFINED - 1)]
        return norms.min(axis=1)

    def inflated(self, paths: Settled) -> tuple[Settled, float, float] | None:
        """Pairs' zones scaled until all are clear between nodes: the cheapest such paths, ratio, factor."""
        inflation, best = np.ones(len(self.first)), None
        for k in range(INFLATIONS):
            ratios = self.least_ratios(paths.thrust, paths.states)
            if ratios.min() >= 1.0:
                if best and paths.energy > (1 - SETTLED) * best[0].energy:
                    break
                best = paths, float(ratios.min()), float(inflation.max())
            aim = 1 + CLEAR * (1 + k)  # pairs that slide along their planes follow slowly
            change = inflation * (aim / ratios - 1)
            change = np.where(ratios < 1, change, np.minimum(change, 0) / (1 + k))  # lest it swing for ever
            if best and np.abs(np.maximum(change, 1 - inflation)).max() <= CLEAR:
                break
            inflation = np.maximum(inflation + change, 1.0)
            again = self.settle(self.relative(paths.states), paths.near, inflation)
            if again is None:
                break
            paths = again
        return best


def solve(
    initial: Array,
    final: Array,
    duration: float,
    n: float,
    zone: Array,
    box: bool = False,
    starts: int = 4,
    nodes: int = NODES,
    guess: Array | None = None,
) -> Formed | None:
    """Best of `starts` starts for states (N, 6) [m, m/s], every pair clear of |zone r| <= 1.

    The zone's matrix (3, 3) is in 1/m; the norm of a `box` is the greatest component. Starts are
    judged by their energy with all pairs clear at the nodes, and the cheapest is inflated (the next
    one where that fails). A `guess` of states (N, nodes + 1, 6) is the only start, if given. None
    if no start leads to paths.
    """
    begin = perf_counter()
    task = Forming(initial, final, duration, n, zone, box, nodes)
    nowhere = np.zeros((len(task.first), nodes - 1), dtype=bool)
    ones = np.ones(len(task.first))
    _, free_energy, _, free = task.step(np.zeros((*nowhere.shape, 3)), nowhere, ones)
    found = []
    begun = [task.start(free, seed) for seed in range(starts)] if guess is None else [task.near(guess)]
    for start in begun:
        before = task.solver_time
        paths = task.settle(*start, ones)
        if paths is not None:
            found.append((paths, task.solver_time - before))
    for settled, spent in sorted(found, key=lambda each: each[0].energy):
        before = task.solver_time
        clear = task.inflated(settled)
        if clear is None:
            continue
        paths, ratio, inflation = clear
        return Formed(
            energy=paths.energy,
            free_energy=free_energy,
            thrust=paths.thrust,
            states=paths.states,
            ratio=ratio,
            inflation=inflation,
            node_energy=settled.energy,
            starts=len(found),
            programs=task.programs,
            planes=int(paths.near.sum()),
            solver_time=task.solver_time,
            one_start=spent + task.solver_time - before,
            wall_time=perf_counter() - begin,
        )
    return None
