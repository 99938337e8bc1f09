"""Sampled trajectories with process noise: natural motion in short steps, with velocity changes between.

States are exact at the ends of steps, and paths are continuous. The remaining effect of noise within a step
is bounded.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.conflicts.pair_search import ENTERED
from closeform.kernel_loans import borrowed, stack_matrix
from closeform.motion.path import Path
from closeform.uncertainty.sampled_trajectories import (
    CHUNK,
    CORES,
    Drawn,
    SampledTrajectories,
    count_entries,
    fill_windows,
    summed,
)
from closeform.uncertainty.white_noise import (
    MOST_OFF,
    SAME,
    STEPS,
    ends_of,
    growth,
    off_beside,
    step_beside,
)
from closeform.zones.shapes import FORM, norm
from closeform.zones.zone import Zone

LEAST_OFF = 1e-9  # of the zone: more than rounding
NUMBERS = 1 << 22  # maximum count of random numbers in a chunk
ZONES = 3  # the enlarged zone, the zone, the reduced zone


@kernel(
    void(
        float64[::1],
        int64[::1],
        float64,
        float64[:, :, :, ::1],
        int64[::1],
        float64[:, :, ::1],
        float64[:, :, ::1],
        FORM,
        float64[::1],
        float64[:, ::1],
        float64[:, ::1],
        float64[:, :, ::1],
        int64[:, :, ::1],
    )
)
def count_noisy(
    times, orders, n, windows, instants, natural, flows, form, factors, ends, errors, pushes, out
):
    """Count entries as `count_histories`, for errors (N, m) and noise `pushes` (N, K, 6) in each step.

    The noise acts by velocity changes at the `ends` (6, 6) of steps. `out` (N, Z, 2) is for the zone scaled
    by Z factors, the largest first.
    """
    windows, natural, flows, out = borrowed(windows), borrowed(natural), borrowed(flows), borrowed(out)
    ends, errors, pushes = borrowed(ends), borrowed(errors), borrowed(pushes)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    q, scaled = stack_matrix(8, 3), stack_matrix(8, 3)
    noise = stack_matrix(12, 1)  # effect of noise on the state, now and at the window's end
    inside = stack_matrix(ZONES, 1)
    for p in range(len(errors)):
        for i in range(6):
            noise[i, 0] = 0.0
        for w in range(len(orders)):
            order, flow = orders[w], flows[w]
            k = instants[w]
            if k >= 0:
                for i in range(3):
                    for j in range(6):
                        noise[3 + i, 0] += ends[i, j] * pushes[p, k, j]
                        if k > 0:
                            noise[3 + i, 0] += ends[3 + i, j] * pushes[p, k - 1, j]
            for k in range(order):
                for i in range(3):
                    q[k, i] = windows[w, 0, k, i]
            for j in range(errors.shape[1]):
                for k in range(order):
                    for i in range(3):
                        q[k, i] += errors[p, j] * windows[w, j + 1, k, i]
            for j in range(6):
                for k in range(order):
                    for i in range(3):
                        q[k, i] += noise[j, 0] * natural[j, k, i]
            for z in range(len(factors)):
                for k in range(order):
                    for i in range(3):
                        scaled[k, i] = q[k, i] / factors[z]
                if w == 0:
                    began = norm(form[0], form[2], scaled[0, 0], scaled[0, 1], scaled[0, 2]) <= ENTERED
                    out[p, z, 0], out[p, z, 1] = began, 0
                    inside[z, 0] = 1.0 if began else 0.0
                before = inside[z, 0] > 0.0
                after, more = count_entries(scaled, order, n, times[w + 1] - times[w], form, before)
                inside[z, 0] = 1.0 if after else 0.0
                out[p, z, 1] += more
                if w > 0 and not before and more == 0:
                    break  # smaller zones have no entries either
            for i in range(6):
                total = 0.0
                for j in range(6):
                    total += flow[i, j] * noise[j, 0]
                noise[6 + i, 0] = total
            for i in range(6):
                noise[i, 0] = noise[6 + i, 0]


@dataclass(frozen=True, eq=False)
class NoisyTrajectories:
    """Sampled trajectories with errors and process noise, in windows that end at velocity changes.

    `instants` (W,) are the indices of the changes at which windows begin, -1 for none; `natural` (6, 8, 3)
    are derivatives of natural motion, `flows` (W, 6, 6) its transitions. `step` [s] is the time between
    changes, and `off` bounds the error relative to the zone, except with a probability below 1e-13 per step.
    """

    histories: SampledTrajectories
    instants: Any
    natural: Floats
    flows: Floats
    step: float
    off: float

    @classmethod
    def of(cls, path: Path, other: Path, columns: Path, noise: float, zone: Zone) -> NoisyTrajectories:
        """Return trajectories in steps so short that the discretization error is a thousandth of the zone.

        Raises ValueError if it exceeds a tenth with ten thousand steps.
        """
        n, span = path.orbit.mean_motion, min(path.end, other.end) - max(path.start, other.start)
        step = span / ceil(span / step_beside(n, noise, zone.inner_radius, span) - SAME)
        if off_beside(noise, step) > MOST_OFF * zone.inner_radius:
            raise ValueError(
                f"errors: noise of {noise:g} m^2/s^3 moves craft too far for the zone in each of {STEPS} "
                'steps; use method="bound"'
            )
        return cls.in_steps(path, other, columns, noise, zone, step)

    @classmethod
    def in_steps(
        cls, path: Path, other: Path, columns: Path, noise: float, zone: Zone, step: float
    ) -> NoisyTrajectories:
        """Return trajectories in steps of a given length [s]."""
        start, orbit = max(path.start, other.start), path.orbit
        span = min(path.end, other.end) - start
        changes = start + step * np.arange(ceil(span / step - SAME))
        seen = SampledTrajectories.of(path, other, columns, noise, zone, changes)
        begins = seen.times[:-1]
        places = np.minimum(np.searchsorted(changes, begins), len(changes) - 1)
        instants = np.where(changes[places] == begins, places, -1)
        natural, coasts = np.zeros((1, 7, 8, 3)), orbit.coast(np.eye(6), span)
        still = orbit.coast(np.zeros(6), span).arcs
        held = np.array([0.0, span]), np.array([8])
        fill_windows(still, still, coasts.arcs, coasts.offsets, *held, zone.matrix, natural)
        natural, flows = np.ascontiguousarray(natural[0, 1:]), orbit.transition(np.diff(seen.times))
        off = max(off_beside(noise, step) / zone.inner_radius, LEAST_OFF)
        return cls(seen, instants, natural, flows, step, off)

    @property
    def changes(self) -> int:
        """Number of velocity changes."""
        return int(self.instants.max()) + 1

    def counted(self, errors: Floats, pushes: Floats) -> Any:
        """Return whether each trajectory begins inside, and its number of entries: (N, 2).

        For errors (N, M) and increments `pushes` (N, K, 6) [m, m/s] of the state by noise in each step.
        """
        out = np.empty((len(errors), 1, 2), dtype=np.int64)
        zone = np.ones(1), ends_of(self.histories.mean_motion, self.step)
        size = max(1, -(-len(errors) // (2 * CORES)))
        jobs = [slice(k, k + size) for k in range(0, len(errors), size)]
        with ThreadPoolExecutor(CORES) as pool:
            list(pool.map(lambda some: self._count(*zone, errors[some], pushes[some], out[some]), jobs))
        return out[:, 0]

    def drawn(self, samples: int, seed: int) -> Drawn:
        """Return the counts of random trajectories; each chunk has its own Philox stream."""
        seen, width, changes = self.histories, len(self.histories.columns), self.changes
        factors = np.array([1.0 + self.off, 1.0, 1.0 - self.off])
        size = max(1, min(CHUNK, NUMBERS // (6 * changes)))
        moved = seen.mean_motion, self.step
        ends = np.sqrt(seen.noise) * ends_of(*moved) @ growth(*moved)[1]

        def chunk(k: int) -> Floats:
            random = np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, 0, k]))
            count = min(size, samples - k * size)
            errors = random.standard_normal((count, width))
            pushes = random.standard_normal((count, changes, 6))
            out = np.empty((count, ZONES, 2), dtype=np.int64)
            self._count(factors, ends, errors, pushes, out)
            most, met, least = ((out[:, :, 0] > 0) | (out[:, :, 1] > 0)).sum(axis=0)
            began, entries = out[:, 1].T
            return np.array([began.sum(), met, entries.sum(), (entries > 1).sum(), least, most])

        return summed(chunk, -(-samples // size))

    def _count(self, factors: Floats, ends: Floats, errors: Floats, pushes: Floats, out: Any) -> None:
        """Count the entries of trajectories with the kernel."""
        seen = self.histories
        held = seen.times, seen.orders, seen.mean_motion, seen.windows
        parts = self.instants, self.natural, self.flows, seen.zone.form
        count_noisy(*held, *parts, factors, np.ascontiguousarray(ends), errors, pushes, out)
