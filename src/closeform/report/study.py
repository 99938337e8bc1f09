"""Reports of studies: their common parts, and the study of searches."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees
from pathlib import Path
from typing import Any

from closeform.campaign import Campaign, GatherCampaign, LockCampaign
from closeform.campaign.cases import Statistics
from closeform.campaign.search_cases import LATER
from closeform.campaign.spread import QUANTILES, Spread
from closeform.confidence import Estimate, estimate
from closeform.mission.verdict import MET, NOT_MET
from closeform.report import page, run
from closeform.report.description import Column, Section, Table
from closeform.report.page import Head, Repeat, quoted
from closeform.report.picture import Picture, Progress
from closeform.report.sections import model_limits, searches
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


@dataclass(frozen=True, eq=False)
class StudyReport:
    """Report on the cases of a `campaign`: what the terminal, the page and `summary.json` show of it.

    - `opening`: the title, and lines on the cases.
    - `verdict`: the last line: all requirements are met, or the reason why not.
    - `hint`: the command that shows a case; empty if the file gives other cases.
    - `tables`, `pictures`: the results; `figures`: the same in full precision, for `summary.json`.
    - `requested`: further tables of the request; `sure`: further rows on certified and estimated figures.
    - `notable`: the tables of notable cases, with links to their pages.
    """

    campaign: Statistics
    opening: tuple[str, ...]
    verdict: str
    hint: tuple[str, ...]
    tables: tuple[Table, ...]
    figures: dict[str, Any]
    pictures: tuple[Picture, ...] = ()
    requested: tuple[Table, ...] = ()
    sure: Sequence[tuple[str, str]] = ()
    notable: Callable[[Replays], tuple[Table, ...]] = lambda replays: ()
    printed_warnings = ()
    wraps = False  # whether a long verdict is broken into lines

    @property
    def printed(self) -> tuple[Section, ...]:
        """Sections that the terminal shows, with the values that were sampled for the cases."""
        tables = tuple(replace(one, folded=False) for one in self.tables)
        return (Section("", (*self.opening, *draw_lines(self.campaign)), tables),)

    def chapters(self, replays: Replays) -> Iterator[Section]:
        """Yield the sections of the page except the one on reproduction."""
        request = run.request(self.campaign.scenario)
        yield replace(request, tables=(*request.tables, *self.requested))
        yield Section("Results", self.hint, self.tables, pictures=self.pictures)
        rows = [(page, what, why, command(self.campaign, what)) for page, what, why in replays]
        found = tuple(one for one in (Table("", PAGES, rows), *self.notable(replays)) if one.rows)
        if found:
            yield Section("Notable cases", tables=found)
        yield Section("Limits of the model", tables=(model_limits.certain([SHARES, *self.sure]),))

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


def shows(campaign: Statistics, case: int, which: str) -> tuple[str, ...]:
    """Return the command that shows a case, described by `which`; empty if the file gives other cases."""
    line = f"closeform run {quoted(campaign.scenario.file)} --case {case} shows {which}"
    return (line,) if campaign.as_in_file else ()


def command(campaign: Statistics, what: str) -> str | None:
    """Return the command that runs a case; None if the file has other cases, or `what` is not one."""
    kind, _, number = what.partition(" ")
    if kind != "case" or not campaign.as_in_file:
        return None
    return f"closeform run {quoted(Path(campaign.scenario.file).name)} --case {number}"


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


def spread_table(title: str, heading: str, spreads: Mapping[str, Spread]) -> tuple[Table, ...]:
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


def searches_report(campaign: Campaign) -> StudyReport:
    """Return the report of a campaign of searches."""
    scenario, search, tally = campaign.scenario, search_of(campaign), campaign.tally
    study, never = scenario.study, campaign.never
    published = study.published if study is not None else {}
    tip, sun, limit = map(degrees, (search.tip_angle, search.sun_angle, search.sun_limit))
    lines = [
        scenario.title,
        f"{len(campaign)} cases of {len(scenario.craft)} craft in deep space, seed {campaign.seed}",
        f"Search: {len(search.phases)} phases, {search.duration:.1f} s, tips {tip:.3f} deg; "
        f"body x at most {sun:.3f} deg off the sun, limit {limit:g} deg",
    ]
    if source := published.get("source"):
        lines.append(f"Published: {source}")
    labels = {what: campaign.requirement_label(what) for what in tally.met}
    every = {**{labels[what]: met for what, met in tally.met.items()}, "all requirements": tally.good}
    met = [(what, one.count, estimate(one.count, len(campaign))) for what, one in every.items()]
    detection, violations = by_detection(campaign), violated(campaign)
    violation_figures = {name: vars(share) | {"pairs": pairs} for name, (share, pairs) in violations.items()}
    times = TimeHistogram.of(campaign.times, campaign.search.duration, campaign.search)
    what = {"what": "pairs lock" if isinstance(campaign, LockCampaign) else "formations gather"}
    caption = f"Time at which cases were {campaign.done}"

    def notable(replays: Replays) -> tuple[Table, ...]:
        """Return the ten cases with the longest times and highest costs, with links to their pages."""
        pages = {what: file for file, what, _ in replays}
        rows = [
            (name, value, case, pages.get(f"case {case}"), command(campaign, f"case {case}"))
            for name, found in campaign.spreads.items()
            if name != LATER  # the same cases
            for value, case in found.worst
        ]
        return (Table("The ten largest", GREATEST, rows),)

    return StudyReport(
        campaign,
        tuple(lines),
        campaign.reason or f"all {len(campaign)} cases {listed(list(labels.values()))}",
        () if campaign.ok else shows(campaign, tally.good.unmet[0], "the first of them"),
        tuple(search_tables(campaign, published, met, detection, violations)),
        {
            "failed": never,
            "asked": {name: {"cases": count, **vars(share)} for name, count, share in met},
            "stage": scenario.stages[0].verb,
            "search": searches.search_figures(search),
            "shares": [
                {
                    "phase": share.label,
                    "cases": share.cases,
                    "inside": vars(share.inside),
                    "by_end": vars(share.by_end) if share.by_end is not None else None,
                    "published": published.get(share.label),
                }
                for share in campaign.shares
            ],
            "published": published.get("source"),
            "spreads": {name: spread(one) for name, one in campaign.spreads.items()},
            "costs": {name: spread(one) for name, one in campaign.costs.items()},
            **({"detection": detection} if detection else {}),
            **({"met": violation_figures} if violations else {}),
        },
        (Picture("histogram", caption, "studies.binned", (times, campaign.search), what),),
        (searches.facts(search, campaign.search.duration), *draw_table(campaign)),
        (model_limits.LOCKS,),
        notable,
    )


def search_of(campaign: Campaign) -> Search:
    """Return the search of one case, for a gathering that of one round."""
    if isinstance(campaign, LockCampaign):
        return campaign.search
    stage: Any
    (stage,) = campaign.scenario.stages
    return searches.one_round(campaign.search, stage.rounds)


def search_tables(
    campaign: Campaign,
    published: Mapping[str, str],
    met: Sequence[tuple[str, int, Estimate]],
    detection: Mapping[str, Mapping[str, int]],
    violations: Mapping[str, tuple[Estimate, int]],
) -> Iterator[Table]:
    """Yield shares by phase, requirements met, times, costs, and the tables of the kind of search."""
    shares, done = campaign.shares, Column(campaign.done, words=True)
    last = max((k for k, one in enumerate(shares[:-1]) if one.cases or one.label in published), default=0)
    shown = [*shares[: last + 1], shares[-1]]  # up to the last phase with cases, and at the end
    columns: tuple[Column, ...] = (
        *(done, Column("cases"), *percent("in phase [%]"), *percent("by end [%]")),
        Column("published" if published else None),
    )
    rows: list[tuple[Any, ...]] = [
        (one.label, one.cases, one.inside, one.inside, one.by_end, one.by_end, published.get(one.label, ""))
        for one in shown
    ]
    yield Table("Cases by phase", columns, rows)
    if len(campaign.tally.met) > 1:
        columns = Column("requirement", words=True), Column("cases"), *percent("met in [%]")
        yield Table("Requirements", columns, [(*row, row[2]) for row in met])
    yield from spread_table("Time and delta-v", campaign.done, campaign.spreads)
    yield from spread_table("By cause and phase", "delta-v of all craft [m/s]", campaign.costs)
    if detection:
        keep = {share.label for share in shown}
        rows = [
            (name, *(way[name] for way in detection.values()))
            for name in detection["exact"]
            if name in keep or any(way[name] for way in detection.values())
        ]
        yield Table("The same cases with detection at samples only", (done, *map(Column, detection)), rows)
    if violations:
        columns = Column("two craft in conflict", words=True), *percent("cases [%]"), Column("pairs in all")
        rows = [(name, share, share, pairs) for name, (share, pairs) in violations.items()]
        yield Table("Keep-out zone", columns, rows)


def by_detection(campaign: Campaign) -> dict[str, dict[str, int]]:
    """Return the cases by phase, and the missed first locks, by detection method; empty for a single one."""
    if not isinstance(campaign, LockCampaign) or not campaign.kind.steps:
        return {}
    names, over = phase_labels(campaign.search), "stepped over"
    found = {"exact": {share.label: share.cases for share in campaign.shares} | {over: 0}}
    for step in campaign.kind.steps:
        phases, skipped = campaign.detected(step)
        found[f"every {step:g} s"] = dict(zip(names, phases, strict=True)) | {over: skipped}
    return found


def violated(campaign: Campaign) -> dict[str, tuple[Estimate, int]]:
    """Return the fraction of gatherings with conflicts, and the pairs, by whether the two shared a set."""
    if not isinstance(campaign, GatherCampaign) or not campaign.scenario.zones.pairs:
        return {}
    words = {"met_unknown": "before they shared a set", "met_known": "only after"}
    counts = {name: campaign.conflicts(key) for key, name in words.items()}
    return {name: (estimate(cases, len(campaign)), pairs) for name, (cases, pairs) in counts.items()}
