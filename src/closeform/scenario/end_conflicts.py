"""Conflicts that are known before any plan is computed: of initial states, and of final states."""

from collections.abc import Iterator

import numpy as np

from closeform.arrays import Floats
from closeform.motion.orbit import Orbit
from closeform.scenario.formation import Goal, Target
from closeform.scenario.quantity import span
from closeform.scenario.scenario import Scenario
from closeform.scenario.stages import Avoid, Coast, Gather, Joint, Reconfigure, Transfer
from closeform.zones.combined_zones import REGION
from closeform.zones.padding import Short
from closeform.zones.pair_zones import PairZones, portions, portions_near
from closeform.zones.shapes import CYLINDER, FACES
from closeform.zones.zone import ON

MOST_PAIRS = 100_000  # largest number of pairs that is checked
Moving = Avoid | Joint | Transfer


def stops(scenario: Scenario) -> tuple[str, ...]:
    """Return one line for each pair that stops a run, with its stage and reason; empty if none is known."""
    if scenario.scattered or scenario.zones.pairs > MOST_PAIRS:
        return ()
    orbit, time = scenario.orbit.build(), 0.0
    states = scenario.states(orbit)
    for number, stage in enumerate(scenario.stages, 1):
        if not isinstance(stage, Coast | Moving) or (
            isinstance(stage, Coast) and (stage.burns or stage.follow)
        ):
            return ()
        lasts = (stage.length if isinstance(stage, Coast) else stage.within).on(orbit.period)
        coasted, time = states @ orbit.transition(lasts, time).T, time + lasts
        if isinstance(stage, Coast):
            states = coasted
            continue
        movers = [scenario.names.index(name) for name in stage.moving(scenario.names)]
        latitude = scenario.orbit.latitude + 2.0 * np.pi / orbit.period * time
        after = end_states(orbit, stage, coasted, movers, latitude)
        if stage.keeps_out:
            margin = stage.margin if isinstance(stage, Avoid | Joint) else None
            room = margin if isinstance(margin, float) else 0.0
            planned = (
                movers[:1] if isinstance(stage, Avoid) else movers
            )  # other moving craft do not avoid others
            for verb, places in (("start", states), ("end", after)):
                if places is not None and (found := [*pairs_inside(scenario, places, planned, room)]):
                    return tuple(f"stage[{number}]: {pair.format(verb)}" for pair in found)
            opened = after if after is not None else open_end_states(orbit, stage, coasted, movers, latitude)
            if found := [*unsafe_ends(scenario, orbit, stage, opened, planned)]:
                return tuple(f"stage[{number}]: {pair}" for pair in found)
        if after is None or can_be_late(scenario, stage, movers):
            return ()
        states = after
    return ()


def end_states(
    orbit: Orbit, stage: Moving, coasted: Floats, movers: list[int], latitude: float
) -> Floats | None:
    """Return the states (N, 6) of all craft after a stage, given their `coasted` states.

    Return None if the final states depend on the plan.
    """
    after = coasted.copy()
    if isinstance(stage, Joint):
        if not isinstance(stage, Reconfigure) or stage.assigns:
            return None
        if (finals := stage.known(orbit, len(movers), latitude)) is None:
            return None
        after[movers] = stage.centred(finals, coasted[movers])
        return after
    targets = (
        [stage.to, *(fellow.to for fellow in stage.meanwhile)] if isinstance(stage, Avoid) else [stage.to]
    )
    for k, target in zip(movers, targets, strict=True):
        if target is not None and target.is_open:
            return None
        after[k] = coasted[k] if target is None else target.state(orbit, latitude)
    return after


def open_end_states(
    orbit: Orbit, stage: Moving, coasted: Floats, movers: list[int], latitude: float
) -> Floats | None:
    """Return the final states (N, 6) at an arbitrary phase if only the phase is open, else None.

    A drift of at least one orbit passes through every phase, so that any phase serves.
    """
    if not isinstance(stage, Avoid) or stage.to is None or stage.meanwhile or stage.drift is None:
        return None
    if not stage.to.is_open or not stage.drift.on(orbit.period) >= orbit.period:
        return None
    return end_states(
        orbit, stage.model_copy(update={"to": stage.to.at_phase(0.0)}), coasted, movers, latitude
    )


