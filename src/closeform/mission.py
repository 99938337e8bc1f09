"""START HERE: a mission flies the stages of a scenario in order, each from where the last ended.

    scenario file -> Scenario -> fly -> Mission -> result folder, report, printed tables

No mathematics: a stage asks the orbit for paths, `screen` for conflicts, `avoid` for the way
around them, and `lock_times` and `gather` for who finds whom.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arc import END, START
from closeform.flight import Flight, watch
from closeform.orbit import Orbit
from closeform.path import Path, stack
from closeform.scenario import Avoid, Coast, Gather, Lock, Scenario, ScenarioError, StageTable, Target
from closeform.search.gathering import Gathering, who_is_left
from closeform.search.schedule import Search
from closeform.zones import Floats, Zone

if TYPE_CHECKING:
    from closeform.avoidance import Avoidance
    from closeform.search.locks import Locks

# Kernels are compiled, or loaded, where they are imported: a stage imports those that it needs.

NAMED = 10  # pairs that are named where more have failed


@dataclass(frozen=True, eq=False)
class Change:
    """What a move changed: the `direct` path of one craft and the way around the others."""

    craft: str
    others: tuple[str, ...]
    zones: tuple[Zone, ...]  # one for each other
    method: str
    direct: Path
    avoidance: "Avoidance"


@dataclass(frozen=True, eq=False)
class FirstLocks:
    """The first locks of all `pairs` (P, 2) of a craft in group A and one in B, by index.

    `search` begins, and times count, when the stage does.
    """

    search: Search
    pairs: Any
    locks: "Locks"

    @property
    def missing(self) -> Any:
        """The pairs (Q, 2) that never lock."""
        return self.pairs[self.locks.leg < 0]


@dataclass(frozen=True, eq=False)
class Leg:
    """A stage as flown, from `start` to `end` [s]: the flight `before` avoidance and `after` it.

    The times of a Gathering or of FirstLocks count from the start of the stage.
    """

    number: int
    stage: StageTable
    start: float
    end: float
    before: Flight
    after: Flight
    deed: Change | Gathering | FirstLocks | None = None  # None: a coast

    @property
    def name(self) -> str:
        """What the file calls it, or an empty text."""
        return self.stage.name or ""

    @property
    def verb(self) -> str:
        """What stands in `do`."""
        return self.stage.verb

    @property
    def failure(self) -> str | None:
        """Why the mission cannot go on after this stage; None where it can."""
        names = self.after.names
        if isinstance(self.deed, Change) and not self.deed.avoidance.ok:
            return self.deed.avoidance.reason
        if isinstance(self.deed, Gathering) and not self.deed.ok:
            return who_is_left(self.deed.sets, self.deed.lost, self.deed.rounds, names)
        if isinstance(self.deed, FirstLocks) and len(self.deed.missing):
            shown = [f"{names[i]} - {names[j]}" for i, j in self.deed.missing[:NAMED]]
            more = ", ..." if len(self.deed.missing) > NAMED else ""
            never = f"{len(self.deed.missing)} of {len(self.deed.pairs)} pairs never lock"
            return f"{never}: {', '.join(shown)}{more}"
        return None


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

    @property
    def warnings(self) -> tuple[str, ...]:
        """Craft that would need more than their thrust or delta-v, one line each."""
        lines = []
        for k, craft in enumerate(self.scenario.craft):
            paths = [leg.after.paths[k] for leg in self.legs]
            spent = sum(path.delta_v for path in paths)
            if craft.delta_v_budget is not None and spent > craft.delta_v_budget:
                lines.append(
                    f"{craft.name} needs {spent:.4g} m/s, its delta_v_budget is {craft.delta_v_budget:g} m/s"
                )
            if craft.max_thrust is not None and craft.mass is not None:
                force = max((path.peak_thrust for path in paths), default=0.0) * craft.mass
                if force > craft.max_thrust:
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
    for number, stage in enumerate(scenario.stages, 1):
        verb = stage.verb
        progress(f"stage {number} of {len(scenario.stages)}: {verb}")
        try:
            leg = flown(Sky(scenario, orbit, states, legs[-1].end if legs else 0.0), number, stage)
        except ValueError as error:
            raise ScenarioError(scenario.file, [f"stage[{number}]: {error}"]) from error
        legs.append(leg)
        if leg.failure is not None:
            return Mission(scenario, orbit, tuple(legs), f"stage {number} ({verb}): {leg.failure}")
        states = leg.after.paths.state(leg.end)
    return Mission(scenario, orbit, tuple(legs))


@dataclass(frozen=True, eq=False)
class Sky:
    """Where everybody is when a stage begins, at `time` [s]."""

    scenario: Scenario
    orbit: Orbit
    states: Floats
    time: float

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


def flown(sky: Sky, number: int, stage: StageTable) -> Leg:
    """One stage as flown."""
    if isinstance(stage, Coast):
        flight = sky.coasts(stage.length.on(sky.orbit.mean_motion))
        return Leg(number, stage, sky.time, flight.end, flight, flight)
    if isinstance(stage, Avoid):
        return moved(sky, number, stage)
    if isinstance(stage, Lock):
        return locked(sky, number, stage)
    if isinstance(stage, Gather):
        return gathered(sky, number, stage)
    raise TypeError(f"stage {number}: {stage.verb} is not built")


def moved(sky: Sky, number: int, stage: Avoid) -> Leg:
    """One craft moves; the others coast or fly their own transfers and do not give way."""
    from closeform.avoidance import avoid

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
