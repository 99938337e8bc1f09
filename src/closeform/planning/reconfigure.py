"""Reconfiguration of a formation: all paths at once, each pair certified clear, at minimum cost found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import instance, sequence, size
from closeform.fuel.thrusters import Thrusters
from closeform.motion.orbit import Orbit, circular_orbit
from closeform.motion.path import Path
from closeform.motion.within_limit import TooLittleThrust
from closeform.planning.fallbacks import FALLBACKS, Attempt, Fallback, tried_openly, within_limits
from closeform.planning.impulse_checks import Spent
from closeform.planning.impulse_search import shortage, solve_impulses, unconstrained
from closeform.planning.plan import Cost, Plan, Status, weakness
from closeform.planning.planner import (
    Outcome,
    check_cost,
    check_drift,
    check_effort,
    check_errors,
    check_method,
    check_obstacles,
    joined,
    once,
    outcome,
    solve,
)
from closeform.planning.problem import Problem
from closeform.planning.prove import GAP, closeness, is_proven
from closeform.planning.prove import prove as prove_bound
from closeform.planning.request import Request
from closeform.planning.sequential import one_by_one
from closeform.planning.side_search import MARGINS, Found
from closeform.planning.slots import revised
from closeform.planning.unavoidable_conflicts import hopeless
from closeform.zones.combined_zones import OwnZone
from closeform.zones.padding import Padding
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
    method: Literal["joint", "sequential"] = "joint",
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
) -> Plan:
    """Plan the paths of N spacecraft from initial to final states, each pair certified clear of its zone.

    Parameters
    ----------
    orbit : Orbit
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
        for a thrust limit either.
    method : "joint" or "sequential", default "joint"
        "joint": all paths are optimised together.  "sequential": the spacecraft are planned one by one, and
        earlier paths are obstacles for later ones.
    order : sequence of int, optional
        Planning order of the spacecraft, by index, for "sequential"; 0, 1, ... by default.
    names : sequence of str, optional
        Names of the spacecraft, or of the spacecraft and obstacles, for use in reasons.
    budget : int, optional
        Maximum number of candidates, each a choice of passing sides solved to its local optimum.  The default
        depends on the number of pairs in contact and falls to one beyond 200.  With `drift` the search also
        ends after a counted effort for each spacecraft, as in `avoid`.
    prove : float [s], default 0
        Time limit for branch and bound over all passing sides.  It raises the lower bound until the
        optimality gap is at most `gap`, and replaces the plan if it finds one of lower cost (not with
        `max_acceleration`).
    gap : float, no unit, default 0.001
        Optimality gap, as a fraction of the lower bound, at which `prove` stops.
    cost : "energy" or "delta-v", default "energy"
        The minimised cost.  With "delta-v" the spacecraft fire impulses, or burns within `max_acceleration`:
        few, except where a path slides along a zone.  `budget` then counts starting points; "delta-v" cannot
        be combined with `prove` or "sequential".
    thrusters : Thrusters, or sequence of Thrusters or None, optional
        Thrusters of all spacecraft, or of each (None: thrust in any direction).  They require cost "delta-v",
        which is then summed over the thrusters: two that fire at once both count.  No impulse is below
        `minimum_bit` where such a plan is found; otherwise the reason states it.  With `drift` and a given
        acceleration of all thrusters, a plan around zones consists of pulses, none below `minimum_bit`.  For
        these spacecraft `max_acceleration` must be inf.
    drift : float [s], optional
        Passive-safety horizon.  If any one spacecraft permanently loses thrust at any time, while the others
        complete their plans and coast, it stays clear of every zone until this long after the last arrival.
        Obstacles must be known until then.  Cannot be combined with `prove` or "sequential".
    errors : Uncertainty, sequence of these, or None, default None
        Uncertainty of all, or of each spacecraft followed by each obstacle, independent, from the start of
        its path in the plan.  No errors within `sigmas` standard deviations cause a conflict.  Cannot be
        combined with `drift`, `prove` or "sequential".
    sigmas : float, no unit, default 3
        Number of standard deviations that are kept clear.
    margin : float, Tube or array_like of shape (N + M, N + M) [m], default 0
        Keep-out margin added to each zone (`Zone.padded`): the combined deviation of a pair from its paths.
        A tube of N spacecraft assumes that obstacles follow their paths exactly; a tube of all spacecraft
        and obstacles does not.  An array holds the margins of all pairs of spacecraft followed by obstacles.

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
    docs/theory.md section 4, many spacecraft; "sequential" follows SP11 (Sauter and Palmer 2011).
    """
    instance("assign", assign, bool, np.bool_)
    check_effort(budget, prove, gap)
    check_method(method, "joint", "sequential")
    check_cost(cost, thrusters, prove=prove > 0.0, method=method != "joint")
    drift = check_drift(drift, prove, method, "joint")
    request = Request.of(
        circular_orbit("orbit", orbit),
        initial,
        final,
        duration,
        zone,
        assign,
        start,
        obstacles,
        max_acceleration,
        names,
        cost,
        thrusters,
        drift,
    )
    count = len(request.initial)
    obstructed = len(request.others) if request.others is not None else 0
    request = replace(request, padding=Padding.of(margin, count, obstructed))
    if drift is not None:
        until = float((request.starts + request.durations).max()) + drift
        check_obstacles(request.others, until, request.names[count:])
    sigmas = size("sigmas", sigmas)
    if check_errors((errors,), zone, prove, method != "joint", drift):
        from closeform.planning.sigma_problem import Margin

        request = replace(request, kept=Margin.among(count, obstructed, errors, sigmas))
    if unknown := [word for word in sequence("if_blocked", if_blocked, str) if word not in FALLBACKS]:
        raise ValueError(f"if_blocked: must be {', '.join(map(repr, FALLBACKS))}, got {unknown[0]!r}")
    if order is not None:
        order = sequence("order", order, int, np.integer)
    if order is not None and (method == "joint" or sorted(order) != list(range(count))):
        raise ValueError(
            f"order: requires method 'sequential' and each of 0 to {count - 1} once, got {order}"
        )
    attempt = _attempts(method, range(count) if order is None else order, budget)
    if not assign:
        return _bounded(*_followed(request, attempt(request, False), attempt, if_blocked), prove, gap)
    plan = revised(request, attempt(request, False), lambda other: attempt(other, False))
    flown, plan = _followed(request.assigned(plan.slots), plan, attempt, if_blocked)
    return replace(_bounded(flown, plan, prove, gap), lower_bound=flown.least_slots()[1])


def _followed(
    request: Request, plan: Plan, attempt: Attempt, if_blocked: Sequence[Fallback]
) -> tuple[Request, Plan]:
    """Return the request and plan after the fallbacks and thrust limits have been applied."""
    if plan.status in (Status.NOT_FOUND, Status.END_UNSAFE):
        request, plan = tried_openly(request, plan, attempt, if_blocked)
    if (plan.ok or plan.weak is not None) and request.limits is not None:
        request, plan = within_limits(request, plan, attempt, "longer" in if_blocked)
    return request, plan


def _attempts(method: str, order: Sequence[int], budget: int | None) -> Attempt:
    """Return the function that plans one request; called with True, it examines more candidates."""

    def attempt(request: Request, more: bool) -> Plan:
        problem = request.problem()
        direct = problem.path(problem.direct)
        bound = float(np.sum(direct.energy))
        times = request.starts, request.durations
        plan = Plan(None, direct, request.slots, *times, nan, nan, bound, (), Status.NOT_FOUND, "")
        plan = replace(plan, drift=request.drift, sigmas=problem.sigmas)
        if request.padding is not None:
            plan = replace(plan, padding=request.padding.told)
        if none := hopeless(problem, request):
            if request.cost == "energy" and problem.drift is None and not problem.conflicts(problem.direct):
                clear = Outcome(problem.direct, (), 0.0, 1.0, True, 0)  # by less than rounding needs
                return _planned(plan, problem, clear, request.names)
            status, pair, reason = none
            if request.cost == "delta-v":
                plan = _beside(plan, problem, unconstrained(problem, request.thrusters, request.names))
            return replace(plan, status=status, reason=reason, blocked=pair)
        if request.cost == "delta-v":
            return _fired(plan, problem, request, budget, more)
        found = (
            solve(problem, budget, more) if method == "joint" else one_by_one(problem, order, budget, more)
        )
        alone = request.drift is None and request.kept is None and problem.count > 1
        if method == "joint" and found.flown is None and alone:
            found = joined(problem, one_by_one(problem, order, budget, more), found)
        if found.flown is None:
            reason = _blocked(request.names, found.blocked, found.tried)
            reason += "" if request.drift is None else found.near_miss(problem, request.names)
            return replace(plan, tried=found.tried, blocked=found.blocked, reason=reason)
        return _planned(plan, problem, found, request.names)

    return attempt


def _planned(plan: Plan, problem: Problem, found: Outcome, names: Sequence[str]) -> Plan:
    """Return the plan completed with the paths of an outcome."""
    assert found.flown is not None
    paths = problem.path(found.flown)
    ways = f"the best of {found.tried} candidate{'s' * (found.tried != 1)} examined"
    if found.order:
        ways += f", planned in order: {', '.join(names[k] for k in found.order)}"
    number = len(found.contacts)
    changed = number > 0 or not found.priced
    direct = float(plan.direct.energy.sum())
    return replace(
        plan,
        paths=paths,
        energy=max(float(paths.energy.sum()), direct),
        delta_v=float(paths.delta_v.sum()),
        contacts=found.contacts,
        clearance_ratio=found.margin,
        tried=found.tried,
        priced=found.priced,
        proven=not changed,
        status=Status.AVOIDED if changed else Status.CLEAR,
        reason=f"{number} contact{'s' * (number != 1)}, {ways}" if changed else "no conflict",
    )


def _fired(plan: Plan, problem: Problem, request: Request, budget: int | None, more: bool) -> Plan:
    """Return the plan completed with a solution of minimum delta-v, or with the reason why there is none."""
    names, limits = request.names, request.limits
    try:
        found, free = solve_impulses(problem, request.thrusters, names, budget, more, limits)
    except TooLittleThrust as little:
        assert limits is not None
        weak = shortage(problem, limits, little)
        plan = _beside(plan, problem, unconstrained(problem, request.thrusters, names))
        reason = f"{names[weak.craft]}: {little}"
        return replace(plan, status=Status.TOO_WEAK, weak=weak, reason=reason)
    plan = replace(_beside(plan, problem, free), tried=found.tried)
    if found.enough is not None and limits is not None:
        weak = shortage(problem, limits, found.enough)
        return replace(plan, status=Status.TOO_WEAK, weak=weak, reason=weakness(weak, names[weak.craft]))
    if found.flown is None:
        reason = _blocked(names, found.blocked, found.tried)
        if problem.drift is not None:
            reason += "" if limits is None or found.limited else ", also without thrust limits"
            reason += found.near_miss(problem, names)
        return replace(plan, blocked=found.blocked, reason=reason)
    paths, contacts, spent = problem.path(found.flown), once(found.contacts), found.delta_v
    bound, number = min(free.least, spent), len(contacts)
    changed = found.tried > 0
    ways = f"the best of {found.tried} start{'s' * (found.tried != 1)} examined"
    best = f"{number or 'no'} contact{'s' * (number != 1)}, {ways}"
    near = closeness(spent, bound, "delta-v", limits is not None)
    return replace(
        plan,
        paths=paths,
        energy=float(paths.energy.sum()),
        delta_v=spent,
        lower_bound=bound,
        contacts=contacts,
        clearance_ratio=found.margin,
        proven=is_proven(spent, bound),
        status=Status.AVOIDED if changed else Status.CLEAR,
        reason=f"{best if changed else 'no conflict'}, {near}{found.unfireable}",
        priced=found.priced,
    )


def _beside(plan: Plan, problem: Problem, free: Spent) -> Plan:
    """Return the plan with the unconstrained optima of delta-v as its direct paths and lower bound."""
    return replace(plan, direct=problem.path(free.flown), lower_bound=free.least, cost="delta-v")


def _bounded(request: Request, plan: Plan, seconds: float, gap: float) -> Plan:
    """Return the plan with its proven lower bound, or a plan of lower cost found during the proof."""
    if not plan.contacts or plan.cost == "delta-v":
        return plan
    problem = request.problem()
    limited = request.limits is not None
    spent = plan.extra_energy, plan.energy
    proof = prove_bound(problem, plan.contacts, *spent, seconds, gap=gap, fixed=limited)
    if proof.better is not None:
        better = outcome(Found(proof.better, MARGINS[0], False, plan.tried + proof.nodes))
        plan = _planned(plan, problem, better, request.names)
    bound = min(float(plan.direct.energy.sum()) + proof.bound, plan.energy)
    reason = f"{plan.reason}, {closeness(plan.energy, bound)}"
    return replace(plan, lower_bound=bound, proven=is_proven(plan.energy, bound), reason=reason)


def _blocked(names: Sequence[str], pair: tuple[int, int] | None, tried: int) -> str:
    """Return the reason why no plan was found."""
    who = f"{names[pair[0]]} and {names[pair[1]]}" if pair else "craft"
    return f"{who} remain in conflict in {f'all {tried} candidates' if tried != 1 else 'the only candidate'}"
