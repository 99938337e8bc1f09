"""The margin that fits: plans that are made anew until what their own flight needs is kept clear."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, of_each, shown
from closeform.dynamics.feedback import Feedback, Navigation, nonnegative
from closeform.dynamics.field import Field
from closeform.dynamics.flown_plan import following, paths_to_fly, spanning
from closeform.dynamics.infeasible import Grounded
from closeform.dynamics.timetable import SAME
from closeform.dynamics.tracking_margins import TrackingMargins, needed_room, tracking_margins
from closeform.dynamics.tube import tube
from closeform.fuel.thrusters import Thrusters
from closeform.motion.arc import END, START
from closeform.motion.joining import stack
from closeform.motion.path import Path, path_of
from closeform.planning.obstacles import obstacle_batch
from closeform.planning.plan import Avoidance, Plan
from closeform.result import Result
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones, pair_zones

ROUNDS = 12  # of plans; three as a rule
SPARE = 1e-3  # of a margin that grows, so that the next round does not miss by rounding


@dataclass(frozen=True, eq=False, repr=False)
class FittedMargin(Result):
    """A plan whose margin is what its own flight needs, or why there is none; made by `fit_margin`.

    Attributes
    ----------
    plan : Plan or Avoidance
        The last that was made; flown in the field, its pairs stay clear of their zones.
    room : TrackingMargins or None
        How far its craft are off it; None where it has no paths, or cannot be flown.
    margin : array of shape (B, B) [m]
        Of each pair of bodies that it was made with.
    fits : bool
        Whether all pairs have the room that they need.
    rounds : int
        How many plans were made.
    reason : str
        The same in words.
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
        """The greatest margin of any pair [m]."""
        return float(self.margin.max())


