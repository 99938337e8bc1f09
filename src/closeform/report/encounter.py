"""The report of a conjunction message: how near, how many sigmas clear, how probable, and by which method."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from closeform.exchange.conjunction import Conjunction
from closeform.report.table import Column, Table
from closeform.uncertainty.clearance import SigmaApproach
from closeform.uncertainty.encounter import Encounter
from closeform.uncertainty.probability import Probability
from closeform.verdict import MET, NOT_MET

FIGURES = (
    Column("figure", "figure", words=True),
    Column("what it counts or assumes", "counts", words=True),
    Column("value", "value", "{:.5g}".format),
    Column("95 % interval", None, "{:.5g} to {:.5g}".format, parts=("low", "high")),
)
EDGE = 0.01  # of the probability, and of the greatest rate: what an edge of the window may have


@dataclass(frozen=True)
class Judgement:
    """Whether a probability is as small as was asked for, if anything was."""

    value: float
    limit: float | None

    @property
    def status(self) -> int:
        """The exit status of the command."""
        return MET if self.limit is None or self.value <= self.limit else NOT_MET

    def __str__(self) -> str:
        if self.limit is None:
            return f"collision probability {self.value:.5g}"
        found, how = ("clear", "at most") if self.status == MET else ("not clear", "above")
        return f"{found}: collision probability {self.value:.5g}, {how} {self.limit:g}"


@dataclass(frozen=True, eq=False)
class EncounterReport:
    """What there is to say of a conjunction message, with bodies of some `radius` [m] together."""

    message: Conjunction
    radius: float
    encounter: Encounter
    clearance: SigmaApproach
    probability: Probability
    short: Probability | None  # None where the two do not pass each other in the window
    limit: float | None

    @property
    def opening(self) -> tuple[str, ...]:
        """Who meets whom, how near and how fast."""
        message, encounter = self.message, self.encounter
        first, second = (f"{each.name} ({each.designator})" for each in message.objects)
        place = ", ".join(
            f"{axis} {value:.3f}"
            for axis, value in zip(
                ("radial", "along-track", "cross-track"), message.relative_state, strict=False
            )
        )
        span = encounter.path.end
        return (
            f"{first} and {second}, closest at {message.tca} UTC",
            f"Miss distance {encounter.distance:.3f} m ({place}), relative speed {encounter.speed:.6g} m/s",
            f"Radius of both bodies {self.radius:g} m; followed for {span:.6g} s before and after, "
            f"in the Hill frame of {message.objects[0].name}",
        )

    @property
    def lines(self) -> tuple[str, ...]:
        """The clearance in sigmas, and why figures may be off."""
        sigmas, time = float(self.clearance.sigmas), round(float(self.clearance.time), 1) + 0.0
        clear = f"Clear by {sigmas:.4g} sigmas, fewest at {time:.1f} s"
        if sigmas == 0.0:
            clear = f"Clear by 0 sigmas: the bodies overlap even without errors, most at {time:.1f} s"
        return (clear, *self.notes, *(f"Warning: {line}" for line in self.encounter.warnings))

    @property
    def notes(self) -> Iterator[str]:
        """What the window leaves out."""
        if self.short is None:
            yield "No short encounter: the two are nearest at an edge of the window, and do not pass"
        found = self.probability
        grows = len(found.rates) > 0 and found.rates[-1] > EDGE * found.rates.max()
        if found.at_start > EDGE * found.value or grows:
            yield "The probability still grows at an edge of the window: a longer --window gives more"

    @property
    def tables(self) -> Sequence[Table]:
        """The probabilities beside each other."""
        found, short, message = self.probability, self.short, self.message
        sure = found.low, found.high
        rows = [
            ("ever inside", "histories that touch, however often", found.value, sure),
            ("inside at the start", "a part of it", found.at_start, None),
            ("mean entries", "entries after the start, each counted", found.mean_entries, None),
            ("short encounter (2-D)", "straight flight, errors of one instant", short and short.value, None),
        ]
        if message.collision_probability is not None:
            method = message.collision_probability_method or "method not told"
            rows.append(("the message", method, message.collision_probability, None))
        return (Table("Probability of collision", FIGURES, rows),)

    @property
    def verdict(self) -> Judgement:
        """Whether the probability is as small as was asked for."""
        return Judgement(self.probability.value, self.limit)
