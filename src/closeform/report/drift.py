"""Passive safety of a stage: closest approaches in free drift after a failure."""

from collections.abc import Iterator
from dataclasses import replace
from math import inf, isfinite, isnan
from typing import TYPE_CHECKING, Any

from closeform.mission.mission_result import StageResult
from closeform.motion.path import Path
from closeform.report.picture import Picture
from closeform.report.table import MOST_ROWS, Column, Table, record
from closeform.safety.failures import ThrustLost
from closeform.scenario.quantity import span
from closeform.scenario.stages import Drifting
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.mission.passive_safety import PairDrift, PassiveSafety

CURVES = 6  # pairs whose clearance ratio is plotted against the instant of failure
ROUNDING = 1e-6  # m: a smaller distance is printed as 0
SECONDS = "{:.3f}".format
EVENTS = {
    "ThrustLost": ("thrust is lost", "thrust lost at [s]"),
    "MissedBurns": ("burns are missed", "first missed at [s]"),
    "DegradedThrust": ("thrust gets weak", "weak from [s]"),
    "StuckOnThrust": ("thrust is stuck", "stuck at [s]"),
}


def columns(passive: "PassiveSafety") -> tuple[Column, ...]:
    """Return the columns of the table of pairs."""
    return (
        Column("fails", "first", words=True),
        Column("meets", "second", words=True),
        Column("least", "ratio", "{:.4f} x zone".format),
        Column("distance [m]", "distance_m", SECONDS),
        Column(EVENTS[type(passive.failure).__name__][1], "failed_at_s", SECONDS, since="mission"),
        Column("met at [s]", "time_s", SECONDS, since="mission"),
        Column("later", None, absent=""),
        Column("in", "model", words=True, spare=True),
    )


def row(pair: "PairDrift") -> tuple[Any, ...]:
    """Return a row of the table of pairs."""
    known = [value if isfinite(value) else None for value in (pair.distance, pair.failed_at, pair.time)]
    later = span(pair.time - pair.failed_at) if None not in known else None
    return (pair.fails, pair.meets, pair.ratio, *known, later, pair.model)


def lines(result: StageResult[Any, Any]) -> Iterator[str]:
    """Yield the verdict on passive safety in words, and whether the paths were planned for it."""
    passive, stage = result.passive, result.stage
    if passive is None:
        if isinstance(stage, Drifting) and stage.drift is not None:
            yield f"Passively safe {stage.lasting}: no, since there is no path{directly(result)}"
        return
    safe, lasting, worst = passive.safe, passive.lasting, passive.worst
    title = f"{'Passively' if safe else 'Not passively'} safe {lasting}"
    if worst is None:
        several = passive.count and f"none of {passive.count} failures of one craft leads into a zone"
        yield f"{title}: {several or 'no two craft keep a zone'}"
        return
    if safe:
        yield f"{title}: least {near(worst)}, {worst.fails} with {worst.meets}{when(passive, worst)}"
    else:
        many = f"; unsafe are {len(passive.unsafe)} of {passive.count}" if passive.count > 1 else ""
        yield f"{title}: {worst.fails} comes to {near(worst)} of {worst.meets}{when(passive, worst)}{many}"
    if passive.field:
        yield f"Judged {passive.models}, of each pair the worse; the least is in {worst.model}"
    if safe and passive.doubt:
        remedy = "" if passive.field else "; enlarge the zone, or add a field"
        yield f"Not shown beyond Hill's equations: {passive.doubt}{remedy}"
    if any(not isnan(pair.failed_at) for pair in passive.pairs):
        yield judgement(passive, result.pulsed is not None)


def directly(result: StageResult[Any, Any]) -> str:
    """Return the closest approach of the direct path in words, for a stage without a plan."""
    pair = result.unplanned
    if pair is None:
        return ""
    return f"; by the direct path {pair.fails} would come to {near(pair)} of {pair.meets}"


def judgement(passive: "PassiveSafety", fires: bool) -> str:
    """Return whether the paths were planned to be safe or only checked; `fires`: executed by pulses."""
    if not passive.planned:
        return "Judged, not planned for: every instant of failure and all of the drift is looked at"
    told = "Planned for" if not fires else "Planned for, and judged as the pulses fly it"
    direct = passive.direct
    if direct is None:
        return f"{told}: the direct path is safe, at every instant of failure and for all of the drift"
    return f"{told}: by the direct path {direct.fails} would come to {near(direct)} of {direct.meets}"


def near(pair: "PairDrift") -> str:
    """Return the clearance ratio and the distance of a pair in words."""
    metres = f" ({length(pair.distance)})" if isfinite(pair.distance) else ""
    return f"{pair.ratio:.4f} x zone{metres}{pair.beside}"


