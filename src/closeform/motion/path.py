"""Paths: motion as arcs in closed form, of one spacecraft or of a batch."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np
from numba import float64, int64, void
from numpy.typing import ArrayLike

from closeform._jit import kernel
from closeform.arrays import Floats, finite, instance, number, numbers, shown
from closeform.motion.arc import END, IMPULSE, START, STATE, WIDTH, state_at
from closeform.motion.certified_march import locate
from closeform.motion.effort import DELTA_V, ENERGY, HIDDEN, PEAK, thrust_at
from closeform.result import Result

if TYPE_CHECKING:
    from closeform.motion.orbit import Orbit

FORGIVEN = 1e-9  # accepted rounding, relative to the duration, and between joined arcs to the scale


@kernel(void(float64[:, ::1], int64[::1], float64, float64[:, ::1], float64[:, :, ::1]))
def evaluate(arcs: Floats, offsets: Any, n: float, times: Floats, out: Floats) -> None:
    """Fill `out` with states, or with thrusts if it has three columns.

    `times` has one row for all paths or one for each.
    """
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


@dataclass(frozen=True, eq=False, repr=False)
class Path(Result):
    """Motion of one spacecraft, or of a batch of spacecraft, in the rotating frame of one orbit.

    Paths are made by an `Orbit` of any kind, `join` and `stack`.  Index a batch like an array to select
    spacecraft.

    Attributes
    ----------
    orbit : Orbit
        Orbit whose rotating frame is used.
    arcs : array of shape (M, 30) [s, m, m/s, m/s^2]
        Arcs of all spacecraft, one after another; a row is described in `closeform.motion.arc`.
    offsets : array of int of shape (N + 1,)
        Index of the first arc of each spacecraft, and the number of arcs.
    shape : tuple of int
        Shape of the batch: () for one spacecraft.

    Raises
    ------
    ValueError
        If arcs, offsets and shape do not fit each other.
    """

    orbit: Orbit
    arcs: Floats
    offsets: Any
    shape: tuple[int, ...]
    _told: ClassVar = ("shape", "start", "end", "energy", "delta_v", "peak_thrust")

    def __post_init__(self) -> None:
        if not hasattr(self.orbit, "_fill_states"):
            raise ValueError(f"orbit: expected Orbit, got {shown(self.orbit)}")
        arcs, offsets = np.ascontiguousarray(numbers("arcs", self.arcs)), np.asarray(self.offsets)
        if arcs.ndim != 2 or arcs.shape[1] != WIDTH:
            raise ValueError(f"arcs: expected shape (M, {WIDTH}), got {arcs.shape}")
        whole = offsets.dtype.kind in "iu" and offsets.ndim == 1 and len(offsets) > 0
        if not (whole and offsets[0] == 0 and offsets[-1] == len(arcs) and (np.diff(offsets) >= 0).all()):
            raise ValueError(
                f"offsets: expected indices of first arcs, from 0 to {len(arcs)}, got {shown(self.offsets)}"
            )
        sides = isinstance(self.shape, tuple) and all(
            isinstance(side, int | np.integer) for side in self.shape
        )
        if not sides or math.prod(self.shape) != len(offsets) - 1:
            raise ValueError(f"shape: expected one of {len(offsets) - 1} spacecraft, got {shown(self.shape)}")
        object.__setattr__(self, "arcs", arcs)
        object.__setattr__(self, "offsets", np.ascontiguousarray(offsets, dtype=np.int64))

    @property
    def start(self) -> Any:
        """Start time [s], of the path's shape."""
        return self._shaped(self.arcs[self.offsets[:-1], START])

    @property
    def end(self) -> Any:
        """End time [s], of the path's shape."""
        return self._shaped(self.arcs[self.offsets[1:] - 1, END])

    def state(self, time: ArrayLike) -> Floats:
        """Return states at given times.

        Parameters
        ----------
        time : array_like of shape (...) [s]
            Times on the path; at an impulse the state is the one after it.

        Returns
        -------
        array of shape (*path, ..., 6) [m, m/s]
            States in the rotating frame, for each spacecraft of the path's shape.

        Raises
        ------
        ValueError
            If a time is outside of the path (by more than 1e-9 of its duration) or not finite.

        References
        ----------
        docs/theory.md section 1.
        """
        return self._evaluate(time, 6)

    def position(self, time: ArrayLike) -> Floats:
        """Return positions at given times.

        Parameters
        ----------
        time : array_like of shape (...) [s]
            Times on the path.

        Returns
        -------
        array of shape (*path, ..., 3) [m]
            Positions in the rotating frame, for each spacecraft of the path's shape.

        Raises
        ------
        ValueError
            If a time is outside of the path (by more than 1e-9 of its duration) or not finite.

        References
        ----------
        docs/theory.md section 1.
        """
        return self.state(time)[..., :3]

    def velocity(self, time: ArrayLike) -> Floats:
        """Return velocities at given times.

        Parameters
        ----------
        time : array_like of shape (...) [s]
            Times on the path; at an impulse the velocity is the one after it.

        Returns
        -------
        array of shape (*path, ..., 3) [m/s]
            Velocities in the rotating frame, for each spacecraft of the path's shape.

        Raises
        ------
        ValueError
            If a time is outside of the path (by more than 1e-9 of its duration) or not finite.

        References
        ----------
        docs/theory.md section 1.
        """
        return self.state(time)[..., 3:]

    def thrust(self, time: ArrayLike) -> Floats:
        """Return thrust accelerations at given times, without impulses.

        Parameters
        ----------
        time : array_like of shape (...) [s]
            Times on the path.

        Returns
        -------
        array of shape (*path, ..., 3) [m/s^2]
            Thrust in the rotating frame, for each spacecraft of the path's shape; for a path through samples
            the thrust that its motion requires.

        Raises
        ------
        ValueError
            If a time is outside of the path (by more than 1e-9 of its duration) or not finite.

        References
        ----------
        docs/theory.md section 2.
        """
        return self._evaluate(time, 3)

    def extended(self, until: float) -> Path:
        """Return the path with natural motion after its end.

        Parameters
        ----------
        until : float [s]
            End of the natural motion.  Spacecraft of a batch with a path that ends later are unchanged.

        Returns
        -------
        Path
            Path of the same shape.

        Raises
        ------
        ValueError
            If the time is not finite, or too late for the orbit.

        References
        ----------
        docs/theory.md section 1.

        Examples
        --------
        >>> orbit = cf.Orbit.circular(500e3)
        >>> client = orbit.coast(np.zeros(6), 2000.0)
        >>> visitor = orbit.coast([-20, -100, 0, 0, 0.0332, 0], 500.0)
        >>> len(cf.find_conflicts(visitor, client, cf.Sphere(60.0)))
        0
        >>> len(cf.find_conflicts(visitor.extended(2000.0), client, cf.Sphere(60.0)))
        1
        """
        time = float(finite("until", number("until", until)))
        lasts = self.offsets[1:]
        ends = self.arcs[lasts - 1, END]
        early = ends < time
        if not early.any():
            return self
        states = self._evaluate_rows(ends[:, None])[early, 0]
        coasts = self.orbit.coast(states, time - ends[early], ends[early]).arcs
        arcs = np.insert(self.arcs, lasts[early], coasts, axis=0)
        offsets = self.offsets + np.concatenate([[0], np.cumsum(early)])
        return path_of(self.orbit, arcs, offsets, self.shape)

    @property
    def energy(self) -> Any:
        """Control energy [m^2/s^3] per unit mass, half the integral of |thrust|^2, of the path's shape.

        It is inf with an impulse. docs/theory.md (7).
        """
        energy = self._total(ENERGY)
        impulsive = np.abs(self.arcs[:, IMPULSE : IMPULSE + 3]).sum(axis=1) > 0
        energy[np.add.reduceat(impulsive, self.offsets[:-1]) > 0] = np.inf
        return self._shaped(energy)

    @property
    def delta_v(self) -> Any:
        """Integral of |thrust| plus the sizes of all impulses [m/s], to 1e-9, of the path's shape."""
        jumps = np.linalg.norm(self.arcs[:, IMPULSE : IMPULSE + 3], axis=1)
        return self._shaped(self._total(DELTA_V) + np.add.reduceat(jumps, self.offsets[:-1]))

    @property
    def peak_thrust(self) -> Any:
        """Largest |thrust| [m/s^2] without impulses, to a relative 1e-9, of the path's shape."""
        return self._shaped(self._total(PEAK))

    @property
    def interpolation_error(self) -> Any:
        """Estimated position error between the samples of a path [m], of the path's shape.

        The estimate is a h^2 / 16, the maximum over all intervals h between samples, with a the
        acceleration of the path beyond natural motion: the distance that a spacecraft can cover with
        a thrust that differs by a. A manoeuvre with more thrust that ends before the next sample
        leaves no trace in the samples.
        """
        return self._shaped(self._total(HIDDEN))

    @property
    def cubic_share(self) -> Any:
        """Fraction of the arcs that are cubics through samples, no unit, of the path's shape.

        The others are motion in this orbit. The share is 0 in deep space, where natural motion is
        cubic.
        """
        cubic = self.orbit._interpolates(self.arcs)
        return self._shaped(np.add.reduceat(cubic, self.offsets[:-1], dtype=float) / np.diff(self.offsets))

    @property
    def impulses(self) -> tuple[tuple[float, Floats], ...]:
        """Velocity jumps of one spacecraft in order of time: (time [s], jump (3,) [m/s]).

        Raises ValueError for a batch: index it first.
        """
        if self.shape:
            raise ValueError(f"impulses: requires one spacecraft, got shape {self.shape}; index it")
        jumps = self.arcs[:, IMPULSE : IMPULSE + 3]
        return tuple((float(self.arcs[k, START]), jumps[k].copy()) for k in np.flatnonzero(jumps.any(axis=1)))

    def __len__(self) -> int:
        if not self.shape:
            raise TypeError("a path of one spacecraft has no length")
        return self.shape[0]

    def __bool__(self) -> bool:
        return not self.shape or self.shape[0] > 0  # a single path is true, without a length

    def __getitem__(self, index: Any) -> Path:
        if not self.shape:
            raise IndexError("a path of one spacecraft cannot be indexed")
        chosen = np.arange(len(self.offsets) - 1).reshape(self.shape)[index]
        return self._gathered(np.ravel(chosen), np.shape(chosen))

    @property
    def _brief(self) -> str:
        arcs, craft = len(self.arcs), len(self.offsets) - 1
        span = f", {np.min(self.start):g} to {np.max(self.end):g} s" if arcs else ""
        return f"{craft} craft of shape {self.shape}, {arcs} arc{'s' * (arcs != 1)}{span}"

    def __repr__(self) -> str:
        return f"<Path: {self._brief}>"

    def _gathered(self, index: Any, shape: tuple[int, ...]) -> Path:
        if not shape:
            first, last = self.offsets[index[0]], self.offsets[index[0] + 1]
            return path_of(self.orbit, self.arcs[first:last], np.array([0, last - first]), ())
        counts = np.diff(self.offsets)[index]
        offsets = np.concatenate([[0], np.cumsum(counts)])
        rows = np.arange(offsets[-1]) + np.repeat(self.offsets[index] - offsets[:-1], counts)
        return path_of(self.orbit, self.arcs[rows], offsets, shape)

    @cached_property
    def _segments(self) -> tuple[Floats, Any]:
        """Polynomial segments of all arcs about a chief that is not on a circle, as `chief.segments`."""
        found: tuple[Floats, Any] = cast(Any, self.orbit)._segments(self.arcs, self.offsets)
        return found

    def _shaped(self, values: Any) -> Any:
        return values.reshape(self.shape) if self.shape else float(values[0])

    def _total(self, what: int) -> Floats:
        return self.orbit._totals(self, what)

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
        """Return states (M, 6) of spacecraft `index` (M,) of the flattened batch at times (M,)."""
        return self._gathered(index, index.shape)._evaluate_rows(times[:, None])[:, 0]

    def _evaluate_rows(self, times: Floats, columns: int = 6) -> Floats:
        out = np.empty((len(self.offsets) - 1, times.shape[1], columns))
        self.orbit._fill_states(self, np.ascontiguousarray(times), out)
        return out


