"""Result of planning: certified paths with their contacts, cost and bound, or the reason why there are none.

At a contact the path keeps the supporting plane a . (r_i - r_j) >= h(a) of the zone, with h(a) the zone's
extent along the normal a.  By the envelope theorem the minimum cost rises with h(a) at the rate of the
contact's multiplier, whatever else the plan changes: the shadow price of clearance.  A zone that grows by d
in every direction has the extent h + d, and one enlarged by a factor has factor times h.     # theory (21b)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from math import nan
from typing import Any, Literal

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.result import Result

Cost = Literal["energy", "delta-v"]
UNITS: dict[Cost, str] = {"energy": "m²/s³", "delta-v": "m/s"}


class Status(StrEnum):
    """Outcome of planning.

    - `CLEAR`: the unconstrained optima have no conflict.
    - `AVOIDED`: the paths avoid the zones and are certified clear.
    - `END_INSIDE`: two craft are in conflict at a start or end that the plan cannot change; move that
      state or its time.
    - `END_UNSAFE`: a craft without thrust from the plan's start, or after its end, drifts into a zone; no
      plan between these states is passively safe.  Move that state, or reduce `drift`.
    - `END_OUTSIDE`: a start or end does not keep a requirement, such as an approach corridor.
    - `NOT_FOUND`: no examined candidate is clear, which does not prove that none exists; raise `budget`, or
      allow more time.
    - `TOO_WEAK`: the plan exceeds `max_acceleration` for every allowed duration; allow more thrust or time.
      `weak` holds the shortfall.
    - `NO_MARGIN`: the plan is clear, but not by the keep-out margin that its own simulation requires, in a
      stage with margin "auto"; give a length, improve the navigation, or allow more time.
    """

    CLEAR = "clear already"
    AVOIDED = "avoided"
    END_INSIDE = "start or end inside a zone"
    END_UNSAFE = "end not passively safe"
    END_OUTSIDE = "start or end outside a requirement"
    NOT_FOUND = "no clear path found"
    TOO_WEAK = "thrust limit exceeded"
    NO_MARGIN = "no margin fits"


@dataclass(frozen=True, eq=False, repr=False)
class Contact(Result):
    """Point where two paths of a plan touch the zone between them.

    Attributes
    ----------
    time : float [s]
        Time of contact.
    first, second : int
        Indices of the two craft; N + k is obstacle k of a plan of N craft.
    position : array of shape (3,) [m]
        Position of the first craft in the rotating frame.
    normal : array of shape (3,), no unit
        Unit normal of the zone in the rotating frame, pointing from second to first.
    multiplier : float [m/s^3]
        Lagrange multiplier of the contact: the jump of the thrust's rate, of the first craft along the
        normal, of the second against it.  For a single contact it is twice the extra energy per metre of
        displacement.  It does not act on obstacles nor, in sequential planning, on the second craft.
    reach : float [m]
        Extent of the zone along the normal: the distance of the craft along it, without `clearance_ratio`.
    failed_at : float [s]
        Time of the first craft's loss of thrust, if the contact occurs in the free drift after it; nan in the
        nominal plan.  The multiplier then acts at the loss of thrust, propagated there by natural motion.
    sigma : float [m]
        Standard deviation of the relative position along the normal; the requested number of these is kept
        beyond `reach`.  0 without `errors`.
    """

    time: float
    first: int
    second: int
    position: Floats
    normal: Floats
    multiplier: float
    reach: float
    failed_at: float = nan
    sigma: float = 0.0


@dataclass(frozen=True, repr=False)
class ThrustShortfall(Result):
    """The craft that exceeds its thrust limit by the largest factor.

    Attributes
    ----------
    craft : int
        Index of the craft.
    needed : float [m/s^2]
        Peak thrust for the last duration tried; for a plan of minimum delta-v, a sufficient limit.
    limit : float [m/s^2]
        Given thrust limit.
    duration : float [s]
        Last duration tried.
    remedy : str
        Suggested remedy.
    shortest : float [s]
        First duration tried; equal to `duration` if no longer one was tried.
    first : float [m/s^2]
        Peak thrust for the first duration.
    proven : float [m/s^2]
        Proven lower bound on the thrust needed in the last duration tried; 0 without a proof.
    """

    craft: int
    needed: float
    limit: float
    duration: float
    remedy: str
    shortest: float
    first: float
    proven: float = 0.0


def weakness(weak: ThrustShortfall, name: str, mass: float | None = None) -> str:
    """Return a description of a thrust shortfall in m/s^2, or in newtons for a craft of `mass` [kg]."""
    size, unit, has = (1.0, "m/s²", "its limit is") if mass is None else (mass, "N", "its max_thrust is")
    tried = ""
    if weak.duration > weak.shortest:
        tried = (
            f"no longer duration is tried, and {weak.shortest:.6g} s require {size * weak.first:.4g} {unit}: "
        )
    least = f", and at least {size * weak.proven:.4g} {unit} is proven necessary" if weak.proven else ""
    return (
        f"{name} needs {size * weak.needed:.4g} {unit} in {weak.duration:.6g} s{least}, "
        f"{has} {size * weak.limit:.4g} {unit}; {tried}{weak.remedy}"
    )


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


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Result):
    """Paths of N spacecraft from their initial to their final states, or the reason why there are none.

    `avoid` returns a plan of one spacecraft.

    Attributes
    ----------
    paths : Path or None
        Shape (N,), from the earliest start to the latest end, with coasts before and after each spacecraft's
        own transfer.  Every pair is certified clear.  None where not `ok`.
    direct : Path
        The unconstrained optima over the same times, shape (N,).
    slots : array of int of shape (N,)
        Index of each spacecraft's final state.
    starts, durations : array of shape (N,) [s]
        Planned values, which differ from the requested ones where `late` is above 0.
    energy : float [m^2/s^3]
        Control energy of all spacecraft, half the integral of the squared thrust acceleration; inf with
        impulses, nan where not ok.
    extra_energy : float [m^2/s^3]
        Energy beyond that of the paths of minimum energy between the same states; nan where not ok.
    delta_v : float [m/s]
        Delta-v of all spacecraft; nan where not ok.  With thrusters it is the sum over all thrusters, which
        exceeds the paths' own where several fire at once, because the paths' impulses are vector sums.
    lower_bound : float [m^2/s^3, or m/s of delta-v]
        Certified lower bound on the cost of every clear plan over these times and, where spacecraft were
        assigned to slots, of every other assignment.
    contacts : tuple of Contact
        Contacts in order of time.
    status : Status
        Outcome of planning.
    reason : str
        Outcome as text.
    blocked : tuple of int, or None
        The two spacecraft of the conflict that could not be resolved; N + k for obstacle k.
    measures : tuple of str
        Fallbacks and measures tried, in order.
    clearance_ratio : float, no unit
        Factor by which the zones were enlarged for planning.
    proven : bool
        Whether the cost equals the lower bound to rounding; otherwise the plan is the best found.
    tried : int
        Number of candidates examined.
    weak : ThrustShortfall or None
        Spacecraft with the largest shortfall of thrust, where a limit is exceeded.
    late : float [s]
        Delay of the last arrival beyond the requested one, by a longer duration or staggered starts; 0 for a
        plan in the requested time.
    punctual : array of shape (N,), or None [m/s^2]
        Peak thrusts of a clear plan over the requested durations, where they exceed a limit: with these
        limits no spacecraft would need a longer duration.
    cost : "energy" or "delta-v"
        Minimised cost, in which `lower_bound`, `proven` and `gap` are expressed.  With "delta-v" the paths
        have impulses or burns, and multipliers are delta-v per metre of displacement [1/s].
    priced : bool
        Whether the multipliers are slopes of the minimised cost, as `prices` requires.  False for
        "sequential" and "sauter-palmer", and for paths of minimum energy where delta-v was requested.
    drift : float or None [s]
        Certified passive-safety horizon after the plan's end, for the loss of thrust of any one spacecraft
        while the others complete their plans; None if not requested.
    sigmas : float, no unit
        Number of standard deviations of all errors that are certified clear until the last arrival; 0 without
        `errors`.
    padding : float or array of shape (N + M, N + M) [m]
        Requested keep-out `margin`.  The zones enlarged by it are certified clear, and the contacts are with
        these.
    """

    paths: Path | None
    direct: Path
    slots: Any
    starts: Floats
    durations: Floats
    energy: float
    extra_energy: float
    delta_v: float
    lower_bound: float
    contacts: tuple[Contact, ...]
    status: Status
    reason: str
    blocked: tuple[int, int] | None = None
    measures: tuple[str, ...] = ()
    clearance_ratio: float = 1.0
    proven: bool = False
    tried: int = 0
    weak: ThrustShortfall | None = None
    late: float = 0.0
    punctual: Floats | None = None
    cost: Cost = "energy"
    priced: bool = True
    drift: float | None = None
    sigmas: float = 0.0
    padding: Any = 0.0

    @property
    def path(self) -> Path | None:
        """Path of the only spacecraft; None where not ok.  ValueError for a plan of several."""
        if len(self.starts) != 1:
            raise ValueError(f"path: this plan has {len(self.starts)} spacecraft; index its paths")
        return None if self.paths is None else self.paths[0]

    @property
    def ok(self) -> bool:
        """True if clear paths were found."""
        return self.status in (Status.CLEAR, Status.AVOIDED)

    @property
    def spent(self) -> float:
        """Minimised cost: the energy [m^2/s^3] or delta-v [m/s], by `cost`; nan where not ok."""
        return self.delta_v if self.cost == "delta-v" else self.energy

    @property
    def gap(self) -> float:
        """Optimality gap: relative excess of the cost over the lower bound, no unit; nan where not ok."""
        return gap(self.spent, self.lower_bound)

    @property
    def prices(self) -> tuple[ShadowPrice, ...]:
        """Shadow prices of clearance, one for each pair in contact, the highest per metre first.

        Empty where not `priced`.  At a kink of the minimum cost, such as at a zone's edge, the slopes for
        more and for less clearance differ: the price is the slope for more, with impulses a value between.
        """
        return prices_of(self.contacts, self.clearance_ratio) if self.priced else ()

    @property
    def price(self) -> float:
        """Cost of one metre more of all zones [m/s^3, of delta-v 1/s]; nan where not ok or not `priced`."""
        return sum((one.per_metre for one in self.prices), 0.0) if self.ok and self.priced else nan


def without_paths(plan: Plan, status: Status, reason: str) -> Plan:
    """Return a plan without paths and costs, with the status and reason why there are none."""
    none = replace(plan, paths=None, energy=nan, extra_energy=nan, delta_v=nan, contacts=())
    return replace(none, proven=False, status=status, reason=reason)


def too_weak(plan: Plan, weak: ThrustShortfall, name: str) -> Plan:
    """Return a plan without paths, for the thrust shortfall of the spacecraft `name`."""
    return replace(without_paths(plan, Status.TOO_WEAK, weakness(weak, name)), weak=weak)


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


def gap(energy: float, bound: float) -> float:
    """Return the excess of an energy over its lower bound, as a fraction of the bound."""
    if not bound > 0.0:
        return 0.0 if energy == bound else nan
    return energy / bound - 1.0
