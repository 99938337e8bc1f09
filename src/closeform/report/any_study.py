"""Report of a study, selected by the kind of its campaign."""

from typing import Any

from closeform.report.study import CasesReport
from closeform.scenario import Scenario


def report_of(campaign: Any, scenario: Scenario) -> CasesReport:
    """Return the report of a campaign, by its kind; only the module of that kind is loaded."""
    if scenario.points:
        from closeform.report.mission_study import SweepReport

        return SweepReport(campaign)
    if scenario.study is not None and scenario.study.draws == "errors":
        from closeform.report.mission_study import ErrorStudyReport

        return ErrorStudyReport(campaign)
    if not scenario.searches_alone:
        from closeform.report.mission_study import MissionStudyReport

        return MissionStudyReport(campaign)
    from closeform.report.study import StudyReport

    return StudyReport(campaign)
