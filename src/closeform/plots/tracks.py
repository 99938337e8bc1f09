"""Tracks of a formation, its stretches in conflict, and its closest pair."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import stays_rather
from closeform.motion.path import Path
from closeform.plots.inputs import crafts
from closeform.plots.pairs import Pairs, ratio_text
from closeform.plots.style import instants, length
from closeform.zones.outlines import drawn
from closeform.zones.solids import Sphere
from closeform.zones.zone import Zone

MANY, NAMED = 200, 20  # spacecraft above which only the closest are shown, and how many of them
SAMPLE = 150  # of the others, as faint tracks
ROOM = 48  # characters of a headline for the names of pairs


@dataclass(frozen=True, eq=False)
class Closest:
    """Closest pair at its closest approach: `zone`, its `centre`, and the position of the `other`."""

    zone: Zone | None  # None if no spacecraft has one
    centre: Floats
    other: Floats
    story: str  # describes the pair


@dataclass(frozen=True, eq=False)
class Formation:
    """Tracks of all paths at one stage of a plan, as positions [m]."""

    title: str
    tracks: list[Floats]
    stays: list[Floats]  # stretches in conflict
    obstacles: list[Floats]
    closest: Closest | None
    conflicts: int  # pairs in conflict
    pairs: int  # pairs that have a zone
    named: str  # some of those in conflict
    shown: list[int]  # indices of the spacecraft with tracks
    faint: list[Floats]  # tracks of a sample of the others

    @classmethod
    def of(
        cls,
        title: str,
        paths: Path,
        others: list[Path],
        zone: object,
        called: list[str],
        shown: list[int] | None = None,
    ) -> "Formation":
        """Sample the tracks and find the conflicts.

        Of many spacecraft only `shown` have tracks, by default those of the closest pairs.
        """
        flown = crafts("paths", paths)
        many, lacking = len(flown) > MANY, zone is None or (isinstance(zone, Sequence) and not zone)
        kept = Sphere(1.0) if many and lacking else zone  # ranks pairs by distance
        pairs = (Pairs.near if many else Pairs.of)([*flown, *others], kept, len(flown), "zone")
        if shown is None:
            shown = closest_craft(pairs, len(flown)) if many else list(range(len(flown)))
        rest = np.setdiff1d(np.arange(len(flown)), shown)
        rest = rest[np.linspace(0, len(rest) - 1, min(len(rest), SAMPLE)).astype(int)]
        tracks, passed, faint = (
            [path.position(instants(path.start, path.end, path)) for path in some]
            for some in ([flown[k] for k in shown], others, [flown[k] for k in rest])
        )
        near = closest(pairs, len(flown), called, many and lacking)
        if many and lacking:
            return cls(title, tracks, [], passed, near, 0, 0, "", shown, faint)
        stays: list[Floats] = []
        for path, spans in zip(flown, together(pairs, len(flown)), strict=True):
            stays += [path.position(np.linspace(start, end, 60)) for start, end in spans]
        words = in_words(pairs, called)
        return cls(title, tracks, stays, passed, near, int(pairs.hit.sum()), pairs.total, words, shown, faint)

    @property
    def points(self) -> Floats:
        """All positions (M, 3) [m], including the extremes of the zone."""
        every = [*self.tracks, *self.faint, *self.stays, *self.obstacles]
        if self.closest is not None and self.closest.zone is not None:
            extents = drawn(self.closest.zone).extents[None]
            every += [self.closest.centre + sign * extents for sign in (-1, 1)]
        return np.vstack(every)

    @property
    def story(self) -> str:
        """Closest pair as text, and which spacecraft are shown if there are many."""
        told = [self.closest.story] if self.closest is not None else []
        if self.faint:
            told.append(f"in colour the {len(self.shown)} craft of the closest pairs")
        return "; ".join(told)


def closest_craft(pairs: Pairs, flown: int) -> list[int]:
    """Return the sorted indices of the spacecraft in the closest pairs."""
    found: dict[int, None] = {}
    for k in pairs.order:
        both = [craft for craft in pairs.craft[k].tolist() if craft < flown]
        if len({*found, *both}) > NAMED:
            break
        found |= dict.fromkeys(both)
    return sorted(found)


def closest(pairs: Pairs, flown: int, called: list[str], by_distance: bool = False) -> Closest | None:
    """Return the closest pair, or None if no pair shares a time; `by_distance` for 1 m zones."""
    if not pairs.order:
        return None
    near = pairs.order[0]
    one, other = pairs.craft[near].tolist()
    least = pairs.ratio[near]
    how = length(float(least)) if by_distance else f"{ratio_text(least)} × zone"
    story = f"closest {called[one]} and {called[other]}, {how}"
    here, there = one, other
    if stays(pairs.paths, flown, other, one):
        here, there = other, one
    centre, away = (pairs.paths[k].position(pairs.time[near]) for k in (here, there))
    return Closest(None if by_distance else pairs.zone[near], centre, away, story)


def in_words(pairs: Pairs, called: list[str]) -> str:
    """Return the pairs in conflict as text, deepest first, as far as the headline has room."""
    deep = [k for k in pairs.order if pairs.stays[k]]
    named = [" and ".join(called[craft] for craft in pairs.craft[k].tolist()) for k in deep]
    if len(named) < 2:
        return ""
    kept = max(1, sum(len(", ".join(named[: k + 1])) <= ROOM for k in range(len(named))))
    more = f", {len(named) - kept} more" if len(named) > kept else ""
    return f": {', '.join(named[:kept])}{more}"


def stays(paths: Path, flown: int, one: int, other: int) -> bool:
    """Return True if spacecraft `one` should carry the zone: it is the obstacle, or moves less."""
    if (one >= flown) != (other >= flown):
        return one >= flown
    return stays_rather(paths[one], paths[other])


def together(pairs: Pairs, count: int) -> list[list[tuple[float, float]]]:
    """Return the merged conflict intervals of each spacecraft with any other."""
    spans: list[list[tuple[float, float]]] = [[] for _ in range(count)]
    for craft, met in zip(pairs.craft.tolist(), pairs.stays, strict=True):
        for k in craft:
            if k < count:
                spans[k] += [(stay.start, stay.end) for stay in met]
    merged: list[list[tuple[float, float]]] = []
    for one in spans:
        whole: list[tuple[float, float]] = []
        for start, end in sorted(one):
            if whole and start <= whole[-1][1]:
                whole[-1] = whole[-1][0], max(end, whole[-1][1])
            else:
                whole.append((start, end))
        merged.append(whole)
    return merged
