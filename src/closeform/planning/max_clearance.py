"""Maximum zone size, or number of sigmas, within a budget of energy or delta-v: bracketed Newton's method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf, nan, sqrt
from typing import Any, ClassVar

from closeform.arrays import number, shown
from closeform.fuel.thrusters import Thrusters
from closeform.motion.path import Path
from closeform.planning.clearance_cost_curve import Sizes, Zoned, free_cost
from closeform.planning.plan import UNITS, Cost, Plan, Status
from closeform.result import Result

ROUNDING = 1e-12  # of a budget: a cost that exceeds it by less counts as equal on any processor
FINE = 1e-6  # of the budget available for clearance: accepted remainder
NARROW = 1e-7  # of a factor: accuracy where the cost jumps
GROWTH = 2.0  # maximum growth of the factor from one plan to the next
PLANS, TRUSTED = 60, 12  # maximum plans, and plans after which every other one halves the bracket


class ClearanceStatus(StrEnum):
    """Reason why zones, or sigmas, cannot be larger.

    - `BUDGET`: the budget is spent.
    - `NO_WAY`: no clear plan within the budget was found for slightly larger zones, because the cost jumps
      where a passing side is closed.
    - `END_INSIDE`: two craft would be in conflict at a start or end that the plan cannot change.
    - `TOO_LITTLE`: the budget is below the cost without zones; there is no plan.
    - `NEVER_NEAR`: even zones a million times as large, or 10 000 sigmas, cause no conflict.
    """

    BUDGET = "budget spent"
    NO_WAY = "no clear plan within the budget beyond"
    END_INSIDE = "an end inside a zone beyond"
    TOO_LITTLE = "budget too small"
    NEVER_NEAR = "no conflict at any size"


@dataclass(frozen=True, eq=False, repr=False)
class MaxClearance(Result):
    """Largest zones that a budget allows, or the largest number of sigmas of errors around them.

    Attributes
    ----------
    factor : float, no unit
        Factor by which all zones are enlarged; nan without a plan, 1 with errors.
    metres : float [m]
        Minimum growth of the zones in any direction; negative for smaller zones.
    plan : Plan or None
        Plan for this size or number of sigmas, within the budget.
    status : ClearanceStatus
        Reason why the zones cannot be larger.
    reason : str
        The reason as text.
    budget : float [m^2/s^3, or m/s of delta-v]
        Given budget.
    tried : int
        Number of plans made.
    sigmas : float, no unit
        With errors, the number of standard deviations that the plan keeps clear of the given zones; nan
        without errors.
    """

    factor: float
    metres: float
    plan: Plan | None
    status: ClearanceStatus
    reason: str
    budget: float
    tried: int
    sigmas: float = nan

    @property
    def ok(self) -> bool:
        """True if there is a plan within the budget."""
        return self.plan is not None


def max_clearance(
    path: Path,
    obstacles: Path | Sequence[Path],
    zone: Zoned,
    budget: float,
    *,
    cost: Cost = "energy",
    thrusters: Thrusters | None = None,
    names: Sequence[str] | None = None,
    errors: Any = None,
    other_errors: Any = None,
) -> MaxClearance:
    """Find the largest zones, or with errors the most sigmas, that a budget allows, and the plan.

    Parameters
    ----------
    path : Path
        Path of one craft, or of a formation, shape (N,); end states and times are kept.
    obstacles : Path or sequence of Path
        Fixed paths, as for `avoid`; () for a formation without obstacles.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones
        As for `avoid`, for a formation as for `reconfigure`.  All zones are enlarged by one factor, which
        scales the sigmas of a `CovarianceZone`.
    budget : float [m^2/s^3, or m/s of delta-v]
        Maximum cost of the plan, summed over all craft.
    cost : "energy" or "delta-v", default "energy"
        Minimised cost, to which the budget applies.
    thrusters : Thrusters, optional
        As for `avoid`.
    names : sequence of str, optional
        Names of the obstacles, for a formation of craft and obstacles, for use in reasons.
    errors : Uncertainty, sequence of these, or None, default None
        As for `avoid`, for a formation as for `reconfigure`.  The zones then stay fixed, and the plan keeps
        the largest number of standard deviations clear that the budget allows.
    other_errors : Uncertainty, sequence of these, or None, default None
        As for `avoid`; for a formation, include those of obstacles in `errors`.

    Returns
    -------
    MaxClearance
        The plan leaves at most a millionth of the budget available for clearance; otherwise `status` is the
        reason why the zones or sigmas cannot be larger.

    Raises
    ------
    ValueError
        If `budget` is not positive and finite, `other_errors` are given for a formation, or `avoid` or
        `reconfigure` rejects another argument.

    Notes
    -----
    The minimum cost rises with the size of the zones at the rate given by a plan's `prices`, and jumps where
    a passing side is closed.  Newton's method on the square root of the cost of clearance meets the budget in
    a few plans; where it fails, the bracket is halved, which also converges to a jump.  Plans are the best
    found, so a larger zone may be affordable if a plan of lower cost exists.

    References
    ----------
    docs/theory.md section 4, cost of clearance.
    """
    limit = number("budget", budget)
    if not 0.0 < limit < inf:
        raise ValueError(f"budget: must be positive and finite, got {shown(budget)}")
    sizes = Sizes.of(path, obstacles, zone, cost, thrusters, names)
    if errors is not None or other_errors is not None:
        sizes = SigmaCounts(**vars(sizes), errors=errors, other_errors=other_errors)
        if path.shape and other_errors is not None:
            raise ValueError("other_errors: is for one spacecraft; for a formation append them to errors")
    low, high, factor, tried = 0.0, inf, sizes.first, 0
    best: Plan | None = None
    beyond: Plan | None = None
    while tried < PLANS and sizes.least < factor:
        plan = sizes.plan(factor)
        tried += 1
        if plan.ok and plan.spent <= limit * (1.0 + ROUNDING):
            low, best = factor, plan
        else:
            high, beyond = factor, plan
        if is_spent(plan, limit) or high - low <= NARROW * low or low >= sizes.most:
            break
        halved = tried > TRUSTED and tried % 2 == 0
        rise = sizes.slope(plan, factor)
        factor = (
            0.5 * (low + high) if halved and high < inf else next_factor(factor, plan, rise, limit, low, high)
        )
        factor = min(factor, sizes.most)
    status, reason = in_words(sizes, best, beyond, limit)
    if best is None:
        return MaxClearance(nan, nan, None, status, reason, limit, tried)
    factor, metres, sigmas = sizes.told(low)
    return MaxClearance(factor, metres, best, status, reason, limit, tried, sigmas)


@dataclass(frozen=True, eq=False)
class SigmaCounts(Sizes):
    """Planning task with errors as a function of the number of standard deviations kept clear."""

    first: ClassVar[float] = 0.0
    least: ClassVar[float] = -1.0
    most: ClassVar[float] = 1e4
    none, more, never = "at no sigma", "at slightly more sigmas", "no conflict at 10 000 sigmas"

    errors: Any
    other_errors: Any

    def told(self, factor: float) -> tuple[float, float, float]:
        """Return factor, metres and sigmas of a result for fixed zones."""
        return 1.0, 0.0, factor

    def plan(self, factor: float) -> Plan:
        """Return the plan that keeps `factor` sigmas clear."""
        others = {} if self.path.shape else {"other_errors": self.other_errors}
        return self.planned(self.zone, errors=self.errors, sigmas=factor, **others)

    def slope(self, plan: Plan, factor: float) -> float:
        """Return the slope of a plan's cost per sigma."""
        return sum(one.per_sigma for one in plan.prices) if plan.ok and plan.priced else nan


