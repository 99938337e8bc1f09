"""Path: motion as arcs in closed form, for one craft or a whole batch."""

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import float64, int64, void
from numpy.typing import ArrayLike

from closeform.arc import (
    CONSTANT,
    END,
    IMPULSE,
    MEAN_MOTION,
    START,
    STATE,
    THRUST,
    acceleration,
    pushes,
    state_at,
    steered,
    steering_at,
)
from closeform.compiled import kernel
from closeform.extrema import highest
from closeform.hill import costate, forced
from closeform.march import locate
from closeform.zones import Floats

if TYPE_CHECKING:
    from closeform.orbit import Orbit

FORGIVEN = 1e-9  # of the path's length, outside of it; of its scale, between joined arcs


@kernel()
def thrust_at(arc, n, t):
    """Thrust acceleration at time t that flies the arc in an orbit of mean motion n.

    An interpolated arc (n = 0 in an orbit with n > 0) has the thrust that its motion asks for.
    """
    ux, uy, uz, _, _, _ = steering_at(arc, t)
    ux, uy, uz = ux + arc[CONSTANT], uy + arc[CONSTANT + 1], uz + arc[CONSTANT + 2]
    if arc[MEAN_MOTION] != n:
        x, _, z, vx, vy, _ = state_at(arc, t)
        ax, ay, az = acceleration(n, x, z, vx, vy)
        ux, uy, uz = ux - ax, uy - ay, uz - az
    return ux, uy, uz


@kernel(void(float64[:, ::1], int64[::1], float64, float64[:, ::1], float64[:, :, ::1]))
def evaluate(arcs, offsets, n, times, out):
    """States, or thrusts where `out` has three columns; `times` has a row for all or one for each."""
    for p in range(len(offsets) - 1):
        for k in range(times.shape[1]):
            t = times[p if len(times) > 1 else 0, k]
            arc = arcs[locate(arcs, offsets[p], offsets[p + 1], t)]
            t = min(max(t, arc[START]), arcs[offsets[p + 1] - 1, END])
            if out.shape[2] == 6:
                x, y, z, vx, vy, vz = state_at(arc, t)
                out[p, k, 3], out[p, k, 4], out[p, k, 5] = vx, vy, vz
            else:
                x, y, z = thrust_at(arc, n, t)
            out[p, k, 0], out[p, k, 1], out[p, k, 2] = x, y, z


@kernel()
def thrust_squared(arc, n, t):
    x, y, z = thrust_at(arc, n, t)
    return x * x + y * y + z * z


@kernel()
def gauss4(arc, n, middle, half):
    """Integral of |thrust|^2 by four Gauss points: exact for a cubic thrust."""
    a = 0.33998104358485626 * half
    b = 0.8611363115940526 * half
    inner = thrust_squared(arc, n, middle - a) + thrust_squared(arc, n, middle + a)
    outer = thrust_squared(arc, n, middle - b) + thrust_squared(arc, n, middle + b)
    return half * (0.6521451548625461 * inner + 0.34785484513745385 * outer)


@kernel()
def arc_energy(arc, n):
    duration = arc[END] - arc[START]
    if arc[MEAN_MOTION] != n:
        return 0.5 * gauss4(arc, n, 0.5 * (arc[START] + arc[END]), 0.5 * duration)
    energy = 0.5 * duration * (arc[18] ** 2 + arc[19] ** 2 + arc[20] ** 2)
    if steered(arc):
        # d(costate . state)/dt = |u|^2, with the state that the thrust alone produces
        x, y, z, vx, vy, vz = forced(n, duration, arc[12], arc[13], arc[14], arc[15], arc[16], arc[17])
        ux, uy, uz, wx, wy, wz = steering_at(arc, arc[END])
        lx, ly, lz = costate(n, ux, uy, uz, wx, wy, wz)
        energy += 0.5 * (lx * x + ly * y + lz * z + ux * vx + uy * vy + uz * vz)
    return energy


# Kronrod's 15 points and weights and the 7 Gauss weights among them (QUADPACK, positive half).
NODES = (0.9914553711208126, 0.9491079123427585, 0.8648644233597691, 0.7415311855993945)
NODES += (0.5860872354676911, 0.4058451513773972, 0.2077849550078985, 0.0)
KRONROD = (0.0229353220105292, 0.0630920926299786, 0.1047900103222502, 0.1406532597159259)
KRONROD += (0.1690047266392679, 0.1903505780647854, 0.2044329400752989, 0.2094821410847278)
GAUSS = (0.0, 0.1294849661688697, 0.0, 0.2797053914892767, 0.0, 0.3818300505051189, 0.0, 0.4179591836734694)


