"""Stages in which lost spacecraft search for each other: first locks and gatherings."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import WatchedFlight, watch
from closeform.mission.mission_result import FirstLocks, StageResult
from closeform.mission.stage_start import StageStart
from closeform.mission.verdict import SunAngle
from closeform.motion.arc import END, START
from closeform.scenario import Gather, Lock, Scenario
from closeform.search.gathering.result import Gathering, GatherStatus, reason_incomplete
from closeform.search.schedule import Search
from closeform.search.search_errors import errors_of_each, errors_of_pairs
from closeform.search.slew_profile import ExecutedTurns

if TYPE_CHECKING:
    from closeform.search.gathering.burn_errors import BurnErrors

NAMED = 10  # maximum number of listed pairs that never lock


def lock(start: StageStart, stage: Lock) -> StageResult[Lock, FirstLocks]:
    """Evaluate the first lock of each pair while all spacecraft coast, and return the result of the stage."""
    from closeform.search.lock_times import lock_times

    search, pairs, names = start.scenario.plan, start.scenario.opposite, start.scenario.names
    relative = start.states[pairs[:, 1]] - start.states[pairs[:, 0]]
    craft = start.scenario.search_errors
    errors = None if craft is None else errors_of_pairs(craft, pairs)
    found = FirstLocks(search, pairs, lock_times(search, relative[:, :3], relative[:, 3:], errors))
    failure = None
    if never := [f"{names[i]} - {names[j]}" for i, j in found.missing]:
        some = ", ".join(never[:NAMED]) + ", ..." * (len(never) > NAMED)
        failure = f"{len(never)} of {len(pairs)} pairs never lock: {some}"
    flight = start.coasts(search.duration)
    sun = sun_angle(start.scenario, search)
    return StageResult(start.number, stage, start.time, flight, flight, found, failure, sun=sun)


def gather(start: StageStart, stage: Gather) -> StageResult[Gather, Gathering]:
    """Gather lost spacecraft by search, lock and join, and return the result of the stage.

    The gathering ends when one formation set contains all spacecraft, or after the last round.
    """
    from closeform.search.gathering.gather import gather

    scenario, states = start.scenario, start.states
    found = gather(scenario.plan, states[:, :3], states[:, 3:], **scenario.gathering(stage))
    flight = gathered_flight(scenario, found, start.time)
    failure, sun = incomplete(scenario, found), sun_angle(scenario, found.search)
    return StageResult(start.number, stage, start.time, flight, flight, found, failure, sun=sun)


def gather_with_burn_errors(
    scenario: Scenario, planned: StageResult[Gather, Gathering], states: Floats, burn_errors: BurnErrors
) -> StageResult[Gather, Gathering]:
    """Return the gathering from the same states (N, 6), with `burn_errors`."""
    from closeform.search.gathering import gather

    arguments = scenario.gathering(planned.stage)
    begun = scenario.plan, states[:, :3], states[:, 3:]
    found = gather.gather_with_burn_errors(planned.result, *begun, burn_errors, **arguments)
    flight, failure = gathered_flight(scenario, found, planned.start), incomplete(scenario, found)
    return replace(
        planned, before=flight, after=flight, result=found, failure=failure, commanded=planned.after
    )


def sun_angle(scenario: Scenario, search: Search) -> SunAngle | None:
    """Return the maximum sun angle of spacecraft that search with errors; None if none has an error."""
    if (errors := scenario.search_errors) is None:
        return None
    turns = ExecutedTurns(search, scenario.groups, errors_of_each(errors, (len(scenario.craft),)))
    k = int(np.argmax(turns.sun_angles))
    return SunAngle(scenario.names[k], float(turns.sun_angles[k]), search.sun_limit)


def gathered_flight(scenario: Scenario, found: Gathering, time: float) -> WatchedFlight:
    """Return the flight of a gathering that begins at a mission time [s], with its conflicts."""
    arcs = found.paths.arcs.copy()
    arcs[:, [START, END]] += time
    return watch(replace(found.paths, arcs=arcs), scenario.names, scenario.zones)


def incomplete(scenario: Scenario, found: Gathering) -> str | None:
    """Return the reason why the mission ends after a gathering; None if it contains all spacecraft."""
    if found.status is not GatherStatus.INCOMPLETE:
        return None
    return reason_incomplete(found.sets, found.lost, found.rounds, scenario.names)
