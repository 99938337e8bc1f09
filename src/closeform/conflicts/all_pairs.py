"""Screening: the conflicts among all pairs of many paths."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.entries import COLUMNS, conflicts_of_pairs
from closeform.conflicts.tracks import NO_TRACKS, Tracks, follow
from closeform.conflicts.two_paths import PairConflict, one_of
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.result import Rows
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import (
    TWICE,
    PairZones,
    by_zone,
    counts_covariances,
    made_by_need,
    pair_zones,
    pairs_of,
    portions,
    reach_of,
)
from closeform.zones.solids import Sphere
from closeform.zones.zone import Zone

CHUNK = 32_768  # pairs that one thread takes at a time
AHEAD = 2 * (os.cpu_count() or 1)
LONG = 5_000_000  # pairs from which on a progress bar is shown


@dataclass(frozen=True, eq=False, repr=False)
class Screening(Rows):
    """Conflicts among N paths, one row for each stay in a zone, sorted by pair, then start.

    Attributes
    ----------
    pairs : array of int of shape (M, 2)
        i < j, but for one zone that is not symmetric: then the first is within the zone around the second.
    start, end : array of shape (M,) [s]
        When each stay begins and ends, or the edge of the common time.
    time : array of shape (M,) [s]
        When the norm is least.
    ratio : array of shape (M,), no unit
        The least norm, below 1.
    """

    _columns: ClassVar = {
        "pairs": "first second",
        "start": "start_s",
        "end": "end_s",
        "time": "time_s",
        "ratio": "ratio",
    }

    pairs: Any
    start: Floats
    end: Floats
    time: Floats
    ratio: Floats

    def __len__(self) -> int:
        return len(self.ratio)

    @property
    def conflicts(self) -> tuple[PairConflict, ...]:
        """The same rows one by one, by index."""
        values = np.column_stack([self.start, self.end, self.time, self.ratio]).tolist()
        return tuple(
            PairConflict(*value, *pair) for value, pair in zip(values, self.pairs.tolist(), strict=True)
        )


def search_pairs(
    arcs: Floats,
    offsets: Any,
    others: Floats,
    other_offsets: Any,
    zone: Zone,
    first: Any,
    second: Any,
    tracks: Tracks | None = None,
) -> tuple[Any, Floats]:
    """Conflicts of some pairs, in order: their pairs (M, 2) and rows (M, 4) of start, end, time, ratio.

    `first` (P,) are among the bodies of `arcs`, `second` among those of `others`, which `tracks`
    follow; they are followed here if None are given and it pays.
    """
    if tracks is None:
        tracks = follow(arcs, offsets, others, other_offsets, (zone,), len(first))[zone]
    rows = np.empty((min(4096, 64 + len(first)), COLUMNS))
    done = np.zeros(2, dtype=np.int64)
    found = []
    while done[0] < len(first):
        before = done[0]
        count = conflicts_of_pairs(
            arcs,
            offsets,
            others,
            other_offsets,
            first,
            second,
            before,
            zone.form,
            *tracks,
            rows,
            done,
        )
        if count:
            found.append(rows[:count].copy())
        if done[0] == before:  # one pair has more conflicts than there are rows
            rows = np.empty((done[1], COLUMNS))
    if not found:
        return np.empty((0, 2), dtype=np.int64), np.empty((0, COLUMNS - 1))
    table = np.concatenate(found)
    index = table[:, 0].astype(np.int64)
    return np.stack([first[index], second[index]], axis=1), table[:, 1:]


def screen(
    paths: Path | Sequence[Path],
    zone: OwnZone | Sequence[OwnZone | None] | PairZones,
    errors: Any = None,
    sigmas: float = 3.0,
) -> Screening:
    """Every stay in a zone among all pairs of many paths, on all cores.

    Parameters
    ----------
    paths : Path or sequence of Path
        A Path of shape (N,), or N of single craft, in one orbit; times may differ.
    zone : Zone, Uncertainty, Body, None, sequence of these, or PairZones
        One is every craft's own, a sequence has one for each (None: none of its own).  Of two regions
        the larger holds, covariances and bodies are added; `PairZones` tell it themselves.  One region
        that is not symmetric is searched for both ways.
    errors : Errors, sequence of these, or None, default None
        Of the craft, independent: one for all or one for each, in order (None: where its path is).  Then a
        stay is as of `find_conflicts` with errors; hard bodies go into `zone`, as `Body(Sphere(radius))`.
    sigmas : float, no unit, default 3
        How many, where there are errors.

    Returns
    -------
    Screening
        Certified as by `find_conflicts`.

    Raises
    ------
    ValueError
        If `paths` are no Path of shape (N,) or in different orbits, or if `zone` is of another kind, of
        another number of craft, makes none for a pair, or holds an `Uncertainty` beside errors; if errors
        are of another kind or number, or `sigmas` is negative or not finite.

    Notes
    -----
    Most pairs are excluded by bounds on what each craft does between common times.  Half a million
    pairs take a tenth of a second on two cores and some megabytes.  A progress bar goes to standard
    error from five million pairs on, where that is a terminal.  Paths through samples are searched as
    they are: their `interpolation_error` says how far from them craft may be.  With errors the bounds hold
    the sigmas too; what they leave takes some tens of microseconds a pair.

    References
    ----------
    docs/theory.md section 3 and docs/theory.md (23).

    Examples
    --------
    >>> orbit = cf.Orbit(0.0)
    >>> places = np.array([[0, -50, 0, 0, 0, 0], [-50, 0, 0, 0, 0, 0.0]])
    >>> paths = orbit.transfer(places, -places, 100.0)
    >>> cf.screen(paths, cf.Sphere(5.0)).pairs.tolist()
    [[0, 1]]
    """
    batch = paths if isinstance(paths, Path) else stack(paths)
    if len(batch.shape) != 1:
        raise ValueError(f"paths: expected a Path of shape (N,), got shape {batch.shape}")
    count = len(batch)
    held = zone if isinstance(zone, Zone) else pair_zones("zone", zone, count)
    total = count * (count - 1) // 2
    pairs, rows = [np.empty((0, 2), dtype=np.int64)], [np.empty((0, COLUMNS - 1))]
    search = _search(batch, held, errors, sigmas)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for found, table in _shown(_ahead(pool, _jobs(held, batch, errors, sigmas), search), total):
            pairs.append(found)
            rows.append(table)
    who, table = np.concatenate(pairs), np.concatenate(rows)
    order = np.lexsort((table[:, 0], who[:, 1], who[:, 0]))
    return Screening(who[order], *np.ascontiguousarray(table[order].T))


def _jobs(zone: Zone | PairZones, paths: Path, errors: Any, sigmas: float) -> Iterator[tuple[Zone, Any, Any]]:
    """What is to be searched for, some pairs at a time: a zone, and who may be within whose."""
    if isinstance(zone, PairZones) and not made_by_need(zone):
        yield from portions(zone, CHUNK)
        return
    if isinstance(zone, PairZones):  # as many zones as pairs: they are made for those that come near
        reach = reach_of(zone)
        if reach > 0.0:
            first, second = np.unique(screen(paths, Sphere(reach), errors, sigmas).pairs, axis=0).T
            for k, some in by_zone(zone.which(first, second)):
                yield zone.zones[k], first[some], second[some]
        return
    for first, second in pairs_of(len(paths), CHUNK):
        yield zone, first, second
        if not zone.symmetric:
            yield zone, second, first


def _search(paths: Path, zone: Zone | PairZones, errors: Any, sigmas: float) -> Any:
    """What finds the rows of some pairs, of a zone and both indices."""
    zones = (zone,) if isinstance(zone, Zone) else () if made_by_need(zone) else tuple(zone.zones)
    given = errors if isinstance(errors, list | tuple) else [errors]
    known = one_of([("errors", one) for one in given])
    if known is not None:
        if isinstance(zone, PairZones) and counts_covariances(zone):
            raise ValueError(TWICE)
        return known._search_of(paths, errors, zones, sigmas)
    bodies = paths.arcs, paths.offsets
    tracks = follow(*bodies, *bodies, zones, len(paths) ** 2 // 2)
    return lambda one, first, second: search_pairs(
        *bodies, *bodies, one, first, second, tracks.get(one, NO_TRACKS)
    )


def _ahead(pool: ThreadPoolExecutor, jobs: Any, search: Any) -> Iterator[tuple[Any, Floats]]:
    """Results of the jobs in order, few of them under way at once."""
    waiting: deque[Any] = deque()
    for job in jobs:
        waiting.append(pool.submit(search, *job))
        if len(waiting) > AHEAD:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


def _shown(jobs: Any, total: int) -> Any:
    """The jobs' results, behind a progress bar where there are many."""
    if total < LONG:
        return jobs
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    steps = -(-total // CHUNK)
    return track(jobs, "screening pairs", total=steps, console=console, disable=not console.is_terminal)
