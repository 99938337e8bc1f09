"""`avoid`: the cheapest path of one craft around obstacles that do not give way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf, nan
from typing import Any, Literal, Self

import numpy as np

from closeform.arrays import Floats, instance, numbers, shown
from closeform.fuel.thrusters import Thrusters
from closeform.motion.joining import stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.planning.impulse_search import solve_impulses, unconstrained
from closeform.planning.limits import FULL, longest, stretched
from closeform.planning.obstacles import end_inside, obstacle_batch, obstacle_names
from closeform.planning.plan import Avoidance, Cost, Status, TooWeak, too_weak
from closeform.planning.planner import check_cost, check_effort, outcome, solve
from closeform.planning.problem import Problem, transfer_of
from closeform.planning.prove import closeness, is_proven
from closeform.planning.prove import prove as prove_bound
from closeform.planning.sauter_palmer import deviated
from closeform.planning.side_search import MARGINS, Found
from closeform.zones.combined_zones import OwnZone, pair_zone
from closeform.zones.pair_zones import PairZones, pair_zones
from closeform.zones.zone import Zone

Zones = tuple[tuple[Zone, Any], ...]  # each with the pairs (M, 2) that it holds for

TOO_DEAR = 1e8  # times the optimum: no plan to fly
ROUNDING = 1e-9  # of a duration
CHEAPER = 1e-6  # of its delta-v: by less, a clear path is left as it is


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
) -> Avoidance:
    """The cheapest path found between the same states and times that stays out of every zone.

    A path that is clear is returned as it is.  Whatever is returned is certified clear of the zone
    itself, or the status says why there is none: an end inside a zone, or no clear path found.

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
        What is least.  With "delta-v" the path has impulses, few but where it slides along a zone; `budget`
        counts starts, and `max_acceleration`, `prove` and "sauter-palmer" are not for it.
    thrusters : Thrusters, optional
        Only these push, with cost "delta-v", which is summed over them: two that fire at once spend what both
        do.  Also a clear path is planned anew then.

    Returns
    -------
    Avoidance
        With a certified lower bound of what any path costs.

    Raises
    ------
    ValueError
        If `path` is a batch, an obstacle is in another orbit, zones or names are not as many as obstacles,
        a limit is not positive, a budget below 1, a time negative, a word unknown, an argument of another
        kind, or the thrusters cannot make the transfer, whatever is in the way.

    References
    ----------
    SP11 (Sauter and Palmer 2011) section 4; docs/theory.md section 4.
    """
    if instance("path", path, Path).shape:
        raise ValueError(f"path: of one craft, got shape {path.shape}; index it")

    def way(factor: float) -> Path:
        return path if factor == 1.0 else transfer_of(path, factor)

    check_effort(budget, prove)
    limited = max_acceleration is not None
    check_cost(cost, thrusters, max_acceleration=limited, prove=prove > 0.0, method=method != "exact")
    instance("longer", longer, bool, np.bool_)
    if thrusters is not None:
        instance("thrusters", thrusters, Thrusters)
    task = Around.of(path.orbit, obstacles, zone, method, budget, names, cost, thrusters)
    return (
        task.plan(path, prove)
        if max_acceleration is None
        else task.keep(max_acceleration, way, longer, prove)
    )


@dataclass(frozen=True, eq=False)
class Around:
    """What one craft keeps clear of, and how it plans."""

    obstacles: Path
    zones: Zones
    names: tuple[str, ...]
    method: str
    budget: int | None
    cost: Cost = "energy"
    thrusters: Thrusters | None = None

    @classmethod
    def of(
        cls,
        orbit: Orbit,
        obstacles: Path | Sequence[Path],
        zone: OwnZone | Sequence[OwnZone] | PairZones,
        method: str,
        budget: int | None,
        names: Sequence[str] | None,
        cost: Cost = "energy",
        thrusters: Thrusters | None = None,
    ) -> Self:
        """Raises ValueError naming the argument of `avoid` that does not fit."""
        if not isinstance(method, str) or method not in ("exact", "sauter-palmer"):
            raise ValueError(f"method: 'exact' or 'sauter-palmer', not {shown(method)}")
        batch = obstacle_batch(orbit, obstacles)
        if batch is None:
            raise ValueError("obstacles: give at least one path")
        zones, called = zones_around(zone, len(batch)), obstacle_names(names, len(batch))
        return cls(batch, zones, called, method, budget, cost, thrusters)

    def plan(self, path: Path, prove: float = 0.0, fixed: bool = False) -> Avoidance:
        """The way around for a path, or the path itself where it is clear.

        `fixed`: no cheaper path is taken while proving.
        """
        optimum = transfer_of(path)
        problem = Problem.of(stack([optimum]), self.obstacles, self.zones)
        by_delta_v = self.cost == "delta-v"
        if inside := end_inside(problem):
            end, ratio, which = inside
            reason = f"the path's {end} is {ratio:.2f} x zone from {self.names[which]}; move it or the time"
            least = unconstrained(problem, (self.thrusters,), ("",)).least if by_delta_v else None
            return refused(problem, Status.END_INSIDE, reason, least=least)
        if by_delta_v and self.thrusters is not None:
            return impulsive(None, problem, self.thrusters, self.budget)
        clear = not problem.conflicts(problem.with_path(path))
        if by_delta_v:
            return impulsive(path if clear else None, problem, None, self.budget)
        if clear:
            energy, bound = path.energy, min(float(optimum.energy), path.energy)
            extra = max(energy - optimum.energy, 0.0)  # rounding, where it is the optimum itself
            proven = is_proven(energy, bound)
            return Avoidance(
                path, energy, extra, path.delta_v, bound, (), Status.CLEAR, "no conflict", proven=proven
            )
        if self.method == "sauter-palmer":
            return deviated(path, problem, self.names)
        return shaped(problem, self.budget, prove, fixed)

    def keep(
        self, max_acceleration: float, direct: Callable[[float], Path], longer: bool, prove: float = 0.0
    ) -> Avoidance:
        """The way around within a thrust limit; `direct` is the path that takes so many times as long."""
        limit = numbers("max_acceleration", max_acceleration)
        if limit.shape or not limit > 0.0:
            raise ValueError(f"max_acceleration: one positive number [m/s^2], got {shown(max_acceleration)}")
        return within_limit(self, direct, float(limit), longer, prove)


def within_limit(
    task: Around, direct: Callable[[float], Path], limit: float, longer: bool, prove: float
) -> Avoidance:
    """A way around that keeps a thrust limit [m/s^2], in the shortest longer duration found where it must."""

    def excess(found: Path) -> Floats:
        return np.array([inf if found.impulses else found.peak_thrust / limit])

    def attempt(factor: float) -> tuple[Avoidance, Floats] | None:
        found = task.plan(direct(factor))
        return (found, excess(found.path)) if found.path is not None else None

    path = direct(1.0)
    for way in dict.fromkeys((path, transfer_of(path))):  # of less thrust, where `path` is none and clear
        plan = task.plan(way, prove, fixed=True)
        if plan.path is None or (over := excess(plan.path)) <= FULL:
            return plan
    asked = float(path.end - path.start)
    plan = replace(plan, punctual=float(over[0]) * limit)

    def refused(remedy: str, excess: Floats = over, duration: float = asked) -> Avoidance:
        weak = TooWeak(0, float(excess[0]) * limit, limit, duration, remedy, asked, float(over[0]) * limit)
        return too_weak(plan, weak, "path")

    if not longer:
        return refused("allow longer, or give more time")
    there = task.obstacles.end[task.obstacles.end >= path.end - ROUNDING * asked]
    most = min(float(min(there, default=inf)) - path.start, longest(path.orbit, asked)) / asked
    if most <= 1.0 + ROUNDING:
        return refused(f"give more time, or obstacles that are known beyond {path.end:.6g} s")
    later = stretched(over, lambda factor: excess(direct(factor)), attempt, most)
    if later.found is None:
        tried = refused("give it more", later.excess, later.factor * asked)
        return replace(tried, measures=(later.measure,))
    found = task.plan(direct(later.factor), prove, fixed=True) if prove else later.found
    return replace(found, measures=(later.measure,), punctual=plan.punctual)


def shaped(problem: Problem, budget: int | None, seconds: float, fixed: bool) -> Avoidance:
    """`avoid` by method "exact"."""
    found = solve(problem, budget)
    optimum, duration = problem.energy(problem.direct), problem.last - problem.first
    ways = f"{found.tried} candidates examined"
    if found.flown is None:
        return refused(
            problem, Status.NOT_FOUND, f"no clear path among {ways}; raise budget for more", found.tried
        )
    # rest to rest over one zone in a hundredth of the time costs 1e6 of these
    zone = 1.0 / max(np.abs(one.matrix).max() for one in problem.zones)
    if found.extra > TOO_DEAR * (optimum + 6.0 * zone**2 / duration**3):
        reason = f"the cheapest of {ways} costs {found.extra:.3g} m²/s³ more; give it a longer transfer"
        return refused(problem, Status.NOT_FOUND, reason, found.tried)
    proof = prove_bound(problem, found.contacts, found.extra, optimum + found.extra, seconds, fixed=fixed)
    if proof.better is not None:
        found = outcome(Found(proof.better, MARGINS[0], False, found.tried + proof.nodes))
    assert found.flown is not None
    path = problem.path(found.flown)[0]
    energy, bound = path.energy, optimum + proof.bound
    number = len(found.contacts)
    best = f"the best of {found.tried} candidates examined, {closeness(energy, bound)}"
    return Avoidance(
        path=path,
        energy=energy,
        extra_energy=found.extra,
        delta_v=path.delta_v,
        lower_bound=min(bound, energy),
        contacts=found.contacts,
        status=Status.AVOIDED,
        reason=f"{number} contact{'s' * (number != 1)}, {best}",
        margin=found.margin,
        proven=is_proven(energy, bound),
        tried=found.tried,
    )


def impulsive(
    clear: Path | None, problem: Problem, thrusters: Thrusters | None, budget: int | None
) -> Avoidance:
    """`avoid` by least delta-v; a `clear` path is left as it is where none found is cheaper."""
    found, free = solve_impulses(problem, (thrusters,), ("",), budget)
    ways = f"{found.tried} starts examined"
    if found.flown is None and clear is None:
        reason = f"no clear path among {ways}; raise budget for more"
        return refused(problem, Status.NOT_FOUND, reason, found.tried, free.least)
    number, path, spent = len(found.contacts), clear, found.delta_v
    if found.flown is not None and (clear is None or spent < (1.0 - CHEAPER) * clear.delta_v):
        path = problem.path(found.flown)[0]
    assert path is not None
    if path is clear:
        number, spent = 0, path.delta_v
    bound = min(free.least, spent)
    best = f"{number} contact{'s' * (number != 1)}, the best of {ways}" if number else "no conflict"
    return Avoidance(
        path=path,
        energy=path.energy,
        extra_energy=path.energy - problem.energy(problem.direct),
        delta_v=spent,
        lower_bound=bound,
        contacts=found.contacts if number else (),
        status=Status.AVOIDED if number else Status.CLEAR,
        reason=f"{best}, {closeness(spent, bound, 'delta-v')}",
        margin=found.margin if number else 1.0,
        proven=is_proven(spent, bound),
        tried=found.tried,
        cost="delta-v",
        priced=found.priced or not number,
    )


def refused(
    problem: Problem, status: Status, reason: str, tried: int = 0, least: float | None = None
) -> Avoidance:
    """An avoidance without a path; `least`: what any costs at least, where that is delta-v [m/s]."""
    none = Avoidance(None, nan, nan, nan, nan, (), status, reason, tried=tried)
    if least is not None:
        return replace(none, lower_bound=least, cost="delta-v")
    return replace(none, lower_bound=problem.energy(problem.direct))


def zones_around(zone: OwnZone | Sequence[OwnZone] | PairZones, count: int) -> Zones:
    """Zones of a craft, which has none unless given, and `count` obstacles, each with its pairs."""
    if isinstance(zone, PairZones):
        return tuple(pair_zones("zone", zone, 1, count).groups())
    given = [zone] * count if isinstance(zone, OwnZone) else list(zone) if isinstance(zone, Sequence) else []
    if not given or not all(isinstance(one, OwnZone) for one in given):
        raise ValueError(f"zone: expected a zone, or one for each obstacle, got {shown(zone)}")
    if len(given) != count:
        raise ValueError(f"zone: give one zone, or one for each of {count} obstacles, not {len(given)}")
    alike: dict[int, list[int]] = {}
    for k, own in enumerate(given):
        alike.setdefault(id(own), []).append(k)
    return tuple(
        (pair_zone(given[those[0]], None)[0], np.array([[0, 1 + k] for k in those]))
        for those in alike.values()
    )
