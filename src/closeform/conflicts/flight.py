"""Paths of a formation with all conflicts and closest approaches among them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from closeform.conflicts.all_pairs import screen
from closeform.conflicts.two_paths import PairConflict, closest_approach, nearest_first
from closeform.motion.path import Path
from closeform.result import Result
from closeform.zones.made_table import NONE
from closeform.zones.pair_zones import PairZones, by_zone, enlarged, portions
from closeform.zones.zone import Zone

ALL_PAIRS = 100_000  # up to which every closest approach is computed: 447 spacecraft
CLOSEST = 2000  # closest pairs, at least, that are reported among more
SAMPLED, FEW = 20_000, 20  # random pairs, and the number of the closest of them that estimate the density
HUGE = 1e9  # maximum factor of a zone
SAME = 1e-9  # m/s: difference up to which two spacecraft have equal delta-v
LOOKS = 201  # instants that measure the length of a track


@dataclass(frozen=True, eq=False)
class PairApproach:
    """Closest approach of the spacecraft `first` and `second`, measured by the `zone` of the pair.

    It has the `time` [s], the clearance ratio, the `distance` [m] at that time, and the `rule` of the zone.
    """

    first: Any
    second: Any
    time: float
    ratio: float
    distance: float
    zone: Zone
    rule: str


@dataclass(frozen=True, eq=False, repr=False)
class WatchedFlight(Result):
    """Paths of a formation, shape (N,), with all conflicts and the closest approach of each pair.

    Above `ALL_PAIRS` pairs only the approaches of the closest are kept; `pairs` is the number of pairs with a
    zone. If no pair has a zone there are neither conflicts nor approaches.
    """

    _told: ClassVar = ("paths", "names", "conflicts", "approaches")

    paths: Path
    names: tuple[str, ...]
    conflicts: tuple[PairConflict, ...]
    approaches: tuple[PairApproach, ...]
    pairs: int

    @property
    def _brief(self) -> str:
        return f"{len(self.names)} craft with {len(self.conflicts)} conflicts"

    def path(self, name: str) -> Path:
        """Return the path of one spacecraft by name."""
        return self.paths[self.names.index(name)]

    @property
    def end(self) -> float:
        """End of the last path [s]."""
        return float(np.max(self.paths.end))

    def facing(self, first: str, second: str) -> tuple[str, str]:
        """Return two names in order of display: the spacecraft that moves, and the one taken as fixed."""
        stay = stays_rather(self.path(first), self.path(second))
        return (second, first) if stay else (first, second)

    @property
    def closest(self) -> PairApproach | None:
        """Closest pair by clearance ratio, the earliest of equals; None for one spacecraft."""
        return min(self.approaches, key=lambda pair: nearest_first(pair.ratio, pair.time), default=None)


def stays_rather(path: Path, other: Path) -> bool:
    """Return True if the first spacecraft counts as fixed: it has less delta-v, or a shorter track."""
    burnt = path.delta_v - other.delta_v
    if abs(burnt) > SAME:
        return bool(burnt < 0.0)
    tracks = (one.position(np.linspace(one.start, one.end, LOOKS)) for one in (path, other))
    mine, theirs = (float(np.linalg.norm(np.diff(track, axis=0), axis=1).sum()) for track in tracks)
    return mine < theirs


def watch(paths: Path, names: Sequence[str], zones: PairZones) -> WatchedFlight:
    """Return all conflicts and the closest approaches among paths of shape (N,)."""
    approaches: list[PairApproach] = []
    for zone, first, second in portions(zones) if zones.pairs <= ALL_PAIRS else nearest(paths, zones):
        close = closest_approach(paths[first], paths[second], zone)
        approaches += [
            PairApproach(one, other, time, ratio, distance, zone, zones.rule(one, other) or "")
            for one, other, time, ratio, distance in zip(
                *(part.tolist() for part in (first, second, close.time, close.ratio, close.distance)),
                strict=True,
            )
        ]
    conflicts = list(screen(paths, zones).conflicts)
    return WatchedFlight(paths, tuple(names), named(conflicts, names), named(approaches, names), zones.pairs)


def nearest(paths: Path, zones: PairZones) -> Iterator[tuple[Zone, Any, Any]]:
    """Yield the pairs in conflict and at least `CLOSEST` of the closest, by zone, without all approaches.

    They are found by screenings with larger and larger zones, until that many pairs are in conflict.
    """
    factor, pairs = 0.5 * max(1.0, guess(paths, zones)), np.empty((0, 2), dtype=np.int64)
    while len(pairs) < CLOSEST and factor < HUGE:
        factor *= 2.0
        pairs = np.unique(screen(paths, enlarged(zones, factor)).pairs, axis=0)
    first, second = pairs.T
    for k, some in by_zone(zones.which(first, second)):
        yield zones.zones[k], first[some], second[some]


def guess(paths: Path, zones: PairZones) -> float:
    """Return the factor of the zones that gives about `CLOSEST` conflicts, estimated from random pairs.

    The number within a distance grows with its third power if spacecraft are spread evenly.
    """
    first, second = np.sort(np.random.default_rng(0).integers(len(paths), size=(2, SAMPLED)), axis=0)
    which = np.where(first < second, zones.which(first, second), NONE)
    near = [
        closest_approach(paths[first[some]], paths[second[some]], zones.zones[k]).ratio
        for k, some in by_zone(which)
    ]
    ratios = np.sort(np.concatenate(near))
    share = CLOSEST / zones.pairs * len(ratios) / FEW
    return float(min(ratios[FEW - 1], HUGE) * share ** (1.0 / 3.0))


def named(found: list[Any], names: Sequence[str]) -> tuple[Any, ...]:
    """Return the items of pairs, sorted by pair and then time, with names instead of indices."""
    ordered = sorted(found, key=lambda pair: (pair.first, pair.second, pair.time))
    return tuple(replace(pair, first=names[pair.first], second=names[pair.second]) for pair in ordered)
