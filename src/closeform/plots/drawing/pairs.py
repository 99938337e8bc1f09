"""Pairs of spacecraft with a keep-out zone, their closest approaches, and text about them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.all_pairs import screen
from closeform.conflicts.flight import nearest
from closeform.conflicts.two_paths import PairConflict, closest_approach, nearest_first
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.plots.drawing.inputs import crafts
from closeform.plots.drawing.text import short_names
from closeform.zones.pair_zones import pair_zones, portions
from closeform.zones.zone import Zone

TOUCH = 1e-6  # above 1: tolerance for a pair on the keep-out boundary


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of spacecraft with a keep-out zone, each with its closest approach and conflicts.

    `craft` (M, 2) holds sorted indices i < j. Each pair has a `zone`, a minimum `ratio` (M,), inf if the two
    share no time, the `time` of closest approach (M,) [s], and its conflicts, `stays`. `total` is the number
    of all pairs with a zone, which may be more than M.
    """

    paths: Path
    craft: Any
    zone: list[Zone]
    ratio: Floats
    time: Floats
    stays: list[tuple[PairConflict, ...]]
    total: int

    @classmethod
    def of(
        cls, paths: Any, zones: Any, count: int | None = None, name: str = "zones", most: float = np.inf
    ) -> Self:
        """Return the pairs of N `paths` with one zone for all, one for each, or `PairZones`; or no pairs.

        The first two apply to pairs with at least one of the first `count` spacecraft. Of more than
        `most` pairs, those in conflict and the closest are returned. Raises ValueError for a wrong number of
        zones, or if two zones cannot be combined.
        """
        batch = stack(crafts("paths", paths))
        flying = len(batch) if count is None else count
        none = zones is None or (isinstance(zones, Sequence) and not zones)
        kept = pair_zones(name, [None] * len(batch) if none else zones, flying, len(batch) - flying)
        parts = list(portions(kept) if kept.pairs <= most else nearest(batch, kept))
        near = [closest_approach(batch[first], batch[second], zone) for zone, first, second in parts]
        craft = np.concatenate([np.empty((0, 2), dtype=int), *(np.stack(pair, 1) for _, *pair in parts)])
        ratio, time = (
            np.concatenate([[], *(getattr(one, what) for one in near)]) for what in ("ratio", "time")
        )
        zone = [zone for zone, first, _ in parts for _ in range(len(first))]
        stays: dict[tuple[int, ...], list[PairConflict]] = {}
        for met in screen(batch, kept).conflicts:
            stays.setdefault((met.first, met.second), []).append(met)
        order = np.lexsort(craft.T[::-1])
        return cls(
            batch,
            craft[order],
            [zone[k] for k in order],
            ratio[order],
            time[order],
            [tuple(stays.get(tuple(pair), ())) for pair in craft[order].tolist()],
            len(craft) if kept.pairs <= most else kept.pairs,
        )

    def __len__(self) -> int:
        return len(self.craft)

    def ratios(self, times: Floats, rows: Sequence[int] | slice = slice(None)) -> Floats:
        """Return clearance ratios (R, T) of some pairs at times (T,) [s]; inf where one has no path."""
        craft, zones = self.craft[rows], np.array([id(zone) for zone in self.zone])[rows]
        places, found = places_at(self.paths, times), np.full((len(craft), len(times)), np.inf)
        for zone in {id(zone): zone for zone in self.zone}.values():
            mine = np.flatnonzero(zones == id(zone))
            one, other = craft[mine].T
            gap = places[one] - places[other]
            both = np.isfinite(gap[..., 0])
            ratios = np.full(gap.shape[:2], np.inf)
            ratios[both] = zone._norm(gap[both])
            found[mine] = ratios
        return found

    @cached_property
    def hit(self) -> Any:
        """Mask (M,) of pairs: True for those in conflict."""
        return np.array([bool(stays) for stays in self.stays], dtype=bool)

    @cached_property
    def order(self) -> list[int]:
        """Indices of the pairs that share a time, closest first; of equal ones the earliest."""
        near = list(zip(self.ratio.tolist(), self.time.tolist(), strict=True))
        ranked = sorted(range(len(self)), key=lambda k: nearest_first(*near[k]))
        return [k for k in ranked if near[k][0] < np.inf]


def places_at(paths: Path, times: Floats) -> Floats:
    """Return positions (N, T, 3) [m] of paths (N,), nan outside of their times."""
    found = np.full((len(paths), len(times), 3), np.nan)
    for k, places in enumerate(found):
        path = paths[k]
        there = (times >= path.start) & (times <= path.end)
        places[there] = path.position(times[there])
    return found


def asked_pairs(paths: Any, zones: Any, names: Sequence[str] | None) -> tuple[Pairs, list[str]]:
    """Return the pairs to show and the labels of their spacecraft."""
    count = crafts("paths", paths)
    if len(count) < 2:
        raise ValueError(f"paths: give at least two craft, got {len(count)}")
    called = short_names(names, len(count))
    pairs = Pairs.of(count, zones)
    if not len(pairs):
        raise ValueError("zones: no pair of craft has a zone")
    return pairs, called


def verdict_of_pairs(pairs: Pairs, called: list[str]) -> str:
    """Return the headline: number of conflicts, and the closest pair."""
    hits, total = int(pairs.hit.sum()), len(pairs)
    if not pairs.order:
        return "No two craft that have a zone share a time"
    near = pairs.order[0]
    one, other = (called[craft] for craft in pairs.craft[near])
    least = f"{ratio_text(pairs.ratio[near])} × zone"
    if total == 1:
        return f"{one} and {other}: {'in conflict' if hits else 'clear'}, {least}"
    verdict = f"{hits} of {total} pairs in conflict" if hits else f"All {total} pairs clear"
    touching = int((pairs.ratio <= 1.0 + TOUCH).sum())
    if not hits and touching > 1:
        return f"{verdict}; {touching} of them touch, {least}"
    return f"{verdict}; closest {one} and {other}, {least}"


def ratio_text(ratio: float) -> str:
    """Return a ratio as text; a ratio below 1 is never shown as 1.00."""
    if ratio <= 1.0 and round(ratio, 2) == 1.0:
        return "<1"
    if ratio >= 9999.5:
        return f"{ratio:.0e}".replace("e+0", "e")
    return f"{ratio:.{2 if ratio < 9.995 else 1 if ratio < 99.95 else 0}f}"
