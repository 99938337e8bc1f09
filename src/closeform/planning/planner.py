"""The planner: one attempt for a request, then its fallbacks, thrust limits and lower bound.

An attempt keeps paths that are clear already.  Otherwise it searches for clear paths of minimum energy or
delta-v.  Where it finds none, the fallbacks allow more candidates, more time, or staggered starts.  Where a
plan exceeds a thrust limit, all durations are stretched.  The bound of the result is proven last.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial
from math import inf, nan

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START
from closeform.motion.joining import stack
from closeform.motion.minimum_delta_v.within_limit import TooLittleThrust
from closeform.motion.path import Path
from closeform.planning.bounds.branch_and_bound import closeness, is_proven, prove
from closeform.planning.bounds.energy_bound import EnergyBound, lower_bound
from closeform.planning.continuous.least_energy import least_energy
from closeform.planning.continuous.safe_energy import safe_starts
from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.delta_v_search import (
    fewest,
    outcome_of,
    shortage,
    solve_impulses,
    unconstrained,
)
from closeform.planning.delta_v.impulse_bound import ImpulseBound
from closeform.planning.delta_v.impulse_solver import ImpulseSolver
from closeform.planning.energy.side_search import MARGINS, Found
from closeform.planning.infeasible_ends import EndConflict, end_conflict, unsafe_end, unseparated
from closeform.planning.limits import FULL, longest, stretched
from closeform.planning.methods.sauter_palmer import deviated
from closeform.planning.methods.sequential import by_messages, one_by_one
from closeform.planning.minimum_energy import Outcome, is_passive, joined, once, outcome
from closeform.planning.plan import Plan, Status, ThrustShortfall, too_weak
from closeform.planning.problem.problem import Problem, Trajectories, deepest, is_optimum
from closeform.planning.problem.scene import Contacts
from closeform.planning.request import ROUNDING, Fallback, Request
from closeform.planning.slots import revised
from closeform.planning.violations import violations
from closeform.zones.padding import Short

STRETCHES = (1.25, 1.6, 2.0, 3.0)  # of all durations
WAITS = (0.25, 0.5, 1.0)  # of the longest duration, for the spacecraft that starts last
DEEP = 1.0 - 1e-6  # ratio to the slightly enlarged zone, below which the zone itself is violated
CHEAPER = 1e-6  # of its delta-v: smallest saving for which a clear path is replaced
TOO_DEAR = 1e8  # times the optimum: not a practical plan


def planned(request: Request) -> Plan:
    """Return the plan of a request."""
    plan, asked = attempt(request), request.arrival
    if request.assign:
        plan = revised(request, plan, attempt)
        request = request.assigned(plan.slots)
    if plan.status in (Status.NOT_FOUND, Status.END_UNSAFE):
        request, plan = fallen_back(request, plan)
    if plan.ok or plan.weak is not None:
        request, plan = within_limits(request, plan)
    plan = bounded(request, plan)
    if plan.ok and (late := request.arrival - asked) > ROUNDING * request.durations.max():
        plan = replace(plan, late=late, reason=f"arrives {late:.6g} s later than asked: {plan.reason}")
    return replace(plan, lower_bound=request.least_slots()[1]) if request.assign else plan


def attempt(request: Request, more: bool = False) -> Plan:
    """Return the plan for the slots and times of a request; with `more`, examine more candidates."""
    problem = request.problem()
    plan = unplanned(request, problem)
    least = plan.lower_bound
    if reason := end_outside(problem, request):
        return replace(plan, status=Status.END_OUTSIDE, reason=reason)
    clear = (own for own, paths in candidates(request, problem) if is_clear(problem, own, paths))
    kept = None if request.requirements else next(clear, None)  # clear paths may not keep requirements
    if request.cost == "delta-v":
        return of_least_delta_v(plan, problem, request, more, kept)
    if kept is not None:
        return unchanged(plan, kept)
    if none := infeasible_end(problem, request):
        status, pair, reason = none
        return replace(plan, status=status, reason=reason, blocked=pair)
    if request.method == "sauter-palmer":
        found = deviated(problem, request.names)
    elif request.method == "sequential":
        found = one_by_one(problem, request.order or range(problem.count), request.budget, more)
    elif request.method == "distributed":
        found = by_messages(problem, request.order or range(problem.count), request.budget)
    else:
        found = least_energy(problem, request.budget, more)
        plan = replace(plan, lower_bound=max(least, found.least))
        plain = problem.drift is None and not (request.errors or request.requirements)
        if found.trajectories is None and problem.count > 1 and plain:
            alone = one_by_one(problem, range(problem.count), request.budget, more)
            found = joined(problem, alone, found)
    if found.trajectories is None:
        return not_found(plan, request, problem, found)
    if found.priced and not found.contacts and not request.requirements:
        return unchanged(plan, problem.path(found.trajectories))
    # a transfer from rest to rest over one zone in a hundredth of the time costs 1e6 of these
    zone = 1.0 / max((np.abs(one.matrix).max() for one in problem.zones), default=1.0)
    if found.extra > TOO_DEAR * (least + 6.0 * zone**2 / (problem.arrival - problem.first) ** 3):
        reason = f"the cheapest of {examined(found)} costs {found.extra:.3g} m²/s³ more"
        return replace(plan, tried=found.tried, reason=f"{reason}; allow a longer transfer")
    return completed(plan, problem, found, request)


def unplanned(request: Request, problem: Problem) -> Plan:
    """Return the plan of a request before any search: only its direct paths."""
    direct, least = problem.path(problem.direct), problem.least_energy if request.cost == "energy" else 0.0
    return Plan(
        *(None, direct, request.slots, request.starts, request.durations, nan, nan, nan, least, ()),
        *(Status.NOT_FOUND, ""),
        cost=request.cost,
        drift=request.drift,
        sigmas=problem.sigmas,
        padding=0.0 if request.padding is None else request.padding.told,
    )


def with_checked_ends(request: Request) -> Plan:
    """Return the direct paths as a plan, without regard to zones on the way; no paths if an end excludes any.

    It fails as `planned` does for a start or an end in a zone, outside a requirement or not passively safe.
    """
    problem = request.problem()
    plan = unplanned(request, problem)
    if reason := end_outside(problem, request):
        return replace(plan, status=Status.END_OUTSIDE, reason=reason)
    clear = any(is_clear(problem, own, paths) for own, paths in candidates(request, problem))
    if request.cost == "delta-v" and request.drift is None:
        clear = clear or unconstrained(problem, request.thrusters, request.names).checked.clear
    if not clear and (none := infeasible_end(problem, request)):
        status, pair, reason = none
        return replace(plan, status=status, reason=reason, blocked=pair)
    return unchanged(plan, plan.direct)


def candidates(request: Request, problem: Problem) -> Iterator[tuple[Path, Trajectories]]:
    """Yield paths that are kept if they are clear, within the thrust limits, and those of all bodies.

    They are the given path, and those of minimum energy.  A given path was not planned for thrusters.
    """
    given = request.given
    if given is not None and request.thrusters[0] is None:
        own = stack([given])
        if (request.cost == "delta-v" or not is_optimum(given)) and keeps_limits(request, own):
            yield own, problem.with_path(given)
    if request.cost == "energy":
        optima = problem.path(problem.planned(Contacts.none()))
        if keeps_limits(request, optima):
            yield optima, problem.direct


def is_clear(problem: Problem, own: Path, trajectories: Trajectories) -> bool:
    """Return whether paths, and the free drift after any loss of thrust, are clear."""
    if trajectories is problem.direct:  # whose conflicts with a margin the search uses again
        met = problem.direct_conflicts(MARGINS[0])
        if met and (deepest(met)[1][3] < DEEP or problem.conflicts(trajectories)):
            return False
    elif problem.conflicts(trajectories):
        return False
    return is_passive(problem, own, trajectories)


def unchanged(plan: Plan, paths: Path) -> Plan:
    """Return the plan completed with clear paths that need no avoidance."""
    least, energy = plan.lower_bound, float(paths.energy.sum())
    bound = min(least, energy)
    return replace(
        plan,
        paths=paths,
        energy=energy,
        extra_energy=max(energy - least, 0.0),  # the optimum itself may round below 0
        delta_v=float(paths.delta_v.sum()),
        lower_bound=bound,
        proven=is_proven(energy, bound),
        status=Status.CLEAR,
        reason="no conflict",
    )


def completed(plan: Plan, problem: Problem, found: Outcome, request: Request) -> Plan:
    """Return the plan completed with the paths of an outcome that avoids zones or keeps requirements."""
    assert found.trajectories is not None
    paths, least = problem.path(found.trajectories), problem.least_energy
    energy, fired = max(float(paths.energy.sum()), least), request.cost == "delta-v"
    reason = found.reason or f"{contact_count(found)}, the best of {examined(found)}{found.unfireable}"
    if found.order:
        reason += f", planned in order: {', '.join(request.names[k] for k in found.order)}"
    return replace(
        plan,
        paths=paths,
        energy=energy,
        extra_energy=energy - least if fired else found.extra,
        delta_v=found.delta_v if fired else float(paths.delta_v.sum()),
        contacts=once(found.contacts) if fired else found.contacts,
        clearance_ratio=found.margin,
        tried=found.tried,
        blocked=None,
        priced=found.priced or (fired and not found.contacts),
        status=Status.AVOIDED,
        reason=reason,
    )


def of_least_delta_v(plan: Plan, problem: Problem, request: Request, more: bool, kept: Path | None) -> Plan:
    """Return the plan completed with paths of minimum delta-v, or the reason why there are none.

    Clear paths are `kept` unless cheaper ones are found.
    """
    names, limits = request.names, request.limits
    if kept is None and (none := infeasible_end(problem, request)):
        free = unconstrained(problem, request.thrusters, names)
        if problem.drift is not None or not free.checked.clear:
            status, pair, reason = none
            return replace(beside(plan, problem, free), status=status, reason=reason, blocked=pair)
    bare = replace(problem, requirements=()) if problem.requirements else problem
    by_energy = cache(lambda: least_energy(bare, more=more, waiting=False))
    try:
        searches = by_energy, partial(safe_starts, bare)
        given = request.thrusters, names, *searches, request.budget, more, limits
        found, free = solve_impulses(problem, *given)
    except TooLittleThrust as little:
        assert limits is not None
        weak = shortage(problem, limits, little)
        plan = beside(plan, problem, unconstrained(problem, request.thrusters, names))
        return replace(too_weak(plan, weak, names[weak.craft]), reason=f"{names[weak.craft]}: {little}")
    plan = replace(beside(plan, problem, free), tried=found.tried, blocked=found.blocked)
    if found.trajectories is None and kept is None:
        if found.enough is not None and limits is not None:
            weak = shortage(problem, limits, found.enough)
            return too_weak(plan, weak, names[weak.craft])
        return not_found(plan, request, problem, found)
    if found.trajectories is None or (kept and found.delta_v >= (1.0 - CHEAPER) * float(kept.delta_v.sum())):
        assert kept is not None
        paths = problem.with_path(*(kept[k] for k in range(problem.count)))
        found = Outcome(paths, (), 0.0, 1.0, 0, delta_v=float(kept.delta_v.sum()))
    plan = completed(plan, problem, found, request)
    if found.tried:
        return plan
    return replace(plan, status=Status.CLEAR, clearance_ratio=1.0, reason=f"no conflict{found.unfireable}")


def beside(plan: Plan, problem: Problem, free: Spent) -> Plan:
    """Return the plan with the unconstrained optima of delta-v as its direct paths and lower bound."""
    return replace(plan, direct=problem.path(free.trajectories), lower_bound=free.least)


def not_found(plan: Plan, request: Request, problem: Problem, found: Outcome) -> Plan:
    """Return the plan without paths, with the violations that remain where none was found."""
    plan = replace(plan, tried=found.tried, blocked=found.blocked)
    if found.reason:
        return replace(plan, reason=found.reason)
    safe, names, near = problem.drift is not None, request.names, found.closest.trajectories
    lasts = request.arrival - float(request.starts.min())
    reason = f"no {'passively safe' if safe else 'clear'} plan within {lasts:.6g} s"
    reason += f" among {examined(found)}" if found.tried else ""
    if request.limits is not None and safe and request.cost == "delta-v" and not found.limited:
        reason += ", nor without the thrust limit"
    missed = [] if near is None else violations(problem, near, names)
    pair = next((one.pair for one in missed if one.pair), plan.blocked)
    if missed:
        reason += f"; the nearest miss: {' and '.join(one.text for one in missed)}"
    elif pair is not None:
        reason += f"; {names[pair[0]]} and {names[pair[1]]} remain in conflict"
    remedies = ["allow more time"]
    if found.needed < inf:
        reason += f"; the constraints tried need at least {found.needed:.3g} times the thrust limit"
        remedies.append("raise the limit")
    if found.unfired:
        reason += "; impulses are safe, but no safe pulses above the thrusters' minimum_bit were found"
    if broken := dict.fromkeys(one.requirement for one in missed if one.requirement):
        remedies.append(f"relax the {' or the '.join(broken)}")
    if safe and pair is not None:
        remedies.append(unseparated(problem, names))
    return replace(plan, reason=f"{reason}; {', or '.join(remedies)}", blocked=pair)


def examined(found: Outcome) -> str:
    """Return the number of candidates as text."""
    return f"{found.tried} candidate{'s' * (found.tried != 1)} examined"


def contact_count(found: Outcome) -> str:
    """Return the number of contacts as text."""
    number = len(once(found.contacts))
    return f"{number or 'no'} contact{'s' * (number != 1)}"


def infeasible_end(problem: Problem, request: Request) -> tuple[Status, tuple[int, int], str] | None:
    """Return status, pair and reason why no clear plan between these states exists; else None."""
    names = request.names
    at_end = problem.without_drift
    clear = request.cost == "delta-v" and not at_end.conflicts(at_end.direct)  # without a margin
    if not clear and (found := end_conflict(at_end)):
        pair = found.pair
        short = margin_shortage(at_end, request, found)
        less = ", or reduce the margin" if short is not None and not short.inside else ""
        less += ", or reduce sigmas" if request.errors is not None else ""
        reason = f"{names[pair[0]]} and {names[pair[1]]} are at {short or at_end.depth(found.ratio)}"
        return Status.END_INSIDE, pair, f"{reason} {found.when}; move one of them{less}"
    if problem.drift is not None and (unsafe := unsafe_end(problem)):
        return Status.END_UNSAFE, unsafe.pair, unsafe.reason(problem, names)
    return None


def end_outside(problem: Problem, request: Request) -> str:
    """Return which spacecraft starts or ends outside a requirement, as text; empty if none does."""
    for k, own in enumerate(request.requirements):
        start, end = problem.base[k, [START, END]]
        ends = problem.path(problem.direct)[k].state(np.array([start, end]))
        for one in own:
            for word, time, margin in zip(("start", "end"), (start, end), one._margin(ends), strict=True):
                if one.start <= time <= one.end and margin < 0.0:
                    outside = f"is outside its {one.called}, by {-margin:.3g} {one.unit}"
                    return f"the {word} of {request.names[k]} {outside}; move it, or relax the requirement"
    return ""


def margin_shortage(problem: Problem, request: Request, at: EndConflict) -> Short | None:
    """Return a pair's shortage of keep-out margin in a conflict; None without a margin."""
    if request.padding is None:
        return None
    one, other = problem.bodies(problem.direct)._at(np.array(at.pair), np.full(2, at.time))[:, :3]
    return request.padding.shortage(request.zones, at.pair, one - other)


