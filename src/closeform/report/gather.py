"""Section of a gathering: its search, its timeline, the delta-v of each spacecraft, and the final sets."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from closeform.mission.mission_result import Mission, StageResult
from closeform.mission.verdict import conflicts_in, conflicts_of
from closeform.report import conflicts, effort, search
from closeform.report.burns import StageBurns
from closeform.report.picture import Film, Picture
from closeform.report.section import Section, heading
from closeform.report.table import MOST_ROWS, PHASE, Column, Table, minutes
from closeform.scenario import Gather
from closeform.search.gather_result import Event, EventKind, Gathering, GatherStatus, listed

MOST_NAMES = 12  # maximum number of names on one line; larger sets are counted
MOMENTS = 6  # maximum number of times with a picture
FILMED, FRAMES = 200, 100  # maximum spacecraft in an animation, and its frames besides those of locks
BURNS = {
    EventKind.BURN: "burn, nulls its relative velocity",
    EventKind.CORRECTION: "correction, keeps clear of its set",
    EventKind.NEAR_FIELD: "near-field burn against its boresight",
}

Gathered = StageResult[Gather, Gathering]


def section(mission: Mission, result: Gathered) -> Section:
    """Return the section of a gathering, with its search, timeline, delta-v, conflicts and pictures."""
    gathering, names, rounds = result.result, result.after.names, result.stage.rounds
    history = timeline(gathering, names)
    once = search.one_round(gathering.search, rounds)
    knew = known(result)
    told, met = acquainted(result, knew)
    spent = spendings(mission, result)
    return Section(
        heading(result),
        (*search.since(result), *outcome(result), *told),
        (
            *((progress(gathering),) if history.folded else ()),
            *((history,) if history.rows else ()),
            with_total(spent),
            *ways(result),
            *met,
            search.facts(once, gathering.duration, result.sun),
            search.phases(once, rounds),
            search.turns(once),
            *conflicts.approaches("Closest approaches", result.after),
        ),
        closing=unjudged(mission, gathering),
        pictures=pictures(gathering, names, result.stage.animation),
        figures={"search": search.figures(once, result.sun), "gathering": figures(result, knew)},
        files={"events": history, "sets": spent} | StageBurns(mission, result).files,
    )


def unjudged(mission: Mission, gathering: Gathering) -> tuple[str, ...]:
    """Return a note that burns are impulses, if thrust is limited and spacecraft burn."""
    if not mission.scenario.newtons or not np.any(gathering.delta_v):
        return ()
    return ("Burns are impulses, which take no time: max_thrust is not looked at in this stage",)


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
        Column("who", words=True),
        Column("what", words=True),
        replace(speed(gathering), absent=""),
        Column(None, parts=("dvx_m_s", "dvy_m_s", "dvz_m_s")),
    )
    shared = halves(gathering)
    rows = []
    for moment in replayed(gathering):
        event, size = moment.event, None
        pair = names[event.first], names[event.second] if event.second >= 0 else None
        if event.kind is EventKind.LOCK:
            who, what = f"{pair[0]} - {pair[1]}", met(moment, pair)
        else:
            who, what, size = pair[0], BURNS[event.kind], float(np.linalg.norm(event.delta_v))
        if event in shared:
            what = "burn, nulls half of the relative velocity"
        phase, kind, push = (event.phase, event.round), str(event.kind), event.delta_v.tolist()
        rows.append(
            (event.time, event.time, kind, pair, phase, event.case, event.label, who, what, size, push)
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
    """Return a lock in words."""
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
    starts = {(name, number): start for name, number, start, _ in gathering.search.phases}
    rows = []
    for place in [None, *starts]:  # None: at once
        some = [moment for moment in moments if place == came(moment.event)]
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
    return Table("Progress, at the end of each phase in which something happened", columns, rows)


def came(event: Event) -> tuple[str, int] | None:
    """Return the phase and round of an event; None for an event at time 0."""
    return (event.phase, event.round) if event.time > 0.0 else None


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
        effort.in_grams(mission, effort.FUEL) if known else replace(effort.FUEL, heading=None),
    )
    return Table("Delta-v of each craft", columns, rows, folded=len(names) > MOST_ROWS)


def with_total(spent: Table) -> Table:
    """Return the table with a last row for all spacecraft."""
    burns, speeds, fuels = ([row[k] for row in spent.rows] for k in (3, 4, 5))
    fuel = None if None in fuels else sum(fuels)
    return replace(spent, rows=[*spent.rows, ("all", "", None, sum(burns), sum(speeds), fuel)])


def chosen(result: Gathered) -> str:
    """Return "flown" for the first pair's choice, or "planned" if burns have errors or thrust is lost."""
    return "flown" if result.commanded is None else "planned"


