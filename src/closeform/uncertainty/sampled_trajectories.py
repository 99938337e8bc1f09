"""Sampled trajectories of a random relative motion: mean path and error columns, in common windows.

A trajectory is the mean motion plus each column times its error. Derivatives at a window's start add up like
motions, so that a trajectory costs one sum per window, and the march that finds conflicts counts its entries.
Most windows need no march: the whole trajectory lies beyond a plane that touches the zone near the mean.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.conflicts.pair_search import ENTERED, cross
from closeform.kernel_loans import borrowed, stack_matrix
from closeform.motion.arc import ANGLE, END, MEAN_MOTION, PUSH, START, THRUST, derivatives_at
from closeform.motion.certified_march import (
    COAST_ANGLE,
    LESS_PATIENCE,
    PATIENCE,
    locate,
    relative_state,
    store,
)
from closeform.motion.path import Path
from closeform.uncertainty.covariance import roots_of
from closeform.uncertainty.errors import Uncertainty
from closeform.zones.shapes import FACES, FORM, norm, part, part_count
from closeform.zones.zone import Zone

CHUNK = 16_384  # trajectories in a chunk, the work of one thread; each chunk has its own random numbers
CORES = os.cpu_count() or 1
BEYOND = 1.0 + 1e-9  # beyond rounding
NEVER = np.zeros(0)  # s


@kernel()
def advance(q, order, n, t):
    """Propagate derivatives (8, 3) by a time t."""
    more = stack_matrix(14, 3)
    for k in range(order):
        for i in range(3):
            more[k, i] = q[k, i]
    for k in range(order, 14):  # each axis solves D^2 (D^2 + n^2) r = 0, or D^4 (D^2 + n^2)^2 r = 0
        for i in range(3):
            if order == 4:
                more[k, i] = -n * n * more[k - 2, i]
            else:
                more[k, i] = -n * n * (2.0 * more[k - 2, i] + n * n * more[k - 4, i])
    for k in range(0, order, 2):
        x, y, z, vx, vy, vz = relative_state(more[k:], order, n, t)
        q[k, 0], q[k, 1], q[k, 2] = x, y, z
        q[k + 1, 0], q[k + 1, 1], q[k + 1, 2] = vx, vy, vz


@kernel()
def count_entries(q, order, n, stop, form, inside):
    """Return whether a trajectory is inside at the end of a window, and its entries; overwrites `q`."""
    shape, _, faces = form
    count, patience = 0, PATIENCE
    while True:
        t = 0.0
        while True:
            t, crossed = cross(shape, faces, q, order, n, t, stop, inside, patience)
            if not crossed:
                break
            inside = not inside
            if inside:
                count += 1
        if t >= stop:
            return inside, count
        advance(q, order, n, t)
        stop -= t
        patience = LESS_PATIENCE


@kernel(
    void(
        float64[:, ::1],
        float64[:, ::1],
        float64[:, ::1],
        int64[::1],
        float64[::1],
        int64[::1],
        float64[:, ::1],
        float64[:, :, :, ::1],
    )
)
def fill_windows(arcs, others, columns, offsets, times, orders, matrix, out):
    """Fill derivatives (W, 1 + m, 8, 3) in zone coordinates of mean and columns at the starts of windows."""
    q = stack_matrix(8, 3)
    for w in range(len(orders)):
        t, order = times[w], orders[w]
        for j in range(len(offsets)):
            for k in range(8):
                q[k, 0], q[k, 1], q[k, 2] = 0.0, 0.0, 0.0
            if j == 0:
                derivatives_at(arcs[locate(arcs, 0, len(arcs), t)], t, order, q, 1.0)
                derivatives_at(others[locate(others, 0, len(others), t)], t, order, q, -1.0)
            else:
                arc = columns[locate(columns, offsets[j - 1], offsets[j], t)]
                derivatives_at(arc, t, order, q, 1.0)
            for k in range(8):
                store(out[w, j], k, matrix, q[k, 0], q[k, 1], q[k, 2])


@kernel(void(float64[::1], int64[::1], float64, float64[:, :, :, ::1], FORM, float64[:, :, ::1]))
def fill_planes(times, orders, n, windows, form, planes):
    """Fill the components (W, 1 + m, 4) of mean and columns along the normal of a plane at the zone.

    In zone units: at a window's start, at its end, and the sag between, in two parts. A trajectory whose sums
    exceed 1 at both ends by more than its sag has no entry there. All are 0 for a window that is neither
    natural motion nor cubic.
    """
    shape, _, faces = form
    for w in range(len(orders)):
        if orders[w] != 4:
            continue
        h = times[w + 1] - times[w]
        bend = h if n == 0.0 else min(h, 1.0 / n)
        x, y, z, _, _, _ = relative_state(windows[w, 0], 4, n, 0.5 * h)
        farthest, gx, gy, gz = part(shape, faces, 0, x, y, z)
        for k in range(1, part_count(shape, faces)):
            s, ax, ay, az = part(shape, faces, k, x, y, z)
            if s > farthest:
                farthest, gx, gy, gz = s, ax, ay, az
        for j in range(len(planes[w])):
            q, row = windows[w, j], planes[w, j]
            x, y, z, _, _, _ = relative_state(q, 4, n, h)
            row[0] = gx * q[0, 0] + gy * q[0, 1] + gz * q[0, 2]
            row[1] = gx * x + gy * y + gz * z
            row[2] = h * h / 8.0 * (gx * q[2, 0] + gy * q[2, 1] + gz * q[2, 2])
            row[3] = h * h / 8.0 * bend * (gx * q[3, 0] + gy * q[3, 1] + gz * q[3, 2])


@kernel()
def is_beyond(shape, plane, error):
    """Return True if a trajectory stays beyond a window's plane (1 + m, 4), or beyond the opposite one."""
    first, last, sag, more = plane[0, 0], plane[0, 1], plane[0, 2], plane[0, 3]
    for j in range(len(error)):
        first += error[j] * plane[j + 1, 0]
        last += error[j] * plane[j + 1, 1]
        sag += error[j] * plane[j + 1, 2]
        more += error[j] * plane[j + 1, 3]
    if first < 0.0 and shape != FACES:
        first, last = -first, -last
    return min(first, last) - abs(sag) - abs(more) > BEYOND


