"""The report of a study: what became of its cases, the same for the terminal, the page and the files."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.campaign import Campaign, Estimate, GatherCampaign, LockCampaign, Share, drawn
from closeform.campaign.campaign import relative
from closeform.campaign.shares import estimate
from closeform.report import page, search
from closeform.report.run import STATE_COLUMNS
from closeform.report.section import Picture
from closeform.report.table import Column, Table
from closeform.result_folder import REPORT, Folder
from closeform.search.gather_result import listed
from closeform.search.phases import labels, tally
from closeform.search.schedule import Search

EACH_FILE = 100_000  # cases
QUANTILES = (0.5, 0.95, 0.999)


def interval(share: Estimate) -> str:
    """The confidence interval of a share in per cent."""
    return f"{100.0 * share.low:.3f} to {100.0 * share.high:.3f}"


def percent(heading: str) -> tuple[Column, Column]:
    """Two columns of estimates: the share, and its interval."""
    return (
        Column(heading, form=lambda share: f"{100.0 * share.share:.3f}", absent=""),
        Column("95 % interval", form=interval, absent=""),
    )


@dataclass(frozen=True)
class Subject:
    """What a study of one kind of search has of its own.

    `search`: that of a case, of a gathering one round; `spreads`: what the table of times is about
    too, values (K,) and the numbers (K,) of their cases; `histogram`: times [s] and what happens then;
    `cases` makes the table of a range of cases for Parquet.
    """

    search: Search
    tables: tuple[Table, ...]
    figures: dict[str, Any]
    spreads: dict[str, tuple[Floats, Any]]
    histogram: tuple[Floats, str]
    cases: Callable[[slice], dict[str, Any]]


@dataclass(frozen=True, eq=False)
class StudyReport:
    """What there is to say of a campaign."""

    campaign: Campaign

    @cached_property
    def subject(self) -> Subject:
        """What its kind of search has of its own."""
        return SUBJECTS[type(self.campaign)](self.campaign)

    @property
    def opening(self) -> tuple[str, ...]:
        """What was flown, and what the search is."""
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
        """The last line: all cases done, or which were not."""
        return self.campaign.reason or f"all {len(self.campaign)} cases {listed(list(self.campaign.met))}"

    @property
    def hint(self) -> tuple[str, ...]:
        """How to see a case in which something is not met."""
        campaign = self.campaign
        study, name = campaign.scenario.study, campaign.scenario.file
        if campaign.ok or study is None or study.seed != campaign.seed:
            return ()
        return (f"closeform run {name} --case {np.argmin(campaign.good)} shows the first of them",)

    @cached_property
    def tables(self) -> tuple[Table, ...]:
        """Shares by phase, times, and what this kind of search has of its own."""
        campaign = self.campaign
        spreads = spread_table(campaign, self.spreads)
        return (share_table(campaign), *met_table(campaign), *spreads, *self.subject.tables)

    @cached_property
    def spreads(self) -> dict[str, tuple[Floats, Any]]:
        """What the table of times is about: values and the numbers of their cases."""
        case = np.flatnonzero(self.campaign.leg >= 0)
        time = self.campaign.time[case]
        later = time > 0.0
        found = {"time [s]": (time, case), "time, not at once [s]": (time[later], case[later])}
        return {name: values for name, values in (found | self.subject.spreads).items() if len(values[0])}

    @property
    def summary(self) -> dict[str, Any]:
        """Every figure printed, in full."""
        campaign, scenario = self.campaign, self.campaign.scenario
        return {
            "title": scenario.title,
            "inputs": {Path(scenario.file).name: f"sha256:{scenario.digest}"},
            "seed": campaign.seed,
            "cases": len(campaign),
            "status": 0 if campaign.ok else 1,
            "verdict": self.verdict,
            "failed": len(campaign.failed),
            "asked": {what: {"cases": count, **vars(share)} for what, count, share in asked(campaign)},
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
            "spreads": {name: spread(*values) for name, values in self.spreads.items()},
            **self.subject.figures,
        }


def leave(report: StudyReport, folder: Folder) -> None:
    """Fill a result folder with everything that a study leaves."""
    campaign, subject = report.campaign, report.subject
    folder.text("scenario.toml", campaign.scenario.text)
    for first in range(0, len(campaign), EACH_FILE):
        rows = slice(first, min(first + EACH_FILE, len(campaign)))
        folder.table(f"cases/{first:09d}", subject.cases(rows))
    times, what = subject.histogram
    caption = f"When cases were {campaign.done}"
    picture = Picture("histogram", caption, "histogram", (times, campaign.search), {"what": what})
    shot = picture.leave(folder, lambda text: None)
    title, *lines = report.opening
    parts = page.head(title, lines, report.verdict, campaign.ok)
    parts += map(page.paragraph, report.hint)
    parts += map(page.titled, report.tables)
    parts.append(page.embedded(shot, caption))
    whole = search.facts(campaign.search, campaign.search.duration)
    parts += map(page.titled, (whole, *draw_table(campaign)))
    folder.text(REPORT, page.document(title, parts))
    folder.summary(report.summary)


def published(campaign: Campaign) -> dict[str, str]:
    """What others reported, by the rows of the table of shares."""
    return campaign.scenario.study.published if campaign.scenario.study is not None else {}


def share_table(campaign: Campaign) -> Table:
    """Shares by phase; phases after the last in which something happened are left out."""
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


def shown(campaign: Campaign) -> list[Share]:
    """The rows of the table of shares worth showing."""
    theirs = published(campaign)
    worth = [k for k, share in enumerate(campaign.shares[:-1]) if share.cases or share.label in theirs]
    return [*campaign.shares[: max(worth, default=0) + 1], campaign.shares[-1]]


def asked(campaign: Campaign) -> Iterator[tuple[str, int, Estimate]]:
    """Of all that was asked for: what, and in how many cases it is met; last, all of it."""
    for what, met in {**campaign.met, "all of it": campaign.good}.items():
        yield what, int(met.sum()), estimate(int(met.sum()), len(campaign))


def met_table(campaign: Campaign) -> tuple[Table, ...]:
    """The same as a table, where more is asked for than to be done."""
    if not campaign.kept:
        return ()
    columns = Column("what was asked", words=True), Column("cases"), *percent("met in [%]")
    return (Table("What is met", columns, [(*row, row[2]) for row in asked(campaign)]),)


def spread(values: Floats, case: Any) -> dict[str, float]:
    """Mean, quantiles and the greatest with its case."""
    middle = dict(zip((f"quantile_{q:g}" for q in QUANTILES), np.quantile(values, QUANTILES), strict=True))
    top = int(np.argmax(values))
    found = {"mean": values.mean(), **middle, "greatest": values[top]}
    return {name: float(value) for name, value in found.items()} | {"case": int(case[top])}


def spread_table(campaign: Campaign, spreads: dict[str, tuple[Floats, Any]]) -> tuple[Table, ...]:
    """Mean, quantiles and greatest of the times, and of the delta-v."""
    rows = []
    for name, values in spreads.items():
        *numbers, case = spread(*values).values()
        digits = 2 if name.startswith("time") else 4
        rows.append((name, *(f"{number:.{digits}f}" for number in numbers), case))
    headings = "mean", "median", "95 %", "99.9 %", "greatest", "in case"
    columns = Column(campaign.done, words=True), *(Column(heading) for heading in headings)
    return (Table("How long", columns, rows),) if rows else ()


def draws(campaign: Campaign) -> dict[str, Any]:
    """What was drawn, as the file says it."""
    study = campaign.scenario.study
    vary = study.vary if study is not None else {}
    return {key: draw.model_dump(exclude_none=True) for key, draw in vary.items()}


def draw_table(campaign: Campaign) -> tuple[Table, ...]:
    """The same as a table."""
    rows = [(key, " ".join(draw), str(next(iter(draw.values())))) for key, draw in draws(campaign).items()]
    columns = Column("key", words=True), Column("distribution"), Column("size")
    return (Table("Drawn for each case and craft", columns, rows),) if rows else ()


def locks(campaign: LockCampaign) -> Subject:
    """Of first locks: what looking at fixed steps makes of the same cases; a row for each case and pair."""
    pairs, names = campaign.pairs, np.array(campaign.scenario.names)

    def cases(rows: slice) -> dict[str, Any]:
        states = drawn(campaign.scenario, campaign.seed, rows.start, rows.stop)
        count = rows.stop - rows.start
        time, leg = campaign.pair_time[rows].ravel(), campaign.pair_leg[rows].ravel()
        return {
            "case": np.repeat(np.arange(rows.start, rows.stop), len(pairs)),
            "first": np.tile(names[pairs[:, 0]], count),
            "second": np.tile(names[pairs[:, 1]], count),
            **dict(zip(STATE_COLUMNS, relative(states, pairs).reshape(-1, 6).T, strict=True)),
            **ended("time_s", campaign.search, time, leg),
            **{what: np.repeat(kept[rows], len(pairs)) for what, kept in stored(campaign)},
        }

    ways = by_detection(campaign) if campaign.sampled else {}
    return Subject(
        campaign.search,
        tables=(detection_table(campaign, ways),) if ways else (),
        figures={"detection": ways} if ways else {},
        spreads={},
        histogram=(campaign.pair_time.ravel(), "pairs lock"),
        cases=cases,
    )


def by_detection(campaign: LockCampaign) -> dict[str, dict[str, int]]:
    """Cases by phase, and those whose first lock was stepped over, for each way of detection."""
    names, over = labels(campaign.search), "stepped over"
    found = {"exact": {share.label: share.cases for share in campaign.shares} | {over: 0}}
    for one in campaign.sampled:
        late = (one.leg < 0) & (campaign.leg >= 0) | (one.time - campaign.time > one.step)
        counts = dict(zip(names, tally(campaign.search, one.time, one.leg), strict=True))
        found[f"every {one.step:g} s"] = counts | {over: int(late.sum())}
    return found


def detection_table(campaign: LockCampaign, ways: dict[str, dict[str, int]]) -> Table:
    """The same as a table, without rows in which nothing happened."""
    keep = {share.label for share in shown(campaign)}
    rows = [
        (name, *(way[name] for way in ways.values()))
        for name in ways["exact"]
        if name in keep or any(way[name] for way in ways.values())
    ]
    columns = Column(campaign.done, words=True), *(Column(way) for way in ways)
    return Table("The same cases with detection at samples only", columns, rows)


def gatherings(campaign: GatherCampaign) -> Subject:
    """Of gatherings: what they cost, and in which craft came within their keep-out zone; a row for each."""

    def cases(rows: slice) -> dict[str, Any]:
        return {
            "case": np.arange(rows.start, rows.stop),
            **ended("duration_s", campaign.search, campaign.time[rows], campaign.leg[rows]),
            "rounds": campaign.rounds[rows],
            "left": campaign.left[rows],
            "delta_v_m_s": campaign.delta_v[rows],
            "met_unknown": campaign.met_unknown[rows],
            "met_known": campaign.met_known[rows],
            **{what: kept[rows] for what, kept in stored(campaign)},
        }

    stage: Any
    (stage,) = campaign.scenario.stages
    done, met = np.flatnonzero(campaign.leg >= 0), {}
    if campaign.scenario.zones.zones:
        counts = {"before they knew each other": campaign.met_unknown, "only after": campaign.met_known}
        met = {
            name: (estimate(int((pairs > 0).sum()), len(campaign)), int(pairs.sum()))
            for name, pairs in counts.items()
        }
    columns = Column("two craft came within it", words=True), *percent("cases [%]"), Column("pairs in all")
    rows = [(name, share, share, pairs) for name, (share, pairs) in met.items()]
    figures = {name: vars(share) | {"pairs": pairs} for name, (share, pairs) in met.items()}
    return Subject(
        search.one_round(campaign.search, stage.rounds),
        tables=(Table("Keep-out zone", columns, rows),) if met else (),
        figures={"met": figures} if met else {},
        spreads={"delta-v of all craft [m/s]": (campaign.delta_v[done], done)},
        histogram=(campaign.time, "formations gather"),
        cases=cases,
    )


def stored(campaign: Campaign) -> Iterator[tuple[str, Any]]:
    """The columns of the table of cases that say what is kept."""
    for what, kept in campaign.kept.items():
        yield what if what == "clear" else f"{what.replace('-', '_')}_kept", kept


def ended(name: str, search: Search, time: Floats, leg: Any) -> dict[str, Any]:
    """Time, phase and round of what ended in a leg; null where nothing did."""
    import pyarrow

    absent = leg < 0
    phases = np.array([one.phase for one in search.legs])
    rounds = np.array([one.round for one in search.legs])
    return {
        name: pyarrow.array(time, mask=absent),
        "phase": pyarrow.array(phases[leg], mask=absent),
        "round": pyarrow.array(rounds[leg], mask=absent),
    }


SUBJECTS: dict[type[Campaign], Callable[[Any], Subject]] = {LockCampaign: locks, GatherCampaign: gatherings}
