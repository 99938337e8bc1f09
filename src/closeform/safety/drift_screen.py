"""Screening of all pairs of a formation for conflicts after a failure of thrust."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from closeform.arrays import Floats, shown
from closeform.motion.joining import stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.result import Rows
from closeform.safety.drift_approach import checked_end, failures_at, search_pairs, soon_after
from closeform.safety.failure_cells import Side, side_of
from closeform.safety.failure_search import LOWER, RATIO, TIME
from closeform.safety.failures import Failure, ThrustLost
from closeform.safety.single_failures import MEETS
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones, pair_zones, pairs_of, portions
from closeform.zones.solids import Sphere
from closeform.zones.zone import Zone

ENOUGH = 5e-4  # of a zone: the precision of a screening's ratios; 1e-9 takes twice as long
CHUNK = 256  # pairs that one thread takes at a time


@dataclass(frozen=True, eq=False, repr=False)
class DriftScreening(Rows):
    """Pairs with a conflict after a failure of thrust, one row for each pair, sorted by pair.

    Attributes
    ----------
    pairs : array of int of shape (M, 2)
        The spacecraft that fails, and the one that it meets; where both fail the lower index is first.
    failed_at : array of shape (M,) [s]
        Time of the worst failure; (M, 2) where both fail.
    time : array of shape (M,) [s]
        Time of the minimum norm after it; inf where ever slower drifts approach it as a limit.
    ratio : array of shape (M,), no unit
        Clearance ratio, the minimum norm found: accurate to 1e-3, and to 1e-9 by `drift_approach` of the
        pair. It is less accurate where failures with many unknowns, or drift without an end, need more cells
        than are searched; it is above 1 where a conflict remains possible but undecided.
    """

    _columns: ClassVar = {
        "pairs": "first second",
        "failed_at": "failed_at_s other_failed_at_s",
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
    failing: Literal["either", "both"] = "either",
) -> DriftScreening:
    """Return every pair of many spacecraft with a conflict after a failure, computed on all cores.

    Parameters
    ----------
    paths : Path or sequence of Path
        A Path of shape (N,), or N paths of single spacecraft, in one orbit.  A spacecraft that does not fail
        continues as planned, and coasts after its end.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones
        Own zones or zones of pairs, as for `screen`.
    until : float [s]
        End of the drift, at the last end of the paths or later; inf means a million orbits.
    failure : ThrustLost, MissedBurns, DegradedThrust or StuckOnThrust, default ThrustLost()
        Failure of thrust.
    failing : {"either", "both"}, default "either"
        Which spacecraft of a pair fails: one while the other continues, in turn, or both, each at its
        own instant.

    Returns
    -------
    DriftScreening
        Pairs with a conflict, certified: all other pairs are passively safe.

    Raises
    ------
    ValueError
        If `paths` is not a Path of shape (N,) or is in different orbits, `until` is before their
        ends, impulses would be stuck on, `failing` is unknown, or `zone` is of another type, for
        another number of spacecraft, or makes none for a pair.

    References
    ----------
    docs/theory.md section 8; docs/passive_safety.md.
    """
    batch = paths if isinstance(paths, Path) else stack(paths)
    if len(batch.shape) != 1:
        raise ValueError(f"paths: expected a Path of shape (N,), got shape {batch.shape}")
    end = checked_end("paths", batch, until, failure)
    if not isinstance(failing, str) or failing not in ("either", "both"):
        raise ValueError(f"failing: expected 'either' or 'both', got {shown(failing)}")
    held = zone if isinstance(zone, Zone) else pair_zones("zone", zone, len(batch))
    for_ever, both = end == np.inf, failing == "both"
    soon = soon_after(batch, batch) if for_ever else end
    fails = side_of(batch, failure, soon, carry_on=True)
    sides = fails, fails if both else side_of(batch, None, soon, carry_on=True)

    def search(job: tuple[Zone, Any, Any]) -> tuple[Any, ...]:
        one, first, second = job
        pair = first, second, soon, batch.orbit
        unsafe, rows = worst_drifts(sides, *pair, one, ENOUGH, for_ever)
        craft = first[unsafe], second[unsafe]
        at = failures_at("both" if both else "path", rows, sides, craft)
        return np.stack(craft, axis=1), at, rows[:, TIME], rows[:, RATIO]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = list(pool.map(search, _asked(held, len(batch), both)))
    if not found:
        found = [search((Sphere(1.0), *np.empty((2, 0), dtype=np.int64)))]
    columns = [np.concatenate(column) for column in zip(*found, strict=True)]
    order = np.lexsort(columns[0].T[::-1])
    return DriftScreening(*(column[order] for column in columns))


def worst_drifts(
    sides: tuple[Side, Side],
    first: Any,
    second: Any,
    end: float,
    orbit: Orbit,
    zone: Zone,
    certain: float,
    for_ever: bool = False,
) -> tuple[Any, Floats]:
    """Return the pairs that are not passively safe, and the rows of `worst_failures` for these.

    For a drift with an end, one search finds both; the minimum norm is searched only for pairs in the zone.
    """
    judged = 0.0 if for_ever else certain
    rows = search_pairs(*sides, first, second, end, orbit, zone, judged, MEETS, for_ever)
    unsafe = np.flatnonzero(np.isfinite(rows[:, RATIO]))
    unsure = unsafe if for_ever else unsafe[np.isnan(rows[unsafe, TIME])]
    rows[unsure] = search_pairs(
        *sides, first[unsure], second[unsure], end, orbit, zone, certain, np.inf, for_ever
    )
    unsafe = unsafe[rows[unsafe, LOWER] <= 1.0]
    return unsafe, rows[unsafe]


def _asked(zone: Zone | PairZones, count: int, both: bool) -> Iterator[tuple[Zone, Any, Any]]:
    """Yield zones with the spacecraft that fails and the other, each pair both ways, or once for `both`."""
    if isinstance(zone, PairZones):
        held: Any = ((one, first, second) for one, first, second in portions(zone, CHUNK))
    else:
        around = (zone,) if zone.symmetric else (zone, zone.mirrored)
        held = ((one, *pair) for pair in pairs_of(count, CHUNK) for one in around)
    for one, first, second in held:
        yield one, first, second
        if not both:
            yield one.mirrored, second, first