@kernel(
    void(
        float64[::1],
        int64[::1],
        float64,
        float64[:, :, :, ::1],
        float64[:, :, ::1],
        FORM,
        float64[:, ::1],
        int64[:, ::1],
    )
)
def count_histories(times, orders, n, windows, planes, form, errors, out):
    """Write whether each trajectory (errors (N, m)) begins inside, and its later entries, to `out` (N, 2)."""
    windows, planes, errors, out = borrowed(windows), borrowed(planes), borrowed(errors), borrowed(out)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    q = stack_matrix(8, 3)
    for p in range(len(errors)):
        inside, count = False, 0
        out[p, 0] = False
        for w in range(len(orders)):
            order = orders[w]
            if not inside and is_beyond(form[0], planes[w], errors[p]):
                continue
            for k in range(order):
                for i in range(3):
                    q[k, i] = windows[w, 0, k, i]
            for j in range(errors.shape[1]):
                for k in range(order):
                    for i in range(3):
                        q[k, i] += errors[p, j] * windows[w, j + 1, k, i]
            if w == 0:
                inside = norm(form[0], form[2], q[0, 0], q[0, 1], q[0, 2]) <= ENTERED
                out[p, 0] = inside
            inside, more = count_entries(q, order, n, times[w + 1] - times[w], form, inside)
            count += more
        out[p, 1] = count


class Drawn(NamedTuple):
    """Counts of random trajectories: inside at the start, ever inside, all entries, repeated entries.

    `least` and `most` bound the number ever inside, with the discretization error.
    """

    began: int
    met: int
    entries: int
    again: int
    least: int
    most: int


def summed(chunk: Callable[[int], Floats], count: int) -> Drawn:
    """Return the sum of the counts of chunks, on all cores."""
    with ThreadPoolExecutor(CORES) as pool:
        return Drawn(*sum(pool.map(chunk, range(count))).tolist())  # type: ignore[union-attr]


