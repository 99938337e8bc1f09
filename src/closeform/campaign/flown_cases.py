"""Base class of the statistics of a study, of any kind of cases."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from closeform.campaign.chunks import CaseChunks
from closeform.result import Result
from closeform.scenario import Scenario


@dataclass(frozen=True, eq=False, repr=False)
class FlownCases(Result, ABC):
    """Statistics of C cases of one `kind`, drawn with its seed, held by `chunks`."""

    kind: Any
    chunks: CaseChunks

    @property
    def scenario(self) -> Scenario:
        """Scenario of the study."""
        flown: Scenario = self.kind.scenario
        return flown

    @property
    def seed(self) -> int:
        """Seed with which the cases were drawn."""
        return int(self.kind.seed)

    @property
    def title(self) -> str:
        """Title of the scenario."""
        return self.scenario.title

    def __len__(self) -> int:
        return self.chunks.count

    @property
    @abstractmethod
    def ok(self) -> bool:
        """True if all requirements are met in every case."""

    @property
    def as_in_file(self) -> bool:
        """True if the file's own seed draws the same cases."""
        study = self.scenario.study
        return study is not None and study.seed == self.seed
