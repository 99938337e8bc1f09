"""What a mission came to: every stage as flown, what was done in it, and how much the craft used up."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from math import expm1, nan
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import WatchedFlight
from closeform.mission.simulation_verdict import eaten, in_flight, least_margin, predicted
from closeform.mission.verdict import (
    Asked,
    Late,
    LostThrust,
    SunAngle,
    Use,
    Verdict,
    conflicts_in,
    thrust_use,
)
from closeform.motion.arc import MEAN_MOTION, THRUST
from closeform.motion.joining import join
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.result import Result
from closeform.scenario import Scenario, StageTable
from closeform.search.schedule import Search
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.dynamics.validity import Validity
    from closeform.mission.passive_safety import PairDrift, PassiveSafety
    from closeform.mission.simulation import FlownRun
    from closeform.mission.stage_start import Arrival
    from closeform.mission.thruster_firing import Pulsed
    from closeform.mission.uncertainty import UncertainStage
    from closeform.planning.plan import Avoidance, Plan
    from closeform.search.locks import Locks

AnyStage = TypeVar("AnyStage", bound=StageTable)
AnyResult = TypeVar("AnyResult")


@dataclass(frozen=True, eq=False, repr=False)
class StageResult(Result, Generic[AnyStage, AnyResult]):
    """A stage as flown, from `start` [s] on: the flight `before` avoidance and `after` it.

    `result`: what was done, None of a coast; times in a Gathering or FirstLocks count from the start
    of the stage.  `failure`: why the mission cannot go on after it; `flown`: whether its paths
    count, which those of a plan that failed do not; `late`: by how much it takes longer than asked;
    `pulsed`: what thrusters fire to fly the plan, where `after` is what they fly.  `uncertain`: what errors
    of the craft make of it, None without any.  `passive`: whether it is safe when something fails, where that
    is asked, and `unplanned`: how near direct paths come then, where a plan failed.  `validity`: what becomes
    of it in the scenario's field, where that has one.  `commanded`: the plan, where `after` has the errors
    that a case of a study has drawn.  `sun`: the greatest sun angle of craft that search with errors.
    """

    number: int
    stage: AnyStage
    start: float
    before: WatchedFlight
    after: WatchedFlight
    result: AnyResult
    failure: str | None = None
    flown: bool = True
    late: Late | None = None
    pulsed: "Pulsed | None" = None
    uncertain: "UncertainStage | None" = None
    passive: "PassiveSafety | None" = None
    unplanned: "PairDrift | None" = None
    validity: "Validity | None" = None
    commanded: WatchedFlight | None = None
    sun: SunAngle | None = None
    on_ephemerides: tuple[int, ...] = ()  # craft whose forces between states are no thrust

    def _facts(self) -> Iterator[tuple[str, str]]:
        conflicts = f"{len(self.after.conflicts)} conflicts, {len(self.before.conflicts)} before"
        yield f"stage {self.number}", f"{self.stage.verb}, {self.start:.1f} s to {self.end:.1f} s"
        yield "craft", f"{len(self.after.names)}, {conflicts}, delta-v {self.delta_v.sum():.6g} m/s"
        if self.failure is not None:
            yield "failed", self.failure

    @property
    def planned(self) -> WatchedFlight:
        """The plan: what is flown, but for thrusters and errors that were drawn."""
        if self.commanded is not None:
            return self.commanded
        return self.after if self.pulsed is None else self.pulsed.planned

    @property
    def asked(self) -> "tuple[Asked, ...]":
        """What it asks for beside clearance as planned."""
        judged = self.uncertain, self.passive
        sun = () if self.sun is None else (self.sun.asked,)
        arrival = () if self.pulsed is None else (self.pulsed.arrival(self.number, cast(Any, self.stage)),)
        return *arrival, *(one for some in judged if some is not None for one in some.asked), *sun

    @property
    def burning(self) -> Path:
        """Paths (N,) with the thrust of each craft; of one on its ephemeris with its velocity jumps only."""
        paths = self.after.paths
        if not self.on_ephemerides:
            return paths
        arcs = paths.arcs.copy()
        for k in self.on_ephemerides:
            own = arcs[paths.offsets[k] : paths.offsets[k + 1]]  # cubics have a mean motion of 0
            own[:, THRUST:], own[:, MEAN_MOTION] = 0.0, paths.orbit.mean_motion
        return Path(paths.orbit, arcs, paths.offsets, paths.shape)

    @cached_property
    def delta_v(self) -> Floats:
        """What each craft spends (N,) [m/s], summed over its thrusters."""
        spent = np.array(self.burning.delta_v)
        if self.pulsed is not None:
            who = [self.after.names.index(name) for name in self.pulsed.names]
            spent[who] = self.pulsed.firing.delta_v
        return spent

    @property
    def end(self) -> float:
        """When it ends [s]."""
        return self.after.end


@dataclass(frozen=True, eq=False)
class AvoidResult:
    """The `direct` path of one `craft` and the way around the `others`, each with its zone.

    It was asked to arrive `asked` [s] after the start of the stage, as `direct` does; `plain` is the direct
    path that takes as long as the way around, another one where that takes longer.  `goals`: where
    it, and who flies `meanwhile`, go, each with the phase at which it arrives.
    """

    craft: str
    others: tuple[str, ...]
    zones: tuple[Zone, ...]
    direct: Path
    plain: Path
    avoidance: "Avoidance"
    asked: float
    goals: "Mapping[str, Arrival]"

    @property
    def names(self) -> tuple[str, ...]:
        """The craft as the avoidance counts them."""
        return self.craft, *self.others


@dataclass(frozen=True, eq=False)
class TransferResult:
    """What one `craft` was asked: from `initial` to `final` (6,) in `asked` [s]; `free` keeps no limit.

    `goal`: where it goes, with the phase at which it arrives.
    """

    craft: str
    initial: Floats
    final: Floats
    asked: float
    free: Path
    goal: "Arrival"


@dataclass(frozen=True, eq=False)
class ReconfigureResult:
    """What a formation did together by a `plan`: the craft `movers` flew, the `others` coasted.

    The plan counts first those, then these.  The craft were asked to arrive `asked` [s] after the
    start of the stage, and `measures` say what was tried beyond that.
    """

    movers: tuple[str, ...]
    others: tuple[str, ...]
    asked: float
    plan: "Plan"
    measures: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The craft as the plan counts them."""
        return self.movers + self.others


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


