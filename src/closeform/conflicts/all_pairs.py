"""Screening: the conflicts among all pairs of many paths."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, numbers, sequence, shown, size
from closeform.conflicts.batches import ahead, chunks, rounds, sieve_of
from closeform.conflicts.pair_rows import conflicts_of, tracks_of_all
from closeform.conflicts.pair_search import COLUMNS
from closeform.conflicts.tracks import NO_TRACKS
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
    reach_of,
)
from closeform.zones.solids import Sphere
from closeform.zones.zone import Zone

NO_PAIRS = np.empty((0, 2), dtype=np.int64)


@dataclass(frozen=True, eq=False, repr=False)
class Screening(Rows):
    """Conflicts among N paths, one row for each, sorted by pair, then start.

    Attributes
    ----------
    pairs : array of int of shape (M, 2)
        Indices i < j; for one zone that is not symmetric the first is inside the zone around the second.
    start, end : array of shape (M,) [s]
        Start and end of each conflict, or the edge of the common time.
    time : array of shape (M,) [s]
        Time of the minimum norm.
    ratio : array of shape (M,), no unit
        Clearance ratio: the minimum norm, below 1.
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

    @classmethod
    def joined(cls, parts: Sequence[Screening]) -> Self:
        """Join screenings of consecutive time spans into one.

        Parameters
        ----------
        parts : sequence of Screening
            Screenings of the same spacecraft over spans that do not overlap, in any order.

        Returns
        -------
        Screening
            Conflicts of all spans.

        Raises
        ------
        ValueError
            If `parts` is not a sequence, or contains another type.

        References
        ----------
        docs/conflicts.md.
        """
        given = sequence("parts", parts, Screening)
        return cls._of([(one.pairs, np.stack([one.start, one.end, one.time, one.ratio], 1)) for one in given])

    @classmethod
    def _of(cls, found: Sequence[tuple[Any, Floats]]) -> Self:
        """Return the screening of pairs (M, 2) and rows (M, 4) of start, end, time, ratio, in any order."""
        pairs = np.concatenate([NO_PAIRS, *(some for some, _ in found)])
        rows = np.concatenate([np.empty((0, COLUMNS - 1)), *(row for _, row in found)])
        order = np.lexsort((rows[:, 0], pairs[:, 1], pairs[:, 0]))
        return cls(pairs[order], *np.ascontiguousarray(rows[order].T))

    def __len__(self) -> int:
        return len(self.ratio)

    @property
    def conflicts(self) -> tuple[PairConflict, ...]:
        """Rows as one conflict each, by index."""
        values = np.column_stack([self.start, self.end, self.time, self.ratio]).tolist()
        return tuple(
            PairConflict(*value, *pair) for value, pair in zip(values, self.pairs.tolist(), strict=True)
        )


