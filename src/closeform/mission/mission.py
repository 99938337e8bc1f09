"""START HERE: a mission flies the stages of a scenario in order, each from where the last ended.

    scenario file -> Scenario -> fly -> Mission -> report -> result folder, printed tables
                                  |
                     one function for each kind of stage: StageStart -> StageResult

No mathematics: a stage asks the orbit for paths, `watch` for conflicts, `avoid` for the way
around them, `reconfigure` for the paths of a whole formation (`single_stage`, `joint_stage`), `fire` for the
pulses of thrusters (`pulsed`), `lock_times` and `gather` for who finds whom (`search_stage`).
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

# Kernels are compiled, or loaded, where they are imported: a stage imports those that it needs.


def fly(
    scenario: Scenario, progress: Callable[[str], None] = lambda text: None, predicted: bool = True
) -> Mission:
    """Fly a scenario's stages; `progress` is told what is under way.

    A move that finds no clear path or a search that leaves craft lost ends the mission; the Mission
    says so in `stopped`.  `predicted`: whether each stage has the `validity` of its plan in the field of the
    scenario.  Raises ScenarioError for numbers that are beyond the mathematics.
    """
    return as_happened(staged(scenario, progress, predicted), progress, predicted)


def staged(
    scenario: Scenario, progress: Callable[[str], None] = lambda text: None, predicted: bool = True
) -> Mission:
    """The stages, one after another, up to the last or to where the mission cannot go on."""
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
        known = () if replanned else tuple(results)  # where everybody is known anew
        here = scenario.during(stage)
        start = StageStart(here, orbit, number, states, begin, past, shares, errors=errors, flown=known)
        if stage.name is not None:
            past[stage.name] = start.time, states
        try:
            result = FLIES[type(stage)](start, stage)
            result = with_drift(scenario, in_field(scenario, result) if predicted else result)
        except ValueError as error:
            raise ScenarioError(scenario.file, [f"stage[{number}]: {error}"]) from error
        if scenario.uncertain and result.flown:
            progress(f"stage {number} of {len(scenario.stages)}: {verb}, with errors")
            result, left = with_errors(scenario, result, errors)
            errors = errors if replanned else left  # where everybody is known anew
        if scenario.history is not None:
            result = scenario.history.executed(scenario, result, states)
        results.append(result)
        if result.failure is not None:
            stopped = f"stage {number} ({verb}): {result.failure}"
            return Mission(scenario, orbit, tuple(results), stopped)
        states = result.after.paths.state(result.end)
    return Mission(scenario, orbit, tuple(results))


def as_happened(
    mission: Mission, progress: Callable[[str], None] = lambda text: None, predicted: bool = True
) -> Mission:
    """A mission with what its case drew that no plan knows, flown in its field if that is asked."""
    scenario, history = mission.scenario, mission.scenario.history
    if history is not None:
        if (failing := history.failing_in(mission)) is not None:
            history, mission = failing, staged(replace(scenario, history=failing), progress, predicted)
        mission = history.whole(mission)
    if scenario.flights is None or not mission.flown:
        return mission
    from closeform.dynamics.infeasible import Grounded
    from closeform.mission.simulation import FlownRun

    progress("flying in the field")
    try:
        flights = FlownRun.asked(mission)
        lost = tuple(flights.drifted(one) for one in mission.lost)
        return replace(mission, flights=flights, lost=lost)
    except Grounded as error:
        return replace(mission, grounded=str(error))
    except ValueError as error:
        raise ScenarioError(scenario.file, [f"flight: {error}"]) from error


def with_errors(
    scenario: Scenario, result: StageResult[Any, Any], errors: tuple[Any, ...]
) -> tuple[StageResult[Any, Any], tuple[Any, ...]]:
    """What the errors of all craft at a stage's start make of it, and what they are at its end."""
    from closeform.mission.uncertainty import UncertainStage

    found = UncertainStage.of(scenario, result.number, result.stage, result.after, errors)
    return replace(result, uncertain=found), found.after(result.after)


def run(file: str | Path) -> Mission:
    """Fly the stages of a scenario file, as `closeform run` does, and answer with all that has come of it.

    Nothing is printed or written.

    Parameters
    ----------
    file : str or path-like
        A scenario.

    Returns
    -------
    Mission
        Its `results` are the stages as flown, each with the flight `before` avoidance and `after` it:
        `paths`, `conflicts` by name (`PairConflict`) and `approaches`, the closest of each pair; `result`
        holds the `plan`, `avoidance` or gathering.  `verdict` says what the last line of a run does, `clear`
        whether no conflict remains; `delta_v` [m/s] and `propellant` [kg] are of each stage and craft.

    Raises
    ------
    ScenarioError
        If the scenario cannot be read or flown; a ValueError.
    ValueError
        If `file` is no path.

    Warns
    -----
    UserWarning
        If an altitude or a relative speed is legal, but not that of a close formation.
    """
    scenario = load(instance("file", file, str, Path))
    for line in scenario.doubts:
        warnings.warn(f"{file}: {line}", stacklevel=2)
    return fly(scenario)


def shares_left(scenario: Scenario, results: list[StageResult[Any, Any]]) -> Floats:
    """What the craft have left of their mass (N,), by Tsiolkovsky's equation, after some stages."""
    flown = [result for result in results if result.flown]
    spent = (result.delta_v / scenario.exhaust(result.stage) for result in flown)
    return np.asarray(np.exp(-sum(spent, np.zeros(len(scenario.craft)))))


def with_drift(scenario: Scenario, result: StageResult[Any, Any]) -> StageResult[Any, Any]:
    """A stage with whether it is safe when something fails, where that is asked."""
    if getattr(result.stage, "drift", None) is None:
        return result
    from closeform.mission.passive_safety import judged, unplanned

    if not result.flown:
        return replace(result, unplanned=unplanned(scenario, result))
    return replace(result, passive=judged(scenario, result))


def in_field(scenario: Scenario, result: StageResult[Any, Any]) -> StageResult[Any, Any]:
    """A stage with what becomes of it in the scenario's field, if it has one."""
    if scenario.field is None or not result.flown:
        return result
    from closeform.dynamics.validity import validity

    zones = scenario.zones if result.after.pairs <= ALL_PAIRS else None
    return replace(result, validity=validity(result.after.paths, scenario.field, zones))


def coast(start: StageStart, stage: Coast) -> StageResult[Coast, None]:
    """Evaluate natural motion with the given impulses, and the given paths of craft that follow theirs."""
    n, names = start.orbit.mean_motion, start.scenario.names
    duration = stage.length.on(n)
    given: list[list[tuple[float, Floats]]] = [[] for _ in names]
    for k, burn in enumerate(stage.burns, 1):
        at = burn.at.on(n)
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


FLIES: dict[type[StageTable], Callable[[StageStart, Any], StageResult[Any, Any]]] = {
    Coast: coast,
    Transfer: transfer,
    Avoid: avoid,
    Scatter: scatter,
    Regather: regather,
    Reconfigure: reconfigure,
    Lock: lock,
    Gather: gather,
}
