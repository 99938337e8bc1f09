"""Sampled trajectories of a random relative motion: mean path and error columns, in common windows.

In each window the mean and the columns are polynomials (see `table_windows`).  A trajectory is the mean plus
each column times its error, so that it costs one sum of coefficients per window, and the signs of polynomials
count its entries.  Most windows need no count: the whole trajectory lies beyond a plane that touches the zone
near the mean.

Process noise acts by changes of velocity between short steps, so that states are exact at the ends of steps
and paths are continuous. The effect of these changes is a natural motion, which is six more columns. The
remaining effect of noise within a step is bounded.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import ceil, inf
from typing import Any, NamedTuple

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats, instance, subdivided
from closeform.conflicts.chief.sign_changes import DEPTH, excluded, window_changes
from closeform.conflicts.pair_search import ENTERED
from closeform.conflicts.two_paths import check_comparable
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
from closeform.motion.arc import START
from closeform.motion.chief.bernstein import SQUARE, TERMS
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.path import Path
from closeform.uncertainty.covariance import roots_of
from closeform.uncertainty.error_columns import columns_of_pair
from closeform.uncertainty.errors import Uncertainty
from closeform.uncertainty.table_windows import (
    ANGLE,
    hill_windows,
    natural_windows,
    polynomial_state,
    table_windows,
)
from closeform.uncertainty.white_noise import (
    MOST_OFF,
    SAME,
    STEPS,
    deviation_in_step,
    end_changes,
    step_for_zone,
    step_noise,
)
from closeform.zones.shapes import FACES, FORM, norm, part, part_count
from closeform.zones.zone import Zone

CHUNK = 16_384  # trajectories in a chunk, the work of one thread; each chunk has its own random numbers
NUMBERS = 1 << 22  # maximum count of random numbers of noise in a chunk
CORES = os.cpu_count() or 1
BEYOND = 1.0 + 1e-9  # beyond rounding
LEAST_OFF = 1e-9  # of the zone: bound of the effect of noise within a step, more than rounding
ROWS, PLANES, WINDOWS = float64[:, ::1], float64[:, :, ::1], float64[:, :, :, ::1]


@kernel()
def count_entries(form, c, inside, work):
    """Return whether a polynomial is inside at its end, and its entries; `inside` before its start."""
    shape, _, faces = form
    off, stack, ends, places, outs = work
    if excluded(shape, faces, c, off, stack[0]):
        return False, 0
    number, out = window_changes(shape, faces, c, off, stack, ends, places, outs)
    now = out == 0
    count = 1 if now and not inside else 0
    for m in range(number):
        out += outs[m]
        if (out == 0) != now:
            now = not now
            if now:
                count += 1
    return now, count


@kernel(void(WINDOWS, FORM, PLANES))
def fill_planes(windows, form, planes):
    """Fill the coefficients (W, 1 + m, 12) of mean and columns along the normal of a plane touching the zone.

    In zone units. A trajectory whose sums all exceed 1 has no entry in the window.
    """
    shape, _, faces = form
    for w in range(len(windows)):
        x, y, z, _, _, _ = polynomial_state(windows[w, 0], 0.5)
        farthest, gx, gy, gz = part(shape, faces, 0, x, y, z)
        for k in range(1, part_count(shape, faces)):
            s, ax, ay, az = part(shape, faces, k, x, y, z)
            if s > farthest:
                farthest, gx, gy, gz = s, ax, ay, az
        for j in range(len(planes[w])):
            q = windows[w, j]
            for k in range(TERMS):
                planes[w, j, k] = gx * q[k, 0] + gy * q[k, 1] + gz * q[k, 2]


@kernel()
def is_beyond(shape, plane, error, scale, line):
    """Return True if a trajectory stays beyond a window's plane (1 + m, 12), or beyond the opposite one.

    The planes are those of the zone enlarged by `scale`. `line` (12,) is room.
    """
    for b in range(TERMS):
        line[b] = plane[0, b]
    for j in range(len(error)):
        for b in range(TERMS):
            line[b] += error[j] * plane[j + 1, b]
    least, most = inf, -inf
    for b in range(TERMS):
        least, most = min(least, line[b]), max(most, line[b])
    return least > BEYOND * scale or (most < -BEYOND * scale and shape != FACES)


@kernel(
    void(
        *(WINDOWS, PLANES, FORM, float64[::1], int64[::1], float64[:, :, ::1], ROWS, ROWS),
        *(float64[:, :, ::1], int64[:, :, ::1]),
    )
)
def count_trajectories(windows, planes, form, factors, instants, flows, ends, errors, pushes, out):
    """Write whether each trajectory begins inside, and its later entries, to `out` (N, Z, 2).

    For errors (N, m) and increments `pushes` (N, K, 6) of the state by noise in each step, which act by
    velocity changes at the `ends` (6, 6) of steps. The zone is scaled by Z factors, the largest first. With
    noise the last six columns of windows are natural motions; without, there are no steps.
    """
    windows, planes, errors, out = borrowed(windows), borrowed(planes), borrowed(errors), borrowed(out)
    flows, ends, pushes = borrowed(flows), borrowed(ends), borrowed(pushes)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    given, width = errors.shape[1], windows.shape[1] - 1
    q, scaled, line = stack_matrix(TERMS, 3), stack_matrix(3, TERMS), stack_vector(TERMS)
    room = 2 * SQUARE + 2 * TERMS * (6 + len(form[2]))
    work = (
        np.zeros(3),
        np.empty((DEPTH, SQUARE)),
        np.empty(DEPTH),
        np.empty(room),
        np.empty(room, dtype=np.int64),
    )
    xi, moved, inside = np.zeros(width), np.zeros(6), np.zeros(len(factors), dtype=np.bool_)
    for p in range(len(errors)):
        for j in range(width):
            xi[j] = errors[p, j] if j < given else 0.0
        out[p] = 0
        inside[:] = False
        for w in range(len(windows)):
            k = instants[w]
            for i in range(3 if k >= 0 else 0):
                for j in range(6):
                    xi[given + 3 + i] += ends[i, j] * pushes[p, k, j]
                    if k > 0:
                        xi[given + 3 + i] += ends[3 + i, j] * pushes[p, k - 1, j]
            if inside[0] or not is_beyond(form[0], planes[w], xi, factors[0], line):
                for k in range(TERMS):
                    for i in range(3):
                        q[k, i] = windows[w, 0, k, i]
                for j in range(width):
                    for k in range(TERMS):
                        for i in range(3):
                            q[k, i] += xi[j] * windows[w, j + 1, k, i]
                for z in range(len(factors)):
                    for i in range(3):
                        for k in range(TERMS):
                            scaled[i, k] = q[k, i] / factors[z]
                    if w == 0:
                        inside[z] = (
                            norm(form[0], form[2], scaled[0, 0], scaled[1, 0], scaled[2, 0]) <= ENTERED
                        )
                        out[p, z, 0] = inside[z]
                    before = inside[z]
                    inside[z], more = count_entries(form, scaled, before, work)
                    out[p, z, 1] += more
                    if w > 0 and not before and more == 0:
                        break  # smaller zones have no entries either
            for i in range(6 if width > given else 0):
                moved[i] = 0.0
                for j in range(6):
                    moved[i] += flows[w, i, j] * xi[given + j]
            for i in range(6 if width > given else 0):
                xi[given + i] = moved[i]


class Counts(NamedTuple):
    """Counts of random trajectories: inside at the start, ever inside, all entries, repeated entries.

    `least` and `most` bound the number ever inside, with the discretization error of process noise.
    """

    began: int
    ever: int
    entries: int
    again: int
    least: int
    most: int


@dataclass(frozen=True, eq=False)
class SampledTrajectories:
    """Relative motion of two craft, and the contribution of each of M independent errors.

    `edges` are the times between which all motions are smooth, from the start of the common time to its end.
    With process noise in steps of length `step` [s], `instants` (W,) are the indices of the velocity changes
    at which windows begin, -1 for none, `flows` (W, 6, 6) the transitions of windows, and `off` bounds the
    error relative to the zone, except with a probability below 1e-13 per step.
    """

    path: Path
    other: Path
    columns: Path
    noise: float  # spectral density of the process noise [m^2/s^3]
    zone: Zone
    edges: Floats
    turns: Floats  # (W,) parts of a revolution that windows take in Hill's equations, otherwise 1
    windows: Floats  # (W, 1 + M, 12, 3), (W, 7 + M, 12, 3) with steps: Bernstein coefficients
    planes: Floats  # (W, 1 + M, 12) or (W, 7 + M, 12)
    step: float | None
    instants: Any
    flows: Floats
    off: float

    @classmethod
    def of(
        cls,
        path: Path,
        other: Path,
        columns: Path,
        noise: float,
        zone: Zone,
        step: float | None = None,
    ) -> SampledTrajectories:
        """Return the trajectories.

        Without a `step`, process noise is not included in them.
        """
        starts = np.concatenate([path.arcs, other.arcs, columns.arcs])[:, START]
        start, end = max(path.start, other.start), min(path.end, other.end)
        changes, flows, off = np.empty(0), np.empty((0, 6, 6)), 0.0
        if step is not None:
            changes = start + step * np.arange(ceil((end - start) / step - SAME))
        edges = _edges(start, end, np.concatenate([starts, changes]))
        if isinstance(path.orbit, ChiefOrbit):
            _, windows, _ = table_windows(path, other, columns, zone)
            turns, instants = np.ones(len(windows)), np.full(len(windows), -1)
        else:
            n = path.orbit.mean_motion
            times = subdivided(edges, np.maximum(np.ceil(n * np.diff(edges) / ANGLE), 1.0))
            windows = hill_windows(path, other, columns, zone, times)
            turns = n * np.diff(times) / (2.0 * np.pi) if n > 0.0 else np.ones(len(windows))
            instants = np.full(len(windows), -1)
            if step is not None:
                natural = natural_windows(path.orbit, zone, np.diff(times))
                windows = np.concatenate([windows, natural], axis=1)
                places = np.minimum(np.searchsorted(changes, times[:-1]), len(changes) - 1)
                instants = np.where(changes[places] == times[:-1], places, -1)
                flows = path.orbit.transition(np.diff(times))
                off = max(deviation_in_step(noise, step) / zone.inner_radius, LEAST_OFF)
        planes = np.zeros(windows.shape[:3])
        fill_planes(windows, zone.form, planes)
        return cls(
            *(path, other, columns, noise, zone, edges, turns),
            *(windows, planes, step, instants, flows, off),
        )

    @property
    def changes(self) -> int:
        """Number of velocity changes by process noise."""
        return int(self.instants.max()) + 1

    @property
    def _moved(self) -> tuple[float, Any]:
        """Mean motion [rad/s] and step [s] of the process noise."""
        return self.path.orbit.mean_motion, self.step

    def spread(self, per_turn: float) -> Floats:
        """Return times of the whole motion, so many in a revolution, with all edges."""
        pairs, orbit = zip(self.edges[:-1], self.edges[1:], strict=True), self.path.orbit
        return np.unique(np.concatenate([orbit._spread(*pair, per_turn, 9) for pair in pairs]))

    def states(self, times: Floats) -> tuple[Floats, Floats]:
        """Return the mean (T, 6) and a factor (T, 6, M) of the covariance of the relative state."""
        at = np.ascontiguousarray(times).reshape(1, -1)
        mean = self.path._evaluate_rows(at)[0] - self.other._evaluate_rows(at)[0]
        factor = self.columns._evaluate_rows(at).transpose(1, 2, 0)
        if self.noise:
            added = roots_of(Uncertainty(noise=self.noise).covariance(self.path, times))
            factor = np.concatenate([factor, added], axis=2)
        return mean, np.ascontiguousarray(factor)

    def count(self, errors: Floats, pushes: Floats | None = None) -> Any:
        """Return whether trajectories of errors (N, M) begin inside, and their numbers of entries: (N, 2).

        `pushes` (N, K, 6) [m, m/s] are the increments of the state by process noise in each step.
        """
        held = np.empty((len(errors), 0, 6)) if pushes is None else pushes
        out = np.empty((len(errors), 1, 2), dtype=np.int64)
        ends = np.zeros((6, 6)) if self.step is None else end_changes(*self._moved)
        with ThreadPoolExecutor(CORES) as pool:
            size = max(1, min(CHUNK // 4, -(-len(errors) // (2 * CORES))))
            jobs = [slice(k, k + size) for k in range(0, len(errors), size)]
            list(
                pool.map(
                    lambda part: self._count(np.ones(1), ends, errors[part], held[part], out[part]), jobs
                )
            )
        return out[:, 0]

    def sample(self, samples: int, seed: int) -> Counts:
        """Return the counts of random trajectories.

        Each chunk has its own Philox stream, so that the result does not depend on the number of threads.
        """
        changes, factors, ends = self.changes, np.ones(1), np.zeros((6, 6))
        if self.step is not None:
            factors = np.array([1.0 + self.off, 1.0, 1.0 - self.off])
            root = step_noise(*self._moved)[1]
            ends = np.ascontiguousarray(np.sqrt(self.noise) * end_changes(*self._moved) @ root)
        size = max(1, min(CHUNK, NUMBERS // max(1, 6 * changes)))

        def chunk(k: int) -> Floats:
            random = np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, 0, k]))
            count = min(size, samples - k * size)
            errors = random.standard_normal((count, len(self.columns)))
            pushes = random.standard_normal((count, changes, 6))
            out = np.empty((count, len(factors), 2), dtype=np.int64)
            self._count(factors, ends, errors, pushes, out)
            ever = ((out[:, :, 0] > 0) | (out[:, :, 1] > 0)).sum(axis=0)
            began, entries = out[:, len(factors) // 2].T
            both = began.sum(), ever[len(factors) // 2]
            return np.array([*both, entries.sum(), (entries > 1).sum(), ever[-1], ever[0]])

        with ThreadPoolExecutor(CORES) as pool:
            return Counts(*sum(pool.map(chunk, range(-(-samples // size)))).tolist())  # type: ignore[union-attr]

    def _count(self, factors: Floats, ends: Floats, errors: Floats, pushes: Floats, out: Any) -> None:
        """Count the entries of trajectories with the kernel."""
        held = self.windows, self.planes, self.zone.form
        count_trajectories(*held, factors, self.instants, self.flows, ends, errors, pushes, out)


def _edges(start: float, end: float, times: Floats) -> Floats:
    """Return a start, an end, and the times between them."""
    return np.unique(np.concatenate([[start, end], times[(times > start) & (times < end)]]))


def noise_step(path: Path, other: Path, noise: float, zone: Zone) -> float | None:
    """Return a step [s] in which process noise moves craft by a thousandth of the zone; None without noise.

    Raises ValueError if it moves them by more than a tenth with ten thousand steps.
    """
    if not noise:
        return None
    if isinstance(path.orbit, ChiefOrbit):
        raise ValueError(
            f"errors: process noise is sampled about a circular orbit only, not about {path.orbit.chief}; "
            'use method="bound"'
        )
    n, span = path.orbit.mean_motion, min(path.end, other.end) - max(path.start, other.start)
    step: float = span / ceil(span / step_for_zone(n, noise, zone.inner_radius, span) - SAME)
    if deviation_in_step(noise, step) > MOST_OFF * zone.inner_radius:
        raise ValueError(
            f"errors: noise of {noise:g} m^2/s^3 moves craft too far for the zone in each of {STEPS} "
            'steps; use method="bound"'
        )
    return step


def relative_errors(
    path: Path, other: Path, zone: Zone, errors: Uncertainty, other_errors: Uncertainty | None
) -> tuple[Path, float]:
    """Return the columns (M,) of the relative motion, natural ones merged to six, and the noise [m^2/s^3].

    Raises ValueError if the two cannot be compared, or nothing is uncertain.
    """
    check_comparable(path, other, zone)
    if path.shape or other.shape:
        raise ValueError(
            f"path, other: expected one craft each, got shapes {path.shape} and {other.shape}; index them"
        )
    instance("errors", errors, Uncertainty)
    if path.start != other.start:
        raise ValueError(
            f"other: starts at {other.start:g} s, path at {path.start:g} s; errors hold at the start, "
            "so both must start at the same time"
        )
    if other_errors is not None:
        instance("other_errors", other_errors, Uncertainty)
    columns = columns_of_pair(path, other, errors, other_errors)
    noise = errors.noise + (0.0 if other_errors is None else other_errors.noise)
    if not len(columns) and not noise:
        raise ValueError("errors: all are zero; give an uncertainty, or use find_conflicts")
    return columns, noise
