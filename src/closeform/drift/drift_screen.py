"""All pairs of a formation: who comes into whose zone when thrust fails."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import Floats
from closeform.drift.cells import SIDE, Side
from closeform.drift.drift_approach import failed_at, search_pairs
from closeform.drift.ends import checked_end
from closeform.drift.failures import Failure, ThrustLost
from closeform.drift.flown import MEETS
from closeform.drift.search import FAILURE, RATIO, TIME
from closeform.drift.sides import side_of
from closeform.motion.joining import stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.result import Rows
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones, pair_zones, pairs_of, portions
from closeform.zones.zone import Zone

ENOUGH = 5e-4  # of a zone: as precise as ratios of a screen are; to 1e-9 they take twice as long
CHUNK = 256  # pairs that one thread takes at a time


@dataclass(frozen=True, eq=False, repr=False)
class DriftScreening(Rows):
    """Who comes into whose zone when thrust fails, one row for each such pair, sorted by pair.

    Attributes
    ----------
    pairs : array of int of shape (M, 2)
        The craft that fails, and the one that it meets.
    failed_at : array of shape (M,) [s]
        When thrust fails for the worst.
    time : array of shape (M,) [s]
        When the norm is least then.
    ratio : array of shape (M,), no unit
        The least norm, at most 1, certain to 1e-3; `drift_approach` of the pair tells it to 1e-9.
    """

    _columns: ClassVar = {
        "pairs": "first second",
        "failed_at": "failed_at_s",
        "time": "time_s",
        "ratio": "ratio",
    }

    pairs: Any
    failed_at: Floats
    time: Floats
    ratio: Floats

    def __len__(self) -> int:
        return len(self.ratio)


def drift_screen(
    paths: Path | Sequence[Path],
    zone: OwnZone | Sequence[OwnZone | None] | PairZones,
    until: float,
    failure: Failure = ThrustLost(),  # noqa: B008 (it is frozen)
) -> DriftScreening:
    """Every pair of many craft in which the failure of one leads it into the zone of the other, on all cores.

    Parameters
    ----------
    paths : Path or sequence of Path
        A Path of shape (N,), or N of single craft, in one orbit.  Who does not fail flies on as planned,
        and coasts on after that.
    zone : Zone, Uncertainty, Body, None, sequence of these, or PairZones
        As of `screen`.
    until : float [s]
        The end of the drift, at the last end of the paths or later; finite.
    failure : ThrustLost, MissedBurns, WeakThrust or StuckThrust, default ThrustLost()
        What fails, in one craft at a time.

    Returns
    -------
    DriftScreening
        Certified: all other pairs are passively safe.

    Raises
    ------
    ValueError
        If `paths` are no Path of shape (N,) or in different orbits, `until` is before their ends or not
        finite, impulses would be stuck on, or `zone` is of another kind, of another number of craft, or
        makes none for a pair.

    References
    ----------
    docs/theory.md section 8; docs/passive_safety.md.
    """
    batch = paths if isinstance(paths, Path) else stack(paths)
    if len(batch.shape) != 1:
        raise ValueError(f"paths: expected a Path of shape (N,), got shape {batch.shape}")
    end = checked_end("paths", batch, until, failure)
    if end == np.inf:
        raise ValueError("until: expected a finite time in s, got inf; ask drift_approach pair by pair")
    held = zone if isinstance(zone, Zone) else pair_zones("zone", zone, len(batch))
    every = side_of(batch, failure, end), side_of(batch, None, end, carry_on=True)

    def search(job: tuple[Zone, Any, Any]) -> tuple[Any, Floats]:
        one, first, second = job
        fails, flies = (side._replace(now=side.now.copy()) for side in every)  # whom a search looks at
        unsafe, worst = worst_drifts(fails, flies, first, second, end, batch.orbit, one, ENOUGH)
        return np.stack([first[unsafe], second[unsafe]], axis=1), worst

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = list(pool.map(search, _directed(held, len(batch))))
    pairs = np.concatenate([np.empty((0, 2), dtype=np.int64), *(one for one, _ in found)])
    rows = np.concatenate([np.empty((0, 3)), *(row for _, row in found)])
    order = np.lexsort(pairs.T[::-1])
    return DriftScreening(pairs[order], *np.ascontiguousarray(rows[order].T))


def worst_drifts(
    fails: Side, flies: Side, first: Any, second: Any, end: float, orbit: Orbit, zone: Zone, certain: float
) -> tuple[Any, Floats]:
    """Which pairs are not passively safe; of each (U, 3) when its worst failure is, when it is met, its norm.

    One search tells both: the least norm is looked for where any is within the zone.
    """
    rows = search_pairs(fails, flies, first, second, end, orbit, zone, certain, MEETS)
    unsafe = np.flatnonzero(np.isfinite(rows[:, RATIO]))
    unsure = unsafe[np.isnan(rows[unsafe, TIME])]
    rows[unsure] = search_pairs(
        fails, flies, first[unsure], second[unsure], end, orbit, zone, certain, np.inf
    )
    at = failed_at(fails, rows[unsafe, FAILURE + SIDE :], first[unsafe])
    return unsafe, np.stack([at, rows[unsafe, TIME], rows[unsafe, RATIO]], axis=1)


def _directed(zone: Zone | PairZones, count: int) -> Iterator[tuple[Zone, Any, Any]]:
    """Zones, who fails, and who flies on: each pair both ways."""
    if isinstance(zone, PairZones):
        for one, first, second in portions(zone, CHUNK):
            yield one, first, second
            yield one.mirrored, second, first
        return
    for first, second in pairs_of(count, CHUNK):
        for one in (zone,) if zone.symmetric else (zone, zone.mirrored):
            yield one, first, second
            yield one, second, first
