"""Cases of a study: case K does not depend on the range, the machine or the other cases evaluated with it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from closeform.scenario import Scenario, ScenarioError

if TYPE_CHECKING:
    from closeform.campaign.chunks import CaseChunks

Columns = dict[str, Any]
Range = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Cases(ABC):
    """Cases of one kind of study, determined by a scenario and a seed alone.

    `at_once`: the greatest number of cases in a chunk, some tenths of a second of work, which is what an
    interrupted study loses. `drawn`: the columns that seed and case reproduce, which are not kept in memory.
    """

    scenario: Scenario
    seed: int
    drawn: ClassVar[tuple[str, ...]] = ()

    @property
    @abstractmethod
    def at_once(self) -> int:
        """Greatest number of cases in a chunk."""

    def in_chunk(self, count: int) -> int:
        """Return the number of cases in a chunk of a study of `count` cases, at most `at_once`."""
        return self.at_once

    @abstractmethod
    def fly(self, first: int, last: int) -> Columns:
        """Return the results of the cases from `first` to `last`, exclusive, by column name.

        Each column is an array with the same number of rows for each case, in the order of cases. nan is an
        absent number, -1 an absent `leg`. Raises ScenarioError for cases that cannot be evaluated.
        """

    def prepared(self) -> Self:
        """Return the cases with their shared data computed, before threads evaluate any of them."""
        return self

    def flown(self, first: int, last: int) -> Columns:
        """Return the same columns as `fly`; report every failure as an error of the scenario."""
        try:
            return self.fly(first, last)
        except ScenarioError:
            raise
        except ValueError as error:
            line = f"stage[1]: {error}; change [craft] or its draws"
            raise ScenarioError(self.scenario.file, [line]) from error

    @abstractmethod
    def good(self, columns: Columns) -> Any:
        """Return in which cases (C,) of a chunk all requirements are met."""

    def stored(self, first: int, last: int, columns: Columns) -> Columns:
        """Return the columns of a chunk as files hold them: those of `fly` and the case, with its craft."""
        return {"case": np.arange(first, last), **columns}

    @abstractmethod
    def campaign(self, chunks: CaseChunks) -> Any:
        """Return the statistics of the cases in some chunks."""
