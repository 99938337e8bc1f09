"""Pairs of a flight whose states have errors: how many sigmas are clear, how probable a meeting is."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Self

import numpy as np
from scipy.special import gammaincc

from closeform.conflicts.flight import PairApproach, WatchedFlight
from closeform.uncertainty.clearance import clearance_in_sigmas
from closeform.uncertainty.columns import burning, errs
from closeform.uncertainty.errors import Uncertainty
from closeform.uncertainty.mean_entries import Unresolved
from closeform.uncertainty.probability import Probability, collision_probability
from closeform.zones.shapes import BALL
from closeform.zones.zone import Zone

MOST_PROBABLE = 10  # pairs, the fewest sigmas first, whose probability is told
MOST_BURNS = 60  # of two craft, of which histories are drawn: each has up to four errors of its own
HISTORIES = 200_000  # that are drawn where the surface of a zone is not resolved

NONE = np.empty(0)
NEVER = Probability(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, NONE, NONE, "bound", 0)  # of who no error brings together


@dataclass(frozen=True, eq=False)
class UncertainPair:
    """Two craft by name that are clear of a `zone` by `sigmas` at least, fewest at `time` [s].

    `probability` that they are ever within it; None where others are nearer, the zone is no sphere and no
    ellipsoid, or there are too many burns with errors of their own.
    """

    first: str
    second: str
    sigmas: float
    time: float
    zone: Zone
    probability: Probability | None


@dataclass(frozen=True, eq=False)
class UncertainFlight:
    """The pairs of a flight of which anything is uncertain, the fewest sigmas first.

    `exact`: who has no errors; `sigmas`: by how many pairs were to be clear.  `any_pair`: what the
    probability that any two ever meet is not above, the sum over all; None where that of some is not known.
    """

    pairs: tuple[UncertainPair, ...]
    exact: tuple[str, ...]
    sigmas: float
    any_pair: float | None

    @classmethod
    def of(
        cls,
        flight: WatchedFlight,
        errors: Sequence[Uncertainty | None],
        sigmas: float,
        probable: int = MOST_PROBABLE,
        limit: float = inf,
    ) -> Self:
        """From the approaches of a flight, and the errors of its craft in order.

        The probability is that of so many pairs, and of all others that are not below a `limit` for certain.
        """
        known = {name: one or Uncertainty() for name, one in zip(flight.names, errors, strict=True)}
        exact = tuple(name for name, one in zip(flight.names, errors, strict=True) if one is None)
        off = {name for name, one in known.items() if errs(flight.path(name), one)}
        pairs = [near for near in flight.approaches if near.first in off or near.second in off]
        found = sorted(_clearances(flight, pairs, known), key=lambda one: one[:2])
        told, total = [], 0.0
        for place, (clear, time, near) in enumerate(found):
            probability, most = None, at_most(flight, near, known, clear)
            looked = place < probable or limit < inf
            if looked and near.zone.shape == BALL and few_burns(flight, near, known):
                sure = place >= probable and most <= limit
                probability = None if sure else NEVER if most == 0.0 else probability_of(flight, near, known)
            told.append(UncertainPair(near.first, near.second, clear, time, near.zone, probability))
            total += most if probability is None else min(most, probability.high)
        return cls(tuple(told), exact, sigmas, total if total < 1.0 else None)

    @property
    def within(self) -> tuple[UncertainPair, ...]:
        """The pairs that are not clear by so many sigmas."""
        return tuple(pair for pair in self.pairs if pair.sigmas < self.sigmas)


def few_burns(flight: WatchedFlight, near: PairApproach, known: Mapping[str, Uncertainty]) -> bool:
    """Whether two craft have few enough burns and impulses with errors that histories can be drawn."""
    return sum(fired(flight, near, known)) <= MOST_BURNS


def fired(flight: WatchedFlight, near: PairApproach, known: Mapping[str, Uncertainty]) -> tuple[int, int]:
    """How many burns and impulses with errors two craft have."""
    burns = impulses = 0
    for name in (near.first, near.second):
        path, errors = flight.path(name), known[name]
        if errors.magnitude or errors.pointing or any(errors.impulse):
            burns, impulses = burns + len(burning(path)), impulses + len(path.impulses)
    return burns, impulses


def probability_of(
    flight: WatchedFlight, near: PairApproach, known: Mapping[str, Uncertainty]
) -> Probability:
    """That two craft ever come within their zone: as exactly as their errors allow."""
    first, second = near.first, near.second
    asked = flight.path(first), flight.path(second), near.zone, known[first], known[second]
    if known[first].noise or known[second].noise:  # has no histories that could be drawn
        return collision_probability(*asked, method="bound")
    try:
        return collision_probability(*asked)
    except Unresolved:
        return collision_probability(*asked, method="monte-carlo", samples=HISTORIES)


def at_most(
    flight: WatchedFlight, near: PairApproach, known: Mapping[str, Uncertainty], sigmas: float
) -> float:
    """What the probability of two craft is not above, clear by some sigmas: errors beyond these."""
    if known[near.first].noise or known[near.second].noise:
        return 1.0
    burns, impulses = fired(flight, near, known)
    size = 6 + 4 * burns + 3 * impulses  # of the relative state, of strengths and directions
    return float(gammaincc(0.5 * size, 0.5 * sigmas**2))


def _clearances(
    flight: WatchedFlight, pairs: Sequence[PairApproach], known: Mapping[str, Uncertainty]
) -> Iterator[tuple[float, float, PairApproach]]:
    """Sigmas and when they are fewest [s], of pairs of one zone after another."""
    place = {name: k for k, name in enumerate(flight.names)}
    groups: dict[Zone, list[PairApproach]] = {}
    for near in pairs:
        groups.setdefault(near.zone, []).append(near)
    for zone, some in groups.items():
        first, second = [near.first for near in some], [near.second for near in some]
        one, other = (flight.paths[[place[name] for name in names]] for names in (first, second))
        errors, other_errors = ([known[name] for name in names] for names in (first, second))
        close = clearance_in_sigmas(one, other, zone, errors, other_errors)
        yield from zip(close.sigmas.tolist(), close.time.tolist(), some, strict=True)
