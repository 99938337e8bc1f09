"""The section of a coast: nothing burns."""

from closeform.mission_result import Mission, StageResult
from closeform.report import conflicts
from closeform.report.section import Section, heading
from closeform.scenario import Coast


def section(mission: Mission, result: StageResult[Coast, None]) -> Section:
    """Who flies where, conflicts and closest approaches."""
    zones = mission.scenario.zones
    lines, tables = conflicts.summed("Conflicts", result.after)
    return Section(
        heading(result),
        lines,
        tables + conflicts.approaches("Closest approaches", result.after),
        pictures=conflicts.film(result, zones) + conflicts.coasting(result.after, zones),
    )
