"""Reports of studies: their common parts, and the study of searches."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import degrees
from pathlib import Path
from typing import Any

from closeform.campaign import Campaign, GatherCampaign, LockCampaign, Share
from closeform.campaign.cases import Statistics
from closeform.campaign.search_cases import LATER
from closeform.campaign.spread import QUANTILES, Spread
from closeform.confidence import Estimate, estimate
from closeform.mission.verdict import MET, NOT_MET
from closeform.report import page, run
from closeform.report.description import Column, Section, Table
from closeform.report.page import Head, Repeat, quoted
from closeform.report.picture import Picture, Progress
from closeform.report.sections import model, searches
from closeform.search.gathering.result import listed
from closeform.search.lock_statistics import TimeHistogram, phase_labels
from closeform.search.schedule import Search
from closeform.storage.result_folder import Folder

Replays = Sequence[tuple[str, str, str]]  # pages of cases: file, contents, reason to look at it

SHARES = "Shares of cases", "estimated from all cases drawn, failed ones included; 95 % intervals (Wilson)"
SPREAD = tuple(map(Column, ("mean", "median", "95 %", "99.9 %", "greatest", "in case")))
AS_RUN = Column("the same as a run", "command", words=True, absent="")
PAGES = (
    Column("in motion", "file", words=True, links=True),
    Column("content", "what", words=True),
    Column("reason", "why", words=True),
    AS_RUN,
)
GREATEST = (
    Column("of", "what", words=True),
    Column("", "value", "{:.4f}".format),
    Column("case", "case"),
    Column("in motion", "file", words=True, links=True, absent=""),
    AS_RUN,
)


class CasesReport(ABC):
    """Report on the cases of a `campaign` of any kind."""

    campaign: Statistics

    @property
    @abstractmethod
    def opening(self) -> tuple[str, ...]:
        """The title, and a description of the cases."""

    @property
    @abstractmethod
    def hint(self) -> tuple[str, ...]:
        """The command that shows a case."""

    @property
    @abstractmethod
    def tables(self) -> tuple[Table, ...]:
        """The results."""

    @property
    @abstractmethod
    def verdict(self) -> str:
        """The last line: all requirements are met, or the reason why not."""

    @property
    @abstractmethod
    def figures(self) -> dict[str, Any]:
        """The printed figures in full precision, for `summary.json`."""

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The pictures of the results."""
        return ()

    @property
    def sure(self) -> Sequence[tuple[str, str]]:
        """Further rows on certified and estimated figures."""
        return ()

    @property
    def requested(self) -> tuple[Table, ...]:
        """Further tables of the request."""
        return draw_table(self.campaign)

    def notable(self, replays: Replays) -> tuple[Table, ...]:
        """Return further tables of notable cases."""
        return ()

    def chapters(self, replays: Replays) -> Iterator[Section]:
        """Yield the sections of the page except the one on reproduction."""
        request = run.request(self.campaign.scenario)
        yield replace(request, tables=(*request.tables, *self.requested))
        yield Section("Results", self.hint, self.tables, pictures=self.pictures)
        rows = [(page, what, why, self.command(what)) for page, what, why in replays]
        found = tuple(one for one in (Table("", PAGES, rows), *self.notable(replays)) if one.rows)
        if found:
            yield Section("Notable cases", tables=found)
        yield Section("Limits of the model", tables=(model.certain([SHARES, *self.sure]),))

    def run_of(self, case: int, which: str) -> tuple[str, ...]:
        """Return the command that shows a case, described by `which`; empty if the file gives other cases."""
        line = f"closeform run {quoted(self.campaign.scenario.file)} --case {case} shows {which}"
        return (line,) if self.campaign.as_in_file else ()

    def command(self, what: str) -> str | None:
        """Return the command that runs a case; None if the file has other cases, or `what` is not one."""
        kind, _, number = what.partition(" ")
        if kind != "case" or not self.campaign.as_in_file:
            return None
        return f"closeform run {quoted(Path(self.campaign.scenario.file).name)} --case {number}"

    @property
    def summary(self) -> dict[str, Any]:
        """The inputs, the outcome and the figures of the study."""
        campaign = self.campaign
        return {
            "kind": "study",
            "title": campaign.title,
            "inputs": page.inputs(campaign.scenario),
            "seed": campaign.seed,
            "cases": len(campaign),
            "status": MET if campaign.ok else NOT_MET,
            "verdict": self.verdict,
            "craft": list(campaign.scenario.names),
            "draws": draws(campaign),
            **self.figures,
        }

    def repeat(self, out: Path | None) -> Repeat:
        """Return the command that reproduces the study; `out` is the option for the folder."""
        campaign, study = self.campaign, self.campaign.scenario.study
        options = ""
        if study is not None and study.cases != len(campaign):
            options += f" --cases {len(campaign)}"
        if study is None or study.seed != campaign.seed:
            options += f" --seed {campaign.seed}"
        return Repeat.of(campaign.scenario, "study", options, out, campaign.seed)

    def write(
        self,
        folder: Folder,
        replays: Replays = (),
        pages: page.Pages = page.nothing,
        out: Path | None = None,
        progress: Progress = lambda text: None,
    ) -> None:
        """Fill a result folder with the files of a study; `pages` writes the pages of `replays`.

        `out` is the option for the folder; `progress` is called with a description of the current step.
        """
        folder.scenario(self.campaign.scenario)
        title, *lines = self.opening
        head = Head(title, lines, self.verdict, self.campaign.ok)
        chapters, repeat = list(self.chapters(replays)), self.repeat(out)
        page.write(folder, head, chapters, repeat, self.summary, progress, pages=pages)


