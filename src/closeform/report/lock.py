"""Section of a search without burns: the first lock of each pair."""

from dataclasses import replace
from typing import Any

import numpy as np

from closeform.mission.mission_result import FirstLocks, Mission, StageResult
from closeform.report import conflicts, search
from closeform.report.picture import Picture
from closeform.report.section import Section, heading
from closeform.report.table import MOST_ROWS, PAIR, PHASE, Column, Table, counted, minutes
from closeform.scenario import Lock
from closeform.search.phases import labels, tally

LOCKS = (
    replace(PAIR, key=None),
    Column("at [s]", "time_s", "{:.2f}".format, absent="never", since="stage"),
    Column("[min:s]", None, minutes),
    replace(PHASE, words=False),
)


def section(mission: Mission, result: StageResult[Lock, FirstLocks]) -> Section:
    """Return the section of first locks, sorted by time; pairs that never lock come last."""
    found, names = result.result, result.after.names
    locks = Table("First locks", LOCKS, [lock_row(found, k, names) for k in range(len(found.pairs))])
    shown = replace(
        locks,
        rows=[locks.rows[k] for k in np.argsort(found.locks.time, kind="stable")],
        folded=len(locks.rows) > MOST_ROWS,
    )
    met, tables = search.watched(result)
    asked = "" if mission.scenario.search_errors is None else ", as asked of craft that are off it"
    return Section(
        heading(result),
        (*search.since(result), outcome(found), *met),
        (
            *((by_phase(found),) if shown.folded else ()),
            shown,
            *tables,
            search.facts(found.search, found.search.duration, result.sun),
            search.phases(found.search),
            search.turns(found.search),
            *conflicts.approaches("Closest approaches", result.after),
        ),
        pictures=(
            Picture(
                "in-plane-search",
                f"The in-plane search of both groups{asked}",
                "in_plane_search",
                (found.search,),
            ),
            Picture("manoeuvres", f"The turns of the first round{asked}", "manoeuvres", (found.search,)),
            *conflicts.deepest(result.after),
        ),
        figures={"search": search.figures(found.search, result.sun), "locks": figures(found, names)},
        files={"locks": locks},
    )


def lock_row(found: FirstLocks, k: int, names: tuple[str, ...]) -> tuple[Any, ...]:
    """Return a row of LOCKS for pair k, with None for a pair that never locks."""
    (one, other), leg = found.pairs[k], int(found.locks.leg[k])
    pair = names[one], names[other]
    if leg < 0:
        return pair, None, None, None
    time, turn = float(found.locks.time[k]), found.search.legs[leg]
    return pair, time, time, (turn.phase, turn.round)


def outcome(found: FirstLocks) -> str:
    """Return a line on how many pairs lock, and when the last one does."""
    pairs, times = len(found.pairs), found.locks.time[found.locks.leg >= 0]
    last = f", the last at {times.max():.2f} s" if len(times) else ""
    return f"{len(times)} of {counted(pairs, 'pair')} lock{'s' * (pairs == 1)}{last}"


def by_phase(found: FirstLocks) -> Table:
    """Return the table of the number of pairs that lock in each phase."""
    counts = tally(found.search, found.locks.time, found.locks.leg)
    rows = list(zip(labels(found.search), counts, strict=True))
    return Table("First locks by phase", (Column("phase", words=True), Column("pairs")), rows)


def figures(found: FirstLocks, names: tuple[str, ...]) -> dict[str, Any]:
    """Return the first locks for `summary.json`; times count from the start of the stage."""
    times = found.locks.time[found.locks.leg >= 0]
    return {
        "pairs": len(found.pairs),
        "locked": len(times),
        "last_s": float(times.max()) if len(times) else None,
        "missing": [[names[i], names[j]] for i, j in found.missing],
    }
