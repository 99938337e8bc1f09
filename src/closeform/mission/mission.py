"""Plan and evaluate a mission: the stages of a scenario in order, each from the end of the previous one.

Start reading here.

    scenario file -> Scenario -> plan_mission -> Mission -> report -> result folder, printed tables
                                  |
                     one function for each kind of stage: StageStart -> StageResult

The stage functions contain no mathematics.  The orbit supplies paths and `watch` finds conflicts.  `avoid`
plans avoidance trajectories (`single_stage`), and `reconfigure` plans the paths of a formation
(`joint_stage`).  `fire_thrusters` realizes a plan with pulses (`thruster_firing`).  `lock_times` and `gather`
evaluate the search for lost spacecraft (`search_stage`).
"""

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from closeform.arrays import Floats, instance
from closeform.conflicts.flight import ALL_PAIRS
from closeform.mission.joint_stage import reconfigure, regather, scatter
from closeform.mission.mission_result import Mission, StageResult
from closeform.mission.search_stage import gather, lock
from closeform.mission.single_stage import avoid, transfer
from closeform.mission.stage_start import StageStart
from closeform.scenario import (
    Avoid,
    Coast,
    Gather,
    Joint,
    Lock,
    Reconfigure,
    Regather,
    Scatter,
    Scenario,
    ScenarioError,
    StageTable,
    Transfer,
    load,
)
from closeform.scenario.start_state import is_inertial

MOST_PAIRS = 100_000  # largest number of pairs that `check` evaluates

# Importing a kernel compiles or loads it, so that each stage imports only the kernels that it needs.


def plan_mission(
    scenario: Scenario, progress: Callable[[str], None] = lambda text: None, predicted: bool = True
) -> Mission:
    """Plan and evaluate the stages of a scenario, and return the Mission.

    `progress` is called with a text at the start of each part of the work.  A manoeuvre without a clear path,
    or a search that leaves spacecraft lost, ends the mission; `stopped` of the Mission then holds the reason.
    With `predicted`, each stage has the `validity` of its plan in the high-fidelity model of the scenario, if
    there is one.  Raises ScenarioError for values that a stage rejects.
    """
    return as_happened(staged(scenario, progress, predicted), progress, predicted)


def staged(
    scenario: Scenario,
    progress: Callable[[str], None] = lambda text: None,
    predicted: bool = True,
    planner: Callable[[Any], Any] | None = None,
) -> Mission:
    """Evaluate the stages in order, up to the last one or the first that fails, and return the Mission.

    With a `planner`, it plans the requests of the stages, which are not judged further.
    """
    orbit = scenario.orbit.build()
    states = scenario.states(orbit)
    results: list[StageResult[Any, Any]] = []
    past: dict[str, tuple[float, Floats]] = {}
    errors = tuple(craft.errors for craft in scenario.craft) if scenario.uncertain else ()
    replanned = scenario.history is not None and scenario.history.replanned
    for number, stage in enumerate(scenario.stages, 1):
        verb = stage.verb
        progress(f"stage {number} of {len(scenario.stages)}: {verb}")
        begin, shares = results[-1].end if results else 0.0, shares_left(scenario, results)
        known = () if replanned else tuple(results)  # replanning starts from newly measured states
        here = scenario.during(stage)
        start = StageStart(
            *(here, orbit, number, states, begin, past, shares),
            errors=errors,
            executed=known,
            whole=scenario,
            planner=planner,
        )
        if stage.name is not None:
            past[stage.name] = start.time, states
        try:
            result = PLANNERS[type(stage)](start, stage)
            if planner is None:
                result = with_drift(scenario, in_field(scenario, result) if predicted else result)
        except ValueError as error:
            raise ScenarioError(scenario.file, [f"stage[{number}]: {error}"]) from error
        if scenario.uncertain and result.executed and planner is None:
            progress(f"stage {number} of {len(scenario.stages)}: {verb}, with errors")
            result, left = with_errors(scenario, result, errors)
            errors = errors if replanned else left  # replanning starts from newly measured states
        if scenario.history is not None:
            result = scenario.history.executed(scenario, result, states)
        results.append(result)
        if result.failure is not None:
            stopped = f"stage {number} ({verb}): {result.failure}"
            return Mission(scenario, orbit, tuple(results), stopped)
        states = result.after.paths.state(result.end)
    return Mission(scenario, orbit, tuple(results))


def stops(scenario: Scenario) -> tuple[str, ...]:
    """Return the reason why a run is known to stop, with its stage; none if no reason is known.

    The stages are evaluated without a search for plans, as far as their starts do not depend on one.
    """
    if scenario.scattered or scenario.zones.pairs > MOST_PAIRS:
        return ()
    stages = list[StageTable]()
    for stage in scenario.stages:
        if stage.searches:
            break
        stages.append(stage)
        limited = scenario.during(stage).limits(*stage.moving(scenario.names))
        if isinstance(stage, Joint) or (isinstance(stage, Avoid) and (limited or scenario.uncertain)):
            break
    from closeform.planning.planner import with_checked_ends

    try:
        mission = staged(replace(scenario, stages=tuple(stages)), planner=with_checked_ends)
    except ScenarioError as error:
        return tuple(line.removeprefix(f"{scenario.file}: ") for line in error.lines)
    if mission.stopped is None:
        return ()
    return (f"stage[{mission.results[-1].number}]: {mission.results[-1].failure}",)


