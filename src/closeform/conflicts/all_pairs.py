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
from closeform.conflicts.pair_search import COLUMNS, conflicts_of_pairs
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
    reach_of,
)
from closeform.zones.solids import Sphere
from closeform.zones.zone import Zone

NO_PAIRS = np.empty((0, 2), dtype=np.int64)


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

    @classmethod
    def joined(cls, parts: Sequence[Screening]) -> Self:
        """What was screened span by span, as one screening.

        Parameters
        ----------
        parts : sequence of Screening
            Of the same craft, of spans that share no time, in any order.

        Returns
        -------
        Screening
            As of all spans at once.

        Raises
        ------
        ValueError
            If `parts` is no sequence, or holds something else.

        References
        ----------
        docs/conflicts.md.
        """
        given = sequence("parts", parts, Screening)
        return cls._of([(one.pairs, np.stack([one.start, one.end, one.time, one.ratio], 1)) for one in given])

    @classmethod
    def _of(cls, found: Sequence[tuple[Any, Floats]]) -> Self:
        """Of pairs (M, 2) and their rows (M, 4) of start, end, time, ratio, in any order."""
        pairs = np.concatenate([NO_PAIRS, *(who for who, _ in found)])
        rows = np.concatenate([np.empty((0, COLUMNS - 1)), *(row for _, row in found)])
        order = np.lexsort((rows[:, 0], pairs[:, 1], pairs[:, 0]))
        return cls(pairs[order], *np.ascontiguousarray(rows[order].T))

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
    span: ArrayLike = (-inf, inf),
) -> Screening:
    """Every stay in a zone among all pairs of many paths, on all cores.

    Parameters
    ----------
    paths : Path or sequence of Path
        A Path of shape (N,), or N of single craft, in one orbit; times may differ.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones
        One is every craft's own, a sequence has one for each (None: none of its own).  Of two regions
        the larger holds, covariances and bodies are added; `PairZones` tell it themselves.  One region
        that is not symmetric is searched for both ways.
    errors : Uncertainty, sequence of these, or None, default None
        Of the craft, independent: one for all or one for each, in order (None: where its path is).  Then a
        stay is as of `find_conflicts` with errors; hard bodies go into `zone`, as `Body(Sphere(radius))`.
    sigmas : float, no unit, default 3
        How many, where there are errors.
    span : array_like of shape (2,) [s], default always
        Only stays that begin from the first time on and before the second.  Spans that follow each other
        share the work between computers: `Screening.joined` makes one answer of theirs.

    Returns
    -------
    Screening
        Certified as by `find_conflicts`.

    Raises
    ------
    ValueError
        If `paths` are no Path of shape (N,) or in different orbits, or if `zone` is of another kind, of
        another number of craft, makes none for a pair, or holds an `Uncertainty` beside errors; if errors
        are of another kind or number, `sigmas` is negative or not finite, or `span` is not two times in
        order.

    Notes
    -----
    Most pairs are excluded by bounds on what each craft does between common times.  Of two thousand craft
    or more a tree of boxes that hold those bounds finds who can meet at all, and nobody asks pair by pair:
    time grows with the craft, not with their pairs, as long as each has few near it at a time.  Memory grows
    with the craft and the stays.  A progress bar goes to standard error where many are screened, and that is
    a terminal.  Paths through samples are searched as they are: their `interpolation_error` says how far
    from them craft may be.  With errors every pair is asked, the bounds hold the sigmas too, and what they
    leave takes some tens of microseconds a pair.

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
            if isinstance(held, PairZones) and made_by_need(held):  # zones are made for those that come near
                near = [who for one in zones for who, _ in ahead(pool, _jobs(one, pairs), search)]
                pairs = chunks(*np.unique(np.concatenate([NO_PAIRS, *near]), axis=0).T)
            for who, rows in ahead(pool, _jobs(held, pairs), search):
                some = (since <= rows[:, 0]) & (rows[:, 0] < until)
                found.append((who[some], rows[some]))
    return Screening._of(found)


def checked_span(span: Any) -> tuple[float, float]:
    """When stays begin that are asked for."""
    times = numbers("span", span)
    if times.shape != (2,) or not times[0] < times[1]:
        raise ValueError(
            "span: expected two times in s, the first before the second, "
            f"got {shown(span)}; leave it out for all"
        )
    return float(times[0]), float(times[1])


def _zones(zone: Zone | PairZones) -> tuple[Zone, ...]:
    """Those that all pairs are searched for: a ball around as many zones as pairs."""
    if isinstance(zone, Zone):
        return (zone,)
    if made_by_need(zone):
        reach = reach_of(zone)
        return (Sphere(reach),) if reach > 0.0 else ()
    return tuple(zone.zones)


def _jobs(zone: Zone | PairZones, pairs: Any) -> Iterator[tuple[Zone, Any, Any]]:
    """What is to be searched for, some pairs at a time: a zone, and who may be within whose."""
    for first, second in pairs:
        if isinstance(zone, PairZones):
            for k, some in by_zone(zone.which(first, second)):
                yield zone.zones[k], first[some], second[some]
            continue
        yield zone, first, second
        if not zone.symmetric:
            yield zone, second, first


def _known(zone: Zone | PairZones, errors: Any) -> Any:
    """Some craft's errors; None if there are none."""
    given = errors if isinstance(errors, list | tuple) else [errors]
    known = one_of([("errors", one) for one in given])
    if known is not None and isinstance(zone, PairZones) and counts_covariances(zone):
        raise ValueError(TWICE)
    return known


def _search(paths: Path, zones: tuple[Zone, ...], known: Any, errors: Any, sigmas: float, every: bool) -> Any:
    """What finds the rows of some pairs, or of `every` pair, of a zone and both indices."""
    if known is not None:
        return known._search_of(paths, errors, zones, sigmas)
    bodies = paths.arcs, paths.offsets
    tracks = follow(*bodies, *bodies, zones, len(paths) ** 2 // 2 if every else 0)
    return lambda one, first, second: search_pairs(
        *bodies, *bodies, one, first, second, tracks.get(one, NO_TRACKS)
    )
