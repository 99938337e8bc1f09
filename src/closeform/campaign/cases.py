"""Cases: what a study flies; case K is the same wherever, whenever and beside whichever others."""

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
    """The cases of one kind of study, made from a scenario and a seed alone, on any machine.

    `at_once`: how many are flown in a chunk at most, some tenths of a second's work, what a killed study
    loses.  `drawn`: the columns that seed and case give again, which are left out where arrays are held.
    """

    scenario: Scenario
    seed: int
    drawn: ClassVar[tuple[str, ...]] = ()

    @property
    @abstractmethod
    def at_once(self) -> int:
        """Cases in a chunk."""

    def in_chunk(self, count: int) -> int:
        """Cases in a chunk of a study of so many, at most `at_once`."""
        return self.at_once

    @abstractmethod
    def fly(self, first: int, last: int) -> Columns:
        """What becomes of the cases from `first` to `last`, without that one, by the name of the column.

        An array for each, of the same number of rows for each case, in the order of cases; nan is an absent
        number, -1 an absent `leg`.  Raises ScenarioError for cases that cannot be flown.
        """

    def prepared(self) -> Self:
        """The same with what all cases share, where that takes its time: before threads fly any."""
        return self

    def flown(self, first: int, last: int) -> Columns:
        """The same; whatever cannot be flown is told as what is wrong with the scenario."""
        try:
            return self.fly(first, last)
        except ScenarioError:
            raise
        except ValueError as error:
            line = f"stage[1]: {error}; change [craft] or its draws"
            raise ScenarioError(self.scenario.file, [line]) from error

    @abstractmethod
    def good(self, columns: Columns) -> Any:
        """In which of the cases of a chunk (C,) all that was asked for is met."""

    def stored(self, first: int, last: int, columns: Columns) -> Columns:
        """The table of a chunk as files hold it: those columns and who they are about."""
        return {"case": np.arange(first, last), **columns}

    @abstractmethod
    def campaign(self, chunks: CaseChunks) -> Any:
        """What the cases came to, as chunks hold it."""
