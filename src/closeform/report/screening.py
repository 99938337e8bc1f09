"""The report of a screening: real ephemerides in a common frame, and who comes near whom."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from closeform.conflicts.flight import Flight
from closeform.exchange.common_frame import CommonFrame
from closeform.report import conflicts
from closeform.report.conflicts import MOST_PAIRS
from closeform.report.table import Table, counted
from closeform.report.uncertain import SIGMAS, row
from closeform.verdict import MOST_NAMES, Verdict, conflicts_in

if TYPE_CHECKING:  # which a screening without errors can spare
    from closeform.uncertainty.uncertain_flight import UncertainFlight


@dataclass(frozen=True, eq=False)
class ScreenReport:
    """What there is to say of a flight along ephemerides in a frame."""

    frame: CommonFrame
    flight: Flight
    uncertain: "UncertainFlight | None" = None

    @property
    def opening(self) -> tuple[str, ...]:
        """What was screened."""
        frame = self.frame
        return (
            f"{len(frame.names)} craft, {len(frame.times)} common epochs from {frame.epoch} "
            f"{frame.time_system}, {frame.times[-1] - frame.times[0]:.1f} s",
            f"Frame: radial, along-track (arc), cross-track of {frame.names[0]}, "
            f"on a circle of {frame.radius / 1e3:.3f} km",
            *self.interpolated,
            *self.known,
        )

    @property
    def interpolated(self) -> tuple[str, ...]:
        """Whose states were interpolated to common epochs, and how far they may be off."""
        pairs = zip(self.frame.names, self.frame.interpolation_errors.tolist(), strict=True)
        moved = {name: error for name, error in pairs if error > 0.0}
        if not moved:
            return ()
        worst = max(moved, key=lambda name: moved[name])
        names = ", ".join(list(moved)[:MOST_NAMES]) + f" and {len(moved) - MOST_NAMES} more" * (
            len(moved) > MOST_NAMES
        )
        return (f"States of {names} interpolated, off by up to {moved[worst]:.2g} m ({worst}), by estimate",)

    @property
    def known(self) -> tuple[str, ...]:
        """Whose covariances were taken, how old they were, and who is taken for known exactly."""
        if self.uncertain is None:
            return ()
        pairs = [
            (name, age)
            for name, age in zip(self.frame.names, self.frame.ages, strict=True)
            if age is not None
        ]
        oldest = max(pairs, key=lambda pair: abs(pair[1]))
        line = f"Covariances of {counted(len(pairs), 'ephemeris', 'ephemerides')}"
        if oldest[1]:
            line += f", carried by Hill's equations for up to {abs(oldest[1]):.1f} s ({oldest[0]})"
        exact, looked = self.uncertain.exact, len(self.flight.approaches)
        told = [line, *([f"Taken for known exactly: {', '.join(exact)}"] if exact else [])]
        if looked < self.flight.pairs:
            told.append(f"Sigmas of the {looked} closest of {self.flight.pairs} pairs only")
        return tuple(told)

    @property
    def sigmas(self) -> tuple[Table, ...]:
        """By how many sigmas pairs are clear, and how probable it is that they meet."""
        if self.uncertain is None:
            return ()
        rows = [row(pair) for pair in self.uncertain.pairs[:MOST_PAIRS]]
        return (Table("Clearance in sigmas, and probability to come within the zone", SIGMAS, rows),)

    @cached_property
    def found(self) -> tuple[tuple[str, ...], tuple[Table, ...]]:
        """Conflicts in words, and as tables."""
        lines, tables = conflicts.listed("Conflicts", self.flight)
        return tuple(lines), tuple(tables)

    @property
    def lines(self) -> tuple[str, ...]:
        """How near samples tell, which zones held, and who is in conflict."""
        return (*conflicts.between_samples(self.flight), *conflicts.zones(self.flight), *self.found[0])

    @property
    def tables(self) -> tuple[Table, ...]:
        """Conflicts and closest approaches."""
        return (*self.found[1], *conflicts.approaches("Closest approaches", self.flight), *self.sigmas)

    @property
    def verdict(self) -> Verdict:
        """Whether they are clear of each other."""
        if self.uncertain is None:
            return Verdict(None, *conflicts_in([self.flight]), exceeded=None, searched=False)
        within = len(self.uncertain.within)
        return Verdict(None, within, within, exceeded=None, searched=False, sigmas=self.uncertain.sigmas)