@kernel()
def arc_delta_v(arc, n, stack):
    """Integral of |thrust| by adaptive Gauss-Kronrod quadrature, to 1e-10 of itself."""
    duration = arc[END] - arc[START]
    if not steered(arc) and arc[MEAN_MOTION] == n:
        return duration * sqrt(arc[18] ** 2 + arc[19] ** 2 + arc[20] ** 2)
    total = 0.0
    scale = 0.0
    stack[0] = 0.0  # left edges of the intervals still to do; each is 2^-depth long
    stack[1] = 0.0  # and their depths
    top = 1
    while top > 0:
        top -= 1
        left = stack[2 * top]
        depth = stack[2 * top + 1]
        half = 0.5 * duration * 0.5**depth
        middle = arc[START] + left * duration + half
        fine = 0.0
        coarse = 0.0
        for k in range(8):
            f = sqrt(thrust_squared(arc, n, middle - half * NODES[k]))
            if k < 7:
                f += sqrt(thrust_squared(arc, n, middle + half * NODES[k]))
            fine += KRONROD[k] * f
            coarse += GAUSS[k] * f
        if depth == 0.0:
            scale = half * fine
        if depth > 40.0 or half * abs(fine - coarse) <= 1e-11 * scale:
            total += half * fine
        else:
            stack[2 * top] = left
            stack[2 * top + 1] = depth + 1.0
            stack[2 * top + 2] = left + 0.5 ** (depth + 1.0)
            stack[2 * top + 3] = depth + 1.0
            top += 2
    return total


@kernel()
def arc_peak(arc, n, q):
    """Greatest thrust along an arc: thrust is natural motion, or a cubic for an interpolated arc."""
    duration = arc[END] - arc[START]
    q[:] = 0.0
    ux, uy, uz, wx, wy, wz = steering_at(arc, arc[START])
    order_n = arc[MEAN_MOTION]
    for k in range(4):
        q[k, 0], q[k, 1], q[k, 2] = ux, uy, uz
        ax, ay, az = acceleration(order_n, ux, uz, wx, wy)
        ux, uy, uz, wx, wy, wz = wx, wy, wz, ax, ay, az
    if order_n != n:
        x, y, z, vx, vy, vz = state_at(arc, arc[START])
        ux, uy, uz, wx, wy, wz = steering_at(arc, arc[START])
        for k in range(4):
            ax, ay, az = acceleration(n, x, z, vx, vy)
            q[k, 0] -= ax
            q[k, 1] -= ay
            q[k, 2] -= az
            x, y, z, vx, vy, vz = vx, vy, vz, ux, uy, uz
            ux, uy, uz, wx, wy, wz = wx, wy, wz, 0.0, 0.0, 0.0
    if pushes(arc):
        q[0, 0] += arc[CONSTANT]
        q[0, 1] += arc[CONSTANT + 1]
        q[0, 2] += arc[CONSTANT + 2]
    return highest(q, 4, order_n, duration)


ENERGY, DELTA_V, PEAK = 0, 1, 2


@kernel(void(float64[:, ::1], int64[::1], float64, int64, float64[::1]))
def totals(arcs, offsets, n, what, out):
    """Energy, delta-v or peak thrust of every path; the impulses count in none of them."""
    stack = np.empty(200)
    q = np.empty((8, 3))
    for p in range(len(offsets) - 1):
        total = 0.0
        for a in range(offsets[p], offsets[p + 1]):
            arc = arcs[a]
            if arc[END] > arc[START]:
                if what == ENERGY:
                    total += arc_energy(arc, n)
                elif what == DELTA_V:
                    total += arc_delta_v(arc, n, stack)
                else:
                    total = max(total, arc_peak(arc, n, q))
        out[p] = total


