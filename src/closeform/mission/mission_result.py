"""Results of a mission: the flight, plan and checks of each stage, and the use of delta-v and propellant."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from html import escape
from importlib import import_module
from math import expm1, inf, nan
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import WatchedFlight
from closeform.mission.simulation_verdict import asked_of, eaten, in_flight, predicted, zone_distance
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
    from closeform.dynamics.simulation.validity import Validity
    from closeform.mission.passive_safety import PairDrift, PassiveSafety
    from closeform.mission.simulation import SimulatedRun
    from closeform.mission.stage_start import Arrival
    from closeform.mission.thruster_firing import Pulsed
    from closeform.mission.uncertainty import UncertainStage
    from closeform.planning.plan import Plan
    from closeform.planning.requirements.requirement import Requirement
    from closeform.search.lock_times import Locks

AnyStage = TypeVar("AnyStage", bound=StageTable)
AnyResult = TypeVar("AnyResult")


@dataclass(frozen=True, eq=False, repr=False)
class StageResult(Result, Generic[AnyStage, AnyResult]):
    """Evaluated stage from `start` [s] on, with the flight `before` avoidance and `after` it.

    - `result`: plan or search; None for a coast.  Times in a Gathering or FirstLocks count from
      the start of the stage.
    - `failure`: reason why the mission ends after this stage.
    - `executed`: whether the paths are part of the mission; False if planning failed.
    - `late`: delay beyond the requested duration.
    - `pulsed`: thruster pulses that realize the plan; `after` then contains the pulsed paths.
    - `uncertain`: clearance and collision probability with the uncertainty of the spacecraft.
    - `passive`: passive safety, if the stage requires it.
    - `unplanned`: closest pair of the direct paths after a failure, if planning failed.
    - `validity`: prediction for the plan in the scenario's high-fidelity model, if it has one.
    - `commanded`: the plan, if `after` includes the errors that a case of a study has sampled.
    - `sun`: maximum sun angle of spacecraft that search with errors.
    """

    number: int
    stage: AnyStage
    start: float
    before: WatchedFlight
    after: WatchedFlight
    result: AnyResult
    failure: str | None = None
    executed: bool = True
    late: Late | None = None
    pulsed: "Pulsed | None" = None
    uncertain: "UncertainStage | None" = None
    passive: "PassiveSafety | None" = None
    unplanned: "PairDrift | None" = None
    validity: "Validity | None" = None
    commanded: WatchedFlight | None = None
    sun: SunAngle | None = None
    on_ephemerides: tuple[int, ...] = ()  # craft whose accelerations between states are not thrust

    def _facts(self) -> Iterator[tuple[str, str]]:
        conflicts = f"{len(self.after.conflicts)} conflicts, {len(self.before.conflicts)} before"
        yield f"stage {self.number}", f"{self.stage.verb}, {self.start:.1f} s to {self.end:.1f} s"
        yield "craft", f"{len(self.after.names)}, {conflicts}, delta-v {self.delta_v.sum():.6g} m/s"
        if self.failure is not None:
            yield "failed", self.failure

    @property
    def planned(self) -> WatchedFlight:
        """Planned flight, before its realization by thrusters and without sampled errors."""
        if self.commanded is not None:
            return self.commanded
        return self.after if self.pulsed is None else self.pulsed.planned

    @property
    def asked(self) -> "tuple[Asked, ...]":
        """Requirements of the stage other than clearance of the planned paths."""
        judged = self.uncertain, self.passive
        sun = () if self.sun is None else (self.sun.asked,)
        arrival = () if self.pulsed is None else (self.pulsed.arrival(self.number, cast(Any, self.stage)),)
        done = self.result
        kept = done.kept(self.after.path(done.craft)) if isinstance(done, AvoidResult) else ()
        return *arrival, *(one for some in judged if some is not None for one in some.asked), *sun, *kept

    @property
    def burning(self) -> Path:
        """Paths (N,) with the thrust of each craft; on an ephemeris, velocity jumps are its only thrust."""
        paths = self.after.paths
        if not self.on_ephemerides:
            return paths
        arcs = paths.arcs.copy()
        for k in self.on_ephemerides:
            own = arcs[paths.offsets[k] : paths.offsets[k + 1]]  # cubics have a mean motion of 0
            own[:, THRUST:], own[:, MEAN_MOTION] = 0.0, paths.orbit._column
        return Path(paths.orbit, arcs, paths.offsets, paths.shape)

    @cached_property
    def delta_v(self) -> Floats:
        """Delta-v of each spacecraft (N,) [m/s], summed over its thrusters."""
        spent = np.array(self.burning.delta_v)
        if self.pulsed is not None:
            firing = [self.after.names.index(name) for name in self.pulsed.names]
            spent[firing] = self.pulsed.firing.delta_v
        return spent

    @property
    def end(self) -> float:
        """End time [s]."""
        return self.after.end


@dataclass(frozen=True, eq=False)
class AvoidResult:
    """Direct path of one `craft` and its avoidance trajectory around the `others`, each with its zone.

    `asked` [s] is the requested duration, which `direct` takes.  `plain` is the direct path with the duration
    of the avoidance trajectory; it differs from `direct` if the latter takes longer.  `goals` holds the
    destination, with the arrival phase, of the spacecraft and of each one that moves `meanwhile`.
    `required` holds the requirements on the path by name.
    """

    craft: str
    others: tuple[str, ...]
    zones: tuple[Zone, ...]
    direct: Path
    plain: Path
    plan: "Plan"
    asked: float
    goals: "Mapping[str, Arrival]"
    required: "Mapping[str, Requirement]" = field(default_factory=dict)

    def kept(self, path: Path) -> "Iterator[Asked]":
        """Yield each requirement on the path, and whether a path keeps it."""
        for name, one in self.required.items() if self.plan.ok else ():
            held, text, least, by = one.holds(path), f"{name} of {self.craft}", one._worst(path)[0], ""
            if least < inf:
                by = f" by {abs(least):.3g} {one.unit}"
            broken = f"{text} is not kept{by * (least < 0.0)}"
            yield Asked(f"{text} is kept{by}", broken, held, least, name, unit=one.unit)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the spacecraft in the order of the avoidance."""
        return self.craft, *self.others


