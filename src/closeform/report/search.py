"""Tables and figures of a search: phases, turns, sun angle and near field."""

from dataclasses import replace
from functools import lru_cache
from math import degrees, isinf, pi
from typing import Any

from closeform.mission.mission_result import StageResult
from closeform.mission.verdict import SunAngle
from closeform.report import conflicts
from closeform.report.table import PHASE, Column, Table, minutes
from closeform.search.leg import SPELLED
from closeform.search.schedule import Search

ROUNDING = 1e-9  # rad
FROM, TO = (
    Column(f"{word} [s]", key, "{:.1f}".format, since="stage")
    for word, key in (("from", "start_s"), ("to", "end_s"))
)


def turn(about: str, angle: float) -> str:
    """Return a turn in words."""
    return "wait" if about == "none" else f"{degrees(angle):+.3f} deg about the {about}"


PHASES = (PHASE, FROM, TO, Column("[min:s]"), Column("sky covered", None, "{:.2f} %".format, 100.0))
TURNS = (
    *(PHASE, FROM, TO),
    Column("turn", None, turn, parts=("about", "angle_rad")),
    Column("greatest sun angle [deg]", "sun_angle_rad", "{:.3f}".format, 180.0 / pi),
)


@lru_cache(maxsize=4)
def one_round(search: Search, rounds: int) -> Search:
    """Return the first round of a gathering's search; all rounds are alike."""
    return replace(search, legs=search.legs[: len(search.legs) // rounds])


@lru_cache(maxsize=16)  # tables and figures use the same values
def covered(search: Search, phase: str | None) -> float:
    """Return the share of the sky that one cone covers in a phase, or in the whole search; from 0 to 1."""
    return search.coverage(phase)


def facts(search: Search, duration: float, attained: SunAngle | None = None) -> Table:
    """Return the table of tips, sun angle and near field of a search of a given `duration` [s].

    `attained`: the sun angle with the errors of the spacecraft, if there are any.
    """
    rate, limit, tip = (degrees(x) for x in (search.slew_rate, search.sun_limit, search.tip_angle))
    sun = degrees(search.sun_drift) * duration / search.duration
    within = search.sun_angle <= search.sun_limit + ROUNDING if attained is None else attained.within
    asked, kept = "" if attained is None else ", as commanded", "respected" if within else "not respected"
    rows = [
        ("slew rate", f"{rate:g} deg/s"),
        ("tip angle", f"{tip:.3f} deg"),
        (f"sun limit, {kept} in every turn", f"{limit:g} deg"),
        (f"greatest angle between body x and the sun line{asked}", f"{degrees(search.sun_angle):.3f} deg"),
        *(() if attained is None else (("the same with the errors of the craft", told(attained)),)),
        (f"the sun's own motion in {duration:.1f} s at 1 AU", f"{sun:.3f} deg"),
        ("turn to the start attitude, before the search, at most", f"180 deg, {pi / search.slew_rate:.1f} s"),
        ("sky covered by one cone", f"{100 * covered(search, None):.2f} %"),
    ]
    if isinf(search.near_field):
        rows.append(("near field of a craft, where its cone never comes", "no end: tips too small"))
    elif search.near_field:
        waits = [leg.end - leg.start for leg in search.legs if leg.about == "none"]
        rows.append(("near field of a craft, where its cone never comes", f"{search.near_field:.1f} m"))
        rows += [("waits of the near-field search (NFS)", f"2 x {waits[0]:.1f} s")] if waits else []
        rows.append(("on the sun line two craft cannot lock within", f"{2.0 * search.near_field:.1f} m"))
    return Table("Search", (Column("quantity", words=True), Column("value")), rows)


def told(sun: SunAngle) -> str:
    """Return the largest sun angle of a spacecraft in words."""
    return f"{degrees(sun.angle):.3f} deg ({sun.craft})"


def phases(search: Search, rounds: int = 1) -> Table:
    """Return the table of phases of a search with the share of the sky that they cover."""
    rows = [
        ((name, number), start, end, f"{minutes(start)} - {minutes(end)}", covered(search, name))
        for name, number, start, end in search.phases
    ]
    title = f"Phases of one round, of {rounds} at most" if rounds > 1 else "Phases"
    return Table(f"{title}: {spelled(search)}", PHASES, rows)


def spelled(search: Search) -> str:
    """Return the full names of the phases."""
    names = dict.fromkeys(name for name, *_ in search.phases)
    return ", ".join(f"{name} {SPELLED[name]}" for name in names) + " search"


def turns(search: Search) -> Table:
    """Return the table of all turns of a search."""
    rows = [
        ((leg.phase, leg.round), leg.start, leg.end, (leg.about, leg.angle), leg.sun_angle)
        for leg in search.legs
    ]
    return Table("Turns", TURNS, rows, folded=True)


def figures(search: Search, attained: SunAngle | None = None) -> dict[str, Any]:
    """Return the figures of a search, or one round of a gathering: angles in radians, shares from 0 to 1."""
    names = dict.fromkeys(phase for phase, *_ in search.phases)
    return {
        "duration_s": search.duration,
        "slew_rate_rad_s": search.slew_rate,
        "tip_angle_rad": search.tip_angle,
        "sun_limit_rad": search.sun_limit,
        "sun_angle_rad": search.sun_angle,
        "sun_angle_with_errors_rad": None if attained is None else attained.angle,
        "sun_drift_rad": search.sun_drift,
        "longest_alignment_s": pi / search.slew_rate,
        "near_field_m": search.near_field,
        "near_field_of_pair_m": 2.0 * search.near_field,
        "coverage": {name or "all": covered(search, name) for name in (*names, None)},
        "phases": phases(search).records,
        "legs": turns(search).records,
    }


def since(result: StageResult[Any, Any]) -> tuple[str, ...]:
    """Return the line that states the origin of times, if the search does not start at zero."""
    return (f"Times count from the start of the search, at {result.start:.1f} s",) if result.start else ()


def watched(result: StageResult[Any, Any]) -> tuple[tuple[str, ...], tuple[Table, ...]]:
    """Return lines and tables of conflicts during a search, in times of the mission."""
    if not result.after.approaches:
        return ("Conflicts: not looked for, no craft has a keep_out",), ()
    return conflicts.summed("Conflicts", result.after)
