"""Flight: a formation's paths with all that is to be said of their conflicts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from closeform.conflicts.all_pairs import screen
from closeform.conflicts.two_paths import PairConflict, closest_approach
from closeform.motion.path import Path
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone


@dataclass(frozen=True, eq=False)
class PairApproach:
    """The closest approach of the craft `first` and `second` in terms of the `zone` that holds for them.

    `time` [s], least norm `ratio`, and the `distance` [m] at that time; `rule`: how the zone was made.
    """

    first: Any
    second: Any
    time: float
    ratio: float
    distance: float
    zone: Zone
    rule: str


@dataclass(frozen=True, eq=False)
class Flight:
    """The formation's paths, shape (N,), with every conflict and each pair's closest approach.

    Where no zone holds for any pair there are neither.
    """

    paths: Path
    names: tuple[str, ...]
    conflicts: tuple[PairConflict, ...]
    approaches: tuple[PairApproach, ...]

    def path(self, name: str) -> Path:
        """One craft's path."""
        return self.paths[self.names.index(name)]

    @property
    def end(self) -> float:
        """When it ends [s]."""
        return float(np.max(self.paths.end))

    @property
    def closest(self) -> PairApproach | None:
        """The pair that comes closest in terms of its zone, the earliest of equals; None for one craft."""
        return min(self.approaches, key=lambda pair: (round(pair.ratio, 6), pair.time), default=None)


def watch(paths: Path, names: Sequence[str], zones: PairZones) -> Flight:
    """Every conflict and every closest approach among paths of shape (N,)."""
    approaches: list[PairApproach] = []
    for zone, pairs in zones.groups():
        close = closest_approach(paths[pairs[:, 0]], paths[pairs[:, 1]], zone)
        approaches += [
            PairApproach(one, other, time, ratio, distance, zone, zones.rule(one, other) or "")
            for (one, other), time, ratio, distance in zip(
                *(part.tolist() for part in (pairs, close.time, close.ratio, close.distance)), strict=True
            )
        ]
    conflicts = list(screen(paths, zones).conflicts)
    return Flight(paths, tuple(names), named(conflicts, names), named(approaches, names))


def named(found: list[Any], names: Sequence[str]) -> tuple[Any, ...]:
    """What pairs by index came to, by pair, then time, with their names."""
    ordered = sorted(found, key=lambda pair: (pair.first, pair.second, pair.time))
    return tuple(replace(pair, first=names[pair.first], second=names[pair.second]) for pair in ordered)
