"""Conflicts of sampled and planned paths, and the closest approach of each pair, as tables and pictures."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np

from closeform.conflicts.flight import ALL_PAIRS, PairApproach, WatchedFlight
from closeform.conflicts.two_paths import PairConflict, nearest_first
from closeform.mission.mission_result import StageResult
from closeform.mission.verdict import conflicts_in
from closeform.motion.arc import END, START
from closeform.report.picture import Film, Picture
from closeform.report.table import MOST_ROWS, PAIR, Column, Table, counted, record
from closeform.zones.combined_zones import REGION
from closeform.zones.pair_zones import PairZones

DOUBTFUL = 0.1  # of a clearance ratio: a smaller interpolation error causes no warning
FEWEST, MOST_CURVES = 4, 8  # pairs whose clearance ratios are plotted over time
MOST_PAIRS = 1000  # closest approaches shown; the Parquet table has all that were computed

RATIO = Column("least", "ratio", "{:.4f} x zone".format)
DEEPEST = Column("deepest at [s]", "time_s", "{:.3f}".format, since="mission")
CONFLICT = (
    PAIR,
    Column("from [s]", "start_s", "{:.3f}".format, since="mission"),
    Column("to [s]", "end_s", "{:.3f}".format, since="mission"),
    Column("lasts [s]", None, "{:.3f}".format),
    DEEPEST,
    RATIO,
)
APPROACH = (
    PAIR,
    RATIO,
    Column("distance [m]", "distance_m", "{:.3f}".format),
    Column("at [s]", "time_s", "{:.3f}".format, since="mission"),
    Column(None, "zone"),
)
STAYS = (
    PAIR,
    Column("conflicts", "conflicts"),
    Column("first from [s]", "start_s", "{:.3f}".format, since="mission"),
    Column("last to [s]", "end_s", "{:.3f}".format, since="mission"),
    Column("in all [s]", "inside_s", "{:.3f}".format),
    DEEPEST,
    RATIO,
)
WHEN = Column("when", "when")


def conflict_row(met: PairConflict) -> tuple[Any, ...]:
    """Return a row of CONFLICT."""
    return (met.first, met.second), met.start, met.end, met.end - met.start, met.time, met.ratio


def approach_row(near: PairApproach) -> tuple[Any, ...]:
    """Return a row of APPROACH."""
    return (near.first, near.second), near.ratio, near.distance, near.time, near.rule


def stays(flight: WatchedFlight) -> list[tuple[Any, ...]]:
    """Return the rows of STAYS: each pair with a summary of its conflicts, closest approach first."""
    pairs: dict[tuple[Any, Any], list[PairConflict]] = {}
    for met in flight.conflicts:
        pairs.setdefault((met.first, met.second), []).append(met)
    rows = []
    for pair, found in pairs.items():
        worst = deepest_of(found)
        inside = sum(met.end - met.start for met in found)
        rows.append((pair, len(found), found[0].start, found[-1].end, inside, worst.time, worst.ratio))
    return sorted(rows, key=lambda row: nearest_first(row[-1], row[-2]))


def deepest_of(found: Sequence[PairConflict]) -> PairConflict:
    """Return the conflict with the smallest clearance ratio, the earliest of equal ones."""
    return min(found, key=lambda met: nearest_first(met.ratio, met.time))


def zones(flight: WatchedFlight) -> tuple[str, ...]:
    """Return a line on the rules by which zones of pairs are combined, with counts; empty without any."""
    counts = Counter(near.rule for near in flight.approaches)
    if not counts.keys() - {REGION}:
        return ()
    told = [f"{rule} ({counted(number, 'pair')})" for rule, number in counts.most_common()]
    return (f"Zones of pairs: {'; '.join(told) if len(told) > 1 else next(iter(counts))}",)


def listed(title: str, flight: WatchedFlight) -> tuple[tuple[str, ...], tuple[Table, ...]]:
    """Return a table of conflicts, or a line with the closest approach if there are none."""
    if flight.conflicts:
        return (), (Table(title, CONFLICT, [conflict_row(met) for met in flight.conflicts]),)
    close = flight.closest
    if close is None:
        return (f"{title}: none, there is only one craft",), ()
    return (
        f"{title}: none; closest are {close.first} and {close.second}, {close.ratio:.4f} x zone "
        f"({close.distance:.3f} m) at {close.time:.1f} s",
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
    rows, worst = stays(flight), deepest_of(flight.conflicts)
    pairs = len(rows)
    often = f"{len(flight.conflicts)} in " if len(flight.conflicts) > pairs else ""
    line = (
        f"{title}: {often}{pairs} of {flight.pairs} pairs; deepest are {worst.first} and "
        f"{worst.second}, {worst.ratio:.4f} x zone at {worst.time:.1f} s"
    )
    some = f", the {MOST_ROWS} deepest of {pairs}" if pairs > MOST_ROWS else ""
    by_pair = Table(f"{title}, by pair{some}", STAYS, rows[:MOST_ROWS], folded=avoided)
    return (line,), (by_pair, *(replace(table, folded=True) for table in tables))


def approaches(title: str, flight: WatchedFlight) -> tuple[Table, ...]:
    """Return the closest approach of each pair as a table, limited to MOST_PAIRS."""
    pairs = flight.approaches
    if len(pairs) > MOST_PAIRS:
        pairs = tuple(sorted(pairs, key=lambda pair: pair.ratio)[:MOST_PAIRS])
        title += f", the {MOST_PAIRS} closest of {flight.pairs}"
    return (Table(title, APPROACH, [approach_row(near) for near in pairs], folded=True),) if pairs else ()


def figures(flight: WatchedFlight) -> dict[str, Any]:
    """Return all conflicts, the number of pairs in conflict, and the closest pair, for `summary.json`."""
    close = flight.closest
    return {
        "pairs_in_conflict": conflicts_in([flight])[1],
        "conflicts": [record(CONFLICT, conflict_row(met)) for met in flight.conflicts],
        "conflicts_by_pair": [record(STAYS, row) for row in stays(flight)],
        "closest": None if close is None else record(APPROACH, approach_row(close)),
    }


def between_samples(flight: WatchedFlight) -> tuple[str, ...]:
    """Return how paths between samples were interpolated, their error, and whether it matters."""
    paths = flight.paths[1:]  # relative to the first spacecraft, whose position is exact
    count = len(paths.arcs)
    cubics = round(float(paths.cubic_share @ np.diff(paths.offsets)))
    both = f"Hill's own motion in {count - cubics} of {count} intervals, where craft coast, else cubics"
    how = both if 0 < cubics < count else "cubics" if cubics else "Hill's own motion, as craft coast"
    errors = paths.interpolation_error
    worst = int(np.argmax(errors))
    line = (
        f"Between epochs: {how}; off by up to {errors[worst]:.3f} m ({flight.names[1 + worst]}), by estimate"
    )
    close = flight.closest
    if close is None:
        return (line,)
    doubt = float(np.sort(errors)[-2:].sum() * close.zone.stretch)  # of a pair's clearance ratio
    if doubt < DOUBTFUL or close.ratio > 1.0 + doubt:
        return (line,)
    apart = float(np.diff(paths[worst].arcs[:, [START, END]]).max())
    enough = apart * sqrt(DOUBTFUL / doubt)
    return (
        line,
        f"Epochs {apart:g} s apart are too few here: conflicts between them may be missed or false; "
        f"sample every {enough:.2g} s",
    )


def files(result: StageResult[Any, Any]) -> dict[str, Table]:
    """Return conflicts and closest approaches before and after avoidance, as tables for Parquet."""
    flights = {"before": result.before, "after": result.after}
    met = [(when, *conflict_row(met)) for when, flight in flights.items() for met in flight.conflicts]
    near = [(when, *approach_row(near)) for when, flight in flights.items() for near in flight.approaches]
    return {"conflicts": Table("", (WHEN, *CONFLICT), met), "approaches": Table("", (WHEN, *APPROACH), near)}


def coasting(flight: WatchedFlight, zones: PairZones) -> tuple[Picture, ...]:
    """Return pictures of coasting spacecraft: all paths, the closest pairs, and those in conflict."""
    if flight.pairs > ALL_PAIRS:  # a picture of thousands is unreadable and takes minutes
        return deepest(flight)
    names = {"names": flight.names}
    paths = Picture(
        "paths", "All paths", "formation_paths", (flight.paths, flight.paths), names | {"zone": zones}
    )
    if not flight.approaches:
        return (paths,)
    hit = len({(met.first, met.second) for met in flight.conflicts})
    found = [paths, nearest(flight, zones, min(max(hit, FEWEST), MOST_CURVES))]
    if hit > 1:
        every = "How near each two craft come"
        found.insert(1, Picture("ratios", every, "ratio_matrix", (flight.paths, zones), names))
    return (*found, *deepest(flight))


def nearest(flight: WatchedFlight, zones: PairZones, count: int = FEWEST) -> Picture:
    """Return the picture of clearance over time of the `count` closest pairs."""
    some = f"The {count} of {flight.pairs} pairs" if flight.pairs > count else "The pairs"
    caption = f"{some} that come closest, against time"
    options = {"names": flight.names, "count": count}
    return Picture("closest-pairs", caption, "closest_pairs", (flight.paths, zones), options)


def film(result: StageResult[Any, Any], zones: PairZones) -> tuple[Film, ...]:
    """Return the animation of all spacecraft, if the stage requests it."""
    if not result.stage.animation:
        return ()
    options = {"names": result.after.names, "zone": zones}
    return (
        Film("flight", "The flight of all craft", "moving_formation.reel", (result.after.paths,), options),
    )


def deepest(flight: WatchedFlight) -> tuple[Picture, ...]:
    """Return the picture of the closest pair, if there is a conflict."""
    close = flight.closest
    if close is None or not flight.conflicts:
        return ()
    pair = flight.facing(close.first, close.second)
    zone = close.zone if pair[0] == close.first else close.zone.mirrored
    caption = f"{pair[0]} relative to {pair[1]}, of all pairs the deepest in conflict"
    arguments = *(flight.path(name) for name in pair), zone
    return (Picture("distances", caption, "distances", arguments, {"names": pair}),)
