"""Content specific to the kind of search in a study: first locks or gatherings."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from closeform.campaign import Campaign, GatherCampaign, LockCampaign, Share
from closeform.confidence import Estimate, estimate
from closeform.report import search
from closeform.report.table import Column, Table
from closeform.search.phases import labels
from closeform.search.schedule import Search

SHARES = (
    "Shares of cases",
    "estimated from the cases drawn, failed ones among them: each with its own interval of 95 % (Wilson)",
)


def interval(share: Estimate) -> str:
    """Return the confidence interval of a share in per cent."""
    return f"{100.0 * share.low:.3f} to {100.0 * share.high:.3f}"


def percent(heading: str) -> tuple[Column, Column]:
    """Return two columns for estimates: the share, and its interval."""
    return (
        Column(heading, form=lambda share: f"{100.0 * share.share:.3f}", absent=""),
        Column("95 % interval", form=interval, absent=""),
    )


@dataclass(frozen=True)
class Subject:
    """Content of a study that is specific to the kind of search.

    `search`: that of one case, for a gathering that of one round; `what`: the event in the histogram.
    """

    search: Search
    tables: tuple[Table, ...]
    figures: dict[str, Any]
    what: str


def published(campaign: Campaign) -> dict[str, str]:
    """Return published values by row of the table of shares."""
    return campaign.scenario.study.published if campaign.scenario.study is not None else {}


def shown(campaign: Campaign) -> list[Share]:
    """Return the rows of the table of shares that are worth showing."""
    theirs = published(campaign)
    worth = [k for k, share in enumerate(campaign.shares[:-1]) if share.cases or share.label in theirs]
    return [*campaign.shares[: max(worth, default=0) + 1], campaign.shares[-1]]


def locks(campaign: LockCampaign) -> Subject:
    """Return the content of a study of first locks, with results of detection at fixed steps."""
    ways = by_detection(campaign) if campaign.kind.steps else {}
    return Subject(
        campaign.search,
        tables=(detection_table(campaign, ways),) if ways else (),
        figures={"detection": ways} if ways else {},
        what="pairs lock",
    )


def by_detection(campaign: LockCampaign) -> dict[str, dict[str, int]]:
    """Return the cases by phase, and the missed first locks, for each detection method."""
    names, over = labels(campaign.search), "stepped over"
    found = {"exact": {share.label: share.cases for share in campaign.shares} | {over: 0}}
    for step in campaign.kind.steps:
        phases, skipped = campaign.detected(step)
        found[f"every {step:g} s"] = dict(zip(names, phases, strict=True)) | {over: skipped}
    return found


def detection_table(campaign: LockCampaign, ways: dict[str, dict[str, int]]) -> Table:
    """Return the cases by detection method as a table, without empty rows."""
    keep = {share.label for share in shown(campaign)}
    rows = [
        (name, *(way[name] for way in ways.values()))
        for name in ways["exact"]
        if name in keep or any(way[name] for way in ways.values())
    ]
    columns = Column(campaign.done, words=True), *(Column(way) for way in ways)
    return Table("The same cases with detection at samples only", columns, rows)


def gatherings(campaign: GatherCampaign) -> Subject:
    """Return the content of a study of gatherings: cases and pairs inside their keep-out zone."""
    stage: Any
    (stage,) = campaign.scenario.stages
    met = {}
    if campaign.scenario.zones.pairs:
        words = {"met_unknown": "before they knew each other", "met_known": "only after"}
        counts = {name: campaign.conflicts(key) for key, name in words.items()}
        met = {name: (estimate(cases, len(campaign)), pairs) for name, (cases, pairs) in counts.items()}
    columns = Column("two craft came within it", words=True), *percent("cases [%]"), Column("pairs in all")
    rows = [(name, share, share, pairs) for name, (share, pairs) in met.items()]
    figures = {name: vars(share) | {"pairs": pairs} for name, (share, pairs) in met.items()}
    return Subject(
        search.one_round(campaign.search, stage.rounds),
        tables=(Table("Keep-out zone", columns, rows),) if met else (),
        figures={"met": figures} if met else {},
        what="formations gather",
    )


SUBJECTS: dict[type[Campaign], Callable[[Any], Subject]] = {LockCampaign: locks, GatherCampaign: gatherings}
