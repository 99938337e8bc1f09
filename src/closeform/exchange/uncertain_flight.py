"""Pairs of a flight whose states have errors: how many sigmas are clear, how probable a meeting is."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from closeform.conflicts.flight import Flight, PairApproach
from closeform.uncertainty.clearance import clearance_in_sigmas
from closeform.uncertainty.errors import Errors
from closeform.uncertainty.probability import Probability, collision_probability
from closeform.zones.shapes import BALL
from closeform.zones.zone import Zone

MOST_PROBABLE = 10  # pairs, the fewest sigmas first, whose probability is told


@dataclass(frozen=True, eq=False)
class UncertainPair:
    """Two craft by name that are clear by `sigmas` at least, fewest at `time` [s].

    `probability` that they are ever within the zone; None where others are nearer, or the zone is no sphere
    and no ellipsoid.
    """

    first: str
    second: str
    sigmas: float
    time: float
    probability: Probability | None


@dataclass(frozen=True, eq=False)
class UncertainFlight:
    """The pairs of a flight, the fewest sigmas first.

    `exact`: who has no errors; `sigmas`: by how many pairs were to be clear.
    """

    pairs: tuple[UncertainPair, ...]
    exact: tuple[str, ...]
    sigmas: float

    @classmethod
    def of(cls, flight: Flight, errors: Sequence[Errors | None], sigmas: float) -> Self:
        """From the approaches of a flight, and the errors of its craft in order."""
        known = {name: one or Errors() for name, one in zip(flight.names, errors, strict=True)}
        exact = tuple(name for name, one in zip(flight.names, errors, strict=True) if one is None)
        pairs = [near for near in flight.approaches if near.first not in exact or near.second not in exact]
        found = sorted(_clearances(flight, pairs, known), key=lambda one: one[:2])
        told = []
        for place, (clear, time, near) in enumerate(found):
            probability = None
            if place < MOST_PROBABLE and near.zone.shape == BALL:
                first, second = near.first, near.second
                paths = flight.path(first), flight.path(second)
                probability = collision_probability(*paths, near.zone, known[first], known[second])
            told.append(UncertainPair(near.first, near.second, clear, time, probability))
        return cls(tuple(told), exact, sigmas)

    @property
    def within(self) -> tuple[UncertainPair, ...]:
        """The pairs that are not clear by so many sigmas."""
        return tuple(pair for pair in self.pairs if pair.sigmas < self.sigmas)


def _clearances(
    flight: Flight, pairs: Sequence[PairApproach], known: Mapping[str, Errors]
) -> Iterator[tuple[float, float, PairApproach]]:
    """Sigmas and when they are fewest [s], of pairs of one zone after another."""
    groups: dict[Zone, list[PairApproach]] = {}
    for near in pairs:
        groups.setdefault(near.zone, []).append(near)
    for zone, some in groups.items():
        first, second = [near.first for near in some], [near.second for near in some]
        one, other = (flight.paths[[flight.names.index(name) for name in names]] for names in (first, second))
        errors, other_errors = ([known[name] for name in names] for names in (first, second))
        close = clearance_in_sigmas(one, other, zone, errors, other_errors)
        yield from zip(close.sigmas.tolist(), close.time.tolist(), some, strict=True)
