"""Shadow prices of clearance: slopes of a plan's cost with the size of its zones, from the multipliers.

At a contact the path keeps the supporting plane a . (r_i - r_j) >= h(a) of the zone, with h(a) the zone's
extent along the normal a.  By the envelope theorem the minimum cost rises with h(a) at the rate of the
contact's multiplier, whatever else the plan changes.  A zone enlarged by d in every direction extends to h +
d; one enlarged by a factor extends to factor times h.                                 # theory (21b)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from closeform.result import Result

if TYPE_CHECKING:
    from closeform.planning.plan import Contact


@dataclass(frozen=True, repr=False)
class ShadowPrice(Result):
    """Shadow price of the clearance between two craft: slope of a plan's cost with the size of their zone.

    Other zones, end states and times stay fixed; all paths adapt at minimum cost.

    Attributes
    ----------
    first, second : int
        Indices of the two craft; N + k is obstacle k of a plan of N craft.
    per_metre : float [m/s^3, of delta-v 1/s]
        Cost per metre by which the zone grows in every direction, in m^2/s^3 or m/s of delta-v per metre.
    per_factor : float [m^2/s^3, of delta-v m/s]
        Cost per unit of the factor by which the zone is enlarged about its origin: a hundredth of it for a
        zone that is 1 % larger.
    per_sigma : float [m^2/s^3, of delta-v m/s]
        Cost per additional standard deviation of the errors that is kept clear; 0 without errors.
    """

    first: int
    second: int
    per_metre: float
    per_factor: float
    per_sigma: float = 0.0


def prices_of(contacts: Sequence[Contact], margin: float) -> tuple[ShadowPrice, ...]:
    """Return the shadow price of each pair in contact, the highest per metre first.

    `margin` is the factor by which the zones were enlarged for planning.
    """
    found: dict[tuple[int, int], tuple[float, float, float]] = {}
    for one in contacts:
        metre, factor, sigma = found.get((one.first, one.second), (0.0, 0.0, 0.0))
        own = margin * one.multiplier
        found[one.first, one.second] = metre + own, factor + own * one.reach, sigma + own * one.sigma
    prices = (ShadowPrice(*pair, *slopes) for pair, slopes in found.items())
    return tuple(sorted(prices, key=lambda price: -price.per_metre))
