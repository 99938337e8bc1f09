"""START HERE: a mission flies the stages of a scenario in order, each from where the last ended.

    scenario file -> Scenario -> fly -> Mission -> result folder, report, printed tables

No mathematics: a stage asks the orbit for paths, `screen` for conflicts, `avoid` for the way
around them, `reconfigure` for the paths of a whole formation, `lock_times` and `gather` for who
finds whom.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import nan
from typing import TYPE_CHECKING

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import Flight, watch
from closeform.motion.arc import END, START
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path, stack
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
    Target,
)
from closeform.stage_results import Change, FirstLocks, Leg, Reshaping

if TYPE_CHECKING:
    from closeform.planning.plan import Plan

# Kernels are compiled, or loaded, where they are imported: a stage imports those that it needs.

OBSERVED = 1e6  # times the duration of a move for which those that coast are looked at
AGAIN = 20  # times that a goal which depends on when one arrives is aimed at
ROUNDING = 1e-9
SLACK = 1.01  # by which later such times are stretched, so that they settle


@dataclass(frozen=True, eq=False)
class Mission:
    """All legs flown; `stopped` says why there are fewer than stages, else it is None."""

    scenario: Scenario
    orbit: Orbit
    legs: tuple[Leg, ...]
    stopped: str | None = None

    @property
    def clear(self) -> bool:
        """Whether every stage was flown and no encounter remains."""
        return self.stopped is None and not any(leg.after.encounters for leg in self.legs)

    @cached_property
    def delta_v(self) -> Floats:
        """What each craft spends in each leg (L, N) [m/s]."""
        spent = [leg.after.paths.delta_v for leg in self.legs]
        return np.array(spent).reshape(-1, len(self.scenario.craft))

    @cached_property
    def propellant(self) -> Floats:
        """What each craft burns in each leg (L, N) [kg]; nan for one without mass and specific impulse."""
        from closeform.planning.limits import propellant

        burnt = np.full(self.delta_v.shape, nan)
        for k, craft in enumerate(self.scenario.craft):
            if craft.mass is not None and craft.specific_impulse is not None:
                so_far = propellant(craft.mass, np.cumsum(self.delta_v[:, k]), craft.specific_impulse)
                burnt[:, k] = np.diff(so_far, prepend=0.0)
        return burnt

    @property
    def warnings(self) -> tuple[str, ...]:
        """Stages that take longer than asked, and craft that need more than they have, one line each."""
        lines = [leg.late for leg in self.legs if leg.late]
        flown = [leg.flown for leg in self.legs]
        for k, craft in enumerate(self.scenario.craft):
            spent, burnt = self.delta_v[flown, k].sum(), self.propellant[flown, k].sum()
            if craft.delta_v_budget is not None and spent > craft.delta_v_budget:
                lines.append(
                    f"{craft.name} needs {spent:.4g} m/s, its delta_v_budget is {craft.delta_v_budget:g} m/s"
                )
            if craft.propellant is not None and burnt > craft.propellant:
                lines.append(
                    f"{craft.name} needs {burnt:.4g} kg of propellant, it has {craft.propellant:g} kg"
                )
            if craft.max_thrust is not None and craft.mass is not None:
                peaks = (leg.after.paths[k].peak_thrust for leg in self.legs if leg.flown)
                force = max(peaks, default=0.0) * craft.mass
                if force > craft.max_thrust * (1.0 + ROUNDING):
                    lines.append(
                        f"{craft.name} needs {force:.4g} N, its max_thrust is {craft.max_thrust:g} N"
                    )
        return tuple(lines)


def fly(scenario: Scenario, progress: Callable[[str], None] = lambda text: None) -> Mission:
    """Fly a scenario's stages; `progress` is told what is under way.

    A move that finds no clear path or a search that leaves craft lost ends the mission; the Mission
    says so in `stopped`.  Raises ScenarioError for stages or starts that this version has not
    built, and for numbers that are beyond the mathematics.
    """
    if lines := scenario.unbuilt():
        raise ScenarioError(scenario.file, lines)
    orbit = scenario.orbit.build()
    states = np.array([craft.state(orbit) for craft in scenario.craft])
    legs: list[Leg] = []
    past: dict[str, tuple[float, Floats]] = {}
    for number, stage in enumerate(scenario.stages, 1):
        verb = stage.verb
        progress(f"stage {number} of {len(scenario.stages)}: {verb}")
        sky = Sky(scenario, orbit, states, legs[-1].end if legs else 0.0, past)
        if stage.name is not None:
            past[stage.name] = sky.time, states
        try:
            leg = flown(sky, number, stage)
        except ValueError as error:
            raise ScenarioError(scenario.file, [f"stage[{number}]: {error}"]) from error
        legs.append(leg)
        if leg.failure is not None:
            return Mission(scenario, orbit, tuple(legs), f"stage {number} ({verb}): {leg.failure}")
        states = leg.after.paths.state(leg.end)
    return Mission(scenario, orbit, tuple(legs))


@dataclass(frozen=True, eq=False)
class Sky:
    """Where everybody is when a stage begins, at `time` [s]; `past` has time and states of named stages."""

    scenario: Scenario
    orbit: Orbit
    states: Floats
    time: float
    past: dict[str, tuple[float, Floats]]

    def flight(self, paths: list[Path]) -> Flight:
        """The paths, watched over their common time."""
        return watch(stack(paths), self.scenario.names, self.scenario.zones)

    def coasts(self, duration: float) -> Flight:
        """Nobody burns for a `duration` [s]."""
        return self.flight([self.orbit.coast(state, duration, self.time) for state in self.states])

    def goal(self, target: Target | None, k: int, duration: float) -> Path:
        """Craft k's own way to a target: the energy-optimal transfer, or coasting without one."""
        if target is None:
            return self.orbit.coast(self.states[k], duration, self.time)
        return self.orbit.transfer(self.states[k], target.state(self.orbit), duration, self.time)

    def mixed(self, who: list[int], paths: Path) -> Flight:
        """The `paths` of the craft `who`; the others coast meanwhile."""
        duration = float(np.max(paths.end)) - self.time
        flying = {k: paths[place] for place, k in enumerate(who)}
        rest = (k for k in range(len(self.states)) if k not in flying)
        flying |= {k: self.goal(None, k, duration) for k in rest}
        return self.flight([flying[k] for k in range(len(flying))])

    def apart(self, stage: Scatter, duration: float) -> Floats:
        """Where everybody scatters to; ValueError naming craft that no way leads apart."""
        from closeform.planning.targets import scattered, scattered_from

        try:
            if stage.factor is not None:
                return scattered(self.orbit, self.states, duration, stage.factor)
            return scattered_from(self.orbit, self.states, duration, *stage.away)
        except ValueError as error:
            raise ValueError(f"{named(str(error), self.scenario.names)}; change within") from None

    def goals(self, stage: Joint, who: list[int], duration: float) -> Floats:
        """Where the craft `who` are to be after a `duration` [s]: the slots (S, 6) of a joint stage."""
        from closeform.planning import targets

        coasted = np.asarray(self.states @ self.orbit.transition(duration).T)
        if isinstance(stage, Regather):
            time, then = self.past[stage.as_before]
            return targets.regathered(self.orbit, then, self.time + duration - time)
        if isinstance(stage, Scatter):
            return self.apart(stage, duration)
        if not isinstance(stage, Reconfigure):
            raise TypeError(f"{stage.verb} is not built")
        slots, to = stage.known(self.orbit, len(who)), stage.to
        if slots is not None:
            centre = coasted[who].mean(axis=0) if isinstance(to, Goal) and to.line is not None else 0.0
            return np.asarray(slots + centre)
        if isinstance(to, Goal) and to.join is not None:
            members = [self.scenario.names.index(name) for name in to.join]
            return targets.added_member(self.orbit, coasted[members])[None]
        if isinstance(to, Goal) and to.remove == "eccentricity":
            return targets.without_eccentricity(self.orbit, coasted[who])
        return targets.without_altitude_difference(self.orbit, coasted[who])


