"""Searches of a scene: attitudes, sensors, locks and sets of craft."""

from math import ceil, isfinite, pi, sqrt
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import FirstLocks, StageResult
from closeform.report.sections.searches import locks_of
from closeform.search.gathering.result import EventKind, Gathering
from closeform.search.leg import Leg
from closeform.search.schedule import Search
from closeform.viewer.numbers import Numbers
from closeform.viewer.shown import Shown

WIDEST = pi / 2.0  # rad: largest turn between two attitudes; the direction of a half-turn is ambiguous
HALF_TURN = np.array([1.0, 0.0, 0.0, 0.0])  # about body x: from group A to B


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
        group: np.column_stack(
            [times + result.start, product(attitudes, other) if group == "B" else attitudes]
        )
        for group, other in (("A", None), ("B", HALF_TURN))
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
    """Return times (K,) [s] and quaternions (K, 4) of group A; it turns about one axis between them."""
    times: list[float] = []
    attitudes: list[Floats] = []
    for leg in search.legs:
        if leg.start > length or leg.end <= leg.start:
            continue
        last = min(leg.end, length)
        steps = max(1, ceil(abs(leg.angle) * (last - leg.start) / (leg.end - leg.start) / WIDEST - 1e-9))
        for share in np.linspace(0.0, 1.0, steps + 1):
            time = leg.start + share * (last - leg.start)
            times.append(time)
            attitudes.append(attitude(leg, time))
    return np.array(times), np.array(attitudes)


def attitude(leg: Leg, time: float) -> Floats:
    """Return the quaternion (4,) of group A in a leg."""
    half = 0.5 * leg.angle * (time - leg.start) / (leg.end - leg.start)
    turned = np.append(np.sin(half) * leg.axis, np.cos(half))
    return product(turned, quaternion(leg.attitude))


def product(one: Floats, other: Floats | None) -> Floats:
    """Return the quaternions (..., 4) of the rotation `other` followed by `one`."""
    if other is None:
        return one
    v, w, u, s = one[..., :3], one[..., 3:], other[..., :3], other[..., 3:]
    vector = w * u + s * v + np.cross(v, u)
    return np.concatenate([vector, w * s - (v * u).sum(axis=-1, keepdims=True)], axis=-1)


def quaternion(matrix: Floats) -> Floats:
    """Return the quaternion (4,), in the order x, y, z, w, of a rotation (3, 3)."""
    m, trace = matrix, float(np.trace(matrix))
    k = int(np.argmax([m[0, 0], m[1, 1], m[2, 2], trace]))  # the largest component avoids a small divisor
    if k == 3:
        q = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1.0 + trace])
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        q = np.empty(4)
        q[k], q[i], q[j] = 1.0 + 2.0 * m[k, k] - trace, m[i, k] + m[k, i], m[j, k] + m[k, j]
        q[3] = m[j, i] - m[i, j]
    return q / sqrt(float(q @ q))
