"""Requirements of a mission and whether they are met, with one row per stage."""

from collections.abc import Iterator
from dataclasses import replace
from textwrap import shorten
from typing import Any

from closeform.conflicts.flight import ALL_PAIRS, PairApproach
from closeform.conflicts.two_paths import nearest_first
from closeform.mission.mission_result import FirstLocks, Mission, StageResult
from closeform.mission.verdict import conflicts_of
from closeform.report.conflicts import RATIO
from closeform.report.limits import first_of_each
from closeform.report.picture import Picture
from closeform.report.section import Section, called
from closeform.report.table import PAIR, Column, Table
from closeform.search.gather_result import EventKind, Gathering

REQUIREMENTS = (
    Column("what was asked for", "asked", words=True),
    Column("what was found", "found", words=True),
    Column("met", "met", lambda met: "yes" if met else "no", words=True, absent="-", judges=True),
)
STAGES = (
    Column("stage", "number"),
    Column("does", "do", words=True),
    Column("from [s]", "start_s", "{:.1f}".format, since="mission"),
    Column("to [s]", "end_s", "{:.1f}".format),
    Column("conflicts before", "before"),
    Column("and after", "after"),
    RATIO,
    PAIR,
    Column("at [s]", "time_s", "{:.1f}".format),
    Column("delta-v of all [m/s]", "delta_v_m_s", "{:.6g}".format),
)
MOST_CRAFT = 100  # maximum number of spacecraft in the overview
WHY = 80  # maximum characters of the reason for a stop, above the overview
IN_FLIGHT = "No craft enters a zone in flight, with errors as they are"


def section(mission: Mission) -> Section:
    """Return the section on requirements and stages, with an overview picture."""
    return Section(
        "What was found",
        tables=(
            Table("What was asked for, and whether it is met", REQUIREMENTS, [*requirements(mission)]),
            Table("Stages", STAGES, [row(result) for result in mission.results]),
        ),
        pictures=overview(mission),
    )


