"""Conflicts, closest approach and avoidance of a pair by the flight core."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import numpy as np

from closeform.conflicts.two_paths import Approach, Conflict, check_comparable
from closeform.flight.library import BUDGET, check, core, filled
from closeform.flight.motion import Chief, chief_of
from closeform.motion.path import Path
from closeform.zones.zone import Zone

ROOM = 16  # conflicts in one call; more are found by the next


def path_of(path: Path, chief: Chief) -> tuple[Any, Any]:
    """Return a path of one spacecraft as the flight core reads it, and its arcs, which must live as long."""
    if path.shape:
        raise ValueError(f"path: the flight core takes one spacecraft at a time, got shape {path.shape}")
    arcs = filled("cff_arc_t[]", path.arcs)
    return core().types.new("cff_path_t *", (arcs, len(path.arcs), chief.pointer)), arcs


def zone_of(zone: Zone) -> Any:
    """Return a zone as the flight core reads it."""
    return core().types.new("cff_zone_t *", {"shape": zone.shape, "to_unit_per_m": zone.matrix.tolist()})


def find_conflicts(path: Path, other: Path, zone: Zone) -> tuple[Conflict, ...]:
    """Return every conflict of two spacecraft, found by the flight core.

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

    Raises
    ------
    RuntimeError
        If there is no C compiler or no cffi.
    ValueError
        If a path is a batch, the orbits differ, or the flight core does not know the kind of zone.

    References
    ----------
    docs/on_board.md.
    """
    check_comparable(path, other, zone)
    types, functions = core()
    chief = chief_of(path.orbit)
    (one, _one), (two, _two), kept = path_of(path, chief), path_of(other, chief), zone_of(zone)
    search, count = types.new("cff_conflict_search_t *"), types.new("uint32_t *")
    rows = types.new("cff_conflict_t[]", ROOM)
    found = []
    status = check(functions.cff_conflicts_begin(search, one, two, kept), "NO_COMMON_TIME")
    while status != "NO_COMMON_TIME":
        count[0] = 0
        status = check(functions.cff_conflicts_continue(search, BUDGET, rows, ROOM, count), "MORE", "FULL")
        found += [(row.start_s, row.end_s) for row in rows[0 : count[0]]]
        if status == "OK":
            break
    return tuple(Conflict(*span, *least(one, two, kept, *span)) for span in found)


def least(one: Any, two: Any, zone: Any, start: float, end: float) -> tuple[float, float]:
    """Return the time and the ratio of the closest approach from `start` to `end`."""
    approach = core().types.new("cff_approach_t *")
    budget, status = BUDGET, "MORE"
    while status == "MORE":
        status = check(
            core().functions.cff_closest_approach(one, two, zone, start, end, budget, approach), "MORE"
        )
        budget *= 2
    return approach.time_s, approach.ratio


def closest_approach(path: Path, other: Path, zone: Zone) -> Approach:
    """Return the closest approach of two spacecraft over their common time, found by the flight core.

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

    Raises
    ------
    RuntimeError
        If there is no C compiler or no cffi.
    ValueError
        If a path is a batch, the orbits differ, or the flight core does not know the kind of zone.

    References
    ----------
    docs/on_board.md.
    """
    check_comparable(path, other, zone)
    chief = chief_of(path.orbit)
    (one, _one), (two, _two) = path_of(path, chief), path_of(other, chief)
    start, end = max(path.start, other.start), min(path.end, other.end)
    if end < start:
        return Approach(nan, inf, inf)
    time, ratio = least(one, two, zone_of(zone), start, end)
    apart = path.state(time)[:3] - other.state(time)[:3]
    return Approach(time, ratio, float(np.linalg.norm(apart)))
