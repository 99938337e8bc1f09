"""Stages in which a run would stop, as two craft are too near each other where neither can give way.

Known before anybody plans: where craft begin, where those end that are told where, and who coasts.
"""

from collections.abc import Iterator

import numpy as np

from closeform.arrays import Floats
from closeform.motion.orbit import Orbit
from closeform.scenario.formation import Goal, Target
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
        if not isinstance(stage, Coast | Moving):
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
        held = (padded.norm(apart) <= ON) & (np.isin(first, who) | np.isin(second, who))
        for k in np.flatnonzero(held):
            names = f"{scenario.names[first[k]]} and {scenario.names[second[k]]}"
            short = Short.of(zone, apart[k], margin)
            less = "" if short.inside else ", or leave less margin"
            yield f"{names} {{}} at {short}; move one of them{less}"