def of_one_craft(path: Path) -> Path:
    """Return `path`; raise ValueError unless it is that of one spacecraft."""
    if instance("path", path, Path).shape:
        raise ValueError(f"path: requires one spacecraft, got shape {path.shape}; index it")
    return path


def fires_impulses(path: Path) -> bool:
    """Return True if the velocity of any spacecraft jumps."""
    return bool(path.arcs[:, IMPULSE : IMPULSE + 3].any())


def runs_of(which: Any) -> Any:
    """Return runs (R, 2) of consecutive True in `which` (M,): the first index, and the one after the last."""
    return np.flatnonzero(np.diff(np.concatenate([[False], which, [False]]))).reshape(-1, 2)


def ends_of(path: Path) -> tuple[Floats, Floats]:
    """Return the states (6,) of one spacecraft before an impulse at its start, and at its end."""
    first = path.arcs[0, STATE : STATE + 6].copy()
    first[3:] -= path.arcs[0, IMPULSE : IMPULSE + 3]
    return first, path.state(path.end)


def path_of(orbit: Any, arcs: Floats, offsets: Any, shape: tuple[int, ...]) -> Path:
    """Return a path of contiguous arcs and offsets (int64) without validating them.

    `orbit` is an `Orbit`, or a `ChiefOrbit`, which has the same methods.
    """
    path = object.__new__(Path)
    path.__dict__.update(orbit=orbit, arcs=arcs, offsets=offsets, shape=shape)
    return path
