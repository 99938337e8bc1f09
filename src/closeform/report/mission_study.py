"""Reports of studies of missions, of sweeps and of errors."""

import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from closeform.campaign.error_cases import MET as CLEAR
from closeform.campaign.error_cases import MOST as MOST_CASES
from closeform.campaign.error_cases import ErrorCampaign, PairCounts
from closeform.campaign.mission_cases import END, RATIO, SPENT, WORDS, MissionCampaign, SimulationTally
from closeform.campaign.sweep_cases import Point, SweepCampaign
from closeform.confidence import estimate
from closeform.report.description import MOST_ROWS, Column, Table, counted
from closeform.report.page import quoted
from closeform.report.picture import Picture
from closeform.report.sections import model_limits
from closeform.report.study import (
    SPREAD,
    StudyReport,
    draw_table,
    percent,
    quantiles,
    resolved,
    shows,
    spread,
    spread_row,
)

NUMBER = re.compile(r"(.*?)([-+]?\d[\d.]*(?:e[-+]?\d+)?)( ?\D.*|)")  # words, a number, its unit
DIGITS = {"[s]": 1, "[%]": 2}  # decimals, by unit
NEAREST = (
    Column("closest pair of a simulation", words=True),
    *(Column(heading, form="{:.4f}".format) for heading in ("median", "5 %", "0.1 %", "least")),
    Column("in case"),
)
CAUSES = tuple(
    Column(f"{cause} [m/s]", form="{:.6g}".format) for cause in ("plan", "model error", "feedback")
)
CASES = Column("case", "case"), Column("entries", "entries"), Column("pairs in conflict", "pairs", words=True)
PICTURES = (  # names, captions, axis labels, columns, and the quantile on the bad side
    ("delta-v", "Delta-v of all craft", "delta-v of all craft [m/s]", "delta_v_m_s", 0.95),
    (
        "simulated-delta-v",
        "Simulated delta-v of all craft",
        "simulated delta-v of all craft [m/s]",
        SPENT,
        0.95,
    ),
    ("simulated-ends", "Largest deviation from the plan at the end", "deviation at the end [m]", END, 0.95),
    (
        "simulated-ratios",
        "Clearance ratio of the closest pair",
        "clearance ratio of the closest pair",
        RATIO,
        0.05,
    ),
)
SIMULATIONS = (
    "Simulations",
    "one per case, with its own errors; ratios at instants a few seconds apart and on cubics between them "
    "(closeform run FILE --case K certifies those of one)",
)


def shares(first: str, share: str = "share [%]") -> tuple[Column, ...]:
    """Return the columns of a table of cases and their share."""
    return Column(first, words=True), Column("cases"), *percent(share)


def missions_report(campaign: MissionCampaign) -> StudyReport:
    """Return the report of a campaign of missions."""
    flights, scenario = campaign.flights, campaign.scenario
    craft = counted(len(scenario.craft), "craft", "craft")
    stages = [stage.verb for stage in scenario.stages]
    return StudyReport(
        campaign,
        (
            scenario.title,
            f"{len(campaign)} cases of {craft}, seed {campaign.seed}; stages: {', '.join(stages)}",
        ),
        campaign.reason or f"in all {len(campaign)} cases {WORDS['met']}",
        () if campaign.ok else shows(campaign, campaign.tally.good.unmet[0], "the first of them"),
        tuple(mission_tables(campaign)),
        {
            "stages": stages,
            "ended": {
                one: {"cases": count} | vars(estimate(count, len(campaign)))
                for one, count in campaign.counts.items()
            },
            "causes": [{"cause": why, "cases": many, "first": case} for why, many, case in campaign.causes],
            "spreads": {name: spread(one) for name, one in campaign.spreads.items()},
            "least_ratio": None if campaign.nearest is None else campaign.nearest[0],
            "drifting": dict(zip(("cases", "into_a_zone"), campaign.drifting, strict=True)),
            **({} if flights is None else {"flights": simulation_figures(flights)}),
        },
        tuple(distributions(campaign)),
        draw_table(campaign),
        (SIMULATIONS,) * (flights is not None),
    )


