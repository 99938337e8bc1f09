"""Events of a mission as text, shown as marks on the time line."""

from collections.abc import Iterator
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.mission.mission_result import FirstLocks, StageResult
from closeform.report.description import fate
from closeform.report.sections.passive import event as failure
from closeform.report.sections.passive import near as clearance
from closeform.report.sections.searches import BURNS, locks_of, met, replayed
from closeform.search.gathering.result import EventKind, Gathering
from closeform.viewer.meetings import closest, flights, places_of
from closeform.viewer.shown import Shown
from closeform.viewer.thrusts import pushes, stretches

if TYPE_CHECKING:
    from closeform.mission.passive_safety import PairDrift

Record = dict[str, Any]
MANY = 40  # burns of a craft in a stage; of more, only the first and the last are listed
LISTED = 400  # largest number of events of one kind and stage
NEAREST = 3  # marked failures and approaches of a stage
PASSING = 1.5  # largest clearance ratio of marked approaches beyond the closest


def events(shown: Shown) -> list[Record]:
    """Return every `Event` of web/scene.d.ts in order of time."""
    found: list[Record] = []
    for result in shown.results:
        for kind in (stage, phases, gathered, locked, burnt, conflicts, approaches, sigmas, failures):
            found += list(kind(result))[:LISTED]
    last, level = shown.results[-1], "good" if shown.ok else "bad"
    found.append(event("end", last, last.end, shown.verdict, level=level))
    return sorted(found, key=lambda one: one["time"])


def event(
    kind: str,
    result: StageResult[Any, Any],
    time: float,
    text: str,
    craft: tuple[int, ...] = (),
    until: float | None = None,
    level: str = "plain",
) -> Record:
    """Return one `Event`; `time` and `until` in seconds."""
    return {
        "time": time,
        "until": time if until is None else until,
        "kind": kind,
        "craft": list(craft),
        "stage": result.number,
        "text": text,
        "level": level,
    }


def stage(result: StageResult[Any, Any]) -> Iterator[Record]:
    """Yield the start of a stage, with its outcome."""
    level = "plain" if result.failure is None else "bad"
    yield event("stage", result, result.start, fate(result), until=result.end, level=level)


def phases(result: StageResult[Any, Any]) -> Iterator[Record]:
    """Yield the phases of a search."""
    if not isinstance(result.result, Gathering | FirstLocks):
        return
    for name, number, start, end in result.result.search.phases:
        if start < result.end - result.start:
            until = min(result.start + end, result.end)
            yield event("phase", result, result.start + start, f"{name} {number}", until=until)


def gathered(result: StageResult[Any, Any]) -> Iterator[Record]:
    """Yield the locks and burns of a gathering."""
    if not isinstance(result.result, Gathering):
        return
    names = result.after.names
    for moment in replayed(result.result):
        one, time = moment.event, result.start + moment.event.time
        if one.kind is EventKind.LOCK:
            pair = names[one.first], names[one.second]
            text = f"{pair[0]} - {pair[1]}: {met(moment, pair)}"
            yield event("lock", result, time, text, (one.first, one.second), level="good")
        else:
            size = float(np.linalg.norm(one.delta_v))
            yield event(
                "burn", result, time, f"{names[one.first]}: {BURNS[one.kind]}, {speed(size)}", (one.first,)
            )


def locked(result: StageResult[Any, Any]) -> Iterator[Record]:
    """Yield the first locks of a search without burns."""
    if not isinstance(result.result, FirstLocks):
        return
    names = result.after.names
    for time, one, other in sorted(locks_of(result.result)):
        text = f"{names[one]} - {names[other]}: lock"
        yield event("lock", result, result.start + time, text, (one, other), level="good")


def burnt(result: StageResult[Any, Any]) -> Iterator[Record]:
    """Yield the impulses, pulses and thrust intervals of craft that do not gather."""
    if isinstance(result.result, Gathering):
        return
    found = [one for craft in range(len(result.after.names)) for one in burns_of(result, craft)]
    yield from sorted(found, key=lambda one: (one["time"], one["craft"]))


