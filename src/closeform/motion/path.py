"""Path: motion as arcs in closed form, for one craft or a whole batch."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import float64, int64, void
from numpy.typing import ArrayLike

from closeform.arrays import Floats, numbers, sequence, shown
from closeform.compiled import kernel
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, START, STATE, WIDTH, state_at
from closeform.motion.effort import DELTA_V, ENERGY, HIDDEN, PEAK, thrust_at, totals
from closeform.motion.march import locate

if TYPE_CHECKING:
    from closeform.motion.orbit import Orbit

FORGIVEN = 1e-9  # of the path's length, outside of it; of its scale, between joined arcs


@kernel(void(float64[:, ::1], int64[::1], float64, float64[:, ::1], float64[:, :, ::1]))
def evaluate(arcs: Floats, offsets: Any, n: float, times: Floats, out: Floats) -> None:
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


@dataclass(frozen=True, eq=False)
class Path:
    """Motion of one craft, or of a batch of craft of `shape`, in one orbit's rotating frame.

    `arcs` (M, 30) holds the arcs of every craft, one after another (see `arc`); `offsets`
    (N + 1,) tells where each craft's begin.  Paths are made by an `Orbit`, `join` and `stack`.
    Index a batch like an array to get some of its craft.
    """

    orbit: "Orbit"
    arcs: Floats
    offsets: Any
    shape: tuple[int, ...]

    def __post_init__(self) -> None:
        if not hasattr(self.orbit, "mean_motion"):
            raise ValueError(f"orbit: expected Orbit, got {shown(self.orbit)}")
        arcs, offsets = np.ascontiguousarray(numbers("arcs", self.arcs)), np.asarray(self.offsets)
        if arcs.ndim != 2 or arcs.shape[1] != WIDTH:
            raise ValueError(f"arcs: expected shape (M, {WIDTH}), got {arcs.shape}")
        whole = offsets.dtype.kind in "iu" and offsets.ndim == 1 and len(offsets) > 0
        if not (whole and offsets[0] == 0 and offsets[-1] == len(arcs) and (np.diff(offsets) >= 0).all()):
            raise ValueError(
                f"offsets: expected where arcs begin, from 0 to {len(arcs)}, got {shown(self.offsets)}"
            )
        sides = isinstance(self.shape, tuple) and all(
            isinstance(side, int | np.integer) for side in self.shape
        )
        if not sides or math.prod(self.shape) != len(offsets) - 1:
            raise ValueError(f"shape: expected one of {len(offsets) - 1} craft, got {shown(self.shape)}")
        object.__setattr__(self, "arcs", arcs)
        object.__setattr__(self, "offsets", np.ascontiguousarray(offsets, dtype=np.int64))

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
        """Positions [m] at `time` [s]: shape of the path + shape of `time` + (3,).  Raises as `state`."""
        return self.state(time)[..., :3]

    def velocity(self, time: ArrayLike) -> Floats:
        """Velocities [m/s] at `time` [s]: shape of the path + shape of `time` + (3,).  Raises as `state`."""
        return self.state(time)[..., 3:]

    def thrust(self, time: ArrayLike) -> Floats:
        """Thrust accelerations [m/s^2] at `time` [s]: shape of the path + shape of `time` + (3,).

        Impulses are not in it.  For a sampled path: the thrust that its motion asks for.  Raises
        as `state`.
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
    def interpolation_error(self) -> Any:
        """Of a path through samples: how far from it the craft may have been between two, an estimate [m].

        a h^2 / 16, the greatest for all samples, h apart, with a the acceleration that the path has
        beside natural motion: as far as a craft can be that thrusts by a more or less.  A visit that
        it thrusts for harder, and that ends before the next sample, is in no sample to be seen.
        """
        return self._shaped(self._total(HIDDEN))

    @property
    def cubic_share(self) -> Any:
        """Share of the arcs that are cubics through samples, not motion in this orbit; 0 in deep space."""
        cubic = self.arcs[:, MEAN_MOTION] != self.orbit.mean_motion
        return self._shaped(np.add.reduceat(cubic, self.offsets[:-1], dtype=float) / np.diff(self.offsets))

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
        span = f", {np.min(self.start):g} to {np.max(self.end):g} s" if arcs else ""
        return f"<Path shape={self.shape}, {arcs} arc{'s' * (arcs != 1)}{span}>"

    def _gathered(self, index: Any, shape: tuple[int, ...]) -> "Path":
        if not shape:
            first, last = self.offsets[index[0]], self.offsets[index[0] + 1]
            return path_of(self.orbit, self.arcs[first:last], np.array([0, last - first]), ())
        counts = np.diff(self.offsets)[index]
        offsets = np.concatenate([[0], np.cumsum(counts)])
        rows = np.arange(offsets[-1]) + np.repeat(self.offsets[index] - offsets[:-1], counts)
        return path_of(self.orbit, self.arcs[rows], offsets, shape)

    def _shaped(self, values: Any) -> Any:
        return values.reshape(self.shape) if self.shape else float(values[0])

    def _total(self, what: int) -> Floats:
        out = np.empty(len(self.offsets) - 1)
        totals(self.arcs, self.offsets, self.orbit.mean_motion, what, out)
        return out

    def _evaluate(self, time: ArrayLike, columns: int) -> Floats:
        times = numbers("time", time)
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