@dataclass(frozen=True, eq=False)
class TransferResult:
    """Transfer of one `craft` from state `initial` to state `final` (6,) in `asked` [s].

    `free` is the transfer without a thrust limit.  `goal` is the destination with the arrival phase.
    """

    craft: str
    initial: Floats
    final: Floats
    asked: float
    free: Path
    goal: "Arrival"


@dataclass(frozen=True, eq=False)
class ReconfigureResult:
    """Joint `plan` of a formation, in which the `movers` move and the `others` coast.

    The plan numbers the movers first, then the others.  `asked` [s] is the requested duration.  `measures`
    describe the further attempts of the planner.
    """

    movers: tuple[str, ...]
    others: tuple[str, ...]
    asked: float
    plan: "Plan"
    measures: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the spacecraft in the order of the plan."""
        return self.movers + self.others


@dataclass(frozen=True, eq=False)
class FirstLocks:
    """First locks of all `pairs` (P, 2) of a spacecraft in group A and one in group B, by index.

    `search` begins at the start of the stage, from which times count.
    """

    search: Search
    pairs: Any
    locks: "Locks"

    @property
    def missing(self) -> Any:
        """Pairs (Q, 2) that never lock."""
        return self.pairs[self.locks.leg < 0]


FRAME = 'style="width:100%;height:32rem;border:0"'  # of the interactive page in a notebook


class Stages(Result, ABC):
    """Base class of evaluated and reloaded missions: `results` by stage, and properties of all stages."""

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
        """Verdict that the last line of the run reports."""

    @property
    def executed(self) -> tuple[Any, ...]:
        """Stages whose paths are part of the mission."""
        return tuple(result for result in self.results if result.executed)

    @cached_property
    def paths(self) -> Path:
        """Paths, of shape (N,), of all spacecraft over all stages that are part of the mission.

        Raises ValueError if there is no such stage.
        """
        return join([result.after.paths for result in self.executed])

    @cached_property
    def conflicts(self) -> dict[str, Any]:
        """Conflicts in columns: stage, first, second, start, end, time of minimum [s], clearance ratio."""
        found = [(result.number, met) for result in self.executed for met in result.after.conflicts]
        keys = {"first": "first", "second": "second", "start_s": "start", "end_s": "end", "time_s": "time"}
        columns = {key: [getattr(met, name) for _, met in found] for key, name in keys.items()}
        return {"stage": [number for number, _ in found], **columns, "ratio": [met.ratio for _, met in found]}


@dataclass(frozen=True, eq=False, repr=False)
class Mission(Stages):
    """Evaluated mission: the `results` of its stages and the properties of all stages together.

    `stopped` is the reason why stages are missing, None if none are.  `lost` lists the losses of thrust, and
    `flights` is the simulation in the high-fidelity model.
    """

    scenario: Scenario
    orbit: Orbit
    results: tuple[StageResult[Any, Any], ...]
    stopped: str | None = None
    lost: tuple[LostThrust, ...] = ()
    flights: "SimulatedRun | None" = None
    grounded: str | None = None  # reason why a requested simulation is impossible

    @cached_property
    def burns(self) -> dict[str, Any]:
        """Burns in columns, as in `burns.parquet`: stage, craft, start, duration [s], R, T, N [m/s]."""
        from closeform.mission.stage_burns import COLUMNS, burns_in

        found = [
            (result.number, *row)
            for result in self.executed
            for row in burns_in(result, partial(self.burnt, result.number))
        ]
        names = ("stage", *COLUMNS)
        return {name: [row[k] for row in found] for k, name in enumerate(names)}

    def _figure(self) -> str:
        """Return the interactive page in a frame, for a notebook."""
        page = import_module("closeform.viewer.page").of_mission(
            self
        )  # at run time: pages are made of missions
        return f'<iframe title="Mission in motion" srcdoc="{escape(page)}" {FRAME}></iframe>'

    @cached_property
    def verdict(self) -> Verdict:
        """Verdict on searches, clearance, limits and the other requirements of the run."""
        searched = any(result.stage.searches for result in self.results)
        alone = len(self.scenario.craft) == 1
        apart = alone or all(result.stage.keeps_out for result in self.results)
        watched = apart or any(result.after.approaches for result in self.results)
        conflicts, pairs = conflicts_in(result.after for result in self.executed)
        judged = *(one.asked for one in self.lost), *in_flight(self.flights, self.grounded)
        return Verdict(
            self.stopped,
            conflicts if watched else None,
            pairs,
            tuple(use for use in self.uses if use.exceeded) if self.scenario.limited else None,
            searched,
            tuple(result.late for result in self.executed if result.late is not None),
            asked=(*judged, *(one for some in self.executed for one in asked_of(self, some))),
            drawn=self.scenario.history is not None and self.scenario.history.erring,
            model=self.orbit._model if watched else "",
            zone_distance=zone_distance(self) if watched else None,
            predicted=predicted(self),
            field=next((one.validity.field for one in self.executed if one.validity is not None), ""),
            strict=self.scenario.strict,
        )

    @property
    def clear(self) -> bool:
        """True if every stage succeeded and no conflict remains."""
        return self.verdict.clear

    @cached_property
    def delta_v(self) -> Floats:
        """Delta-v of each spacecraft in each stage (S, N) [m/s]."""
        spent = [result.delta_v for result in self.results]
        return np.array(spent).reshape(-1, len(self.scenario.craft))

    @cached_property
    def propellant(self) -> Floats:
        """Propellant use in each stage (S, N) [kg]; nan for a spacecraft without mass or specific impulse."""
        exhaust = [self.scenario.exhaust(result.stage) for result in self.results]
        so_far = np.cumsum(self.delta_v / np.array(exhaust).reshape(self.delta_v.shape), axis=0)
        known = (craft.mass if craft.specific_impulse is not None else None for craft in self.scenario.craft)
        return np.array([*known], dtype=float) * -np.diff(np.expm1(-so_far), axis=0, prepend=0.0)

    @cached_property
    def spent_of_each(self) -> Floats:
        """Total delta-v (N,) [m/s] and propellant (N,) [kg] of each spacecraft, as two rows."""
        executed = [result.executed for result in self.results]
        return np.array([self.delta_v[executed].sum(axis=0), self.propellant[executed].sum(axis=0)])

    @cached_property
    def grams(self) -> bool:
        """True if propellant is printed in grams: no tank, or without tanks no use, exceeds a kilogram."""
        tanks = [craft.propellant for craft in self.scenario.craft if craft.propellant is not None]
        return max(tanks, default=float(np.nansum(self.propellant, axis=0).max(initial=0.0))) <= 1.0

    def burnt(self, number: int, k: int, delta_v: float) -> float:
        """Return the propellant [kg] of craft k for a delta-v [m/s] in stage `number`; nan if unknown."""
        craft = self.scenario.craft_in(self.scenario.stages[number - 1])[k]
        if craft.mass is None or craft.specific_impulse is None:
            return nan
        return -craft.mass * self.mass_left(number, k) * expm1(-delta_v / craft.exhaust)

    def mass_left(self, number: int, k: int) -> float:
        """Return the remaining mass fraction of craft k at the start of stage `number`; 1 if unknown."""
        craft = self.scenario.craft[k]
        if craft.mass is None or craft.specific_impulse is None:
            return 1.0
        return 1.0 - float(self.propellant[: number - 1, k].sum()) / craft.mass

    def thrusts(self, result: StageResult[Any, Any]) -> Iterator[Use]:
        """Yield the planned peak thrust in one stage of each spacecraft with a thrust limit."""
        on = () if result.pulsed is None else result.pulsed.names  # pulses have the full thrust
        peaks = result.planned.paths.peak_thrust.tolist()
        craft_now = self.scenario.craft_in(result.stage)
        for k, (craft, peak) in enumerate(zip(craft_now, peaks, strict=True)):
            if craft.limited:  # a thrust force is stated as acceleration of the initial mass
                peak *= self.mass_left(result.number, k)
                yield thrust_use(craft, craft.max_acceleration if craft.name in on else peak)

    def spent(self, stages: Any) -> Iterator[Use]:
        """Yield the use in the `stages` of each craft with a limit: all delta-v, then all propellant."""
        delta_v, burnt = (spent[stages].sum(axis=0) for spent in (self.delta_v, self.propellant))
        return Use.of_spent(self.scenario.craft, delta_v, burnt)

    @cached_property
    def uses(self) -> tuple[Use, ...]:
        """Use of each limit of each spacecraft over all stages; for thrust, the maximum over the stages.

        Delta-v and propellant are those of the simulated flight with the highest use, if there is one.
        """
        planned = self.spent([result.executed for result in self.results])
        uses = list(planned if self.flights is None else self.flights.spent)
        of_each: dict[str, list[Use]] = {}
        for use in (use for result in self.executed for use in self.thrusts(result)):
            of_each.setdefault(use.craft, []).append(use)
        uses += [max(thrusts, key=lambda use: use.share) for thrusts in of_each.values()]
        return tuple(sorted(uses, key=lambda use: self.scenario.names.index(use.craft)))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings: noncircular chief orbit, late stages, conflicts by model error, exceeded limits."""
        chief, known = self.scenario.chief, any(result.validity is not None for result in self.executed)
        return (
            *(() if chief is None or known or self.scenario.orbit.model != "hill" else chief.warnings),
            *(one.warning for one in self.verdict.late),
            *eaten(self),
            *(use.warning(self.grams) for use in self.uses if use.exceeded),
        )
