"""What there is to say of a search: its phases and turns, the sun, the near field; and first locks."""

from dataclasses import replace
from functools import lru_cache
from math import degrees, isinf, pi

import numpy as np

from closeform.chapters.moves import encounters, nearest
from closeform.chapters.sheet import Chapter, Sheet, counted, minutes
from closeform.search.phases import labels, tally
from closeform.search.schedule import Leg as Turn
from closeform.search.schedule import Search
from closeform.stage_results import FirstLocks, Leg

ROUNDING = 1e-9  # rad
MOST_ROWS = 40  # of a table on the terminal; longer ones are summed up there


@lru_cache(maxsize=4)
def one_round(search: Search, rounds: int) -> Search:
    """The first of the rounds of a gathering, which are all alike."""
    return replace(search, legs=search.legs[: len(search.legs) // rounds])


def facts(search: Search, duration: float) -> Sheet:
    """Tips, sun and near field of a search that takes a `duration` [s]."""
    rate, limit, tip = (degrees(x) for x in (search.slew_rate, search.sun_limit, search.tip_angle))
    sun = degrees(search.sun_drift) * duration / search.duration
    kept = "respected" if search.sun_angle <= search.sun_limit + ROUNDING else "not respected"
    rows = [
        ("slew rate", f"{rate:g} deg/s"),
        ("tip angle", f"{tip:.3f} deg"),
        (f"sun limit, {kept} in every turn", f"{limit:g} deg"),
        ("greatest angle between body x and the sun line", f"{degrees(search.sun_angle):.3f} deg"),
        (f"the sun's own motion in {duration:.1f} s at 1 AU", f"{sun:.3f} deg"),
        ("turn to the start attitude, before the search, at most", f"180 deg, {pi / search.slew_rate:.1f} s"),
        ("sky covered by one cone", sky(search)),
    ]
    if isinf(search.near_field):
        rows.append(("near field of a craft, where its cone never comes", "no end: tips too small"))
    elif search.near_field:
        waits = [turn.end - turn.start for turn in search.legs if turn.about == "none"]
        rows.append(("near field of a craft, where its cone never comes", f"{search.near_field:.1f} m"))
        rows += [("waits of the near-field search (NFS)", f"2 x {waits[0]:.1f} s")] if waits else []
        rows.append(("on the sun line two craft cannot lock within", f"{2.0 * search.near_field:.1f} m"))
    return Sheet("Search", ("quantity", "value"), tuple(rows))


def phases(search: Search, rounds: int = 1) -> tuple[Sheet, ...]:
    """The phases of a search with the share of the sky that they cover, and every turn."""
    title = f"Phases of one round, of {rounds} at most" if rounds > 1 else "Phases"
    rows = tuple(
        (
            f"{name} {number}",
            f"{start:.1f}",
            f"{end:.1f}",
            f"{minutes(start)} - {minutes(end)}",
            sky(search, name),
        )
        for name, number, start, end in search.phases
    )
    legs = tuple(
        (
            f"{turn.phase} {turn.round}",
            f"{turn.start:.1f}",
            f"{turn.end:.1f}",
            turned(turn),
            f"{degrees(turn.sun_angle):.3f}",
        )
        for turn in search.legs
    )
    return (
        Sheet(title, ("phase", "from [s]", "to [s]", "[min:s]", "sky covered"), rows),
        Sheet("Turns", ("phase", "from [s]", "to [s]", "turn", "greatest sun angle [deg]"), legs, more=True),
    )


@lru_cache(maxsize=16)  # the terminal, the report and the summary ask for the same
def covered(search: Search, phase: str | None = None) -> float:
    """The share of the sky that one cone covers in a phase, or in all; from 0 to 1."""
    return search.coverage(phase)


def sky(search: Search, phase: str | None = None) -> str:
    """The same in per cent."""
    return f"{100 * covered(search, phase):.2f} %"


def turned(turn: Turn) -> str:
    """A turn in words."""
    return "wait" if turn.about == "none" else f"{degrees(turn.angle):+.3f} deg about the {turn.about}"


def locked(title: str, leg: Leg, found: FirstLocks) -> Chapter:
    """The first lock of each pair."""
    names = leg.after.names
    pairs, locks = len(found.pairs), int((found.locks.leg >= 0).sum())
    whole = np.isfinite(found.locks.time)
    last = f", the last at {np.max(found.locks.time[whole]):.2f} s" if whole.any() else ""
    search = found.search
    order = np.lexsort((found.locks.time,))  # pairs that never lock come last
    rows = tuple(
        (
            f"{names[found.pairs[k, 0]]} - {names[found.pairs[k, 1]]}",
            *when(search, float(found.locks.time[k]), int(found.locks.leg[k])),
        )
        for k in order
    )
    many = len(rows) > MOST_ROWS
    columns = ("pair", "at [s]", "[min:s]", "phase")
    conflicts, more = stays(leg)
    outcome = f"{locks} of {counted(pairs, 'pair')} lock{'s' * (pairs == 1)}{last}"
    sheets = (
        *((by_phase(found),) if many else ()),
        Sheet("First locks", columns, rows, more=many),
        *more,
        facts(search, search.duration),
        *phases(search),
        *nearest("Closest approaches", leg.after),
    )
    return Chapter(title, (*since(leg), outcome, *conflicts), sheets)


def when(search: Search, time: float, leg: int) -> tuple[str, str, str]:
    """A lock's time and phase."""
    if leg < 0:
        return "never", "-", "-"
    return f"{time:.2f}", minutes(time), f"{search.legs[leg].phase} {search.legs[leg].round}"


def by_phase(found: FirstLocks) -> Sheet:
    """How many pairs lock in each phase."""
    counts = map(str, tally(found.search, found.locks.time, found.locks.leg))
    rows = zip(labels(found.search), counts, strict=True)
    return Sheet("First locks by phase", ("phase", "pairs"), tuple(rows))


def since(leg: Leg) -> tuple[str, ...]:
    """From when times count, where that is not plain."""
    return (f"Times count from the start of the search, at {leg.start:.1f} s",) if leg.start else ()


def stays(leg: Leg) -> tuple[tuple[str, ...], tuple[Sheet, ...]]:
    """Conflicts during a search, which may go without keep-out zones; times of the mission."""
    if not leg.after.nearest:
        return ("Conflicts: not looked for, no craft has a keep_out",), ()
    return encounters("Conflicts", leg.after)
