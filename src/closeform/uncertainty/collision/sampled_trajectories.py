"""Sampled trajectories of a random relative motion: mean path and error columns, in common windows.

A trajectory is the mean motion plus each column times its error. Derivatives at a window's start add up like
motions, so that a trajectory costs one sum per window, and the march that finds conflicts counts its entries.
Most windows need no march: the whole trajectory lies beyond a plane that touches the zone near the mean.

Beside a chief that is not on a circle, windows have a variable of their own from 0 to 1, and motions are
polynomials of it (see `table_windows`), of order `TERMS`; the signs of polynomials count the entries.

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
from closeform.arrays import Floats, instance
from closeform.conflicts.chief.sign_changes import DEPTH, excluded, window_changes
from closeform.conflicts.pair_search import ENTERED, cross
from closeform.conflicts.two_paths import check_comparable
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
from closeform.motion.chief.bernstein import SQUARE, TERMS
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.path import Path
from closeform.uncertainty.covariance import roots_of
from closeform.uncertainty.error_columns import columns_of_pair
from closeform.uncertainty.errors import Uncertainty
from closeform.uncertainty.table_windows import polynomial_state, table_windows
from closeform.uncertainty.white_noise import (
    MOST_OFF,
    SAME,
    STEPS,
    deviation_in_step,
    end_changes,
    step_for_zone,
    step_noise,
    system_matrix,
)
from closeform.zones.shapes import FACES, FORM, norm, part, part_count
from closeform.zones.zone import Zone

CHUNK = 16_384  # trajectories in a chunk, the work of one thread; each chunk has its own random numbers
NUMBERS = 1 << 22  # maximum count of random numbers of noise in a chunk
CORES = os.cpu_count() or 1
BEYOND = 1.0 + 1e-9  # beyond rounding
LEAST_OFF = 1e-9  # of the zone: bound of the effect of noise within a step, more than rounding
ROWS, WINDOWS = float64[:, ::1], float64[:, :, :, ::1]


@kernel()
def motion_at(q, order, n, t):
    """Return position and velocity at time t after the start of a window."""
    if order == TERMS:
        return polynomial_state(q, t)
    return relative_state(q, order, n, t)


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
def count_changes(form, q, c, inside, work):
    """Return whether a polynomial is inside at its end, and its entries; `inside` before its start."""
    shape, _, faces = form
    off, stack, ends, places, outs = work
    for b in range(TERMS):
        for axis in range(3):
            c[axis, b] = q[b, axis]
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


@kernel(void(ROWS, ROWS, ROWS, int64[::1], float64[::1], int64[::1], ROWS, WINDOWS))
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


@kernel(void(float64[::1], int64[::1], float64, WINDOWS, FORM, float64[:, :, ::1]))
def fill_planes(times, orders, n, windows, form, planes):
    """Fill the distances (W, 1 + m, 4) of mean and columns along the normal of a plane touching the zone.

    In zone units: at a window's start, at its end, and the sag between, in two parts. A trajectory whose sums
    exceed 1 at both ends by more than its sag has no entry there. All are 0 for a window that is neither
    natural motion nor cubic. Of polynomials they are the coefficients (W, 1 + m, 12) of the distance.
    """
    shape, _, faces = form
    for w in range(len(orders)):
        order = orders[w]
        if order == 8:
            continue
        h = times[w + 1] - times[w]
        bend = h if n == 0.0 else min(h, 1.0 / n)
        x, y, z, _, _, _ = motion_at(windows[w, 0], order, n, 0.5 * h)
        farthest, gx, gy, gz = part(shape, faces, 0, x, y, z)
        for k in range(1, part_count(shape, faces)):
            s, ax, ay, az = part(shape, faces, k, x, y, z)
            if s > farthest:
                farthest, gx, gy, gz = s, ax, ay, az
        for j in range(len(planes[w])):
            q, row = windows[w, j], planes[w, j]
            for k in range(order if order == TERMS else 0):
                row[k] = gx * q[k, 0] + gy * q[k, 1] + gz * q[k, 2]
            if order == TERMS:
                continue
            x, y, z, _, _, _ = relative_state(q, 4, n, h)
            row[0] = gx * q[0, 0] + gy * q[0, 1] + gz * q[0, 2]
            row[1] = gx * x + gy * y + gz * z
            row[2] = h * h / 8.0 * (gx * q[2, 0] + gy * q[2, 1] + gz * q[2, 2])
            row[3] = h * h / 8.0 * bend * (gx * q[3, 0] + gy * q[3, 1] + gz * q[3, 2])


@kernel()
def is_beyond(shape, plane, error, scale):
    """Return True if a trajectory stays beyond a window's plane (1 + m, 4), or beyond the opposite one.

    The planes are those of the zone enlarged by `scale`. Of polynomials all coefficients must be beyond.
    """
    if plane.shape[1] == TERMS:
        least, most = inf, -inf
        for b in range(TERMS):
            total = plane[0, b]
            for j in range(len(error)):
                total += error[j] * plane[j + 1, b]
            least, most = min(least, total), max(most, total)
            if least <= BEYOND * scale and (most >= -BEYOND * scale or shape == FACES):
                return False
        return True
    first, last, sag, more = plane[0, 0], plane[0, 1], plane[0, 2], plane[0, 3]
    for j in range(len(error)):
        first += error[j] * plane[j + 1, 0]
        last += error[j] * plane[j + 1, 1]
        sag += error[j] * plane[j + 1, 2]
        more += error[j] * plane[j + 1, 3]
    if first < 0.0 and shape != FACES:
        first, last = -first, -last
    return min(first, last) - abs(sag) - abs(more) > BEYOND * scale


@kernel(
    void(
        *(float64[::1], int64[::1], float64, WINDOWS, float64[:, :, ::1], FORM, float64[::1]),
        *(int64[::1], float64[:, :, ::1], ROWS, ROWS, float64[:, :, ::1], int64[:, :, ::1]),
    )
)
def count_trajectories(
    times, orders, n, windows, planes, form, factors, instants, flows, ends, errors, pushes, out
):
    """Write whether each trajectory begins inside, and its later entries, to `out` (N, Z, 2).

    For errors (N, m) and increments `pushes` (N, K, 6) of the state by noise in each step, which act by
    velocity changes at the `ends` (6, 6) of steps. The zone is scaled by Z factors, the largest first. With
    noise the last six columns of windows are natural motions; without, there are no steps.
    """
    windows, planes, errors, out = borrowed(windows), borrowed(planes), borrowed(errors), borrowed(out)
    flows, ends, pushes = borrowed(flows), borrowed(ends), borrowed(pushes)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    given, width = errors.shape[1], windows.shape[1] - 1
    q, scaled, c = stack_matrix(TERMS, 3), stack_matrix(TERMS, 3), stack_matrix(3, TERMS)
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
        for w in range(len(orders)):
            k = instants[w]
            for i in range(3 if k >= 0 else 0):
                for j in range(6):
                    xi[given + 3 + i] += ends[i, j] * pushes[p, k, j]
                    if k > 0:
                        xi[given + 3 + i] += ends[3 + i, j] * pushes[p, k - 1, j]
            if inside[0] or not is_beyond(form[0], planes[w], xi, factors[0]):
                for k in range(orders[w]):
                    for i in range(3):
                        q[k, i] = windows[w, 0, k, i]
                for j in range(width):
                    for k in range(orders[w]):
                        for i in range(3):
                            q[k, i] += xi[j] * windows[w, j + 1, k, i]
                for z in range(len(factors)):
                    for k in range(orders[w]):
                        for i in range(3):
                            scaled[k, i] = q[k, i] / factors[z]
                    if w == 0:
                        inside[z] = (
                            norm(form[0], form[2], scaled[0, 0], scaled[0, 1], scaled[0, 2]) <= ENTERED
                        )
                        out[p, z, 0] = inside[z]
                    before, span = inside[z], times[w + 1] - times[w]
                    if orders[w] == TERMS:
                        inside[z], more = count_changes(form, scaled, c, before, work)
                    else:
                        inside[z], more = count_entries(scaled, orders[w], n, span, form, before)
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
    times: Floats  # (W + 1,) edges of windows; 0, 1, ... where these are polynomials
    orders: Any  # (W,)
    rate: float  # mean motion in the time of windows [rad/s]; 0 of polynomials and in deep space
    windows: Floats  # (W, 1 + M, 8, 3), (W, 7 + M, 8, 3) with steps, (W, 1 + M, 12, 3) of polynomials
    planes: Floats  # (W, 1 + M, 4), (W, 7 + M, 4) or (W, 1 + M, 12)
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
        """Return the trajectories in windows as long as the march's bounds allow.

        Without a `step`, process noise is not included in trajectories.
        """
        rows = np.concatenate([path.arcs, other.arcs, columns.arcs])
        start, end = max(path.start, other.start), min(path.end, other.end)
        if isinstance(path.orbit, ChiefOrbit):
            edges = _edges(start, end, rows[:, START])
            _, windows, _ = table_windows(path, other, columns, zone)
            count = len(windows)
            times, held = np.arange(count + 1.0), np.full(count, TERMS)
            planes = np.zeros((*windows.shape[:2], TERMS))
            fill_planes(times, held, 0.0, windows, zone.form, planes)
            return cls(
                *(path, other, columns, noise, zone, edges, times, held, 0.0),
                *(windows, planes, None, np.full(count, -1), np.empty((0, 6, 6)), 0.0),
            )
        n = path.orbit.mean_motion
        changes = np.empty(0)
        if step is not None:
            changes = start + step * np.arange(ceil((end - start) / step - SAME))
        edges = _edges(start, end, np.concatenate([rows[:, START], changes]))
        thrusting = rows[:, THRUST:].any(axis=1) | (rows[:, MEAN_MOTION] != n)
        bent = n > 0.0 and step is not None  # by natural motion added to cubics
        cubic = (rows[:, MEAN_MOTION] == 0.0) & ~rows[:, PUSH + 3 :].any(axis=1) & (not bent)
        ends, orders = [start], []
        for begin, stop in zip(edges[:-1], edges[1:], strict=True):
            here = (rows[:, START] <= begin) & (rows[:, END] >= stop)
            natural = n > 0.0 and not thrusting[here].any()
            order = 4 if natural or cubic[here].all() else 8
            turn = n * (stop - begin) / (COAST_ANGLE if natural else ANGLE)
            pieces = max(1, int(np.ceil(turn)))
            ends += np.linspace(begin, stop, pieces + 1)[1:].tolist()
            orders += [order] * pieces
        times, held = np.array(ends), np.array(orders)
        windows = np.zeros((len(orders), 1 + len(columns), 8, 3))
        fill_windows(path.arcs, other.arcs, columns.arcs, columns.offsets, times, held, zone.matrix, windows)
        instants, flows, off = np.full(len(orders), -1), np.empty((0, 6, 6)), 0.0
        if step is not None:
            every = np.broadcast_to(natural_derivatives(zone, n), (len(orders), 6, 8, 3))
            windows = np.ascontiguousarray(np.concatenate([windows, every], axis=1))
            places = np.minimum(np.searchsorted(changes, times[:-1]), len(changes) - 1)
            instants = np.where(changes[places] == times[:-1], places, -1)
            flows = path.orbit.transition(np.diff(times))
            off = max(deviation_in_step(noise, step) / zone.inner_radius, LEAST_OFF)
        planes = np.zeros((*windows.shape[:2], 4))
        fill_planes(times, held, n, windows, zone.form, planes)
        return cls(
            *(path, other, columns, noise, zone, edges, times, held, n),
            *(windows, planes, step, instants, flows, off),
        )

    @property
    def changes(self) -> int:
        """Number of velocity changes by process noise."""
        return int(self.instants.max()) + 1

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
        ends = np.zeros((6, 6)) if self.step is None else end_changes(self.rate, self.step)
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
            moved = self.rate, self.step
            ends = np.ascontiguousarray(np.sqrt(self.noise) * end_changes(*moved) @ step_noise(*moved)[1])
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
        held = self.times, self.orders, self.rate, self.windows, self.planes, self.zone.form
        count_trajectories(*held, factors, self.instants, self.flows, ends, errors, pushes, out)


def _edges(start: float, end: float, times: Floats) -> Floats:
    """Return a start, an end, and the times between them."""
    return np.unique(np.concatenate([[start, end], times[(times > start) & (times < end)]]))


def natural_derivatives(zone: Zone, n: float) -> Floats:
    """Return the derivatives (6, 8, 3) of the position after each unit state, in zone coordinates."""
    found, power = [], np.eye(6)
    for _ in range(8):
        found.append((zone.matrix @ power[:3]).T)
        power = power @ system_matrix(n)
    return np.stack(found, axis=1)


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
