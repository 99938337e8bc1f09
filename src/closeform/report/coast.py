"""The section of a coast, and of the impulses that it is given."""

from closeform.mission.mission_result import Mission, StageResult
from closeform.report import burns, conflicts
from closeform.report.section import Section, heading
from closeform.scenario import Coast


def section(mission: Mission, result: StageResult[Coast, None]) -> Section:
    """Who flies where, conflicts and closest approaches."""
    zones, fired = mission.scenario.zones, burns.StageBurns(mission, result)
    lines, tables = conflicts.summed("Conflicts", result.after)
    return Section(
        heading(result),
        lines,
        (*tables, *conflicts.approaches("Closest approaches", result.after), *fired.tables),
        pictures=conflicts.film(result, zones) + conflicts.coasting(result.after, zones),
    )
