"""Reports of studies of missions, of sweeps and of errors."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from closeform.campaign.error_cases import MET as CLEAR
from closeform.campaign.error_cases import MOST as MOST_CASES
from closeform.campaign.error_cases import ErrorCampaign, PairCounts
from closeform.campaign.mission_cases import END, RATIO, SPENT, WORDS, MissionCampaign, SimulationTally
from closeform.campaign.sweep_cases import Point, SweepCampaign
from closeform.confidence import Estimate, estimate
from closeform.report.description import MOST_ROWS, Column, Table, counted
from closeform.report.page import quoted
from closeform.report.picture import Picture
from closeform.report.sections import model
from closeform.report.study import (
    SPREAD,
    CasesReport,
    Replays,
    percent,
    quantiles,
    resolved,
    spread,
    spread_row,
)

NUMBER = re.compile(r"(.*?)([-+]?\d[\d.]*(?:e[-+]?\d+)?)( ?\D.*|)")  # words, a number, its unit
DIGITS = {"[s]": 1, "[%]": 2}  # decimals, by unit
NEAREST = (
    Column("closest pair of a simulation", words=True),
    *(Column(heading, form="{:.4f}".format) for heading in ("median", "5 %", "0.1 %", "least")),
    Column("in case"),
)
CAUSES = tuple(
    Column(f"{cause} [m/s]", form="{:.6g}".format) for cause in ("plan", "model error", "feedback")
)
CASES = Column("case", "case"), Column("entries", "entries"), Column("pairs in conflict", "pairs", words=True)
PICTURES = (  # names, captions, axis labels, columns, and the quantile on the bad side
    ("delta-v", "Delta-v of all craft", "delta-v of all craft [m/s]", "delta_v_m_s", 0.95),
    ("flown-delta-v", "Simulated delta-v of all craft", "simulated delta-v of all craft [m/s]", SPENT, 0.95),
    ("flown-ends", "Largest deviation from the plan at the end", "deviation at the end [m]", END, 0.95),
    (
        "flown-ratios",
        "Clearance ratio of the closest pair",
        "clearance ratio of the closest pair",
        RATIO,
        0.05,
    ),
)


def shares(first: str, share: str = "share [%]") -> tuple[Column, ...]:
    """Return the columns of a table of cases and their share."""
    return Column(first, words=True), Column("cases"), *percent(share)


@dataclass(frozen=True, eq=False)
class MissionStudyReport(CasesReport):
    """Report on a campaign of missions."""

    campaign: MissionCampaign

    @property
    def sure(self) -> Sequence[tuple[str, str]]:
        """The certainty of simulated figures."""
        how = (
            "one per case, with its own errors; ratios at instants a few seconds apart and on cubics between "
        )
        certified = "between (closeform run FILE --case K certifies those of one)"
        return (("Simulations", how + certified),) * (self.campaign.flights is not None)

    @property
    def opening(self) -> tuple[str, ...]:
        """The title, the number of cases, and the stages."""
        campaign, scenario = self.campaign, self.campaign.scenario
        craft = counted(len(scenario.craft), "craft", "craft")
        stages = ", ".join(stage.verb for stage in scenario.stages)
        return scenario.title, f"{len(campaign)} cases of {craft}, seed {campaign.seed}; stages: {stages}"

    @property
    def verdict(self) -> str:
        """The last line: all cases meet their requirements, or the reason why not."""
        return self.campaign.reason or f"in all {len(self.campaign)} cases {WORDS['met']}"

    @property
    def hint(self) -> tuple[str, ...]:
        """The command that shows the first case in which a requirement is not met; empty without any."""
        if self.campaign.ok:
            return ()
        return self.run_of(self.campaign.tally.good.unmet[0], "the first of them")

    @cached_property
    def tables(self) -> tuple[Table, ...]:
        """Outcomes, causes, costs, and the ten cases of highest cost."""
        campaign, flights = self.campaign, self.campaign.flights
        columns: tuple[Column, ...]
        counts = {WORDS[status]: count for status, count in campaign.counts.items() if count}
        ended = [(words, count, *[estimate(count, len(campaign))] * 2) for words, count in counts.items()]
        found = [Table("Outcome of cases", shares("outcome"), ended)]
        if campaign.causes:
            columns = Column("cause, without numbers", words=True), Column("cases"), Column("first")
            found.append(Table("Causes", columns, campaign.causes))
        if flights is not None:
            found += simulated(flights)
        if campaign.spreads:
            every = [*campaign.spreads.items()]
            rows = [
                spread_row(name, one, DIGITS.get(name[-3:], 4), 100.0 if name.endswith("[%]") else 1.0)
                for k, (name, one) in enumerate(every)
                if k == 0 or one.worst[0][0] > 0.0
            ]
            first, both = every[0][1], "" if flights is None else ", simulated and planned"
            columns = resolved((Column("of the completed cases", words=True), *SPREAD), first.count)
            found.append(Table(f"Cost of cases{both}", columns, rows))
            columns = Column("case"), Column("delta-v of all craft [m/s]", form="{:.4f}".format)
            simulated_too = ", simulated" * (flights is not None)
            most = [(case, spent) for spent, case in first.worst]
            found.append(Table(f"Cases with the most delta-v{simulated_too}", columns, most))
        if campaign.nearest is not None:
            planned = " as planned" * (flights is not None)
            columns = Column(f"minimum clearance ratio of any pair{planned}"), Column("in case")
            ratio, case = campaign.nearest
            found.append(Table("", columns, [(f"{ratio:.6f}", case)]))
        drifting, into = campaign.drifting
        if drifting:
            some, bad = estimate(drifting, len(campaign)), estimate(into, drifting)
            lost = (
                ("all cases", drifting, some, some),
                ("of these, with a conflict in free drift", into, bad, bad),
            )
            found.append(Table("Cases with loss of thrust", shares("of"), lost))
        return tuple(found)

    @property
    def figures(self) -> dict[str, Any]:
        """The printed figures in full precision, for `summary.json`."""
        campaign, flights = self.campaign, self.campaign.flights
        every = len(campaign)
        found: dict[str, Any] = {
            "stages": [stage.verb for stage in campaign.scenario.stages],
            "ended": {
                one: {"cases": count} | vars(estimate(count, every)) for one, count in campaign.counts.items()
            },
            "causes": [{"cause": why, "cases": many, "first": case} for why, many, case in campaign.causes],
            "spreads": {name: spread(one) for name, one in campaign.spreads.items()},
            "least_ratio": None if campaign.nearest is None else campaign.nearest[0],
            "drifting": dict(zip(("cases", "into_a_zone"), campaign.drifting, strict=True)),
        }
        if flights is not None:
            near = flights.nearness
            found["flights"] = {
                "flown": flights.count,
                "entered": {"cases": flights.entered} | vars(estimate(flights.entered, flights.count)),
                "mean_delta_v_m_s": flights.mean,
                "least_ratio": None if flights.nearest is None else flights.nearest[0],
                "ratios": None if near is None else quantiles(near),
            }
        return found

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The distributions of delta-v and of the simulation results."""
        campaign, simulated = self.campaign, self.campaign.flights is not None
        done, found = ~np.isnan(campaign.column("end_s")), []
        for name, caption, words, column, tail in PICTURES if simulated else PICTURES[:1]:
            planned = simulated and column == "delta_v_m_s"
            some = campaign.column(column)[done]
            if not np.isnan(some).all():
                arguments = some, f"planned {words}" if planned else words
                caption += ", as planned" * planned
                found.append(Picture(name, caption, "distribution", arguments, {"tail": tail}))
        return tuple(found)