@dataclass(frozen=True, eq=False)
class Path:
    """Motion of one craft, or of a batch of craft of `shape`, in one orbit's rotating frame.

    `arcs` (M, 21) holds the arcs of every craft, one after another (see `arc`); `offsets`
    (N + 1,) tells where each craft's begin.  Paths are made by an `Orbit`, `join` and `stack`.
    Index a batch like an array to get some of its craft.
    """

    orbit: "Orbit"
    arcs: Floats
    offsets: Any
    shape: tuple[int, ...]

    @property
    def start(self) -> Any:
        """Start time [s], of the batch's shape."""
        return self._shaped(self.arcs[self.offsets[:-1], START])

    @property
    def end(self) -> Any:
        """End time [s], of the batch's shape."""
        return self._shaped(self.arcs[self.offsets[1:] - 1, END])

    def state(self, time: ArrayLike) -> Floats:
        """States [m, m/s] at `time` [s]: shape of the path + shape of `time` + (6,).

        At an impulse the state is the one after it.  Raises ValueError for a time outside of
        the path (1e-9 of its length is forgiven) or one that is not finite.
        """
        return self._evaluate(time, 6)

    def position(self, time: ArrayLike) -> Floats:
        """Positions [m] at `time` [s]: shape of the path + shape of `time` + (3,)."""
        return self.state(time)[..., :3]

    def velocity(self, time: ArrayLike) -> Floats:
        """Velocities [m/s] at `time` [s]: shape of the path + shape of `time` + (3,)."""
        return self.state(time)[..., 3:]

    def thrust(self, time: ArrayLike) -> Floats:
        """Thrust accelerations [m/s^2] at `time` [s]: shape of the path + shape of `time` + (3,).

        Impulses are not in it.  For a sampled path: the thrust that its motion asks for.
        """
        return self._evaluate(time, 3)

    @property
    def energy(self) -> Any:
        """Half the integral of |thrust|^2 [m^2/s^3], per unit mass; inf with an impulse.  # theory (7)"""
        energy = self._total(ENERGY)
        impulsive = np.abs(self.arcs[:, IMPULSE : IMPULSE + 3]).sum(axis=1) > 0
        energy[np.add.reduceat(impulsive, self.offsets[:-1]) > 0] = np.inf
        return self._shaped(energy)

    @property
    def delta_v(self) -> Any:
        """Integral of |thrust| and the sizes of all impulses [m/s], to 1e-9 of itself."""
        jumps = np.linalg.norm(self.arcs[:, IMPULSE : IMPULSE + 3], axis=1)
        return self._shaped(self._total(DELTA_V) + np.add.reduceat(jumps, self.offsets[:-1]))

    @property
    def peak_thrust(self) -> Any:
        """Greatest |thrust| [m/s^2], to 1e-9 of itself; impulses are not in it."""
        return self._shaped(self._total(PEAK))

    @property
    def impulses(self) -> tuple[tuple[float, Floats], ...]:
        """The velocity jumps of one craft: (time [s], jump (3,) [m/s]) in order of time.

        Raises ValueError for a batch: index it first.
        """
        if self.shape:
            raise ValueError(f"impulses: of one craft at a time, this path has shape {self.shape}; index it")
        jumps = self.arcs[:, IMPULSE : IMPULSE + 3]
        return tuple((float(self.arcs[k, START]), jumps[k].copy()) for k in np.flatnonzero(jumps.any(axis=1)))

    def __len__(self) -> int:
        if not self.shape:
            raise TypeError("a path of one craft has no length")
        return self.shape[0]

    def __getitem__(self, index: Any) -> "Path":
        if not self.shape:
            raise IndexError("a path of one craft cannot be indexed")
        chosen = np.arange(len(self.offsets) - 1).reshape(self.shape)[index]
        return self._gathered(np.ravel(chosen), np.shape(chosen))

    def __repr__(self) -> str:
        arcs = len(self.arcs)
        span = f"{np.min(self.start):g} to {np.max(self.end):g} s"
        return f"<Path shape={self.shape}, {arcs} arc{'s' * (arcs != 1)}, {span}>"

    def broadcast_to(self, shape: tuple[int, ...]) -> "Path":
        """The same paths repeated to a larger batch `shape`, as `numpy.broadcast_to` would."""
        index = np.broadcast_to(np.arange(len(self.offsets) - 1).reshape(self.shape), shape)
        return self._gathered(index.ravel(), shape)

    def _gathered(self, index: Any, shape: tuple[int, ...]) -> "Path":
        if not shape:
            first, last = self.offsets[index[0]], self.offsets[index[0] + 1]
            return Path(self.orbit, self.arcs[first:last], np.array([0, last - first]), ())
        counts = np.diff(self.offsets)[index]
        offsets = np.concatenate([[0], np.cumsum(counts)])
        rows = np.arange(offsets[-1]) + np.repeat(self.offsets[index] - offsets[:-1], counts)
        return Path(self.orbit, self.arcs[rows], offsets, shape)

    def _shaped(self, values: Any) -> Any:
        return values.reshape(self.shape) if self.shape else float(values[0])

    def _total(self, what: int) -> Floats:
        out = np.empty(len(self.offsets) - 1)
        totals(self.arcs, self.offsets, self.orbit.mean_motion, what, out)
        return out

    def _evaluate(self, time: ArrayLike, columns: int) -> Floats:
        times = np.asarray(time, dtype=float)
        starts, ends = self.arcs[self.offsets[:-1], START], self.arcs[self.offsets[1:] - 1, END]
        if times.size and len(starts):
            first, last, slack = starts.max(), ends.min(), FORGIVEN * (ends - starts).min()
            if not (times.min() >= first - slack and times.max() <= last + slack):
                raise ValueError(f"time: must lie on the path, from {first:.12g} to {last:.12g} s")
        out = self._evaluate_rows(times.reshape(1, -1), columns)
        return out.reshape(self.shape + times.shape + (columns,))

    def _at(self, index: Any, times: Floats) -> Floats:
        """State (M, 6) of craft `index` (M,) of the flattened batch, each at its own time (M,)."""
        return self._gathered(index, index.shape)._evaluate_rows(times[:, None])[:, 0]

    def _evaluate_rows(self, times: Floats, columns: int = 6) -> Floats:
        out = np.empty((len(self.offsets) - 1, times.shape[1], columns))
        evaluate(self.arcs, self.offsets, self.orbit.mean_motion, np.ascontiguousarray(times), out)
        return out


