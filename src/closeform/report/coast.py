"""Section of a coast and its impulses."""

from collections.abc import Iterator

from closeform.mission.mission_result import Mission, StageResult
from closeform.mission.verdict import MOST_NAMES
from closeform.report import burns, conflicts
from closeform.report.section import Section, heading
from closeform.scenario import Coast


def section(mission: Mission, result: StageResult[Coast, None]) -> Section:
    """Return the section of a coast: conflicts, closest approaches, burns and pictures."""
    zones, fired = mission.scenario.zones, burns.StageBurns(mission, result)
    found, tables = conflicts.summed("Conflicts", result.after)
    lines = (*followed(result), *found)
    return Section(
        heading(result),
        lines,
        (*tables, *conflicts.approaches("Closest approaches", result.after), *fired.tables),
        pictures=conflicts.film(result, zones) + conflicts.coasting(result.after, zones),
    )


def followed(result: StageResult[Coast, None]) -> Iterator[str]:
    """Yield the interpolation error and the source of delta-v of spacecraft that follow their files."""
    if not result.stage.follow:
        return
    flight, names = result.after, result.stage.follow
    off = max(float(flight.path(name).interpolation_error) for name in names)
    shown = ", ".join(names[:MOST_NAMES]) + f" and {len(names) - MOST_NAMES} more" * (len(names) > MOST_NAMES)
    yield f"On the paths of their files: {shown}; off by up to {off:.2g} m between states, by estimate"
    if result.on_ephemerides:
        yield "Burns of craft on ephemerides are the velocity jumps in these"
