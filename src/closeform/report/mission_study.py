"""Report of a study of missions: how cases ended, why, and their costs."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from closeform.campaign.mission_cases import WORDS, MissionCampaign
from closeform.confidence import estimate
from closeform.report import model, scenario_summary, simulation_study, worst
from closeform.report.cases import SHARES, percent
from closeform.report.cases_report import CasesReport, Replays
from closeform.report.picture import Picture
from closeform.report.section import Section
from closeform.report.study import SPREAD, draw_table, draws, resolved, spread, spread_row
from closeform.report.table import Column, Table, counted

ENDED = Column("how cases ended", words=True), Column("cases"), *percent("share [%]")
WHY = Column("why, numbers left out", words=True), Column("cases"), Column("first")
SPREADS = Column("of the cases flown to the end", words=True), *SPREAD
LOST = Column("of", words=True), Column("cases"), *percent("share [%]")
SPENT = "delta-v", "What all craft spend together", "delta-v of all craft [m/s]", "delta_v_m_s", 0.95
PLANNED = SPENT[0], f"{SPENT[1]}, as planned", f"planned {SPENT[2]}", *SPENT[3:]  # if cases are simulated
DIGITS = {"[s]": 1, "[%]": 2}  # decimals, by unit
DEAREST = Column("case"), Column("delta-v of all craft [m/s]", form="{:.4f}".format)


@dataclass(frozen=True, eq=False)
class MissionStudyReport(CasesReport):
    """Report on a campaign of missions."""

    campaign: MissionCampaign

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
        campaign = self.campaign
        ended = []
        for status, count in campaign.counts.items():
            if count:
                share = estimate(count, len(campaign))
                ended.append((WORDS[status], count, share, share))
        found = [Table("How cases ended", ENDED, ended)]
        if campaign.causes:
            found.append(Table("Why", WHY, campaign.causes))
        if campaign.flights is not None:
            found += simulation_study.tables(campaign.flights)
        if campaign.spreads:
            flown = ", flown" * (campaign.flights is not None)
            title = "What they spent" if campaign.flights is None else "What they spend, flown and as planned"
            every = [*campaign.spreads.items()]
            told = every[:1] + [(name, one) for name, one in every[1:] if one.worst[0][0] > 0.0]
            rows = [
                spread_row(name, one, DIGITS.get(name[-3:], 4), 100.0 if name.endswith("[%]") else 1.0)
                for name, one in told
            ]
            found.append(Table(title, resolved(SPREADS, every[0][1].count), rows))
            dearest = every[0][1].worst
            most = [(case, spent) for spent, case in dearest]
            found.append(Table(f"The cases that spent most{flown}", DEAREST, most))
        if campaign.nearest is not None:
            as_planned = " as planned" * (campaign.flights is not None)
            words = f"closest of any pair{as_planned}, in terms of its zone"
            columns = Column(words), Column("in case")
            ratio, case = campaign.nearest
            found.append(Table("", columns, [(f"{ratio:.6f}", case)]))
        drifting, into = campaign.drifting
        if drifting:
            some, bad = estimate(drifting, len(campaign)), estimate(into, drifting)
            lost = ("all cases", drifting, some, some), ("of these, it drifts into a zone", into, bad, bad)
            found.append(Table("Cases in which a craft loses its thrust", LOST, lost))
        return tuple(found)

    @property
    def summary(self) -> dict[str, Any]:
        """The printed figures in full precision, for `summary.json`."""
        campaign, scenario = self.campaign, self.campaign.scenario
        every = len(campaign)
        shares = {one: vars(estimate(count, every)) for one, count in campaign.counts.items()}
        return {
            **self.studied,
            "craft": list(scenario.names),
            "stages": [stage.verb for stage in scenario.stages],
            "draws": draws(campaign),
            "ended": {one: {"cases": count} | shares[one] for one, count in campaign.counts.items()},
            "causes": [{"cause": why, "cases": many, "first": case} for why, many, case in campaign.causes],
            "spreads": {name: spread(one) for name, one in campaign.spreads.items()},
            "least_ratio": None if campaign.nearest is None else campaign.nearest[0],
            "drifting": dict(zip(("cases", "into_a_zone"), campaign.drifting, strict=True)),
            **({} if campaign.flights is None else {"flights": simulation_study.figures(campaign.flights)}),
        }

    def chapters(self, replays: Replays) -> Sequence[Section]:
        """Return the sections of the page except the one on reproduction."""
        scenario = self.campaign.scenario
        request = scenario_summary.section(scenario)
        sure = [simulation_study.SURE] * (self.campaign.flights is not None)
        return (
            Section(request.title, request.lines, (*request.tables, *draw_table(self.campaign))),
            Section("What was found", self.hint, self.tables, pictures=self.pictures),
            *worst.section(self.campaign, replays),
            Section("Limits of the model", tables=(model.certain([SHARES, *sure]),)),
        )

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The distributions of delta-v and of the simulation results."""
        campaign = self.campaign
        done = ~np.isnan(campaign.column("end_s"))
        if not done.any():
            return ()
        found, told = [], (SPENT,) if campaign.flights is None else (PLANNED, *simulation_study.PICTURES)
        for name, caption, words, column, tail in told:
            some = campaign.column(column)[done]
            if not np.isnan(some).any():
                found.append(Picture(name, caption, "distribution", (some, words), {"tail": tail}))
        return tuple(found)