def burns_of(result: StageResult[Any, Any], craft: int) -> Iterator[Record]:
    """Yield the burns of one craft, or if there are many, only the first and the last."""
    name, (kind, rows) = result.after.names[craft], pushes(result, craft)
    some = [*rows[:1], *rows[-1:]] if len(rows) > MANY else list(rows)
    for k, (start, lasts, *push) in enumerate(some):
        word = kind if len(rows) <= MANY else f"{('first', 'last')[k]} of {len(rows)} {kind}s"
        text = f"{name}: {word}, {speed(float(np.linalg.norm(push)))}"
        yield event("burn", result, float(start), text, (craft,), float(start + lasts))
    steady = stretches(result, craft)
    if len(steady) > MANY or (len(steady) == 1 and np.allclose(steady[0], [result.start, result.end])):
        return  # continuous thrust for the whole stage needs no marks
    for start, end in steady.tolist():
        yield event("burn", result, start, f"{name}: thrusts for {end - start:.1f} s", (craft,), end)


def conflicts(result: StageResult[Any, Any]) -> Iterator[Record]:
    """Yield the conflicts without avoidance and the remaining conflicts."""
    place = places_of(result)
    for when, flight in flights(result):
        remains = when == "after"
        for conflict in sorted(flight.conflicts, key=lambda one: one.start):
            pair_names = f"{conflict.first} - {conflict.second}"
            word = "conflict" if remains else "in conflict without avoidance"
            text = f"{pair_names}: {word}, {conflict.ratio:.4f} x zone at {conflict.time:.1f} s"
            craft = place[conflict.first], place[conflict.second]
            level = "bad" if remains else "plain"
            yield event("conflict", result, conflict.start, text, craft, conflict.end, level)


def approaches(result: StageResult[Any, Any]) -> Iterator[Record]:
    """Yield the closest approach of a stage, and a few others close to a zone."""
    names, near_by = result.after.names, closest(result)
    passing = [near for near in near_by[1:] if near["ratio"] < PASSING]
    for near in [*near_by[:1], *passing[: NEAREST - 1]]:
        one, other = near["first"], near["second"]
        text = (
            f"{names[one]} - {names[other]}: closest approach, {near['ratio']:.4f} x zone "
            f"({near['distance']:.4g} m)"
        )
        yield event("approach", result, near["time"], text, (one, other))


def sigmas(result: StageResult[Any, Any]) -> Iterator[Record]:
    """Yield the approach of two craft at the minimum number of sigmas."""
    near = None if result.uncertain is None else result.uncertain.nearest
    if near is None or not isfinite(near.sigmas):
        return
    from closeform.mission.uncertainty import SURE  # runs without uncertainty do not need its kernels

    asked, place = result.stage.sigmas, places_of(result)
    short = asked is not None and near.sigmas < SURE * asked
    text = f"{near.first} - {near.second}: fewest sigmas, {near.sigmas:.4g}"
    craft = place[near.first], place[near.second]
    yield event("approach", result, near.time, text, craft, level="bad" if short else "plain")


def failures(result: StageResult[Any, Any]) -> Iterator[Record]:
    """Yield the failures with the closest approaches."""
    if result.passive is None:
        return
    place = places_of(result)
    for pair in result.passive.pairs[:NEAREST]:
        if not isfinite(pair.failed_at):
            continue
        text = f"{pair.fails}: {consequence(result, pair)}"
        craft = place[pair.fails], place[pair.meets]
        level = "good" if pair.safe else "bad"
        yield event("failure", result, pair.failed_at, text, craft, level=level)


def consequence(result: StageResult[Any, Any], pair: "PairDrift") -> str:
    """Return the consequence of a failure as text."""
    assert result.passive is not None
    comes = "closest approach" if not pair.safe else "stays clear, minimum"
    return f"if {failure(result.passive)}, {comes} {clearance(pair)} of {pair.meets}"


def speed(size: float) -> str:
    """Return a delta-v [m/s] as text."""
    return f"{size:.4g} m/s" if size >= 0.1 else f"{1e3 * size:.4g} mm/s"
