"""Noteworthy cases of a study, the reason for each, and the command that shows it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from closeform.campaign import Campaign
from closeform.campaign.cases import Statistics
from closeform.campaign.search_cases import LATER
from closeform.report.cases_report import Replays
from closeform.report.reproduction import quoted
from closeform.report.section import Section
from closeform.report.table import Column, Table

if TYPE_CHECKING:
    from closeform.campaign.error_cases import ErrorCampaign  # searches do not need these kernels

PAGES = (
    Column("in motion", "file", words=True, links=True),
    Column("what it shows", "what", words=True),
    Column("why it is worth a look", "why", words=True),
    Column("the same as a run", "command", words=True, absent=""),
)
CASES = (
    Column("case", "case"),
    Column("entries", "entries"),
    Column("who is inside", "pairs", words=True),
)


GREATEST = (
    Column("of", "what", words=True),
    Column("", "value", "{:.4f}".format),
    Column("case", "case"),
    Column("in motion", "file", words=True, links=True, absent=""),
    Column("the same as a run", "command", words=True, absent=""),
)


def greatest(campaign: Campaign, replays: Replays) -> Table:
    """Return the ten cases with the longest times and highest costs, with links to their pages."""
    pages = {what: page for page, what, _ in replays}
    rows = [
        (name, value, case, pages.get(f"case {case}"), command(campaign, f"case {case}"))
        for name, found in campaign.spreads.items()
        if name != LATER  # the same cases
        for value, case in found.worst
    ]
    return Table("The ten greatest", GREATEST, rows)


def section(campaign: Statistics, replays: Replays, *tables: Table) -> Iterator[Section]:
    """Yield the section with pages of cases, the command for each of them, and further `tables`."""
    rows = [(page, what, why, command(campaign, what)) for page, what, why in replays]
    pages = [Table("", PAGES, rows)] if rows else []
    found = tuple(one for one in (*pages, *tables) if one.rows)
    if found:
        yield Section("Cases worth a look", tables=found)


def command(campaign: Statistics, what: str) -> str | None:
    """Return the command that runs a case; None if the file gives other cases, or `what` is no case."""
    kind, _, number = what.partition(" ")
    if kind != "case" or not campaign.as_in_file:
        return None
    return f"closeform run {quoted(Path(campaign.scenario.file).name)} --case {number}"


def of_errors(campaign: ErrorCampaign) -> Table:
    """Return the table of cases with conflicts, sorted by the number of conflicts."""
    from closeform.campaign.error_cases import MOST

    some = f", the {MOST} with most entries" if len(campaign.worst) == MOST else ""
    return Table(f"Cases in which anybody is ever inside{some}", CASES, campaign.worst)