def next_factor(factor: float, plan: Plan, rise: float, limit: float, low: float, high: float) -> float:
    """Return Newton's step towards a spent budget, or the midpoint if that step leaves the bracket.

    With one contact the cost of clearance is quadratic, so its root is nearly straight.  `rise` is the slope
    of the cost.
    """
    most = max(GROWTH * factor, 1.0)
    if rise > 0.0:
        free = free_cost(plan)
        root = sqrt(max(plan.spent - free, 0.0))
        aim = sqrt(max(limit - 0.5 * FINE * (limit - free) - free, 0.0))
        guess = factor + (aim - root) * 2.0 * root / rise
        if low < guess < high:
            return min(guess, most)
    return most if high == inf else 0.5 * (low + high)


def is_spent(plan: Plan, limit: float) -> bool:
    """Return whether a plan spends the budget to rounding, or nothing is available for clearance."""
    left = limit * (1.0 + ROUNDING) - free_cost(plan)
    return plan.ok and (left < 0.0 or 0.0 <= limit * (1.0 + ROUNDING) - plan.spent <= FINE * left)


def in_words(
    sizes: Sizes, best: Plan | None, beyond: Plan | None, limit: float
) -> tuple[ClearanceStatus, str]:
    """Return the status and reason why zones are not larger than for the `best` plan.

    `beyond` is the plan for larger zones.
    """
    unit = UNITS[sizes.cost]
    if best is not None and is_spent(best, limit):
        return ClearanceStatus.BUDGET, f"{best.spent:.6g} of {limit:.6g} {unit} spent; {best.reason}"
    if beyond is None:
        return ClearanceStatus.NEVER_NEAR, sizes.never
    if beyond.ok and free_cost(beyond) > limit * (1.0 + ROUNDING):
        free = f"the cost without zones, {free_cost(beyond):.6g} {unit}"
        return ClearanceStatus.TOO_LITTLE, f"{limit:.6g} {unit} are below {free}; raise budget"
    size = sizes.none if best is None else sizes.more
    if beyond.ok:
        return ClearanceStatus.NO_WAY, f"{size} they cost {beyond.spent:.6g} {unit}"
    ends = beyond.status == Status.END_INSIDE
    return (
        ClearanceStatus.END_INSIDE if ends else ClearanceStatus.NO_WAY,
        f"{size}: {beyond.reason}",
    )
