"""What zones of other sizes cost: a plan for each size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, nan
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, numbers, shown
from closeform.fuel.thrusters import Thrusters
from closeform.motion.path import Path, ends_of
from closeform.planning.avoid import avoid
from closeform.planning.obstacles import obstacle_batch, zones_around
from closeform.planning.plan import Avoidance, Cost, Plan
from closeform.planning.problem import transfer_of
from closeform.planning.reconfigure import reconfigure
from closeform.result import Rows
from closeform.zones.combined_zones import OwnZone, enlarged
from closeform.zones.pair_zones import PairZones, pair_zones

Zoned = OwnZone | Sequence[OwnZone | None] | PairZones


@dataclass(frozen=True, eq=False, repr=False)
class ClearanceCostCurve(Rows):
    """What zones of D sizes cost.

    Attributes
    ----------
    factor : array of shape (D,), no unit
        All zones are so many times as large as they were given.
    metres : array of shape (D,) [m]
        And larger by so much at least in every direction.
    spent : array of shape (D,) [m^2/s^3, or m/s of delta-v]
        What is least; nan where no plan was found.
    slope : array of shape (D,) [m^2/s^3, or m/s of delta-v]
        By which that rises for each 1 of the factor, from the plan's `prices`; nan where not known.
    free : float [m^2/s^3, or m/s of delta-v]
        What it costs with nothing in the way; nan where no plan was found.
    plans : tuple of Avoidance or Plan
        For each size.
    cost : "energy" or "delta-v"
        What is least.
    """

    factor: Floats
    metres: Floats
    spent: Floats
    slope: Floats
    free: float
    plans: tuple[Avoidance | Plan, ...]
    cost: Cost

    @property
    def _named(self) -> dict[str, str]:
        unit = "m_s" if self.cost == "delta-v" else "m2_s3"
        return {"factor": "factor", "metres": "larger_m", "spent": f"spent_{unit}", "slope": f"slope_{unit}"}


def clearance_cost_curve(
    path: Path,
    obstacles: Path | Sequence[Path],
    zone: Zoned,
    factors: ArrayLike,
    *,
    cost: Cost = "energy",
    thrusters: Thrusters | None = None,
    names: Sequence[str] | None = None,
) -> ClearanceCostCurve:
    """What plans around zones of many sizes cost.

    Parameters
    ----------
    path : Path
        Of one craft, or of a formation, shape (N,): end states and times are kept.
    obstacles : Path or sequence of Path
        As of `max_clearance`.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones
        As of `max_clearance`.
    factors : array_like of shape (D,), no unit
        By which all zones are enlarged.
    cost : "energy" or "delta-v", default "energy"
        What is least.
    thrusters : Thrusters, optional
        As of `avoid`.
    names : sequence of str, optional
        As of `max_clearance`.

    Returns
    -------
    ClearanceCostCurve
        In the order of the factors; each is a plan of its own.

    Raises
    ------
    ValueError
        If a factor is not positive and finite, there is none, or another argument is refused by `avoid` or
        `reconfigure`.

    References
    ----------
    docs/theory.md section 4, what clearance costs.
    """
    sizes = Sizes.of(path, obstacles, zone, cost, thrusters, names)
    given = numbers("factors", factors)
    if given.ndim != 1 or not len(given) or not ((given > 0.0) & (given < inf)).all():
        raise ValueError(f"factors: expected shape (D,), positive and finite, got {shown(factors)}")
    plans = tuple(sizes.plan(float(factor)) for factor in given)
    free = [free_cost(plan) for plan in plans if plan.ok]
    return ClearanceCostCurve(
        given,
        sizes.metres(given),
        np.array([plan.spent for plan in plans]),
        np.array([slope(plan, factor) for plan, factor in zip(plans, given.tolist(), strict=True)]),
        min(free, default=nan),
        plans,
        cost,
    )


@dataclass(frozen=True, eq=False)
class Sizes:
    """One craft or a formation, and the zones around which it is planned in many sizes."""

    first: ClassVar[float] = 1.0  # factor that is tried first
    least: ClassVar[float] = 1e-6  # and between which factors are looked at
    most: ClassVar[float] = 1e6
    none, more, never = "at every size", "hardly larger", "a million times as large they are in nobody's way"

    path: Path
    obstacles: Path | Sequence[Path]
    zone: Any  # Zoned
    cost: Cost
    thrusters: Thrusters | None
    names: Sequence[str] | None
    smallest: float  # radius of the largest ball that all zones of pairs hold [m]

    @classmethod
    def of(
        cls,
        path: Path,
        obstacles: Path | Sequence[Path],
        zone: Zoned,
        cost: Cost,
        thrusters: Thrusters | None,
        names: Sequence[str] | None,
    ) -> Sizes:
        """Raises ValueError naming the argument that does not fit."""
        if len(instance("path", path, Path).shape) > 1:
            raise ValueError(f"path: of one craft or of shape (N,), got shape {path.shape}; index it")
        others = obstacle_batch(path.orbit, obstacles)
        extra = 0 if others is None else len(others)
        if path.shape:
            groups = tuple(pair_zones("zone", zone, len(path), extra).groups())
        elif not extra:
            raise ValueError("obstacles: give at least one path")
        else:
            groups = zones_around(cast(Any, zone), extra)
        if not groups:
            raise ValueError("zone: no two craft keep one; give at least one")
        smallest = min(zone.inner_radius for zone, _ in groups)
        return cls(path, obstacles, zone, cost, thrusters, names, smallest)

    def metres(self, factor: Floats | float) -> Floats:
        """By how much zones so many times as large are larger in every direction."""
        return np.asarray((np.asarray(factor) - 1.0) * self.smallest)

    def told(self, factor: float) -> tuple[float, float, float]:
        """Factor, metres and sigmas of an answer; nan sigmas without errors."""
        return factor, float(self.metres(factor)), nan

    def plan(self, factor: float) -> Avoidance | Plan:
        """The plan for zones so many times as large."""
        return self.planned(resized(self.zone, factor))

    def slope(self, plan: Avoidance | Plan, factor: float) -> float:
        """By how much a plan's cost rises for each 1 of the factor; nan where not known."""
        return slope(plan, factor)

    def planned(self, zone: Any, **kept: Any) -> Avoidance | Plan:
        """The plan around zones; `kept`: beside them."""
        if not self.path.shape:
            return avoid(
                transfer_of(self.path),
                self.obstacles,
                zone,
                names=self.names,
                cost=self.cost,
                thrusters=self.thrusters,
                **kept,
            )
        ends = [ends_of(self.path[k]) for k in range(len(self.path))]
        return reconfigure(
            self.path.orbit,
            [first for first, _ in ends],
            [last for _, last in ends],
            self.path.end - self.path.start,
            zone,
            start=self.path.start,
            obstacles=self.obstacles,
            if_blocked=("more sides",),
            names=self.names,
            cost=self.cost,
            thrusters=self.thrusters,
            **kept,
        )


def resized(zone: Zoned, factor: float) -> Zoned:
    """Own zones or zones of pairs, so many times as large."""
    if isinstance(zone, PairZones):
        return replace(zone, zones=tuple(one.enlarged(factor) for one in zone.zones))
    if isinstance(zone, OwnZone):
        return enlarged(zone, factor)
    return [None if one is None else enlarged(one, factor) for one in zone]


def free_cost(plan: Avoidance | Plan) -> float:
    """What a plan would cost with nothing in the way."""
    return plan.lower_bound if plan.cost == "delta-v" else plan.energy - plan.extra_energy


def slope(plan: Avoidance | Plan, factor: float) -> float:
    """By how much a plan's cost rises for each 1 of the factor, which its zones have; nan where not known."""
    return sum(one.per_factor for one in plan.prices) / factor if plan.ok and plan.priced else nan
