"""The report of a study of errors: in how many cases who comes within what."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from closeform.campaign.error_cases import ErrorCampaign, PairCases
from closeform.campaign.shares import Estimate, estimate
from closeform.report import asked, model, results, worst
from closeform.report.cases import SHARES, Replays, percent, repeated, studied
from closeform.report.page import Head
from closeform.report.section import Section
from closeform.report.table import MOST_ROWS, Column, Table, counted
from closeform.result_folder import Folder

COLUMNS = (
    Column("who", words=True),
    Column("cases ever inside"),
    *percent("share [%]"),
    Column("inside at the start"),
    Column("entries in all"),
)


@dataclass(frozen=True, eq=False)
class ErrorStudyReport:
    """What there is to say of a campaign of errors."""

    campaign: ErrorCampaign
    hint: tuple[str, ...] = ()

    @property
    def opening(self) -> tuple[str, ...]:
        """What was flown."""
        campaign, results = self.campaign, self.campaign.mission.results
        craft = counted(len(campaign.scenario.craft), "craft", "craft")
        return (
            campaign.scenario.title,
            f"{len(campaign)} cases of the errors of {craft}, seed {campaign.seed}",
            f"Flown as planned, 0.0 s to {results[-1].end if results else 0.0:.1f} s: "
            "states at the start, burns and impulses are drawn",
        )

    @property
    def verdict(self) -> str:
        """The last line."""
        return self.campaign.reason or f"all {len(self.campaign)} cases {' and '.join(self.campaign.met)}"

    @property
    def groups(self) -> Iterator[tuple[str, tuple[PairCases, ...]]]:
        """What is looked at, and its pairs, those with the most cases first."""
        for title, pairs in (
            ("Within a keep-out zone", self.campaign.zones),
            ("Within the hard bodies", self.campaign.bodies),
        ):
            if pairs:
                yield title, tuple(sorted(pairs, key=lambda pair: -int(pair.inside.sum())))

    @cached_property
    def tables(self) -> tuple[Table, ...]:
        """Shares of cases with their intervals, of any pair and of each."""
        made = []
        for title, pairs in self.groups:
            some = f", the {MOST_ROWS} pairs with most of {len(pairs)}" if len(pairs) > MOST_ROWS else ""
            rows = [self.row("any pair", pairs)]
            rows += [self.row(f"{pair.first} - {pair.second}", (pair,)) for pair in pairs[:MOST_ROWS]]
            made.append(Table(title + some, COLUMNS, rows))
        return tuple(made)

    def row(self, who: str, pairs: tuple[PairCases, ...]) -> tuple[Any, ...]:
        """A row of COLUMNS."""
        count = int(self.campaign.any_of(pairs).sum())
        share = self.share(pairs)
        began = np.any([pair.began for pair in pairs], axis=0)
        return who, count, share, share, int(began.sum()), int(sum(pair.entries.sum() for pair in pairs))

    def share(self, pairs: tuple[PairCases, ...]) -> Estimate:
        """The share of cases in which any of some pairs is ever inside."""
        return estimate(int(self.campaign.any_of(pairs).sum()), len(self.campaign))

    @property
    def summary(self) -> dict[str, Any]:
        """Every figure printed, in full."""
        campaign, scenario = self.campaign, self.campaign.scenario
        return {
            **studied(campaign, self.verdict),
            "craft": list(scenario.names),
            "draws": "errors",
            "worst": worst.of_errors(campaign).records,
            "inside": {
                title: {"any pair": vars(self.share(pairs))}
                | {f"{one.first} - {one.second}": vars(self.share((one,))) for one in pairs}
                for title, pairs in self.groups
            },
        }

    def leave(self, folder: Folder, replays: Replays = ()) -> None:
        """Fill a result folder: the page, the summary, and a row for each case; `replays` are pages in it."""
        campaign = self.campaign
        folder.scenario(campaign.scenario)
        columns: dict[str, Any] = {"case": np.arange(len(campaign))}
        for what, met in campaign.met.items():
            columns[what.replace(" ", "_")] = met
        for key, pairs in (("zone", campaign.zones), ("body", campaign.bodies)):
            if pairs:
                columns[f"{key}_entries"] = np.sum([pair.entries for pair in pairs], axis=0)
        folder.table("cases/000000000", columns)
        title, *lines = self.opening
        head = Head(title, lines, self.verdict, campaign.ok)
        worth = worst.of_errors(campaign)
        sure = [SHARES, *model.of_errors(True)]
        chapters = (
            asked.section(campaign.scenario),
            Section("What was found", tables=self.tables),
            *worst.section(replays, Path(campaign.scenario.file).name, worth),
            Section("Limits of the model", tables=(model.certain(sure),)),
        )
        results.leave(folder, head, chapters, partial(repeated, campaign), self.summary)
