"""Cases of a whole mission, each with its own plan, and their statistics."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import nan
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from closeform.arrays import Floats
from closeform.campaign.cases import CaseChunks, Cases, Columns, Quantity, Statistics
from closeform.campaign.draws import lost_by, varied
from closeform.campaign.one_case import one_case
from closeform.campaign.spread import Spread
from closeform.mission.mission import as_happened, staged
from closeform.mission.mission_result import Mission
from closeform.scenario import Scenario, ScenarioError
from closeform.scenario.stages import Clearing
from closeform.scenario.study import FAILS, UNPLANNED

AT_ONCE = 32  # missions in a chunk: a few tenths of a second for a few craft, a minute for many
CHUNKS = 32  # minimum number in a small study; with fewer, a stop loses more work and progress is coarser
MET, UNMET, STOPPED, REFUSED = "met", "unmet", "stopped", "refused"
STATUSES = (MET, UNMET, STOPPED, REFUSED)
WORDS = {
    MET: "with all requirements met",
    UNMET: "with requirements not met",
    STOPPED: "stopped in a stage",
    REFUSED: "not feasible",
}
ABOVE = "above the lower bound [%]"  # label of the optimality gap in a table
CAUSES = 10  # number of causes that a table lists
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)")

SEED, RATIO, END, SPENT = "flight_seed", "simulated_ratio", "simulated_end_m", "simulated_delta_v_m_s"
NEAREST = 0.5, 0.05, 0.001  # quantiles of minimum clearance ratios, for which small values are bad
BY_CAUSE = {"plan": SPENT, "field": "field_delta_v_m_s", "feedback": "feedback_delta_v_m_s"}


class Figure(NamedTuple):
    """Quantity of a mission: its column, its value, and the label of its spread (None for no spread)."""

    column: str
    of: Callable[[Mission], Any]
    label: str | None = None


def planned_figures(scenario: Scenario) -> Iterator[Figure]:
    """Yield the numbers of a mission without a simulation; nan where a stage was not executed."""
    stages = [*enumerate(scenario.stages, 1)]
    yield Figure("delta_v_m_s", total, "delta-v of all craft [m/s]")
    for number, stage in stages:
        label = f"stage {number}, {stage.verb} [m/s]" if len(stages) > 1 else None
        yield Figure(f"stage_{number}_delta_v_m_s", of_stage(number, lambda one: one.delta_v.sum()), label)
    for k, name in enumerate(scenario.names):
        yield Figure(f"{name}_delta_v_m_s", partial(total, k=k), f"delta-v of {name} [m/s]")
    if scenario.study is not None and scenario.study.draws == "replanned":
        for number, stage in stages:
            label = f"stage {number}, {stage.verb}, deviation [m]"
            yield Figure(f"stage_{number}_off_m", of_stage(number, deviation), label)
    if any(isinstance(stage, Clearing) for stage in scenario.stages):
        yield Figure("gap", gap, ABOVE)
    yield Figure("end_s", lambda one: one.executed[-1].end if complete(one) else nan, "end [s]")
    yield Figure("least_ratio", least_ratio)
    yield Figure("conflicts", lambda one: sum(len(result.after.conflicts) for result in one.executed))
    if FAILS in varied(scenario):
        for name in scenario.names:
            yield Figure(lost_by(name), partial(loss, name=name))
        yield Figure("drift_ratio", lambda one: least(lost.ratio for lost in one.lost))


def simulated_figures(scenario: Scenario) -> Iterator[Figure]:
    """Yield the numbers of a simulation in the high-fidelity model; none if cases are not simulated."""
    if scenario.flights is None:
        return

    def of(value: Callable[..., Any], *which: Any) -> Callable[[Mission], Any]:
        return lambda mission: nan if mission.flights is None else value(mission.flights, *which)

    def end(run: Any, number: int) -> float:
        return next((float(one.ends.max()) for one in run.stages if one.number == number), nan)

    yield Figure(SPENT, of(lambda one: one.flight.delta_v.sum()), "simulated: delta-v of all craft [m/s]")
    yield Figure(BY_CAUSE["field"], of(lambda one: one.flight.field_delta_v.sum()))
    yield Figure(BY_CAUSE["feedback"], of(lambda one: one.flight.feedback_delta_v.sum()))
    for k, name in enumerate(scenario.names):
        label = f"simulated: delta-v of {name} [m/s]"
        yield Figure(f"{name}_simulated_delta_v_m_s", of(lambda one, k: one.flight.delta_v[0, k], k), label)
    for number, stage in enumerate(scenario.stages, 1):
        label = f"simulated: stage {number}, {stage.verb}, end position error [m]"
        yield Figure(f"stage_{number}_end_m", of(end, number), label)
    off = of(lambda one: one.flight.greatest_deviation)
    yield Figure("simulated_off_m", off, "simulated: largest deviation [m]")
    yield Figure(END, of(lambda one: one.flight.greatest_end))
    yield Figure(RATIO, of(lambda one: one.flight.least_ratio if one.flight.ratios.size else nan))


def complete(mission: Mission) -> bool:
    """Return True if all stages were executed."""
    return mission.stopped is None and mission.grounded is None


def total(mission: Mission, k: int | None = None) -> float:
    """Return the delta-v [m/s] of all craft, or of one, in the executed stages."""
    each = [result.delta_v.sum() if k is None else result.delta_v[k] for result in mission.executed]
    return float(sum(each)) if each or k is not None else nan


def loss(mission: Mission, name: str) -> float:
    """Return the time [s] at which a craft loses its thrust; nan if it does not."""
    return next((one.time for one in mission.lost if one.craft == name), nan)


def of_stage(number: int, value: Callable[[Any], Any]) -> Callable[[Mission], Any]:
    """Return a function with the value of the result of a stage; nan if it was not executed."""
    return lambda mission: next((value(one) for one in mission.executed if one.number == number), nan)


def least(values: Iterable[float | None]) -> float:
    """Return the minimum of the given numbers; nan without any."""
    return float(np.fmin.reduce([nan if one is None else one for one in values], initial=nan))


def least_ratio(mission: Mission) -> float:
    """Return the minimum clearance ratio of all pairs; nan without zones."""
    return least(pair.ratio for result in mission.executed for pair in result.after.approaches)


def gap(mission: Mission) -> float:
    """Return the largest optimality gap of the plans, relative to each plan; nan without bounds."""
    moved = [one.result for one in mission.executed if isinstance(one.stage, Clearing)]
    plans = [one.plan for one in moved]
    return float(np.fmax.reduce([max(plan.gap, 0.0) for plan in plans], initial=nan))


def deviation(result: Any) -> float:
    """Return the largest distance [m] between a craft and its planned end, due to burn errors.

    A gathering with exact burns can end earlier; its end is then propagated by coasting.
    """
    if result.commanded is None:
        return nan
    paths, end = result.planned.paths, min(result.end, result.planned.end)
    planned = paths.position(end)
    if end < result.end:
        planned = (paths.state(end) @ paths.orbit.transition(result.end - end, end).T)[..., :3]
    return float(np.linalg.norm(result.after.paths.position(result.end) - planned, axis=-1).max())


@dataclass(frozen=True, eq=False)
class MissionCases(Cases):
    """Cases of a mission with a row each: its `status`, the `reason`, and the numbers of `figures`."""

    failures: ClassVar = WORDS
    unfinished: ClassVar = (STOPPED, REFUSED)

    def chunk_size(self, count: int) -> int:
        """Return the number of cases in a chunk of a study of `count` cases."""
        return max(1, min(AT_ONCE, count // CHUNKS))

    @property
    def figures(self) -> tuple[Figure, ...]:
        """Numbers of a case, those of its simulation first."""
        return *simulated_figures(self.scenario), *planned_figures(self.scenario)

    @property
    def names(self) -> tuple[str, ...]:
        """Columns of `evaluate`."""
        seed = () if self.scenario.flights is None else (SEED,)
        return "status", "reason", *seed, *(one.column for one in self.figures)

    def evaluate(self, first: int, last: int) -> Columns:
        """Plan and evaluate all stages of each case, as a run of it does."""
        rows = [self.row(case) for case in range(first, last)]
        return {name: np.array([row[name] for row in rows]) for name in self.names}

    def row(self, case: int) -> dict[str, Any]:
        """Return the row of one case."""
        scenario = one_case(self.scenario, self.seed, case)
        row: dict[str, Any] = dict.fromkeys(self.names, nan) | {SEED: scenario.flight_seed, "conflicts": -1}
        try:
            mission = self.as_happened(scenario)
        except ScenarioError as error:
            reason = error.lines[0].removeprefix(f"{self.scenario.file}: ")
            return row | {"status": REFUSED, "reason": reason}
        row |= {"status": ended(mission), "reason": "" if mission.verdict.ok else str(mission.verdict)}
        return row | {one.column: one.of(mission) for one in self.figures}

    def met(self, columns: Columns) -> dict[str, Any]:
        """Return, for each status other than MET, the cases that did not end with it."""
        return {status: columns["status"] != status for status in STATUSES[1:]}

    def quantities(self) -> dict[str, Quantity]:
        """Return the delta-v [m/s] in all, by stage and by craft, the end time [s], and deviations [m].

        Only complete missions count. Quantities of a simulated mission appear as simulated and as planned.
        """

        def of(column: str) -> Quantity:
            return lambda columns: columns[column] + 0.0 * columns["end_s"]

        planned = "" if self.scenario.flights is None else "planned: "
        found = {}
        for one in self.figures:
            if one.label is not None:
                label = one.label if one.label.startswith("simulated") else planned + one.label
                found[label] = of(one.column)
        return found

    @cached_property
    def shared(self) -> Mission | None:
        """Plan of every case; None if the planner sees the samples of a case."""
        study = self.scenario.study
        if study is None or study.draws == "replanned":  # each stage is planned from a state with errors
            return None
        if any(key != FAILS and not key.startswith(UNPLANNED) for key in study.vary):
            return None
        return self.plan(one_case(self.scenario, self.seed, 0))

    def prepared(self) -> Self:
        """Return the cases with their common plan computed; every case reports a plan that is refused."""
        with suppress(ScenarioError):
            _ = self.shared
        return self

    @property
    def predicted(self) -> bool:
        """True if plans are predicted in the high-fidelity model; a simulation gives better predictions."""
        return self.scenario.flights is None

    def plan(self, scenario: Scenario) -> Mission:
        """Return the mission of one case as planned."""
        return staged(scenario, predicted=self.predicted)

    def as_happened(self, scenario: Scenario) -> Mission:
        """Return the mission of one case with the events that its plan does not anticipate."""
        plan = self.plan(scenario) if self.shared is None else replace(self.shared, scenario=scenario)
        return as_happened(plan, predicted=self.predicted)

    def campaign(self, chunks: CaseChunks) -> MissionCampaign:
        """Return the statistics of the cases."""
        return MissionCampaign(self, chunks)


def ended(mission: Mission) -> str:
    """Return how a mission ended: one of STATUSES."""
    if mission.stopped is not None:
        return STOPPED
    if mission.grounded is not None:
        return REFUSED
    return MET if mission.verdict.ok else UNMET


@dataclass(frozen=True)
class SimulationTally:
    """Counts over `count` complete simulations.

    The number with a zone `entered` and the `mean` delta-v by cause [m/s]. `nearest`: the minimum clearance
    ratio of any pair and its case; `nearness`: the spread of the minimum ratio of each simulation. None if no
    pair has a zone.
    """

    count: int
    entered: int
    mean: dict[str, float]
    nearest: tuple[float, int] | None
    nearness: Spread | None


@dataclass(frozen=True, eq=False, repr=False)
class MissionCampaign(Statistics):
    """Statistics of C cases of a mission, sampled with a seed.

    Arrays (C,) are read on request: `column` of any name in the files of cases, of which `statuses` are
    "met", "unmet", "stopped" or "refused".
    """

    kind: MissionCases

    @cached_property
    def statuses(self) -> Any:
        """Status of each case."""
        return self.column("status").astype(str)

    @cached_property
    def counts(self) -> dict[str, int]:
        """Number of cases by status, in the order of STATUSES."""
        return {MET: self.met_cases} | {name: len(self) - met.count for name, met in self.tally.met.items()}

    @cached_property
    def causes(self) -> list[tuple[str, int, int]]:
        """Causes without their numbers, the number of cases of each and the first; most frequent first."""
        found = dict[str, tuple[int, int]]()
        for cases, part in self.parts():
            for case, reason in zip(cases, part["reason"].tolist(), strict=True):
                if reason:
                    cause = NUMBER.sub("...", reason)
                    many, first = found.get(cause, (0, case))
                    found[cause] = many + 1, first
        most = sorted(found.items(), key=lambda row: -row[1][0])[:CAUSES]
        return [(cause, many, first) for cause, (many, first) in most]

    @cached_property
    def drifting(self) -> tuple[int, int]:
        """Number of cases in which a craft with a zone drifts, and in which it enters one."""
        if FAILS not in varied(self.scenario):
            return 0, 0
        drift = self.column("drift_ratio")
        return int((~np.isnan(drift)).sum()), int((drift < 1.0).sum())

    @cached_property
    def nearest(self) -> tuple[float, int] | None:
        """Minimum clearance ratio of any pair, and its case; None without zones."""
        return self.least(lambda columns: columns["least_ratio"])

    @cached_property
    def flights(self) -> SimulationTally | None:
        """Counts of the complete simulations in the high-fidelity model; None without any."""
        if self.scenario.flights is None:
            return None

        def ratio(columns: Columns) -> Floats:
            return np.asarray(columns[RATIO] + 0.0 * columns["end_s"])

        def sums(columns: Columns) -> Any:
            done = ~np.isnan(columns["end_s"])
            each = [columns[name][done].sum() for name in BY_CAUSE.values()]
            return np.array([done.sum(), (ratio(columns) < 1.0).sum(), *each])

        count, entered, spent, field, feedback = self.total(sums).tolist()
        if not count:
            return None
        causes = zip(BY_CAUSE, (spent - field - feedback, field, feedback), strict=True)
        mean = {cause: summed / count for cause, summed in causes}
        return SimulationTally(int(count), int(entered), mean, self.least(ratio), self.spread(ratio, NEAREST))