def fallen_back(request: Request, plan: Plan) -> tuple[Request, Plan]:
    """Return the request and plan of the first fallback that succeeds, else the given ones.

    `measures` of the plan lists the fallbacks that were tried.
    """
    done: list[str] = []
    for fallback in request.if_blocked:
        for changed, words in changes(request, fallback):
            if changed is not request and changed.longest < 1.0:
                done.append(f"{words}: an obstacle or the orbit is not known for so long")
                continue
            other = attempt(changed, fallback == "more sides")
            done.append(f"{words}: {other.reason}")
            if other.ok:
                late = "" if changed is request else f"; {words}"
                return changed, replace(other, measures=tuple(done), reason=f"{other.reason}{late}")
    return request, replace(plan, measures=tuple(done))


def changes(request: Request, fallback: Fallback) -> Iterator[tuple[Request, str]]:
    """Yield the requests of a fallback, with their descriptions."""
    if fallback == "more sides":
        yield request, "more sides"
    elif fallback == "longer":
        for factor in STRETCHES:
            yield request.longer(factor), f"longer, {factor:g} times the duration"
    else:
        for share in WAITS:
            last = share * float(request.durations.max())
            yield request.staggered(share), f"stagger, the last starts {last:.6g} s after the first"


def within_limits(request: Request, plan: Plan) -> tuple[Request, Plan]:
    """Return the request and plan with the shortest durations found that respect the thrust limits.

    The status is TOO_WEAK where no stretch does, or where the request does not allow any.
    """
    limits = request.limits
    if limits is None:
        return request, plan
    peaks = peak_thrusts(plan)
    excess = peaks / limits
    if excess.max() <= FULL:
        return request, plan
    if not plan.measures:  # otherwise a fallback has already changed the durations
        plan = replace(plan, punctual=peaks)
    proven = 0.0 if plan.weak is None else plan.weak.proven

    def refused(remedy: str, over: Floats = excess, factor: float = 1.0, least: float = 0.0) -> Plan:
        worst = int(np.argmax(over))
        needed, first = (float(one[worst] * limits[worst]) for one in (over, excess))
        lasts, limit = float(request.durations[worst]), float(limits[worst])
        weak = ThrustShortfall(worst, needed, limit, factor * lasts, remedy, lasts, first, least)
        return too_weak(plan, weak, request.names[worst])

    if not request.stretches:
        return request, refused("allow longer, or give more time", least=proven)
    if request.longest <= 1.0 + ROUNDING:
        remedy = f"give more time, with obstacles and an orbit that are known beyond {request.arrival:.6g} s"
        return request, refused(remedy, least=proven)

    def attempted(factor: float) -> tuple[Plan, Floats] | None:
        other = attempt(request.longer(factor))
        return (other, peak_thrusts(other) / limits) if other.ok or other.weak is not None else None

    def free(factor: float) -> Floats:  # of minimum energy; minimum delta-v requires planning
        if request.cost == "delta-v":
            return np.zeros(1)
        return np.asarray(request.longer(factor).direct.peak_thrust / limits)

    asked = float(request.durations.max())
    most = min(longest(request.orbit, asked) / asked, request.longest)
    later = stretched(excess, free, attempted, most)
    measures = *plan.measures, later.measure
    if later.found is None:
        return request, replace(refused("raise the limit", later.excess, later.factor), measures=measures)
    found = replace(later.found, measures=measures, punctual=plan.punctual)
    return request.longer(later.factor), replace(found, reason=f"{found.reason}; {later.measure}")


