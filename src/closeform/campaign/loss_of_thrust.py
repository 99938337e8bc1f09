"""Loss of thrust in a mission: a craft that loses its thrust drifts, while the others follow their plan."""

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

# adds process noise after a time [s] to the path of a craft by index
Shaken = Callable[[Path, int, float], Path]


def instants(mission: Mission, fails: Sequence[float]) -> dict[int, float]:
    """Return the times [s] at which craft, by index, lose their thrust; `fails` (N,) are fractions or nan."""
    end = mission.flown[-1].end
    return {k: float(share * end) for k, share in enumerate(fails) if not isnan(share)}


def with_losses(mission: Mission, fails: Sequence[float], shaken: Shaken) -> Mission:
    """Return a mission in which each craft (N,) loses its thrust after a fraction of it; nan: it does not.

    A craft that coasts throughout has no thrust to lose. A drifting craft is still subject to process noise
    (`shaken`).
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
    return with_reported_losses(replace(mission, results=tuple(results)), times, needed)


def with_reported_losses(mission: Mission, times: Mapping[int, float], needed: Mapping[int, bool]) -> Mission:
    """Return the mission with its losses of thrust and the closest approach of each drifting craft."""
    names = mission.scenario.names
    lost = (LostThrust(names[k], time, needed[k], *nearest(mission, k, time)) for k, time in times.items())
    return replace(mission, lost=tuple(lost))


def missed(mission: Mission, k: int, time: float) -> bool:
    """Return True if a craft misses a burn after a time, in a mission executed without its thrust.

    In a gathering: True if it could not join for want of a burn.
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
    """Return a stage with the paths that the craft really followed."""
    after = watch(stack(paths), scenario.names, scenario.zones)
    return replace(result, after=after, commanded=result.planned)


def thrust_after(path: Path, time: float) -> bool:
    """Return True if a craft burns after a time of its path."""
    burnt = path.delta_v - drifting(path, time).delta_v
    return bool(burnt > 0.0)


def nearest(mission: Mission, k: int, time: float) -> tuple[float, str | None]:
    """Return the minimum clearance ratio of a craft drifting since a time, and the other craft.

    The drift is propagated in the scenario's high-fidelity model if it has one, else with Hill's equations.
    The result is nan and None without zones.
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