def fit_margin(
    planned: Callable[[Floats], Plan | Avoidance],
    field: Field,
    zones: OwnZone | PairZones,
    feedback: Feedback | None = None,
    navigation: Navigation | None = None,
    *,
    obstacles: Path | Any = (),
    held: bool = False,
    before: Path | None = None,
    cancel: bool = True,
    residual: ArrayLike = 0.0,
    thrust_error: ArrayLike = (0.0, 0.0),
    errors: Any = None,
    minimum_bit: float = 0.0,
    thrusters: Thrusters | Sequence[Thrusters | None] | None = None,
    sigmas: float = 4.0,
    max_acceleration: ArrayLike | None = None,
    engine: ArrayLike = True,
) -> FittedMargin:
    """A plan with the margin that its own flight needs: made, looked at, and made anew until it fits.

    Parameters
    ----------
    planned : callable
        Of a margin (B, B) [m] of all pairs of craft and, after them, obstacles: the plan that keeps it, as
        `reconfigure` and `avoid` with `margin`.
    field : Field
        What is known of the field; as of `room`.
    zones : Zone, CovarianceZone, Body or PairZones
        That the plan keeps; one for all, or of each pair.
    feedback : Feedback, optional
        As of `room`.
    navigation : Navigation, optional
        As of `room`.
    obstacles : Path or sequence of Path, default none
        Of the plan: they are where their paths say, all along it.
    held : bool, default False
        Whether they are craft that are measured and led back to their paths like the others, instead; what is
        told of each craft is of them, too, after the others.
    before : Path, optional
        What craft, and after them those that are `held`, fly until then (B,), under the same feedback: a plan
        begins with what that leaves.  Unless given it begins as `fly` does.
    cancel : bool, default True
        As of `room`.
    residual : array_like of shape (N,) or () [m/s^2], default 0
        As of `room`.
    thrust_error : array_like of shape (2,) or (N, 2), no unit and [rad], default (0, 0)
        As of `room`.
    errors : Uncertainty or sequence of Errors or None, optional
        As of `room`.
    minimum_bit : float [m/s], default 0
        As of `room`.
    thrusters : Thrusters or sequence of Thrusters or None, optional
        As of `room`.
    sigmas : float, no unit, default 4
        As of `room`.
    max_acceleration : array_like of shape (N,) or () [m/s^2], optional
        What each craft can give, for its plan, the field and feedback together.
    engine : array_like of bool of shape (N,) or (), default True
        As of `room`; an obstacle without one is `held`, and coasts in the field.

    Returns
    -------
    FittedMargin
        Not `fits` where no plan was found with the margin that was needed, one asks for more thrust than a
        craft has, or none can fly what the field adds to it.

    Raises
    ------
    ValueError
        If `planned` gives no plan, navigation is worse than a zone is large, or as `room`.

    Notes
    -----
    The first plan has the margin of noise and of `residual`, by `feedback` or, unless given, by thrust that
    lasts.  Where a pair comes nearer to its zone than it may be off along the zone's normal there, its margin
    grows to that; margins never shrink, so that rounds end.  Pairs that come near nobody keep the first.

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
        raise ValueError(f"planned: a function of a margin that makes a plan, got {shown(planned)}")
    orbit = instance("field", field, Field).chief.orbit
    instance("held", held, bool)
    instance("before", before, Path, type(None))
    others = obstacle_batch(orbit, obstacles)
    fixed = len(others) if others is not None else 0
    sight = Navigation() if navigation is None else navigation
    first = Feedback() if feedback is None else feedback  # which room knows of a plan
    least = tube(orbit, first, sight, np.max(nonnegative("residual", residual)), 0.0, sigmas)
    limit = np.inf if max_acceleration is None else nonnegative("max_acceleration", max_acceleration)
    margin: Any = np.asarray(least.radius if fixed and not held else least.of_a_pair)
    widest = _least_radius(zones)
    if margin > widest:
        cause, remedy = ("residual", "know more of the field")
        if least.model < 0.5 * least.radius:
            cause, remedy = ("navigation", "measure better")
        raise ValueError(
            f"{cause}: {margin:.3g} m of room are needed for what it leaves, more than a zone of "
            f"{widest:.3g} m; {remedy}, or keep larger zones"
        )
    for made in range(1, ROUNDS + 1):
        plan = instance("planned", planned(margin), Plan, Avoidance)
        if not plan.ok:
            why = f"no plan with a margin of {margin.max():.3g} m: {plan.reason}"
            return FittedMargin(plan, None, margin, False, made, why)
        paths = paths_to_fly(plan, field)
        craft = len(paths)
        if held and others is not None:
            paths = stack([paths[k] for k in range(craft)] + [during(others[k], paths) for k in range(fixed)])
        try:
            found = tracking_margins(
                *(_after(before, paths), field, feedback, sight),
                cancel=cancel,
                residual=residual,
                thrust_error=thrust_error,
                errors=errors,
                minimum_bit=minimum_bit,
                thrusters=thrusters,
                sigmas=sigmas,
                engine=engine,
            )
        except Grounded as error:
            return FittedMargin(plan, None, margin, False, made, f"the plan cannot be flown: {error}")
        if before is not None:
            found = found._since(float(paths.start[0]))
        limits = of_each("max_acceleration", limit, len(paths))
        beyond = np.flatnonzero(found.thrust > limits)
        if len(beyond):
            why = _too_weak(found, np.ravel(paths.peak_thrust), int(beyond[0]), limits)
            return FittedMargin(plan, found, margin, False, made, why)
        bodies = paths
        if not held and others is not None:
            bodies = stack([paths[k] for k in range(craft)] + [others[k] for k in range(fixed)])
        margin = np.broadcast_to(margin, (craft + fixed, craft + fixed)).copy()
        pairs, short = needed_room(found, bodies, pair_zones("zones", zones, craft, fixed), craft)
        rises = short > margin[tuple(pairs.T)]
        if not rises.any():
            return FittedMargin(plan, found, margin, True, made, _told(margin, made))
        one, other = pairs[rises].T
        margin[one, other] = margin[other, one] = (1.0 + SPARE) * short[rises]
    why = f"still short of room after {made} plans, with a margin of {margin.max():.3g} m"
    return FittedMargin(plan, found, margin, False, made, why)


def _after(before: Path | None, paths: Path) -> Path:
    """Paths (N,), after what is flown before them, if anything is."""
    if before is None:
        return paths
    begin, over = float(paths.start.min()), float(np.max(before.end))
    if len(before) != len(paths):
        raise ValueError(f"before: {len(before)} paths of {len(paths)} craft; give one of each")
    if over > begin + SAME:
        raise ValueError(
            f"before: ends at {over:.6g} s, and the plan begins at {begin:.6g} s; leave off the rest"
        )
    return following(before, paths)


def during(path: Path, planned: Path) -> Path:
    """One craft's path for as long as planned paths (N,) last."""
    start, end = float(planned.start.min()), float(planned.end.max())
    arcs = path.arcs[path.arcs[:, START] < end].copy()
    arcs[-1, END] = min(arcs[-1, END], end)
    return spanning(path_of(path.orbit, arcs, np.array([0, len(arcs)]), (1,)), np.array([start, end]))[0]


def _least_radius(zones: OwnZone | PairZones) -> float:
    """The radius [m] of the least zone, as a ball about the craft that it holds."""
    given = zones if isinstance(zones, PairZones) else pair_zones("zones", zones, 2)
    return min((zone.inner_radius for zone in given.zones), default=np.inf)


def _too_weak(found: TrackingMargins, peaks: Floats, craft: int, limits: Floats) -> str:
    """Which craft is asked for more than it has, and within what to plan."""
    has, asked = float(limits[craft]), float(found.thrust[craft])
    within = has - asked + float(peaks[craft])
    remedy = f"plan within {within:.3g} m/s²" if within > 0.0 else "feedback alone needs more"
    return f"craft {craft} is asked for {asked:.3g} m/s² with feedback, its limit is {has:.3g} m/s²; {remedy}"


def _told(margin: Floats, made: int) -> str:
    return f"a margin of {margin.max():.3g} m fits, in {made} plan{'s' * (made > 1)}"
