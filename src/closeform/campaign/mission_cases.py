"""Cases of a whole mission, each with its own plan, and what they came to."""

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

AT_ONCE = 32  # missions in a chunk: some tenths of a second of plans of a few craft; of many, a minute
CHUNKS = 32  # of a small study at least: what is lost by a stop, and how finely progress is told
MET, UNMET, STOPPED, REFUSED = "met", "unmet", "stopped", "refused"
STATUSES = (MET, UNMET, STOPPED, REFUSED)
WORDS = {
    MET: "all that was asked for is met",
    UNMET: "flown, but not all that was asked for is met",
    STOPPED: "stopped in a stage",
    REFUSED: "cannot be flown",
}
GAP, ABOVE = "gap", "above the lower bound [%]"  # the column, and what it is in a table
NAMED = 10  # cases that are named
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)")


@dataclass(frozen=True, eq=False)
class MissionCases(Cases):
    """Cases with a row each: `status`, `reason`, `end_s`, delta-v in all, by craft and by stage, `conflicts`.

    Where cases are flown in the field, what that came to (`flight_rows`) stands beside what was planned.

    `gap`: by how much a plan is above its lower bound at most, as a share of it.
    `least_ratio`: of all pairs, in terms of their zones, nan where none has one.  Of what was not flown the
    numbers are nan.  Where errors are drawn, of each stage how far they put the craft that is off most;
    where craft fail, when each does, and `drift_ratio`, the least from then on between them and any other.
    `plans` are those that cases have in common.
    """

    plans: Plans = field(default_factory=Plans)

    @property
    def at_once(self) -> int:
        """Cases in a chunk."""
        return AT_ONCE

    def in_chunk(self, count: int) -> int:
        """Cases in a chunk of a study of so many."""
        return max(1, min(AT_ONCE, count // CHUNKS))

    def fly(self, first: int, last: int) -> Columns:
        """All stages of each case, as a run of it flies them."""
        rows = [self.row(case) for case in range(first, last)]
        return {name: np.array([row[name] for row in rows]) for name in self.names}

    @property
    def names(self) -> tuple[str, ...]:
        """The columns of `fly`."""
        craft = (of_craft(name) for name in self.scenario.names)
        numbers = range(1, len(self.scenario.stages) + 1)
        stages = (*map(of_stage, numbers), *(map(off_in, numbers) if self.replanned else ()))
        lost = (*map(lost_by, self.scenario.names), "drift_ratio") if self.failing else ()
        last = *lost, *flight_rows.names(self.scenario)
        least = "least_ratio", *([GAP] if self.bounded else []), "conflicts"
        return "status", "reason", "end_s", "delta_v_m_s", *craft, *stages, *least, *last

    @property
    def bounded(self) -> bool:
        """Whether any stage goes around zones, so that its plans have lower bounds."""
        return any(isinstance(stage, Clearing) for stage in self.scenario.stages)

    @property
    def failing(self) -> bool:
        """Whether craft may lose their thrust."""
        return FAILS in varied(self.scenario)

    @property
    def replanned(self) -> bool:
        """Whether errors are drawn, and each stage is planned from where they left the craft."""
        return self.scenario.study is not None and self.scenario.study.draws == "replanned"

    def row(self, case: int) -> dict[str, Any]:
        """What became of one case."""
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
        if self.scenario.place is None:  # no point of a sweep, whose report shows no case
            self.plans.keep(case, mission, ranks(case, row))
        return row

    def mission(self, case: int) -> Mission:
        """Return the mission of one case: the one that was flown, if it was kept, else flown again."""
        kept = self.plans.mission(case)
        return kept or self.as_happened(one_case(self.scenario, self.seed, case), case)

    def as_happened(self, scenario: Scenario, case: int) -> Mission:
        """Return a case with what happens in it that no plan knows."""
        return as_happened(self.planned(scenario, case), predicted=self.scenario.flights is None)

    def planned(self, scenario: Scenario, case: int) -> Mission:
        """A case as planned: as other cases that draw the same of what plans know."""
        predicted = self.scenario.flights is None  # which flights answer better
        if not recurring(self.scenario):
            return staged(scenario, predicted=predicted)
        drawn = known(self.scenario, self.seed, case)
        return replace(self.plans.of(drawn, lambda: staged(scenario, predicted=predicted)), scenario=scenario)

    def good(self, columns: Columns) -> Any:
        """In which cases all is met."""
        return columns["status"] == MET

    def campaign(self, chunks: CaseChunks) -> MissionCampaign:
        """What became of them."""
        return MissionCampaign(self, chunks)


def ranks(case: int, row: Mapping[str, Any]) -> dict[str, float]:
    """Return what makes a case worth a page, the least first; nan where it is not (`viewer.replays`)."""
    last, spent = nan if np.isnan(row["end_s"]) else 0.0, row.get(flight_rows.SPENT, row["delta_v_m_s"])
    return {
        **{status: case if row["status"] == status else nan for status in (UNMET, STOPPED)},
        "spent": last - spent,
        "near": row["least_ratio"],
        "near in flight": last + row.get(flight_rows.RATIO, nan),
    }


def ended(mission: Mission) -> str:
    """How it ended: one of STATUSES."""
    if mission.stopped is not None:
        return STOPPED
    if mission.grounded is not None:
        return REFUSED
    return MET if mission.verdict.ok else UNMET


def figures(mission: Mission) -> dict[str, Any]:
    """What a mission came to, in numbers: of the stages that were flown."""
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
    """By how much a plan is above its lower bound at most, as a share of it; nan where none has one."""
    moved = [one.result for one in results if isinstance(one.stage, Clearing)]
    plans = [getattr(one, "plan", None) or one.avoidance for one in moved]
    return float(np.fmax.reduce([max(plan.gap, 0.0) for plan in plans], initial=nan))


def off(result: StageResult[Any, Any]) -> float:
    """How far [m] from its planned end the craft is that errors of burns put off most.

    Where a gathering would have ended before, with exact burns: from where it would have coasted to.
    """
    paths, end = result.planned.paths, min(result.end, result.planned.end)
    planned = paths.position(end)
    if end < result.end:
        planned = (paths.state(end) @ paths.orbit.transition(result.end - end).T)[..., :3]
    return float(np.linalg.norm(result.after.paths.position(result.end) - planned, axis=-1).max())


def off_in(number: int) -> str:
    """The column of how far errors of burns put a craft off in a stage."""
    return f"stage_{number}_off_m"


def of_craft(name: str) -> str:
    """The column of what a craft spends."""
    return f"{name}_delta_v_m_s"


def of_stage(number: int) -> str:
    """The column of what all spend in a stage."""
    return f"stage_{number}_delta_v_m_s"


@dataclass(frozen=True)
class Endings:
    """How cases ended: by status `counts` and the `first` few; why, how often and first; who came nearest.

    `drifting`: in how many a craft drifts that has a zone with another, and in how many into one.
    """

    counts: dict[str, int]
    first: dict[str, list[int]]
    causes: dict[str, tuple[int, int]]
    nearest: tuple[float, int] | None
    drifting: tuple[int, int]

    @classmethod
    def of(cls, chunks: CaseChunks, failing: bool) -> Self:
        """Counted chunk after chunk, so that no more than one is held."""
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
    """What became of C cases of a mission, drawn with a seed, as `chunks` hold it.

    As arrays (C,), read when they are asked for: `column` of any name that the files of cases have, of which
    `statuses` are "met", "unmet", "stopped" or "refused", all of them counted.
    """

    kind: MissionCases
    _told: ClassVar = ("title", "seed", "status", "reason")

    def column(self, name: str) -> Any:
        """One column of all cases."""
        return np.concatenate([part[name] for _, part in self.chunks.read(name)])

    @cached_property
    def statuses(self) -> Any:
        """How each case ended."""
        return self.column("status").astype(str)

    @cached_property
    def endings(self) -> Endings:
        """How cases ended, counted chunk after chunk."""
        return Endings.of(self.chunks, self.kind.failing)

    @property
    def counts(self) -> dict[str, int]:
        """How many cases ended how, in the order of STATUSES."""
        return self.endings.counts

    @cached_property
    def good(self) -> Any:
        """In which cases (C,) all is met."""
        return self.statuses == MET

    @property
    def failed(self) -> Any:
        """The numbers (F,) of the cases in which it is not."""
        return np.flatnonzero(~self.good)

    @property
    def met_cases(self) -> int:
        """In how many cases all is met."""
        return self.counts[MET]

    @property
    def ok(self) -> bool:
        """Whether all is met in every case."""
        return self.met_cases == len(self)

    @property
    def status(self) -> CampaignStatus:
        """How it ended."""
        if self.ok:
            return CampaignStatus.COMPLETE
        never = self.counts[STOPPED] + self.counts[REFUSED]
        return CampaignStatus.INCOMPLETE if never else CampaignStatus.UNMET

    @property
    def reason(self) -> str | None:
        """How many cases ended badly, and which come first; None where none did."""
        parts = []
        for status, count in self.counts.items():
            if count and status != MET:
                cases = self.endings.first[status]
                named = ", ".join(map(str, cases)) + ", ..." * (count > len(cases))
                parts.append(f"{count} of {len(self)} cases {WORDS[status]}: {named}")
        return "; ".join(parts) or None

    @cached_property
    def causes(self) -> list[tuple[str, int, int]]:
        """Why cases ended badly, numbers left out: how many did, and the first of them; most often first."""
        most = sorted(self.endings.causes.items(), key=lambda row: -row[1][0])[:NAMED]
        return [(cause, many, first) for cause, (many, first) in most]

    @cached_property
    def spreads(self) -> dict[str, Spread]:
        """Of the delta-v [m/s] in all, by stage and by craft, and of the end [s], where it was all flown.

        Where errors are drawn, of how far they put craft off in each stage [m], too.
        """
        named = {"delta-v of all craft [m/s]": "delta_v_m_s"}
        if len(self.scenario.stages) > 1:
            stages = enumerate(self.scenario.stages, 1)
            named |= {f"stage {number}, {stage.verb} [m/s]": of_stage(number) for number, stage in stages}
        named |= {f"delta-v of {name} [m/s]": of_craft(name) for name in self.scenario.names}
        if self.kind.replanned:
            stages = enumerate(self.scenario.stages, 1)
            named |= {f"stage {number}, {stage.verb}, off [m]": off_in(number) for number, stage in stages}
        if self.kind.bounded:
            named[ABOVE] = GAP
        named["end [s]"] = "end_s"
        if self.scenario.flights is not None:
            planned = {f"planned: {words}": name for words, name in named.items()}
            named = {**dict(flight_rows.named(self.scenario)), **planned}
        found = {words: self.spread(name) for words, name in named.items()}
        return {words: spread for words, spread in found.items() if spread is not None}

    def spread(self, name: str) -> Spread | None:
        """Of one column, of the cases that were flown to the end and have a number in it."""

        def values() -> Iterator[tuple[Floats, Any]]:
            for first, part in self.chunks.read(name, "end_s"):
                counts = ~np.isnan(part["end_s"] + part[name])
                yield part[name][counts], first + np.flatnonzero(counts)

        return Spread.of(values)

    @cached_property
    def flights(self) -> flight_rows.FlightTally | None:
        """What became of the flights in the field; None where none was flown."""
        return None if self.scenario.flights is None else flight_rows.FlightTally.of(self.chunks)

    @property
    def nearest(self) -> tuple[float, int] | None:
        """The least ratio of any pair in terms of its zone, and in which case; None where nobody has one."""
        return self.endings.nearest
