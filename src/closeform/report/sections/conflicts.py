"""Conflicts and closest approaches, as lines, tables and pictures."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np

from closeform.conflicts.flight import ALL_PAIRS, PairApproach, WatchedFlight
from closeform.conflicts.two_paths import PairConflict, nearest_first
from closeform.mission.mission_result import StageResult
from closeform.mission.verdict import conflicts_in
from closeform.motion.arc import END, START
from closeform.report.description import AT, MOST_ROWS, PAIR, Column, Table, counted, record
from closeform.report.picture import Film, Picture
from closeform.zones.combined_zones import REGION
from closeform.zones.pair_zones import PairZones

DOUBTFUL = 0.1  # of a clearance ratio: a smaller interpolation error causes no warning
FEWEST, MOST_CURVES = 4, 8  # pairs whose clearance ratios are plotted over time
MOST_PAIRS = 1000  # closest approaches shown; the Parquet table has all that were computed

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
    return (Film("flight", "All craft in motion", "formation_animation", (result.after.paths,), options),)


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
