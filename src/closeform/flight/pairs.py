"""Conflicts, closest approach, avoidance and passive safety by the flight core."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan
from typing import Any

import numpy as np

from closeform.conflicts.two_paths import Approach, Conflict, check_comparable
from closeform.flight.library import BUDGET, check, core, doubles, filled
from closeform.flight.motion import Chief, chief_of
from closeform.motion.arc import WIDTH
from closeform.motion.path import Path
from closeform.zones.zone import Zone

AVOID_BUDGET = 4_000_000  # evaluations of an avoidance, which is not continued
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


def avoid(
    path: Path, obstacles: Path | Sequence[Path], zone: Zone | Sequence[Zone]
) -> tuple[Path | None, str]:
    """Return a path of minimum energy around obstacles, planned by the flight core.

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

    Raises
    ------
    RuntimeError
        If there is no C compiler or no cffi.
    ValueError
        If a path is a batch, the orbits differ, or the flight core does not take the paths or zones.

    References
    ----------
    docs/on_board.md.
    """
    types, functions = core()
    others = [obstacles] if isinstance(obstacles, Path) else list(obstacles)
    around = [zone] * len(others) if isinstance(zone, Zone) else list(zone)
    if len(others) != len(around):
        raise ValueError(f"zone: expected one for all or each of {len(others)} obstacles, got {len(around)}")
    for other, each in zip(others, around, strict=True):
        check_comparable(path, other, each)
    chief = chief_of(path.orbit)
    kept = [path_of(one, chief) for one in (path, *others)]
    paths = types.new("cff_path_t[]", [pointer[0] for pointer, _ in kept[1:]])
    zones = types.new("cff_zone_t[]", [zone_of(each)[0] for each in around])
    found, work = types.new("cff_avoidance_t *"), types.new("cff_avoid_work_t *")
    given = kept[0][1], paths, zones, len(others), AVOID_BUDGET, work, found
    status = check(functions.cff_avoid(*given), "NO_PLAN", "END_INSIDE", "CROWDED", "MORE")
    if status != "OK":
        return None, status
    arcs = doubles(found.arcs)[: found.count * WIDTH].reshape(-1, WIDTH)
    return Path(path.orbit, arcs, np.array([0, len(arcs)]), ()), status


def passively_safe(path: Path, other: Path, zone: Zone, until: float) -> bool:
    """Return True if a loss of thrust at any instant leads into no zone, as the flight core finds.

    Parameters
    ----------
    path : Path
        Path of one spacecraft, which fails.
    other : Path
        Path of the spacecraft that the zone is around, in the same orbit, until `until`.
    zone : Zone
        Zone of the pair.
    until : float [s]
        End of the drift, in the time of the paths.

    Returns
    -------
    bool
        True if no failure leads into the zone, which is certified. False if one does, or leads so close that
        rounding decides.

    Raises
    ------
    RuntimeError
        If there is no C compiler or no cffi.
    ValueError
        If a path is a batch, the orbits differ, or the flight core does not take the paths or the zone: of
        thrust, it takes that of minimum energy and constant thrust beside an orbit, not in deep space.

    References
    ----------
    docs/on_board.md.
    """
    check_comparable(path, other, zone)
    types, functions = core()
    chief = chief_of(path.orbit, circular=True)
    (one, _one), (two, _two), around = path_of(path, chief), path_of(other, chief), zone_of(zone)
    found, since, status, budget = types.new("cff_drift_t *"), float(path.start), "MORE", BUDGET
    while status == "MORE":
        given = one, two, around, since, float(until), budget, found
        status = check(functions.cff_loss_of_thrust(*given), "MORE")
        if found.certified_until_s == since:
            budget *= 2  # one window of failures needs more
        since = found.certified_until_s
    return bool(found.verdict == functions.CFF_SAFE)
