"""A study's result folder: summary, cases, picture and one self-contained HTML page."""

from html import escape
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.campaign import Campaign, Estimate, GatherCampaign, LockCampaign, Share, drawn
from closeform.campaign.campaign import relative
from closeform.campaign.shares import estimate
from closeform.chapters import Sheet
from closeform.chapters.searches import facts, one_round
from closeform.report.page import document, embedded, table
from closeform.report.summary import search_summary
from closeform.report.tables import STATE_COLUMNS
from closeform.result_folder import REPORT, Folder
from closeform.scenario import Gather
from closeform.search.phases import labels, tally
from closeform.search.schedule import Search

EACH_FILE = 100_000  # cases
QUANTILES = (0.5, 0.95, 0.999)


def leave(campaign: Campaign, folder: Folder) -> None:
    """Fill a result folder with everything that a study leaves."""
    from closeform import plots

    folder.text("scenario.toml", campaign.scenario.text)
    (folder.path / "cases").mkdir()
    for first in range(0, len(campaign), EACH_FILE):
        rows = slice(first, min(first + EACH_FILE, len(campaign)))
        folder.table(f"cases/{first:09d}", case_table(campaign, rows))
    if isinstance(campaign, LockCampaign):
        figure = plots.histogram(campaign.pair_time.ravel(), campaign.search)
    else:
        figure = plots.histogram(campaign.time, campaign.search, what="formations gather")
    pictures = [(folder.picture("histogram", figure), f"When cases were {campaign.done}")]
    folder.summary(summary(campaign))
    folder.text(REPORT, page(campaign, pictures))


def plan(campaign: Campaign) -> Search:
    """The search of a case; of a gathering one round."""
    (stage,) = campaign.scenario.stages
    return one_round(campaign.search, stage.rounds) if isinstance(stage, Gather) else campaign.search


def opening(campaign: Campaign) -> tuple[str, ...]:
    """What was flown, and what the search is."""
    search, craft = plan(campaign), len(campaign.scenario.craft)
    tip, limit = degrees(search.tip_angle), degrees(search.sun_limit)
    lines = [
        campaign.scenario.title,
        f"{len(campaign)} cases of {craft} craft in deep space, seed {campaign.seed}",
        f"Search: {len(search.phases)} phases, {search.duration:.1f} s, tips {tip:.3f} deg; "
        f"body x at most {degrees(search.sun_angle):.3f} deg off the sun, limit {limit:g} deg",
    ]
    if source := published(campaign).get("source"):
        lines.append(f"Published: {source}")
    return tuple(lines)


def verdict(campaign: Campaign) -> str:
    """The last line: all cases done, or which were not."""
    return campaign.reason or f"all {len(campaign)} cases {campaign.done}"


def hint(campaign: Campaign) -> tuple[str, ...]:
    """How to see a case that failed."""
    study, name = campaign.scenario.study, campaign.scenario.file
    if campaign.ok or study is None or study.seed != campaign.seed:
        return ()
    return (f"closeform run {name} --case {campaign.failed[0]} shows the first of them",)


def published(campaign: Campaign) -> dict[str, str]:
    """What others reported, by the rows of the table of shares."""
    return campaign.scenario.study.published if campaign.scenario.study is not None else {}


def sheets(campaign: Campaign) -> tuple[Sheet, ...]:
    """The tables, the same for the terminal and the page."""
    found = [share_sheet(campaign), *spread_sheets(campaign), *meeting_sheets(campaign)]
    if isinstance(campaign, LockCampaign) and campaign.sampled:
        found.append(sampled_sheet(campaign))
    return tuple(found)


def share_sheet(campaign: Campaign) -> Sheet:
    """Shares by phase; phases after the last in which something happened are left out."""
    theirs = published(campaign)
    rows = []
    for share in shown(campaign):
        row = [share.label, str(share.cases), *percent(share.inside)]
        row += percent(share.by_end) if share.by_end is not None else ["", ""]
        rows.append((*row, theirs.get(share.label, "")) if theirs else tuple(row))
    columns = (campaign.done, "cases", "in it [%]", "95 % interval", "by end [%]", "95 % interval")
    return Sheet("Cases by phase", (*columns, "published") if theirs else columns, tuple(rows))


