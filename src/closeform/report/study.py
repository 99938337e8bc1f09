"""Report of a study of searches: shares of cases by phase, times and delta-v, with their intervals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import degrees
from typing import Any

from closeform.campaign import Campaign
from closeform.campaign.cases import Statistics
from closeform.campaign.spread import QUANTILES, Spread
from closeform.confidence import Estimate, estimate
from closeform.report import model, scenario_summary, search, worst
from closeform.report.cases import SHARES, SUBJECTS, Subject, percent, published, shown
from closeform.report.cases_report import CasesReport, Replays
from closeform.report.picture import Picture
from closeform.report.section import Section
from closeform.report.table import Column, Table
from closeform.search.gather_result import listed
from closeform.search.histogram import Binned

SPREAD = tuple(map(Column, ("mean", "median", "95 %", "99.9 %", "greatest", "in case")))


@dataclass(frozen=True, eq=False)
class StudyReport(CasesReport):
    """Report of a campaign of searches."""

    campaign: Campaign

    @cached_property
    def subject(self) -> Subject:
        """The content specific to the kind of search."""
        return SUBJECTS[type(self.campaign)](self.campaign)

    @property
    def opening(self) -> tuple[str, ...]:
        """The title, the number of cases, and the search."""
        campaign, one = self.campaign, self.subject.search
        craft, limit = len(campaign.scenario.craft), degrees(one.sun_limit)
        lines = [
            campaign.scenario.title,
            f"{len(campaign)} cases of {craft} craft in deep space, seed {campaign.seed}",
            f"Search: {len(one.phases)} phases, {one.duration:.1f} s, tips {degrees(one.tip_angle):.3f} deg; "
            f"body x at most {degrees(one.sun_angle):.3f} deg off the sun, limit {limit:g} deg",
        ]
        if source := published(campaign).get("source"):
            lines.append(f"Published: {source}")
        return tuple(lines)

    @property
    def verdict(self) -> str:
        """The last line: all requirements are met in every case, or the reason why not."""
        return self.campaign.reason or f"all {len(self.campaign)} cases {listed(self.asked)}"

    @property
    def asked(self) -> list[str]:
        """The requirements in words."""
        return [self.campaign.requirement_label(what) for what in self.campaign.tally.met]

    @property
    def hint(self) -> tuple[str, ...]:
        """The command that shows the first case in which a requirement is not met; empty if there is none."""
        campaign = self.campaign
        return () if campaign.ok else self.run_of(campaign.tally.good.unmet[0], "the first of them")

    @cached_property
    def tables(self) -> tuple[Table, ...]:
        """Shares by phase, requirements met, times, costs, and the tables of the kind of search."""
        campaign = self.campaign
        spreads = spread_table(campaign)
        costs = cost_table(campaign)
        return (share_table(campaign), *met_table(campaign), *spreads, *costs, *self.subject.tables)

    @property
    def summary(self) -> dict[str, Any]:
        """The printed figures in full precision, for `summary.json`."""
        campaign, scenario = self.campaign, self.campaign.scenario
        return {
            **self.studied,
            "failed": campaign.never,
            "asked": {what: {"cases": count, **vars(share)} for what, count, share in wanted(campaign)},
            "craft": list(scenario.names),
            "stage": scenario.stages[0].verb,
            "draws": draws(campaign),
            "search": search.figures(self.subject.search),
            "shares": [
                {
                    "phase": share.label,
                    "cases": share.cases,
                    "inside": vars(share.inside),
                    "by_end": vars(share.by_end) if share.by_end is not None else None,
                    "published": published(campaign).get(share.label),
                }
                for share in campaign.shares
            ],
            "published": published(campaign).get("source"),
            "spreads": {name: spread(one) for name, one in campaign.spreads.items()},
            "costs": {name: spread(one) for name, one in campaign.costs.items()},
            **self.subject.figures,
        }

    @property
    def times(self) -> Binned:
        """The histogram of the times at which cases were done."""
        campaign = self.campaign
        return Binned.of(campaign.times, campaign.search.duration, campaign.search)

    def chapters(self, replays: Replays) -> tuple[Section, ...]:
        """Return the sections of the page except the one on reproduction."""
        campaign, what = self.campaign, self.subject.what
        scenario = campaign.scenario
        whole = search.facts(self.subject.search, campaign.search.duration)
        request = scenario_summary.section(scenario)
        caption = f"When cases were {campaign.done}"
        picture = Picture(
            "histogram", caption, "lockings.binned", (self.times, campaign.search), {"what": what}
        )
        return (
            replace(request, tables=(*request.tables, whole, *draw_table(campaign))),
            Section("What was found", self.hint, self.tables, pictures=(picture,)),
            *worst.section(campaign, replays, worst.greatest(campaign, replays)),
            Section("Limits of the model", tables=(model.certain([SHARES, model.LOCKS]),)),
        )


def share_table(campaign: Campaign) -> Table:
    """Return the shares by phase, without the phases after the last one in which something happened."""
    theirs = published(campaign)
    columns = (
        Column(campaign.done, words=True),
        Column("cases"),
        *percent("in it [%]"),
        *percent("by end [%]"),
    )
    rows: list[tuple[Any, ...]] = [
        (share.label, share.cases, share.inside, share.inside, share.by_end, share.by_end)
        for share in shown(campaign)
    ]
    if not theirs:
        return Table("Cases by phase", columns, rows)
    rows = [(*row, theirs.get(row[0], "")) for row in rows]
    return Table("Cases by phase", (*columns, Column("published")), rows)


def wanted(campaign: Campaign) -> Iterator[tuple[str, int, Estimate]]:
    """Yield each requirement with the count and share of cases that meet it; the last row covers all."""
    tally = campaign.tally
    told = {campaign.requirement_label(what): met for what, met in tally.met.items()}
    for what, met in {**told, "all of it": tally.good}.items():
        yield what, met.count, estimate(met.count, len(campaign))


def met_table(campaign: Campaign) -> tuple[Table, ...]:
    """Return the table of requirements and the cases that meet them; empty for a single requirement."""
    if len(campaign.tally.met) == 1:
        return ()
    columns = Column("what was asked", words=True), Column("cases"), *percent("met in [%]")
    return (Table("What is met", columns, [(*row, row[2]) for row in wanted(campaign)]),)


def spread(found: Spread) -> dict[str, Any]:
    """Return the mean, the quantiles with their intervals, and the maximum with its case."""
    greatest, case = found.worst[0]
    return quantiles(found) | {"greatest": greatest, "case": case, "worst": found.worst}


def quantiles(found: Spread) -> dict[str, Any]:
    """Return the mean, and the quantiles with their intervals."""
    middle = {f"quantile_{share:g}": one.value for share, one in found.quantiles.items()}
    ends = {f"quantile_{share:g}_95": one[1:] for share, one in found.quantiles.items()}
    return {"mean": found.mean, **middle, **ends}


def spread_table(campaign: Campaign) -> tuple[Table, ...]:
    """Return the table of mean, quantiles and maximum of the times and of the delta-v."""
    spreads = campaign.spreads.items()
    rows = [spread_row(name, found, 2 if name.startswith("time") else 4) for name, found in spreads]
    columns = resolved((Column(campaign.done, words=True), *SPREAD), fewest(campaign.spreads))
    return (Table("How long", columns, rows),) if rows else ()


def fewest(spreads: Mapping[str, Spread]) -> int:
    """Return the smallest number of cases among the spreads, 0 without any."""
    return min((one.count for one in spreads.values()), default=0)


def cost_table(campaign: Campaign) -> tuple[Table, ...]:
    """Return the spread of the delta-v by cause and by the phase in which cases were done."""
    rows = [spread_row(name, found, 4) for name, found in campaign.costs.items()]
    columns = resolved((Column("delta-v of all craft [m/s]", words=True), *SPREAD), fewest(campaign.costs))
    return (Table("By cause and phase", columns, rows),) if rows else ()


def resolved(
    columns: Sequence[Column], count: int, shares: Sequence[float] = QUANTILES
) -> tuple[Column, ...]:
    """Return the columns of a spread of `count` cases; a quantile is hidden if no case lies beyond it.

    The quantiles of `shares` follow the column "median", in their order.
    """
    first = next(k for k, column in enumerate(columns) if column.heading == "median")
    hidden = {first + k for k, share in enumerate(shares) if count * min(share, 1.0 - share) < 1.0}
    return tuple(replace(one, heading=None) if k in hidden else one for k, one in enumerate(columns))


def spread_row(name: str, found: Spread, digits: int, scale: float = 1.0) -> tuple[Any, ...]:
    """Return a table row: the name and the values of SPREAD, times `scale`, with `digits` decimals."""
    greatest, case = found.worst[0]
    numbers = found.mean, *(one.value for one in found.quantiles.values()), greatest
    return name, *(f"{scale * one:.{digits}f}" for one in numbers), case


def draws(campaign: Statistics) -> dict[str, Any]:
    """Return the distributions of the study, by scenario key, as written in the file."""
    study = campaign.scenario.study
    vary = study.vary if study is not None else {}
    return {key: draw.model_dump(exclude_none=True) for key, draw in vary.items()}


def draw_table(campaign: Statistics) -> tuple[Table, ...]:
    """Return the distributions of the study as a table."""
    rows = [(key, *sized(draw)) for key, draw in draws(campaign).items()]
    columns = Column("key", words=True), Column("distribution"), Column("size")
    return (Table("Drawn for each case and craft", columns, rows),) if rows else ()


def draw_lines(campaign: Statistics) -> list[str]:
    """Return the distributions of the study as lines, without the keys of a sweep."""
    study = campaign.scenario.study
    assert study is not None
    fixed = {key: draw for key, draw in draws(campaign).items() if not any(key in one for one in study.sweep)}
    lines = [f"Drawn: {key}, {' '.join(sized(draw))}" for key, draw in fixed.items()]
    if study.draws == "replanned":
        lines.append(
            f"Drawn: errors of states at the start and of burns{', white noise' * campaign.scenario.noisy}; "
            "stages are planned from where they lead"
        )
    return lines


def sized(draw: dict[str, Any]) -> tuple[str, str]:
    """Return the name of a distribution, and its size, sizes or values as text."""
    ((name, size),) = draw.items()
    if not isinstance(size, tuple):
        return name, str(size)
    return name, (" to " if name == "shell" else ", ").join(map(str, size))
