"""Pairs of a flight with uncertain states: their sigma clearance and collision probability."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Self

import numpy as np
from scipy.special import gammaincc

from closeform.conflicts.flight import PairApproach, WatchedFlight
from closeform.uncertainty.clearance import clearance_in_sigmas
from closeform.uncertainty.collision.expected_entries import Unresolved
from closeform.uncertainty.error_columns import burn_ranges, has_errors
from closeform.uncertainty.errors import Uncertainty
from closeform.uncertainty.probability import Probability, collision_probability
from closeform.zones.shapes import BALL
from closeform.zones.zone import Zone

MOST_PROBABLE = 10  # pairs with the fewest sigmas whose probability is computed
MOST_BURNS = 60  # maximum number of burns of two craft for sampling; each has up to four errors
SAMPLES = 200_000  # samples if the surface of a zone is not resolved

NONE = np.empty(0)
# of pairs without any possible conflict
NEVER = Probability(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, NONE, NONE, "bound", 0)


@dataclass(frozen=True, eq=False)
class UncertainPair:
    """Two craft by name that are clear of a `zone` by at least `sigmas`, with the minimum at `time` [s].

    `probability` of a conflict; None for pairs with more sigmas than others, for a zone that is neither a
    sphere nor an ellipsoid, or with too many burn errors.
    """

    first: str
    second: str
    sigmas: float
    time: float
    zone: Zone
    probability: Probability | None


@dataclass(frozen=True, eq=False)
class UncertainFlight:
    """Pairs of a flight with any uncertainty, the fewest sigmas first.

    `exact`: craft without errors; `sigmas`: the required clearance. `any_pair`: an upper bound on the
    probability that any pair has a conflict, the sum over all pairs; None if it is unknown.
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
        """Return the pairs of a flight from its approaches, and the uncertainties of its craft in order.

        The probability is computed for the first `probable` pairs, and for all others that are not certainly
        below `limit`.
        """
        known = {name: one or Uncertainty() for name, one in zip(flight.names, errors, strict=True)}
        exact = tuple(name for name, one in zip(flight.names, errors, strict=True) if one is None)
        off = {name for name, one in known.items() if has_errors(flight.path(name), one)}
        pairs = [near for near in flight.approaches if near.first in off or near.second in off]
        found = sorted(_clearances(flight, pairs, known), key=lambda one: one[:2])
        rows, total = [], 0.0
        for place, (clear, time, near) in enumerate(found):
            probability, most = None, probability_bound(flight, near, known, clear)
            chosen = place < probable or limit < inf
            if chosen and near.zone.shape == BALL and can_be_sampled(flight, near, known):
                sure = place >= probable and most <= limit
                probability = None if sure else NEVER if most == 0.0 else probability_of(flight, near, known)
            rows.append(UncertainPair(near.first, near.second, clear, time, near.zone, probability))
            total += most if probability is None else min(most, probability.high)
        return cls(tuple(rows), exact, sigmas, total if total < 1.0 else None)

    @property
    def within(self) -> tuple[UncertainPair, ...]:
        """Pairs with less than the required clearance."""
        return tuple(pair for pair in self.pairs if pair.sigmas < self.sigmas)


def can_be_sampled(flight: WatchedFlight, near: PairApproach, known: Mapping[str, Uncertainty]) -> bool:
    """Return True if two craft have few enough burns and impulses with errors for sampling."""
    return sum(burn_counts(flight, near, known)) <= MOST_BURNS


def burn_counts(
    flight: WatchedFlight, near: PairApproach, known: Mapping[str, Uncertainty]
) -> tuple[int, int]:
    """Return the numbers of burns and impulses with errors of two craft."""
    burns = impulses = 0
    for name in (near.first, near.second):
        path, errors = flight.path(name), known[name]
        if errors.magnitude or errors.pointing or any(errors.impulse):
            burns, impulses = burns + len(burn_ranges(path)), impulses + len(path.impulses)
    return burns, impulses


def probability_of(
    flight: WatchedFlight, near: PairApproach, known: Mapping[str, Uncertainty]
) -> Probability:
    """Return the probability of a conflict of two craft, as exactly as their errors allow."""
    first, second = near.first, near.second
    asked = flight.path(first), flight.path(second), near.zone, known[first], known[second]
    if known[first].noise or known[second].noise:  # process noise: a bound instead of samples
        return collision_probability(*asked, method="bound")
    try:
        return collision_probability(*asked)
    except Unresolved:
        return collision_probability(*asked, method="monte-carlo", samples=SAMPLES)


def probability_bound(
    flight: WatchedFlight, near: PairApproach, known: Mapping[str, Uncertainty], sigmas: float
) -> float:
    """Return an upper bound on the probability of a conflict from the sigma clearance."""
    if known[near.first].noise or known[near.second].noise:
        return 1.0
    burns, impulses = burn_counts(flight, near, known)
    size = 6 + 4 * burns + 3 * impulses  # errors of the relative state, of burns and of impulses
    return float(gammaincc(0.5 * size, 0.5 * sigmas**2))


def _clearances(
    flight: WatchedFlight, pairs: Sequence[PairApproach], known: Mapping[str, Uncertainty]
) -> Iterator[tuple[float, float, PairApproach]]:
    """Yield the sigma clearance of each pair and its time [s], one zone after another."""
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
