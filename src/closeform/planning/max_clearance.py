"""The largest zones, or most sigmas, that a budget of energy or delta-v affords: Newton within a bracket."""

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
from closeform.planning.plan import UNITS, Avoidance, Cost, Plan, Status
from closeform.result import Result

ROUNDING = 1e-12  # of a budget: a cost that exceeds it by less equals it, whatever the processor rounds
FINE = 1e-6  # of what a budget leaves for clearance, that may be left of it
NARROW = 1e-7  # of a factor: how near the greatest that is affordable it is known, where the cost jumps there
GROWTH = 2.0  # of the factor at most from one plan to the next
PLANS, TRUSTED = 60, 12  # at most; and those after which every other one halves the bracket


class ClearanceStatus(StrEnum):
    """What keeps zones from being larger, or sigmas from being more.

    - `BUDGET`: it is spent.
    - `NO_WAY`: for zones that are hardly larger no clear plan is found, or none within the budget, as the
      cost jumps where a side on which to pass is closed.
    - `END_INSIDE`: two craft would be in conflict where neither can give way, at the start or the end.
    - `TOO_LITTLE`: the budget is below what it costs with nothing in the way; there is no plan.
    - `NEVER_NEAR`: nothing; a million times as large they are in nobody's way, nor are 10 000 sigmas.
    """

    BUDGET = "budget spent"
    NO_WAY = "no way within the budget beyond"
    END_INSIDE = "an end inside a zone beyond"
    TOO_LITTLE = "budget too small"
    NEVER_NEAR = "never in the way"


@dataclass(frozen=True, eq=False, repr=False)
class MaxClearance(Result):
    """The most enlarged zones that a budget affords, or the most sigmas of errors around them.

    Attributes
    ----------
    factor : float, no unit
        All zones are so many times as large as they were given; nan without a plan, 1 with errors.
    metres : float [m]
        And larger by so much at least in every direction, below 0 where they are smaller.
    plan : Avoidance, Plan or None
        For zones of that size or so many sigmas, within the budget: of one craft an `Avoidance`, of a
        formation a `Plan`.
    status : ClearanceStatus
        Why they are not larger.
    reason : str
        The same in words.
    budget : float [m^2/s^3, or m/s of delta-v]
        As it was given.
    tried : int
        How many plans were made.
    sigmas : float, no unit
        With errors, how many standard deviations of these the plan keeps clear of the zones as they were
        given; nan without.
    """

    factor: float
    metres: float
    plan: Avoidance | Plan | None
    status: ClearanceStatus
    reason: str
    budget: float
    tried: int
    sigmas: float = nan

    @property
    def ok(self) -> bool:
        """Whether there is a plan within the budget."""
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
    """The most enlarged zones around which a budget leads, or with errors the most sigmas, and the plan.

    Parameters
    ----------
    path : Path
        Of one craft, or of a formation, shape (N,): end states and times are kept.
    obstacles : Path or sequence of Path
        That do not give way, as of `avoid`; () for a formation without any.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones
        As of `avoid`, for a formation as of `reconfigure`; all are enlarged by one factor, of an
        `Uncertainty` its sigmas.
    budget : float [m^2/s^3, or m/s of delta-v]
        What the plan may cost, of all craft together.
    cost : "energy" or "delta-v", default "energy"
        What is least, and what the budget is of.
    thrusters : Thrusters, optional
        As of `avoid`.
    names : sequence of str, optional
        Of the obstacles, for a formation of craft and obstacles, for reasons.
    errors : Uncertainty, sequence of these, or None, default None
        As of `avoid`, for a formation as of `reconfigure`.  Zones stay as they are, and the plan keeps as
        many standard deviations clear of them as the budget affords.
    other_errors : Uncertainty, sequence of these, or None, default None
        As of `avoid`; for a formation those of obstacles stand in `errors`.

    Returns
    -------
    MaxClearance
        Its plan costs all but a millionth of what the budget leaves for clearance, or its `status` says what
        keeps zones from being larger, or sigmas from being more.

    Raises
    ------
    ValueError
        If `budget` is not positive and finite, `other_errors` are given for a formation, or another argument
        is refused by `avoid` or `reconfigure`.

    Notes
    -----
    The least cost rises with the size of zones, at the rate that a plan's `prices` tell, and jumps where a
    side on which to pass is closed.  Newton's method on the root of what clearance costs meets the budget in
    a few plans; a bracket that is halved where it fails ends at a jump too.  Plans are the best that were
    found, so that a larger zone may be affordable where a cheaper plan exists.

    References
    ----------
    docs/theory.md section 4, what clearance costs.
    """
    limit = number("budget", budget)
    if not 0.0 < limit < inf:
        raise ValueError(f"budget: must be positive and finite, got {shown(budget)}")
    sizes = Sizes.of(path, obstacles, zone, cost, thrusters, names)
    if errors is not None or other_errors is not None:
        sizes = SigmaCounts(**vars(sizes), errors=errors, other_errors=other_errors)
        if path.shape and other_errors is not None:
            raise ValueError("other_errors: of a formation; give them in errors, behind those of its craft")
    low, high, factor, tried = 0.0, inf, sizes.first, 0
    best: Avoidance | Plan | None = None
    beyond: Avoidance | Plan | None = None
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
    """The same with errors, of which more and more standard deviations are kept: the factor is how many."""

    first: ClassVar[float] = 0.0
    least: ClassVar[float] = -1.0
    most: ClassVar[float] = 1e4
    none, more, never = "at no sigma", "at hardly more sigmas", "10 000 sigmas bring nobody together"

    errors: Any
    other_errors: Any

    def told(self, factor: float) -> tuple[float, float, float]:
        """Zones stay as they are."""
        return 1.0, 0.0, factor

    def plan(self, factor: float) -> Avoidance | Plan:
        """The plan that keeps so many sigmas."""
        others = {} if self.path.shape else {"other_errors": self.other_errors}
        return self.planned(self.zone, errors=self.errors, sigmas=factor, **others)

    def slope(self, plan: Avoidance | Plan, factor: float) -> float:
        """By how much a plan's cost rises for each sigma."""
        return sum(one.per_sigma for one in plan.prices) if plan.ok and plan.priced else nan


