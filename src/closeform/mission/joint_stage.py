"""Stages in which one plan moves a whole formation: scatter, regather and reconfigure."""

from collections.abc import Callable
from dataclasses import replace
from math import inf, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import ReconfigureResult, StageResult
from closeform.mission.stage_margin import with_margin
from closeform.mission.stage_start import StageStart, too_late
from closeform.mission.thruster_firing import pulsed
from closeform.named_craft import named
from closeform.scenario import Goal, Joint, Reconfigure, Regather, Scatter

if TYPE_CHECKING:
    from closeform.planning.plan import Plan

AGAIN = 20  # maximum number of plans for goals that depend on the arrival time
ROUNDING = 1e-9  # relative tolerance of the duration
SLACK = 1.01  # factor on the duration from the second iteration on, so that the iteration converges

Goals = Callable[[float], Floats]  # duration of the stage [s] -> slots (S, 6)
Moved = StageResult[Joint, ReconfigureResult]


def scatter(start: StageStart, stage: Scatter) -> Moved:
    """Spread all spacecraft in one plan, and return the result of the stage."""
    from closeform.planning.targets import scattered, scattered_from

    def goals(duration: float) -> Floats:
        try:
            if stage.factor is not None:
                return scattered(start.orbit, start.states, duration, stage.factor)
            return scattered_from(start.orbit, start.states, duration, *stage.away)
        except ValueError as error:
            raise ValueError(f"{named(str(error), start.scenario.names)}; change within") from None

    return pulsed(start, lambda later: together(later, stage, goals))


def regather(start: StageStart, stage: Regather) -> Moved:
    """Move all spacecraft back to the relative orbits of an earlier stage's start, and return the result."""
    from closeform.planning.targets import regathered

    time, states = start.past[stage.as_before]

    def goals(duration: float) -> Floats:
        return regathered(start.orbit, states, start.time + duration - time)

    return pulsed(start, lambda later: together(later, stage, goals))


def reconfigure(start: StageStart, stage: Reconfigure) -> Moved:
    """Move spacecraft to new relative orbits in one plan, and return the result of the stage."""
    from closeform.planning import targets

    names, to = start.scenario.names, stage.to
    moving = [names.index(name) for name in stage.moving(names)]

    def goals(duration: float) -> Floats:
        coasted = np.asarray(start.states @ start.orbit.transition(duration, start.time).T)
        slots = stage.known(start.orbit, len(moving), start.latitude(duration))
        if slots is not None:
            return stage.centred(slots, coasted[moving])
        if isinstance(to, Goal) and to.join is not None:
            members = [names.index(name) for name in to.join]
            return targets.added_member(start.orbit, coasted[members])[None]
        if isinstance(to, Goal) and to.remove == "eccentricity":
            return targets.without_eccentricity(start.orbit, coasted[moving])
        return targets.without_altitude_difference(start.orbit, coasted[moving])

    return pulsed(start, lambda later: together(later, stage, goals))


def together(start: StageStart, stage: Joint, goals: Goals) -> Moved:
    """Plan the move of a formation to its `goals`, and return the result of the stage.

    Spacecraft that do not move coast, and the plan keeps clear of them.
    """
    from closeform.planning.plan import Status

    names = start.scenario.names
    movers = stage.moving(names)
    others = tuple(name for name in names if name not in movers)
    moving = [names.index(name) for name in movers]
    plan, measures = planned(start, stage, goals, moving, [names.index(name) for name in others])
    asked = start.asked(stage)
    before = start.mixed(moving, plan.direct)
    changed = plan.status is Status.AVOIDED
    after = start.mixed(moving, plan.paths) if changed and plan.paths is not None else before
    punctual = plan.punctual.tolist() if plan.punctual is not None else [None] * len(movers)
    late = too_late(start, stage, after, dict(zip(movers, punctual, strict=True)))
    failure = None if plan.ok else f"{plan.status}: {plan.reason}"
    result = ReconfigureResult(movers, others, asked, plan, measures)
    return StageResult(start.number, stage, start.time, before, after, result, failure, plan.ok, late)


def planned(
    start: StageStart, stage: Joint, goals: Goals, moving: list[int], rest: list[int]
) -> tuple["Plan", tuple[str, ...]]:
    """Return the plan of the craft `moving`, clear of the coasting craft `rest`, and the further attempts.

    If spacecraft arrive later than requested, moving goals are updated to the later time, and the formation
    is planned again.
    """
    from closeform.planning.plan import Status, weakness
    from closeform.planning.request import Request

    scenario = start.scenario
    thrusters = [start.thrusters(k, stage.cost) for k in moving]
    limits = np.array(  # accelerations of the initial mass
        [
            inf if own is not None else scenario.craft[k].max_acceleration
            for k, own in zip(moving, thrusters, strict=True)
        ]
    )
    order = None
    if stage.plan != "joint":
        order = [moving.index(scenario.names.index(name)) for name in stage.order or ()]
        order += [k for k in range(len(moving)) if k not in order]
    duration, known = start.asked(stage), start.planned_errors(stage, moving + rest)
    drift = start.planned_drift(stage)
    seen = start.known_for(duration + (drift or 0.0))
    coasting = [start.coast(k, seen) for k in rest]
    measures: tuple[str, ...] = ()
    punctual: Floats | None = None
    for attempt in range(AGAIN):
        slots = start.earlier(goals(duration + start.room.time))

        def made(margin: Any, slots: Floats = slots, duration: float = duration) -> "Plan":
            request = Request.of_formation(
                start.orbit,
                start.states[moving],
                slots,
                duration,
                [start.keep_out[k] for k in moving + rest],
                assign=stage.assigns,
                start=start.time,
                obstacles=coasting,
                max_acceleration=limits if np.isfinite(limits).any() else None,
                if_blocked=stage.if_blocked,
                method=stage.plan,
                order=order,
                names=[scenario.names[k] for k in moving + rest],
                cost=stage.cost,
                thrusters=thrusters if any(own is not None for own in thrusters) else None,
                errors=known,
                sigmas=stage.sigmas or 0.0,
                drift=drift,
                margin=margin,
                prove=stage.proving.seconds,
                gap=stage.proving.gap,
            )
            return start.plan(request)

        plan = with_margin(start, stage, moving + rest, coasting, made)
        measures += plan.measures
        punctual = punctual if attempt else plan.punctual  # for the requested duration
        plan = replace(plan, punctual=punctual)
        if plan.weak is not None:
            weak = scenario.craft[moving[plan.weak.craft]]
            plan = replace(plan, reason=weakness(plan.weak, weak.name, scenario.force_mass(weak.name)))
        took = float(np.max(plan.starts + plan.durations)) - start.time
        if not plan.ok or abs(took - duration) <= ROUNDING * duration:
            return plan, measures
        if np.array_equal(start.earlier(goals(took + start.room.time)), slots):
            return plan, measures  # these goals do not depend on the arrival time
        duration = took * SLACK if attempt else took
        measures += (f"targets on the relative orbits after {duration:.6g} s",)
    reason = f"no arrival at the moving relative orbits within {took:.6g} s"
    late = replace(plan, paths=None, energy=nan, delta_v=nan, status=Status.TOO_WEAK, reason=reason)
    return late, measures