class Stages(Result, ABC):
    """What a mission has, flown just now or opened again: `results` by stage, and all of them together."""

    scenario: Scenario
    results: tuple[Any, ...]
    lost: tuple[LostThrust, ...] = ()

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "title", self.scenario.title
        for result in self.results:
            yield f"stage {result.number}", f"{result.stage.verb}, {result.start:.1f} s to {result.end:.1f} s"
        yield "verdict", str(self.verdict)

    @property
    @abstractmethod
    def verdict(self) -> object:
        """What the last line of the run says."""

    @property
    def flown(self) -> tuple[Any, ...]:
        """The stages whose paths count."""
        return tuple(result for result in self.results if result.flown)

    @cached_property
    def paths(self) -> Path:
        """All craft from the start of the first stage to the end of the last that was flown, of shape (N,).

        Raises ValueError where none was.
        """
        return join([result.after.paths for result in self.flown])

    @cached_property
    def conflicts(self) -> dict[str, Any]:
        """Every conflict as flown, in columns: stage, first, second, start, end, deepest time [s], ratio."""
        found = [(result.number, met) for result in self.flown for met in result.after.conflicts]
        keys = {"first": "first", "second": "second", "start_s": "start", "end_s": "end", "time_s": "time"}
        columns = {key: [getattr(met, name) for _, met in found] for key, name in keys.items()}
        return {"stage": [number for number, _ in found], **columns, "ratio": [met.ratio for _, met in found]}