def requirements(mission: Mission) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of REQUIREMENTS: those of the whole mission, then those of each stage."""
    if mission.stopped is not None:
        yield "Every stage is flown", f"stopped in {short(mission.stopped)}", False
    yield from clearance(mission)
    for use in first_of_each(mission.uses, idle=True):
        used, limit, unit = use.shown(mission.grams)
        most = f"at most {used:.4g} of {limit:g} {unit}, {100.0 * use.share:.3g} % ({use.craft})"
        yield f"{use.what.capitalize()} of each craft within its limit", most, not use.exceeded
    for result in mission.results:
        yield from of_stage(mission, result)
    for one in mission.lost:
        told = one.asked
        yield f"{one.craft} gets where it is to be", told.kept or told.broken, told.met
    if mission.flights is not None:
        flown = mission.flights.entered
        yield IN_FLIGHT, flown.zones, flown.clear
    if mission.grounded is not None:
        yield IN_FLIGHT, f"cannot be flown: {mission.grounded}", False


def short(stopped: str) -> str:
    """Return the first words of why a mission stopped; the verdict has all of them."""
    return shorten(stopped.split(";")[0], WHY, placeholder=" …")


def clearance(mission: Mission) -> Iterator[tuple[Any, ...]]:
    """Yield the requirement that no keep-out zone is violated in the stages that were executed."""
    verdict = mission.verdict
    if verdict.conflicts is None or not any(result.flown for result in mission.results):
        return
    found = "there is only one craft"
    if (near := closest(mission)) is not None:
        result, pair = near
        found = (
            f"least {pair.ratio:.4f} x zone, {pair.first} and {pair.second} at {pair.time:.1f} s "
            f"({pair.distance:.3f} m apart), stage {result.number}"
        )
    if verdict.conflicts:
        found = f"{conflicts_of(verdict.conflicts, verdict.pairs)}: {found}"
    met: bool | None = not verdict.conflicts and not verdict.enters
    if verdict.enters and not verdict.conflicts:
        found += f"; least {verdict.predicted:.4f} x zone as predicted in {verdict.field}"
    if met and verdict.margin is not None and verdict.margin.exceeded:
        met, found = None, f"{found}; not shown beyond {verdict.model}: {verdict.margin}"
    yield "No craft enters the keep-out zone of another, at any instant", found, met


def closest(mission: Mission) -> tuple[StageResult[Any, Any], PairApproach] | None:
    """Return the stage and the pair of the closest approach in the mission; None if there is none."""
    flown = [(result, result.after.closest) for result in mission.results if result.flown]
    near = [(result, pair) for result, pair in flown if pair is not None]
    return min(near, key=lambda one: nearest_first(one[1].ratio, one[1].time), default=None)


def of_stage(mission: Mission, result: StageResult[Any, Any]) -> Iterator[tuple[Any, ...]]:
    """Yield the other requirements of a stage."""
    stage, where = result.stage, called(result)
    if stage.searches:
        everybody = "every pair locks" if isinstance(result.result, FirstLocks) else "nobody stays lost"
        done = f"after {result.end - result.start:.1f} s"
        yield f"{where}: {everybody}", result.failure or done, result.failure is None
    if not result.flown:
        return
    if "within" in stage.durations:
        asked = stage.durations["within"].on(mission.orbit.mean_motion)
        took = f"takes {result.end - result.start:.1f} s"
        yield f"{where}: within {asked:.1f} s", took, result.late is None
    for one in result.asked:
        what = {
            "sigmas": f"clear at {stage.sigmas} sigma",
            "probability": f"probability of collision at most {stage.max_probability}",
            "likelihood": "probability of collision",
            "sun": "body x within the sun limit in every turn, with the errors of the craft",
            "drift": f"passively safe {getattr(stage, 'lasting', '')}",
            "arrival": f"arrives within {tolerance(stage)}",
        }[one.kind]
        met = None if one.kind == "likelihood" else one.shown  # no limit is set
        yield f"{where}: {what}", str(one), met


def tolerance(stage: Any) -> str:
    """Return the tolerance of arrival of a stage, empty of a stage without a target."""
    allowed = getattr(stage, "arrival", None)
    return f"{allowed.position:g} m and {1e3 * allowed.velocity:g} mm/s" if allowed is not None else ""


def row(result: StageResult[Any, Any]) -> tuple[Any, ...]:
    """Return a row of STAGES; a failed stage has no clearance."""
    near = result.after.closest if result.flown else None
    close = (None, None, None) if near is None else (near.ratio, (near.first, near.second), near.time)
    before, after = (
        len(flight.conflicts) if flight.pairs else None for flight in (result.before, result.after)
    )
    spent = float(result.delta_v.sum()) if result.flown else 0.0
    ends = result.start, result.end
    return result.number, result.stage.verb, *ends, before, after if result.flown else None, *close, spent


def overview(mission: Mission) -> tuple[Picture, ...]:
    """Return one picture of all stages, if there are at least two."""
    flown = [result for result in mission.results if result.flown]
    names = mission.scenario.names
    if len(flown) < 2 or len(names) > MOST_CRAFT or flown[0].after.pairs > ALL_PAIRS:
        return ()
    titles = [f"{result.number} {result.stage.name or result.stage.verb}" for result in flown]
    options = {
        "names": names,
        "zone": mission.scenario.zones,
        "titles": titles,
        "locks": [lock for result in flown for lock in locks(result)],
    }
    paths = [result.after.paths for result in flown]
    whole = Picture("overview", "The whole mission", "overview", (paths,), options)
    if mission.stopped is None:
        return (whole,)
    return (
        replace(whole, stage=f"Stopped in {short(mission.stopped)}; what was flown before that", failed=True),
    )


def locks(result: StageResult[Any, Any]) -> Iterator[tuple[float, int, int]]:
    """Yield the time [s] and the indices of the two spacecraft of each lock in a stage."""
    found = result.result
    if isinstance(found, Gathering):
        for event in found.events:
            if event.kind is EventKind.LOCK:
                yield result.start + event.time, event.first, event.second
    elif isinstance(found, FirstLocks):
        pairs = zip(found.pairs.tolist(), found.locks.time.tolist(), found.locks.leg.tolist(), strict=True)
        yield from ((result.start + time, one, other) for (one, other), time, leg in pairs if leg >= 0)


def figures(mission: Mission) -> list[dict[str, Any]]:
    """Return the requirements and whether they are met, for `summary.json`."""
    return Table("", REQUIREMENTS, [*requirements(mission)]).records
