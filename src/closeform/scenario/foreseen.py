"""Stages in which a run would stop, as two craft are too near each other where neither can give way.

Known before anybody plans: where craft begin, where those end that are told where, and who coasts; of a plan
that is to be passively safe also where they drift from there.
"""

from collections.abc import Iterator

import numpy as np

from closeform.arrays import Floats
from closeform.motion.orbit import Orbit
from closeform.scenario.formation import Goal, Target
from closeform.scenario.quantity import span
from closeform.scenario.scenario import Scenario
from closeform.scenario.stages import Avoid, Coast, Joint, Reconfigure, Transfer
from closeform.zones.padding import Short
from closeform.zones.pair_zones import portions
from closeform.zones.zone import ON

MOST_PAIRS = 100_000  # that are looked at
Moving = Avoid | Joint | Transfer


def stops(scenario: Scenario) -> tuple[str, ...]:
    """In which stage a run would stop for that, and why, one line for each pair; none if it is not known."""
    if scenario.scattered or scenario.zones.pairs > MOST_PAIRS:
        return ()
    orbit, time = scenario.orbit.build(), 0.0
    states = scenario.states(orbit)
    for number, stage in enumerate(scenario.stages, 1):
        if not isinstance(stage, Coast | Moving) or (
            isinstance(stage, Coast) and (stage.burns or stage.follow)
        ):
            return ()
        lasts = (stage.length if isinstance(stage, Coast) else stage.within).on(orbit.mean_motion)
        coasted, time = states @ orbit.transition(lasts).T, time + lasts
        if isinstance(stage, Coast):
            states = coasted
            continue
        who = [scenario.names.index(name) for name in stage.moving(scenario.names)]
        latitude = scenario.orbit.latitude + orbit.mean_motion * time
        after = ends(orbit, stage, coasted, who, latitude)
        if stage.keeps_out:
            margin = stage.margin if isinstance(stage, Avoid | Joint) else None
            room = margin if isinstance(margin, float) else 0.0
            planned = who[:1] if isinstance(stage, Avoid) else who  # fellows give way to nobody
            for verb, places in (("start", states), ("end", after)):
                if places is not None and (found := [*near(scenario, places, planned, room)]):
                    return tuple(f"stage[{number}]: {pair.format(verb)}" for pair in found)
            opened = after if after is not None else open_end(orbit, stage, coasted, who, latitude)
            if found := [*adrift(scenario, orbit, stage, opened, planned)]:
                return tuple(f"stage[{number}]: {pair}" for pair in found)
        if after is None or later(scenario, stage, who):
            return ()
        states = after
    return ()


def ends(orbit: Orbit, stage: Moving, coasted: Floats, who: list[int], latitude: float) -> Floats | None:
    """Where all craft (N, 6) are after a stage, `coasted` being where they coast to; None if plans say."""
    after = coasted.copy()
    if isinstance(stage, Joint):
        if not isinstance(stage, Reconfigure) or stage.assigns:
            return None
        if (finals := stage.known(orbit, len(who), latitude)) is None:
            return None
        after[who] = stage.centred(finals, coasted[who])
        return after
    targets = (
        [stage.to, *(fellow.to for fellow in stage.meanwhile)] if isinstance(stage, Avoid) else [stage.to]
    )
    for k, target in zip(who, targets, strict=True):
        if target is not None and target.is_open:
            return None
        after[k] = coasted[k] if target is None else target.state(orbit, latitude)
    return after


def open_end(orbit: Orbit, stage: Moving, coasted: Floats, who: list[int], latitude: float) -> Floats | None:
    """The same at any phase where only that is open, and a drift of an orbit comes through all of them."""
    if not isinstance(stage, Avoid) or stage.to is None or stage.meanwhile or stage.drift is None:
        return None
    if not stage.to.is_open or not stage.drift.on(orbit.mean_motion) >= orbit.period:
        return None
    return ends(orbit, stage.model_copy(update={"to": stage.to.at_phase(0.0)}), coasted, who, latitude)


def adrift(
    scenario: Scenario, orbit: Orbit, stage: Moving, after: Floats | None, planned: list[int]
) -> Iterator[str]:
    """Pairs that a plan which is to be safe when thrust is lost brings to where they drift together.

    Of craft that are planned, with each other and with those that give way to nobody.
    """
    safe = isinstance(stage, Avoid | Joint) and stage.is_exact and stage.plans_drift
    joint = isinstance(stage, Joint)
    if (
        after is None
        or stage.drift is None
        or not safe
        or (joint and any(map(moves, stage.targets.values())))
    ):
        return
    from closeform.conflicts.two_paths import closest_approach  # whose kernels only this needs

    drift = stage.drift.on(orbit.mean_motion)
    for zone, first, second in portions(scenario.zones):
        for i, j in zip(first.tolist(), second.tolist(), strict=True):
            if (i in planned) + (j in planned) < (2 if joint else 1):
                continue
            met = closest_approach(orbit.coast(after[i], drift), orbit.coast(after[j], drift), zone)
            if met.ratio <= ON:
                drifting = f"{scenario.names[i]} and {scenario.names[j]} end where they drift to"
                yield (
                    f"{drifting} {met.ratio:.2f} x zone, {span(met.time)} later: no plan with that end is "
                    "passively safe; end farther out, ask for less drift or keep a smaller zone"
                )


def later(scenario: Scenario, stage: Moving, who: list[int]) -> bool:
    """Whether a stage may take longer than asked, and where somebody is or goes depends on how long."""
    limited = any(scenario.craft_in(stage)[k].limited for k in who)
    if not isinstance(stage, Joint):
        return limited
    coast = len(who) < len(scenario.craft)
    told = (target for one in scenario.stages for target in one.targets.values())
    return (limited or stage.if_blocked != ()) and (coast or any(map(moves, told)))


def moves(target: Target | Goal) -> bool:
    """Whether where a target is depends on when one arrives."""
    return target.line is not None if isinstance(target, Goal) else target.roe is not None


def near(scenario: Scenario, states: Floats, who: list[int], margin: float) -> Iterator[str]:
    """Pairs with one of some craft that are within their zone padded by a margin [m], and what helps."""
    for zone, first, second in portions(scenario.zones):
        apart = states[first, :3] - states[second, :3]
        padded = zone.padded(margin) if margin else zone
        held = (padded._norm(apart) <= ON) & (np.isin(first, who) | np.isin(second, who))
        for k in np.flatnonzero(held):
            names = f"{scenario.names[first[k]]} and {scenario.names[second[k]]}"
            short = Short.of(zone, apart[k], margin)
            less = "" if short.inside else ", or leave less margin"
            yield f"{names} {{}} at {short}; move one of them{less}"