def shown(campaign: Campaign) -> list[Share]:
    """The rows of the table of shares worth showing."""
    theirs = published(campaign)
    worth = [k for k, share in enumerate(campaign.shares[:-1]) if share.cases or share.label in theirs]
    return [*campaign.shares[: max(worth, default=0) + 1], campaign.shares[-1]]


def percent(estimate: Estimate) -> list[str]:
    """A share and its interval in per cent."""
    share, low, high = (f"{100.0 * value:.3f}" for value in (estimate.share, estimate.low, estimate.high))
    return [share, f"{low} to {high}"]


def figures(campaign: Campaign) -> dict[str, tuple[Floats, Any]]:
    """What the table of times is about: values and the numbers of their cases."""
    case = np.flatnonzero(campaign.leg >= 0)
    time = campaign.time[case]
    later = time > 0.0
    found = {"time [s]": (time, case), "time, not at once [s]": (time[later], case[later])}
    if isinstance(campaign, GatherCampaign):
        found["delta-v of all craft [m/s]"] = (campaign.delta_v[case], case)
    return {name: values for name, values in found.items() if len(values[0])}


def spread(values: Floats, case: Any) -> dict[str, float]:
    """Mean, quantiles and the greatest with its case."""
    middle = dict(zip((f"quantile_{q:g}" for q in QUANTILES), np.quantile(values, QUANTILES), strict=True))
    top = int(np.argmax(values))
    found = {"mean": values.mean(), **middle, "greatest": values[top]}
    return {name: float(value) for name, value in found.items()} | {"case": int(case[top])}


def spread_sheets(campaign: Campaign) -> tuple[Sheet, ...]:
    """Mean, quantiles and greatest of the times, and of the delta-v."""
    rows = []
    for name, values in figures(campaign).items():
        *numbers, case = spread(*values).values()
        digits = 2 if name.startswith("time") else 4
        rows.append((name, *(f"{number:.{digits}f}" for number in numbers), str(case)))
    columns = (campaign.done, "mean", "median", "95 %", "99.9 %", "greatest", "in case")
    return (Sheet("How long", columns, tuple(rows)),) if rows else ()


def by_detection(campaign: LockCampaign) -> dict[str, dict[str, int]]:
    """Cases by phase, and those whose first lock was stepped over, for each way of detection."""
    names, over = labels(campaign.search), "stepped over"
    found = {"exact": {share.label: share.cases for share in campaign.shares} | {over: 0}}
    for one in campaign.sampled:
        late = (one.leg < 0) & (campaign.leg >= 0) | (one.time - campaign.time > one.step)
        counts = dict(zip(names, tally(campaign.search, one.time, one.leg), strict=True))
        found[f"every {one.step:g} s"] = counts | {over: int(late.sum())}
    return found


def sampled_sheet(campaign: LockCampaign) -> Sheet:
    """What looking at fixed steps makes of the same cases."""
    ways = by_detection(campaign)
    keep = {share.label for share in shown(campaign)}
    rows = [
        (name, *(str(way[name]) for way in ways.values()))
        for name in ways["exact"]
        if name in keep or any(way[name] for way in ways.values())
    ]
    return Sheet("The same cases with detection at samples only", (campaign.done, *ways), tuple(rows))


def meetings(campaign: Campaign) -> dict[str, tuple[Estimate, int]]:
    """In which share of gatherings craft came within their keep-out zone, and how many pairs did."""
    if not isinstance(campaign, GatherCampaign) or campaign.scenario.common_zone is None:
        return {}
    found = {"before they knew each other": campaign.met_unknown, "only after": campaign.met_known}
    return {
        name: (estimate(int((pairs > 0).sum()), len(campaign)), int(pairs.sum()))
        for name, pairs in found.items()
    }


