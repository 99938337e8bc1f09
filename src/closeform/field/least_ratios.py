"""The least ratio of each pair of craft that are known at equal steps."""

from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone


def least_ratios(places: Floats, zones: Zone | PairZones | None) -> tuple[Any, Floats]:
    """Pairs i < j (P, 2) of craft at `places` (N, T, 3) that have a zone, and the least norm of each (P,)."""
    each = [(i, j) for i in range(len(places)) for j in range(i + 1, len(places))]
    held = [(pair, zones.between(*pair) if isinstance(zones, PairZones) else zones) for pair in each]
    kept = [(pair, zone) for pair, zone in held if zone is not None]
    pairs = np.array([pair for pair, _ in kept], dtype=int).reshape(-1, 2)
    return pairs, np.array([least_between(zone.norm(places[i] - places[j])) for (i, j), zone in kept])


def least_between(norms: Floats) -> float:
    """The least of a smooth norm (T,), between its steps by the parabola of its square."""
    k = int(np.argmin(norms))
    if not 0 < k < len(norms) - 1:
        return float(norms[k])
    before, here, after = norms[k - 1 : k + 2] ** 2
    bend = before - 2.0 * here + after
    return (
        float(np.sqrt(max(here - (after - before) ** 2 / (8.0 * bend), 0.0)))
        if bend > 0.0
        else float(norms[k])
    )