def peak_thrusts(plan: Plan) -> Floats:
    """Return peak thrusts (N,) [m/s^2]: for a shortfall only that of its craft, 0 without paths."""
    peaks = np.zeros(len(plan.starts))
    if plan.weak is not None:
        peaks[plan.weak.craft] = plan.weak.needed
    elif plan.paths is not None:
        peaks[:] = plan.paths.peak_thrust
    return peaks


def keeps_limits(request: Request, paths: Path) -> bool:
    """Return whether paths (N,) respect the thrust limits; impulses exceed any limit."""
    if request.limits is None:
        return True
    limited = np.isfinite(request.limits)
    fires = any(paths[k].impulses for k in np.flatnonzero(limited).tolist())
    return not fires and bool((paths.peak_thrust <= FULL * request.limits).all())


def bounded(request: Request, plan: Plan) -> Plan:
    """Return the plan with its certified lower bound, or a plan of lower cost found during the proof."""
    fired, compared = plan.cost == "delta-v", request.method == "sauter-palmer"
    if not plan.ok or (compared and not request.proof_time) or (plan.status is Status.CLEAR and not fired):
        return plan
    problem, limited, least, ended = request.problem(), request.limits is not None, plan.lower_bound, ""
    if not fired:
        least = max(least, problem.least_energy + lower_bound(problem, plan.contacts))
    if request.proof_time and plan.spent > (1.0 + request.gap) * least:
        more = not fired and bool(request.requirements or problem.sigmas)  # than zones: no other plans
        bound = bound_of(problem, request, plan, limited or compared or more or problem.drift is not None)
        proof = prove(bound, plan.spent, least, request.proof_time, gap=request.gap)
        least, tried = proof.bound, plan.tried + proof.nodes
        ended = "; the proof has no side left to divide" if proof.exhausted else "; the time to prove is over"
        if isinstance(bound, EnergyBound) and proof.better is not None:
            better = outcome(Found(proof.better, MARGINS[0], tried))
            plan = completed(plan, problem, better, request)
        elif isinstance(bound, ImpulseBound) and proof.better is not None and bound.plans is not None:
            better = outcome_of(bound.plans, fewest(bound.plans, proof.better), tried)
            plan = completed(plan, problem, better, request) if better.delta_v < plan.delta_v else plan
    least = min(least, plan.spent)
    ended = ended if plan.spent > (1.0 + request.gap) * least else ""
    reason = f"{plan.reason}, {closeness(plan.spent, least, plan.cost, limited and fired)}{ended}"
    return replace(plan, lower_bound=least, proven=is_proven(plan.spent, least), reason=reason)


def bound_of(problem: Problem, request: Request, plan: Plan, fixed: bool) -> EnergyBound | ImpulseBound:
    """Return the bound of a plan's cost, which finds no other plans if the plan is `fixed`."""
    relaxed, missed, failures = problem.relaxed, None, None
    if problem.drift is not None:
        from closeform.planning.delta_v.thrust_loss import ImpulseFailures
        from closeform.planning.passive.certification import failures_with_norms

        def missed(contacts: Contacts) -> tuple[Contacts, Floats]:
            bodies = relaxed.bodies(relaxed.trajectories(contacts))
            return failures_with_norms(relaxed, relaxed.path(relaxed.planned(contacts)), bodies)

        failures = ImpulseFailures(relaxed, lambda _: iter(()))
    if plan.cost == "energy":
        return EnergyBound(problem, plan.contacts, missed, fixed)
    solver = ImpulseSolver(relaxed, request.thrusters, request.names, failures)
    others = None if fixed else ImpulseSolver(problem, request.thrusters, request.names)
    return ImpulseBound(solver, plan.contacts, others)
