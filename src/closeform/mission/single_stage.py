"""Stages in which one spacecraft moves: with avoidance of the others, or without regard to them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import WatchedFlight
from closeform.conflicts.two_paths import closest_approach
from closeform.mission.mission_result import AvoidResult, StageResult, TransferResult
from closeform.mission.stage_margin import with_margin
from closeform.mission.stage_start import StageStart, too_late
from closeform.mission.thruster_firing import pulsed
from closeform.motion.joining import join, stack
from closeform.motion.minimum_delta_v.within_limit import TooLittleThrust
from closeform.motion.path import Path
from closeform.scenario import Avoid, Transfer
from closeform.scenario.path_requirements import ApproachSpeed, Corridor, Waypoint, built_all
from closeform.zones.zone import ON, Zone

# scenario keys of the requirements that a start or an end can break, by the name in the planner's messages
REQUIREMENT_KEYS = {Corridor.kind: "corridor", ApproachSpeed.kind: "speed_limit", Waypoint.kind: "waypoints"}


def avoid(start: StageStart, stage: Avoid) -> StageResult[Avoid, AvoidResult]:
    """Move one spacecraft with avoidance, and return the result of the stage.

    The others coast or follow their own transfers, and do not give way.
    """
    return pulsed(start, lambda later: around(later, stage))


def around(start: StageStart, stage: Avoid) -> StageResult[Avoid, AvoidResult]:
    """Plan the avoidance trajectory of one spacecraft around the others, and return the result."""
    from closeform.planning.plan import Plan, weakness
    from closeform.planning.request import Request

    names, asked = start.scenario.names, start.asked(stage)
    mover = names.index(stage.craft)
    goals = {
        fellow.craft: start.arrival(fellow.to, names.index(fellow.craft), asked, stage.cost)
        for fellow in stage.meanwhile
    }
    rest = tuple(name for name in names if name != stage.craft)
    own = start.transfer if stage.cost == "energy" else start.own_transfer  # the latter keeps limits
    moves = {
        name: own(goals[name].target, names.index(name), asked, stage.cost) for name in rest if name in goals
    }

    def other(name: str, duration: float) -> Path:
        if name not in moves:
            return start.coast(names.index(name), duration)
        path = moves[name]
        later = start.time + duration - path.end
        return join([path, start.orbit.coast(path.state(path.end), later, path.end)]) if later > 0.0 else path

    chosen = [mover, *(names.index(name) for name in rest)]
    known = start.planned_errors(stage, chosen)
    drift = start.planned_drift(stage)
    seen = start.known_for(asked + (drift or 0.0))
    others = [other(name, seen) for name in rest]
    zones = tuple(zone for zone in start.zones.around(mover) if zone is not None)

    def clear(finals: Floats) -> Any:
        return outside(finals, others, zones, start.time + asked, drift or 0.0)

    to = None
    if stage.to is not None:
        goals[stage.craft] = start.arrival(stage.to, mover, asked, stage.cost, clear)
        to = goals[stage.craft].target

    def flight(path: Path) -> WatchedFlight:
        around = [other(name, path.end - start.time) for name in rest]
        return start.flight([*around[:mover], path, *around[mover:]])

    def direct_path(factor: float) -> Path:
        if to is None:
            return start.coast(mover, factor * asked)
        task = to, mover, factor * asked, stage.cost
        if stage.cost == "energy":
            return start.transfer(*task)
        try:
            return start.own_transfer(*task)
        except TooLittleThrust:
            return start.transfer(*task)  # the planner then reports the lack of thrust

    craft, direct = start.scenario.craft[mover], direct_path(1.0)
    thrusters = start.thrusters(mover, stage.cost)
    limited = craft.limited and thrusters is None
    errors = {} if known is None else {"errors": known[0], "other_errors": known[1:], "sigmas": stage.sigmas}

    bodies, wanted = stack([direct, *others]), built_all(stage, start.time, start.orbit.period)
    required = {key: one._among(bodies, 0) for key, one in wanted.items()}

    def made(margin: Any) -> Plan:
        request = Request.of_path(
            direct,
            others,
            zones,
            stage.method,
            path_over=direct_path,
            max_acceleration=craft.max_acceleration if limited else None,
            longer=stage.longer,
            name=craft.name,
            names=rest,
            cost=stage.cost,
            thrusters=thrusters,
            drift=drift,
            margin=margin,
            prove=stage.proving.seconds,
            gap=stage.proving.gap,
            requirements=tuple(required.values()),
            **errors,
        )
        return start.plan(request)

    plan = with_margin(start, stage, chosen, others, made)
    if plan.weak is not None:
        plan = replace(plan, reason=weakness(plan.weak, craft.name, start.scenario.force_mass(craft.name)))
    before = flight(direct)
    changed = plan.paths is not None and not np.array_equal(plan.paths.arcs, direct.arcs)
    after = flight(plan.path) if changed else before
    punctual = None if plan.punctual is None else float(plan.punctual[0])
    late = too_late(start, stage, after, {craft.name: punctual})
    plain = direct_path((after.end - start.time) / asked) if late is not None else direct
    asked_for = start.scenario.zones_around(craft.name)  # zones of the scenario, not enlarged for pulses
    result = AvoidResult(stage.craft, rest, asked_for, direct, plain, plan, asked, goals, required)
    failure = None if plan.ok else plan.reason
    for kind, key in REQUIREMENT_KEYS.items():
        failure = failure and failure.replace(f"its {kind}", f"its {key}")
    return StageResult(start.number, stage, start.time, before, after, result, failure, plan.ok, late)


def outside(finals: Floats, others: Sequence[Path], zones: Sequence[Zone], time: float, drift: float) -> Any:
    """Return a mask (S,) of the final states (S, 6) that are outside of all zones at a `time` [s].

    A free drift from the state must stay clear for `drift` [s] as well.  `zones` has one zone per path of
    `others`.
    """
    ratios = [
        zone.norm(finals[:, :3] - path.position(time)) for path, zone in zip(others, zones, strict=True)
    ]
    if drift > 0.0 and others:
        coasts = others[0].orbit.coast(finals, drift, start=time)
        ratios += [
            closest_approach(coasts, path, zone).ratio for path, zone in zip(others, zones, strict=True)
        ]
    return np.all(np.array(ratios) > ON, axis=0)


def transfer(start: StageStart, stage: Transfer) -> StageResult[Transfer, TransferResult]:
    """Move one spacecraft within its thrust limit and the given time, and return the result of the stage.

    The others coast.
    """
    return pulsed(start, lambda later: moved(later, stage))


def moved(start: StageStart, stage: Transfer) -> StageResult[Transfer, TransferResult]:
    """Plan the transfer of one spacecraft without avoidance, and return the result."""
    names, asked = start.scenario.names, start.asked(stage)
    k = 0 if stage.craft is None else names.index(stage.craft)
    goal = start.arrival(stage.to, k, asked, stage.cost)
    to = goal.target
    initial, final = start.states[k], start.goal(to, asked)
    failure = None
    free = path = start.transfer(to, k, asked, stage.cost)
    try:
        path = start.own_transfer(to, k, asked, stage.cost)
    except ValueError as error:
        failure = str(error)
    before, after = (start.mixed([k], one) for one in (free, path))
    result = TransferResult(names[k], initial, final, asked, free, goal)
    return StageResult(start.number, stage, start.time, before, after, result, failure, failure is None)
