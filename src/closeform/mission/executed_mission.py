"""Execution of one case with its sampled errors, process noise and losses of thrust.

A random number depends only on a seed, a craft's name, a case and an event. Process noise is sampled on a
common time grid, so that it does not depend on the length of the mission, its division into stages, or the
step. A craft that loses its thrust drifts, while the others follow their plan.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf, isnan, nan
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from scipy.special import ndtri

from closeform.arrays import Floats
from closeform.conflicts.flight import watch
from closeform.conflicts.two_paths import closest_approach
from closeform.mission.search_stage import gather_with_burn_errors
from closeform.mission.verdict import LostThrust
from closeform.motion.joining import drift, drifting, join, stack
from closeform.motion.path import Path
from closeform.scenario import Craft, Gather, Scenario, ScenarioError
from closeform.search.gathering.burn_errors import BurnErrors
from closeform.search.gathering.result import Gathering
from closeform.uncertainty.covariance import root_of
from closeform.uncertainty.error_columns import columns_of, executed_path
from closeform.uncertainty.random_streams import WORDS, uniform
from closeform.uncertainty.white_noise import (
    BLOCK,
    MOST_OFF,
    SAME,
    STEPS,
    deviation_in_step,
    halvings_for,
    increments,
    instants_until,
    step_for_zone,
    velocity_changes,
    with_velocity_changes,
)
from closeform.zones.pair_zones import portions
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.mission.mission_result import Mission, StageResult

USUAL = 9  # the level with steps of 8 s
HALVES = 1 << 20  # maximum number of intervals in a block
NOISE_BLOCKS = 2  # blocks of random numbers that give the six of a step
# adds process noise after a time [s] to the path of a craft by index
Disturbance = Callable[[Path, int, float], Path]


@dataclass(frozen=True)
class History:
    """Samples of a case that the planner does not know: errors, by `draws` of its study, and failures.

    `fails`: the fraction of the mission after which each craft (N,) loses its thrust, nan if it does not;
    `instants`: the corresponding times [s] by craft index if stages are executed with them, else None. Random
    numbers are keyed by the seed and the craft's name, so that they do not depend on other craft.
    """

    seed: int
    case: int
    draws: str
    fails: tuple[float, ...] = ()
    instants: Mapping[int, float] | None = None

    @property
    def replanned(self) -> bool:
        """True if each stage is planned from the executed end of the previous one."""
        return self.draws == "replanned"

    @property
    def erring(self) -> bool:
        """True if the case samples errors."""
        return self.draws != "vary"

    def starts(self, craft: Craft) -> Floats:
        """Return the deviation (6,) of a craft from its state at the start of the mission."""
        if craft.covariance is None:
            return np.zeros(6)
        random = self.normal(f"start of {craft.name}", 6)
        return np.asarray(root_of("covariance", craft.covariance.matrix) @ random)

    def normal(self, key: str, count: int) -> Floats:
        """Return normal random numbers (count,), four for each event."""
        events = [
            uniform(self.seed, key, 1, self.case, self.case + 1, event).ravel()
            for event in range(-(-count // WORDS))
        ]
        return np.asarray(ndtri(np.concatenate([np.empty(0), *events])[:count]))

    def failing_in(self, mission: Mission) -> History | None:
        """Return the history with the times of lost thrust if the mission must be repeated with them.

        This is needed for a gathering: the other craft observe a missed burn and react to it.
        """
        gathers = any(isinstance(result.stage, Gather) for result in mission.executed)
        times = instants(mission, self.fails) if gathers and self.draws != "errors" else {}
        return replace(self, instants=times) if times else None

    def executed(
        self, scenario: Scenario, result: StageResult[Any, Any], states: Floats
    ) -> StageResult[Any, Any]:
        """Return a stage from `states` (N, 6) as executed, with burn errors and without lost thrust."""
        if not result.executed or not (self.replanned or self.instants):
            return result
        if isinstance(result.stage, Gather) and (errors := self.burn_errors(scenario, result)).any:
            return gather_with_burn_errors(scenario, result, states, errors)
        paths, disturbed = list[Path](), self.disturbed(scenario)
        for k, craft in enumerate(scenario.craft):
            path = result.after.path(craft.name)
            if self.replanned and craft.errors is not None:
                columns = columns_of(path, craft.errors)
                key = f"stage {result.number} of {craft.name}"
                path = executed_path(path, columns, self.normal(key, len(columns)))
            if self.instants and (time := self.instants.get(k, inf)) < result.end:
                path = drifting(path, time, states[k] if time <= result.start else None)
            paths.append(disturbed(path, k, path.start))
        return with_paths(scenario, result, paths)

    def disturbed(self, scenario: Scenario) -> Disturbance:
        """Return a function that adds process noise to a craft's path."""
        if not (self.replanned and scenario.noisy):
            return lambda path, k, since: path
        noise = ProcessNoise(self.seed, scenario.orbit.build().mean_motion, USUAL)
        return lambda path, k, since: noise.moved(path, scenario.craft[k], self.case, since)

    def burn_errors(self, scenario: Scenario, result: StageResult[Any, Any]) -> BurnErrors:
        """Return the errors of a gathering's burns; each burn of a craft takes four random numbers."""
        craft = scenario.craft
        times = [(self.instants or {}).get(k, inf) - result.start for k in range(len(craft))]
        gates = np.array([(0.0,) * 4 if one.execution is None else one.execution.gates for one in craft])

        def normals(burns: int) -> Floats:
            keys = (f"stage {result.number} of {one.name}" for one in craft)
            drawn = [self.normal(key, burns * WORDS).reshape(burns, WORDS) for key in keys]
            return np.array(drawn)[None, :, :, :3]

        off = self.replanned and gates.any()
        return BurnErrors(np.array([times]), gates, normals if off else None)

    def whole(self, mission: Mission) -> Mission:
        """Return a mission with the events that no plan takes into account."""
        if not mission.executed:
            return mission
        if self.draws == "errors":
            mission = self.uncorrected(mission)
        if self.instants is None:
            return with_losses(mission, self.fails, self.disturbed(mission.scenario))
        times = {k: time for k, time in self.instants.items() if time <= mission.executed[-1].end}
        return with_reported_losses(
            mission, times, {k: missed(mission, k, time) for k, time in times.items()}
        )

    def uncorrected(self, mission: Mission) -> Mission:
        """Return a mission executed as planned, in which no craft corrects its errors."""
        scenario, end = mission.scenario, mission.executed[-1].end
        noise = ProcessNoise.beside_zones(scenario, self.seed, end) if scenario.noisy else None
        errors = [
            errors_of(craft, join([result.after.path(craft.name) for result in mission.executed]), self)
            for craft in scenario.craft
        ]

        def off(k: int, path: Path) -> Path:
            own = errors[k]
            path = path if own is None else executed_path(path, *own)
            return path if noise is None else noise.moved(path, scenario.craft[k], self.case, 0.0)

        def uncorrected(result: StageResult[Any, Any]) -> StageResult[Any, Any]:
            paths = [off(k, result.after.path(name)) for k, name in enumerate(scenario.names)]
            return with_paths(scenario, result, paths)

        each = (uncorrected(result) if result.executed else result for result in mission.results)
        return replace(mission, results=tuple(each))