def path_of(orbit: "Orbit", arcs: Floats, offsets: Any, shape: tuple[int, ...]) -> Path:
    """Of contiguous arcs and offsets (int64) that fit, which nobody needs to look at again."""
    path = object.__new__(Path)
    path.__dict__.update(orbit=orbit, arcs=arcs, offsets=offsets, shape=shape)
    return path


def _single(paths: Any, verb: str) -> list[Path]:
    chosen = sequence("paths", paths, Path)
    if not chosen:
        raise ValueError(f"paths: nothing to {verb}, give at least one path")
    for path in chosen:
        if path.orbit.mean_motion != chosen[0].orbit.mean_motion:
            raise ValueError(f"paths: all must be in one orbit to {verb} them")
    return chosen


def join(paths: Any) -> Path:
    """One path out of `paths` that follow each other in time, all of one batch shape.

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
        scale = FORGIVEN * np.maximum(_scale(before, length), _scale(after, length)) + 1e-300
        if np.any(np.abs(jump[:, :3]).max(axis=1) > scale):
            raise ValueError(f"paths: position jumps by {np.abs(jump[:, :3]).max():g} m between two of them")
        kicked = np.abs(jump[:, 3:]).max(axis=1) * np.maximum(length, 1e-300) > scale
        arcs[first, IMPULSE : IMPULSE + 3] = np.where(kicked[:, None], jump[:, 3:], 0.0)
        pieces.append(arcs)
    return _interleaved(chosen, pieces)


def _scale(path: Path, duration: Floats) -> Floats:
    """The larger of |r| and |v| T over the arcs of each craft (N,)."""
    sizes = np.abs(path.arcs[:, STATE : STATE + 6])
    sizes[:, 3:] *= np.repeat(duration, np.diff(path.offsets))[:, None]
    return np.maximum.reduceat(sizes.max(axis=1), path.offsets[:-1])


def _interleaved(paths: list[Path], pieces: list[Floats]) -> Path:
    """Arcs of each craft brought together, craft by craft."""
    owner = np.concatenate([np.repeat(np.arange(len(p.offsets) - 1), np.diff(p.offsets)) for p in paths])
    arcs = np.concatenate(pieces)[np.argsort(owner, kind="stable")]
    offsets = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=len(paths[0].offsets) - 1))])
    return path_of(paths[0].orbit, arcs, offsets, paths[0].shape)


def stack(paths: Any) -> Path:
    """One batch of shape (N,) out of N `paths` of single craft; they may have different times.

    Raises ValueError for a path that is a batch already, or for different orbits.
    """
    chosen = _single(paths, "stack")
    if any(path.shape for path in chosen):
        raise ValueError("paths: stack takes paths of single craft; index the batches first")
    offsets = np.concatenate([[0], np.cumsum([len(path.arcs) for path in chosen])])
    arcs = np.concatenate([path.arcs for path in chosen])
    return path_of(chosen[0].orbit, arcs, offsets, (len(chosen),))
