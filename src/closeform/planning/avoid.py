"""`avoid`: the cheapest path of one craft around obstacles that do not give way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from closeform.arrays import instance, size
from closeform.fuel.thrusters import Thrusters
from closeform.motion.path import Path, of_one_craft
from closeform.planning.plan import Avoidance, Cost
from closeform.planning.planner import (
    check_cost,
    check_drift,
    check_effort,
    check_errors,
    check_method,
    check_obstacles,
)
from closeform.planning.problem import transfer_of
from closeform.planning.single_craft import Around
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty

BOTH = "bounds thrust in any direction, which thrusters do not have; leave it out, they have their own"


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
    names: Sequence[str] | None = None,
    cost: Cost = "energy",
    thrusters: Thrusters | None = None,
    drift: float | None = None,
    errors: Uncertainty | None = None,
    other_errors: Any = None,
    sigmas: float = 3.0,
    margin: Any = 0.0,
) -> Avoidance:
    """The cheapest path found between the same states and times that stays out of every zone.

    A path that is clear is returned as it is.  Whatever is returned is certified clear of the zone
    itself, or the status says why there is none: its start or end inside a zone, or no clear path found.

    Parameters
    ----------
    path : Path
        Of one craft: its end states and times are kept.
    obstacles : Path or sequence of Path
        One path, a Path of shape (M,) or M paths, in the same orbit: coasting, thrusting or sampled.
    zone : Zone, Uncertainty, Body, sequence of these, or PairZones
        One for all, or one for each obstacle, which the craft keeps out of as a point that is known exactly.
        Where it has a zone of its own, `PairZones` of craft and obstacles.
    method : "exact" or "sauter-palmer", default "exact"
        "exact": least energy, by forces at contacts; the sides on which zones are passed are searched.
        "sauter-palmer": one deviation point for each conflict, perpendicular to the cost's gradients; not
        in deep space.
    max_acceleration : float [m/s^2], optional
        Bounds the thrust; impulses are beyond any limit.  A path beyond it takes the shortest longer
        duration that was found to respect it, with the same final state.
    longer : bool, default True
        Whether it may: in an orbit up to ten orbits, or twice its duration, in deep space up to a hundred
        times; but no longer than any obstacle that is there when `path` ends, as nobody knows where that
        goes on to.  Where that does not help the status is TOO_WEAK, and `weak` says by how much.
    budget : int, optional
        Candidates that are examined at most, each solved to its local optimum; by how many zones are touched
        unless given.
    prove : float [s], default 0
        For so long at most, branch and bound over all sides raises the lower bound until it is within 0.1 %,
        and takes a cheaper path where it finds one (not with `max_acceleration`).
    names : sequence of str, optional
        The obstacles', for reasons; "obstacle 0" and so on unless given.
    cost : "energy" or "delta-v", default "energy"
        What is least.  With "delta-v" the path has impulses, few but where it slides along a zone, with
        `max_acceleration` burns within it; `budget` counts starts, and `prove` and "sauter-palmer" are not
        for it.
    thrusters : Thrusters, optional
        Only these push, with cost "delta-v", which is summed over them: two that fire at once spend what both
        do.  Also a clear path is planned anew then.  No impulse is below its `minimum_bit` where such a path
        is found; otherwise the reason says so.  With `drift` and an acceleration a plan around zones is
        of the pulses that fire it, none below its `minimum_bit`.  Not with `max_acceleration`.
    drift : float [s], optional
        The path is to be passively safe: whenever its thrust is lost for good, the craft keeps out of every
        zone until so long after the path's end.  Obstacles must be known until then.  Not with `prove`
        or "sauter-palmer".
    errors : Uncertainty or None, default None
        Of the craft, from the path's start on: no error within `sigmas` standard deviations is to bring it
        into a zone.  Errors of thrust are those of the path that is found.  Not with `drift`, `prove` or
        "sauter-palmer".
    other_errors : Uncertainty, sequence of these, or None, default None
        Of the obstacles, independent: one for all, or one for each.
    sigmas : float, no unit, default 3
        How many standard deviations are kept clear.
    margin : float, Tube or array_like of shape (1 + M, 1 + M) [m], default 0
        By how much every zone is padded (`Zone.padded`): how far path and obstacle may be off together.  Of a
        tube the sum of two, as if obstacles flew under feedback too; `Tube.radius` where they are known.
        The array is of the path and, after it, obstacles.

    Returns
    -------
    Avoidance
        With a certified lower bound of what any path costs.

    Raises
    ------
    ValueError
        If `path` is a batch, an obstacle is in another orbit, zones or names are not as many as obstacles,
        a limit is not positive, a budget below 1, a time negative, a drift not finite or beyond the end of an
        obstacle, sigmas or a margin negative, a word unknown, an argument of another kind, or the thrusters
        cannot make the transfer, whatever is in the way.

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

    def way(factor: float) -> Path:
        return path if factor == 1.0 else transfer_of(path, factor)

    check_effort(budget, prove)
    check_method(method, "exact", "sauter-palmer")
    check_cost(cost, thrusters, prove=prove > 0.0, method=method != "exact")
    instance("longer", longer, bool, np.bool_)
    if thrusters is not None:
        instance("thrusters", thrusters, Thrusters)
        if max_acceleration is not None:
            raise ValueError(f"max_acceleration: {BOTH}")
    task = Around.of(path.orbit, obstacles, zone, method, budget, names, cost, thrusters)
    if (after := check_drift(drift, prove, method, "exact")) is not None:
        check_obstacles(task.obstacles, path.end + after, task.names)
        task = replace(task, drift=after)
    task, sigmas = task.padded(margin), size("sigmas", sigmas)
    if check_errors((errors, other_errors), zone, prove, method != "exact", drift):
        task = task.keeping(path, errors, other_errors, sigmas)
    return (
        task.plan(path, prove)
        if max_acceleration is None
        else task.keep(max_acceleration, way, longer, prove)
    )
