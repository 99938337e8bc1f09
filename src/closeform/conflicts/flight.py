"""Flight: a formation's paths with all that is to be said of their conflicts."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from closeform.conflicts.all_pairs import screen
from closeform.conflicts.two_paths import Approach, Conflict, closest_approach
from closeform.motion.path import Path
from closeform.zones.zone import Zone


@dataclass(frozen=True)
class Encounter:
    """One stay of two craft in their zone."""

    first: str
    second: str
    conflict: Conflict


@dataclass(frozen=True, eq=False)
class Nearest:
    """The closest approach of two craft, in terms of the zone that holds for them."""

    first: str
    second: str
    approach: Approach
    zone: Zone


@dataclass(frozen=True, eq=False)
class Flight:
    """The formation's paths, shape (N,), with every encounter and each pair's closest approach."""

    paths: Path
    names: tuple[str, ...]
    encounters: tuple[Encounter, ...]
    nearest: tuple[Nearest, ...]

    def path(self, name: str) -> Path:
        """One craft's path."""
        return self.paths[self.names.index(name)]

    @property
    def end(self) -> float:
        """When it ends [s]."""
        return float(np.max(self.paths.end))

    @property
    def closest(self) -> Nearest | None:
        """The pair that comes closest in terms of its zone, the earliest of equals; None for one craft."""
        ranked = [
            (round(pair.approach.ratio, 6), pair.approach.time, k) for k, pair in enumerate(self.nearest)
        ]
        return self.nearest[min(ranked)[2]] if ranked else None


def watch(paths: Path, names: Sequence[str], zones: Sequence[tuple[Zone, Any]]) -> Flight:
    """Every conflict and every closest approach among paths of shape (N,).

    `zones` holds each zone with the pairs (M, 2), i < j, for which it holds.
    """
    encounters: list[tuple[int, int, Conflict]] = []
    nearest: list[tuple[int, int, Approach, Zone]] = []
    for zone, pairs in zones:
        holds = {tuple(pair) for pair in pairs.tolist()}
        found = screen(paths, zone)
        columns = zip(found.start, found.end, found.time, found.ratio, strict=True)
        for (one, other), row in zip(found.pairs.tolist(), columns, strict=True):
            if (one, other) in holds:
                encounters.append((one, other, Conflict(*map(float, row))))
        close = closest_approach(paths[pairs[:, 0]], paths[pairs[:, 1]], zone)
        values = zip(close.time, close.ratio, close.distance, strict=True)
        for (one, other), value in zip(pairs.tolist(), values, strict=True):
            nearest.append((one, other, Approach(*map(float, value)), zone))
    return Flight(
        paths,
        tuple(names),
        tuple(Encounter(names[i], names[j], met) for i, j, met in sorted(encounters, key=in_order)),
        tuple(Nearest(names[i], names[j], near, zone) for i, j, near, zone in sorted(nearest, key=in_order)),
    )


def in_order(row: tuple[Any, ...]) -> tuple[int, int, float]:
    """Sorts by pair, then time."""
    return row[0], row[1], row[2].time
