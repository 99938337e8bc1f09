"""CasesReport: the common base of the reports of all studies."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from closeform.campaign.cases import Statistics
from closeform.mission.verdict import MET, NOT_MET
from closeform.report import reproduction, results
from closeform.report.page import Head
from closeform.report.picture import Progress
from closeform.report.section import Section
from closeform.report.table import Table
from closeform.storage.result_folder import Folder

Replays = Sequence[tuple[str, str, str]]  # pages of cases: file, contents, reason to look at it


class CasesReport(ABC):
    """Report on the cases of a `campaign` of any kind."""

    campaign: Statistics

    @property
    @abstractmethod
    def opening(self) -> tuple[str, ...]:
        """The title, and a description of the cases."""

    @property
    @abstractmethod
    def hint(self) -> tuple[str, ...]:
        """The command that shows a case."""

    @property
    @abstractmethod
    def tables(self) -> tuple[Table, ...]:
        """The results."""

    @property
    @abstractmethod
    def verdict(self) -> str:
        """The last line: all requirements are met, or the reason why not."""

    @property
    @abstractmethod
    def summary(self) -> dict[str, Any]:
        """The printed figures in full precision; those of `studied` come first."""

    @abstractmethod
    def chapters(self, replays: Replays) -> Sequence[Section]:
        """Return the sections of the page except the one on reproduction."""

    def run_of(self, case: int, which: str) -> tuple[str, ...]:
        """Return the command that shows a case, described by `which`; empty if the file gives other cases."""
        told = f"closeform run {reproduction.quoted(self.campaign.scenario.file)} --case {case} shows {which}"
        return (told,) if self.campaign.as_in_file else ()

    @property
    def studied(self) -> dict[str, Any]:
        """The inputs and the outcome of the study."""
        campaign = self.campaign
        return {
            "kind": "study",
            "title": campaign.title,
            "inputs": reproduction.inputs(campaign.scenario),
            "seed": campaign.seed,
            "cases": len(campaign),
            "status": MET if campaign.ok else NOT_MET,
            "verdict": self.verdict,
        }

    def repeated(self, out: Path | None, beside: Sequence[str]) -> Section:
        """Return the section on reproduction."""
        campaign = self.campaign
        study = campaign.scenario.study
        options = ""
        if study is not None and study.cases != len(campaign):
            options += f" --cases {len(campaign)}"
        if study is None or study.seed != campaign.seed:
            options += f" --seed {campaign.seed}"
        return reproduction.by_scenario(campaign.scenario, "study", options, beside, out, campaign.seed)

    def leave(
        self,
        folder: Folder,
        replays: Replays = (),
        pages: results.Pages = results.nothing,
        out: Path | None = None,
        progress: Progress = lambda text: None,
    ) -> None:
        """Fill a result folder with the files of a study; `pages` writes the pages of `replays`.

        `out` is the option for the folder; `progress` is called with a description of the current step.
        """
        folder.scenario(self.campaign.scenario)
        title, *lines = self.opening
        head = Head(title, lines, self.verdict, self.campaign.ok)
        repeated = partial(self.repeated, out)
        results.leave(folder, head, self.chapters(replays), repeated, self.summary, progress, pages=pages)
