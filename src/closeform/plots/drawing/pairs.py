"""Pairs of spacecraft with a keep-out zone, their closest approaches, and text about them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.all_pairs import screen
from closeform.conflicts.flight import nearest
from closeform.conflicts.two_paths import Conflict, closest_approach, find_conflicts, nearest_first
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.plots.drawing.inputs import crafts
from closeform.plots.drawing.text import short_names
from closeform.zones.made_table import NONE
from closeform.zones.pair_zones import by_zone, pair_zones
from closeform.zones.zone import Zone

SURE = 1e-8  # above 1: numerical tolerance of a minimum ratio; larger ratios are not a conflict
TOUCH = 1e-6  # above 1: tolerance for a pair on the keep-out boundary


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of spacecraft with a keep-out zone, each with its closest approach.

    `craft` (M, 2) holds sorted indices i < j. Each pair has a `zone`, a minimum `ratio` (M,), inf if the two
    share no time, and the `time` of closest approach (M,) [s].
    """

    paths: Path
    craft: Any
    zone: list[Zone]
    ratio: Floats
    time: Floats
    total: int  # number of all pairs with a zone, which may be more than M

    @classmethod
    def near(cls, paths: Any, zones: Any, count: int, name: str) -> Self:
        """Return the pairs in conflict, or else the closest ones, of formations too large for `of`.

        Arguments and errors are those of `of`.
        """
        batch = stack(crafts("paths", paths))
        kept = pair_zones(name, zones, count, len(batch) - count)
        craft = np.unique(np.sort(screen(batch, kept).pairs, axis=1), axis=0)
        if len(craft):
            which = kept.which(*craft.T)
            found = [(kept.zones[k], *craft[some].T) for k, some in by_zone(which)]
        else:
            found = list(nearest(batch, kept)) if kept.pairs else []
        chosen = [zone for zone, first, _ in found for _ in range(len(first))]
        near = [closest_approach(batch[one], batch[other], zone) for zone, one, other in found]
        craft = np.concatenate([np.empty((0, 2), dtype=int), *(np.stack(pair[1:], axis=1) for pair in found)])
        ratio, time = (
            np.concatenate([[], *(getattr(one, part) for one in near)]) for part in ("ratio", "time")
        )
        return cls(batch, craft, chosen, ratio, time, kept.pairs)

    @classmethod
    def of(cls, paths: Any, zones: Any, count: int | None = None, name: str = "zones") -> Self:
        """Return the pairs of N `paths` with one zone for all, one for each, or `PairZones`; or no pairs.

        The first two apply to pairs with at least one of the first `count` spacecraft. Raises ValueError for
        a wrong number of zones, or if two zones cannot be combined.
        """
        batch = stack(crafts("paths", paths))
        flying = len(batch) if count is None else count
        none = zones is None or (isinstance(zones, Sequence) and not zones)
        own = [None] * len(batch) if none else zones
        kept = pair_zones(name, own, flying, len(batch) - flying)
        craft = np.stack(np.triu_indices(len(batch), 1), axis=1)
        which = kept.which(*craft.T)
        craft = craft[which != NONE]
        chosen = [kept.zones[k] for k in which[which != NONE]]
        ratio, time = np.full((2, len(craft)), np.nan)
        for zone in dict.fromkeys(chosen):
            rows = np.array([one is zone for one in chosen])
            near = closest_approach(batch[craft[rows, 0]], batch[craft[rows, 1]], zone)
            ratio[rows], time[rows] = near.ratio, near.time
        return cls(batch, craft, chosen, ratio, time, len(craft))

    def __len__(self) -> int:
        return len(self.craft)

    @cached_property
    def stays(self) -> list[tuple[Conflict, ...]]:
        """Conflicts (intervals inside the zone) of each pair."""
        return [
            find_conflicts(self.paths[i], self.paths[j], zone) if ratio <= 1.0 + SURE else ()
            for (i, j), zone, ratio in zip(self.craft.tolist(), self.zone, self.ratio, strict=True)
        ]

    @property
    def hit(self) -> Any:
        """Mask (M,) of pairs: True for those in conflict."""
        return np.array([bool(stays) for stays in self.stays], dtype=bool)

    @property
    def order(self) -> list[int]:
        """Indices of the pairs that share a time, closest first; of equal ones the earliest."""
        near = list(zip(self.ratio.tolist(), self.time.tolist(), strict=True))
        ranked = sorted(range(len(self)), key=lambda k: nearest_first(*near[k]))
        return [k for k in ranked if near[k][0] < np.inf]


def asked_pairs(paths: Any, zones: Any, names: Sequence[str] | None) -> tuple[Pairs, list[str]]:
    """Return the pairs to show and the labels of their spacecraft."""
    count = crafts("paths", paths)
    if len(count) < 2:
        raise ValueError(f"paths: give at least two craft, got {len(count)}")
    called = short_names(names, len(count))
    pairs = Pairs.of(count, zones)
    if not len(pairs):
        raise ValueError("zones: no two craft have a zone")
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
