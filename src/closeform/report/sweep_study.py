"""Report of a sweep: one row per point, and one picture."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from closeform.campaign.sweep_cases import Point, SweepCampaign
from closeform.report import model, scenario_summary
from closeform.report.cases import SHARES, percent
from closeform.report.cases_report import CasesReport, Replays
from closeform.report.picture import Picture
from closeform.report.reproduction import quoted
from closeform.report.section import Section
from closeform.report.study import draw_table, draws, spread
from closeform.report.table import Column, Table

NUMBER = re.compile(r"(.*?)([-+]?\d[\d.]*(?:e[-+]?\d+)?)( ?\D.*|)")  # words, a number, its unit


@dataclass(frozen=True, eq=False)
class SweepReport(CasesReport):
    """Report on a sweep."""

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
        campaign = self.campaign
        return campaign.reason or f"all is met in every case at all {len(campaign.points)} points"

    @property
    def hint(self) -> tuple[str, ...]:
        """The command that shows a case; empty if the file gives other cases."""
        if not self.campaign.as_in_file:
            return ()
        file = quoted(self.campaign.scenario.file)
        return (f"closeform run {file} --case K --point P shows a case, of the point in row P from 0 on",)

    @cached_property
    def tables(self) -> tuple[Table, ...]:
        """The table of points."""
        points = self.campaign.points
        keys = (Column(key.removeprefix("study.vary.")) for key in points[0].values)
        what = next((point.name for point in points if point.name is not None), "time [s]")
        columns = *keys, Column("met"), *percent("of cases [%]"), Column(f"median {what}"), Column("95 %")
        return (Table("Points", (*columns, Column("greatest")), [self.row(point) for point in points]),)

    @staticmethod
    def row(point: Point) -> tuple[Any, ...]:
        """Return the row of a point."""
        found: tuple[str, ...] = ("-", "-", "-")
        if point.spread is not None:
            middle, most = (point.spread.quantiles[share].value for share in (0.5, 0.95))
            found = tuple(f"{one:.6g}" for one in (middle, most, point.spread.worst[0][0]))
        return *point.values.values(), point.met_cases, point.met, point.met, *found

    @property
    def summary(self) -> dict[str, Any]:
        """The printed figures in full precision, for `summary.json`."""
        campaign = self.campaign
        return {
            **self.studied,
            "craft": list(campaign.scenario.names),
            "draws": draws(campaign),
            "points": [
                {
                    "values": point.values,
                    "met": {"cases": point.met_cases, **vars(point.met)},
                    "spread": None if point.spread is None else {point.name: spread(point.spread)},
                }
                for point in campaign.points
            ],
        }

    def chapters(self, replays: Replays) -> Sequence[Section]:
        """Return the sections of the page except the one on reproduction."""
        request = scenario_summary.section(self.campaign.scenario)
        return (
            Section(request.title, request.lines, (*request.tables, *draw_table(self.campaign))),
            Section("What was found", self.hint, self.tables, pictures=(self.picture,)),
            Section("Limits of the model", tables=(model.certain([SHARES]),)),
        )

    @property
    def picture(self) -> Picture:
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
        parts = [
            [[getattr(line[value].met, part) for value in every[along]] for line in lines.values()]
            for part in ("share", "low", "high")
        ]
        what = f"{', '.join(filter(None, (along.removeprefix('study.vary.'), kind)))} [{unit}]"
        order = np.argsort(places, kind="stable")
        arguments = (
            np.array(places)[order],
            *(np.array(part)[:, order] for part in parts),
            what,
            list(lines),
        )
        return Picture("sweep", "Shares of cases in which all is met", "sweep", arguments)


def numbered(texts: Sequence[str]) -> tuple[list[float], str, str]:
    """Return the numbers of quantities of one kind, the text before them, and their unit.

    Quantities of different kinds are numbered in their order.
    """
    found = [NUMBER.fullmatch(text) for text in texts]
    kinds = {(one[1], one[3]) for one in found if one is not None}
    if None in found or len(kinds) != 1:
        return [float(k) for k in range(len(texts))], "", "number of the value"
    ((before, after),) = kinds
    return [float(one[2]) for one in found if one is not None], before.strip(), after.strip() or "1"
