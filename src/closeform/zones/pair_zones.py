"""Which zone holds for two craft: the larger of their two, the one that holds the other."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from closeform.zones.zone import Zone

ROUNDING = 1e-9


def larger(*zones: Zone) -> Zone | None:
    """The zone that holds all others; None where none does: a cigar and a disc, say."""
    for zone in zones:
        if all(zone.greatest_norm(other) <= 1.0 + ROUNDING for other in zones):
            return zone
    return None


def pairwise(zones: Sequence[Zone | None], names: Sequence[str]) -> tuple[tuple[Zone, Any], ...]:
    """Every zone with the pairs (M, 2), i < j, for which it holds: the larger of their two.

    Pairs in which a craft has no zone (None) go by the other's; without any they are left out.
    Raises ValueError naming two craft where neither zone holds the other.
    """
    kinds: list[Zone] = []
    kind = np.full(len(zones), -1)
    known: dict[Any, int] = {}
    for craft, zone in enumerate(zones):
        if zone is not None:
            kind[craft] = known.setdefault(zone.key, len(kinds))
            if kind[craft] == len(kinds):
                kinds.append(zone)
    first, second = np.triu_indices(len(kind), 1)
    winner = np.full(len(first), -1)
    for one, other in product(range(-1, len(kinds)), repeat=2):
        those = (kind[first] == one) & (kind[second] == other)
        if not those.any() or max(one, other) < 0:
            continue
        rivals = {k: kinds[k] for k in (one, other) if k >= 0}
        held = larger(*rivals.values())
        if held is None:
            k = int(np.argmax(those))
            pair = f"{names[first[k]]} and {names[second[k]]}"
            raise ValueError(f"{pair}: neither zone holds the other; give both one that holds both")
        winner[those] = next(k for k, zone in rivals.items() if zone is held)
    pairs = np.stack([first, second], axis=1)
    return tuple((zone, pairs[winner == k]) for k, zone in enumerate(kinds) if (winner == k).any())
