"""The section of a coast: nothing burns."""

from closeform.mission_result import Mission, StageResult
from closeform.report import conflicts
from closeform.report.section import Section, heading
from closeform.scenario import Coast


def section(mission: Mission, result: StageResult[Coast, None]) -> Section:
    """Conflicts and closest approaches."""
    lines, tables = conflicts.summed("Conflicts", result.after)
    return Section(
        heading(result),
        lines,
        tables + conflicts.approaches("Closest approaches", result.after),
        pictures=conflicts.pictures(result.after),
    )