def simulated(flights: SimulationTally) -> Iterator[Table]:
    """Yield tables of keep-out violations, of clearance, and of the delta-v by cause."""
    if flights.nearest is not None and flights.nearness is not None:
        share, quantile = estimate(flights.entered, flights.count), flights.nearness.quantiles
        row = "clearance ratio", *(one.value for one in quantile.values()), *flights.nearest
        entered = "keep-out zone violated", flights.entered, share, share
        yield Table("Simulations in the high-fidelity model", shares("one simulation per case"), [entered])
        yield Table("", resolved(NEAREST, flights.nearness.count, [*quantile]), [row])
    yield Table("Mean simulated delta-v of all craft, by cause", CAUSES, [tuple(flights.mean.values())])


@dataclass(frozen=True, eq=False)
class SweepReport(CasesReport):
    """Report on a sweep: one row per point, and one picture."""

    campaign: SweepCampaign

    @property
    def opening(self) -> tuple[str, ...]:
        """The title, the number of cases and points, and the stages."""
        campaign, scenario = self.campaign, self.campaign.scenario
        points, stages = len(campaign.points), ", ".join(stage.verb for stage in scenario.stages)
        count = f"{len(campaign)} cases at each of {points} points, seed {campaign.seed}; stages: {stages}"
        return scenario.title, count

    @property
    def verdict(self) -> str:
        """The last line: all cases at all points meet their requirements, or the reason why not."""
        points = len(self.campaign.points)
        return self.campaign.reason or f"all requirements met in every case at all {points} points"

    @property
    def hint(self) -> tuple[str, ...]:
        """The command that shows a case; empty if the file gives other cases."""
        if not self.campaign.as_in_file:
            return ()
        file = quoted(self.campaign.scenario.file)
        return (
            f"closeform run {file} --case K --point P shows a case of the point in row P, counted from 0",
        )

    @cached_property
    def tables(self) -> tuple[Table, ...]:
        """The table of points."""
        points, rows = self.campaign.points, []
        keys = (Column(key.removeprefix("study.vary.")) for key in points[0].values)
        what = next((point.name for point in points if point.name is not None), "time [s]")
        columns = *keys, Column("met"), *percent("of cases [%]"), Column(f"median {what}"), Column("95 %")
        for point in points:
            found: tuple[str, ...] = ("-", "-", "-")
            if point.spread is not None:
                middle, most = (point.spread.quantiles[share].value for share in (0.5, 0.95))
                found = tuple(f"{one:.6g}" for one in (middle, most, point.spread.worst[0][0]))
            rows.append((*point.values.values(), point.met_cases, point.met, point.met, *found))
        return (Table("Points", (*columns, Column("greatest")), rows),)

    @property
    def figures(self) -> dict[str, Any]:
        """The printed figures in full precision, for `summary.json`."""
        return {
            "points": [
                {
                    "values": point.values,
                    "met": {"cases": point.met_cases, **vars(point.met)},
                    "spread": None if point.spread is None else {point.name: spread(point.spread)},
                }
                for point in self.campaign.points
            ],
        }

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The shares against the values of the key that has most of them."""
        points = self.campaign.points
        every = {key: list(dict.fromkeys(point.values[key] for point in points)) for key in points[0].values}
        along = max(every, key=lambda key: len(every[key]))
        lines: dict[str, dict[str, Point]] = {}
        for point in points:
            others = ", ".join(
                f"{key.rpartition('.')[2]} {text}" for key, text in point.values.items() if key != along
            )
            lines.setdefault(others, {})[point.values[along]] = point
        places, kind, unit = numbered(every[along])
        order = np.argsort(places, kind="stable")
        parts = [
            np.array([[getattr(line[value].met, part) for value in every[along]] for line in lines.values()])
            for part in ("share", "low", "high")
        ]
        what = f"{', '.join(filter(None, (along.removeprefix('study.vary.'), kind)))} [{unit}]"
        arguments = np.array(places)[order], *(part[:, order] for part in parts), what, list(lines)
        return (Picture("sweep", "Shares of cases in which all requirements are met", "sweep", arguments),)


def numbered(texts: Sequence[str]) -> tuple[list[float], str, str]:
    """Return the numbers of quantities of one kind, the text before them, and their unit.

    Quantities of different kinds are numbered in the order in which they appear.
    """
    found = [NUMBER.fullmatch(text) for text in texts]
    kinds = {(one[1], one[3]) for one in found if one is not None}
    if None in found or len(kinds) != 1:
        return [float(k) for k in range(len(texts))], "", "number of the value"
    ((before, after),) = kinds
    return [float(one[2]) for one in found if one is not None], before.strip(), after.strip() or "1"


@dataclass(frozen=True, eq=False)
class ErrorStudyReport(CasesReport):
    """Report on a campaign of errors: cases and pairs with conflicts."""

    campaign: ErrorCampaign

    @property
    def sure(self) -> Sequence[tuple[str, str]]:
        """The certainty of sigmas and probabilities."""
        return [*model.of_errors(True)]

    @property
    def requested(self) -> tuple[Table, ...]:
        """Nothing, because errors are keys of the scenario."""
        return ()

    @property
    def hint(self) -> tuple[str, ...]:
        """The command that shows the case with most conflicts; empty without any."""
        most = self.campaign.worst
        return self.run_of(most[0][0], "the one with most entries") if most else ()

    @property
    def opening(self) -> tuple[str, ...]:
        """The title, the number of cases, and the sampled errors."""
        campaign, results = self.campaign, self.campaign.mission.results
        craft = counted(len(campaign.scenario.craft), "craft", "craft")
        drawn = ", execution errors and process noise" if campaign.scenario.noisy else " and execution errors"
        return (
            campaign.scenario.title,
            f"{len(campaign)} cases of the errors of {craft}, seed {campaign.seed}",
            f"Executed as planned, 0.0 s to {results[-1].end if results else 0.0:.1f} s: "
            f"initial states{drawn} are sampled",
        )

    @property
    def verdict(self) -> str:
        """The last line: no case has a conflict, or the reason why not."""
        clear = " and ".join(CLEAR[kind] for kind in self.campaign.counts)
        return self.campaign.reason or f"all {len(self.campaign)} cases {clear}"

    @property
    def groups(self) -> Iterator[tuple[str, PairCounts]]:
        """The counts of each kind of zone, with their title."""
        titles = {"zone": "Within a keep-out zone", "body": "Within the hard bodies"}
        for kind, counts in self.campaign.counts.items():
            yield titles[kind], counts

    @cached_property
    def tables(self) -> tuple[Table, ...]:
        """Shares of cases with intervals, for any pair and for each pair, most cases first."""
        made = []
        columns = (
            Column("pair", words=True),
            Column("cases in conflict"),
            *percent("share [%]"),
            Column("in conflict at the start"),
            Column("entries in all"),
        )
        for title, found in self.groups:
            most = np.argsort(-found.inside, kind="stable")[:MOST_ROWS].tolist()
            some = f", the {MOST_ROWS} pairs with most cases of {len(found.pairs)}"
            counts = [("any pair", found.any, found.any_began, found.entries.sum())]
            counts += [
                (" - ".join(found.pairs[k]), found.inside[k], found.began[k], found.entries[k]) for k in most
            ]
            rows = [
                (pair, int(inside), *[self.share(inside)] * 2, int(began), int(entries))
                for pair, inside, began, entries in counts
            ]
            made.append(Table(title + some * (len(found.pairs) > MOST_ROWS), columns, rows))
        return tuple(made)

    def share(self, inside: Any) -> Estimate:
        """Return the share of cases with a conflict."""
        return estimate(int(inside), len(self.campaign))

    def notable(self, replays: Replays = ()) -> tuple[Table, ...]:
        """Return the table of cases with conflicts, sorted by the number of conflicts."""
        worst = self.campaign.worst
        some = f", the {MOST_CASES} with most entries" if len(worst) == MOST_CASES else ""
        return (Table(f"Cases with conflicts{some}", CASES, worst),)

    @property
    def figures(self) -> dict[str, Any]:
        """The printed figures in full precision, for `summary.json`."""
        return {
            "worst": self.notable()[0].records,
            "inside": {
                title: {"any pair": vars(self.share(found.any))}
                | {
                    f"{one} - {other}": vars(self.share(inside))
                    for (one, other), inside in zip(found.pairs, found.inside, strict=True)
                }
                for title, found in self.groups
            },
        }
