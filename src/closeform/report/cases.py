"""What a study of one kind of search has of its own: of first locks, and of gatherings."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats
from closeform.campaign import Campaign, Estimate, GatherCampaign, LockCampaign, Share, drawn
from closeform.campaign.campaign import relative
from closeform.campaign.shares import estimate
from closeform.report import repeat, search
from closeform.report.section import Section
from closeform.report.table import STATE_COLUMNS, Column, Table
from closeform.scenario import Scenario
from closeform.search.phases import labels, tally
from closeform.search.schedule import Search
from closeform.verdict import MET, NOT_MET

if TYPE_CHECKING:
    from closeform.campaign.error_cases import ErrorCampaign


Replays = Sequence[tuple[str, str, str]]  # pages of cases: file, what it shows, why it is worth looking at

SHARES = (
    "Shares of cases",
    "estimated from the cases drawn, failed ones among them: each with its own interval of 95 % "
    "(Clopper and Pearson)",
)


def interval(share: Estimate) -> str:
    """The confidence interval of a share in per cent."""
    return f"{100.0 * share.low:.3f} to {100.0 * share.high:.3f}"


def percent(heading: str) -> tuple[Column, Column]:
    """Two columns of estimates: the share, and its interval."""
    return (
        Column(heading, form=lambda share: f"{100.0 * share.share:.3f}", absent=""),
        Column("95 % interval", form=interval, absent=""),
    )


def studied(campaign: "Campaign | ErrorCampaign", verdict: str) -> dict[str, Any]:
    """What was studied, and what it has come to."""
    scenario = campaign.scenario
    return {
        "kind": "study",
        "title": scenario.title,
        "inputs": digests(scenario),
        "seed": campaign.seed,
        "cases": len(campaign),
        "status": MET if campaign.ok else NOT_MET,
        "verdict": verdict,
    }


def digests(scenario: Scenario) -> dict[str, str]:
    """The hashes of a scenario and of the files that it names."""
    return {name: f"sha256:{digest}" for name, digest in scenario.digests.items()}


def repeated(campaign: "Campaign | ErrorCampaign", beside: Sequence[str]) -> Section:
    """How to repeat a study."""
    scenario = campaign.scenario
    name, study = Path(scenario.file).name, scenario.study
    command = f"closeform study {name}"
    if study is not None and study.cases != len(campaign):
        command += f" --cases {len(campaign)}"
    if study is not None and study.seed != campaign.seed:
        command += f" --seed {campaign.seed}"
    return repeat.section(command, digests(scenario), beside, seed=campaign.seed)


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


def published(campaign: Campaign) -> dict[str, str]:
    """What others reported, by the rows of the table of shares."""
    return campaign.scenario.study.published if campaign.scenario.study is not None else {}


def shown(campaign: Campaign) -> list[Share]:
    """The rows of the table of shares worth showing."""
    theirs = published(campaign)
    worth = [k for k, share in enumerate(campaign.shares[:-1]) if share.cases or share.label in theirs]
    return [*campaign.shares[: max(worth, default=0) + 1], campaign.shares[-1]]


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
    if campaign.scenario.zones.pairs:
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