@dataclass(frozen=True, eq=False)
class SampledTrajectories:
    """Relative motion of two craft, and the contribution of each of M independent errors.

    `edges` are the times between which all motions are smooth, from the start of the common time to its end.
    """

    path: Path
    other: Path
    columns: Path
    noise: float  # process noise [m^2/s^3], not included in trajectories
    zone: Zone
    edges: Floats
    times: Floats  # (W + 1,) edges of windows
    orders: Any  # (W,)
    windows: Floats  # (W, 1 + M, 8, 3)
    planes: Floats  # (W, 1 + M, 4)

    @classmethod
    def of(
        cls,
        path: Path,
        other: Path,
        columns: Path,
        noise: float,
        zone: Zone,
        instants: Floats = NEVER,
    ) -> SampledTrajectories:
        """Return the trajectories of all arcs in windows as long as the march's bounds allow.

        At `instants` [s] natural motion is added to them.
        """
        n = path.orbit.mean_motion
        rows = np.concatenate([path.arcs, other.arcs, columns.arcs])
        start = max(path.start, other.start)
        end = min(path.end, other.end)
        joints = np.concatenate([rows[:, START], instants])
        edges = np.unique(np.concatenate([[start, end], joints[(joints > start) & (joints < end)]]))
        thrusting = rows[:, THRUST:].any(axis=1) | (rows[:, MEAN_MOTION] != n)
        bent = n > 0.0 and len(instants) > 0  # by natural motion added to cubics
        cubic = (rows[:, MEAN_MOTION] == 0.0) & ~rows[:, PUSH + 3 :].any(axis=1) & (not bent)
        times, orders = [start], []
        for begin, stop in zip(edges[:-1], edges[1:], strict=True):
            here = (rows[:, START] <= begin) & (rows[:, END] >= stop)
            natural = n > 0.0 and not thrusting[here].any()
            order = 4 if natural or cubic[here].all() else 8
            turn = n * (stop - begin) / (COAST_ANGLE if natural else ANGLE)
            pieces = max(1, int(np.ceil(turn)))
            times += np.linspace(begin, stop, pieces + 1)[1:].tolist()
            orders += [order] * pieces
        windows = np.zeros((len(orders), 1 + len(columns), 8, 3))
        held = np.array(times), np.array(orders)
        fill_windows(path.arcs, other.arcs, columns.arcs, columns.offsets, *held, zone.matrix, windows)
        planes = np.zeros((len(orders), 1 + len(columns), 4))
        fill_planes(*held, n, windows, zone.form, planes)
        return cls(path, other, columns, noise, zone, edges, *held, windows, planes)

    @property
    def mean_motion(self) -> float:
        """Mean motion of the orbit [rad/s]; 0 in deep space."""
        return self.path.orbit.mean_motion

    def states(self, times: Floats) -> tuple[Floats, Floats]:
        """Return the mean (T, 6) and a factor (T, 6, M) of the covariance of the relative state."""
        at = np.ascontiguousarray(times).reshape(1, -1)
        mean = self.path._evaluate_rows(at)[0] - self.other._evaluate_rows(at)[0]
        factor = self.columns._evaluate_rows(at).transpose(1, 2, 0)
        if self.noise:
            factor = np.concatenate([factor, self._noise(times)], axis=2)
        return mean, np.ascontiguousarray(factor)

    def _noise(self, times: Floats) -> Floats:
        """Return factors (T, 6, 6) of the covariance due to process noise."""
        return roots_of(Uncertainty(noise=self.noise).covariance(self.path, times))

    def counted(self, errors: Floats) -> Any:
        """Return whether trajectories of errors (N, M) begin inside, and their numbers of entries: (N, 2)."""
        out = np.empty((len(errors), 2), dtype=np.int64)
        with ThreadPoolExecutor(CORES) as pool:
            size = max(1, min(CHUNK // 4, -(-len(errors) // (2 * CORES))))
            jobs = [slice(k, k + size) for k in range(0, len(errors), size)]
            list(pool.map(lambda part: self._count(errors[part], out[part]), jobs))
        return out

    def drawn(self, samples: int, seed: int) -> Drawn:
        """Return the counts of random trajectories.

        Each chunk has its own Philox stream, so that the result does not depend on the number of threads.
        """

        def chunk(k: int) -> Floats:
            philox = np.random.Philox(key=seed, counter=[0, 0, 0, k])
            count = min(CHUNK, samples - k * CHUNK)
            errors = np.random.Generator(philox).standard_normal((count, len(self.columns)))
            out = np.empty((count, 2), dtype=np.int64)
            self._count(errors, out)
            began, entries = out.T
            met = ((began > 0) | (entries > 0)).sum()
            return np.array([began.sum(), met, entries.sum(), (entries > 1).sum(), met, met])

        return summed(chunk, -(-samples // CHUNK))

    def _count(self, errors: Floats, out: Any) -> None:
        """Count the entries of trajectories with the kernel."""
        held = self.times, self.orders, self.mean_motion, self.windows, self.planes
        count_histories(*held, self.zone.form, errors, out)