def mission_tables(campaign: MissionCampaign) -> Iterator[Table]:
    """Yield outcomes, causes, costs, and the ten cases of highest cost."""
    flights, columns = campaign.flights, tuple[Column, ...]()
    counts = {WORDS[status]: count for status, count in campaign.counts.items() if count}
    ended = [(words, count, *[estimate(count, len(campaign))] * 2) for words, count in counts.items()]
    yield Table("Outcome of cases", shares("outcome"), ended)
    if campaign.causes:
        columns = Column("cause, without numbers", words=True), Column("cases"), Column("first")
        yield Table("Causes", columns, campaign.causes)
    if flights is not None:
        yield from simulated(flights)
    if campaign.spreads:
        every = [*campaign.spreads.items()]
        rows = [
            spread_row(name, one, DIGITS.get(name[-3:], 4), 100.0 if name.endswith("[%]") else 1.0)
            for k, (name, one) in enumerate(every)
            if k == 0 or one.worst[0][0] > 0.0
        ]
        first, both = every[0][1], "" if flights is None else ", simulated and planned"
        columns = resolved((Column("of the completed cases", words=True), *SPREAD), first.count)
        yield Table(f"Cost of cases{both}", columns, rows)
        columns = Column("case"), Column("delta-v of all craft [m/s]", form="{:.4f}".format)
        simulated_too = ", simulated" * (flights is not None)
        most = [(case, spent) for spent, case in first.worst]
        yield Table(f"Cases with the most delta-v{simulated_too}", columns, most)
    if campaign.nearest is not None:
        planned = " as planned" * (flights is not None)
        columns = Column(f"minimum clearance ratio of any pair{planned}"), Column("in case")
        ratio, case = campaign.nearest
        yield Table("", columns, [(f"{ratio:.6f}", case)])
    drifting, into = campaign.drifting
    if drifting:
        some, bad = estimate(drifting, len(campaign)), estimate(into, drifting)
        lost = (
            ("all cases", drifting, some, some),
            ("of these, with a conflict in free drift", into, bad, bad),
        )
        yield Table("Cases with loss of thrust", shares("of"), lost)


def simulation_figures(flights: SimulationTally) -> dict[str, Any]:
    """Return the results of simulations for `summary.json`."""
    near = flights.nearness
    return {
        "simulated": flights.count,
        "entered": {"cases": flights.entered} | vars(estimate(flights.entered, flights.count)),
        "mean_delta_v_m_s": flights.mean,
        "least_ratio": None if flights.nearest is None else flights.nearest[0],
        "ratios": None if near is None else quantiles(near),
    }


def distributions(campaign: MissionCampaign) -> Iterator[Picture]:
    """Yield the distributions of delta-v and of the simulation results."""
    simulated, done = campaign.flights is not None, ~np.isnan(campaign.column("end_s"))
    for name, caption, words, column, tail in PICTURES if simulated else PICTURES[:1]:
        planned = simulated and column == "delta_v_m_s"
        some = campaign.column(column)[done]
        if not np.isnan(some).all():
            arguments = some, f"planned {words}" if planned else words
            yield Picture(name, caption + ", as planned" * planned, "distribution", arguments, {"tail": tail})


def simulated(flights: SimulationTally) -> Iterator[Table]:
    """Yield tables of keep-out violations, of clearance, and of the delta-v by cause."""
    if flights.nearest is not None and flights.nearness is not None:
        share, quantile = estimate(flights.entered, flights.count), flights.nearness.quantiles
        row = "clearance ratio", *(one.value for one in quantile.values()), *flights.nearest
        entered = "keep-out zone violated", flights.entered, share, share
        yield Table("Simulations in the high-fidelity model", shares("one simulation per case"), [entered])
        yield Table("", resolved(NEAREST, flights.nearness.count, [*quantile]), [row])
    yield Table("Mean simulated delta-v of all craft, by cause", CAUSES, [tuple(flights.mean.values())])


def sweep_report(campaign: SweepCampaign) -> StudyReport:
    """Return the report of a sweep: one row per point, and one picture."""
    scenario, points = campaign.scenario, campaign.points
    stages, file = ", ".join(stage.verb for stage in scenario.stages), quoted(scenario.file)
    count = f"{len(campaign)} cases at each of {len(points)} points, seed {campaign.seed}; stages: {stages}"
    hint = f"closeform run {file} --case K --point P shows a case of the point in row P, counted from 0"
    keys = (Column(key.removeprefix("study.vary.")) for key in points[0].values)
    what = next((point.name for point in points if point.name is not None), "time [s]")
    columns = *keys, Column("met"), *percent("of cases [%]"), Column(f"median {what}"), Column("95 %")
    rows = []
    for point in points:
        found: tuple[str, ...] = ("-", "-", "-")
        if point.spread is not None:
            middle, most = (point.spread.quantiles[share].value for share in (0.5, 0.95))
            found = tuple(f"{one:.6g}" for one in (middle, most, point.spread.worst[0][0]))
        rows.append((*point.values.values(), point.met_cases, point.met, point.met, *found))
    figures = [
        {
            "values": point.values,
            "met": {"cases": point.met_cases, **vars(point.met)},
            "spread": None if point.spread is None else {point.name: spread(point.spread)},
        }
        for point in points
    ]
    return StudyReport(
        campaign,
        (scenario.title, count),
        campaign.reason or f"all requirements met in every case at all {len(points)} points",
        (hint,) if campaign.as_in_file else (),
        (Table("Points", (*columns, Column("greatest")), rows),),
        {"points": figures},
        (shares_of_points(points),),
        draw_table(campaign),
    )


