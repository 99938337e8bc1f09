"""The sieve: pairs of many spacecraft that may have a conflict, found in near-linear time.

Spacecraft are bounded by chords (see `quick_rejection`) over short intervals of time.  In each interval a
tree of boxes (see `box_tree`) finds the pairs that may be inside their zone: no conflict is missed. Where too
many boxes overlap because spacecraft move far in an interval, the interval is halved.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil, inf, pi
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.box_tree import LEAF, OPEN, WIDTH, meeting
from closeform.conflicts.quick_rejection import OFF_CHORD, fill_tracks
from closeform.motion.path import Path
from closeform.zones.pair_zones import PairZones, made_by_need, reach_of
from closeform.zones.solids import Sphere
from closeform.zones.zone import Zone, enclosing

PER_ORBIT = 48  # intervals an orbit, and at least
AT_ONCE = 8  # intervals that are processed together, fewer if they contain
FEW = 1 << 21  # more pairs
CROWDED = 8  # overlaps for each spacecraft in an interval above which it is halved, if that helps
SHARE = 8  # the sieve pays if fewer than one in so many pairs overlap in an interval
MOST = 1 << 24  # overlaps in an interval: beyond, pairs are tested one by one, in less memory
ANY = 1 << 62
FINEST = 256  # largest number of parts of an interval
SOME = 1000  # spacecraft that estimate the distance moved
LOOKS = 3  # intervals that decide if the sieve pays
ROOM = 1 << 16  # pairs that one call finds


@dataclass(frozen=True, eq=False)
class Sieve:
    """Spacecraft of shape (N,), and intervals between `times` (K + 1,) [s] in which they are compared.

    `matrix` maps to coordinates in which two spacecraft are outside their zone while their distance exceeds 1
    plus both `margins` (N,), which are 0 or less.
    """

    paths: Path
    matrix: Floats
    margins: Floats
    times: Floats
    starts: Floats
    ends: Floats
    at_once: int = AT_ONCE

    @classmethod
    def of(cls, paths: Path, zones: Zone | PairZones) -> Sieve | None:
        """Return the sieve, or None if a zone is unbounded, or if testing pairs one by one costs less."""
        scaled = in_unit_ball(zones, len(paths))
        if scaled is None:
            return None
        starts, ends = paths.start, paths.end
        start, end = float(starts.min()), float(ends.max())
        count = PER_ORBIT * max(1.0, paths.orbit.mean_motion * (end - start) / (2 * pi))
        sieve = cls(paths, *scaled, np.linspace(start, end, ceil(count) + 1), starts, ends)
        overlaps = sieve._overlaps
        if overlaps > min(len(paths) * (len(paths) - 1) // 2 // SHARE, MOST):
            return None
        return replace(sieve, at_once=min(AT_ONCE, max(1, FEW // max(1, overlaps))))

    def near(self, first: int, last: int) -> Any:
        """Return pairs (M,) as i N + j with i < j, each once, that may meet in intervals [first, last)."""
        found = [codes for codes, _ in self._looks(self.times[first : last + 1])]
        return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *found]))

    def spans(self, begin: float = -inf, before: float = inf) -> Iterator[tuple[int, int]]:
        """Yield ranges [first, last) of intervals to process together that meet [begin, before)."""
        first = max(0, int(np.searchsorted(self.times, begin)) - 1)
        stop = min(len(self.times) - 1, int(np.searchsorted(self.times, before)))
        for k in range(first, stop, self.at_once):
            yield k, min(k + self.at_once, stop)

    @property
    def _overlaps(self) -> int:
        """Maximum number of boxes that overlap in any of the intervals; counting stops beyond `MOST`."""
        most = 0
        for look in range(LOOKS):
            k = (2 * look + 1) * (len(self.times) - 1) // (2 * LOOKS)
            overlaps = 0
            for _, more in self._looks(self.times[k : k + 2]):
                overlaps += more
                if overlaps > MOST:
                    return overlaps
            most = max(most, overlaps)
        return most

    def _looks(self, times: Floats) -> Iterator[tuple[Any, int]]:
        """Yield parts of the pairs of `near` in the intervals between times, and counts of overlaps."""
        number = len(self.paths)
        tracks = np.zeros((number, 4, len(times)))
        fill_tracks(self.paths.arcs, self.paths.offsets, self.matrix, times, tracks)
        tracks[:, OFF_CHORD] += self.margins[:, None]
        boxes, codes = np.empty((number, WIDTH)), np.empty(ROOM, dtype=np.int64)
        chords = np.empty((number, 4, 2))
        nodes = np.empty((4 * max(1, number // LEAF), 6))
        waiting, state = np.empty((OPEN, 2), dtype=np.int64), np.empty(2, dtype=np.int64)
        for k in range(len(times) - 1):
            craft = np.flatnonzero((self.starts <= times[k + 1]) & (self.ends >= times[k]))
            middles = 0.5 * (times[k:-1] + times[k + 1 :])
            halved = times[k + 1] - times[k] > self._finest and self._far(tracks[:, :, k : k + 2], craft)
            most = CROWDED * len(craft) if halved else ANY
            state[:] = -1, 0
            found = []
            while state[0] and state[1] <= most:
                before = int(state[1])
                count = meeting(tracks, k, craft, boxes, chords, nodes, waiting, state, most, codes)
                found.append((codes[:count].copy(), int(state[1]) - before))
            if state[1] > most:  # the next intervals will have as many
                finer = np.sort(np.concatenate([times[k:], middles]))
                for begin in range(0, len(finer) - 1, AT_ONCE):
                    yield from self._looks(finer[begin : begin + AT_ONCE + 1])
                return
            yield from found

    @property
    def _finest(self) -> float:
        """Shortest interval [s]; below it coordinates round by more than a zone, and nothing is gained."""
        return float(self.times[1] - self.times[0]) / FINEST

    def _far(self, tracks: Floats, craft: Any) -> bool:
        """Return True if spacecraft move further in an interval than the distance that they have to keep."""
        some = craft[:: max(1, len(craft) // SOME)]
        moved = np.abs(tracks[some, :3, 1] - tracks[some, :3, 0]).max(axis=1)
        margins = self.margins[some]
        return bool((0.5 * moved + tracks[some, OFF_CHORD, 0] - margins).sum() > (0.5 + margins).sum())


def in_unit_ball(zones: Zone | PairZones, number: int) -> tuple[Floats, Floats] | None:
    """Return the `matrix` and `margins` of a sieve; None if a zone is unbounded, or there is none."""
    if isinstance(zones, Zone):
        return (enclosing(zones), np.zeros(number)) if zones.bounded else None
    if made_by_need(zones):
        reach = reach_of(zones)
        return (enclosing(Sphere(reach)), np.zeros(number)) if reach > 0.0 else None
    radii = np.array([*(zone.radius for zone in zones.zones), 0.0])[zones.table]  # the last kind has no zone
    radii = np.maximum(radii, radii.T)
    if not 0.0 < radii.max() < inf:
        return None
    shares = 0.5 * np.diag(radii)
    for kind in np.argsort(-radii.max(axis=1), kind="stable"):  # the larger zones take larger shares
        shares[kind] = max(shares[kind], (radii[kind] - shares).max())
    unit = 2.0 * shares.max()
    return np.eye(3) / unit, shares[zones.kinds] / unit - 0.5
