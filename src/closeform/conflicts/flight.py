"""Flight: a formation's paths with all that is to be said of their conflicts."""

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

ALL_PAIRS = 100_000  # of which every closest approach is looked for: 447 craft
CLOSEST = 2000  # pairs, at least, that are looked for among more
SAMPLED, FEW = 20_000, 20  # pairs at random, and how many of them say how densely craft fly
LEAST, HUGE = 1e-3, 1e9  # times a zone
SAME = 1e-9  # m/s by which two craft that burn as much may differ
LOOKS = 201  # instants from which a track's length is told


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


@dataclass(frozen=True, eq=False, repr=False)
class WatchedFlight(Result):
    """The formation's paths, shape (N,), with every conflict and each pair's closest approach.

    Of more than `ALL_PAIRS` there are the approaches of the closest only; `pairs` is how many have
    a zone.  Where none has there are neither.
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
        """One craft's path."""
        return self.paths[self.names.index(name)]

    @property
    def end(self) -> float:
        """When it ends [s]."""
        return float(np.max(self.paths.end))

    def facing(self, first: str, second: str) -> tuple[str, str]:
        """Two craft as they are shown: the one that moves relative to the one that stays."""
        stay = stays_rather(self.path(first), self.path(second))
        return (second, first) if stay else (first, second)

    @property
    def closest(self) -> PairApproach | None:
        """The pair that comes closest in terms of its zone, the earliest of equals; None for one craft."""
        return min(self.approaches, key=lambda pair: nearest_first(pair.ratio, pair.time), default=None)


def stays_rather(path: Path, other: Path) -> bool:
    """Whether one craft rather than another stays where it is: who burns less, or whose track is shorter."""
    burnt = path.delta_v - other.delta_v
    if abs(burnt) > SAME:
        return bool(burnt < 0.0)
    tracks = (one.position(np.linspace(one.start, one.end, LOOKS)) for one in (path, other))
    mine, theirs = (float(np.linalg.norm(np.diff(track, axis=0), axis=1).sum()) for track in tracks)
    return mine < theirs


def watch(paths: Path, names: Sequence[str], zones: PairZones) -> WatchedFlight:
    """Every conflict and the closest approaches among paths of shape (N,)."""
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
    """Among others the `CLOSEST` pairs that come closest, by zone, without a look at each of them all.

    A screening finds them, with zones so large that so many are in conflict.
    """
    factor, pairs = 0.5 * guess(paths, zones), np.empty((0, 2), dtype=np.int64)
    while len(pairs) < CLOSEST and factor < HUGE:
        factor *= 2.0
        pairs = np.unique(screen(paths, enlarged(zones, factor)).pairs, axis=0)
    first, second = pairs.T
    for k, some in by_zone(zones.which(first, second)):
        yield zones.zones[k], first[some], second[some]


def guess(paths: Path, zones: PairZones) -> float:
    """How many times larger zones would give `CLOSEST` conflicts, from pairs at random.

    The number within a distance grows with its third power, if craft are spread evenly.
    """
    first, second = np.sort(np.random.default_rng(0).integers(len(paths), size=(2, SAMPLED)), axis=0)
    which = np.where(first < second, zones.which(first, second), NONE)
    near = [
        closest_approach(paths[first[some]], paths[second[some]], zones.zones[k]).ratio
        for k, some in by_zone(which)
    ]
    ratios = np.sort(np.concatenate(near))
    share = CLOSEST / zones.pairs * len(ratios) / FEW
    return float(np.clip(ratios[FEW - 1], LEAST, HUGE) * share ** (1.0 / 3.0))


def named(found: list[Any], names: Sequence[str]) -> tuple[Any, ...]:
    """What pairs by index came to, by pair, then time, with their names."""
    ordered = sorted(found, key=lambda pair: (pair.first, pair.second, pair.time))
    return tuple(replace(pair, first=names[pair.first], second=names[pair.second]) for pair in ordered)