def percent(heading: str) -> tuple[Column, Column]:
    """Return two columns for estimates: the share and its confidence interval."""

    def interval(share: Estimate) -> str:
        return f"{100.0 * share.low:.3f} to {100.0 * share.high:.3f}"

    return (
        Column(heading, form=lambda share: f"{100.0 * share.share:.3f}", absent=""),
        Column("95 % interval", form=interval, absent=""),
    )


def spread(found: Spread) -> dict[str, Any]:
    """Return the mean, the quantiles with their intervals, and the maximum with its case."""
    greatest, case = found.worst[0]
    return quantiles(found) | {"greatest": greatest, "case": case, "worst": found.worst}


def quantiles(found: Spread) -> dict[str, Any]:
    """Return the mean, and the quantiles with their intervals."""
    middle = {f"quantile_{share:g}": one.value for share, one in found.quantiles.items()}
    ends = {f"quantile_{share:g}_95": one[1:] for share, one in found.quantiles.items()}
    return {"mean": found.mean, **middle, **ends}


def spread_table(
    title: str, heading: str, spreads: Mapping[str, Spread], digits: int = 4
) -> tuple[Table, ...]:
    """Return the table of mean, quantiles and maximum of each spread; times have two decimals."""
    rows = [spread_row(name, one, 2 if name.startswith("time") else 4) for name, one in spreads.items()]
    fewest = min((one.count for one in spreads.values()), default=0)
    columns = resolved((Column(heading, words=True), *SPREAD), fewest)
    return (Table(title, columns, rows),) if rows else ()


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


def draws(campaign: Statistics) -> Any:
    """Return the distributions of the study by scenario key, as written in the file; or its `draws`."""
    study = campaign.scenario.study
    if study is not None and study.draws == "errors":
        return study.draws
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
    if study.draws == "errors":
        return []
    fixed = {key: draw for key, draw in draws(campaign).items() if not any(key in one for one in study.sweep)}
    lines = [f"Drawn: {key}, {' '.join(sized(draw))}" for key, draw in fixed.items()]
    if study.draws == "replanned":
        noise = " and process noise" * campaign.scenario.noisy
        lines.append(f"Drawn: initial states, execution errors{noise}; each stage is planned from the result")
    return lines


def sized(draw: dict[str, Any]) -> tuple[str, str]:
    """Return the name of a distribution, and its size, sizes or values as text."""
    ((name, size),) = draw.items()
    if not isinstance(size, tuple):
        return name, str(size)
    return name, (" to " if name == "shell" else ", ").join(map(str, size))


