"""Conflicts and closest approaches of all pairs."""

from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np

from closeform.conflicts.flight import WatchedFlight
from closeform.conflicts.two_paths import nearest_first
from closeform.mission.mission_result import StageResult
from closeform.viewer.shown import Shown

Record = dict[str, Any]
LISTED = 500  # largest number of conflicts and of approaches of a stage; the closest are kept
FEW = 30  # largest number of craft whose distances are compared for all pairs


def conflicts(shown: Shown) -> list[Record]:
    """Return every `Conflict` of web/scene.d.ts in order of time."""
    found = [
        record(met, result, ("start", "end", "time", "ratio")) | {"when": when}
        for result in shown.results
        for when, flight in flights(result)
        for met in sorted(flight.conflicts, key=lambda met: met.ratio)[:LISTED]
    ]
    return sorted(found, key=lambda met: (met["start"], met["first"], met["second"], met["when"]))


def record(met: Any, result: StageResult[Any, Any], kept: Sequence[str]) -> Record:
    """Return the kept values of a conflict or an approach, with the indices of its craft and the stage."""
    place = places_of(result)
    craft = {"first": place[met.first], "second": place[met.second], "stage": result.number}
    return craft | {key: getattr(met, key) for key in kept}


def flights(result: StageResult[Any, Any]) -> list[tuple[str, WatchedFlight]]:
    """Return the watched paths "before" avoidance, if they differ, and "after" it, if executed."""
    last = [("after" if result.executed else "before", result.after)]
    return last if result.before is result.after else [("before", result.before), *last]


def approaches(shown: Shown) -> list[Record]:
    """Return every `Approach` of web/scene.d.ts, the closest first."""
    found = [record for result in shown.results for record in closest(result)]
    return sorted(
        found, key=lambda one: (*nearest_first(one["ratio"], one["time"]), one["first"], one["second"])
    )


def closest(result: StageResult[Any, Any]) -> list[Record]:
    """Return the closest pairs of a stage, the closest first."""
    near = [pair for pair in result.after.approaches if pair.ratio < inf]
    ranked = sorted(near, key=lambda pair: nearest_first(pair.ratio, pair.time))[:LISTED]
    return [record(pair, result, ("time", "ratio", "distance")) for pair in ranked]


def places_of(result: StageResult[Any, Any]) -> dict[str, int]:
    """Return the index of each craft by its name."""
    return {name: k for k, name in enumerate(result.after.names)}


def worth_watching(shown: Shown, most: int) -> list[tuple[int, int]]:
    """Return up to `most` pairs (i < j): the closest pair of each craft, then the closest of the rest.

    Clearance ratio determines the order; without zones, distance does, for a small number of craft.
    """
    ranked = list(dict.fromkeys((one["first"], one["second"]) for one in approaches(shown)))
    if not ranked:
        ranked = by_distance(shown)
    firsts, seen = [], set[int]()
    for pair in ranked:
        if not seen.issuperset(pair):
            firsts.append(pair)
            seen.update(pair)
    chosen = set(firsts[:most])
    chosen.update([pair for pair in ranked if pair not in chosen][: most - len(chosen)])
    return [pair for pair in ranked if pair in chosen]


def by_distance(shown: Shown) -> list[tuple[int, int]]:
    """Return all pairs of few craft in order of minimum distance."""
    count = len(shown.names)
    if not 1 < count <= FEW or not shown.results:
        return []
    first, second = np.triu_indices(count, 1)
    least = np.full(len(first), inf)
    for result in shown.results:
        places = result.after.paths.position(np.linspace(result.start, result.end, 65))
        least = np.minimum(least, np.linalg.norm(places[first] - places[second], axis=2).min(axis=1))
    order = np.argsort(least, kind="stable")
    return [(int(first[k]), int(second[k])) for k in order]
