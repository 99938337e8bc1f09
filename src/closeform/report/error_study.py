"""Report of a study of errors: cases and pairs with conflicts."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from closeform.campaign.error_cases import MET, ErrorCampaign, PairCounts
from closeform.confidence import Estimate, estimate
from closeform.report import model, scenario_summary, worst
from closeform.report.cases import SHARES, percent
from closeform.report.cases_report import CasesReport, Replays
from closeform.report.section import Section
from closeform.report.table import MOST_ROWS, Column, Table, counted

COLUMNS = (
    Column("who", words=True),
    Column("cases ever inside"),
    *percent("share [%]"),
    Column("inside at the start"),
    Column("entries in all"),
)


@dataclass(frozen=True, eq=False)
class ErrorStudyReport(CasesReport):
    """Report on a campaign of errors."""

    campaign: ErrorCampaign

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
        drawn = ", impulses and white noise" if campaign.scenario.noisy else " and impulses"
        return (
            campaign.scenario.title,
            f"{len(campaign)} cases of the errors of {craft}, seed {campaign.seed}",
            f"Flown as planned, 0.0 s to {results[-1].end if results else 0.0:.1f} s: "
            f"states at the start, burns{drawn} are drawn",
        )

    @property
    def verdict(self) -> str:
        """The last line: no case has a conflict, or the reason why not."""
        return (
            self.campaign.reason
            or f"all {len(self.campaign)} cases {' and '.join(MET[kind] for kind in self.campaign.counts)}"
        )

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
        for title, found in self.groups:
            most = np.argsort(-found.inside, kind="stable")[:MOST_ROWS].tolist()
            some = f", the {MOST_ROWS} pairs with most of {len(found.pairs)}"
            rows = [self.row("any pair", found.any, found.any_began, found.entries.sum())]
            rows += [
                self.row(" - ".join(found.pairs[k]), found.inside[k], found.began[k], found.entries[k])
                for k in most
            ]
            made.append(Table(title + some * (len(found.pairs) > MOST_ROWS), COLUMNS, rows))
        return tuple(made)

    def row(self, who: str, inside: Any, began: Any, entries: Any) -> tuple[Any, ...]:
        """Return a row of COLUMNS."""
        share = self.share(inside)
        return who, int(inside), share, share, int(began), int(entries)

    def share(self, inside: Any) -> Estimate:
        """Return the share of cases with a conflict."""
        return estimate(int(inside), len(self.campaign))

    @property
    def summary(self) -> dict[str, Any]:
        """The printed figures in full precision, for `summary.json`."""
        campaign, scenario = self.campaign, self.campaign.scenario
        return {
            **self.studied,
            "craft": list(scenario.names),
            "draws": "errors",
            "worst": worst.of_errors(campaign).records,
            "inside": {
                title: {"any pair": vars(self.share(found.any))}
                | {
                    f"{one} - {other}": vars(self.share(inside))
                    for (one, other), inside in zip(found.pairs, found.inside, strict=True)
                }
                for title, found in self.groups
            },
        }

    def chapters(self, replays: Replays) -> Sequence[Section]:
        """Return the sections of the page except the one on reproduction."""
        campaign = self.campaign
        worth = worst.of_errors(campaign)
        sure = [SHARES, *model.of_errors(True)]
        return (
            scenario_summary.section(campaign.scenario),
            Section("What was found", self.hint, self.tables),
            *worst.section(campaign, replays, worth),
            Section("Limits of the model", tables=(model.certain(sure),)),
        )
