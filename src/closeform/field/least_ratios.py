"""The least ratio of each pair of craft that are known at equal steps."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.zones.made_table import NONE
from closeform.zones.pair_zones import PairZones, by_zone, pair_zones
from closeform.zones.zone import Zone

FINER = 8  # instants of each step about the nearest, on the cubics through states


def least_ratios(
    states: Floats, arrivals: Floats, times: Floats, zones: Zone | PairZones | None
) -> tuple[Any, Floats]:
    """Pairs i < j (P, 2) with a zone, and their least norms (P,), of `states` (N, T, 6) at `times` (T,).

    `arrivals` are the states before impulses at these times.
    """
    if zones is None:
        return np.empty((0, 2), dtype=np.int64), np.empty(0)
    first, second = np.triu_indices(len(states), 1)
    pairs = np.stack([first, second], axis=1)
    which, shapes = zones_of(first, second, len(states), zones)
    least = np.full(len(pairs), np.inf)
    for k, some in by_zone(which):
        i, j = first[some], second[some]
        before = states[i] - states[j] if arrivals is states else arrivals[i] - arrivals[j]
        least[some] = least_norms(states[i] - states[j], before, times, shapes[k])
    return pairs[which != NONE], least[which != NONE]


def zones_of(first: Any, second: Any, count: int, zones: Zone | PairZones) -> tuple[Any, Sequence[Zone]]:
    """Which zone each pair (P,) of so many craft keeps, and the zones."""
    if isinstance(zones, Zone):
        return np.zeros(len(first), dtype=np.int64), (zones,)
    which = pair_zones("zones", zones, count).which(first, second)
    return which, zones.zones


def least_norms(motions: Floats, arrivals: Floats, times: Floats, zone: Zone) -> Floats:
    """The least norm of each of some relative motions (P, T, 6), by the cubics beside the nearest state."""
    norms = zone.norm(motions[..., :3])
    k = np.clip(norms.argmin(axis=1), 1, norms.shape[1] - 2) if len(times) > 2 else np.ones(len(norms), int)
    rows = np.arange(len(motions))
    least = norms.min(axis=1)
    for one in (k - 1, np.minimum(k, len(times) - 2)):
        step = times[one + 1] - times[one]
        found = zone.norm(cubic(motions[rows, one], arrivals[rows, one + 1], step[:, None, None]))
        m = np.clip(found.argmin(axis=1), 1, FINER - 1)
        before, here, after = (found[rows, m + side] ** 2 for side in (-1, 0, 1))
        inside = (here <= before) & (here <= after) & (before + after > 2.0 * here)
        bend = np.where(inside, before - 2.0 * here + after, np.inf)
        lower = np.maximum(here - (after - before) ** 2 / (8.0 * bend), 0.0)  # by a parabola of squares
        least = np.minimum(least, np.minimum(np.sqrt(lower), found.min(axis=1)))
    return np.asarray(least)


def cubic(one: Floats, two: Floats, step: Floats) -> Floats:
    """Positions (P, M + 1, 3) on the cubics between states (P, 6), both included, that are `step` apart."""
    s = np.linspace(0.0, 1.0, FINER + 1)[:, None]
    a, b, va, vb = one[:, None, :3], two[:, None, :3], step * one[:, None, 3:], step * two[:, None, 3:]
    ends = (1.0 + 2.0 * s) * (1.0 - s) ** 2 * a + s * s * (3.0 - 2.0 * s) * b
    return np.asarray(ends + s * (1.0 - s) ** 2 * va - s * s * (1.0 - s) * vb)


def nearest_pairs(states: Floats, zones: Zone | PairZones) -> Floats:
    """The least norm of all pairs of `states` (N, T, 6) at each time (T,); inf without any zone."""
    first, second = np.triu_indices(len(states), 1)
    which, shapes = zones_of(first, second, len(states), zones)
    least = np.full(states.shape[1], np.inf)
    for k, some in by_zone(which):
        apart = states[first[some], :, :3] - states[second[some], :, :3]
        least = np.minimum(least, shapes[k].norm(apart).min(axis=0))
    return least


def nearest_pair(states: Floats, zones: Zone | PairZones) -> tuple[int, int]:
    """The two craft whose norm is the least, of `states` (N, 6) at an instant."""
    first, second = np.triu_indices(len(states), 1)
    which, shapes = zones_of(first, second, len(states), zones)
    norms = np.full(len(first), np.inf)
    for k, some in by_zone(which):
        norms[some] = shapes[k].norm(states[first[some], :3] - states[second[some], :3])
    k = int(np.argmin(norms))
    return int(first[k]), int(second[k])