@dataclass(frozen=True, eq=False, repr=False)
class Mission(Stages):
    """All stages flown; `stopped`: why not all; `lost`: whose thrust was lost; `flights`: in its field."""

    scenario: Scenario
    orbit: Orbit
    results: tuple[StageResult[Any, Any], ...]
    stopped: str | None = None
    lost: tuple[LostThrust, ...] = ()
    flights: "FlownRun | None" = None
    grounded: str | None = None  # why it cannot be flown there, where that was asked for

    @cached_property
    def burns(self) -> dict[str, Any]:
        """Every burn in columns, as in `burns.parquet`: stage, craft, start, duration [s], R, T, N [m/s]."""
        from closeform.mission.stage_burns import COLUMNS, burns_in

        found = [
            (result.number, *row)
            for result in self.flown
            for row in burns_in(result, partial(self.burnt, result.number))
        ]
        names = ("stage", *COLUMNS)
        return {name: [row[k] for row in found] for k, name in enumerate(names)}

    @cached_property
    def verdict(self) -> Verdict:
        """Whether all were found, all is clear, and every limit is kept."""
        searched = any(result.stage.searches for result in self.results)
        alone = len(self.scenario.craft) == 1
        apart = alone or all(result.stage.keeps_out for result in self.results)
        watched = apart or any(result.after.approaches for result in self.results)
        conflicts, pairs = conflicts_in(result.after for result in self.flown)
        judged = *(one.asked for one in self.lost), *in_flight(self.flights, self.grounded)
        return Verdict(
            self.stopped,
            conflicts if watched else None,
            pairs,
            tuple(use for use in self.uses if use.exceeded) if self.scenario.limited else None,
            searched,
            tuple(result.late for result in self.flown if result.late is not None),
            asked=(*judged, *(one for some in self.flown for one in some.asked)),
            drawn=self.scenario.history is not None and self.scenario.history.erring,
            model="Hill's equations" if watched and self.orbit.mean_motion else "",
            margin=least_margin(self) if watched else None,
            predicted=predicted(self),
            field=next((one.validity.field for one in self.flown if one.validity is not None), ""),
            strict=self.scenario.strict,
        )

    @property
    def clear(self) -> bool:
        """Whether every stage was flown and no conflict remains."""
        return self.verdict.clear

    @cached_property
    def delta_v(self) -> Floats:
        """What each craft spends in each stage (S, N) [m/s]."""
        spent = [result.delta_v for result in self.results]
        return np.array(spent).reshape(-1, len(self.scenario.craft))

    @cached_property
    def propellant(self) -> Floats:
        """What each craft burns in each stage (S, N) [kg]; nan for one without mass and specific impulse."""
        exhaust = [self.scenario.exhaust(result.stage) for result in self.results]
        so_far = np.cumsum(self.delta_v / np.array(exhaust).reshape(self.delta_v.shape), axis=0)
        known = (craft.mass if craft.specific_impulse is not None else None for craft in self.scenario.craft)
        return np.array([*known], dtype=float) * -np.diff(np.expm1(-so_far), axis=0, prepend=0.0)

    @cached_property
    def spent_of_each(self) -> Floats:
        """What each craft spent in all stages flown: delta-v (N,) [m/s] and propellant (N,) [kg]."""
        flown = [result.flown for result in self.results]
        return np.array([self.delta_v[flown].sum(axis=0), self.propellant[flown].sum(axis=0)])

    @cached_property
    def grams(self) -> bool:
        """Whether propellant is printed in grams: no tank holds, or nobody burns, more than a kilogram."""
        tanks = [craft.propellant for craft in self.scenario.craft if craft.propellant is not None]
        return max(tanks, default=float(np.nansum(self.propellant, axis=0).max(initial=0.0))) <= 1.0

    def burnt(self, number: int, k: int, delta_v: float) -> float:
        """What craft k burns for a delta-v [m/s] in stage `number` [kg]; nan where not known."""
        craft = self.scenario.craft_in(self.scenario.stages[number - 1])[k]
        if craft.mass is None or craft.specific_impulse is None:
            return nan
        return -craft.mass * self.mass_left(number, k) * expm1(-delta_v / craft.exhaust)

    def mass_left(self, number: int, k: int) -> float:
        """The share of its mass that craft k has when stage `number` begins; 1 where that is not known."""
        craft = self.scenario.craft[k]
        if craft.mass is None or craft.specific_impulse is None:
            return 1.0
        return 1.0 - float(self.propellant[: number - 1, k].sum()) / craft.mass

    def thrusts(self, result: StageResult[Any, Any]) -> Iterator[Use]:
        """The greatest thrust of each craft that has a limit, as planned in one stage."""
        on = () if result.pulsed is None else result.pulsed.names  # all or nothing
        peaks = result.planned.paths.peak_thrust.tolist()
        craft_now = self.scenario.craft_in(result.stage)
        for k, (craft, peak) in enumerate(zip(craft_now, peaks, strict=True)):
            if craft.limited:  # an engine's force, told by what it gives the mass at the start
                peak *= self.mass_left(result.number, k)
                yield thrust_use(craft, craft.max_acceleration if craft.name in on else peak)

    def spent(self, stages: Any) -> Iterator[Use]:
        """What each craft that has a limit spends in some `stages`: all delta-v, then all propellant."""
        delta_v, burnt = (spent[stages].sum(axis=0) for spent in (self.delta_v, self.propellant))
        return Use.of_spent(self.scenario.craft, delta_v, burnt)

    @cached_property
    def uses(self) -> tuple[Use, ...]:
        """What each craft uses of each of its limits in all stages flown, of thrust the greatest share of
        that in one stage.

        Of delta-v and propellant what it takes in the dearest of its flights in the field, if there are any.
        """
        planned = self.spent([result.flown for result in self.results])
        uses = list(planned if self.flights is None else self.flights.spent)
        of_each: dict[str, list[Use]] = {}
        for use in (use for result in self.flown for use in self.thrusts(result)):
            of_each.setdefault(use.craft, []).append(use)
        uses += [max(thrusts, key=lambda use: use.share) for thrusts in of_each.values()]
        return tuple(sorted(uses, key=lambda use: self.scenario.names.index(use.craft)))

    @property
    def warnings(self) -> tuple[str, ...]:
        """A chief far from a circle, or what its field does; stages longer than asked, limits exceeded."""
        chief, known = self.scenario.chief, any(result.validity is not None for result in self.flown)
        return (
            *(() if chief is None or known else chief.warnings),
            *(one.warning for one in self.verdict.late),
            *eaten(self),
            *(use.warning(self.grams) for use in self.uses if use.exceeded),
        )
