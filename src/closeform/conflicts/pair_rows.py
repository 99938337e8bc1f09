"""Conflicts and closest approaches of pairs as rows of floats, in any orbit."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts import pair_search
from closeform.conflicts.chief import pair_search as chief_search
from closeform.conflicts.chief.tracks import follow_segments
from closeform.conflicts.pair_search import all_rows
from closeform.conflicts.tracks import NO_TRACKS, Tracks, follow
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.path import Path
from closeform.zones.zone import Zone


def conflicts_of(
    path: Path, other: Path, zone: Zone, first: Any, second: Any, tracks: Tracks = NO_TRACKS
) -> tuple[Any, Floats]:
    """Return the conflicts of pairs in order: indices (M, 2) and rows (M, 4) of start, end, time, ratio.

    `first` (P,) are indices of the spacecraft of `path`, `second` of those of `other`.
    """
    search, bodies = _search_of(path, other)
    table = all_rows(
        lambda pair, rows, done: search.conflicts_of_pairs(
            *bodies, first, second, pair, zone.form, *tracks, rows, done
        ),
        len(first),
        min(4096, 64 + len(first)),
    )
    index = table[:, 0].astype(np.int64)
    return np.stack([first[index], second[index]], axis=1), table[:, 1:]


def approaches_of(path: Path, other: Path, zone: Zone, first: Any, second: Any) -> Floats:
    """Return the time and the minimum norm of each pair (P, 2); nan and inf without a common time."""
    out = np.empty((len(first), 2))
    search, bodies = _search_of(path, other)
    search.approaches_of_pairs(*bodies, first, second, zone.form, out)
    return out


def _search_of(path: Path, other: Path) -> tuple[Any, tuple[Any, ...]]:
    """Return the module that searches pairs in the orbit of two batches, and their motion as arguments."""
    if isinstance(path.orbit, ChiefOrbit):
        table = path.orbit.chief.table
        return chief_search, (table.form, table.errors, *path._segments, *other._segments)
    return pair_search, (path.arcs, path.offsets, other.arcs, other.offsets)


def tracks_of_all(paths: Path, zones: Sequence[Zone], pairs: int) -> dict[Zone, Tracks]:
    """Return the tracks of a batch for each zone, to search a number of pairs; empty if they do not pay."""
    if not isinstance(paths.orbit, ChiefOrbit):
        return follow(paths.arcs, paths.offsets, paths.arcs, paths.offsets, zones, pairs)
    return follow_segments(paths.orbit.chief.table, *paths._segments, zones, pairs)
