"""Reconfiguration of a formation: all paths at once, each pair certified clear, at the lowest cost found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from numpy.typing import ArrayLike

from closeform.fuel.thrusters import Thrusters
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.planning.bounds.branch_and_bound import GAP
from closeform.planning.plan import Cost, Plan
from closeform.planning.planner import planned
from closeform.planning.request import FALLBACKS, Fallback, Request
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones


def reconfigure(
    orbit: Orbit,
    initial: ArrayLike,
    final: ArrayLike,
    duration: ArrayLike,
    zone: OwnZone | Sequence[OwnZone | None] | PairZones,
    *,
    assign: bool = False,
    start: ArrayLike = 0.0,
    obstacles: Path | Sequence[Path] = (),
    max_acceleration: ArrayLike | None = None,
    if_blocked: Sequence[Fallback] = FALLBACKS,
    method: Literal["joint", "sequential", "distributed"] = "joint",
    order: Sequence[int] | None = None,
    names: Sequence[str] | None = None,
    budget: int | None = None,
    prove: float = 0.0,
    gap: float = GAP,
    cost: Cost = "energy",
    thrusters: Thrusters | Sequence[Thrusters | None] | None = None,
    drift: float | None = None,
    errors: Any = None,
    sigmas: float = 3.0,
    margin: Any = 0.0,
    requirements: Any = (),
) -> Plan:
    """Plan the paths of N spacecraft from initial to final states, each pair certified clear of its zone.

    Parameters
    ----------
    orbit : Orbit or ChiefOrbit
        Reference orbit; all states are in its rotating frame.
    initial : array_like of shape (N, 6) [m, m/s]
        States at each spacecraft's `start`, in the rotating frame.  Before it the spacecraft coasts.
    final : array_like of shape (N, 6) [m, m/s]
        States in the rotating frame, a `duration` after each `start`; then the spacecraft coasts.  With
        `assign`, the states of S slots, shape (S, 6), S >= N.
    duration : array_like of shape (N,) [s]
        Duration of each transfer; one number for all.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones
        One for all, or one for each spacecraft followed by one for each obstacle (None: no zone of its own).
        For a pair, the larger of two regions holds; covariances and bodies add.  `PairZones` defines the
        zone of each pair explicitly.
    assign : bool, default False
        Assign the spacecraft to the slots of minimum total cost, instead of each to its own.
    start : array_like of shape (N,) [s], default 0
        Start of each transfer; one number for all.
    obstacles : Path or sequence of Path, default none
        Paths that the plan does not change.  An obstacle is absent after its path ends.
    max_acceleration : array_like of shape (N,) [m/s^2], optional
        Limit of the thrust acceleration; one number for all.  If a plan exceeds it, the planner stretches all
        durations by the smallest factor it finds that respects the limit: up to ten orbits or twice the
        duration, in deep space up to a hundred times the duration.
    if_blocked : sequence of "more sides", "longer" or "stagger", default all
        Fallbacks, in order, for when no clear plan is found.  Without "longer", durations are not stretched
        for a thrust limit either.  `Plan.late` is the delay of the last arrival; () keeps the given times.
    method : "joint", "sequential" or "distributed", default "joint"
        "joint": all paths are optimised together.  "sequential": the spacecraft are planned one by one, and
        earlier paths are obstacles for later ones.  "distributed": each spacecraft plans on its own, all at
        once, and again when it receives a plan that conflicts with its own; the later in `order` gives way.
    order : sequence of int, optional
        Planning order of the spacecraft, by index, for "sequential", or their right of way for
        "distributed"; 0, 1, ... by default.
    names : sequence of str, optional
        Names of the spacecraft, or of the spacecraft and obstacles, for use in reasons.
    budget : int, optional
        Maximum number of candidates, each a choice of passing sides solved to its local optimum.  The default
        depends on the number of pairs in contact and falls to one beyond 200.  With `drift` the search also
        ends after a counted effort for each spacecraft, as in `avoid`.
    prove : float [s], default 0
        Time limit for branch and bound over all passing sides.  It raises the lower bound until the
        optimality gap is at most `gap`, and replaces the plan if it finds one of lower cost (not with
        `max_acceleration` or `drift`, nor at minimum energy with `errors` or `requirements`).
    gap : float, no unit, default 0.001
        Optimality gap, as a fraction of the lower bound, at which `prove` stops.
    cost : "energy" or "delta-v", default "energy"
        The minimised cost.  With "delta-v" the spacecraft fire impulses, or burns within `max_acceleration`:
        few, except where a path slides along a zone.  `budget` then counts starting points; "delta-v" cannot
        be combined with "sequential" or "distributed".
    thrusters : Thrusters, or sequence of Thrusters or None, optional
        Thrusters of all spacecraft, or of each (None: thrust in any direction).  They require cost "delta-v",
        which is then summed over the thrusters: two that fire at once both count.  No impulse is below
        `minimum_bit` where such a plan is found; otherwise the reason states it.  With `drift` and a given
        acceleration of all thrusters, a plan around zones consists of pulses, none below `minimum_bit`.  For
        these spacecraft `max_acceleration` must be inf.
    drift : float [s], optional
        Passive-safety horizon.  If any one spacecraft permanently loses thrust at any time, while the others
        complete their plans and coast, it stays clear of every zone until this long after the last arrival.
        Obstacles must be known until then.  Requires method "joint".
    errors : Uncertainty, sequence of these, or None, default None
        Uncertainty of all, or of each spacecraft followed by each obstacle, independent, from the start of
        its path in the plan.  No errors within `sigmas` standard deviations cause a conflict.  With `drift`
        they count until the last arrival; free drifts after a loss of thrust keep only the zones clear.
        Requires method "joint".
    sigmas : float, no unit, default 3
        Number of standard deviations that are kept clear.
    margin : float, Tube or array_like of shape (N + M, N + M) [m], default 0
        Keep-out margin added to each zone (`Zone.padded`): the combined deviation of a pair from its paths.
        A tube of N spacecraft assumes that obstacles follow their paths exactly; a tube of all spacecraft
        and obstacles does not.  An array holds the margins of all pairs of spacecraft followed by obstacles.
    requirements : Requirement, sequence of these, or sequence of N sequences, default none
        Conditions for all spacecraft, or for each, as in `avoid`.

    Returns
    -------
    Plan
        The plan with a certified lower bound on its cost.  Its `status` is the outcome.

    Raises
    ------
    ValueError
        If shapes do not match, a number is not finite, there are fewer slots than spacecraft, a duration or
        limit is not positive, an obstacle is in another orbit, the zones do not define a zone for a pair, the
        number of names is wrong, `order` is invalid or given with "joint", a budget is below 1, a time or
        margin is negative, a drift is not finite or ends after an obstacle, a keyword is unknown, an argument
        has the wrong type, or a spacecraft's thrusters cannot perform its transfer.

    References
    ----------
    docs/theory.md section 4, many spacecraft; "sequential" and "distributed" follow SP11 (Sauter and Palmer
    2011).
    """
    return planned(
        Request.of_formation(
            orbit,
            initial,
            final,
            duration,
            zone,
            assign=assign,
            start=start,
            obstacles=obstacles,
            max_acceleration=max_acceleration,
            if_blocked=if_blocked,
            method=method,
            order=order,
            names=names,
            budget=budget,
            prove=prove,
            gap=gap,
            cost=cost,
            thrusters=thrusters,
            drift=drift,
            errors=errors,
            sigmas=sigmas,
            margin=margin,
            requirements=requirements,
        )
    )