def ways(result: Gathered) -> tuple[Table, ...]:
    """Return the total delta-v of exact burns for each way in which the first pair can burn."""
    gathering, names = result.result, result.after.names
    first = first_lock(gathering)
    if first is None:
        return ()
    low, high = names[first.first], names[first.second]
    words = {"second": f"second: {high} burns, {low} holds", "first": f"first: {low} burns, {high} holds"}
    rows = [
        (words.get(way, "half: half each"), total, chosen(result) if way == gathering.burns else "")
        for way, total in gathering.totals.items()
    ]
    columns = Column("the first pair", words=True), speed(gathering, " of all craft"), Column("")
    as_planned = ", as planned" * (result.commanded is not None)
    return (Table(f"Three ways of the first pair{as_planned}", columns, rows),)


def known(result: Gathered) -> list[bool]:
    """Return whether the two spacecraft of each conflict were in one set when it began."""
    place = {name: k for k, name in enumerate(result.after.names)}
    return [
        result.result.known(place[met.first], place[met.second], met.start - result.start)
        for met in result.after.conflicts
    ]


def acquainted(result: Gathered, knew: list[bool]) -> tuple[tuple[str, ...], tuple[Table, ...]]:
    """Return conflicts as a line, and as a table with a column on whether the two knew each other."""
    lines, tables = search.watched(result)
    if not tables:
        return lines, tables
    (table,) = tables
    columns = *table.columns, Column("known", form=lambda yes: "yes" if yes else "no")
    rows = [(*row, yes) for row, yes in zip(table.rows, knew, strict=True)]
    count = conflicts_of(*conflicts_in([result.after]))
    line = f"{count}, {knew.count(False)} with craft still unknown"
    return (line,), (Table(table.title, columns, rows, folded=len(rows) > MOST_ROWS),)


def outcome(result: Gathered) -> Iterator[str]:
    """Yield the final status of a gathering and its sets."""
    gathering, names = result.result, result.after.names
    whole, rest = divmod(gathering.duration, 60.0)
    begun = f"round {gathering.rounds} of at most {result.stage.rounds}"
    time = f"after {gathering.duration:.2f} s ({whole:.0f} min {rest:.1f} s), {begun}"
    if gathering.status is GatherStatus.INCOMPLETE:
        yield from incomplete(gathering, names, time)
    else:
        last = gathering.events[-1]
        yield f"Gathered {time}, in {last.phase} {last.round}"
        yield f"One formation set of all {len(names)} craft"
    if gathering.adrift:
        who = listed([names[k] for k in gathering.adrift])
        yield f"Adrift in the formation set, without the thrust to fly along: {who}"
    cheapest = min(gathering.totals.values())
    if result.stage.burns == "least" and gathering.totals[gathering.burns] > cheapest * (1.0 + 1e-9):
        way = f"The way {chosen(result)}"
        yield f"{way} is not the cheapest of three because the cheaper ones leave more craft"
    if len(names) > MOST_ROWS:
        yield share(gathering, names)


def incomplete(gathering: Gathering, names: Sequence[str], time: str) -> Iterator[str]:
    """Yield the sets and the lost spacecraft at the end of an incomplete gathering."""
    yield f"Incomplete {time}"
    for k, some in enumerate(gathering.sets):
        who = f"{len(some)} craft" if len(some) > MOST_NAMES else listed([names[i] for i in some])
        yield f"Knowledge set: {who}" if k else f"Formation set: {who}"
    if gathering.lost:
        yield f"Lost: {listed([names[k] for k in gathering.lost])}"


def share(gathering: Gathering, names: Sequence[str]) -> str:
    """Return the total, mean and maximum delta-v in words."""
    size, unit = speed_unit(gathering)
    each = gathering.delta_v / size
    most = int(np.argmax(each))
    shares = f"{each.mean():.1f} {unit} each on average, {each[most]:.1f} {unit} at most ({names[most]})"
    return f"Delta-v: {each.sum():.1f} {unit} in all, {shares}"


def speed_unit(gathering: Gathering) -> tuple[float, str]:
    """Return the unit of delta-v: its size in m/s and its name."""
    return (1.0, "m/s") if gathering.delta_v.sum() >= 100.0 else (1e-3, "mm/s")


def speed(gathering: Gathering, whose: str = "") -> Column:
    """Return a column of delta-v."""
    size, unit = speed_unit(gathering)
    return Column(f"delta-v{whose} [{unit}]", None, "{:.1f}".format, 1.0 / size)


def figures(result: Gathered, knew: list[bool]) -> dict[str, Any]:
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
        "sets": [[names[k] for k in some] for some in gathering.sets],
        "lost": [names[k] for k in gathering.lost],
        "adrift": [names[k] for k in gathering.adrift],
        "locks": sum(event.kind is EventKind.LOCK for event in gathering.events),
        "burns_count": sum(event.kind is not EventKind.LOCK for event in gathering.events),
        "conflicts_known": knew,
    }


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
        found.append(Film("gathering", caption, "gathering_views.reel", (gathering,), options, most=FILMED))
    for k, time in enumerate(moments(gathering), 1):
        caption = f"{time:.2f} s ({minutes(time)} min:s) after the start of the search"
        found.append(Picture(f"view-{k}", caption, "three_views", (gathering, time), {"names": names}))
    return tuple(found)