def unsafe_ends(
    scenario: Scenario, orbit: Orbit, stage: Moving, after: Floats | None, planned: list[int]
) -> Iterator[str]:
    """Yield a line for each pair in conflict during free drift from a passively safe plan's final states.

    Both craft are planned, or one is planned and the other does not avoid it.
    """
    hill = scenario.orbit.model == "hill"  # otherwise the planner finds it, or a check afterwards
    safe = hill and isinstance(stage, Avoid | Joint) and stage.is_exact and stage.plans_drift
    joint = isinstance(stage, Joint)
    if (
        after is None
        or stage.drift is None
        or not safe
        or (joint and any(map(depends_on_arrival, stage.targets.values())))
    ):
        return
    from closeform.conflicts.two_paths import closest_approach  # only this check needs its kernels

    drift = stage.drift.on(orbit.period)
    for zone, first, second in portions(scenario.zones):
        for i, j in zip(first.tolist(), second.tolist(), strict=True):
            if (i in planned) + (j in planned) < (2 if joint else 1):
                continue
            met = closest_approach(orbit.coast(after[i], drift), orbit.coast(after[j], drift), zone)
            if met.ratio <= ON:
                drifting = f"{scenario.names[i]} and {scenario.names[j]} drift to"
                yield (
                    f"{drifting} {met.ratio:.2f} x zone, {span(met.time)} later: no plan with that end is "
                    "passively safe; end farther out, reduce drift, or use a smaller zone"
                )


def can_be_late(scenario: Scenario, stage: Moving, movers: list[int]) -> bool:
    """Return True if a stage may take longer than requested and later states depend on its duration."""
    limited = any(scenario.craft_in(stage)[k].limited for k in movers)
    if not isinstance(stage, Joint):
        return limited
    coast = len(movers) < len(scenario.craft)
    goals = (target for one in scenario.stages for target in one.targets.values())
    return (limited or stage.if_blocked != ()) and (coast or any(map(depends_on_arrival, goals)))


def depends_on_arrival(target: Target | Goal) -> bool:
    """Return True if the target state depends on the arrival time."""
    return target.line is not None if isinstance(target, Goal) else target.roe is not None


def pairs_inside(scenario: Scenario, states: Floats, movers: list[int], margin: float) -> Iterator[str]:
    """Yield a line, with a remedy, for each pair with one of `movers` inside its zone plus `margin` [m]."""
    for zone, first, second in portions(scenario.zones):
        apart = states[first, :3] - states[second, :3]
        padded = zone.padded(margin) if margin else zone
        held = (padded._norm(apart) <= ON) & (np.isin(first, movers) | np.isin(second, movers))
        for k in np.flatnonzero(held):
            names = f"{scenario.names[first[k]]} and {scenario.names[second[k]]}"
            short = Short.of(zone, apart[k], margin)
            less = "" if short.inside else ", or leave less margin"
            yield f"{names} {{}} at {short}; move one of them{less}"


MOST_NAMED = 100  # largest number of pairs that are named


def zone_conflicts(scenario: Scenario, orbit: Orbit) -> Iterator[str]:
    """Yield an error line for each pair without a common zone or with a conflict at the start."""
    try:
        kept = scenario.zones
    except ValueError as error:
        yield f"craft.keep_out: {error}"
        return
    unlike = any(zone.shape in (CYLINDER, FACES) for zone in kept.zones)
    for number, stage in enumerate(scenario.stages, 1):
        if unlike and isinstance(stage, Gather):
            yield (
                f"craft.keep_out: stage[{number}] ({stage.verb}) supports only a sphere, box, ellipsoid or "
                "covariance zone; use one that encloses the present zones"
            )
    if not scenario.scattered:  # otherwise every case has its own positions
        places = scenario.states(orbit)
        remedy = "move one of them or make keep_out smaller"
        deep, count = first_pairs_inside(places, kept)
        for one, other, ratio in deep:
            names = f"{scenario.names[one]} and {scenario.names[other]}"
            yield f"craft.position: {names} start inside each other's zone, at {ratio}; {remedy}"
        if count > len(deep):
            yield f"craft.position: {count} pairs in all start inside each other's zone; {remedy}"


def first_pairs_inside(states: Floats, kept: PairZones) -> tuple[list[tuple[int, int, str]], int]:
    """Return the first pairs in conflict, each with its clearance ratio as text, and the count of all."""
    found: list[tuple[int, int, str]] = []
    count = 0
    for zone, first, second in portions_near(kept, states[:, :3]):
        ratios = zone._norm(states[first, :3] - states[second, :3])
        deep = np.flatnonzero(ratios <= 1.0)
        count += len(deep)
        for k in deep[: MOST_NAMED - len(found)]:
            one, other = int(first[k]), int(second[k])
            made = "" if (rule := kept.rule(one, other)) == REGION else f" ({rule})"
            found.append((one, other, f"{ratios[k]:.2f} x zone{made}"))
    return found, count
