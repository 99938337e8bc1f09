"""START HERE: a mission flies the stages of a scenario in order, each from where the last ended.

    scenario file -> Scenario -> fly -> Mission -> report -> result folder, printed tables
                                  |
                     one function for each kind of stage: StageStart -> StageResult

No mathematics: a stage asks the orbit for paths, `watch` for conflicts, `avoid` for the way
around them, `reconfigure` for the paths of a whole formation, `lock_times` and `gather` for who
finds whom.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import Flight, watch
from closeform.mission_result import AvoidResult, FirstLocks, Mission, ReconfigureResult, StageResult
from closeform.motion.arc import END, START
from closeform.motion.duration import far_beyond
from closeform.motion.joining import join
from closeform.motion.path import Path
from closeform.scenario import (
    Avoid,
    Coast,
    Gather,
    Goal,
    Joint,
    Lock,
    Reconfigure,
    Regather,
    Scatter,
    Scenario,
    ScenarioError,
    StageTable,
)
from closeform.search.gather_result import Gathering, who_is_left
from closeform.stage_start import StageStart, too_late

if TYPE_CHECKING:
    from closeform.planning.plan import Plan

# Kernels are compiled, or loaded, where they are imported: a stage imports those that it needs.

AGAIN = 20  # times that a goal which depends on when one arrives is aimed at
ROUNDING = 1e-9
SLACK = 1.01  # by which later such times are stretched, so that they settle
NAMED = 10  # pairs that are named where more never lock

Goals = Callable[[float], Floats]  # duration [s] -> slots (S, 6)


def fly(scenario: Scenario, progress: Callable[[str], None] = lambda text: None) -> Mission:
    """Fly a scenario's stages; `progress` is told what is under way.

    A move that finds no clear path or a search that leaves craft lost ends the mission; the Mission
    says so in `stopped`.  Raises ScenarioError for stages or starts that this version has not
    built, and for numbers that are beyond the mathematics.
    """
    if lines := scenario.unbuilt():
        raise ScenarioError(scenario.file, lines)
    orbit = scenario.orbit.build()
    states = scenario.states(orbit)
    results: list[StageResult[Any, Any]] = []
    past: dict[str, tuple[float, Floats]] = {}
    for number, stage in enumerate(scenario.stages, 1):
        verb = stage.verb
        progress(f"stage {number} of {len(scenario.stages)}: {verb}")
        start = StageStart(scenario, orbit, number, states, results[-1].end if results else 0.0, past)
        if stage.name is not None:
            past[stage.name] = start.time, states
        try:
            result = FLIES[type(stage)](start, stage)
        except ValueError as error:
            raise ScenarioError(scenario.file, [f"stage[{number}]: {error}"]) from error
        results.append(result)
        if result.failure is not None:
            return Mission(scenario, orbit, tuple(results), f"stage {number} ({verb}): {result.failure}")
        states = result.after.paths.state(result.end)
    return Mission(scenario, orbit, tuple(results))


def coast(start: StageStart, stage: Coast) -> StageResult[Coast, None]:
    """Nobody burns."""
    flight = start.coasts(stage.length.on(start.orbit.mean_motion))
    return StageResult(start.number, stage, start.time, flight, flight, None)


def avoid(start: StageStart, stage: Avoid) -> StageResult[Avoid, AvoidResult]:
    """One craft moves; the others coast or fly their own transfers and do not give way."""
    from closeform.planning.avoid import Around
    from closeform.planning.plan import weakness

    names, asked = start.scenario.names, stage.within.on(start.orbit.mean_motion)
    targets = {fellow.craft: fellow.to for fellow in stage.meanwhile}
    mover = names.index(stage.craft)
    rest = tuple(name for name in names if name != stage.craft)

    def other(name: str, duration: float) -> Path:
        k = names.index(name)
        if name not in targets:
            return start.coast(k, duration)
        path = start.transfer(targets[name], k, asked)
        later = start.time + duration - path.end
        return join([path, start.orbit.coast(path.state(path.end), later, path.end)]) if later > 0.0 else path

    def flight(path: Path) -> Flight:
        around = [other(name, path.end - start.time) for name in rest]
        return start.flight([*around[:mover], path, *around[mover:]])

    def way(factor: float) -> Path:
        if stage.to is None:
            return start.coast(mover, factor * asked)
        return start.transfer(stage.to, mover, factor * asked)

    craft, zones, direct = start.scenario.craft[mover], start.scenario.zones_around(stage.craft), way(1.0)
    others = [other(name, far_beyond(asked, start.orbit.mean_motion)) for name in rest]
    task = Around.of(start.orbit, others, zones, stage.method, None, rest)
    if craft.max_thrust is None:
        avoidance = task.plan(direct)
    else:
        avoidance = task.keep(
            craft.max_acceleration, lambda factor: way(factor) if factor != 1.0 else direct, stage.longer
        )
    if avoidance.weak is not None:
        avoidance = replace(avoidance, reason=weakness(avoidance.weak, craft.name, craft.mass))
    before = flight(direct)
    after = flight(avoidance.path) if avoidance.path not in (None, direct) else before
    late = too_late(start, stage, after, {craft.name: avoidance.punctual})
    plain = way((after.end - start.time) / asked) if late is not None else direct
    result = AvoidResult(stage.craft, rest, zones, direct, plain, avoidance, asked)
    failure = None if avoidance.ok else avoidance.reason
    return StageResult(start.number, stage, start.time, before, after, result, failure, avoidance.ok, late)


def scatter(start: StageStart, stage: Scatter) -> StageResult[Joint, ReconfigureResult]:
    """All craft spread out."""
    from closeform.planning.targets import scattered, scattered_from

    def goals(duration: float) -> Floats:
        try:
            if stage.factor is not None:
                return scattered(start.orbit, start.states, duration, stage.factor)
            return scattered_from(start.orbit, start.states, duration, *stage.away)
        except ValueError as error:
            raise ValueError(f"{named(str(error), start.scenario.names)}; change within") from None

    return together(start, stage, goals)


def regather(start: StageStart, stage: Regather) -> StageResult[Joint, ReconfigureResult]:
    """All craft return to the relative orbits that they had at the start of an earlier stage."""
    from closeform.planning.targets import regathered

    time, states = start.past[stage.as_before]
    return together(
        start, stage, lambda duration: regathered(start.orbit, states, start.time + duration - time)
    )


def reconfigure(start: StageStart, stage: Reconfigure) -> StageResult[Joint, ReconfigureResult]:
    """Craft move to new relative orbits."""
    from closeform.planning import targets

    names, to = start.scenario.names, stage.to
    who = [names.index(name) for name in stage.movers or names]

    def goals(duration: float) -> Floats:
        coasted = np.asarray(start.states @ start.orbit.transition(duration).T)
        slots = stage.known(start.orbit, len(who), start.latitude(duration))
        if slots is not None:
            centre = coasted[who].mean(axis=0) if isinstance(to, Goal) and to.line is not None else 0.0
            return np.asarray(slots + centre)
        if isinstance(to, Goal) and to.join is not None:
            members = [names.index(name) for name in to.join]
            return targets.added_member(start.orbit, coasted[members])[None]
        if isinstance(to, Goal) and to.remove == "eccentricity":
            return targets.without_eccentricity(start.orbit, coasted[who])
        return targets.without_altitude_difference(start.orbit, coasted[who])

    return together(start, stage, goals)


def together(start: StageStart, stage: Joint, goals: Goals) -> StageResult[Joint, ReconfigureResult]:
    """A formation moves to its `goals` in one plan; craft that do not move coast, and are kept clear of."""
    names = start.scenario.names
    movers = stage.movers or names
    others = tuple(name for name in names if name not in movers)
    who = [names.index(name) for name in movers]
    plan, measures = planned(start, stage, goals, who, [names.index(name) for name in others])
    asked = stage.within.on(start.orbit.mean_motion)
    before = start.mixed(who, plan.direct)
    after = start.mixed(who, plan.paths) if plan.paths is not None and plan.contacts else before
    punctual = plan.punctual.tolist() if plan.punctual is not None else [None] * len(movers)
    late = too_late(start, stage, after, dict(zip(movers, punctual, strict=True)))
    failure = None if plan.ok else f"{plan.status}: {plan.reason}"
    result = ReconfigureResult(movers, others, asked, plan, measures)
    return StageResult(start.number, stage, start.time, before, after, result, failure, plan.ok, late)


def planned(
    start: StageStart, stage: Joint, goals: Goals, who: list[int], rest: list[int]
) -> tuple["Plan", tuple[str, ...]]:
    """The plan for the craft `who` around those that coast, and what was tried.

    Where craft arrive later than asked for, goals that move are aimed at anew, where they are then.
    """
    from closeform.planning.plan import Status, weakness
    from closeform.planning.reconfigure import reconfigure

    scenario = start.scenario
    limits = np.array([scenario.craft[k].max_acceleration for k in who])
    order = None
    if stage.plan == "sequential":
        order = [who.index(scenario.names.index(name)) for name in stage.order or ()]
        order += [k for k in range(len(who)) if k not in order]
    duration = stage.within.on(start.orbit.mean_motion)
    measures: tuple[str, ...] = ()
    punctual: Floats | None = None
    for attempt in range(AGAIN):
        slots = goals(duration)
        plan = reconfigure(
            start.orbit,
            start.states[who],
            slots,
            duration,
            [scenario.keep_out[k] for k in who + rest],
            assign=stage.assigns,
            start=start.time,
            obstacles=[start.coast(k, far_beyond(duration, start.orbit.mean_motion)) for k in rest],
            max_acceleration=limits if np.isfinite(limits).any() else None,
            if_blocked=stage.if_blocked,
            method=stage.plan,
            order=order,
            names=[scenario.names[k] for k in who + rest],
        )
        measures += plan.measures
        punctual = punctual if attempt else plan.punctual  # of the duration asked for
        plan = replace(plan, punctual=punctual)
        if plan.weak is not None:
            weak = scenario.craft[who[plan.weak.craft]]
            plan = replace(plan, reason=weakness(plan.weak, weak.name, weak.mass))
        took = float(np.max(plan.starts + plan.durations)) - start.time
        if not plan.ok or abs(took - duration) <= ROUNDING * duration:
            return plan, measures
        if np.array_equal(goals(took), slots):
            return plan, measures  # they hold whenever craft arrive
        duration = took * SLACK if attempt else took
        measures += (f"aims at where the relative orbits are after {duration:.6g} s",)
    reason = f"the relative orbits move on faster than craft arrive, up to {took:.6g} s"
    late = replace(plan, paths=None, energy=nan, delta_v=nan, status=Status.TOO_WEAK, reason=reason)
    return late, measures


def lock(start: StageStart, stage: Lock) -> StageResult[Lock, FirstLocks]:
    """All craft coast through the search; who sees whom, and when."""
    from closeform.search.locks import lock_times

    search, pairs, names = start.scenario.plan, start.scenario.opposite, start.scenario.names
    relative = start.states[pairs[:, 1]] - start.states[pairs[:, 0]]
    found = FirstLocks(search, pairs, lock_times(search, relative[:, :3], relative[:, 3:]))
    failure = None
    if never := [f"{names[i]} - {names[j]}" for i, j in found.missing]:
        some = ", ".join(never[:NAMED]) + ", ..." * (len(never) > NAMED)
        failure = f"{len(never)} of {len(pairs)} pairs never lock: {some}"
    flight = start.coasts(search.duration)
    return StageResult(start.number, stage, start.time, flight, flight, found, failure)


def gather(start: StageStart, stage: Gather) -> StageResult[Gather, Gathering]:
    """Lost craft search, lock and join, until one formation holds them all or the rounds are over."""
    from closeform.search.gather import gather

    scenario, states = start.scenario, start.states
    found = gather(scenario.plan, states[:, :3], states[:, 3:], **scenario.gathering(stage))
    arcs = found.paths.arcs.copy()
    arcs[:, [START, END]] += start.time
    flight = watch(replace(found.paths, arcs=arcs), scenario.names, scenario.zones)
    failure = None if found.ok else who_is_left(found.sets, found.lost, found.rounds, scenario.names)
    return StageResult(start.number, stage, start.time, flight, flight, found, failure)


def named(text: str, names: tuple[str, ...]) -> str:
    """A text that counts, "craft 0 and 3", with names instead."""

    def called(found: re.Match[str]) -> str:
        return " and ".join(names[int(number)] for number in re.findall(r"\d+", found[0]))

    return re.sub(r"\bcraft \d+(?: and \d+\b)?", called, text)


FLIES: dict[type[StageTable], Callable[[StageStart, Any], StageResult[Any, Any]]] = {
    Coast: coast,
    Avoid: avoid,
    Scatter: scatter,
    Regather: regather,
    Reconfigure: reconfigure,
    Lock: lock,
    Gather: gather,
}
