"""Searches of a scene: attitudes, sensors, locks and sets of craft."""

from math import ceil, isfinite, pi
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.ccsds.aem import quaternions
from closeform.mission.mission_result import FirstLocks, StageResult
from closeform.report.sections.searches import locks_of
from closeform.search.gathering.result import EventKind, Gathering
from closeform.search.leg import AXES_OF_GROUP
from closeform.search.schedule import Search
from closeform.viewer.numbers import Numbers
from closeform.viewer.shown import Shown

WIDEST = pi / 2.0  # rad: largest turn between two attitudes; the direction of a half-turn is ambiguous


def searches(shown: Shown, numbers: Numbers) -> list[dict[str, Any]]:
    """Return every `SearchScene` of web/scene.d.ts."""
    return [
        searched(shown, result, numbers)
        for result in shown.results
        if isinstance(result.result, Gathering | FirstLocks)
    ]


def searched(shown: Shown, result: StageResult[Any, Any], numbers: Numbers) -> dict[str, Any]:
    """Return the `SearchScene` of one stage."""
    search: Search = result.result.search
    sensor, length = search.sensor, result.end - result.start
    times, attitudes = turns(search, length)
    rows = {
        group: np.column_stack([times + result.start, quaternions(attitudes * axes)])
        for group, axes in AXES_OF_GROUP.items()
    }
    return {
        "stage": result.number,
        "start": result.start,
        "end": result.end,
        "sensor": {
            "half_angle": sensor.half_angle,
            "offset": sensor.offset,
            "range": sensor.range if isfinite(sensor.range) else None,
        },
        "sun_limit": search.sun_limit,
        "groups": list(shown.groups),
        "attitudes": {group: numbers.block(some, "f8") for group, some in rows.items()},
        "phases": [
            {
                "name": name,
                "round": number,
                "start": result.start + start,
                "end": result.start + min(end, length),
            }
            for name, number, start, end in search.phases
            if start < length
        ],
        "sets": sets(result, numbers) if isinstance(result.result, Gathering) else None,
    }


def sets(result: StageResult[Any, Gathering], numbers: Numbers) -> dict[str, Any]:
    """Return the block of the set of each craft, one row for each change."""
    gathering = result.result
    times = np.array([0.0, *(event.time for event in gathering.events)])
    changed = np.array([True, *(event.kind is EventKind.LOCK for event in gathering.events)])
    rows = np.column_stack([result.start + times, gathering.history])[changed]
    return numbers.block(rows, "f8")


def locks(shown: Shown) -> list[dict[str, Any]]:
    """Return every `Lock` of web/scene.d.ts in order of time."""
    found = []
    for result in shown.results:
        for time, first, second in locks_of(result.result):
            found.append(
                {"first": first, "second": second, "time": result.start + time, "stage": result.number}
            )
    return sorted(found, key=lambda lock: (lock["time"], lock["first"], lock["second"]))


def turns(search: Search, length: float) -> tuple[Floats, Floats]:
    """Return times (K,) [s] and attitudes (K, 3, 3) of group A; it turns about one axis between them."""
    times, attitudes = list[Floats](), list[Floats]()
    for leg in search.legs:
        if leg.start <= length and leg.end > leg.start:
            last = min(leg.end, length)
            steps = max(1, ceil(abs(leg.angle) * (last - leg.start) / (leg.end - leg.start) / WIDEST - 1e-9))
            times.append(np.linspace(leg.start, last, steps + 1))
            attitudes.append(leg.attitude_at(times[-1]))
    return np.concatenate(times), np.concatenate(attitudes)