def screen(
    paths: Path | Sequence[Path],
    zone: OwnZone | Sequence[OwnZone | None] | PairZones,
    errors: Any = None,
    sigmas: float = 3.0,
    span: ArrayLike = (-inf, inf),
) -> Screening:
    """Return every conflict among all pairs of many paths, computed on all cores.

    Parameters
    ----------
    paths : Path or sequence of Path
        A Path of shape (N,), or N paths of single spacecraft, in one orbit. Times may differ: each pair is
        searched while both have a path, and `Path.extended` lets all end together.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones
        One zone is the own zone of every spacecraft, a sequence has one for each (None: no own zone).
        Of two regions the larger applies; covariances and bodies add; `PairZones` defines the zone of
        each pair. One region that is not symmetric is searched in both directions.
    errors : Uncertainty, sequence of these, or None, default None
        Independent errors of the spacecraft: one for all or one for each, in order (None: no error).
        A conflict is then as in `find_conflicts` with errors; hard bodies go into `zone` as
        `Body(Sphere(radius))`.
    sigmas : float, no unit, default 3
        Number of standard deviations, if there are errors.
    span : array_like of shape (2,) [s], default always
        Only conflicts that begin at the first time or later and before the second. Consecutive spans
        distribute the work over computers: `Screening.joined` combines their results.

    Returns
    -------
    Screening
        Conflicts, certified as in `find_conflicts`.

    Raises
    ------
    ValueError
        If `paths` is not a Path of shape (N,) or is in different orbits, or if `zone` is of another
        type, for another number of spacecraft, makes no zone for a pair, or contains a
        `CovarianceZone` together with errors; if errors are of another type or number, `sigmas` is
        negative or not finite, or `span` is not two times in order.

    Notes
    -----
    Most pairs are excluded by bounds on each spacecraft's motion between common times. For two thousand
    spacecraft or more a tree of boxes around these bounds finds the pairs that can meet, without a loop
    over pairs: the run time grows with the number of spacecraft, not of pairs, as long as each has few
    others near it at a time. Memory grows with the number of spacecraft and conflicts. A long screening
    shows a progress bar on standard error if that is a terminal. Paths through samples are searched as
    they are; their `interpolation_error` estimates the distance of the spacecraft from them. With errors
    every pair is tested, the bounds include the sigmas, and a pair that remains takes a few tens of
    microseconds.

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
    begin, before = checked_span(span)
    sigmas = size("sigmas", sigmas)
    held = zone if isinstance(zone, Zone) else pair_zones("zone", zone, len(batch))
    known = _known(held, errors)
    sieve = sieve_of(batch, held) if known is None else None
    zones = _zones(held)
    search = _search(batch, zones, known, errors, sigmas, sieve is None)
    found = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for since, until, pairs in rounds(sieve, len(batch), pool, begin, before):
            if isinstance(held, PairZones) and made_by_need(held):  # make zones only for pairs that come near
                near = [some for one in zones for some, _ in ahead(pool, _jobs(one, pairs), search)]
                pairs = chunks(*np.unique(np.concatenate([NO_PAIRS, *near]), axis=0).T)
            for found_pairs, rows in ahead(pool, _jobs(held, pairs), search):
                some = (since <= rows[:, 0]) & (rows[:, 0] < until)
                found.append((found_pairs[some], rows[some]))
    return Screening._of(found)


def checked_span(span: Any) -> tuple[float, float]:
    """Return the span in which conflicts begin, as two floats; raise ValueError if it is invalid."""
    times = numbers("span", span)
    if times.shape != (2,) or not times[0] < times[1]:
        raise ValueError(
            "span: expected two times in s, the first before the second, "
            f"got {shown(span)}; leave it out for all"
        )
    return float(times[0]), float(times[1])


def _zones(zone: Zone | PairZones) -> tuple[Zone, ...]:
    """Return the zones to search for; a single ball if there may be as many zones as pairs."""
    if isinstance(zone, Zone):
        return (zone,)
    if made_by_need(zone):
        reach = reach_of(zone)
        return (Sphere(reach),) if reach > 0.0 else ()
    return tuple(zone.zones)


def _jobs(zone: Zone | PairZones, pairs: Any) -> Iterator[tuple[Zone, Any, Any]]:
    """Yield each zone, and the pairs in which the first spacecraft may be inside that zone of the second."""
    for first, second in pairs:
        if isinstance(zone, PairZones):
            for k, some in by_zone(zone.which(first, second)):
                yield zone.zones[k], first[some], second[some]
            continue
        yield zone, first, second
        if not zone.symmetric:
            yield zone, second, first


def _known(zone: Zone | PairZones, errors: Any) -> Any:
    """Return the errors of any spacecraft, or None if there are none."""
    given = errors if isinstance(errors, list | tuple) else [errors]
    known = one_of([("errors", one) for one in given])
    if known is not None and isinstance(zone, PairZones) and counts_covariances(zone):
        raise ValueError(TWICE)
    return known


def _search(paths: Path, zones: tuple[Zone, ...], known: Any, errors: Any, sigmas: float, every: bool) -> Any:
    """Return the function that finds the rows of pairs, given a zone and both indices."""
    if known is not None:
        return known._search_of(paths, errors, zones, sigmas)
    tracks = tracks_of_all(paths, zones, len(paths) ** 2 // 2 if every else 0)
    return lambda one, first, second: conflicts_of(
        paths, paths, one, first, second, tracks.get(one, NO_TRACKS)
    )
