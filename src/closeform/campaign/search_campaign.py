"""Statistics of the cases of a search, counted chunk after chunk or as arrays."""

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

Measured = Callable[[Settled], tuple[Floats, Any]]  # a value for each case (C,), and the cases that count
LATER = "time, not at once [s]"
WORDS = {
    "clear": "clear",
    "delta-v": "within delta_v_budget",
    "propellant": "within propellant",
    "thrust": "free of craft adrift",
    "sun": "within the sun limit",
}


class CampaignStatus(StrEnum):
    """Status of a campaign: all requirements met, some not met in some cases, or some cases never done."""

    COMPLETE = "complete"
    UNMET = "a clearance or a limit not met"
    INCOMPLETE = "incomplete"


@dataclass(frozen=True, eq=False, repr=False)
class Campaign(FlownCases):
    """Statistics of C cases of one `kind`, drawn with its seed, held by `chunks`.

    `tally` counts them chunk after chunk. Arrays (C,) are read on request: `time` [s] at which the case was
    done, nan if it never was, and the `leg` of `search`, then -1; `kept` of each clearance and limit that the
    file requires: "clear" of keep-out zones, within the "delta-v" budget, within the "propellant" on board of
    every craft, with the "thrust" that every craft needs.
    """

    done: ClassVar[str] = "done"  # the label of a case that is done
    _told: ClassVar = ("title", "seed", "time", "status", "reason")

    @property
    def search(self) -> Search:
        """Search in which the cases were done, over all rounds."""
        found: Search = self.kind.search
        return found

    @property
    @abstractmethod
    def wanted(self) -> tuple[str, ...]:
        """Columns with the outcome of a case."""

    @abstractmethod
    def settled(self, columns: Columns) -> Settled:
        """Return the outcomes of the cases of a chunk."""

    @cached_property
    def tally(self) -> Tally:
        """Counts over all cases, in memory that does not grow with them."""
        return Tally.of(self.search, (self.settled(part) for _, part in self.chunks.read(*self.wanted)))

    def spread(self, of: Measured) -> Spread | None:
        """Return the spread of a quantity over the cases (C,) that count."""

        def values() -> Iterator[tuple[Floats, Any]]:
            for first, part in self.chunks.read(*self.wanted):
                settled = self.settled(part)
                value, counts = of(settled)
                yield value[counts], first + np.flatnonzero(counts)

        return Spread.of(values)

    def most(self, of: Callable[[Settled], Floats]) -> tuple[float, int]:
        """Return the greatest value of a quantity over all cases, and its case."""
        best, case = -inf, 0
        for first, part in self.chunks.read(*self.wanted):
            value = of(self.settled(part))
            if (top := float(value.max())) > best:
                best, case = top, first + int(np.argmax(value))
        return best, case

    @cached_property
    def spreads(self) -> dict[str, Spread]:
        """Spreads of the times [s] of the cases done, of those not done at once, and of other quantities."""
        return self.each_spread(self.measured)

    @cached_property
    def costs(self) -> dict[str, Spread]:
        """Spreads of the delta-v [m/s], by cause and phase."""
        return self.each_spread(self.spent)

    def each_spread(self, measured: dict[str, Measured]) -> dict[str, Spread]:
        """Return the spreads of several quantities by name, of those that some case has."""
        found = {name: self.spread(of) for name, of in measured.items()}
        return {name: spread for name, spread in found.items() if spread is not None}

    @property
    def measured(self) -> dict[str, Measured]:
        """Quantities of `spreads`."""
        return {
            "time [s]": lambda one: (one.time, one.leg >= 0),
            LATER: lambda one: (one.time, one.time > 0.0),
        }

    @property
    def spent(self) -> dict[str, Measured]:
        """Quantities of `costs`; empty if no craft burns."""
        return {}

    @cached_property
    def _settled(self) -> Settled:
        """Outcomes of all cases."""
        return Settled.joined([self.settled(part) for _, part in self.chunks.read(*self.wanted)])

    @property
    def time(self) -> Floats:
        """Time at which each case was done [s]."""
        return self._settled.time

    @property
    def leg(self) -> Any:
        """Leg in which each case was done."""
        return self._settled.leg

    @property
    def kept(self) -> dict[str, Any]:
        """Cases in which each clearance and limit is kept."""
        return self._settled.kept

    @property
    def failed(self) -> Any:
        """Numbers (F,) of the cases that were never done."""
        return np.flatnonzero(self.leg < 0)

    @property
    def met(self) -> dict[str, Any]:
        """Cases (C,) in which each requirement is met: to be done, and each clearance and limit."""
        return {self.requirement_label(what): met for what, met in self._settled.met.items()}

    @cached_property
    def good(self) -> Any:
        """Cases (C,) in which all requirements are met, as in a run with exit status 0."""
        return self._settled.good

    def requirement_label(self, what: str) -> str:
        """Return a requirement in words."""
        return WORDS.get(what, self.done)

    @property
    def met_cases(self) -> int:
        """Number of cases in which all requirements are met."""
        return self.tally.good.count

    @property
    def ok(self) -> bool:
        """True if all requirements are met in every case."""
        return self.met_cases == len(self)

    @property
    def status(self) -> CampaignStatus:
        """Status of the campaign."""
        if self.tally.never:
            return CampaignStatus.INCOMPLETE
        return CampaignStatus.COMPLETE if self.ok else CampaignStatus.UNMET

    @property
    def reason(self) -> str | None:
        """Number of cases in which each requirement is not met, and the first of them; None if all are."""
        parts = []
        for what, met in self.tally.met.items():
            if unmet := len(self) - met.count:
                named = ", ".join(map(str, met.unmet)) + ", ..." * (unmet > len(met.unmet))
                parts.append(f"{unmet} of {len(self)} cases not {self.requirement_label(what)}: {named}")
        return "; ".join(parts) or None

    @cached_property
    def shares(self) -> tuple[Share, ...]:
        """Shares of cases done at once, in each phase, and never, with confidence intervals."""
        return shares(labels(self.search), self.tally.phases.tolist())
