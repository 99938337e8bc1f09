"""What flights in a field have come to: who enters a zone, whose limits are kept; or why there are none."""

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

from closeform.confidence import estimate
from closeform.verdict import MET, NOT_MET, Asked, Use, beyond

if TYPE_CHECKING:
    from closeform.flown_run import FlownRun


@dataclass(frozen=True)
class Entered:
    """How many flights in a field enter a zone, `least` ratio (None without); alike unless `uncertain`.

    `exceeded`: who spends more than there is in the dearest flight, None without any limit.
    """

    count: int
    flights: int
    least: float | None
    uncertain: bool
    exceeded: tuple[Use, ...] | None = None

    @property
    def clear(self) -> bool:
        """Whether none does."""
        return self.count == 0

    @property
    def ok(self) -> bool:
        """Whether none does, and every limit is kept."""
        return self.clear and not self.exceeded

    @property
    def status(self) -> int:
        """The exit status."""
        return MET if self.ok else NOT_MET

    @property
    def many(self) -> str:
        """The flights in words."""
        return f"{self.flights} flight{'s' * (self.flights != 1)}"

    @property
    def asked(self) -> Asked:
        """The same as part of what a run comes to."""
        if self.least is None:
            return Asked(f"{self.many} flown, there is no zone to enter", "", True, inf, "flight")
        if self.flights == 1:
            kept, broken = "no zone is entered in flight", "a zone is entered in flight"
        else:
            kept = f"no zone is entered in {self.many}"
            broken = f"zones are entered in {self.count} of {self.many}"
        least = f", least {self.least:.4f} x zone"
        return Asked(kept + least, broken + least, self.clear, self.least - 1.0, "flight")

    @property
    def zones(self) -> str:
        """Whether zones are entered, in words."""
        if self.least is None:
            return f"flown: {self.many}, there is no zone to enter"
        found = (
            "clear: no zone is entered in"
            if self.clear
            else f"violated: zones are entered in {self.count} of"
        )
        likely = str(estimate(self.count, self.flights)) if self.uncertain else "nothing is uncertain"
        return f"{found} {self.many} ({likely}), least {self.least:.4f} x zone"

    def __str__(self) -> str:
        if self.exceeded is None:
            return self.zones
        if not self.exceeded:
            return f"{self.zones}; limits are kept"
        return f"{self.zones}; limits are not kept: {beyond(self.exceeded)}"


def in_flight(flights: "FlownRun | None", grounded: str | None) -> tuple[Asked, ...]:
    """What flights that were asked for come to as part of a run; or why it is `grounded`."""
    if grounded is not None:
        return (Asked("", f"cannot be flown: {grounded}", False, 0.0, "flight"),)
    return () if flights is None else (flights.entered.asked,)
