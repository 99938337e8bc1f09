"""What clearance costs: the slope of a plan's cost by the size of its zones, from contacts' multipliers.

At a contact the path keeps the plane a . (r_i - r_j) >= h(a) that supports the zone, h(a) being how far the
zone reaches along the normal a.  By the envelope theorem the least cost rises with h(a) at the rate of the
contact's multiplier, whatever else the plan changes.  A zone that grows by d in every direction reaches
h + d, one that is enlarged by a factor reaches factor times h.                                # theory (21b)
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
    """What more clearance between two craft costs: how fast a plan's cost rises with the size of their zone.

    Other zones stay as they are, as do states and times at the ends; all paths give way as is cheapest.

    Attributes
    ----------
    first, second : int
        The two craft by index; N + k is obstacle k of a plan of N craft.
    per_metre : float [m/s^3, of delta-v 1/s]
        For each metre by which the zone grows in every direction: of energy m^2/s^3, of delta-v m/s.
    per_factor : float [m^2/s^3, of delta-v m/s]
        For a zone enlarged about its origin, for each 1 by which the factor grows: a hundredth of it for a
        zone that is 1 % larger.
    per_sigma : float [m^2/s^3, of delta-v m/s]
        For each standard deviation of the errors more that is kept clear; 0 where no errors were given.
    """

    first: int
    second: int
    per_metre: float
    per_factor: float
    per_sigma: float = 0.0


def prices_of(contacts: Sequence[Contact], margin: float) -> tuple[ShadowPrice, ...]:
    """The price of each pair that some contacts keep apart, the dearest by the metre first.

    `margin`: the plan was made for zones so many times as large, which grow by as much more.
    """
    found: dict[tuple[int, int], tuple[float, float, float]] = {}
    for one in contacts:
        metre, factor, sigma = found.get((one.first, one.second), (0.0, 0.0, 0.0))
        own = margin * one.multiplier
        found[one.first, one.second] = metre + own, factor + own * one.reach, sigma + own * one.sigma
    prices = (ShadowPrice(*pair, *slopes) for pair, slopes in found.items())
    return tuple(sorted(prices, key=lambda price: -price.per_metre))
