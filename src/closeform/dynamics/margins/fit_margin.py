"""Iteration of plans and tracking margins until the keep-out margin covers the plan's tracking error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, of_each, shown
from closeform.dynamics.control.feedback import Feedback, Navigation, nonnegative
from closeform.dynamics.control.tracking_tube import tube
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.infeasible import Infeasible
from closeform.dynamics.margins.tracking_margins import TrackingMargins, required_margins, tracking_margins
from closeform.dynamics.planned_paths import appended_paths, checked_paths, extended_paths
from closeform.dynamics.simulation.commands import SAME
from closeform.motion.arc import END, START
from closeform.motion.joining import stack
from closeform.motion.path import Path, path_of
from closeform.planning.obstacles import obstacle_batch
from closeform.planning.plan import Plan
from closeform.result import Result
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones, pair_zones

ROUNDS = 12  # maximum number of plans; usually three
SPARE = 1e-3  # relative excess of a margin that grows, so that rounding does not prevent the end


@dataclass(frozen=True, eq=False, repr=False)
class FittedMargin(Result):
    """Plan whose margin covers its tracking error, or the reason of failure; returned by `fit_margin`.

    Attributes
    ----------
    plan : Plan
        The last plan. In the high-fidelity model its pairs keep clear of their zones.
    room : TrackingMargins or None
        Tracking margins of its spacecraft; None if the plan has no paths, or is not feasible in the field.
    margin : array of shape (B, B) [m]
        Keep-out margin of each pair of bodies in the plan.
    fits : bool
        True if the margins of all pairs suffice.
    rounds : int
        Number of plans.
    reason : str
        Description of the outcome.
    """

    _told: ClassVar = ("fits", "rounds", "greatest", "reason")

    plan: Any
    room: TrackingMargins | None
    margin: Floats
    fits: bool
    rounds: int
    reason: str

    @property
    def greatest(self) -> float:
        """Largest margin of any pair [m]."""
        return float(self.margin.max())


def fit_margin(
    planned: Callable[[Floats], Plan],
    field: Field,
    zones: OwnZone | PairZones,
    feedback: Feedback | None = None,
    navigation: Navigation | None = None,
    *,
    obstacles: Path | Any = (),
    held: bool = False,
    before: Path | None = None,
    max_acceleration: ArrayLike | None = None,
    **tracking: Any,
) -> FittedMargin:
    """Plan with the keep-out margin that the plan's own tracking error requires, by iteration.

    Parameters
    ----------
    planned : callable
        Function of a margin (B, B) [m] of all pairs of spacecraft and, after them, obstacles. It returns the
        plan that keeps the margin, as `reconfigure` and `avoid` do with `margin`.
    field : Field
        Known force model, as in `tracking_margins`.
    zones : Zone, CovarianceZone, Body or PairZones
        Zones that the plan keeps; one for all, or one of each pair.
    feedback : Feedback, optional
        As in `tracking_margins`.
    navigation : Navigation, optional
        As in `tracking_margins`.
    obstacles : Path or sequence of Path, default none
        Obstacles of the plan, which follow their paths exactly.
    held : bool, default False
        True if they are spacecraft under feedback like the others instead; arguments of each spacecraft then
        include them, after the others.
    before : Path, optional
        Preceding paths (B,) of the spacecraft and of those that are `held`, under the same feedback. The plan
        begins with the resulting deviations. Default: it begins as `simulate` does.
    max_acceleration : array_like of shape (N,) or () [m/s^2], optional
        Thrust limit of each spacecraft, for plan, compensation and feedback together.
    tracking : keyword arguments
        Further arguments of `tracking_margins`. An obstacle without an `engine` is `held`, and coasts in the
        field.

    Returns
    -------
    FittedMargin
        Plan and margin. `fits` is False if no plan was found with the required margin, a plan exceeds a
        thrust limit, or it is not feasible in the field.

    Raises
    ------
    ValueError
        If `planned` returns no plan, the navigation error exceeds a zone, or as `tracking_margins`.

    Notes
    -----
    The first plan has the margin for noise and `residual`, with `feedback` or, by default, continuous thrust.
    If the tracking error along the normal of a pair's zone exceeds the distance to it, the margin grows to
    that error. Margins never shrink, so that the iteration ends. Pairs far from each other keep the first
    margin.

    References
    ----------
    docs/theory.md (93).

    Examples
    --------
    >>> import closeform as cf
    >>> chief = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, 0.9, 0.0])
    >>> start = np.array([[0, 0, 120.0, 0, 0, 0], [0, 0, -120.0, 0, 0, 0]])
    >>> def swap(margin):
    ...     return cf.reconfigure(chief.orbit, start, -start, 2000.0, cf.Sphere(30.0), margin=margin)
    >>> sight = cf.Navigation(0.1, 3e-4)
    >>> field, zone = cf.Field(chief), cf.Sphere(30.0)
    >>> found = cf.fit_margin(swap, field, zone, navigation=sight, thrust_error=(0.01, 0.01))
    >>> found.fits, bool(0.28 < found.greatest < 0.45)
    (True, True)
    """
    if not callable(planned):
        raise ValueError(
            f"planned: expected a function of a margin that returns a plan, got {shown(planned)}"
        )
    orbit = instance("field", field, Field).chief.orbit
    instance("held", held, bool)
    instance("before", before, Path, type(None))
    others = obstacle_batch(orbit, obstacles)
    fixed = len(others) if others is not None else 0
    sight = Navigation() if navigation is None else navigation
    first = Feedback() if feedback is None else feedback  # the default without a plan
    unknown = np.max(nonnegative("residual", tracking.get("residual", 0.0)))
    least = tube(orbit, first, sight, unknown, sigmas=tracking.get("sigmas", 4.0))
    limit = np.inf if max_acceleration is None else nonnegative("max_acceleration", max_acceleration)
    margin: Any = np.asarray(least.radius if fixed and not held else least.of_a_pair)
    widest = _least_radius(zones)
    if margin > widest:
        cause, remedy = ("residual", "use a more complete force model")
        if least.model < 0.5 * least.radius:
            cause, remedy = ("navigation", "improve the navigation")
        raise ValueError(
            f"{cause}: requires a margin of {margin:.3g} m, more than a zone of {widest:.3g} m; "
            f"{remedy}, or enlarge the zones"
        )
    for made in range(1, ROUNDS + 1):
        plan = instance("planned", planned(margin), Plan)
        if not plan.ok:
            why = f"no plan with a margin of {margin.max():.3g} m: {plan.reason}"
            return FittedMargin(plan, None, margin, False, made, why)
        paths = checked_paths(plan, field)
        craft = len(paths)
        if held and others is not None:
            paths = stack([paths[k] for k in range(craft)] + [during(others[k], paths) for k in range(fixed)])
        try:
            found = tracking_margins(_after(before, paths), field, feedback, sight, **tracking)
        except Infeasible as error:
            return FittedMargin(plan, None, margin, False, made, f"the plan is not feasible: {error}")
        if before is not None:
            found = found._since(float(paths.start[0]))
        limits = of_each("max_acceleration", limit, len(paths))
        beyond = np.flatnonzero(found.thrust > limits)
        if len(beyond):
            why = _shortfall_message(found, np.ravel(paths.peak_thrust), int(beyond[0]), limits)
            return FittedMargin(plan, found, margin, False, made, why)
        bodies = paths
        if not held and others is not None:
            bodies = stack([paths[k] for k in range(craft)] + [others[k] for k in range(fixed)])
        margin = np.broadcast_to(margin, (craft + fixed, craft + fixed)).copy()
        pairs, short = required_margins(found, bodies, pair_zones("zones", zones, craft, fixed), craft)
        rises = short > margin[tuple(pairs.T)]
        if not rises.any():
            why = f"a margin of {margin.max():.3g} m fits, in {made} plan{'s' * (made > 1)}"
            return FittedMargin(plan, found, margin, True, made, why)
        one, other = pairs[rises].T
        margin[one, other] = margin[other, one] = (1.0 + SPARE) * short[rises]
    why = f"no margin fits after {made} plans, the last of {margin.max():.3g} m"
    return FittedMargin(plan, found, margin, False, made, why)


def _after(before: Path | None, paths: Path) -> Path:
    """Return paths (N,) appended to those before them, if there are any."""
    if before is None:
        return paths
    begin, over = float(paths.start.min()), float(np.max(before.end))
    if len(before) != len(paths):
        raise ValueError(f"before: {len(before)} paths for {len(paths)} craft; give one for each")
    if over > begin + SAME:
        raise ValueError(f"before: ends at {over:.6g} s, but the plan begins at {begin:.6g} s; cut it there")
    return appended_paths(before, paths)


def during(path: Path, planned: Path) -> Path:
    """Return one spacecraft's path for the time span of planned paths (N,)."""
    start, end = float(planned.start.min()), float(planned.end.max())
    arcs = path.arcs[path.arcs[:, START] < end].copy()
    arcs[-1, END] = min(arcs[-1, END], end)
    return extended_paths(path_of(path.orbit, arcs, np.array([0, len(arcs)]), (1,)), np.array([start, end]))[
        0
    ]


def _least_radius(zones: OwnZone | PairZones) -> float:
    """Return the inradius [m] of the smallest zone."""
    given = zones if isinstance(zones, PairZones) else pair_zones("zones", zones, 2)
    return min((zone.inner_radius for zone in given.zones), default=np.inf)


def _shortfall_message(found: TrackingMargins, peaks: Floats, craft: int, limits: Floats) -> str:
    """Return a message on the spacecraft whose thrust limit is exceeded, with a limit for planning."""
    limit, required = float(limits[craft]), float(found.thrust[craft])
    within = limit - required + float(peaks[craft])
    remedy = f"plan with at most {within:.3g} m/s²" if within > 0.0 else "feedback alone requires more"
    return (
        f"craft {craft} requires {required:.3g} m/s² with feedback, its limit is {limit:.3g} m/s²; {remedy}"
    )