def _single(paths: Any, verb: str) -> list[Path]:
    chosen = list(paths)
    if not chosen:
        raise ValueError(f"paths: nothing to {verb}, give at least one path")
    for path in chosen:
        if path.orbit.mean_motion != chosen[0].orbit.mean_motion:
            raise ValueError(f"paths: all must be in one orbit to {verb} them")
    return chosen


def join(paths: Any) -> Path:
    """One path out of several that follow each other in time, all of one batch shape.

    A velocity jump between two becomes an impulse; a position jump is an error.  Jumps below
    1e-9 of the larger of |r| and |v| T are rounding.  Raises ValueError for a gap in time, a
    position jump, or different shapes or orbits.
    """
    chosen = _single(paths, "join")
    if any(path.shape != chosen[0].shape for path in chosen):
        raise ValueError(f"paths: all must have one shape to join them, got {[p.shape for p in chosen]}")
    pieces = [chosen[0].arcs]
    for before, after in zip(chosen, chosen[1:], strict=False):
        arcs = after.arcs.copy()
        first = after.offsets[:-1]
        last = before.offsets[1:] - 1
        length = before.arcs[last, END] - before.arcs[before.offsets[:-1], START]
        gap = arcs[first, START] - before.arcs[last, END]
        if np.any(np.abs(gap) > FORGIVEN * length):
            raise ValueError(
                f"paths: one ends and the next starts {np.abs(gap).max():g} s apart; they must follow"
            )
        ended = before._evaluate_rows(before.arcs[last, END : END + 1])[:, 0]
        jump = arcs[first, STATE : STATE + 6] - ended
        size = np.abs(ended[:, :3]).max(axis=1), np.abs(ended[:, 3:]).max(axis=1) * length
        scale = FORGIVEN * np.maximum(*size) + 1e-300
        if np.any(np.abs(jump[:, :3]).max(axis=1) > scale):
            raise ValueError(f"paths: position jumps by {np.abs(jump[:, :3]).max():g} m between two of them")
        kicked = np.abs(jump[:, 3:]).max(axis=1) * np.maximum(length, 1e-300) > scale
        arcs[first, IMPULSE : IMPULSE + 3] = np.where(kicked[:, None], jump[:, 3:], 0.0)
        pieces.append(arcs)
    return _interleaved(chosen, pieces)


def _interleaved(paths: list[Path], pieces: list[Floats]) -> Path:
    """Arcs of each craft brought together, craft by craft."""
    owner = np.concatenate([np.repeat(np.arange(len(p.offsets) - 1), np.diff(p.offsets)) for p in paths])
    arcs = np.concatenate(pieces)[np.argsort(owner, kind="stable")]
    offsets = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=len(paths[0].offsets) - 1))])
    return Path(paths[0].orbit, arcs, offsets, paths[0].shape)


def stack(paths: Any) -> Path:
    """One batch of shape (N,) out of N paths of single craft; they may have different times.

    Raises ValueError for a path that is a batch already, or for different orbits.
    """
    chosen = _single(paths, "stack")
    if any(path.shape for path in chosen):
        raise ValueError("paths: stack takes paths of single craft; index the batches first")
    offsets = np.concatenate([[0], np.cumsum([len(path.arcs) for path in chosen])])
    return Path(chosen[0].orbit, np.concatenate([path.arcs for path in chosen]), offsets, (len(chosen),))
