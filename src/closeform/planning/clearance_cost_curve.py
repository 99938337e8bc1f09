"""Cost of clearance: plans for zones of several sizes."""

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
from closeform.planning.plan import Cost, Plan
from closeform.planning.problem.problem import transfer_of
from closeform.planning.reconfigure import reconfigure
from closeform.result import Rows
from closeform.zones.combined_zones import OwnZone, enlarged
from closeform.zones.pair_zones import PairZones, pair_zones

Zoned = OwnZone | Sequence[OwnZone | None] | PairZones


@dataclass(frozen=True, eq=False, repr=False)
class ClearanceCostCurve(Rows):
    """Costs of plans for zones of D sizes.

    Attributes
    ----------
    factor : array of shape (D,), no unit
        Factor by which all zones are enlarged.
    metres : array of shape (D,) [m]
        Minimum growth of the zones in any direction.
    spent : array of shape (D,) [m^2/s^3, or m/s of delta-v]
        Minimised cost; nan where no plan was found.
    slope : array of shape (D,) [m^2/s^3, or m/s of delta-v]
        Slope of the cost per unit of the factor, from the plan's `prices`; nan if unknown.
    free : float [m^2/s^3, or m/s of delta-v]
        Cost without any zone; nan where no plan was found.
    plans : tuple of Plan
        Plan for each size.
    cost : "energy" or "delta-v"
        Minimised cost.
    """

    factor: Floats
    metres: Floats
    spent: Floats
    slope: Floats
    free: float
    plans: tuple[Plan, ...]
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
    """Return the costs of plans around zones of several sizes.

    Parameters
    ----------
    path : Path
        Path of one craft, or of a formation, shape (N,); end states and times are kept.
    obstacles : Path or sequence of Path
        As for `max_clearance`.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones
        As for `max_clearance`.
    factors : array_like of shape (D,), no unit
        Factors by which all zones are enlarged.
    cost : "energy" or "delta-v", default "energy"
        Minimised cost.
    thrusters : Thrusters, optional
        As for `avoid`.
    names : sequence of str, optional
        As for `max_clearance`.

    Returns
    -------
    ClearanceCostCurve
        In the order of the factors, with one independent plan for each.

    Raises
    ------
    ValueError
        If `factors` is empty, a factor is not positive and finite, or `avoid` or `reconfigure` rejects
        another argument.

    References
    ----------
    docs/theory.md section 4, cost of clearance.
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
    """Planning task of one craft or a formation as a function of the size of its zones."""

    first: ClassVar[float] = 1.0  # first factor tried
    least: ClassVar[float] = 1e-6  # range of the factors
    most: ClassVar[float] = 1e6
    none, more, never = "at every size", "slightly larger", "no conflict at a million times the size"

    path: Path
    obstacles: Path | Sequence[Path]
    zone: Any  # Zoned
    cost: Cost
    thrusters: Thrusters | None
    names: Sequence[str] | None
    smallest: float  # radius of the largest ball inside every zone [m]

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
        """Return the task for the arguments of `max_clearance`; raise ValueError naming a bad argument."""
        if len(instance("path", path, Path).shape) > 1:
            raise ValueError(f"path: requires one craft or shape (N,), got shape {path.shape}; index it")
        others = obstacle_batch(path.orbit, obstacles)
        extra = 0 if others is None else len(others)
        if path.shape:
            groups = tuple(pair_zones("zone", zone, len(path), extra).groups())
        elif not extra:
            raise ValueError("obstacles: give at least one path")
        else:
            groups = zones_around(cast(Any, zone), extra)
        if not groups:
            raise ValueError("zone: no pair has a zone; give at least one")
        smallest = min(zone.inner_radius for zone, _ in groups)
        return cls(path, obstacles, zone, cost, thrusters, names, smallest)

    def metres(self, factor: Floats | float) -> Floats:
        """Return the minimum growth [m] in any direction of zones enlarged by `factor`."""
        return np.asarray((np.asarray(factor) - 1.0) * self.smallest)

    def told(self, factor: float) -> tuple[float, float, float]:
        """Return factor, metres and sigmas of a result; sigmas are nan without errors."""
        return factor, float(self.metres(factor)), nan

    def plan(self, factor: float) -> Plan:
        """Return the plan for zones enlarged by `factor`."""
        return self.planned(resized(self.zone, factor))

    def slope(self, plan: Plan, factor: float) -> float:
        """Return the slope of a plan's cost per unit of the factor; nan if unknown."""
        return slope(plan, factor)

    def planned(self, zone: Any, **kept: Any) -> Plan:
        """Return the plan around zones, with further arguments of the planner."""
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
    """Return the zones enlarged by a factor."""
    if isinstance(zone, PairZones):
        return replace(zone, zones=tuple(one.enlarged(factor) for one in zone.zones))
    if isinstance(zone, OwnZone):
        return enlarged(zone, factor)
    return [None if one is None else enlarged(one, factor) for one in zone]


def free_cost(plan: Plan) -> float:
    """Return the cost of a plan without any zone."""
    return plan.lower_bound if plan.cost == "delta-v" else plan.energy - plan.extra_energy


def slope(plan: Plan, factor: float) -> float:
    """Return the slope of a plan's cost per unit of the `factor` of its zones; nan if unknown."""
    return sum(one.per_factor for one in plan.prices) / factor if plan.ok and plan.priced else nan
