"""Curves of the strip chart: clearance ratios and ranges of pairs, speeds, thrust and spent delta-v."""

from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import StageResult
from closeform.viewer.meetings import places_of, worth_watching
from closeform.viewer.numbers import Numbers
from closeform.viewer.requirements import speeds
from closeform.viewer.shown import Shown
from closeform.viewer.thrusts import instants, is_pulsed, spent, thrust_of

Record = dict[str, Any]
PAIRS = 30  # largest number of pairs with curves
UNITS = {"ratio": "× zone", "range": "m", "speed": "m/s", "thrust": "m/s²", "delta-v": "m/s"}


def series(shown: Shown, numbers: Numbers) -> list[Record]:
    """Return every `Series` of web/scene.d.ts."""
    chart = Chart(shown.names, numbers)
    limited = [chart.curve("speed", [craft], *rows) for craft, *rows in speeds(shown)]
    return [*nearness(shown, chart), *limited, *efforts(shown, chart)]


@dataclass(frozen=True, eq=False)
class Chart:
    """Factory of the curves."""

    names: tuple[str, ...]
    numbers: Numbers

    def curve(
        self, kind: str, craft: list[int], times: Floats, values: Floats, limit: Floats | None = None
    ) -> Record:
        """Return one `Series`."""
        return {
            "kind": kind,
            "name": " - ".join(self.names[k] for k in craft),
            "unit": UNITS[kind],
            "craft": craft,
            "times": self.numbers.block(times, "f8"),
            "values": self.numbers.block(values),
            "limit": None if limit is None else self.numbers.block(limit),
        }


def nearness(shown: Shown, chart: Chart) -> list[Record]:
    """Return the curves of watched pairs: clearance ratio, if they have a zone, and range [m]."""
    watched = worth_watching(shown, PAIRS)
    if not watched:
        return []
    looks = [(result, looked_at(result, watched)) for result in shown.results]
    times = np.concatenate([some for _, some in looks])
    places = np.concatenate([result.after.paths.position(some) for result, some in looks], axis=1)
    found = []
    for kind in ("ratio", "range"):
        for one, other in watched:
            gap = places[one] - places[other]
            zone = shown.zones.between(one, other) if kind == "ratio" else None
            if zone is None and kind == "ratio":
                continue
            values = np.linalg.norm(gap, axis=1) if zone is None else zone.norm(gap)
            found.append(chart.curve(kind, [one, other], times, values))
    return found


def looked_at(result: StageResult[Any, Any], watched: list[tuple[int, int]]) -> Floats:
    """Return instants [s] of a stage, with its closest approaches and the ends of conflicts among them."""
    place, chosen = places_of(result), set(watched)
    every: list[tuple[Any, tuple[float, ...]]] = [(met, (met.time,)) for met in result.after.approaches]
    every += [(met, (met.start, met.time, met.end)) for met in result.after.conflicts]
    marked = [
        time for met, times in every if (place[met.first], place[met.second]) in chosen for time in times
    ]
    within = [time for time in marked if result.start < time < result.end]
    return np.unique(np.concatenate([instants(result), within]))


def efforts(shown: Shown, chart: Chart) -> list[Record]:
    """Return the curves of each craft: thrust [m/s^2] and delta-v [m/s] spent since the first stage."""
    found = []
    for craft in range(len(shown.names)):
        sizes = [thrust_sizes(result, craft) for result in shown.results]
        if any(np.nanmax(size, initial=0.0) > 0.0 for _, size in sizes):
            found.append(
                chart.curve("thrust", [craft], *(np.concatenate(one) for one in zip(*sizes, strict=True)))
            )
        if (used := used_up(shown, craft)) is not None:
            found.append(chart.curve("delta-v", [craft], *used))
    return found


def thrust_sizes(result: StageResult[Any, Any], craft: int) -> tuple[Floats, Floats]:
    """Return times [s] and thrust magnitudes [m/s^2] of a craft in a stage; nan if it fires pulses."""
    if (thrust := thrust_of(result, craft)) is not None:
        return thrust[0], np.linalg.norm(thrust[1], axis=1)
    return np.array([result.start, result.end]), np.full(2, nan if is_pulsed(result, craft) else 0.0)


def used_up(shown: Shown, craft: int) -> tuple[Floats, Floats] | None:
    """Return times [s] and cumulative delta-v [m/s] over all executed stages; None if it is zero."""
    parts, so_far = [], 0.0
    for result in shown.results:
        if not result.executed:
            continue
        edges = np.array([result.start, result.end])
        times, values = spent(result, craft) or (edges, np.zeros(2))
        parts.append((times, so_far + values))
        so_far += float(values[-1])
    if so_far == 0.0:
        return None
    return np.concatenate([times for times, _ in parts]), np.concatenate([values for _, values in parts])
