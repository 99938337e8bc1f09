"""The least ratio of each pair of craft that are known at equal steps."""

from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.zones.made_table import NONE
from closeform.zones.pair_zones import PairZones, by_zone, pair_zones
from closeform.zones.zone import Zone

FINER = 8  # instants of each step about the nearest, on the cubics through states


def least_ratios(states: Floats, step: float, zones: Zone | PairZones | None) -> tuple[Any, Floats]:
    """Pairs i < j (P, 2) with a zone, and their least norms (P,), of `states` (N, T, 6) at equal steps."""
    if zones is None:
        return np.empty((0, 2), dtype=np.int64), np.empty(0)
    first, second = np.triu_indices(len(states), 1)
    pairs = np.stack([first, second], axis=1)
    if isinstance(zones, Zone):
        return pairs, least_norms(states[first] - states[second], step, zones)
    which = pair_zones("zones", zones, len(states)).which(first, second)
    least = np.full(len(pairs), np.inf)
    for k, some in by_zone(which):
        least[some] = least_norms(states[first[some]] - states[second[some]], step, zones.zones[k])
    return pairs[which != NONE], least[which != NONE]


def least_norms(motions: Floats, step: float, zone: Zone) -> Floats:
    """The least norm of each of some relative motions (P, T, 6), by the cubics beside the nearest state."""
    norms = zone.norm(motions[..., :3])
    k = np.clip(norms.argmin(axis=1), 1, norms.shape[1] - 2)
    rows = np.arange(len(motions))
    fine = [cubic(motions[rows, k + side], motions[rows, k + side + 1], step) for side in (-1, 0)]
    found = zone.norm(np.concatenate(fine, axis=1))
    m = np.clip(found.argmin(axis=1), 1, found.shape[1] - 2)
    before, here, after = (found[rows, m + side] ** 2 for side in (-1, 0, 1))
    inside = (here <= before) & (here <= after) & (before + after > 2.0 * here)
    bend = np.where(inside, before - 2.0 * here + after, np.inf)
    lower = (after - before) ** 2 / (8.0 * bend)  # by a parabola of squares
    least = np.sqrt(np.maximum(here - lower, 0.0))
    return np.asarray(np.minimum(np.minimum(least, found.min(axis=1)), norms.min(axis=1)))


def cubic(one: Floats, two: Floats, step: float) -> Floats:
    """Positions (P, M, 3) on the cubics between states (P, 6), from the first until before the second."""
    s = np.linspace(0.0, 1.0, FINER, endpoint=False)[:, None]
    a, b, va, vb = (part[:, None] for part in (one[:, :3], two[:, :3], step * one[:, 3:], step * two[:, 3:]))
    ends = (1.0 + 2.0 * s) * (1.0 - s) ** 2 * a + s * s * (3.0 - 2.0 * s) * b
    return np.asarray(ends + s * (1.0 - s) ** 2 * va - s * s * (1.0 - s) * vb)
