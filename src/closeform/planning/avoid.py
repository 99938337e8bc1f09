"""Collision avoidance of one craft: `avoid` plans the path of minimum cost around given obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

from closeform.fuel.thrusters import Thrusters
from closeform.motion.path import Path, of_one_craft
from closeform.planning.bounds.branch_and_bound import GAP
from closeform.planning.plan import Cost, Plan
from closeform.planning.planner import planned
from closeform.planning.request import Request
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty


def avoid(
    path: Path,
    obstacles: Path | Sequence[Path],
    zone: OwnZone | Sequence[OwnZone] | PairZones,
    method: Literal["exact", "sauter-palmer"] = "exact",
    *,
    max_acceleration: float | None = None,
    longer: bool = True,
    budget: int | None = None,
    prove: float = 0.0,
    gap: float = GAP,
    names: Sequence[str] | None = None,
    cost: Cost = "energy",
    thrusters: Thrusters | None = None,
    drift: float | None = None,
    errors: Uncertainty | None = None,
    other_errors: Any = None,
    sigmas: float = 3.0,
    margin: Any = 0.0,
    requirements: Any = (),
) -> Plan:
    """Plan the lowest-cost path found between the same states and times that stays out of every zone.

    A path that is already clear is returned unchanged.  Every returned path is certified clear of the zones
    themselves.  If there is none, the status is the reason: a start or end inside a zone, or no clear path
    found.

    Parameters
    ----------
    path : Path
        Path of one craft; its end states and times are kept.
    obstacles : Path or sequence of Path
        One path, a Path of shape (M,) or M paths in the same orbit: coasting, thrusting or sampled.
    zone : Zone, CovarianceZone, Body, sequence of these, or PairZones
        One for all, or one for each obstacle; the craft itself is a point at an exactly known position.
        If the craft has a zone of its own, use `PairZones` of the craft and the obstacles.
    method : "exact" or "sauter-palmer", default "exact"
        "exact": minimum energy with active constraints at contacts; the planner searches over passing sides.
        "sauter-palmer": one deviation point for each conflict, perpendicular to the cost's gradients; not
        available in deep space.
    max_acceleration : float [m/s^2], optional
        Limit of the thrust acceleration; impulses exceed any limit.  If a path exceeds it, the planner uses
        the shortest longer duration it finds that respects the limit, with the same final state.
    longer : bool, default True
        Allow a longer duration: up to ten orbits or twice the duration, in deep space up to a hundred times,
        but not beyond the end of any obstacle that is present when `path` ends.  Otherwise the status is
        TOO_WEAK, and `weak` holds the shortfall.
    budget : int, optional
        Maximum number of candidates, each solved to its local optimum.  The default depends on the number of
        zones in contact.  With `drift` the search also ends after a counted effort of about 10 s,
        the same on every machine; a budget above 24 raises it in proportion.
    prove : float [s], default 0
        Time limit for branch and bound over all passing sides.  It raises the lower bound until the
        optimality gap is at most `gap`, and replaces the path if it finds one of lower cost (not with
        `max_acceleration` or `drift`, nor at minimum energy with `errors` or `requirements`).
    gap : float, no unit, default 0.001
        Optimality gap, as a fraction of the lower bound, at which `prove` stops.
    names : sequence of str, optional
        Names of the obstacles, for use in reasons; "obstacle 0" and so on by default.
    cost : "energy" or "delta-v", default "energy"
        The minimised cost.  With "delta-v" the path has impulses, or burns within `max_acceleration`: few,
        except where it slides along a zone.  Impulses, burns and throttled parts of burns below 0.1 mm/s, or
        1 % of the delta-v where that is less, are dropped where the others can replace them at 0.1 % more
        delta-v.  `budget` then counts starting points; "delta-v" cannot be combined with
        "sauter-palmer".
    thrusters : Thrusters, optional
        Thrusters of the craft.  They require cost "delta-v", which is then summed over the thrusters: two
        that fire at once both count.  A clear path is replanned for them.  No impulse is below `minimum_bit`
        where such a path is found; otherwise the reason states it.  With `drift` and a given
        acceleration, a plan around zones consists of pulses, of which none is below `minimum_bit`.  Cannot be
        combined with `max_acceleration`.
    drift : float [s], optional
        Passive-safety horizon.  If thrust is permanently lost at any time, the craft stays clear of every
        zone until this long after the path's end.  Obstacles must be known until then.  Cannot be combined
        with "sauter-palmer".
    errors : Uncertainty or None, default None
        Uncertainty of the craft from the path's start.  No error within `sigmas` standard deviations causes a
        conflict.  Execution errors are those of the planned path.  With `drift` they count until the path's
        end; free drifts after a loss of thrust keep only the zones clear.  Cannot be combined with
        "sauter-palmer".
    other_errors : Uncertainty, sequence of these, or None, default None
        Independent uncertainty of the obstacles: one for all, or one for each.
    sigmas : float, no unit, default 3
        Number of standard deviations that are kept clear.
    margin : float, Tube or array_like of shape (1 + M, 1 + M) [m], default 0
        Keep-out margin added to each zone (`Zone.padded`): the combined deviation of craft and obstacle.  A
        tube counts twice, as if obstacles were under feedback as well; use `Tube.radius` where obstacles are
        known exactly.  An array holds the margins of all pairs of the path followed by the obstacles.
    requirements : Requirement, or sequence of these, default none
        Conditions on the states of the spacecraft in continuous time: `requirements.ApproachCone`,
        `SpeedLimit`, `KeepIn` (also a waypoint with a tolerance), or a `StateRequirement` of your own; on its
        thrust: times of `NoThrust`, `ThrustExclusion` and `Plume`.  Those on thrust require cost "delta-v";
        with another method there are none.  The lower bound counts those on states.

    Returns
    -------
    Plan
        The plan of one spacecraft, with a certified lower bound on its cost.

    Raises
    ------
    ValueError
        If `path` is a batch, an obstacle is in another orbit, the number of zones or names differs from that
        of obstacles, a limit is not positive, a budget is below 1, a time is negative, a drift is not finite
        or ends after an obstacle, sigmas or a margin is negative, a keyword is unknown, an argument has the
        wrong type, or the thrusters cannot perform the transfer.

    References
    ----------
    SP11 (Sauter and Palmer 2011) section 4; docs/theory.md section 4.

    Examples
    --------
    >>> orbit = cf.Orbit.circular(500e3)
    >>> client = orbit.coast(np.zeros(6), 300.0)
    >>> planned = orbit.transfer([0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], 300.0)
    >>> shaped = cf.avoid(planned, client, cf.Ellipsoid([20.0, 40.0, 20.0]))
    >>> shaped.ok, cf.find_conflicts(shaped.path, client, cf.Ellipsoid([20.0, 40.0, 20.0]))
    (True, ())
    """
    of_one_craft(path)
    return planned(
        Request.of_path(
            path,
            obstacles,
            zone,
            method,
            max_acceleration=max_acceleration,
            longer=longer,
            budget=budget,
            prove=prove,
            gap=gap,
            names=names,
            cost=cost,
            thrusters=thrusters,
            drift=drift,
            errors=errors,
            other_errors=other_errors,
            sigmas=sigmas,
            margin=margin,
            requirements=requirements,
        )
    )
