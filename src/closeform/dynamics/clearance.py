"""Minimum clearance ratio of each pair of spacecraft whose states are known at given times."""

from collections.abc import Iterator
from math import inf, nan
from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import borrowed, stack_matrix
from closeform.motion.certified_march import LESS_PATIENCE, PATIENCE, store
from closeform.motion.extrema import advance, minimum_norm
from closeform.zones.pair_zones import PairZones, pair_zones
from closeform.zones.shapes import FORM, norm
from closeform.zones.zone import Zone

NO_PAIRS = np.empty((0, 2), dtype=np.int64)
BODIES = float64[:, :, ::1]


def clearance_ratios(
    states: Floats, arrivals: Floats, times: Floats, zones: Zone | PairZones | None
) -> tuple[Any, Floats]:
    """Return pairs i < j (P, 2) with a zone, and their minimum clearance ratios (P,).

    `states` (N, T, 6) at `times` (T,) are joined by cubics, on which the minimum is certified like a closest
    approach. `arrivals` are the states before impulses at these times.
    """
    known, pairs, least = [np.ascontiguousarray(one) for one in (states, arrivals, times)], [NO_PAIRS], []
    for zone, some in _groups(len(states), zones):
        found = np.empty(len(some))
        minimum_ratios(*known, *np.ascontiguousarray(some.T), zone.form, found)
        pairs.append(some)
        least.append(found)
    every = np.concatenate(pairs)
    order = np.lexsort(every.T[::-1])
    return every[order], np.concatenate([np.empty(0), *least])[order]


def ratios_at_times(states: Floats, zones: Zone | PairZones) -> tuple[Any, Floats]:
    """Return pairs i < j (P, 2) with a zone, and their clearance ratios (P, T) at states (N, T, 6)."""
    pairs, ratios = [NO_PAIRS], [np.empty((0, states.shape[1]))]
    for zone, some in _groups(len(states), zones):
        pairs.append(some)
        ratios.append(zone._norm(states[some[:, 0], :, :3] - states[some[:, 1], :, :3]))
    return np.concatenate(pairs), np.concatenate(ratios)


def _groups(count: int, zones: Zone | PairZones | None) -> Iterator[tuple[Zone, Any]]:
    """Yield each zone and its pairs (M, 2) of `count` spacecraft; one zone applies to all pairs."""
    if isinstance(zones, Zone):
        yield zones, np.stack(np.triu_indices(count, 1), axis=1)
    elif zones is not None:
        yield from pair_zones("zones", zones, count).groups()


@kernel(void(BODIES, BODIES, float64[::1], int64[::1], int64[::1], FORM, float64[::1]))
def minimum_ratios(
    states: Floats, arrivals: Floats, times: Floats, first: Any, second: Any, form: Any, out: Floats
) -> None:
    """Write the minimum norm of every pair, on the cubics from each state to the next arrival."""
    states, arrivals = borrowed(states), borrowed(arrivals)
    shape, matrix, faces = form[0], borrowed(form[1]), borrowed(form[2])
    q, end = stack_matrix(8, 3), stack_matrix(2, 3)
    for pair in range(len(first)):
        i, j = first[pair], second[pair]
        best = inf
        for k in range(len(times)):
            relative_state(states[i, k], states[j, k], matrix, q)
            best = min(best, norm(shape, faces, q[0, 0], q[0, 1], q[0, 2]))
        for k in range(len(times) - 1):
            h = times[k + 1] - times[k]
            relative_state(states[i, k], states[j, k], matrix, q)
            relative_state(arrivals[i, k + 1], arrivals[j, k + 1], matrix, end)
            if lower_bound(shape, faces, q, end, h) < best:
                fit_cubic(q, end, h)
                best = minimum_on_cubic(shape, faces, q, h, best)
        out[pair] = best


@kernel()
def relative_state(one: Floats, two: Floats, matrix: Floats, q: Floats) -> None:
    """Fill two rows of `q` with the relative position and velocity of two spacecraft, in zone coordinates."""
    for row in range(2):
        k = 3 * row
        store(q, row, matrix, one[k] - two[k], one[k + 1] - two[k + 1], one[k + 2] - two[k + 2])


@kernel()
def lower_bound(shape: int, faces: Floats, q: Floats, end: Floats, h: float) -> float:
    """Return a lower bound on the norm on a cubic: at its start, minus the distance of control points."""
    far = 0.0
    for a, b, c in ((h / 3.0, 0.0, 0.0), (0.0, 1.0, -h / 3.0), (0.0, 1.0, 0.0)):
        x, y, z = (
            a * q[1, 0] + b * (end[0, 0] - q[0, 0]) + c * end[1, 0],
            a * q[1, 1] + b * (end[0, 1] - q[0, 1]) + c * end[1, 1],
            a * q[1, 2] + b * (end[0, 2] - q[0, 2]) + c * end[1, 2],
        )
        far = max(far, norm(shape, faces, -x, -y, -z))
    begun: float = norm(shape, faces, q[0, 0], q[0, 1], q[0, 2])
    return begun - far


@kernel()
def fit_cubic(q: Floats, end: Floats, h: float) -> None:
    """Fill the second and third derivative of the cubic that reaches `end` after h."""
    for axis in range(3):
        way, v, w = end[0, axis] - q[0, axis], q[1, axis], end[1, axis]
        q[2, axis] = (6.0 * way / h - 4.0 * v - 2.0 * w) / h
        q[3, axis] = (6.0 * (v + w) - 12.0 * way / h) / (h * h)


@kernel()
def minimum_on_cubic(shape: int, faces: Floats, q: Floats, stop: float, best: float) -> float:
    """Return the minimum norm of a cubic until `stop`, if below `best`; overwrites `q`."""
    patience = PATIENCE
    while True:
        best, _, reached = minimum_norm(shape, faces, q, 4, 0.0, 0.0, stop, patience, best, nan)
        if reached >= stop:
            return best
        advance(q, 0.0, reached)
        stop, patience = stop - reached, LESS_PATIENCE
