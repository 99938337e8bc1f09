"""Losses: craft lose their thrust in mid-mission and drift to its end, while the others fly as planned."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import isnan, nan
from typing import Any

from closeform.arrays import Floats
from closeform.conflicts.flight import watch
from closeform.conflicts.two_paths import closest_approach
from closeform.dynamics.natural import coast
from closeform.mission.mission_result import Mission, StageResult
from closeform.mission.verdict import LostThrust
from closeform.motion.joining import drift, drifting, stack
from closeform.motion.path import Path
from closeform.scenario import Scenario
from closeform.search.gather_result import Gathering

Shaken = Callable[[Path, int, float], Path]  # a path of a craft by its number, with noise after a time [s]


def instants(mission: Mission, fails: Sequence[float]) -> dict[int, float]:
    """When craft, by number, lose their thrust [s]: after shares (N,) of the mission, nan: they do not."""
    end = mission.flown[-1].end
    return {k: float(share * end) for k, share in enumerate(fails) if not isnan(share)}


def with_losses(mission: Mission, fails: Sequence[float], shaken: Shaken) -> Mission:
    """A mission in which each craft (N,) loses its thrust after a share of it, nan for who does not.

    Who coasts all along has none to lose; who drifts is `shaken` on.
    """
    scenario, burns = mission.scenario, mission.paths.delta_v > 0.0
    times = {k: time for k, time in instants(mission, fails).items() if burns[k]}
    if not times:
        return mission
    needed = {k: thrust_after(mission.paths[k], time) for k, time in times.items()}
    results, states = list(mission.results), dict[int, Floats]()
    for place, result in enumerate(results):
        if result.flown:
            paths = [result.after.path(name) for name in scenario.names]
            for k, time in times.items():
                if time < result.end:
                    paths[k] = shaken(drifting(paths[k], time, states.get(k)), k, max(time, result.start))
                    states[k] = paths[k].state(result.end)
            results[place] = flown(scenario, result, paths)
    return told(replace(mission, results=tuple(results)), times, needed)


def told(mission: Mission, times: Mapping[int, float], needed: Mapping[int, bool]) -> Mission:
    """A mission as flown by craft that lose their thrust, which says who does, and how near they drift."""
    names = mission.scenario.names
    lost = (LostThrust(names[k], time, needed[k], *nearest(mission, k, time)) for k, time in times.items())
    return replace(mission, lost=tuple(lost))


def missed(mission: Mission, k: int, time: float) -> bool:
    """Whether a craft is told to burn after a time, in a mission whose stages were flown without its thrust.

    In a gathering: whether it could not fly along for want of a burn.
    """
    for result in mission.flown:
        if isinstance(result.result, Gathering):
            if k in result.result.adrift:
                return True
        elif time < result.end:
            path = result.planned.path(mission.scenario.names[k])
            if thrust_after(path, time) if time > path.start else path.delta_v > 0.0:
                return True
    return False


def flown(scenario: Scenario, result: StageResult[Any, Any], paths: list[Path]) -> StageResult[Any, Any]:
    """A stage with the paths on which the craft really were."""
    after = watch(stack(paths), scenario.names, scenario.zones)
    return replace(result, after=after, commanded=result.planned)


def thrust_after(path: Path, time: float) -> bool:
    """Whether a craft burns after some time of its path."""
    burnt = path.delta_v - drifting(path, time).delta_v
    return bool(burnt > 0.0)


def nearest(mission: Mission, k: int, time: float) -> tuple[float, str | None]:
    """Least ratio of a craft that drifts since a time to another, and to whom; nan, None without zones.

    In the scenario's field, where it has one; else in Hill's equations.
    """
    names, orbit, paths, field = mission.scenario.names, mission.orbit, mission.paths, mission.scenario.field
    own = paths[k]
    if field is None or time >= own.end:
        alone = drift(orbit, time, own.end, own.state(time))
    else:
        alone = coast(own.state(time), field._of([k]), own.end - time, time, orbit=orbit)
    zones = {j: mission.scenario.zones.between(k, j) for j in range(len(names)) if j != k}
    ratios = [
        (float(closest_approach(alone, paths[j], zone).ratio), names[j])
        for j, zone in zones.items()
        if zone is not None
    ]
    return min(ratios, default=(nan, None))