def as_happened(
    mission: Mission, progress: Callable[[str], None] = lambda text: None, predicted: bool = True
) -> Mission:
    """Apply sampled errors and losses of thrust to a mission, simulate it if requested, and return it.

    A case of a study samples them, and the planner does not know them.
    """
    scenario, history = mission.scenario, mission.scenario.history
    if history is not None:
        if (failing := history.failing_in(mission)) is not None:
            history, mission = failing, staged(replace(scenario, history=failing), progress, predicted)
        mission = history.whole(mission)
    if scenario.flights is None or not mission.executed:
        return mission
    from closeform.dynamics.infeasible import Infeasible
    from closeform.mission.simulation import SimulatedRun

    progress("simulation in the high-fidelity model")
    try:
        flights = SimulatedRun.asked(mission)
        lost = tuple(flights.drifted(one) for one in mission.lost)
        return replace(mission, flights=flights, lost=lost)
    except Infeasible as error:
        return replace(mission, grounded=str(error))
    except ValueError as error:
        raise ScenarioError(scenario.file, [f"flight: {error}"]) from error


def with_errors(
    scenario: Scenario, result: StageResult[Any, Any], errors: tuple[Any, ...]
) -> tuple[StageResult[Any, Any], tuple[Any, ...]]:
    """Return the stage with its uncertainty results, and the uncertainty (N,) of each spacecraft at its end.

    `errors` (N,) is the uncertainty of each spacecraft at the start of the stage.
    """
    from closeform.mission.uncertainty import UncertainStage

    found = UncertainStage.of(scenario, result.number, result.stage, result.after, errors)
    return replace(result, uncertain=found), found.after(result.after)


def run(file: str | Path) -> Mission:
    """Plan and evaluate the stages of a scenario file, as `closeform run` does, and return all results.

    The function prints and writes nothing.

    Parameters
    ----------
    file : str or path-like
        The scenario file.

    Returns
    -------
    Mission
        Its `results` are the evaluated stages, each with the flight `before` avoidance and `after` it:
        `paths`, `conflicts` by name (`PairConflict`) and `approaches`, the closest approach of each pair.
        `result` of a stage holds the `plan` or gathering.  `verdict` is the last line that a run
        prints, and `clear` is True if no conflict remains.  `delta_v` [m/s] and `propellant` [kg] have one
        row per stage and one column per spacecraft.

    Raises
    ------
    ScenarioError
        If the scenario cannot be read or evaluated; a ValueError.
    ValueError
        If `file` is not a path.

    Warns
    -----
    UserWarning
        If an altitude or a relative speed is valid but untypical of a close formation.
    """
    scenario = load(instance("file", file, str, Path))
    for line in scenario.doubts:
        warnings.warn(f"{file}: {line}", stacklevel=2)
    return plan_mission(scenario)


def shares_left(scenario: Scenario, results: list[StageResult[Any, Any]]) -> Floats:
    """Return the fraction (N,) of its initial mass that each spacecraft has left after `results`."""
    executed = [result for result in results if result.executed]
    spent = (result.delta_v / scenario.exhaust(result.stage) for result in executed)
    return np.asarray(np.exp(-sum(spent, np.zeros(len(scenario.craft)))))


def with_drift(scenario: Scenario, result: StageResult[Any, Any]) -> StageResult[Any, Any]:
    """Return the stage with its passive safety evaluated, if the stage requires passive safety."""
    if getattr(result.stage, "drift", None) is None:
        return result
    from closeform.mission.passive_safety import judged, unplanned

    if not result.executed:
        return replace(result, unplanned=unplanned(scenario, result))
    return replace(result, passive=judged(scenario, result))


def in_field(scenario: Scenario, result: StageResult[Any, Any]) -> StageResult[Any, Any]:
    """Return the stage with the validity of its plan in the scenario's high-fidelity model, if any."""
    if scenario.field is None or not result.executed:
        return result
    from closeform.dynamics.simulation.validity import validity

    zones = scenario.zones if result.after.pairs <= ALL_PAIRS else None
    return replace(result, validity=validity(result.after.paths, scenario.field, zones))


def coast(start: StageStart, stage: Coast) -> StageResult[Coast, None]:
    """Evaluate natural motion with the given impulses; spacecraft listed in `follow` follow their files."""
    period, names = start.orbit.period, start.scenario.names
    duration = stage.length.on(period)
    given: list[list[tuple[float, Floats]]] = [[] for _ in names]
    for k, burn in enumerate(stage.burns, 1):
        at = burn.at.on(period)
        if at >= duration:
            raise ValueError(f"burns[{k}].at: {at:.6g} s is not before the end of the stage; fire it earlier")
        given[names.index(burn.craft)].append((at, np.array(burn.delta_v)))
    flight = start.flight(
        [
            start.followed(k, duration) if name in stage.follow else start.fired(k, own, duration)
            for k, (name, own) in enumerate(zip(names, given, strict=True))
        ]
    )
    real = tuple(names.index(name) for name in stage.follow if is_inertial(start.scenario, name))
    return StageResult(start.number, stage, start.time, flight, flight, None, on_ephemerides=real)


PLANNERS: dict[type[StageTable], Callable[[StageStart, Any], StageResult[Any, Any]]] = {
    Coast: coast,
    Transfer: transfer,
    Avoid: avoid,
    Scatter: scatter,
    Regather: regather,
    Reconfigure: reconfigure,
    Lock: lock,
    Gather: gather,
}