@dataclass(frozen=True, eq=False)
class StudyReport(CasesReport):
    """Report of a campaign of searches."""

    campaign: Campaign

    @cached_property
    def search(self) -> Search:
        """The search of one case, for a gathering that of one round."""
        if isinstance(self.campaign, LockCampaign):
            return self.campaign.search
        stage: Any
        (stage,) = self.campaign.scenario.stages
        return searches.one_round(self.campaign.search, stage.rounds)

    @property
    def opening(self) -> tuple[str, ...]:
        """The title, the number of cases, and the search."""
        campaign, one = self.campaign, self.search
        craft, limit = len(campaign.scenario.craft), degrees(one.sun_limit)
        lines = [
            campaign.scenario.title,
            f"{len(campaign)} cases of {craft} craft in deep space, seed {campaign.seed}",
            f"Search: {len(one.phases)} phases, {one.duration:.1f} s, tips {degrees(one.tip_angle):.3f} deg; "
            f"body x at most {degrees(one.sun_angle):.3f} deg off the sun, limit {limit:g} deg",
        ]
        if source := self.published.get("source"):
            lines.append(f"Published: {source}")
        return tuple(lines)

    @property
    def published(self) -> dict[str, str]:
        """The published values by row of the table of shares."""
        study = self.campaign.scenario.study
        return study.published if study is not None else {}

    @property
    def verdict(self) -> str:
        """The last line: all requirements are met in every case, or the reason why not."""
        labels = [self.campaign.requirement_label(what) for what in self.campaign.tally.met]
        return self.campaign.reason or f"all {len(self.campaign)} cases {listed(labels)}"

    @property
    def hint(self) -> tuple[str, ...]:
        """The command that shows the first case in which a requirement is not met; empty if there is none."""
        campaign = self.campaign
        return () if campaign.ok else self.run_of(campaign.tally.good.unmet[0], "the first of them")

    @property
    def shown(self) -> list[Share]:
        """The shares up to the last phase with cases, and the share at the end."""
        shares = self.campaign.shares
        kept = [k for k, share in enumerate(shares[:-1]) if share.cases or share.label in self.published]
        return [*shares[: max(kept, default=0) + 1], shares[-1]]

    @property
    def met(self) -> Iterator[tuple[str, int, Estimate]]:
        """Each requirement with the count and share of cases that meet it; the last row covers all."""
        tally = self.campaign.tally
        every = {self.campaign.requirement_label(what): met for what, met in tally.met.items()}
        for what, met in {**every, "all requirements": tally.good}.items():
            yield what, met.count, estimate(met.count, len(self.campaign))

    @cached_property
    def tables(self) -> tuple[Table, ...]:
        """Shares by phase, requirements met, times, costs, and the tables of the kind of search."""
        campaign = self.campaign
        done = Column(campaign.done, words=True)
        rows: list[tuple[Any, ...]] = [
            (one.label, one.cases, one.inside, one.inside, one.by_end, one.by_end)
            + (self.published.get(one.label, ""),)
            for one in self.shown
        ]
        columns: tuple[Column, ...] = (
            done,
            Column("cases"),
            *percent("in phase [%]"),
            *percent("by end [%]"),
        )
        published = Column("published" if self.published else None)
        tables = [Table("Cases by phase", (*columns, published), rows)]
        if len(campaign.tally.met) > 1:
            columns = Column("requirement", words=True), Column("cases"), *percent("met in [%]")
            tables.append(Table("Requirements", columns, [(*row, row[2]) for row in self.met]))
        tables += spread_table("Time and delta-v", campaign.done, campaign.spreads)
        tables += spread_table("By cause and phase", "delta-v of all craft [m/s]", campaign.costs)
        if ways := self.by_detection:
            keep = {share.label for share in self.shown}
            rows = [
                (name, *(way[name] for way in ways.values()))
                for name in ways["exact"]
                if name in keep or any(way[name] for way in ways.values())
            ]
            title = "The same cases with detection at samples only"
            tables.append(Table(title, (done, *map(Column, ways)), rows))
        if met := self.violations:
            columns = (
                Column("two craft in conflict", words=True),
                *percent("cases [%]"),
                Column("pairs in all"),
            )
            rows = [(name, share, share, pairs) for name, (share, pairs) in met.items()]
            tables.append(Table("Keep-out zone", columns, rows))
        return tuple(tables)

    @cached_property
    def by_detection(self) -> dict[str, dict[str, int]]:
        """The cases by phase, and the missed first locks, by detection method; empty for a single one."""
        campaign = self.campaign
        if not isinstance(campaign, LockCampaign) or not campaign.kind.steps:
            return {}
        names, over = phase_labels(campaign.search), "stepped over"
        found = {"exact": {share.label: share.cases for share in campaign.shares} | {over: 0}}
        for step in campaign.kind.steps:
            phases, skipped = campaign.detected(step)
            found[f"every {step:g} s"] = dict(zip(names, phases, strict=True)) | {over: skipped}
        return found

    @cached_property
    def violations(self) -> dict[str, tuple[Estimate, int]]:
        """The share of gatherings with conflicts, and the pairs, by whether the two craft shared a set."""
        campaign = self.campaign
        if not isinstance(campaign, GatherCampaign) or not campaign.scenario.zones.pairs:
            return {}
        words = {"met_unknown": "before they shared a set", "met_known": "only after"}
        counts = {name: campaign.conflicts(key) for key, name in words.items()}
        return {name: (estimate(cases, len(campaign)), pairs) for name, (cases, pairs) in counts.items()}

    @property
    def figures(self) -> dict[str, Any]:
        """The printed figures in full precision, for `summary.json`."""
        campaign = self.campaign
        met = {name: vars(share) | {"pairs": pairs} for name, (share, pairs) in self.violations.items()}
        return {
            "failed": campaign.never,
            "asked": {what: {"cases": count, **vars(share)} for what, count, share in self.met},
            "stage": campaign.scenario.stages[0].verb,
            "search": searches.search_figures(self.search),
            "shares": [
                {
                    "phase": share.label,
                    "cases": share.cases,
                    "inside": vars(share.inside),
                    "by_end": vars(share.by_end) if share.by_end is not None else None,
                    "published": self.published.get(share.label),
                }
                for share in campaign.shares
            ],
            "published": self.published.get("source"),
            "spreads": {name: spread(one) for name, one in campaign.spreads.items()},
            "costs": {name: spread(one) for name, one in campaign.costs.items()},
            **({"detection": self.by_detection} if self.by_detection else {}),
            **({"met": met} if met else {}),
        }

    @property
    def sure(self) -> Sequence[tuple[str, str]]:
        """The certainty of locks."""
        return (model.LOCKS,)

    @property
    def times(self) -> TimeHistogram:
        """The histogram of the times at which cases were done."""
        campaign = self.campaign
        return TimeHistogram.of(campaign.times, campaign.search.duration, campaign.search)

    @property
    def requested(self) -> tuple[Table, ...]:
        """The facts of the search, and the distributions of the study."""
        return searches.facts(self.search, self.campaign.search.duration), *draw_table(self.campaign)

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The histogram of times."""
        campaign = self.campaign
        what = {"what": "pairs lock" if isinstance(campaign, LockCampaign) else "formations gather"}
        caption = f"Time at which cases were {campaign.done}"
        return (Picture("histogram", caption, "studies.binned", (self.times, campaign.search), what),)

    def notable(self, replays: Replays) -> tuple[Table, ...]:
        """Return the ten cases with the longest times and highest costs, with links to their pages."""
        pages = {what: file for file, what, _ in replays}
        rows = [
            (name, value, case, pages.get(f"case {case}"), self.command(f"case {case}"))
            for name, found in self.campaign.spreads.items()
            if name != LATER  # the same cases
            for value, case in found.worst
        ]
        return (Table("The ten largest", GREATEST, rows),)
