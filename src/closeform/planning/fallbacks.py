"""Fallbacks of `reconfigure`: further attempts where no clear plan is found or a thrust limit is exceeded."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from closeform.arrays import Floats
from closeform.planning.limits import FULL, longest, stretched
from closeform.planning.plan import Plan, ThrustShortfall, too_weak
from closeform.planning.request import Request

Fallback = Literal["more sides", "longer", "stagger"]
FALLBACKS: tuple[Fallback, ...] = ("more sides", "longer", "stagger")
Attempt = Callable[[Request, bool], Plan]  # plans a request; with True it examines more candidates

STRETCHES = (1.25, 1.6, 2.0, 3.0)  # of all durations
WAITS = (0.25, 0.5, 1.0)  # of the longest duration, for the craft that starts last


def tried_openly(
    request: Request, plan: Plan, attempt: Attempt, if_blocked: Sequence[Fallback]
) -> tuple[Request, Plan]:
    """Return the request and plan of the first fallback that succeeds, else the given ones.

    `measures` of the plan lists the fallbacks that were tried.
    """
    done: list[str] = []
    for fallback in if_blocked:
        for changed, words in _changes(request, fallback):
            if changed is not request and changed.longest < 1.0:
                done.append(f"{words}: an obstacle ends before the drift does")
                continue
            other = attempt(changed, fallback == "more sides")
            done.append(f"{words}: {other.reason}")
            if other.ok:
                return changed, replace(other, measures=tuple(done))
    return request, replace(plan, measures=tuple(done))


def _changes(request: Request, fallback: Fallback) -> Iterator[tuple[Request, str]]:
    if fallback == "more sides":
        yield request, "more sides"
    elif fallback == "longer":
        for factor in STRETCHES:
            yield request.longer(factor), f"longer, {factor:g} times the duration"
    else:
        for share in WAITS:
            last = share * float(request.durations.max())
            yield request.staggered(share), f"stagger, the last starts {last:.6g} s after the first"


def within_limits(request: Request, plan: Plan, attempt: Attempt, longer: bool) -> tuple[Request, Plan]:
    """Return the request and plan with the shortest durations found that respect the thrust limits.

    The status is TOO_WEAK if no longer duration does, or if `longer` is False.
    """
    limits = request.limits
    if limits is None:
        return request, plan
    peaks = _peaks(request, plan)
    excess = peaks / limits
    if excess.max() <= FULL:
        return request, plan
    if not plan.measures:  # otherwise a fallback has already changed the durations
        plan = replace(plan, punctual=peaks)

    proven = 0.0 if plan.weak is None else plan.weak.proven

    def refused(remedy: str, over: Floats = excess, factor: float = 1.0, least: float = 0.0) -> Plan:
        worst = int(np.argmax(over))
        needed, first = (float(one[worst] * limits[worst]) for one in (over, excess))
        shortest = float(request.durations[worst])
        weak = ThrustShortfall(
            worst, needed, float(limits[worst]), factor * shortest, remedy, shortest, first, least
        )
        return too_weak(plan, weak, request.names[worst])

    if not longer:
        return request, refused('allow "longer", or increase the duration', least=proven)

    def attempted(factor: float) -> tuple[Plan, Floats] | None:
        other = attempt(request.longer(factor), False)
        return (other, _peaks(request, other) / limits) if other.ok or other.weak is not None else None

    def free(factor: float) -> Floats:  # of minimum energy; minimum delta-v requires planning
        sparing = request.cost == "delta-v"
        return np.zeros(1) if sparing else np.asarray(request.longer(factor).direct.peak_thrust / limits)

    asked = float(request.durations.max())
    most = min(longest(request.orbit, asked) / asked, request.longest)
    later = stretched(excess, free, attempted, most)
    measures = *plan.measures, later.measure
    if later.found is None:
        return request, replace(refused("raise the limit", later.excess, later.factor), measures=measures)
    return request.longer(later.factor), replace(later.found, measures=measures, punctual=plan.punctual)


def _peaks(request: Request, plan: Plan) -> Floats:
    """Return peak thrusts (N,) [m/s^2]; after a shortfall only that of its craft, and 0 without paths."""
    peaks = np.zeros(len(request.initial))
    if plan.weak is not None:
        peaks[plan.weak.craft] = plan.weak.needed
    elif plan.paths is not None:
        peaks[:] = plan.paths.peak_thrust
    return peaks
