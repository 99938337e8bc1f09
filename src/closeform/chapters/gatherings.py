"""The chapter of a gathering: its search, its timeline, what everybody spent, who is where at the end."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from closeform.chapters.moves import nearest
from closeform.chapters.searches import MOST_ROWS, facts, one_round, phases, since, stays
from closeform.chapters.sheet import Chapter, Sheet, counted, minutes
from closeform.conflicts.flight import Encounter
from closeform.scenario import Gather
from closeform.search.gathering import Event, EventKind, Gathering, listed
from closeform.stage_results import Leg

MOST_NAMES = 12  # of a set on one line; larger ones are counted


def gathered(title: str, leg: Leg, gathering: Gathering) -> Chapter:
    """A gathering."""
    names = leg.after.names
    history = timeline(gathering, names)
    long = len(history.rows) > MOST_ROWS
    stage = leg.stage
    if not isinstance(stage, Gather):
        raise TypeError(f"stage {leg.number}: {leg.verb} gathers nobody")
    search = one_round(gathering.search, stage.rounds)
    told, conflicts = acquainted(leg, gathering)
    sheets = (
        *((progress(gathering),) if long else ()),
        *((replace(history, more=long),) if history.rows else ()),
        spent(gathering, names),
        *ways(gathering, names),
        *conflicts,
        facts(search, gathering.duration),
        *phases(search, stage.rounds),
        *nearest("Closest approaches", leg.after),
    )
    return Chapter(title, (*since(leg), *outcome(gathering, names, stage), *told), sheets)


@dataclass(frozen=True)
class Moment:
    """An event, the labels that its two craft had before it, and everybody's after it."""

    event: Event
    before: tuple[int, int]
    labels: tuple[int, ...]


def replayed(gathering: Gathering) -> Iterator[Moment]:
    """Every event with the sets before and after it; -1 lost, 0 the formation set, k knowledge set k."""
    history = gathering.history.tolist()
    for event, before, after in zip(gathering.events, history[:-1], history[1:], strict=True):
        yield Moment(event, (before[event.first], before[event.second]), tuple(after))


def timeline(gathering: Gathering, names: Sequence[str]) -> Sheet:
    """Every event in words."""
    unit, called = speed_unit(gathering)
    rows = []
    first = next((event.time for event in gathering.events if event.kind is EventKind.BURN), None)
    for moment in replayed(gathering):
        event, who = moment.event, names[moment.event.first]
        what, size = BURNS.get(event.kind, ""), f"{np.linalg.norm(event.delta_v) / unit:.1f}"
        if event.kind is EventKind.LOCK:
            pair = who, names[event.second]
            who, what, size = " - ".join(pair), met(moment, pair), ""
        elif event.kind is EventKind.BURN and gathering.burns == "half" and event.time == first:
            what = "burn, nulls half of the relative velocity"
        phase = f"{event.phase} {event.round}"
        rows.append((f"{event.time:.2f}", minutes(event.time), phase, who, what, size))
    columns = ("at [s]", "[min:s]", "phase", "who", "what", f"delta-v [{called}]")
    return Sheet("Timeline", columns, tuple(rows), texts=(2, 3, 4))


BURNS = {
    EventKind.BURN: "burn, nulls its relative velocity",
    EventKind.CORRECTION: "correction, keeps clear of its set",
    EventKind.NEAR_FIELD: "near-field burn against its boresight",
}


def met(moment: Moment, pair: tuple[str, str]) -> str:
    """A lock in words."""
    label, before = moment.event.label, moment.before
    goal = f"knowledge set {label}" if label else "the formation set"
    if max(before) < 0:
        return f"lock, {goal} begins" if label else f"lock, kernel of {goal}"
    if min(before) < 0:
        return f"lock, {pair[before.index(-1)]} joins {goal}"
    return f"lock, knowledge set {max(before)} joins {goal}"


def progress(gathering: Gathering) -> Sheet:
    """What happened in each phase, and who was where at its end."""
    unit, called = speed_unit(gathering)
    moments = list(replayed(gathering))
    starts = {(name, number): start for name, number, start, _ in gathering.search.phases}
    rows = []
    for place in [None, *starts]:  # None: at once
        some = [moment for moment in moments if place == came(moment.event)]
        if not some:
            continue
        labels = some[-1].labels
        burns = [moment.event for moment in some if moment.event.kind is not EventKind.LOCK]
        speed = sum(float(np.linalg.norm(event.delta_v)) for event in burns)
        inside, lost, sets = labels.count(0), labels.count(-1), len(set(labels) - {0, -1})
        rows.append(
            (
                f"{place[0]} {place[1]}" if place else "at once",
                f"{starts[place] if place else 0.0:.1f}",
                str(len(some) - len(burns)),
                str(len(burns)),
                f"{speed / unit:.1f}",
                str(inside),
                f"{len(labels) - inside - lost} in {sets}",
                str(lost),
            )
        )
    columns = (
        *("phase", "from [s]", "locks", "burns", f"delta-v [{called}]"),
        *("formation set", "knowledge sets", "lost"),
    )
    return Sheet("Progress, at the end of each phase in which something happened", columns, tuple(rows))


