"""Passive safety of a stage: verdict, pairs and pictures of the free drift after a failure."""

from collections.abc import Iterator
from dataclasses import replace
from math import inf, isfinite, isnan
from typing import TYPE_CHECKING, Any

from closeform.conflicts.flight import WatchedFlight
from closeform.mission.mission_result import StageResult
from closeform.motion.path import Path
from closeform.report.description import AT, MOST_ROWS, Column, Section, Table, record
from closeform.report.picture import Picture
from closeform.report.sections.conflicts import RATIO, SECONDS
from closeform.safety.failures import ThrustLost
from closeform.scenario.quantity import span
from closeform.scenario.stages import Drifting
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.mission.passive_safety import PairDrift, PassiveSafety

MOST_FAILURES = 6  # pairs whose clearance ratio is plotted against the instant of failure
ROUNDING = 1e-6  # m: a smaller distance is printed as 0
EVENTS = {  # a failure as text, and the heading of its time
    "ThrustLost": ("thrust is lost", "thrust lost at [s]"),
    "MissedBurns": ("burns are missed", "first missed at [s]"),
    "DegradedThrust": ("thrust is degraded", "degraded from [s]"),
    "StuckOnThrust": ("thrust is stuck on", "stuck from [s]"),
}


def drift_columns(passive: "PassiveSafety") -> tuple[Column, ...]:
    """Return the columns of the table of pairs in free drift."""
    several = len({pair.model for pair in passive.pairs}) > 1
    return (
        Column("fails", "first", words=True),
        Column("meets", "second", words=True),
        RATIO,
        Column("distance [m]", "distance_m", SECONDS),
        Column(EVENTS[type(passive.failure).__name__][1], "failed_at_s", SECONDS, since="mission"),
        replace(AT, heading="closest at [s]"),
        Column("later", absent=""),
        Column("in" if several else None, "model", words=True, spare=True),
    )


def drift_row(pair: "PairDrift") -> tuple[Any, ...]:
    """Return a row of the table of pairs in free drift."""
    known = [value if isfinite(value) else None for value in (pair.distance, pair.failed_at, pair.time)]
    later = span(pair.time - pair.failed_at) if None not in known else None
    return (pair.fails, pair.meets, pair.ratio, *known, later, pair.model)


def drift_lines(result: StageResult[Any, Any]) -> Iterator[str]:
    """Yield the verdict on passive safety as text, and whether the paths were planned for it."""
    passive, stage = result.passive, result.stage
    if passive is None:
        if isinstance(stage, Drifting) and stage.drift is not None:
            one = result.unplanned
            direct = f"; on the direct path: {one.fails} to {one.meets}, {near(one)}" if one else ""
            yield f"Passively safe {stage.lasting}: no, since there is no path{direct}"
        return
    safe, worst = passive.safe, passive.worst
    title = f"{'Passively' if safe else 'Not passively'} safe {passive.lasting}"
    if worst is None:
        several = passive.count and f"no conflict after any of {passive.count} failures of one craft"
        yield f"{title}: {several or 'no two craft keep a zone'}"
        return
    pair = f"{worst.fails} to {worst.meets}"
    many = "" if safe or passive.count < 2 else f"; unsafe are {len(passive.unsafe)} of {passive.count} pairs"
    yield f"{title}: {pair}, closest approach {near(worst)}{when(passive, worst)}{many}"
    if passive.field:
        yield f"Evaluated {passive.models}, the worse for each pair; the closest approach is in {worst.model}"
    if safe and passive.doubt:
        remedy = "" if passive.field else "; enlarge the zone, or add epoch, chief and field to [orbit]"
        yield f"Not shown beyond Hill's equations: {passive.doubt}{remedy}"
    if all(isnan(pair.failed_at) for pair in passive.pairs):
        return
    if not passive.planned:
        yield "Checked, not planned for: every instant of failure and the whole free drift"
        return
    how = "Planned for" if result.pulsed is None else "Planned for, and checked with the pulses as fired"
    unplanned = passive.direct
    if unplanned is None:
        yield f"{how}: the direct path is safe, at every instant of failure and for the whole free drift"
    else:
        both = f"{unplanned.fails} to {unplanned.meets}"
        yield f"{how}; on the direct path: {both}, closest approach {near(unplanned)}"


