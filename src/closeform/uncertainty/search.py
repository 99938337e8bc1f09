"""Conflict search of paths with uncertainty, for `find_conflicts` and `screen`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats, shown, size
from closeform.conflicts.pair_search import COLUMNS
from closeform.conflicts.tracks import NO_TRACKS, Tracks, follow
from closeform.motion.path import Path
from closeform.uncertainty.sigma_conflicts import sigma_conflicts_of_pairs
from closeform.uncertainty.spread import Spread
from closeform.uncertainty.tube import tube_for
from closeform.uncertainty.widths import widened
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty


def sigma_conflicts(
    one: Spread,
    two: Spread,
    first: Any,
    second: Any,
    zone: Zone,
    mean_motion: float,
    sigmas: float,
    tracks: Tracks = NO_TRACKS,
) -> Floats:
    """Return the conflicts of pairs `first` and `second` (P,) of two batches, as sorted rows.

    Columns: pair, start, end, time of the minimum, ratio.
    """
    rows = np.empty((min(4096, 16 + len(first)), COLUMNS))
    done = np.zeros(2, dtype=np.int64)
    tube = tube_for(zone, mean_motion)
    found = [np.empty((0, COLUMNS))]
    while done[0] < len(first):
        before = int(done[0])
        count = sigma_conflicts_of_pairs(one, two, first, second, before, tube, sigmas, *tracks, rows, done)
        found.append(rows[:count].copy())
        if done[0] == before:  # one pair has more conflicts than there are rows
            rows = np.empty((done[1], COLUMNS))
    return np.concatenate(found)


def one_for_each(name: str, errors: Any, path: Path, kind: Any) -> list[Uncertainty | None]:
    """Return the uncertainties of the craft of a batch from one for all, or one for each."""
    return given_errors(name, errors, len(path.offsets) - 1, kind)


def given_errors(name: str, errors: Any, count: int, kind: Any) -> list[Uncertainty | None]:
    """Return the uncertainties of `count` craft; None for an exact craft."""
    given = list(errors) if isinstance(errors, list | tuple) else [errors] * count
    for one in given:
        if not (one is None or isinstance(one, kind)):
            raise ValueError(f"{name}: expected Uncertainty, got {shown(one)}")
    if len(given) != count:
        raise ValueError(f"{name}: {len(given)} for {count} craft; give one, or one for each")
    return given


def sigma_conflicts_of_two(one: Spread, two: Spread, zone: Zone, mean_motion: float, sigmas: Any) -> Floats:
    """Return the conflicts of two craft, as rows."""
    first = np.zeros(1, dtype=np.int64)
    return sigma_conflicts(one, two, first, first, zone, mean_motion, size("sigmas", sigmas))


def search_of(spread: Spread, zones: Sequence[Zone], mean_motion: float, sigmas: float) -> Any:
    """Return a function that finds the conflicts of the given pairs of a batch with a zone.

    `zones`: the zones that most pairs have.
    """
    bodies = spread.arcs, spread.offsets
    followed = follow(*bodies, *bodies, zones, (len(spread.offsets) - 1) ** 2 // 2)
    tracks = {zone: widened(followed[zone], spread, zone, mean_motion, sigmas) for zone in zones}

    def search(zone: Zone, first: Any, second: Any) -> tuple[Any, Floats]:
        near = tracks.get(zone, NO_TRACKS)
        rows = sigma_conflicts(spread, spread, first, second, zone, mean_motion, sigmas, near)
        index = rows[:, 0].astype(np.int64)
        return np.stack([first[index], second[index]], axis=1), rows[:, 1:]

    return search
