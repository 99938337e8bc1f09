"""Uncertainty results of a stage: the sigma clearance of pairs and the collision probability."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf
from typing import Self

from closeform.conflicts.flight import WatchedFlight, watch
from closeform.mission.verdict import Asked
from closeform.scenario import Scenario, StageTable
from closeform.uncertainty.covariance_propagation import uncertainty_at_end
from closeform.uncertainty.errors import Uncertainty
from closeform.uncertainty.uncertain_flight import MOST_BURNS, MOST_PROBABLE, UncertainFlight, UncertainPair
from closeform.zones.shapes import BALL

SURE = 1.0 - 1e-9  # fraction of the required sigmas that counts as met, for rounding
TOLD_LAST = 1e-12  # scale of margins that rank below the margins of limits
UNTOLD = 1e-6  # largest probability that is left out of the verdict if the stage has no limit


@dataclass(frozen=True, eq=False)
class UncertainStage:
    """Sigma clearances and collision probabilities of the pairs of a stage, lowest clearance first.

    `errors` (N,) is the uncertainty of each spacecraft at the start of the stage.  `zones` holds the
    clearances of keep-out zones; it is None without zones.  `bodies` holds the clearances of hard bodies and
    the probability that they touch; it is None without hard bodies.
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
        """Evaluate a stage from its flight and the uncertainty (N,) of all spacecraft at its start."""
        sigmas, limit = stage.sigmas or 0.0, stage.max_probability or inf
        zones = bodies = None
        if scenario.zones.pairs and any(craft.keep_out is not None for craft in scenario.craft):
            zones = UncertainFlight.of(flight, errors, sigmas, probable=0)
        if scenario.bodies.pairs:
            touching = watch(flight.paths, flight.names, scenario.bodies)
            bodies = UncertainFlight.of(touching, errors, sigmas, limit=limit)
        return cls(number, stage, tuple(errors), zones, bodies)

    def after(self, flight: WatchedFlight) -> tuple[Uncertainty | None, ...]:
        """Return the uncertainty (N,) of all spacecraft at the end of the stage."""
        return tuple(
            None if one is None else uncertainty_at_end(one, flight.path(name))
            for name, one in zip(flight.names, self.errors, strict=True)
        )

    @property
    def nearest(self) -> UncertainPair | None:
        """Pair with the lowest sigma clearance of keep-out zones or, without zones, of hard bodies."""
        judged = self.zones or self.bodies
        return judged.pairs[0] if judged is not None and judged.pairs else None

    @property
    def likeliest(self) -> UncertainPair | None:
        """Pair with the highest collision probability of its hard bodies."""
        pairs = self.bodies.pairs if self.bodies is not None else ()
        known_odds = [(pair.probability.high, pair) for pair in pairs if pair.probability is not None]
        return max(known_odds, key=lambda one: one[0], default=(0.0, None))[1]

    @property
    def undrawn(self) -> UncertainPair | None:
        """First of the pairs with the lowest clearances whose probability could not be computed."""
        pairs = self.bodies.pairs[:MOST_PROBABLE] if self.bodies is not None else ()
        return next((pair for pair in pairs if pair.probability is None), None)

    @property
    def asked(self) -> Iterator[Asked]:
        """Requirements of the stage on clearance and probability, and whether they are met."""
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
        """Yield the requirement on the collision probability; `where` names the stage in its text.

        If there is no limit, the probability is reported as a requirement that is always met.
        """
        limit, pair = self.stage.max_probability, self.likeliest
        high = 0.0 if pair is None or pair.probability is None else pair.probability.high
        pair_names = "" if pair is None else f" of {pair.first} - {pair.second}"
        words = f"probability of collision{pair_names} up to {high:.3g}"
        if limit is None:
            if high > UNTOLD:
                yield Asked(f"{words}, without a limit", "", True, TOLD_LAST / high, "likelihood")
            return
        if unknown := self.undrawn:
            pair_names = f"{unknown.first} - {unknown.second}"
            words = (
                f"probability of collision of {pair_names} is not known, with more than {MOST_BURNS} burns"
            )
            yield Asked("", f"{words}, in {where}", False, 0.0, "probability")
            return
        broken, margin = f"{words}, above {limit:g} in {where}", limit / high if high > 0.0 else inf
        yield Asked(f"{words}, {limit:g} at most", broken, high <= limit, margin, "probability")


def fewest(pair: UncertainPair | None) -> str:
    """Return text with the minimum sigma clearance of a pair and its time."""
    if pair is None:
        return "nothing is uncertain"
    if pair.sigmas == inf:
        return "no error of any size brings two craft together"
    return f"minimum {pair.sigmas:.3g} sigma, {pair.first} - {pair.second} at {pair.time:.1f} s"


def radius(pair: UncertainPair) -> float | None:
    """Return the radius [m] of the combined sphere of both hard bodies; None for another shape."""
    return float(pair.zone.support([1.0, 0.0, 0.0])) if pair.zone.shape == BALL else None
