"""Conflicts, closest approaches and passive safety, as lines, tables and pictures."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf, isfinite, isnan, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.conflicts.flight import ALL_PAIRS, PairApproach, WatchedFlight
from closeform.conflicts.two_paths import PairConflict, nearest_first
from closeform.mission.mission_result import StageResult
from closeform.mission.verdict import conflicts_in
from closeform.motion.arc import END, START
from closeform.motion.path import Path
from closeform.report.description import AT, MOST_ROWS, PAIR, Column, Table, counted, record
from closeform.report.picture import Film, Picture
from closeform.safety.failures import ThrustLost
from closeform.scenario.quantity import span
from closeform.scenario.stages import Drifting
from closeform.zones.combined_zones import REGION
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.mission.passive_safety import PairDrift, PassiveSafety

DOUBTFUL = 0.1  # of a clearance ratio: a smaller interpolation error causes no warning
FEWEST, MOST_CURVES = 4, 8  # pairs whose clearance ratios are plotted over time
MOST_PAIRS = 1000  # closest approaches shown; the Parquet table has all that were computed
MOST_FAILURES = 6  # pairs whose clearance ratio is plotted against the instant of failure
ROUNDING = 1e-6  # m: a smaller distance is printed as 0

SECONDS = "{:.3f}".format
RATIO = Column("clearance", "ratio", "{:.4f} x zone".format)
CLOSEST = replace(AT, heading="closest at [s]")
CONFLICT = (
    PAIR,
    Column("from [s]", "start_s", SECONDS, since="mission"),
    Column("to [s]", "end_s", SECONDS, since="mission"),
    Column("lasts [s]", None, SECONDS),
    CLOSEST,
    RATIO,
)
BY_PAIR = (
    PAIR,
    Column("conflicts", "conflicts"),
    Column("first start [s]", "start_s", SECONDS, since="mission"),
    Column("last end [s]", "end_s", SECONDS, since="mission"),
    Column("total [s]", "inside_s", SECONDS),
    CLOSEST,
    RATIO,
)
APPROACH = (PAIR, RATIO, Column("distance [m]", "distance_m", SECONDS), AT, Column(None, "zone"))
WHEN = Column("when", "when")
EVENTS = {  # a failure as text, and the heading of its time
    "ThrustLost": ("thrust is lost", "thrust lost at [s]"),
    "MissedBurns": ("burns are missed", "first missed at [s]"),
    "DegradedThrust": ("thrust is degraded", "degraded from [s]"),
    "StuckOnThrust": ("thrust is stuck on", "stuck from [s]"),
}


def conflict_row(met: PairConflict) -> tuple[Any, ...]:
    """Return a row of CONFLICT."""
    return (met.first, met.second), met.start, met.end, met.end - met.start, met.time, met.ratio


def approach_row(near: PairApproach) -> tuple[Any, ...]:
    """Return a row of APPROACH."""
    return (near.first, near.second), near.ratio, near.distance, near.time, near.rule


def by_pair(flight: WatchedFlight) -> list[tuple[Any, ...]]:
    """Return the rows of BY_PAIR: each pair with a summary of its conflicts, closest approach first."""
    pairs: dict[tuple[Any, Any], list[PairConflict]] = {}
    for met in flight.conflicts:
        pairs.setdefault((met.first, met.second), []).append(met)
    rows = []
    for pair, found in pairs.items():
        worst = closest_of(found)
        inside = sum(met.end - met.start for met in found)
        rows.append((pair, len(found), found[0].start, found[-1].end, inside, worst.time, worst.ratio))
    return sorted(rows, key=lambda row: nearest_first(row[-1], row[-2]))


def closest_of(found: Sequence[PairConflict]) -> PairConflict:
    """Return the conflict with the smallest clearance ratio, the earliest of equal ones."""
    return min(found, key=lambda met: nearest_first(met.ratio, met.time))


def zones(flight: WatchedFlight) -> tuple[str, ...]:
    """Return a line on the rules by which zones of pairs are combined, with counts; empty without any."""
    counts = Counter(near.rule for near in flight.approaches)
    if not counts.keys() - {REGION}:
        return ()
    rules = [f"{rule} ({counted(number, 'pair')})" for rule, number in counts.most_common()]
    return (f"Zones of pairs: {'; '.join(rules) if len(rules) > 1 else next(iter(counts))}",)


def listed(title: str, flight: WatchedFlight) -> tuple[tuple[str, ...], tuple[Table, ...]]:
    """Return a table of conflicts, or a line with the closest approach if there are none."""
    if flight.conflicts:
        return (), (Table(title, CONFLICT, [conflict_row(met) for met in flight.conflicts]),)
    near = flight.closest
    if near is None:
        return (f"{title}: none, there is only one craft",), ()
    return (
        f"{title}: none; closest approach {near.first} - {near.second}, {near.ratio:.4f} x zone "
        f"({near.distance:.3f} m) at {near.time:.1f} s",
    ), ()


def summed(
    title: str, flight: WatchedFlight, avoided: bool = False
) -> tuple[tuple[str, ...], tuple[Table, ...]]:
    """Return conflicts; if there are many, a line, a row per pair, and all of them for the page.

    If they are `avoided`, the terminal shows only the line.
    """
    lines, tables = listed(title, flight)
    if len(flight.conflicts) <= MOST_ROWS:
        return lines, tables
    rows, worst = by_pair(flight), closest_of(flight.conflicts)
    pairs = len(rows)
    often = f"{len(flight.conflicts)} in " if len(flight.conflicts) > pairs else ""
    line = (
        f"{title}: {often}{pairs} of {flight.pairs} pairs; closest approach {worst.first} - {worst.second}, "
        f"{worst.ratio:.4f} x zone at {worst.time:.1f} s"
    )
    some = f", the {MOST_ROWS} closest of {pairs}" if pairs > MOST_ROWS else ""
    short = Table(f"{title}, by pair{some}", BY_PAIR, rows[:MOST_ROWS], folded=avoided)
    return (line,), (short, *(replace(table, folded=True) for table in tables))


def approaches(title: str, flight: WatchedFlight) -> tuple[Table, ...]:
    """Return the closest approach of each pair as a table, limited to MOST_PAIRS."""
    pairs = flight.approaches
    if len(pairs) > MOST_PAIRS:
        pairs = tuple(sorted(pairs, key=lambda pair: pair.ratio)[:MOST_PAIRS])
        title += f", the {MOST_PAIRS} closest of {flight.pairs}"
    return (Table(title, APPROACH, [approach_row(near) for near in pairs], folded=True),) if pairs else ()


def figures(flight: WatchedFlight) -> dict[str, Any]:
    """Return all conflicts, the number of pairs in conflict, and the closest pair, for `summary.json`."""
    near = flight.closest
    return {
        "pairs_in_conflict": conflicts_in([flight])[1],
        "conflicts": [record(CONFLICT, conflict_row(met)) for met in flight.conflicts],
        "conflicts_by_pair": [record(BY_PAIR, row) for row in by_pair(flight)],
        "closest": None if near is None else record(APPROACH, approach_row(near)),
    }


def tables_of(flights: Mapping[str, WatchedFlight]) -> dict[str, Table]:
    """Return the conflicts and closest approaches of flights as tables for Parquet, with their names."""
    met = [(when, *conflict_row(met)) for when, flight in flights.items() for met in flight.conflicts]
    near = [(when, *approach_row(near)) for when, flight in flights.items() for near in flight.approaches]
    return {"conflicts": Table("", (WHEN, *CONFLICT), met), "approaches": Table("", (WHEN, *APPROACH), near)}


def between_samples(flight: WatchedFlight) -> tuple[str, ...]:
    """Return how paths between samples were interpolated, their error, and whether it matters."""
    paths = flight.paths[1:]  # relative to the first spacecraft, whose position is exact
    count = len(paths.arcs)
    cubics = round(float(paths.cubic_share @ np.diff(paths.offsets)))
    mixed = f"Hill's equations in {count - cubics} of {count} intervals, where craft coast, else cubics"
    how = mixed if 0 < cubics < count else "cubics" if cubics else "Hill's equations, as craft coast"
    errors = paths.interpolation_error
    worst = int(np.argmax(errors))
    name = flight.names[1 + worst]
    line = f"Between epochs: {how}; interpolation error up to {errors[worst]:.3f} m ({name}, estimate)"
    near = flight.closest
    if near is None:
        return (line,)
    doubt = float(np.sort(errors)[-2:].sum() * near.zone.stretch)  # of a pair's clearance ratio
    if doubt < DOUBTFUL or near.ratio > 1.0 + doubt:
        return (line,)
    apart = float(np.diff(paths[worst].arcs[:, [START, END]]).max())
    return (
        line,
        f"Epochs {apart:g} s apart are too few here: conflicts between them may be missed or false; "
        f"sample every {apart * sqrt(DOUBTFUL / doubt):.2g} s",
    )


def coasting(flight: WatchedFlight, zones: PairZones) -> tuple[Picture, ...]:
    """Return pictures of coasting spacecraft: all paths, the closest pairs, and those in conflict."""
    if flight.pairs > ALL_PAIRS:  # a picture of thousands is unreadable and takes minutes
        return deepest(flight)
    names = {"names": flight.names}
    both = flight.paths, flight.paths
    found = [Picture("paths", "All paths", "formation_paths", both, names | {"zone": zones})]
    if not flight.approaches:
        return tuple(found)
    hit = len({(met.first, met.second) for met in flight.conflicts})
    if hit > 1:
        caption = "Minimum clearance ratio of each pair"
        found.append(Picture("ratios", caption, "ratio_matrix", (flight.paths, zones), names))
    return (*found, nearest(flight, zones, min(max(hit, FEWEST), MOST_CURVES)), *deepest(flight))


def nearest(flight: WatchedFlight, zones: PairZones, count: int = FEWEST) -> Picture:
    """Return the picture of clearance over time of the `count` closest pairs."""
    some = f"the {count} closest of {flight.pairs} pairs" if flight.pairs > count else "the pairs"
    options = {"names": flight.names, "count": count}
    caption = f"Clearance ratio of {some} against time"
    return Picture("closest-pairs", caption, "closest_pairs", (flight.paths, zones), options)


def film(result: StageResult[Any, Any], zones: PairZones) -> tuple[Film, ...]:
    """Return the animation of all spacecraft, if the stage requests it."""
    if not result.stage.animation:
        return ()
    options = {"names": result.after.names, "zone": zones}
    return (Film("flight", "All craft in motion", "animations.reel", (result.after.paths,), options),)


def deepest(flight: WatchedFlight) -> tuple[Picture, ...]:
    """Return the picture of the closest pair, if there is a conflict."""
    near = flight.closest
    if near is None or not flight.conflicts:
        return ()
    pair = flight.facing(near.first, near.second)
    zone = near.zone if pair[0] == near.first else near.zone.mirrored
    caption = f"{pair[0]} relative to {pair[1]}, the conflict with the closest approach"
    arguments = *(flight.path(name) for name in pair), zone
    return (Picture("distances", caption, "distances", arguments, {"names": pair}),)


def drift_columns(passive: "PassiveSafety") -> tuple[Column, ...]:
    """Return the columns of the table of pairs in free drift."""
    return (
        Column("fails", "first", words=True),
        Column("meets", "second", words=True),
        RATIO,
        Column("distance [m]", "distance_m", SECONDS),
        Column(EVENTS[type(passive.failure).__name__][1], "failed_at_s", SECONDS, since="mission"),
        replace(AT, heading="closest at [s]"),
        Column("later", None, absent=""),
        Column("in", "model", words=True, spare=True),
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
        remedy = "" if passive.field else "; enlarge the zone, or add a field"
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


def drift_tables(result: StageResult[Any, Any]) -> tuple[Table, ...]:
    """Return the table of pairs, smallest clearance ratio first."""
    passive = result.passive
    if passive is None or len(passive.pairs) < 2:
        return ()
    some = f", the {MOST_ROWS} closest" if len(passive.pairs) > MOST_ROWS else ""
    of = f" of {passive.count}" * (len(passive.pairs) < passive.count)
    title = f"Closest approaches when {event(passive)}{some}{of}"
    return (Table(title, drift_columns(passive), [drift_row(pair) for pair in passive.pairs[:MOST_ROWS]]),)


def drift_figures(result: StageResult[Any, Any]) -> dict[str, Any]:
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
            "direct": None if direct is None else record(drift_columns(passive), drift_row(direct)),
            "unsafe": len(passive.unsafe),
            "nearest": None if worst is None else record(drift_columns(passive), drift_row(worst)),
        }
    }


def drift_files(result: StageResult[Any, Any]) -> dict[str, Table]:
    """Return all pairs that were checked, as a table for Parquet."""
    passive = result.passive
    if passive is None:
        return {}
    return {"drifts": Table("", drift_columns(passive), [drift_row(pair) for pair in passive.pairs])}


def drift_pictures(result: StageResult[Any, Any]) -> tuple[Picture, ...]:
    """Return pictures of clearance by time of thrust loss, and of the drift of the closest pair."""
    passive = result.passive
    if passive is None or not isinstance(passive.failure, ThrustLost):
        return ()
    failing = [pair for pair in passive.pairs if not isnan(pair.failed_at)][:MOST_FAILURES]
    if not failing:
        return ()
    fates = [drifting(result.after, pair, passive.until) for pair in failing]
    paths, others, zones = (list(some) for some in zip(*fates, strict=True))
    direct = passive.direct
    before = None if direct is None else drifting(result.before, direct, passive.until)
    some = f", the {MOST_FAILURES} closest of {passive.count} pairs" if passive.count > MOST_FAILURES else ""
    first = failing[0]
    return (
        Picture(
            "failures",
            f"Clearance ratio in free drift by instant of thrust loss{some}",
            "drift_ratios",
            (paths, others, zones, passive.until),
            {"labels": [f"{pair.fails} fails, {pair.meets}" for pair in failing], "before": before},
        ),
        Picture(
            "drift",
            f"Free drift of {first.fails} after loss of thrust, relative to {first.meets}",
            "drift_fan",
            (*fates[0], passive.until),
            {"names": (first.fails, first.meets)},
        ),
    )


def drifting(flight: WatchedFlight, pair: "PairDrift", until: float) -> tuple[Path, Path, Zone]:
    """Return the path of a pair that fails, the one that continues `until` a time [s], and their zone."""
    fails, meets = flight.path(pair.fails), flight.path(pair.meets)
    if until != inf:
        from closeform.safety.failure_cells import extended_by_coasts  # only a drift needs these kernels

        meets = extended_by_coasts(meets, until)
    return fails, meets, pair.zone
