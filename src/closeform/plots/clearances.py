"""Cost of clearance: minimum energy or delta-v against the size of the zones."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from closeform.arrays import Floats, instance
from closeform.planning.clearance_cost_curve import ClearanceCostCurve, slope
from closeform.planning.max_clearance import MaxClearance
from closeform.planning.plan import Avoidance, Plan
from closeform.plots.palette import AFTER, BEFORE, CONFLICT, FAINT, INK, OTHER, ZONE
from closeform.plots.style import (
    DASHED,
    DOTTED,
    HALO,
    SMALL,
    Unit,
    chart,
    headline,
    signed_percent,
    speed_unit,
)

STEEPEST = 3.0  # times the rise between two plans: maximum slope of a monotone cubic
POINTS = 24  # points of a curve between two plans
SAME = 0.0  # cosine of the angle between two normals, above which the passing side is the same


def clearance(found: ClearanceCostCurve, most: MaxClearance | None = None) -> Figure:
    """Plot the cost of a plan against the size of the zones: a point for each plan, a curve through them.

    The curve has the slope of each plan at its point. Dots join two plans with different passing sides.
    Crosses at the top are sizes for which no clear plan was found. The dashed line is the cost without
    obstacles.

    Parameters
    ----------
    found : ClearanceCostCurve
        Result of `clearance_cost_curve`.
    most : MaxClearance, optional
        Result of `max_clearance`; a line shows its budget, and a ring the largest zones within that budget.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If `found` is not a `ClearanceCostCurve` or has no plan, or `most` is not a `MaxClearance` of zones
        with a plan.
    """
    instance("found", found, ClearanceCostCurve)
    if not np.isfinite(found.spent).any():
        raise ValueError("found: no clear plan was found at any size; there is nothing to show")
    if most is not None and not instance("most", most, MaxClearance).ok:
        raise ValueError(f"most: has no plan; {most.reason}")
    factors, costs, slopes, plans = found.factor, found.spent, found.slope, list(found.plans)
    if most is not None and most.sigmas == most.sigmas:
        raise ValueError("most: of sigmas, not of the size of zones; make it without errors")
    if most is not None and most.plan is not None:  # an ordinary point of the curve
        own = most.factor, most.plan.spent, slope(most.plan, most.factor)
        factors, costs, slopes = (
            np.append(*pair) for pair in zip((factors, costs, slopes), own, strict=True)
        )
        plans.append(most.plan)
    order = np.argsort(factors, kind="stable")
    factors, costs, slopes = (each[order] for each in (factors, costs, slopes))
    plans = [plans[k] for k in order]
    highest = max(float(np.nanmax(costs)), 0.0 if most is None else most.budget)
    up = speed_unit(highest) if found.cost == "delta-v" else energy_unit(highest)

    figure, axes = chart(5.2, beside=0.3 if not found.free > 0.0 else 1.0)
    axes.axvline(1.0, color=FAINT, linewidth=2.0)
    axes.axhline(found.free / up.size, color=BEFORE, linestyle=DASHED, linewidth=1.2)
    seen = np.flatnonzero(np.isfinite(costs))
    for k, m in zip(seen, seen[1:], strict=False):
        ends = factors[[k, m]], costs[[k, m]], slopes[[k, m]]
        if m == k + 1 and alike(plans[k], plans[m]) and np.isfinite(ends[2]).all():
            across, curve = between(*ends)
            axes.plot(across, curve / up.size, color=AFTER, linewidth=2.0)
        else:
            axes.plot(ends[0], ends[1] / up.size, color=OTHER, linestyle=DOTTED, linewidth=1.4)
    axes.plot(factors[seen], costs[seen] / up.size, "o", color=AFTER, markersize=4.5)
    lost = np.setdiff1d(np.arange(len(factors)), seen)
    if len(lost):
        look: dict[str, Any] = {"color": CONFLICT, "transform": axes.get_xaxis_transform(), "clip_on": False}
        axes.plot(factors[lost], np.full(len(lost), 1.0), "x", markersize=7, **look)
    if most is not None:
        show_most(axes, most, up)
    scales(figure, axes, found, up)
    headline(figure, words(found, most, up))
    return figure


def show_most(axes: Any, most: MaxClearance, up: Unit) -> None:
    """Draw the budget, and the largest zones within it."""
    assert most.plan is not None
    height = most.plan.spent / up.size
    axes.axhline(most.budget / up.size, color=ZONE, linewidth=1.6)
    axes.plot(most.factor, height, "o", markersize=12, markerfacecolor="none", color=INK, zorder=6)
    right = most.factor > np.mean(axes.get_xlim())
    text = axes.annotate(
        f"{most.factor:.4g} x, {most.metres:+.4g} m: {most.status}".replace("-", "−"),
        (most.factor, height),
        (-12, 9) if right else (12, -17),  # where the curve is not
        textcoords="offset points",
        ha="right" if right else "left",
        fontsize=SMALL,
        color=INK,
    )
    text.set_path_effects(HALO)


def scales(figure: Figure, axes: Any, found: ClearanceCostCurve, up: Unit) -> None:
    """Label the axes: scale factor and metres, cost and relative increase over the plan without obstacles."""
    axes.set_xlabel("scale factor of the zones")
    axes.set_ylabel(f"minimum {found.cost} [{up.name}]")
    others = []
    metre = float(np.ptp(found.metres) / np.ptp(found.factor)) if np.ptp(found.factor) > 0.0 else 0.0
    if metre > 0.0:
        lengths = lambda factor: (factor - 1.0) * metre, lambda length: 1.0 + length / metre
        above = axes.secondary_xaxis("top", functions=lengths)
        above.set_xlabel("distance added to the zones [m]", fontsize=SMALL, color=INK)
        others.append(above)
    if (free := found.free / up.size) > 0.0:
        shares = lambda cost: 100.0 * (cost / free - 1.0), lambda share: free * (1.0 + 0.01 * share)
        beside = axes.secondary_yaxis("right", functions=shares)
        beside.set_ylabel("increase over the plan without obstacles [%]", fontsize=SMALL, color=INK)
        others.append(beside)
    for one in others:
        one.tick_params(labelsize=SMALL, colors=INK, length=3)
        for spine in one.spines.values():
            spine.set_color(OTHER)


def words(found: ClearanceCostCurve, most: MaxClearance | None, up: Unit) -> str:
    """Return the headline of the figure."""
    if most is not None:
        budget = f"{most.budget / up.size:.4g} {up.name}"
        share = f" ({signed_percent(most.budget / found.free - 1.0)})" if found.free > 0.0 else ""
        return f"{budget}{share} afford zones {most.factor:.4g} times as large"
    seen = np.flatnonzero(np.isfinite(found.spent))
    first, last = seen[np.argmin(found.factor[seen])], seen[np.argmax(found.factor[seen])]
    return ", ".join(
        f"{found.spent[k] / up.size:.4g} {up.name} at {found.factor[k]:.4g} x zone" for k in (first, last)
    )


def between(factors: Floats, costs: Floats, slopes: Floats) -> tuple[Floats, Floats]:
    """Return a rising cubic between two plans with their slopes, as far as they allow it."""
    width, rise = float(np.diff(factors)[0]), float(np.diff(costs)[0])
    first, last = np.clip(slopes * width, 0.0, STEEPEST * max(rise, 0.0))
    t = np.linspace(0.0, 1.0, POINTS)
    curve = costs[0] + rise * t * t * (3.0 - 2.0 * t) + t * (1.0 - t) * (first * (1.0 - t) - last * t)
    return factors[0] + width * t, curve


def alike(one: Avoidance | Plan, other: Avoidance | Plan) -> bool:
    """Return True if no pair is passed on different sides in two plans."""
    return all(
        a.normal @ b.normal > SAME
        for a in one.contacts
        for b in other.contacts
        if (a.first, a.second) == (b.first, b.second)
    )


def energy_unit(greatest: float) -> Unit:
    """Return the display unit for a maximum energy [m^2/s^3]."""
    for size, name in ((1.0, "m²/s³"), (1e-6, "mm²/s³")):
        if greatest >= size:
            return Unit(size, name)
    return Unit(1e-12, "µm²/s³")