def next_factor(
    factor: float, plan: Avoidance | Plan, rise: float, limit: float, low: float, high: float
) -> float:
    """Newton's step from a plan to where the budget is spent, or half-way where that leaves the bracket.

    Past one contact the cost of clearance is a square, so its root is nearly straight; `rise`: its slope.
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


def is_spent(plan: Avoidance | Plan, limit: float) -> bool:
    """Whether a plan leaves next to nothing of a budget for clearance, or there is nothing to leave."""
    left = limit * (1.0 + ROUNDING) - free_cost(plan)
    return plan.ok and (left < 0.0 or 0.0 <= limit * (1.0 + ROUNDING) - plan.spent <= FINE * left)


def in_words(
    sizes: Sizes, best: Avoidance | Plan | None, beyond: Avoidance | Plan | None, limit: float
) -> tuple[ClearanceStatus, str]:
    """Why zones are not larger than those of the `best` plan; `beyond`: what larger ones come to."""
    unit = UNITS[sizes.cost]
    if best is not None and is_spent(best, limit):
        return ClearanceStatus.BUDGET, f"{best.spent:.6g} of {limit:.6g} {unit} spent; {best.reason}"
    if beyond is None:
        return ClearanceStatus.NEVER_NEAR, sizes.never
    if beyond.ok and free_cost(beyond) > limit * (1.0 + ROUNDING):
        free = f"{free_cost(beyond):.6g} {unit} that it costs with nothing in the way"
        return ClearanceStatus.TOO_LITTLE, f"{limit:.6g} {unit} are below the {free}; give more"
    size = sizes.none if best is None else sizes.more
    if beyond.ok:
        return ClearanceStatus.NO_WAY, f"{size} they cost {beyond.spent:.6g} {unit}"
    ends = beyond.status == Status.END_INSIDE
    return (
        ClearanceStatus.END_INSIDE if ends else ClearanceStatus.NO_WAY,
        f"{size}: {beyond.reason}",
    )
