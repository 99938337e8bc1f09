"""Sections of the stages that search: first locks and gatherings."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import degrees, isinf, pi
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import FirstLocks, Mission, StageResult
from closeform.mission.verdict import SunAngle, conflicts_in, conflicts_of
from closeform.report.description import (
    MOST_ROWS,
    PAIR,
    PHASE,
    TOTAL,
    Column,
    Section,
    Table,
    counted,
    heading,
    minutes,
)
from closeform.report.picture import Film, Picture
from closeform.report.sections import conflicts, effort
from closeform.scenario import Gather, Lock
from closeform.search.gathering.result import Event, EventKind, Gathering, GatherStatus, listed
from closeform.search.leg import SPELLED
from closeform.search.lock_statistics import count_by_phase, phase_labels
from closeform.search.schedule import Search

ROUNDING = 1e-9  # rad
RESIDUAL = 1e-9  # m/s, above the rounding of velocities
FROM, TO = (
    Column(f"{word} [s]", key, "{:.1f}".format, since="stage")
    for word, key in (("from", "start_s"), ("to", "end_s"))
)


def turn(about: str, angle: float) -> str:
    """Return a turn as text."""
    return "wait" if about == "none" else f"{degrees(angle):+.3f} deg about the {about}"


PHASES = (PHASE, FROM, TO, Column("[min:s]"), Column("sky covered", None, "{:.2f} %".format, 100.0))
TURNS = (
    *(PHASE, FROM, TO),
    Column("turn", None, turn, parts=("about", "angle_rad")),
    Column("largest sun angle [deg]", "sun_angle_rad", "{:.3f}".format, 180.0 / pi),
)


@lru_cache(maxsize=4)
def one_round(search: Search, rounds: int) -> Search:
    """Return the first round of a gathering's search; all rounds are alike."""
    return replace(search, legs=search.legs[: len(search.legs) // rounds])


@lru_cache(maxsize=16)  # tables and figures use the same values
def covered(search: Search, phase: str | None) -> float:
    """Return the fraction of the sky that one cone covers in a phase, or in the whole search; from 0 to 1."""
    return search.coverage(phase)


def facts(search: Search, duration: float, attained: SunAngle | None = None) -> Table:
    """Return the table of tips, sun angle and near field of a search of a given `duration` [s].

    `attained`: the sun angle with the errors of the spacecraft, if there are any.
    """
    rate, limit, tip, sun = map(
        degrees, (search.slew_rate, search.sun_limit, search.tip_angle, search.sun_angle)
    )
    within = search.sun_angle <= search.sun_limit + ROUNDING if attained is None else attained.within
    angle, commanded = (
        "largest angle between body x and the sun line",
        ", as commanded" * (attained is not None),
    )
    motion = degrees(search.sun_drift) * duration / search.duration
    rows = [
        ("slew rate", f"{rate:g} deg/s"),
        ("tip angle", f"{tip:.3f} deg"),
        (f"sun limit, {'kept' if within else 'not kept'} in every turn", f"{limit:g} deg"),
        (f"{angle}{commanded}", f"{sun:.3f} deg"),
    ]
    if attained is not None:
        rows.append((f"{angle}, with errors", f"{degrees(attained.angle):.3f} deg ({attained.craft})"))
    rows += [
        (f"motion of the sun in {duration:.1f} s at 1 AU", f"{motion:.3f} deg"),
        ("turn to the start attitude before the search, at most", f"180 deg, {pi / search.slew_rate:.1f} s"),
        ("sky covered by one cone", f"{100 * covered(search, None):.2f} %"),
    ]
    if not (sensor := search.sensor)._exact:
        measured = f"{sensor.range_error:g} m, {degrees(sensor.bearing_error):g} deg"
        rows.append((f"range and bearing errors of two fixes {sensor.fix_interval:g} s apart", measured))
    near = "near field of a craft, never covered by its cone"
    if isinf(search.near_field):
        rows.append((near, "unbounded: tips too small"))
    elif search.near_field:
        rows.append((near, f"{search.near_field:.1f} m"))
        if waits := [leg.end - leg.start for leg in search.legs if leg.about == "none"]:
            rows.append(("waits of the near-field search (NFS)", f"2 x {waits[0]:.1f} s"))
        rows.append(("two craft on the sun line cannot lock within", f"{2.0 * search.near_field:.1f} m"))
    return Table("Search", (Column("quantity", words=True), Column("value")), rows)


def phases(search: Search, rounds: int = 1) -> Table:
    """Return the table of phases of a search with the fraction of the sky that they cover."""
    rows = [
        ((name, number), start, end, f"{minutes(start)} - {minutes(end)}", covered(search, name))
        for name, number, start, end in search.phases
    ]
    title = f"Phases of one round, of {rounds} at most" if rounds > 1 else "Phases"
    names = dict.fromkeys(name for name, *_ in search.phases)
    spelled = ", ".join(f"{name} {SPELLED[name]}" for name in names)
    return Table(f"{title}: {spelled} search", PHASES, rows)


def turns(search: Search) -> Table:
    """Return the table of all turns of a search."""
    rows = [
        ((leg.phase, leg.round), leg.start, leg.end, (leg.about, leg.angle), leg.sun_angle)
        for leg in search.legs
    ]
    return Table("Turns", TURNS, rows, folded=True)


def search_figures(search: Search, attained: SunAngle | None = None) -> dict[str, Any]:
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
    """Return lines and tables of conflicts during a search; times count from the start of the mission."""
    if not result.after.approaches:
        return ("Conflicts: not evaluated, no craft has a keep_out",), ()
    return conflicts.summed("Conflicts", result.after)


LOCKS = (
    replace(PAIR, key=None),
    Column("at [s]", "time_s", "{:.2f}".format, absent="never", since="stage"),
    Column("[min:s]", None, minutes),
    replace(PHASE, words=False),
)


def lock(mission: Mission, result: StageResult[Lock, FirstLocks]) -> Section:
    """Return the section of first locks, sorted by time; pairs that never lock come last."""
    found, names = result.result, result.after.names
    times = found.locks.time[found.locks.leg >= 0]
    last, pairs = float(times.max()) if len(times) else None, len(found.pairs)
    locks = Table("First locks", LOCKS, [lock_row(found, k, names) for k in range(pairs)])
    order = np.argsort(found.locks.time, kind="stable")
    shown = replace(locks, rows=[locks.rows[k] for k in order], folded=pairs > MOST_ROWS)
    outcome = f"{len(times)} of {counted(pairs, 'pair')} lock{'s' * (pairs == 1)}"
    outcome += "" if last is None else f", the last at {last:.2f} s"
    tables = [shown]
    if shown.folded:
        counts = zip(
            phase_labels(found.search),
            count_by_phase(found.search, found.locks.time, found.locks.leg),
            strict=True,
        )
        columns = Column("phase", words=True), Column("pairs")
        tables.insert(0, Table("First locks by phase", columns, list(counts)))
    met, conflict_tables = watched(result)
    asked = "" if mission.scenario.search_errors is None else ", as commanded, without errors"
    return Section(
        heading(result),
        (*since(result), outcome, *met),
        (
            *tables,
            *conflict_tables,
            facts(found.search, found.search.duration, result.sun),
            phases(found.search),
            turns(found.search),
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
        figures={
            "search": search_figures(found.search, result.sun),
            "locks": {  # times count from the start of the stage
                "pairs": pairs,
                "locked": len(times),
                "last_s": last,
                "missing": [[names[i], names[j]] for i, j in found.missing],
            },
        },
        files={"locks": locks},
    )


def locks_of(found: Any) -> list[tuple[float, int, int]]:
    """Return the locks of a stage, none if it does not search: time from its start [s] and the two craft."""
    if isinstance(found, Gathering):
        return [
            (event.time, event.first, event.second) for event in found.events if event.kind is EventKind.LOCK
        ]
    if isinstance(found, FirstLocks):
        met = np.flatnonzero(found.locks.leg >= 0)
        pairs, times = found.pairs[met].tolist(), found.locks.time[met].tolist()
        return [(time, first, second) for time, (first, second) in zip(times, pairs, strict=True)]
    return []


def lock_row(found: FirstLocks, k: int, names: tuple[str, ...]) -> tuple[Any, ...]:
    """Return a row of LOCKS for pair k, with None for a pair that never locks."""
    (one, other), leg = found.pairs[k], int(found.locks.leg[k])
    pair = names[one], names[other]
    if leg < 0:
        return pair, None, None, None
    time, turn = float(found.locks.time[k]), found.search.legs[leg]
    return pair, time, time, (turn.phase, turn.round)


MOST_NAMES = 12  # maximum number of names on one line; larger sets are counted
MOMENTS = 6  # maximum number of times with a picture
FILMED, FRAMES = 200, 100  # maximum spacecraft in an animation, and its frames besides those of locks
BURNS = {
    EventKind.BURN: "burn, nulls its relative velocity",
    EventKind.CORRECTION: "correction, keeps clear of its set",
    EventKind.NEAR_FIELD: "near-field burn against its boresight",
}

Gathered = StageResult[Gather, Gathering]


def gather(mission: Mission, result: Gathered) -> Section:
    """Return the section of a gathering, with its search, timeline, delta-v, conflicts and pictures."""
    gathering, names, rounds = result.result, result.after.names, result.stage.rounds
    history = timeline(gathering, names)
    once = one_round(gathering.search, rounds)
    known = acquaintances(result)
    lines, met = acquainted(result, known)
    spent = spendings(mission, result)
    burns, speeds, fuels = ([row[k] for row in spent.rows] for k in (3, 4, 5))
    total = TOTAL, "", None, sum(burns), sum(speeds), None if None in fuels else sum(fuels)
    impulses = "Burns are impulses, which take no time: max_thrust does not apply to this stage"
    return Section(
        heading(result),
        (*since(result), *ended(result), *lines),
        (
            *((progress(gathering),) if history.folded else ()),
            *((history,) if history.rows else ()),
            replace(spent, rows=[*spent.rows, total]),
            *ways(result),
            *met,
            facts(once, gathering.duration, result.sun),
            phases(once, rounds),
            turns(once),
            *conflicts.approaches("Closest approaches", result.after),
        ),
        closing=(impulses,) * bool(mission.scenario.newtons and np.any(gathering.delta_v)),
        pictures=pictures(gathering, names, result.stage.animation),
        figures={"search": search_figures(once, result.sun), "gathering": gather_figures(result, known)},
        files={"events": history, "sets": spent} | effort.StageBurns(mission, result).files,
    )


@dataclass(frozen=True)
class EventMoment:
    """Event with the labels of its two spacecraft before it, and the labels of all spacecraft after it."""

    event: Event
    before: tuple[int, int]
    labels: tuple[int, ...]


def replayed(gathering: Gathering) -> Iterator[EventMoment]:
    """Yield each event with the labels around it: -1 lost, 0 the formation set, k knowledge set k."""
    history = gathering.history.tolist()
    for event, before, after in zip(gathering.events, history[:-1], history[1:], strict=True):
        yield EventMoment(event, (before[event.first], before[event.second]), tuple(after))


def timeline(gathering: Gathering, names: Sequence[str]) -> Table:
    """Return the table of all events; times count from the start of the stage."""
    columns = (
        Column("at [s]", "time_s", "{:.2f}".format, since="stage"),
        Column("[min:s]", None, minutes),
        Column(None, "kind"),
        Column(None, parts=("first", "second")),
        PHASE,
        Column(None, "case"),
        Column(None, "label"),
        Column("craft", words=True),
        Column("event", words=True),
        replace(speed(gathering), absent=""),
        Column(None, parts=("dvx_m_s", "dvy_m_s", "dvz_m_s")),
    )
    shared = halves(gathering)
    rows = []
    for moment in replayed(gathering):
        event, size = moment.event, None
        pair = names[event.first], names[event.second] if event.second >= 0 else None
        if event.kind is EventKind.LOCK:
            craft, what = f"{pair[0]} - {pair[1]}", met(moment, pair)
        else:
            craft, what, size = pair[0], BURNS[event.kind], float(np.linalg.norm(event.delta_v))
        if event in shared:
            what = "burn, nulls half of the relative velocity"
        phase, kind, push = (event.phase, event.round), str(event.kind), event.delta_v.tolist()
        rows.append(
            (event.time, event.time, kind, pair, phase, event.case, event.label, craft, what, size, push)
        )
    return Table("Timeline", columns, rows, folded=len(rows) > MOST_ROWS)


def first_lock(gathering: Gathering) -> Event | None:
    """Return the lock that begins the formation set; None if there is no lock."""
    return next((event for event in gathering.events if event.kind is EventKind.LOCK), None)


def halves(gathering: Gathering) -> list[Event]:
    """Return the burns by which the first pair splits its relative velocity, if both spacecraft can burn."""
    first = first_lock(gathering)
    if first is None or gathering.burns != "half":
        return []
    pair = first.first, first.second
    burns = [event for event in gathering.events if event.kind is EventKind.BURN and event.first in pair]
    return burns if len(burns) == len(pair) else []


def met(moment: EventMoment, pair: Sequence[str | None]) -> str:
    """Return a lock as text."""
    label, before = moment.event.label, moment.before
    goal = f"knowledge set {label}" if label else "the formation set"
    if max(before) < 0:
        return f"lock, {goal} begins"
    if min(before) < 0:
        return f"lock, {pair[before.index(-1)]} joins {goal}"
    return f"lock, knowledge set {max(before)} joins {goal}"


def progress(gathering: Gathering) -> Table:
    """Return the table of events in each phase, and of the sets at its end."""
    moments = list(replayed(gathering))
    places = [(one.event.phase, one.event.round) if one.event.time > 0.0 else None for one in moments]
    starts = {(name, number): start for name, number, start, _ in gathering.search.phases}
    rows = []
    for place in [None, *starts]:  # None: at once
        some = [moment for moment, its in zip(moments, places, strict=True) if its == place]
        if not some:
            continue
        labels = some[-1].labels
        burns = [moment.event for moment in some if moment.event.kind is not EventKind.LOCK]
        spent = sum(float(np.linalg.norm(event.delta_v)) for event in burns)
        inside, lost, sets = labels.count(0), labels.count(-1), len(set(labels) - {0, -1})
        held = f"{len(labels) - inside - lost} in {sets}"
        start = starts[place] if place else 0.0
        rows.append((place, start, len(some) - len(burns), len(burns), spent, inside, held, lost))
    columns = (
        replace(PHASE, absent="at once"),
        Column("from [s]", form="{:.1f}".format, since="stage"),
        *(Column("locks"), Column("burns"), speed(gathering)),
        *(Column("formation set"), Column("knowledge sets"), Column("lost")),
    )
    return Table("Progress at the end of each phase with events", columns, rows)


def spendings(mission: Mission, result: Gathered) -> Table:
    """Return each spacecraft's delta-v and final set: 0 the formation set, k a knowledge set, -1 lost."""
    gathering, names = result.result, result.after.names
    burnt = mission.propellant[result.number - 1].tolist()
    known = np.isfinite(burnt).any()
    burns = [0] * len(names)
    for event in gathering.events:
        burns[event.first] += event.kind is not EventKind.LOCK
    label = {k: number for number, some in enumerate(gathering.sets) for k in some}
    rows = [
        (name, group, label.get(k, -1), burns[k], float(gathering.delta_v[k]), burnt[k] if known else None)
        for k, (name, group) in enumerate(zip(names, gathering.groups, strict=True))
    ]
    columns = (
        Column("craft", "craft", words=True),
        Column("group", "group"),
        Column(None, "set"),
        Column("burns"),
        replace(speed(gathering), key="delta_v_m_s"),
        effort.in_grams(mission, effort.FUEL),
    )
    return Table("Delta-v of each craft", columns, rows, folded=len(names) > MOST_ROWS, idle=effort.UNUSED)


def choice(result: Gathered) -> str:
    """Return "executed" for the first pair's choice, or "planned" if burns have errors or thrust is lost."""
    return "executed" if result.commanded is None else "planned"


def ways(result: Gathered) -> tuple[Table, ...]:
    """Return the total delta-v of exact burns for each way in which the first pair can burn."""
    gathering, names = result.result, result.after.names
    first = first_lock(gathering)
    if first is None:
        return ()
    low, high = names[first.first], names[first.second]
    chosen = choice(result)
    words = {"second": f"second: {high} burns, {low} holds", "first": f"first: {low} burns, {high} holds"}
    rows = [
        (words.get(way, "half: each burns half"), total, chosen if way == gathering.burns else "")
        for way, total in gathering.totals.items()
    ]
    columns = Column("first pair", words=True), speed(gathering, " of all craft"), Column("")
    as_planned = ", as planned" * (result.commanded is not None)
    return (Table(f"Burns of the first pair: three options{as_planned}", columns, rows),)


def acquaintances(result: Gathered) -> list[bool]:
    """Return whether the two spacecraft of each conflict were in one set when it began."""
    place = {name: k for k, name in enumerate(result.after.names)}
    return [
        result.result.known(place[met.first], place[met.second], met.start - result.start)
        for met in result.after.conflicts
    ]


def acquainted(result: Gathered, known: list[bool]) -> tuple[tuple[str, ...], tuple[Table, ...]]:
    """Return conflicts as a line, and as a table with a column on whether the two knew each other."""
    lines, tables = watched(result)
    if not tables:
        return lines, tables
    (table,) = tables
    columns = *table.columns, Column("known", form=lambda yes: "yes" if yes else "no")
    rows = [(*row, yes) for row, yes in zip(table.rows, known, strict=True)]
    count = conflicts_of(*conflicts_in([result.after]))
    line = f"{count}, {known.count(False)} between craft in different sets"
    return (line,), (Table(table.title, columns, rows, folded=len(rows) > MOST_ROWS),)


def ended(result: Gathered) -> Iterator[str]:
    """Yield the final status of a gathering and its sets."""
    gathering, names = result.result, result.after.names
    whole, rest = divmod(gathering.duration, 60.0)
    begun = f"round {gathering.rounds} of at most {result.stage.rounds}"
    time = f"after {gathering.duration:.2f} s ({whole:.0f} min {rest:.1f} s), {begun}"
    if gathering.status is GatherStatus.INCOMPLETE:
        yield f"Incomplete {time}"
        for k, some in enumerate(gathering.sets):
            craft = f"{len(some)} craft" if len(some) > MOST_NAMES else listed([names[i] for i in some])
            yield f"{'Knowledge' if k else 'Formation'} set: {craft}"
        if gathering.lost:
            yield f"Lost: {listed([names[k] for k in gathering.lost])}"
    else:
        last = gathering.events[-1]
        yield f"Gathered {time}, in {last.phase} {last.round}"
        yield f"One formation set of all {len(names)} craft"
    if gathering.adrift:
        adrift = listed([names[k] for k in gathering.adrift])
        yield f"Adrift in the formation set, without thrust: {adrift}"
    if gathering.sets and (residual := float(np.nanmax(gathering.residual_speeds))) > RESIDUAL:
        yield f"Residual velocity within the formation set: at most {1e3 * residual:.3f} mm/s"
    if gathering.sets and (off := float(np.nanmax(gathering.position_errors))) > 0.0:
        yield f"Error of estimated positions in the formation set: at most {off:.3f} m"
    lowest = min(gathering.totals.values())
    if result.stage.burns == "least" and gathering.totals[gathering.burns] > lowest * (1.0 + 1e-9):
        yield f"The option {choice(result)} is not the one of lowest cost, which leaves more craft lost"
    if len(names) > MOST_ROWS:
        size, unit = speed_unit(gathering)
        each = gathering.delta_v / size
        most = int(np.argmax(each))
        shares = f"{each.mean():.1f} {unit} each on average, {each[most]:.1f} {unit} at most ({names[most]})"
        yield f"Delta-v: {each.sum():.1f} {unit} in all, {shares}"


def speed_unit(gathering: Gathering) -> tuple[float, str]:
    """Return the unit of delta-v: its size in m/s and its name."""
    return (1.0, "m/s") if gathering.delta_v.sum() >= 100.0 else (1e-3, "mm/s")


def speed(gathering: Gathering, whose: str = "") -> Column:
    """Return a column of delta-v."""
    size, unit = speed_unit(gathering)
    return Column(f"delta-v{whose} [{unit}]", None, "{:.1f}".format, 1.0 / size)


def gather_figures(result: Gathered, known: list[bool]) -> dict[str, Any]:
    """Return the figures of a gathering; times count from the start of the stage."""
    gathering, names = result.result, result.after.names
    return {
        "ok": gathering.ok,
        "status": str(gathering.status),
        "reason": result.failure,
        "duration_s": gathering.duration,
        "rounds": gathering.rounds,
        "sun_motion_rad": gathering.search.sun_drift * gathering.duration / gathering.search.duration,
        "burns": gathering.burns,
        "totals_m_s": gathering.totals,
        "delta_v_m_s": dict(zip(names, gathering.delta_v.tolist(), strict=True)),
        "total_delta_v_m_s": float(gathering.delta_v.sum()),
        "residual_speed_m_s": formed(gathering.residual_speeds, names),
        "position_error_m": formed(gathering.position_errors, names),
        "estimate_errors": dict(zip(names, gathering.estimates.tolist(), strict=True)),  # m, m/s
        "sets": [[names[k] for k in some] for some in gathering.sets],
        "lost": [names[k] for k in gathering.lost],
        "adrift": [names[k] for k in gathering.adrift],
        "known_locks": [
            [one.time, names[one.first], names[one.second], one.phase, one.round, one.case, one.label]
            for one in gathering.known_locks
        ],
        "locks": sum(event.kind is EventKind.LOCK for event in gathering.events),
        "burns_count": sum(event.kind is not EventKind.LOCK for event in gathering.events),
        "conflicts_known": known,
    }


def formed(values: Floats, names: Sequence[str]) -> dict[str, float]:
    """Return the values of the spacecraft in the formation set by their names; the others are nan."""
    return {name: float(one) for name, one in zip(names, values, strict=True) if not np.isnan(one)}


def moments(gathering: Gathering) -> list[float]:
    """Return the key moments of a gathering, at most MOMENTS times [s].

    The first lock and the end come first, then locks by the number of spacecraft that join the formation
    set, then locks that begin another set, then the rest.
    """
    locks = [event for event in gathering.events if event.kind is EventKind.LOCK]
    joins = [event.time for event in gathering.events if event.kind is EventKind.BURN]
    ranked = sorted(locks, key=lambda lock: (-joins.count(lock.time), lock.case != 1, lock.time))
    times = [*(lock.time for lock in locks[:1]), gathering.duration, *(lock.time for lock in ranked)]
    return sorted(list(dict.fromkeys(times))[:MOMENTS])


def pictures(gathering: Gathering, names: Sequence[str], moving: bool) -> tuple[Picture, ...]:
    """Return the animation of a gathering, if requested, and three views at its key moments."""
    found: list[Picture] = []
    if moving:
        caption = "The gathering from the start of its search to its end"
        options = {"names": names, "frames": FRAMES}
        found.append(Film("gathering", caption, "animation", (gathering,), options, most=FILMED))
    for k, time in enumerate(moments(gathering), 1):
        caption = f"{time:.2f} s ({minutes(time)} min:s) after the start of the search"
        found.append(Picture(f"view-{k}", caption, "three_views", (gathering, time), {"names": names}))
    return tuple(found)
