"""Histories with white noise: its exact increments step by step, and between them what is likeliest.

Of all ways to an increment the mean is the transfer of least energy to it, so that what is marched is a
path without jumps.  What noise does beside that within a step is too little to matter, and is bounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform.arrays import Floats
from closeform.compiled import kernel
from closeform.conflicts.entries import ENTERED
from closeform.kernel_loans import borrowed, stack_matrix
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.uncertainty.covariance import roots_of
from closeform.uncertainty.errors import Errors
from closeform.uncertainty.histories import CHUNK, Drawn, Histories, count_entries, fill_windows, summed
from closeform.zones.shapes import FORM, norm
from closeform.zones.zone import Zone

# Of sqrt(q h^3): beyond it a step of length h leaves its mean with a chance below 1e-13.       # theory (65)
OFF = 0.6
LEAST_OFF = 1e-9  # of the zone, which rounding does not reach
ENOUGH, MOST_OFF = 1e-3, 0.1  # of the zone's inner radius
STEPS = 10_000  # at most, of the common time
ANGLE = 0.2  # of n h, up to which (65) holds
NUMBERS = 1 << 22  # random ones that a chunk has at most
ZONES = 3  # the larger one, the zone, the smaller one


@kernel(
    void(
        float64[::1],
        int64[::1],
        float64,
        float64[:, :, :, ::1],
        int64[::1],
        float64[:, :, :, ::1],
        float64[:, :, ::1],
        FORM,
        float64[::1],
        float64[:, ::1],
        float64[:, :, ::1],
        int64[:, :, ::1],
    )
)
def count_noisy(times, orders, n, windows, kinds, bridges, steps, form, factors, errors, pushes, out):
    """As `count_histories` of errors (N, m) and increments `pushes` (N, W, 6): `out` (N, 3, 2).

    Of the zone by three factors, the largest first.
    """
    windows, bridges, steps, out = borrowed(windows), borrowed(bridges), borrowed(steps), borrowed(out)
    errors, pushes = borrowed(errors), borrowed(pushes)
    form = form[0], borrowed(form[1]), borrowed(form[2])
    q, scaled = stack_matrix(8, 3), stack_matrix(8, 3)
    noise = stack_matrix(18, 1)  # what it is at the step's start, its increment, what it is at the end
    inside = stack_matrix(ZONES, 1)
    for p in range(len(errors)):
        for i in range(6):
            noise[i, 0] = 0.0
        for w in range(len(orders)):
            order, bridge, step = orders[w], bridges[kinds[w]], steps[kinds[w]]
            for i in range(6):
                noise[6 + i, 0] = pushes[p, w, i]
            for k in range(order):
                for i in range(3):
                    q[k, i] = windows[w, 0, k, i]
            for j in range(errors.shape[1]):
                for k in range(order):
                    for i in range(3):
                        q[k, i] += errors[p, j] * windows[w, j + 1, k, i]
            for j in range(12):
                for k in range(order):
                    for i in range(3):
                        q[k, i] += noise[j, 0] * bridge[j, k, i]
            for z in range(ZONES):
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
                    break  # nor is any smaller zone met
            for i in range(6):
                total = 0.0
                for j in range(12):
                    total += step[i, j] * noise[j, 0]
                noise[12 + i, 0] = total
            for i in range(6):
                noise[i, 0] = noise[12 + i, 0]


@dataclass(frozen=True, eq=False)
class NoisyHistories:
    """Histories of errors and of white noise, in short windows of some kinds: as long, and all alike.

    `off`: by how much of the zone a history may be off, but with a chance below 1e-13 a window.
    """

    histories: Histories
    kinds: Any  # (W,)
    bridges: Floats  # (K, 12, 8, 3): derivatives of natural motions, and of transfers to increments
    steps: Floats  # (K, 6, 12): where these lead
    off: float

    @classmethod
    def of(cls, path: Path, other: Path, columns: Path, noise: float, zone: Zone) -> NoisyHistories:
        """In steps so short that what they leave out is a thousandth of the zone.

        Raises ValueError where ten thousand steps leave out a tenth.
        """
        n, span = path.orbit.mean_motion, min(path.end, other.end) - max(path.start, other.start)
        longest = (ENOUGH * zone.inner_radius / OFF) ** (2 / 3) / noise ** (1 / 3)
        longest = min(max(longest, span / STEPS), ANGLE / n if n > 0.0 else inf, span)
        seen = Histories.of(path, other, columns, noise, zone, longest)
        middles = 0.5 * (seen.times[1:] + seen.times[:-1])
        kinds = np.searchsorted(seen.edges, middles, side="right") - 1
        lengths = np.diff(seen.edges) / np.bincount(kinds)
        off = OFF * float(np.sqrt(noise * lengths.max() ** 3)) / zone.inner_radius
        if off > MOST_OFF:
            raise ValueError(
                f"errors: noise of {noise:g} m^2/s^3 moves craft too far beside the zone in each of {STEPS} "
                'steps; use method="bound"'
            )
        still = path.orbit.coast(np.zeros(6), lengths.max())
        roots = roots_of(Errors(noise=noise).covariance(still, lengths))
        steps = np.concatenate([path.orbit.transition(lengths), roots], axis=2)
        coasts = path.orbit.coast(np.eye(6), lengths[:, None])
        pushed = path.orbit.transfer(np.zeros(6), roots.transpose(0, 2, 1), lengths[:, None])
        bridges = np.zeros((len(lengths), 1, 13, 8, 3))
        for k, length in enumerate(lengths.tolist()):
            ways = stack([each[k, j] for each in (coasts, pushed) for j in range(6)])
            held = still.arcs, still.arcs, ways.arcs, ways.offsets, np.array([0.0, length]), np.array([8])
            fill_windows(*held, zone.matrix, bridges[k])
        bridges = np.ascontiguousarray(bridges[:, 0, 1:])
        return cls(seen, kinds, bridges, np.ascontiguousarray(steps), max(off, LEAST_OFF))

    def drawn(self, samples: int, seed: int) -> Drawn:
        """Of random histories what became of them; chunk k has a stream of Philox's of its own."""
        seen, width = self.histories, len(self.histories.columns)
        factors = np.array([1.0 + self.off, 1.0, 1.0 - self.off])
        size = max(1, min(CHUNK, NUMBERS // (6 * len(seen.orders))))

        def chunk(k: int) -> Floats:
            random = np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, 0, k]))
            count = min(size, samples - k * size)
            errors = random.standard_normal((count, width))
            pushes = random.standard_normal((count, len(seen.orders), 6))
            out = np.empty((count, ZONES, 2), dtype=np.int64)
            held = seen.times, seen.orders, seen.mean_motion, seen.windows
            parts = self.kinds, self.bridges, self.steps
            count_noisy(*held, *parts, seen.zone.form, factors, errors, pushes, out)
            most, met, least = ((out[:, :, 0] > 0) | (out[:, :, 1] > 0)).sum(axis=0)
            began, entries = out[:, 1].T
            return np.array([began.sum(), met, entries.sum(), (entries > 1).sum(), least, most])

        return summed(chunk, -(-samples // size))
