"""A run's result folder: summary, tables, pictures and one self-contained HTML page."""

from collections.abc import Callable

from closeform.mission import Mission
from closeform.report.figures import pictures
from closeform.report.page import document, embedded, page, table
from closeform.report.summary import summary
from closeform.report.tables import STATE_COLUMNS, tables
from closeform.result_folder import REPORT, Folder

__all__ = ["STATE_COLUMNS", "document", "embedded", "leave", "table"]


def leave(mission: Mission, folder: Folder, progress: Callable[[str], None] = lambda text: None) -> None:
    """Fill a result folder with everything that a run leaves; `progress` is told what is under way."""
    folder.text("scenario.toml", mission.scenario.text)
    progress("writing tables")
    for name, columns in tables(mission).items():
        folder.table(name, columns)
    shown = {leg.number: pictures(leg, folder, progress) for leg in mission.legs}
    folder.summary(summary(mission))
    folder.text(REPORT, page(mission, shown))