def meeting_sheets(campaign: Campaign) -> tuple[Sheet, ...]:
    """The same as a table."""
    rows = tuple((name, *percent(share), str(pairs)) for name, (share, pairs) in meetings(campaign).items())
    columns = ("two craft came within it", "cases [%]", "95 % interval", "pairs in all")
    return (Sheet("Keep-out zone", columns, rows),) if rows else ()


def summary(campaign: Campaign) -> dict[str, Any]:
    """Every figure printed, in full."""
    scenario = campaign.scenario
    content = {
        "title": scenario.title,
        "inputs": {Path(scenario.file).name: f"sha256:{scenario.digest}"},
        "seed": campaign.seed,
        "cases": len(campaign),
        "status": 0 if campaign.ok else 1,
        "verdict": verdict(campaign),
        "failed": len(campaign.failed),
        "craft": list(scenario.names),
        "stage": scenario.stages[0].verb,
        "draws": draws(campaign),
        "search": search_summary(plan(campaign)),
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
        "spreads": {name: spread(*values) for name, values in figures(campaign).items()},
    }
    if met := meetings(campaign):
        content["met"] = {name: vars(share) | {"pairs": pairs} for name, (share, pairs) in met.items()}
    if isinstance(campaign, LockCampaign) and campaign.sampled:
        content["detection"] = by_detection(campaign)
    return content


def draws(campaign: Campaign) -> dict[str, Any]:
    """What was drawn, as the file says it."""
    study = campaign.scenario.study
    vary = study.vary if study is not None else {}
    return {key: draw.model_dump(exclude_none=True) for key, draw in vary.items()}


def case_table(campaign: Campaign, rows: slice) -> dict[str, Any]:
    """Cases as columns: of locks one row for each case and pair, of gatherings one for each case."""
    if isinstance(campaign, GatherCampaign):
        leg = campaign.leg[rows]
        return {
            "case": np.arange(rows.start, rows.stop),
            **ended("duration_s", campaign.search, campaign.time[rows], leg),
            "rounds": campaign.rounds[rows],
            "left": campaign.left[rows],
            "delta_v_m_s": campaign.delta_v[rows],
            "met_unknown": campaign.met_unknown[rows],
            "met_known": campaign.met_known[rows],
        }
    if not isinstance(campaign, LockCampaign):
        raise TypeError(f"{type(campaign).__name__} has no table")
    states = drawn(campaign.scenario, campaign.seed, rows.start, rows.stop)
    moves = relative(states, campaign.pairs).reshape(-1, 6)
    cases, count = rows.stop - rows.start, len(campaign.pairs)
    names = np.array(campaign.scenario.names)
    return {
        "case": np.repeat(np.arange(rows.start, rows.stop), count),
        "first": np.tile(names[campaign.pairs[:, 0]], cases),
        "second": np.tile(names[campaign.pairs[:, 1]], cases),
        **dict(zip(STATE_COLUMNS, moves.T, strict=True)),
        **ended("time_s", campaign.search, campaign.pair_time[rows].ravel(), campaign.pair_leg[rows].ravel()),
    }


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


def page(campaign: Campaign, pictures: list[tuple[Path, str]]) -> str:
    """The whole report as one HTML page without references to other files."""
    title, *lines = (escape(line) for line in opening(campaign))
    tone = "good" if campaign.ok else "bad"
    parts = [
        f"<h1>{title}</h1>",
        *(f'<p class="faint">{line}</p>' for line in lines),
        f'<p class="verdict {tone}">{escape(verdict(campaign))}</p>',
        *(f"<p>{escape(line)}</p>" for line in hint(campaign)),
        *(f"<h2>{escape(sheet.title)}</h2>{table(sheet)}" for sheet in sheets(campaign)),
        *(embedded(file, caption) for file, caption in pictures),
    ]
    search = facts(campaign.search, campaign.search.duration)
    parts.append(f"<h2>{escape(search.title)}</h2>{table(search)}")
    rows = tuple(
        (key, " ".join(draw), str(next(iter(draw.values())))) for key, draw in draws(campaign).items()
    )
    if rows:
        columns = ("key", "distribution", "size")
        parts.append(f"<h2>Drawn for each case and craft</h2>{table(Sheet('', columns, rows))}")
    return document(title, parts)
