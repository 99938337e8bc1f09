"""SearchCampaign: what the cases of a search came to, counted chunk after chunk or as arrays."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from math import inf
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import Floats
from closeform.campaign.cases import Columns
from closeform.campaign.flown_cases import FlownCases
from closeform.campaign.shares import Share, shares
from closeform.campaign.spread import Spread
from closeform.campaign.tally import Settled, Tally
from closeform.search.phases import labels
from closeform.search.schedule import Search

Measured = Callable[[Settled], tuple[Floats, Any]]  # what each case has (C,), and in which it counts
LATER = "time, not at once [s]"
WORDS = {
    "clear": "clear",
    "delta-v": "within delta_v_budget",
    "propellant": "within propellant",
    "thrust": "free of craft adrift",
    "sun": "within the sun limit",
}


class CampaignStatus(StrEnum):
    """How a campaign ended: all that was asked for is met, or not in some cases, or some were never done."""

    COMPLETE = "complete"
    UNMET = "a clearance or a limit not met"
    INCOMPLETE = "incomplete"


@dataclass(frozen=True, eq=False, repr=False)
class Campaign(FlownCases):
    """What became of C cases of one `kind`, drawn with its seed, as `chunks` hold it.

    `tally` has what is counted in them, chunk after chunk.  As arrays (C,), read when they are asked for:
    `time` [s] at which the case was done, nan where it never was, and the `leg` of `search`, then -1;
    `kept` of each clearance and limit that the file asks for: "clear" of keep-out zones, within the
    "delta-v" budget, within the "propellant" on board of every craft, with the "thrust" that everyone needs.
    """

    done: ClassVar[str] = "done"  # what a case is at that time, in words
    _told: ClassVar = ("title", "seed", "time", "status", "reason")

    @property
    def search(self) -> Search:
        """In which they were done, over all rounds."""
        found: Search = self.kind.search
        return found

    @property
    @abstractmethod
    def wanted(self) -> tuple[str, ...]:
        """The columns that say what became of a case."""

    @abstractmethod
    def settled(self, columns: Columns) -> Settled:
        """What became of the cases of a chunk."""

    @cached_property
    def tally(self) -> Tally:
        """What is counted in all cases; memory does not grow with them."""
        return Tally.of(self.search, (self.settled(part) for _, part in self.chunks.read(*self.wanted)))

    def spread(self, of: Measured) -> Spread | None:
        """The spread of what each case has `of` it, in which cases (C,) it counts."""

        def values() -> Iterator[tuple[Floats, Any]]:
            for first, part in self.chunks.read(*self.wanted):
                settled = self.settled(part)
                value, counts = of(settled)
                yield value[counts], first + np.flatnonzero(counts)

        return Spread.of(values)

    def most(self, of: Callable[[Settled], Floats]) -> tuple[float, int]:
        """The greatest of what all cases have, and in which case."""
        best, case = -inf, 0
        for first, part in self.chunks.read(*self.wanted):
            value = of(self.settled(part))
            if (top := float(value.max())) > best:
                best, case = top, first + int(np.argmax(value))
        return best, case

    @cached_property
    def spreads(self) -> dict[str, Spread]:
        """Of the times [s], of the cases that were done and of those not at once, and what else there is."""
        return self.each_spread(self.measured)

    @cached_property
    def costs(self) -> dict[str, Spread]:
        """Of what craft spend [m/s], by cause and phase."""
        return self.each_spread(self.spent)

    def each_spread(self, measured: dict[str, Measured]) -> dict[str, Spread]:
        """The spreads of several by name, of those that some case has."""
        found = {name: self.spread(of) for name, of in measured.items()}
        return {name: spread for name, spread in found.items() if spread is not None}

    @property
    def measured(self) -> dict[str, Measured]:
        """What `spreads` are about."""
        return {
            "time [s]": lambda one: (one.time, one.leg >= 0),
            LATER: lambda one: (one.time, one.time > 0.0),
        }

    @property
    def spent(self) -> dict[str, Measured]:
        """What `costs` are about; nothing where nobody burns."""
        return {}

    @cached_property
    def _settled(self) -> Settled:
        """What became of all cases."""
        return Settled.joined([self.settled(part) for _, part in self.chunks.read(*self.wanted)])

    @property
    def time(self) -> Floats:
        """When each case was done [s]."""
        return self._settled.time

    @property
    def leg(self) -> Any:
        """In which leg."""
        return self._settled.leg

    @property
    def kept(self) -> dict[str, Any]:
        """In which cases each clearance and limit is kept."""
        return self._settled.kept

    @property
    def failed(self) -> Any:
        """The numbers (F,) of the cases that were never done."""
        return np.flatnonzero(self.leg < 0)

    @property
    def met(self) -> dict[str, Any]:
        """Of all that was asked for, in which cases (C,) it is met: to be done, and what is to be kept."""
        return {self.told(what): met for what, met in self._settled.met.items()}

    @cached_property
    def good(self) -> Any:
        """In which cases (C,) all of it is met, as in a run that ends with status 0."""
        return self._settled.good

    def told(self, what: str) -> str:
        """What was asked for, in words."""
        return WORDS.get(what, self.done)

    @property
    def met_cases(self) -> int:
        """In how many cases all of it is met."""
        return self.tally.good.count

    @property
    def ok(self) -> bool:
        """Whether all that was asked for is met in every case."""
        return self.met_cases == len(self)

    @property
    def status(self) -> CampaignStatus:
        """How it ended."""
        if self.tally.never:
            return CampaignStatus.INCOMPLETE
        return CampaignStatus.COMPLETE if self.ok else CampaignStatus.UNMET

    @property
    def reason(self) -> str | None:
        """In how many cases what is not met, and which come first; None where all is met."""
        parts = []
        for what, met in self.tally.met.items():
            if unmet := len(self) - met.count:
                named = ", ".join(map(str, met.unmet)) + ", ..." * (unmet > len(met.unmet))
                parts.append(f"{unmet} of {len(self)} cases not {self.told(what)}: {named}")
        return "; ".join(parts) or None

    @cached_property
    def shares(self) -> tuple[Share, ...]:
        """How many cases were done at once, in each phase, and never, with confidence intervals."""
        return shares(labels(self.search), self.tally.phases.tolist())