def length(metres: float) -> str:
    """Return a distance in words, 0 if it is below rounding error."""
    return f"{metres if metres > ROUNDING else 0.0:.4g} m"


def when(passive: "PassiveSafety", pair: "PairDrift") -> str:
    """Return the time of failure and the time from there to the closest approach, in words."""
    if not isfinite(pair.time):
        met = ", in a drift so slow that nobody knows when"
        return met if isnan(pair.failed_at) else f", if {event(passive)} at {pair.failed_at:.1f} s{met}"
    if isnan(pair.failed_at):
        return f", without any thrust, at {pair.time:.1f} s"
    return f", if {event(passive)} at {pair.failed_at:.1f} s, {span(pair.time - pair.failed_at)} later"


def event(passive: "PassiveSafety") -> str:
    """Return the failure in words."""
    return EVENTS[type(passive.failure).__name__][0]


def tables(result: StageResult[Any, Any]) -> tuple[Table, ...]:
    """Return the table of pairs, smallest clearance ratio first."""
    passive = result.passive
    if passive is None or len(passive.pairs) < 2:
        return ()
    some = f", the {MOST_ROWS} nearest" if len(passive.pairs) > MOST_ROWS else ""
    of = f" of {passive.count}" * (len(passive.pairs) < passive.count)
    title = f"Who comes nearest to whom when {event(passive)}{some}{of}"
    return (Table(title, columns(passive), [row(pair) for pair in passive.pairs[:MOST_ROWS]]),)


def figures(result: StageResult[Any, Any]) -> dict[str, Any]:
    """Return the results on passive safety for `summary.json`."""
    passive = result.passive
    if passive is None:
        return {}
    worst, direct = passive.worst, passive.direct
    return {
        "passive_safety": {
            "safe": passive.safe,
            "model": passive.models.removeprefix("in "),
            "not_shown": passive.doubt or None,
            "planned": passive.planned,
            "until_s": passive.until,
            "drift_s": passive.until - result.end,
            "failure": {"what": type(passive.failure).__name__, **vars(passive.failure)},
            "pairs": passive.count,
            "direct": None if direct is None else record(columns(passive), row(direct)),
            "unsafe": len(passive.unsafe),
            "nearest": None if worst is None else record(columns(passive), row(worst)),
        }
    }


def files(result: StageResult[Any, Any]) -> dict[str, Table]:
    """Return all pairs that were checked, as a table for Parquet."""
    passive = result.passive
    if passive is None:
        return {}
    stored = tuple(replace(column, heading=None) for column in columns(passive))
    return {"drifts": Table("", stored, [row(pair) for pair in passive.pairs])}


def pictures(result: StageResult[Any, Any]) -> tuple[Picture, ...]:
    """Return pictures of clearance by time of thrust loss, and of the drift of the closest pair."""
    passive = result.passive
    if passive is None or not isinstance(passive.failure, ThrustLost):
        return ()
    failing = [pair for pair in passive.pairs if not isnan(pair.failed_at)][:CURVES]
    if not failing:
        return ()
    from closeform.safety.sides import carried  # only a drift needs these kernels

    flown = result.after.paths if passive.until == inf else carried(result.after.paths, passive.until)
    names = result.after.names
    fail = [names.index(pair.fails) for pair in failing]
    fly = [names.index(pair.meets) for pair in failing]
    paths, others = [result.after.paths[k] for k in fail], [flown[k] for k in fly]
    zones, labels = [pair.zone for pair in failing], [f"{pair.fails} fails, {pair.meets}" for pair in failing]
    some = f", the {CURVES} nearest of {passive.count} pairs" if passive.count > CURVES else ""
    pair = names[fail[0]], names[fly[0]]
    before = None if passive.direct is None else unplanned(result, passive.direct, passive.until)
    return (
        Picture(
            "failures",
            f"How near craft come when thrust is lost, by when it is{some}",
            "drift_ratios",
            (paths, others, zones, passive.until),
            {"labels": labels, "before": before},
        ),
        Picture(
            "drift",
            f"Where {pair[0]} drifts when its thrust is lost, relative to {pair[1]}",
            "drift_fan",
            (paths[0], others[0], zones[0], passive.until),
            {"names": pair},
        ),
    )


def unplanned(result: StageResult[Any, Any], direct: "PairDrift", until: float) -> tuple[Path, Path, Zone]:
    """Return the critical pair of the direct paths: the path that fails, the one that continues, the zone."""
    from closeform.safety.sides import carried  # only a drift needs these kernels

    paths, names = result.before.paths, result.before.names
    flown = paths if until == inf else carried(paths, until)
    return paths[names.index(direct.fails)], flown[names.index(direct.meets)], direct.zone