def named(text: str, names: tuple[str, ...]) -> str:
    """A text that counts, "craft 0 and 3", with names instead."""

    def called(found: re.Match[str]) -> str:
        return " and ".join(names[int(number)] for number in re.findall(r"\d+", found[0]))

    return re.sub(r"\bcraft \d+(?: and \d+\b)?", called, text)


def flown(sky: Sky, number: int, stage: StageTable) -> Leg:
    """One stage as flown."""
    if isinstance(stage, Coast):
        flight = sky.coasts(stage.length.on(sky.orbit.mean_motion))
        return Leg(number, stage, sky.time, flight.end, flight, flight)
    if isinstance(stage, Avoid):
        return moved(sky, number, stage)
    if isinstance(stage, Joint):
        return reshaped(sky, number, stage)
    if isinstance(stage, Lock):
        return locked(sky, number, stage)
    if isinstance(stage, Gather):
        return gathered(sky, number, stage)
    raise TypeError(f"stage {number}: {stage.verb} is not built")


def moved(sky: Sky, number: int, stage: Avoid) -> Leg:
    """One craft moves; the others coast or fly their own transfers and do not give way."""
    from closeform.planning.avoid import avoid

    names = sky.scenario.names
    duration = stage.within.on(sky.orbit.mean_motion)
    targets = {fellow.craft: fellow.to for fellow in stage.meanwhile}
    if stage.to is not None:
        targets[stage.craft] = stage.to
    paths = [sky.goal(targets.get(name), k, duration) for k, name in enumerate(names)]
    mover = names.index(stage.craft)
    direct, others = paths[mover], paths[:mover] + paths[mover + 1 :]
    before = sky.flight(paths)
    zones = sky.scenario.zones_around(stage.craft)
    avoidance = avoid(direct, others, zones, method=stage.method)
    after = before
    if avoidance.path is not None:
        after = sky.flight([*paths[:mover], avoidance.path, *paths[mover + 1 :]])
    change = Change(
        stage.craft,
        tuple(name for name in names if name != stage.craft),
        zones,
        stage.method,
        direct,
        avoidance,
    )
    return Leg(number, stage, sky.time, direct.end, before, after, change)