def came(event: Event) -> tuple[str, int] | None:
    """The phase of an event; None for what happens at once."""
    return (event.phase, event.round) if event.time > 0.0 else None


def spent(gathering: Gathering, names: Sequence[str]) -> Sheet:
    """Delta-v of each craft."""
    unit, called = speed_unit(gathering)
    burns = [0] * len(names)
    for event in gathering.events:
        burns[event.first] += event.kind is not EventKind.LOCK
    rows: list[tuple[str, ...]] = [
        (name, group, str(count), f"{size / unit:.1f}")
        for name, group, count, size in zip(names, gathering.groups, burns, gathering.delta_v, strict=True)
    ]
    rows.append(("all", "", str(sum(burns)), f"{gathering.delta_v.sum() / unit:.1f}"))
    columns = ("craft", "group", "burns", f"delta-v [{called}]")
    return Sheet("Delta-v of each craft", columns, tuple(rows), len(names) > MOST_ROWS)


def ways(gathering: Gathering, names: Sequence[str]) -> tuple[Sheet, ...]:
    """What all craft spend for each way in which the first pair can burn."""
    kernel = next((event for event in gathering.events if event.kind is EventKind.LOCK), None)
    if kernel is None:
        return ()
    unit, called = speed_unit(gathering)
    low, high = names[kernel.first], names[kernel.second]
    words = {"second": f"second: {high} burns, {low} holds", "first": f"first: {low} burns, {high} holds"}
    rows = tuple(
        (words.get(way, "half: half each"), f"{total / unit:.1f}", "flown" if way == gathering.burns else "")
        for way, total in gathering.totals.items()
    )
    columns = ("the first pair", f"delta-v of all craft [{called}]", "")
    return (Sheet("Three ways of the first pair", columns, rows),)


def acquainted(leg: Leg, gathering: Gathering) -> tuple[tuple[str, ...], tuple[Sheet, ...]]:
    """Conflicts as a line, and as a sheet that says whether the two craft knew each other."""
    lines, sheets = stays(leg)
    if not sheets:
        return lines, sheets
    (sheet,) = sheets
    known = [knew for _, knew in conflicts_known(leg, gathering)]
    rows = tuple((*row, "yes" if knew else "no") for row, knew in zip(sheet.rows, known, strict=True))
    line = f"{counted(len(known), 'conflict')}, {known.count(False)} with craft still unknown"
    return (line,), (Sheet(sheet.title, (*sheet.columns, "known"), rows, len(rows) > MOST_ROWS),)


def conflicts_known(leg: Leg, gathering: Gathering) -> list[tuple[Encounter, bool]]:
    """Every conflict, and whether the two craft were in one set by then."""
    place = {name: k for k, name in enumerate(leg.after.names)}
    return [
        (
            met,
            gathering.known(place[met.first], place[met.second], met.conflict.start - leg.start),
        )
        for met in leg.after.encounters
    ]


def outcome(gathering: Gathering, names: Sequence[str], stage: Gather) -> Iterator[str]:
    """How it ended, and who is where."""
    whole, rest = divmod(gathering.duration, 60.0)
    begun = f"round {gathering.rounds} of at most {stage.rounds}"
    time = f"after {gathering.duration:.2f} s ({whole:.0f} min {rest:.1f} s), {begun}"
    if gathering.ok:
        last = gathering.events[-1]
        yield f"Gathered {time}, in {last.phase} {last.round}"
        yield f"One formation set of all {len(names)} craft"
    else:
        yield from incomplete(gathering, names, time)
    cheapest = min(gathering.totals.values())
    if stage.burns == "least" and gathering.totals[gathering.burns] > cheapest * (1.0 + 1e-9):
        yield "The way flown is not the cheapest of three because the cheaper ones leave more craft"
    if len(names) > MOST_ROWS:
        yield share(gathering, names)


def incomplete(gathering: Gathering, names: Sequence[str], time: str) -> Iterator[str]:
    """Who is where at the end."""
    yield f"Incomplete {time}"
    for k, some in enumerate(gathering.sets):
        who = f"{len(some)} craft" if len(some) > MOST_NAMES else listed([names[i] for i in some])
        yield f"Knowledge set: {who}" if k else f"Formation set: {who}"
    if gathering.lost:
        yield f"Lost: {listed([names[k] for k in gathering.lost])}"


def share(gathering: Gathering, names: Sequence[str]) -> str:
    """What craft spend on average and at most."""
    unit, called = speed_unit(gathering)
    each = gathering.delta_v / unit
    most = int(np.argmax(each))
    shares = f"{each.mean():.1f} {called} each on average, {each[most]:.1f} {called} at most ({names[most]})"
    return f"Delta-v: {each.sum():.1f} {called} in all, {shares}"


def speed_unit(gathering: Gathering) -> tuple[float, str]:
    """The unit for what is spent: its size in m/s and its name."""
    return (1.0, "m/s") if gathering.delta_v.sum() >= 100.0 else (1e-3, "mm/s")