def near(pair: "PairDrift") -> str:
    """Return the clearance ratio and the distance of a pair as text."""
    metres = (
        f" ({pair.distance if pair.distance > ROUNDING else 0.0:.4g} m)" if isfinite(pair.distance) else ""
    )
    return f"{pair.ratio:.4f} x zone{metres}{pair.beside}"


def when(passive: "PassiveSafety", pair: "PairDrift") -> str:
    """Return the time of failure and the time from there to the closest approach, as text."""
    failed = "" if isnan(pair.failed_at) else f", if {event(passive)} at {pair.failed_at:.1f} s"
    if not isfinite(pair.time):
        return f"{failed}, in a drift too slow to determine the time"
    if not failed:
        return f", without any thrust, at {pair.time:.1f} s"
    return f"{failed}, {span(pair.time - pair.failed_at)} later"


def event(passive: "PassiveSafety") -> str:
    """Return the failure as text."""
    return EVENTS[type(passive.failure).__name__][0]


def section(result: StageResult[Any, Any]) -> Section:
    """Return the section on the passive safety of a stage; without title, and empty if none was evaluated."""
    passive, lines = result.passive, tuple(drift_lines(result))
    if passive is None:
        return Section("", lines)
    worst, direct, columns = passive.worst, passive.direct, drift_columns(passive)
    some = f", the {MOST_ROWS} closest" if len(passive.pairs) > MOST_ROWS else ""
    of = f" of {passive.count}" * (len(passive.pairs) < passive.count)
    title = f"Closest approaches when {event(passive)}{some}{of}"
    rows = [drift_row(pair) for pair in passive.pairs]
    figures = {
        "safe": passive.safe,
        "model": passive.models.removeprefix("in "),
        "not_shown": passive.doubt or None,
        "planned": passive.planned,
        "until_s": passive.until,
        "drift_s": passive.until - result.end,
        "failure": {"what": type(passive.failure).__name__, **vars(passive.failure)},
        "pairs": passive.count,
        "direct": None if direct is None else record(columns, drift_row(direct)),
        "unsafe": len(passive.unsafe),
        "nearest": None if worst is None else record(columns, drift_row(worst)),
    }
    return Section(
        "",
        lines,
        (Table(title, columns, rows[:MOST_ROWS]),) * (len(rows) > 1),  # smallest clearance ratio first
        pictures=tuple(pictures(result, passive)),
        figures={"passive_safety": figures},
        files={"drifts": Table("", columns, rows)},
    )


def pictures(result: StageResult[Any, Any], passive: "PassiveSafety") -> Iterator[Picture]:
    """Yield pictures of clearance by time of thrust loss, and of the drift of the closest pair."""
    failing = [pair for pair in passive.pairs if not isnan(pair.failed_at)][:MOST_FAILURES]
    if not failing or not isinstance(passive.failure, ThrustLost):
        return
    fates = [drifting(result.after, pair, passive.until) for pair in failing]
    paths, others, zones = (list(some) for some in zip(*fates, strict=True))
    direct, first = passive.direct, failing[0]
    before = None if direct is None else drifting(result.before, direct, passive.until)
    some = f", the {MOST_FAILURES} closest of {passive.count} pairs" if passive.count > MOST_FAILURES else ""
    caption = f"Clearance ratio in free drift by instant of thrust loss{some}"
    options = {"labels": [f"{pair.fails} fails, {pair.meets}" for pair in failing], "before": before}
    yield Picture("failures", caption, "drift_ratios", (paths, others, zones, passive.until), options)
    caption = f"Free drift of {first.fails} after loss of thrust, relative to {first.meets}"
    yield Picture(
        "drift", caption, "drift_fan", (*fates[0], passive.until), {"names": (first.fails, first.meets)}
    )


def drifting(flight: WatchedFlight, pair: "PairDrift", until: float) -> tuple[Path, Path, Zone]:
    """Return the path of a pair that fails, the one that continues `until` a time [s], and their zone."""
    fails, meets = flight.path(pair.fails), flight.path(pair.meets)
    if until != inf:
        meets = meets.extended(until)
    return fails, meets, pair.zone
