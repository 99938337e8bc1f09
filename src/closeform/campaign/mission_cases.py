"""Monte Carlo cases of a whole mission, each with its own plan, and their statistics."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, nan
from typing import Any, ClassVar, Self

import numpy as np

from closeform.arrays import Floats
from closeform.campaign import flight_rows
from closeform.campaign.cases import Cases, Columns
from closeform.campaign.chunks import CaseChunks
from closeform.campaign.draws import lost_by, varied
from closeform.campaign.flown_cases import FlownCases
from closeform.campaign.one_case import one_case
from closeform.campaign.plans import Plans, known, recurring
from closeform.campaign.search_campaign import CampaignStatus
from closeform.campaign.spread import Spread
from closeform.mission.mission import as_happened, staged
from closeform.mission.mission_result import Mission, StageResult
from closeform.scenario import Scenario, ScenarioError
from closeform.scenario.stages import Clearing
from closeform.scenario.study import FAILS

AT_ONCE = 32  # missions in a chunk: a few tenths of a second for a few craft, a minute for many
CHUNKS = 32  # least number in a small study; fewer lose more work at a stop and report progress more coarsely
MET, UNMET, STOPPED, REFUSED = "met", "unmet", "stopped", "refused"
STATUSES = (MET, UNMET, STOPPED, REFUSED)
WORDS = {
    MET: "with all requirements met",
    UNMET: "with requirements not met",
    STOPPED: "stopped in a stage",
    REFUSED: "not feasible",
}
GAP, ABOVE = "gap", "above the lower bound [%]"  # the column, and its label in a table
NAMED = 10  # number of cases that a message lists
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)")


@dataclass(frozen=True, eq=False)
class MissionCases(Cases):
    """Cases of a mission with a row each.

    Columns: `status`, `reason`, `end_s`, delta-v in all, by craft and by stage, `conflicts`. Simulated cases
    have the columns of `flight_rows` beside the planned ones. `gap`: the optimality gap of a plan, relative
    to it. `least_ratio`: the minimum clearance ratio of all pairs, nan without zones. Numbers of stages that
    were not executed are nan. With sampled errors, the greatest deviation of a craft in each stage; with
    failures, the time of each and `drift_ratio`, the minimum clearance ratio of drifting craft. `plans` are
    shared between cases.
    """

    plans: Plans = field(default_factory=Plans)

    @property
    def at_once(self) -> int:
        """Greatest number of cases in a chunk."""
        return AT_ONCE

    def in_chunk(self, count: int) -> int:
        """Return the number of cases in a chunk of a study of `count` cases."""
        return max(1, min(AT_ONCE, count // CHUNKS))

    def fly(self, first: int, last: int) -> Columns:
        """Plan and evaluate all stages of each case, as a run of it does."""
        rows = [self.row(case) for case in range(first, last)]
        return {name: np.array([row[name] for row in rows]) for name in self.names}

    @property
    def names(self) -> tuple[str, ...]:
        """Columns of `fly`."""
        craft = (of_craft(name) for name in self.scenario.names)
        numbers = range(1, len(self.scenario.stages) + 1)
        stages = (*map(of_stage, numbers), *(map(off_in, numbers) if self.replanned else ()))
        lost = (*map(lost_by, self.scenario.names), "drift_ratio") if self.failing else ()
        last = *lost, *flight_rows.names(self.scenario)
        least = "least_ratio", *([GAP] if self.bounded else []), "conflicts"
        return "status", "reason", "end_s", "delta_v_m_s", *craft, *stages, *least, *last

    @property
    def bounded(self) -> bool:
        """True if any stage avoids zones, so that its plans have lower bounds."""
        return any(isinstance(stage, Clearing) for stage in self.scenario.stages)

    @property
    def failing(self) -> bool:
        """True if craft may lose their thrust."""
        return FAILS in varied(self.scenario)

    @property
    def replanned(self) -> bool:
        """True if errors are sampled and each stage is planned from the state that they result in."""
        return self.scenario.study is not None and self.scenario.study.draws == "replanned"

    def row(self, case: int) -> dict[str, Any]:
        """Return the row of one case."""
        row: dict[str, Any] = dict.fromkeys(self.names, nan) | {"conflicts": -1}
        scenario = one_case(self.scenario, self.seed, case)
        if scenario.flight_seed is not None:
            row[flight_rows.SEED] = scenario.flight_seed
        try:
            mission = self.as_happened(scenario, case)
        except ScenarioError as error:
            reason = error.lines[0].removeprefix(f"{self.scenario.file}: ")
            return row | {"status": REFUSED, "reason": reason}
        row |= {"status": ended(mission), "reason": "" if mission.verdict.ok else str(mission.verdict)}
        row |= figures(mission)
        if self.scenario.place is None:  # the report of a sweep shows no cases
            self.plans.keep(case, mission, ranks(case, row))
        return row

    def mission(self, case: int) -> Mission:
        """Return the mission of one case: the stored one, else evaluated again."""
        kept = self.plans.mission(case)
        return kept or self.as_happened(one_case(self.scenario, self.seed, case), case)

    def as_happened(self, scenario: Scenario, case: int) -> Mission:
        """Return the mission of a case with the events that its plan does not know."""
        return as_happened(self.planned(scenario, case), predicted=self.scenario.flights is None)

    def planned(self, scenario: Scenario, case: int) -> Mission:
        """Return the planned mission of a case, shared with cases that have the same plan inputs."""
        predicted = self.scenario.flights is None  # a simulation gives better predictions
        if not recurring(self.scenario):
            return staged(scenario, predicted=predicted)
        drawn = known(self.scenario, self.seed, case)
        return replace(self.plans.of(drawn, lambda: staged(scenario, predicted=predicted)), scenario=scenario)

    def good(self, columns: Columns) -> Any:
        """Return the cases in which all requirements are met."""
        return columns["status"] == MET

    def campaign(self, chunks: CaseChunks) -> MissionCampaign:
        """Return the statistics of the cases."""
        return MissionCampaign(self, chunks)


def ranks(case: int, row: Mapping[str, Any]) -> dict[str, float]:
    """Return the ranks that select a case for a page, least first; nan if none does (`viewer.replays`)."""
    last, spent = nan if np.isnan(row["end_s"]) else 0.0, row.get(flight_rows.SPENT, row["delta_v_m_s"])
    return {
        **{status: case if row["status"] == status else nan for status in (UNMET, STOPPED)},
        "spent": last - spent,
        "near": row["least_ratio"],
        "near in flight": last + row.get(flight_rows.RATIO, nan),
    }


def ended(mission: Mission) -> str:
    """Return how a mission ended: one of STATUSES."""
    if mission.stopped is not None:
        return STOPPED
    if mission.grounded is not None:
        return REFUSED
    return MET if mission.verdict.ok else UNMET


def figures(mission: Mission) -> dict[str, Any]:
    """Return the numbers of a mission, from its executed stages."""
    flown = mission.flown
    each = np.array([result.delta_v for result in flown]).reshape(-1, len(mission.scenario.craft))
    ratios = [pair.ratio for result in flown for pair in result.after.approaches]
    return {
        "end_s": flown[-1].end if mission.stopped is None and mission.grounded is None else nan,
        "delta_v_m_s": each.sum() if flown else nan,
        **dict(zip(map(of_craft, mission.scenario.names), each.sum(axis=0), strict=True)),
        **{of_stage(result.number): spent.sum() for result, spent in zip(flown, each, strict=True)},
        **{off_in(result.number): off(result) for result in flown if result.commanded is not None},
        "least_ratio": min(ratios, default=nan),
        **({GAP: widest(flown)} if any(isinstance(one.stage, Clearing) for one in mission.results) else {}),
        "conflicts": sum(len(result.after.conflicts) for result in flown),
        **{lost_by(one.craft): one.time for one in mission.lost},
        "drift_ratio": np.fmin.reduce([one.ratio for one in mission.lost], initial=nan),
        **({} if mission.flights is None else flight_rows.figures(mission.flights)),
    }


def widest(results: Sequence[StageResult[Any, Any]]) -> float:
    """Return the greatest optimality gap of the plans, relative to each plan; nan without bounds."""
    moved = [one.result for one in results if isinstance(one.stage, Clearing)]
    plans = [getattr(one, "plan", None) or one.avoidance for one in moved]
    return float(np.fmax.reduce([max(plan.gap, 0.0) for plan in plans], initial=nan))


def off(result: StageResult[Any, Any]) -> float:
    """Return the greatest distance [m] between a craft and its planned end, due to burn errors.

    A gathering with exact burns can end earlier; its end is then propagated by coasting.
    """
    paths, end = result.planned.paths, min(result.end, result.planned.end)
    planned = paths.position(end)
    if end < result.end:
        planned = (paths.state(end) @ paths.orbit.transition(result.end - end).T)[..., :3]
    return float(np.linalg.norm(result.after.paths.position(result.end) - planned, axis=-1).max())


def off_in(number: int) -> str:
    """Return the column of the greatest deviation due to burn errors in a stage."""
    return f"stage_{number}_off_m"


def of_craft(name: str) -> str:
    """Return the column of the delta-v of a craft."""
    return f"{name}_delta_v_m_s"


def of_stage(number: int) -> str:
    """Return the column of the delta-v of all craft in a stage."""
    return f"stage_{number}_delta_v_m_s"


@dataclass(frozen=True)
class Endings:
    """Outcomes of cases: `counts` by status, the `first` few, the causes, and the closest pair.

    `drifting`: the number of cases in which a craft with a zone drifts, and in which it enters one.
    """

    counts: dict[str, int]
    first: dict[str, list[int]]
    causes: dict[str, tuple[int, int]]
    nearest: tuple[float, int] | None
    drifting: tuple[int, int]

    @classmethod
    def of(cls, chunks: CaseChunks, failing: bool) -> Self:
        """Count chunk after chunk, so that only one is in memory."""
        drifting = np.zeros(2, dtype=np.int64)
        counts, first = dict.fromkeys(STATUSES, 0), {status: list[int]() for status in STATUSES}
        causes, nearest = dict[str, tuple[int, int]](), (inf, -1)
        for begin, part in chunks.read("status", "reason", "least_ratio", *["drift_ratio"] * failing):
            if failing:
                drift = part["drift_ratio"]
                drifting += [np.count_nonzero(~np.isnan(drift)), np.count_nonzero(drift < 1.0)]
            rows = zip(part["status"].tolist(), part["reason"].tolist(), strict=True)
            for case, (status, reason) in enumerate(rows, begin):
                counts[status] += 1
                if len(first[status]) < NAMED:
                    first[status].append(case)
                if reason:
                    cause = NUMBER.sub("...", reason)
                    many, since = causes.get(cause, (0, case))
                    causes[cause] = many + 1, since
            ratio = np.where(np.isnan(part["least_ratio"]), inf, part["least_ratio"])
            nearest = min(nearest, (float(ratio.min()), begin + int(ratio.argmin())))
        found = nearest if nearest[0] < inf else None
        return cls(counts, first, causes, found, (int(drifting[0]), int(drifting[1])))


@dataclass(frozen=True, eq=False, repr=False)
class MissionCampaign(FlownCases):
    """Statistics of C cases of a mission, drawn with a seed, held by `chunks`.

    Arrays (C,) are read on request: `column` of any name in the files of cases, of which `statuses` are
    "met", "unmet", "stopped" or "refused".
    """

    kind: MissionCases
    _told: ClassVar = ("title", "seed", "status", "reason")

    def column(self, name: str) -> Any:
        """Return one column of all cases."""
        return np.concatenate([part[name] for _, part in self.chunks.read(name)])

    @cached_property
    def statuses(self) -> Any:
        """Status of each case."""
        return self.column("status").astype(str)

    @cached_property
    def endings(self) -> Endings:
        """Outcomes of the cases, counted chunk after chunk."""
        return Endings.of(self.chunks, self.kind.failing)

    @property
    def counts(self) -> dict[str, int]:
        """Number of cases by status, in the order of STATUSES."""
        return self.endings.counts

    @cached_property
    def good(self) -> Any:
        """Cases (C,) in which all requirements are met."""
        return self.statuses == MET

    @property
    def failed(self) -> Any:
        """Numbers (F,) of the cases in which they are not."""
        return np.flatnonzero(~self.good)

    @property
    def met_cases(self) -> int:
        """Number of cases in which all requirements are met."""
        return self.counts[MET]

    @property
    def ok(self) -> bool:
        """True if all requirements are met in every case."""
        return self.met_cases == len(self)

    @property
    def status(self) -> CampaignStatus:
        """Status of the campaign."""
        if self.ok:
            return CampaignStatus.COMPLETE
        never = self.counts[STOPPED] + self.counts[REFUSED]
        return CampaignStatus.INCOMPLETE if never else CampaignStatus.UNMET

    @property
    def reason(self) -> str | None:
        """Number of cases that ended badly, and the first of them; None if there are none."""
        parts = []
        for status, count in self.counts.items():
            if count and status != MET:
                cases = self.endings.first[status]
                named = ", ".join(map(str, cases)) + ", ..." * (count > len(cases))
                parts.append(f"{count} of {len(self)} cases {WORDS[status]}: {named}")
        return "; ".join(parts) or None

    @cached_property
    def causes(self) -> list[tuple[str, int, int]]:
        """Causes without their numbers, the number of cases of each and the first; most frequent first."""
        most = sorted(self.endings.causes.items(), key=lambda row: -row[1][0])[:NAMED]
        return [(cause, many, first) for cause, (many, first) in most]

    @cached_property
    def spreads(self) -> dict[str, Spread]:
        """Spreads of the delta-v [m/s] in all, by stage and by craft, and of the end time [s].

        Over complete missions. With sampled errors, also of the deviation in each stage [m].
        """
        named = {"delta-v of all craft [m/s]": "delta_v_m_s"}
        if len(self.scenario.stages) > 1:
            stages = enumerate(self.scenario.stages, 1)
            named |= {f"stage {number}, {stage.verb} [m/s]": of_stage(number) for number, stage in stages}
        named |= {f"delta-v of {name} [m/s]": of_craft(name) for name in self.scenario.names}
        if self.kind.replanned:
            stages = enumerate(self.scenario.stages, 1)
            named |= {
                f"stage {number}, {stage.verb}, deviation [m]": off_in(number) for number, stage in stages
            }
        if self.kind.bounded:
            named[ABOVE] = GAP
        named["end [s]"] = "end_s"
        if self.scenario.flights is not None:
            planned = {f"planned: {words}": name for words, name in named.items()}
            named = {**dict(flight_rows.named(self.scenario)), **planned}
        found = {words: self.spread(name) for words, name in named.items()}
        return {words: spread for words, spread in found.items() if spread is not None}

    def spread(self, name: str) -> Spread | None:
        """Return the spread of one column over the complete cases with a number in it."""

        def values() -> Iterator[tuple[Floats, Any]]:
            for first, part in self.chunks.read(name, "end_s"):
                counts = ~np.isnan(part["end_s"] + part[name])
                yield part[name][counts], first + np.flatnonzero(counts)

        return Spread.of(values)

    @cached_property
    def flights(self) -> flight_rows.FlightTally | None:
        """Counts of the simulations in the high-fidelity model; None without any."""
        return None if self.scenario.flights is None else flight_rows.FlightTally.of(self.chunks)

    @property
    def nearest(self) -> tuple[float, int] | None:
        """Minimum clearance ratio of any pair, and its case; None without zones."""
        return self.endings.nearest