def reshaped(sky: Sky, number: int, stage: Joint) -> Leg:
    """A formation moves together; craft that do not move coast, and are kept clear of."""
    names = sky.scenario.names
    movers = stage.movers or names
    others = tuple(name for name in names if name not in movers)
    who = [names.index(name) for name in movers]
    plan, measures = planned(sky, stage, who, [names.index(name) for name in others])
    asked = stage.within.on(sky.orbit.mean_motion)
    deed = Reshaping(movers, others, sky.scenario.zones, stage.plan, asked, plan, measures)
    before = sky.mixed(who, plan.direct)
    after = sky.mixed(who, plan.paths) if plan.paths is not None and plan.touches else before
    return Leg(number, stage, sky.time, after.end, before, after, deed)


def planned(sky: Sky, stage: Joint, who: list[int], rest: list[int]) -> tuple["Plan", tuple[str, ...]]:
    """The plan for the craft `who` around those that coast, and what was tried.

    Where craft arrive later than asked for, goals that move are aimed at anew, where they are then.
    """
    from closeform.planning.avoid import Status
    from closeform.planning.formation import reconfigure

    scenario = sky.scenario
    limits = np.array([scenario.craft[k].max_acceleration for k in who])
    order = None
    if stage.plan == "sequential":
        order = [who.index(scenario.names.index(name)) for name in stage.order or ()]
        order += [k for k in range(len(who)) if k not in order]
    duration = stage.within.on(sky.orbit.mean_motion)
    measures: tuple[str, ...] = ()
    for attempt in range(AGAIN):
        goals = sky.goals(stage, who, duration)
        plan = reconfigure(
            sky.orbit,
            sky.states[who],
            goals,
            duration,
            [scenario.keep_out[k] for k in who + rest],
            assign=stage.assigns,
            start=sky.time,
            obstacles=[sky.goal(None, k, OBSERVED * duration) for k in rest],
            max_acceleration=limits if np.isfinite(limits).any() else None,
            if_blocked=stage.if_blocked,
            method=stage.plan,
            order=order,
            names=[scenario.names[k] for k in who + rest],
        )
        measures += plan.measures
        took = float(np.max(plan.starts + plan.durations)) - sky.time
        if not plan.ok or abs(took - duration) <= ROUNDING * duration:
            return plan, measures
        if np.array_equal(sky.goals(stage, who, took), goals):
            return plan, measures  # they hold whenever craft arrive
        duration = took * SLACK if attempt else took
        measures += (f"aims at where the relative orbits are after {duration:.6g} s",)
    reason = f"the relative orbits move on faster than craft arrive, up to {took:.6g} s"
    late = replace(plan, paths=None, energy=nan, delta_v=nan, status=Status.TOO_WEAK, reason=reason)
    return late, measures


def locked(sky: Sky, number: int, stage: Lock) -> Leg:
    """All craft coast through the search; who sees whom, and when."""
    from closeform.search.locks import lock_times

    search, pairs = sky.scenario.plan, sky.scenario.opposite
    relative = sky.states[pairs[:, 1]] - sky.states[pairs[:, 0]]
    found = FirstLocks(search, pairs, lock_times(search, relative[:, :3], relative[:, 3:]))
    flight = sky.coasts(search.duration)
    return Leg(number, stage, sky.time, flight.end, flight, flight, found)


def gathered(sky: Sky, number: int, stage: Gather) -> Leg:
    """Lost craft search, lock and join, until one formation holds them all or the rounds are over."""
    from closeform.search.gather import gather

    scenario = sky.scenario
    states = sky.states
    gathering = gather(scenario.plan, states[:, :3], states[:, 3:], **scenario.gathering(stage))
    arcs = gathering.paths.arcs.copy()
    arcs[:, [START, END]] += sky.time
    flight = watch(replace(gathering.paths, arcs=arcs), scenario.names, scenario.zones)
    return Leg(number, stage, sky.time, flight.end, flight, flight, gathering)