def shares_of_points(points: Sequence[Point]) -> Picture:
    """Return the picture of shares against the values of the key that has most of them."""
    every = {key: list(dict.fromkeys(point.values[key] for point in points)) for key in points[0].values}
    along = max(every, key=lambda key: len(every[key]))
    lines: dict[str, dict[str, Point]] = {}
    for point in points:
        others = ", ".join(
            f"{key.rpartition('.')[2]} {text}" for key, text in point.values.items() if key != along
        )
        lines.setdefault(others, {})[point.values[along]] = point
    places, kind, unit = numbered(every[along])
    order = np.argsort(places, kind="stable")
    parts = [
        np.array([[getattr(line[value].met, part) for value in every[along]] for line in lines.values()])
        for part in ("share", "low", "high")
    ]
    what = f"{', '.join(filter(None, (along.removeprefix('study.vary.'), kind)))} [{unit}]"
    arguments = np.array(places)[order], *(part[:, order] for part in parts), what, list(lines)
    return Picture("sweep", "Shares of cases in which all requirements are met", "sweep", arguments)


def numbered(texts: Sequence[str]) -> tuple[list[float], str, str]:
    """Return the numbers of quantities of one kind, the text before them, and their unit.

    Quantities of different kinds are numbered in the order in which they appear.
    """
    found = [NUMBER.fullmatch(text) for text in texts]
    kinds = {(one[1], one[3]) for one in found if one is not None}
    if None in found or len(kinds) != 1:
        return [float(k) for k in range(len(texts))], "", "number of the value"
    ((before, after),) = kinds
    return [float(one[2]) for one in found if one is not None], before.strip(), after.strip() or "1"


def errors_report(campaign: ErrorCampaign) -> StudyReport:
    """Return the report of a campaign of errors: cases and pairs with conflicts."""
    scenario, results, worst = campaign.scenario, campaign.mission.results, campaign.worst
    craft = counted(len(scenario.craft), "craft", "craft")
    drawn = ", execution errors and process noise" if scenario.noisy else " and execution errors"
    clear = " and ".join(CLEAR[kind] for kind in campaign.counts)
    titles = {"zone": "Within a keep-out zone", "body": "Within the hard bodies"}
    groups = [(titles[kind], counts) for kind, counts in campaign.counts.items()]
    some = f", the {MOST_CASES} with most entries" if len(worst) == MOST_CASES else ""
    conflicts = Table(f"Cases with conflicts{some}", CASES, worst)
    return StudyReport(
        campaign,
        (
            scenario.title,
            f"{len(campaign)} cases of the errors of {craft}, seed {campaign.seed}",
            f"Executed as planned, 0.0 s to {results[-1].end if results else 0.0:.1f} s: "
            f"initial states{drawn} are sampled",
        ),
        campaign.reason or f"all {len(campaign)} cases {clear}",
        shows(campaign, worst[0][0], "the one with most entries") if worst else (),
        tuple(pair_table(title, counts, len(campaign)) for title, counts in groups),
        {
            "worst": conflicts.records,
            "inside": {
                title: {"any pair": vars(estimate(int(found.any), len(campaign)))}
                | {
                    f"{one} - {other}": vars(estimate(int(inside), len(campaign)))
                    for (one, other), inside in zip(found.pairs, found.inside, strict=True)
                }
                for title, found in groups
            },
        },
        sure=[*model_limits.of_errors(True)],
        notable=lambda replays: (conflicts,),
    )


def pair_table(title: str, found: PairCounts, cases: int) -> Table:
    """Return shares of cases with intervals, for any pair and for each pair, most cases first."""
    columns = (
        Column("pair", words=True),
        Column("cases in conflict"),
        *percent("share [%]"),
        Column("in conflict at the start"),
        Column("entries in all"),
    )
    most = np.argsort(-found.inside, kind="stable")[:MOST_ROWS].tolist()
    some = f", the {MOST_ROWS} pairs with most cases of {len(found.pairs)}" * (len(found.pairs) > MOST_ROWS)
    counts = [("any pair", found.any, found.any_began, found.entries.sum())]
    counts += [(" - ".join(found.pairs[k]), found.inside[k], found.began[k], found.entries[k]) for k in most]
    rows = [
        (pair, int(inside), *[estimate(int(inside), cases)] * 2, int(began), int(entries))
        for pair, inside, began, entries in counts
    ]
    return Table(title + some, columns, rows)
