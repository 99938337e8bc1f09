"""Avoidance by one craft: its obstacles and zones, the choice of planner, and the thrust limit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from closeform.arrays import Floats, numbers, shown
from closeform.fuel.thrusters import Thrusters
from closeform.motion.joining import stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.motion.within_limit import TooLittleThrust
from closeform.planning.impulse_search import shortage, solve_impulses, unconstrained
from closeform.planning.least_energy import refused, shaped
from closeform.planning.limits import FULL, longest, stretched
from closeform.planning.obstacles import (
    Zones,
    end_inside,
    obstacle_batch,
    obstacle_names,
    short_of,
    zones_around,
)
from closeform.planning.passive_ends import unsafe_end
from closeform.planning.plan import Avoidance, Cost, Status, ThrustShortfall, too_weak
from closeform.planning.planner import is_passive, once
from closeform.planning.problem import Problem, deepest, transfer_of
from closeform.planning.prove import GAP, closeness, is_proven
from closeform.planning.sauter_palmer import deviated
from closeform.planning.side_search import MARGINS
from closeform.zones.combined_zones import OwnZone
from closeform.zones.padding import Padding
from closeform.zones.pair_zones import PairZones

if TYPE_CHECKING:
    from closeform.planning.sigma_problem import Margin

ROUNDING = 1e-9  # of a duration
DEEP = 1.0 - 1e-6  # ratio to the slightly enlarged zone, below which the zone itself is violated
CHEAPER = 1e-6  # of its delta-v: smallest saving for which a clear path is replaced


@dataclass(frozen=True, eq=False)
class Around:
    """Obstacles, zones and planning options of one craft."""

    obstacles: Path
    zones: Zones
    names: tuple[str, ...]
    method: str
    budget: int | None
    cost: Cost = "energy"
    thrusters: Thrusters | None = None
    limit: float | None = None  # [m/s^2], of every plan with cost "delta-v"
    drift: float | None = None
    kept: Margin | None = None
    padding: Padding | None = None
    gap: float = GAP  # at which a proof ends

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
        """Return the task for the arguments of `avoid`; raise ValueError naming an invalid argument."""
        batch = obstacle_batch(orbit, obstacles)
        if batch is None:
            raise ValueError("obstacles: give at least one path")
        zones, called = zones_around(zone, len(batch)), obstacle_names(names, len(batch))
        return cls(batch, zones, called, method, budget, cost, thrusters)

    def keeping(self, path: Path, errors: Any, other_errors: Any, sigmas: Any) -> Self:
        """Return the task that also keeps `sigmas` of errors clear; raise ValueError for invalid errors."""
        from closeform.planning.sigma_problem import Margin

        return replace(self, kept=Margin.around(path, errors, self.obstacles, other_errors, sigmas))

    def padded(self, margin: Any) -> Self:
        """Return the task with a keep-out margin; raise ValueError for an invalid margin."""
        return replace(self, padding=Padding.of(margin, 1, len(self.obstacles)))

    def problem(self, direct: Path) -> Problem:
        """Return the planning problem of this task."""
        zones = self.zones if self.padding is None else self.padding.groups(self.zones)
        plain = Problem.of(direct, self.obstacles, zones, self.drift)
        return plain if self.kept is None else self.kept.problem(plain)

    def hopeless(self, problem: Problem) -> tuple[Status, str] | None:
        """Return the status and reason why no clear plan between these states exists; else None."""
        if inside := end_inside(problem):
            end, ratio, which = inside
            time = problem.first if end == "start" else problem.arrival
            short = short_of(problem, self.padding, self.zones, (0, 1 + which), time)
            if short is not None and not short.inside:
                off = f"{short.off:.3g} m from the zone of {self.names[which]}"
                less = (
                    f"less than the margin of {short.margin:.3g} m; move it or the time, or reduce the margin"
                )
                return Status.END_INSIDE, f"the path's {end} is {off}, {less}"
            depth = f"{short or problem.depth(ratio)} from {self.names[which]}"
            return Status.END_INSIDE, f"the path's {end} is {depth}; move it or the time"
        if self.drift is not None and (unsafe := unsafe_end(problem)):
            return Status.END_UNSAFE, unsafe.reason(problem, ("path", *self.names))
        return None

    def plan(self, path: Path, prove: float = 0.0, fixed: bool = False) -> Avoidance:
        """Return the avoidance for a path, or the path itself where it is clear.

        With `fixed`, the proof does not replace the path by one of lower cost.
        """
        found = self._way(path, prove, fixed)
        return found if self.padding is None else replace(found, padding=self.padding.told)

    def _way(self, path: Path, prove: float, fixed: bool) -> Avoidance:
        optimum = transfer_of(path)
        problem = self.problem(stack([optimum]))
        by_delta_v = self.cost == "delta-v"
        met = problem.direct_conflicts(MARGINS[0]) if path is optimum else []  # which the planner uses again
        deep = bool(met) and deepest(met)[1][3] < DEEP
        clear = not deep and not problem.conflicts(problem.with_path(path)) and is_passive(problem, path)
        fires = by_delta_v and self.thrusters is not None  # `path` was not planned for these thrusters
        if (fires or not clear) and (hopeless := self.hopeless(problem)):
            free = unconstrained(problem, (self.thrusters,), ("",)) if by_delta_v else None
            if free is None or self.drift is not None or not free.checked.clear:
                return refused(problem, *hopeless, least=None if free is None else free.least)
        if fires:
            return impulsive(None, problem, self)
        if by_delta_v:
            within = self.limit is None or beyond(path, self.limit) <= FULL
            return impulsive(path if clear and within else None, problem, self)
        if clear:
            energy, bound = path.energy, min(float(optimum.energy), path.energy)
            extra = max(energy - optimum.energy, 0.0)  # the optimum itself may round below 0
            proven = is_proven(energy, bound)
            return Avoidance(
                *(path, energy, extra, path.delta_v, bound, (), Status.CLEAR, "no conflict"),
                proven=proven,
                drift=self.drift,
                sigmas=problem.sigmas,
            )
        if self.method == "sauter-palmer":
            return deviated(path, problem, self.names)
        return shaped(problem, self.budget, prove, self.gap, fixed, ("path", *self.names))

    def keep(
        self, max_acceleration: float, direct: Callable[[float], Path], longer: bool, prove: float = 0.0
    ) -> Avoidance:
        """Return the avoidance within a thrust limit; `direct(factor)` is the path over a longer duration."""
        limit = numbers("max_acceleration", max_acceleration)
        if limit.shape or not limit > 0.0:
            raise ValueError(f"max_acceleration: one positive number [m/s^2], got {shown(max_acceleration)}")
        if limit == np.inf:
            return self.plan(direct(1.0), prove)
        task = replace(self, limit=float(limit)) if self.cost == "delta-v" else self
        return within_limit(task, direct, float(limit), longer, prove)


def within_limit(
    task: Around, direct: Callable[[float], Path], limit: float, longer: bool, prove: float
) -> Avoidance:
    """Return an avoidance within a thrust limit [m/s^2], over a longer duration where necessary."""
    sparing = task.cost == "delta-v"

    def excess(found: Avoidance) -> Floats:
        if found.weak is not None:
            return np.array([found.weak.needed / limit])
        return np.array([0.0 if found.path is None else beyond(found.path, limit)])

    def attempt(factor: float) -> tuple[Avoidance, Floats] | None:
        found = task.plan(direct(factor))
        return (found, excess(found)) if found.ok or found.weak is not None else None

    def free(factor: float) -> Floats:  # of minimum energy; minimum delta-v requires planning
        return np.array([0.0 if sparing else beyond(direct(factor), limit)])

    path = direct(1.0)
    # a clear `path` that is not the optimum may need more thrust than the optimum
    for way in (path,) if sparing else dict.fromkeys((path, transfer_of(path))):
        plan = task.plan(way, prove, fixed=True)
        over = excess(plan)
        if over <= FULL:  # also where no path was found
            return plan
    first, proven = float(over[0]) * limit, 0.0 if plan.weak is None else plan.weak.proven
    asked = float(path.end - path.start)
    plan = replace(plan, punctual=first)

    def refused(remedy: str, needed: float = first, duration: float = asked, least: float = 0.0) -> Avoidance:
        weak = ThrustShortfall(0, needed, limit, duration, remedy, asked, first, least)
        return too_weak(plan, weak, "path")

    if not longer:
        return refused("allow longer, or give more time", least=proven)
    there = task.obstacles.end[task.obstacles.end >= path.end - ROUNDING * asked] - (task.drift or 0.0)
    most = min(float(min(there, default=inf)) - path.start, longest(path.orbit, asked)) / asked
    if most <= 1.0 + ROUNDING:
        remedy = f"give more time, or obstacles that are known beyond {path.end:.6g} s"
        return refused(remedy, least=proven)
    later = stretched(over, free, attempt, most)
    if later.found is None:
        tried = refused("raise the limit", float(later.excess[0]) * limit, later.factor * asked)
        return replace(tried, measures=(later.measure,))
    found = task.plan(direct(later.factor), prove, fixed=True) if prove else later.found
    return replace(found, measures=(later.measure,), punctual=plan.punctual)


def beyond(path: Path, limit: float) -> float:
    """Return the peak thrust of a path divided by a limit."""
    return inf if path.impulses else float(path.peak_thrust / limit)


def impulsive(clear: Path | None, problem: Problem, task: Around) -> Avoidance:
    """Return the avoidance of minimum delta-v; a `clear` path is kept unless a cheaper one is found."""
    limits = None if task.limit is None else np.array([task.limit])
    try:
        found, free = solve_impulses(problem, (task.thrusters,), ("",), task.budget, limits=limits)
    except TooLittleThrust as little:
        assert limits is not None
        least = unconstrained(problem, (None,), ("",)).least
        none = refused(problem, Status.TOO_WEAK, str(little), least=least)
        return replace(none, weak=shortage(problem, limits, little))
    ways = f"{found.tried} start{'s' * (found.tried != 1)} examined"
    if found.flown is None and clear is None:
        reason = f"no clear path among {ways}; raise budget"
        if problem.drift is not None:
            beyond_it = "" if limits is None or found.limited else ", nor without the thrust limit"
            reason = f"no passively safe path among {ways}{beyond_it}"
            reason += found.near_miss(problem, ("path", *task.names))
        none = refused(problem, Status.NOT_FOUND, reason, found.tried, free.least)
        if found.enough is None or limits is None:
            return none
        return replace(none, status=Status.TOO_WEAK, weak=shortage(problem, limits, found.enough))
    contacts, path, spent = once(found.contacts), clear, found.delta_v
    if found.flown is not None and (clear is None or spent < (1.0 - CHEAPER) * clear.delta_v):
        path = problem.path(found.flown)[0]
    assert path is not None
    if path is clear:
        contacts, spent = (), path.delta_v
    bound, number = min(free.least, spent), len(contacts)
    changed = path is not clear and found.tried > 0
    best = f"{number or 'no'} contact{'s' * (number != 1)}, the best of {ways}" if changed else "no conflict"
    return Avoidance(
        sigmas=problem.sigmas,
        path=path,
        energy=path.energy,
        extra_energy=path.energy - problem.energy(problem.direct),
        delta_v=spent,
        lower_bound=bound,
        contacts=contacts,
        status=Status.AVOIDED if changed else Status.CLEAR,
        reason=f"{best}, {closeness(spent, bound, 'delta-v', limits is not None)}{found.unfireable}",
        clearance_ratio=found.margin if changed else 1.0,
        proven=is_proven(spent, bound),
        tried=found.tried,
        cost="delta-v",
        priced=found.priced or not number,
        drift=task.drift,
    )
