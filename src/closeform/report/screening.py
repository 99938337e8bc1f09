"""The report of a screening: real ephemerides in a common frame, and who comes near whom."""

from dataclasses import dataclass
from functools import cached_property

from closeform.conflicts.flight import Flight
from closeform.exchange.common_frame import CommonFrame
from closeform.report import conflicts
from closeform.report.table import Table
from closeform.verdict import MOST_NAMES, Verdict, conflicts_in


@dataclass(frozen=True, eq=False)
class ScreenReport:
    """What there is to say of a flight along ephemerides in a frame."""

    frame: CommonFrame
    flight: Flight

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
        return (*self.found[1], *conflicts.approaches("Closest approaches", self.flight))

    @property
    def verdict(self) -> Verdict:
        """Whether they are clear of each other."""
        return Verdict(None, *conflicts_in([self.flight]), exceeded=None, searched=False)