def errors_of(craft: Craft, path: Path, history: History) -> tuple[Path, Floats] | None:
    """Return the error columns of a craft over its whole mission and their sizes; None without any."""
    if craft.errors is None:
        return None
    columns = columns_of(path, craft.errors)
    first, last = history.case, history.case + 1
    return columns, drawn(history.seed, craft.name, len(columns), first, last)[0]


def drawn(seed: int, name: str, count: int, first: int, last: int) -> Floats:
    """Return normal random numbers (last - first, count) of one craft in the given cases of a mission."""
    random = uniform(seed, f"errors of {name}", -(-count // WORDS), first, last)
    return np.asarray(ndtri(random.reshape(last - first, -1)[:, :count]))


def instants(mission: Mission, fails: Sequence[float]) -> dict[int, float]:
    """Return the times [s] at which craft, by index, lose their thrust; `fails` (N,) are fractions or nan."""
    end = mission.executed[-1].end
    return {k: float(share * end) for k, share in enumerate(fails) if not isnan(share)}


def with_losses(mission: Mission, fails: Sequence[float], disturbed: Disturbance) -> Mission:
    """Return a mission in which each craft (N,) loses its thrust after a fraction of it; nan: it does not.

    A craft that coasts throughout has no thrust to lose. A drifting craft is still subject to process noise
    (`disturbed`).
    """
    scenario, burns = mission.scenario, mission.paths.delta_v > 0.0
    times = {k: time for k, time in instants(mission, fails).items() if burns[k]}
    if not times:
        return mission
    needed = {k: thrust_after(mission.paths[k], time) for k, time in times.items()}
    results, states = list(mission.results), dict[int, Floats]()
    for place, result in enumerate(results):
        if result.executed:
            paths = [result.after.path(name) for name in scenario.names]
            for k, time in times.items():
                if time < result.end:
                    paths[k] = disturbed(drifting(paths[k], time, states.get(k)), k, max(time, result.start))
                    states[k] = paths[k].state(result.end)
            results[place] = with_paths(scenario, result, paths)
    return with_reported_losses(replace(mission, results=tuple(results)), times, needed)


def with_reported_losses(mission: Mission, times: Mapping[int, float], needed: Mapping[int, bool]) -> Mission:
    """Return the mission with its losses of thrust and the closest approach of each drifting craft."""
    names = mission.scenario.names
    lost = (LostThrust(names[k], time, needed[k], *nearest(mission, k, time)) for k, time in times.items())
    return replace(mission, lost=tuple(lost))


def missed(mission: Mission, k: int, time: float) -> bool:
    """Return True if a craft misses a burn after a time, in a mission executed without its thrust.

    In a gathering, return True if a missing burn kept it from joining.
    """
    for result in mission.executed:
        if isinstance(result.result, Gathering):
            if k in result.result.adrift:
                return True
        elif time < result.end:
            path = result.planned.path(mission.scenario.names[k])
            if thrust_after(path, time) if time > path.start else path.delta_v > 0.0:
                return True
    return False


def with_paths(scenario: Scenario, result: StageResult[Any, Any], paths: list[Path]) -> StageResult[Any, Any]:
    """Return a stage with the executed paths of the craft."""
    after = watch(stack(paths), scenario.names, scenario.zones)
    return replace(result, after=after, commanded=result.planned)


def thrust_after(path: Path, time: float) -> bool:
    """Return True if a craft burns after a time of its path."""
    burnt = path.delta_v - drifting(path, time).delta_v
    return bool(burnt > 0.0)


def nearest(mission: Mission, k: int, time: float) -> tuple[float, str | None]:
    """Return the minimum clearance ratio of a craft drifting since a time, and the other craft.

    The drift is propagated in the scenario's high-fidelity model if it has one, else with Hill's equations.
    The result is nan and None without zones.
    """
    names, orbit, paths, field = mission.scenario.names, mission.orbit, mission.paths, mission.scenario.field
    own = paths[k]
    if field is None or time >= own.end:
        alone = drift(orbit, time, own.end, own.state(time))
    else:
        alone = field._of([k]).coast(own.state(time), own.end - time, time, orbit=orbit)
    zones = {j: mission.scenario.zones.between(k, j) for j in range(len(names)) if j != k}
    ratios = [
        (float(closest_approach(alone, paths[j], zone).ratio), names[j])
        for j, zone in zones.items()
        if zone is not None
    ]
    return min(ratios, default=(nan, None))


@dataclass(frozen=True)
class ProcessNoise:
    """Process noise of a study's cases with a `seed`, in steps of a `level`, at a mean motion [rad/s]."""

    seed: int
    mean_motion: float
    level: int

    @classmethod
    def beside_zones(cls, scenario: Scenario, seed: int, span: float) -> Self:
        """Return noise with steps short enough that the discretization is negligible relative to every zone.

        `span`: the duration of the mission [s]. Raises ScenarioError if no allowed step is short enough.
        """
        n, steps = scenario.orbit.build().mean_motion, list[float]()
        for zone, density in noisy_zones(scenario):
            steps.append(step_for_zone(n, density, zone.inner_radius, span))
            if deviation_in_step(density, steps[-1]) > MOST_OFF * zone.inner_radius:
                line = (
                    f"craft.execution: noise of {density:g} m^2/s^3 moves a pair too far for its zone in "
                    f"each of {STEPS} steps; reduce the noise, enlarge the zone, or shorten the mission"
                )
                raise ScenarioError(scenario.file, [line])
        return cls(seed, n, halvings_for(min(steps)) if steps else USUAL)

    @property
    def step(self) -> float:
        """Time between changes of velocity [s]."""
        return BLOCK / 2.0**self.level

    def steps(self, span: float) -> int:
        """Return the number of steps that begin within a mission of duration `span` [s]."""
        return ceil(span / self.step - SAME)

    def pushes(self, craft: Craft, count: int, first: int, last: int) -> Floats:
        """Return the noise increments of a craft's state in `count` steps of the cases (C, count, 6)."""
        key, density = f"noise of {craft.name}", density_of(craft)
        if density == 0.0:
            return np.zeros((last - first, count, 6))

        def normal(level: int, rows: int) -> Floats:
            random = [
                uniform(self.seed, key, NOISE_BLOCKS, first, last, interval(level, row)).reshape(-1, 8)[:, :6]
                for row in range(rows)
            ]
            return np.asarray(ndtri(np.stack(random, axis=1)))

        return np.asarray(np.sqrt(density) * increments(self.mean_motion, self.level, count, normal))

    def moved(self, path: Path, craft: Craft, case: int, since: float) -> Path:
        """Return a craft's path with the noise after a time [s]; 0 includes the noise that begins then."""
        if density_of(craft) == 0.0:
            return path
        count = int(instants_until(np.asarray(path.end), self.step))
        kicks = velocity_changes(self.mean_motion, self.step, self.pushes(craft, count, case, case + 1))[0]
        first = int(instants_until(np.asarray(since), self.step)) if since > 0.0 else 0
        return with_velocity_changes(path, self.step * np.arange(float(first), float(count)), kicks[first:])


def density_of(craft: Craft) -> float:
    """Return the noise density of a craft [m^2/s^3]."""
    return 0.0 if craft.execution is None else craft.execution.noise


def noisy_zones(scenario: Scenario) -> Iterator[tuple[Zone, float]]:
    """Yield the zone of each pair with noise, hard bodies included, and the sum of both densities."""
    densities = np.array([density_of(craft) for craft in scenario.craft])
    for table in (scenario.zones, scenario.bodies):
        for zone, first, second in portions(table):
            yield from ((zone, both) for both in (densities[first] + densities[second]).tolist() if both)


def interval(level: int, row: int) -> int:
    """Return the event number of an interval: a sum of noise over a block, or the split of a part."""
    if level == 0:
        return row * HALVES
    parts = 1 << (level - 1)
    return row // parts * HALVES + parts + row % parts
