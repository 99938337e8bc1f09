"""Minimum clearance ratio of each pair of spacecraft whose states are known at given times."""

from collections.abc import Sequence
from math import inf, nan
from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import borrowed, stack_matrix
from closeform.motion.certified_march import LESS_PATIENCE, PATIENCE, store
from closeform.motion.extrema import advance, minimum_norm
from closeform.zones.made_table import NONE
from closeform.zones.pair_zones import PairZones, by_zone, pair_zones
from closeform.zones.shapes import FORM, norm
from closeform.zones.zone import Zone

FINER = 8  # samples of each cubic between two states
BODIES = float64[:, :, ::1]


def clearance_ratios(
    states: Floats, arrivals: Floats, times: Floats, zones: Zone | PairZones | None
) -> tuple[Any, Floats]:
    """Return pairs i < j (P, 2) with a zone, and their minimum clearance ratios (P,).

    `states` (N, T, 6) at `times` (T,) are joined by cubics, on which the minimum is certified like a closest
    approach. `arrivals` are the states before impulses at these times.
    """
    if zones is None:
        return np.empty((0, 2), dtype=np.int64), np.empty(0)
    first, second = np.triu_indices(len(states), 1)
    pairs = np.stack([first, second], axis=1)
    which, shapes = _zones_of(first, second, len(states), zones)
    least = np.full(len(pairs), inf)
    known = [np.ascontiguousarray(one) for one in (states, arrivals, times)]
    for k, some in by_zone(which):
        found = np.empty(len(some))
        minimum_ratios(*known, first[some], second[some], shapes[k].form, found)
        least[some] = found
    return pairs[which != NONE], least[which != NONE]


def _zones_of(first: Any, second: Any, count: int, zones: Zone | PairZones) -> tuple[Any, Sequence[Zone]]:
    """Return the zone index of each pair (P,), and the zones."""
    if isinstance(zones, Zone):
        return np.zeros(len(first), dtype=np.int64), (zones,)
    which = pair_zones("zones", zones, count).which(first, second)
    return which, zones.zones


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


def hermite_positions(one: Floats, two: Floats, step: Floats) -> Floats:
    """Return positions (P, M + 1, 3) on the cubics between states (P, 6) that are `step` apart."""
    s = np.linspace(0.0, 1.0, FINER + 1)[:, None]
    a, b, va, vb = one[:, None, :3], two[:, None, :3], step * one[:, None, 3:], step * two[:, None, 3:]
    ends = (1.0 + 2.0 * s) * (1.0 - s) ** 2 * a + s * s * (3.0 - 2.0 * s) * b
    return np.asarray(ends + s * (1.0 - s) ** 2 * va - s * s * (1.0 - s) * vb)


def ratios_at_times(states: Floats, zones: Zone | PairZones) -> Floats:
    """Return the minimum clearance ratio of all pairs of `states` (N, T, 6) at each time (T,).

    inf without zones.
    """
    first, second = np.triu_indices(len(states), 1)
    which, shapes = _zones_of(first, second, len(states), zones)
    least = np.full(states.shape[1], np.inf)
    for k, some in by_zone(which):
        apart = states[first[some], :, :3] - states[second[some], :, :3]
        least = np.minimum(least, shapes[k]._norm(apart).min(axis=0))
    return least


def closest_pair(states: Floats, zones: Zone | PairZones) -> tuple[int, int]:
    """Return the two spacecraft with the minimum clearance ratio, from `states` (N, 6) at an instant."""
    first, second = np.triu_indices(len(states), 1)
    which, shapes = _zones_of(first, second, len(states), zones)
    norms = np.full(len(first), np.inf)
    for k, some in by_zone(which):
        norms[some] = shapes[k]._norm(states[first[some], :3] - states[second[some], :3])
    k = int(np.argmin(norms))
    return int(first[k]), int(second[k])
