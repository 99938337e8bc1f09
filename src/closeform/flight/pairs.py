"""Conflicts, closest approach, avoidance and passive safety by the flight core.

Each function has a counterpart that returns the structure in C, with the number of evaluations used.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan
from typing import Any

import numpy as np

from closeform.conflicts.two_paths import Approach, Conflict, check_comparable
from closeform.flight.library import check, complete, core
from closeform.flight.motion import arcs_of, path_of
from closeform.flight.table import chief_of
from closeform.motion.path import Path
from closeform.zones.zone import Zone

AVOID_BUDGET = 4_000_000  # evaluations of an avoidance, which is not continued
ROOM = 16  # conflicts in one call; more are found by the next


def zone_of(zone: Zone) -> Any:
    """Return the `cff_zone_t *` of a zone."""
    return core().types.new("cff_zone_t *", {"shape": zone.shape, "to_unit_per_m": zone.matrix.tolist()})


def pair_of(path: Path, other: Path, zone: Zone, span: float = 0.0) -> tuple[Any, Any, Any]:
    """Return two paths and their zone as the flight core reads them; `span` as in `chief_of`."""
    check_comparable(path, other, zone)
    chief = chief_of(path.orbit, span)
    return path_of(path, chief), path_of(other, chief), zone_of(zone)


def conflict_search(one: Any, two: Any, zone: Any) -> tuple[list[tuple[float, float]], Any]:
    """Return start and end of every conflict, and the finished `cff_conflict_search_t *`."""
    types, functions = core()
    search, count = types.new("cff_conflict_search_t *"), types.new("uint32_t *")
    rows = types.new("cff_conflict_t[]", ROOM)
    found: list[tuple[float, float]] = []

    def more(budget: int) -> int:
        count[0] = 0
        status: int = functions.cff_conflicts_continue(search, budget, rows, ROOM, count)
        found.extend((row.start_s, row.end_s) for row in rows[0 : count[0]])
        return status

    if check(functions.cff_conflicts_begin(search, one, two, zone), "NO_COMMON_TIME") == "OK":
        complete(more)
    return found, search


def nearest(one: Any, two: Any, zone: Any, start: float, end: float) -> Any:
    """Return the `cff_approach_t *` from `start` to `end`."""
    approach = core().types.new("cff_approach_t *")
    call = core().functions.cff_closest_approach
    complete(lambda budget: call(one, two, zone, start, end, budget, approach))
    return approach


def find_conflicts(path: Path, other: Path, zone: Zone) -> tuple[Conflict, ...]:
    """Return every conflict of two spacecraft.

    Parameters
    ----------
    path, other : Path
        Paths of one spacecraft each, in the same orbit.
    zone : Zone
        Zone of the pair.

    Returns
    -------
    tuple of Conflict
        Conflicts in order of time, as `closeform.find_conflicts` returns them.
    """
    pair = pair_of(path, other, zone)
    spans, _ = conflict_search(*pair)
    least = [nearest(*pair, *span) for span in spans]
    return tuple(Conflict(*span, near.time_s, near.ratio) for span, near in zip(spans, least, strict=True))


def closest_approach(path: Path, other: Path, zone: Zone) -> Approach:
    """Return the closest approach of two spacecraft over their common time.

    Parameters
    ----------
    path, other : Path
        Paths of one spacecraft each, in the same orbit.
    zone : Zone
        Zone of the pair, which defines the norm.

    Returns
    -------
    Approach
        Closest approach, as `closeform.closest_approach` returns it.
    """
    pair = pair_of(path, other, zone)
    start, end = max(path.start, other.start), min(path.end, other.end)
    if end < start:
        return Approach(nan, inf, inf)
    near = nearest(*pair, start, end)
    apart = path.state(near.time_s)[:3] - other.state(near.time_s)[:3]
    return Approach(near.time_s, near.ratio, float(np.linalg.norm(apart)))


def avoidance(
    path: Path, obstacles: Sequence[Path], zones: Sequence[Zone], budget: int = AVOID_BUDGET
) -> tuple[str, Any]:
    """Return the status of a plan around obstacles, and its `cff_avoidance_t *`."""
    types, functions = core()
    for other, each in zip(obstacles, zones, strict=True):
        check_comparable(path, other, each)
    chief = chief_of(path.orbit)
    direct, *others = [path_of(one, chief) for one in (path, *obstacles)]
    paths = types.new("cff_path_t[]", [other[0] for other in others])
    around = types.new("cff_zone_t[]", [zone_of(each)[0] for each in zones])
    found, work = types.new("cff_avoidance_t *"), types.new("cff_avoid_work_t *")
    status = functions.cff_avoid(direct.arcs, paths, around, len(others), budget, work, found)
    return check(status, "NO_PLAN", "END_INSIDE", "CROWDED", "MORE"), found


def avoid(
    path: Path, obstacles: Path | Sequence[Path], zone: Zone | Sequence[Zone]
) -> tuple[Path | None, str]:
    """Return a path of minimum energy around obstacles.

    Parameters
    ----------
    path : Path
        Path of one arc, a transfer or a coast; its end states and times are kept.
    obstacles : Path or sequence of Path
        One path or several, of one spacecraft each, in the same orbit, which last as long.
    zone : Zone or sequence of Zone
        Ellipsoid or sphere, for all or for each obstacle.

    Returns
    -------
    shaped : Path or None
        Certified clear path; None if none was found.
    status : str
        "OK", or the reason: "NO_PLAN", "END_INSIDE", "CROWDED" or "MORE" (budget spent).
    """
    others = [obstacles] if isinstance(obstacles, Path) else list(obstacles)
    around = [zone] * len(others) if isinstance(zone, Zone) else list(zone)
    if len(others) != len(around):
        raise ValueError(f"zone: expected one for all or each of {len(others)} obstacles, got {len(around)}")
    status, found = avoidance(path, others, around)
    return (arcs_of(path.orbit, found.arcs, found.count) if status == "OK" else None), status


def loss_of_thrust(path: Path, other: Path, zone: Zone, until: float) -> Any:
    """Return the `cff_drift_t *` that follows a loss of thrust at any instant of a path."""
    types, functions = core()
    pair = pair_of(path, other, zone, until - float(path.start))
    found = types.new("cff_drift_t *", {"certified_until_s": path.start})
    complete(
        lambda budget: functions.cff_loss_of_thrust(
            *pair, found.certified_until_s, float(until), budget, found
        )
    )
    return found


def passively_safe(path: Path, other: Path, zone: Zone, until: float) -> bool:
    """Return True if no loss of thrust, at any instant, causes an entry into the zone.

    Parameters
    ----------
    path : Path
        Path of one spacecraft, which fails; with thrust of minimum energy or constant thrust.
    other : Path
        Path of the spacecraft that the zone is around, in the same orbit, until `until`.
    zone : Zone
        Zone of the pair.
    until : float [s]
        End of the drift, in the time of the paths.

    Returns
    -------
    bool
        True if no loss of thrust causes an entry into the zone; certified. False if one does, or leads so
        close to its surface that rounding decides.
    """
    return bool(loss_of_thrust(path, other, zone, until).verdict == core().functions.CFF_SAFE)
