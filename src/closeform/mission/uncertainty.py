"""What errors make of a stage: by how many sigmas pairs are clear, how probable collisions are."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf
from typing import Self

from closeform.conflicts.flight import WatchedFlight, watch
from closeform.mission.verdict import Asked
from closeform.scenario import Scenario, StageTable
from closeform.uncertainty.errors import Uncertainty
from closeform.uncertainty.propagated_errors import carried
from closeform.uncertainty.uncertain_flight import MOST_BURNS, MOST_PROBABLE, UncertainFlight, UncertainPair
from closeform.zones.shapes import BALL

SURE = 1.0 - 1e-9  # of sigmas that a plan was to keep, to which they are certain
TOLD_LAST = 1e-12  # a margin below those of limits
UNTOLD = 1e-6  # probabilities up to which nobody needs a word beside "clear"


@dataclass(frozen=True, eq=False)
class UncertainStage:
    """The pairs of a stage with errors, the fewest sigmas first.

    `errors` (N,) of the craft at its start; `zones`: clear of keep-out zones by how many sigmas, None where
    there are none; `bodies`: the same of the hard bodies, and how probable it is that they ever touch.
    """

    number: int
    stage: StageTable
    errors: tuple[Uncertainty | None, ...]
    zones: UncertainFlight | None
    bodies: UncertainFlight | None

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        number: int,
        stage: StageTable,
        flight: WatchedFlight,
        errors: Sequence[Uncertainty | None],
    ) -> Self:
        """From a stage as flown, and the errors of all craft when it begins."""
        sigmas, limit = stage.sigmas or 0.0, stage.max_probability or inf
        zones = bodies = None
        if scenario.zones.pairs and any(craft.keep_out is not None for craft in scenario.craft):
            zones = UncertainFlight.of(flight, errors, sigmas, probable=0)
        if scenario.bodies.pairs:
            touching = watch(flight.paths, flight.names, scenario.bodies)
            bodies = UncertainFlight.of(touching, errors, sigmas, limit=limit)
        return cls(number, stage, tuple(errors), zones, bodies)

    def after(self, flight: WatchedFlight) -> tuple[Uncertainty | None, ...]:
        """The errors of all craft when it is over."""
        return tuple(
            None if one is None else carried(one, flight.path(name))
            for name, one in zip(flight.names, self.errors, strict=True)
        )

    @property
    def nearest(self) -> UncertainPair | None:
        """The pair that is clear by the fewest sigmas: of its keep-out zone, else of the hard bodies."""
        judged = self.zones or self.bodies
        return judged.pairs[0] if judged is not None and judged.pairs else None

    @property
    def likeliest(self) -> UncertainPair | None:
        """The pair whose hard bodies touch with the highest probability."""
        pairs = self.bodies.pairs if self.bodies is not None else ()
        told = [(pair.probability.high, pair) for pair in pairs if pair.probability is not None]
        return max(told, key=lambda one: one[0], default=(0.0, None))[1]

    @property
    def undrawn(self) -> UncertainPair | None:
        """A pair whose probability should be known, and is not."""
        pairs = self.bodies.pairs[:MOST_PROBABLE] if self.bodies is not None else ()
        return next((pair for pair in pairs if pair.probability is None), None)

    @property
    def asked(self) -> Iterator[Asked]:
        """What the stage asks for, and whether it is so."""
        where = f"stage {self.number} ({self.stage.verb})"
        if self.stage.sigmas is not None:
            many, near = f"{self.stage.sigmas:g} sigma", self.nearest
            met = near is None or near.sigmas >= SURE * self.stage.sigmas
            least = fewest(near)
            margin = inf if near is None else near.sigmas / self.stage.sigmas
            yield Asked(
                f"clear at {many} ({least})",
                f"not clear at {many} in {where}: {least}",
                met,
                margin,
                "sigmas",
            )
        yield from self.likely(where)

    def likely(self, where: str) -> Iterator[Asked]:
        """How probable a collision is in a stage, called so: beside its limit, or told where it has none."""
        limit, pair = self.stage.max_probability, self.likeliest
        high = 0.0 if pair is None or pair.probability is None else pair.probability.high
        who = "" if pair is None else f" of {pair.first} - {pair.second}"
        words = f"probability of collision{who} up to {high:.3g}"
        if limit is None:
            if high > UNTOLD:
                yield Asked(f"{words}, without a limit", "", True, TOLD_LAST / high, "likelihood")
            return
        if unknown := self.undrawn:
            who = f"{unknown.first} - {unknown.second}"
            words = f"probability of collision of {who} is not known, with more than {MOST_BURNS} burns"
            yield Asked("", f"{words}, in {where}", False, 0.0, "probability")
            return
        broken, margin = f"{words}, above {limit:g} in {where}", limit / high if high > 0.0 else inf
        yield Asked(f"{words}, {limit:g} at most", broken, high <= limit, margin, "probability")


def fewest(pair: UncertainPair | None) -> str:
    """By how many sigmas a pair is clear at least, and when."""
    if pair is None:
        return "nothing is uncertain"
    if pair.sigmas == inf:
        return "no error of any size brings two craft together"
    return f"least {pair.sigmas:.3g} sigma, {pair.first} - {pair.second} at {pair.time:.1f} s"


def radius(pair: UncertainPair) -> float | None:
    """Of the sphere that holds both hard bodies [m]; None of another zone."""
    return float(pair.zone.support([1.0, 0.0, 0.0])) if pair.zone.shape == BALL else None
