"""What is tried, openly, where no clear plan was found or a plan asks for more thrust than there is."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import nan
from typing import Any, Literal

import numpy as np

from closeform.motion.path import Path
from closeform.planning.plan import Plan, Status
from closeform.planning.request import Request

Fallback = Literal["more sides", "longer", "stagger"]
FALLBACKS: tuple[Fallback, ...] = ("more sides", "longer", "stagger")
Attempt = Callable[[Request, bool], Plan]  # plans what is asked; with True in more ways

STRETCHES = (1.25, 1.6, 2.0, 3.0)  # of all durations
WAITS = (0.25, 0.5, 1.0)  # of the longest duration, for the craft that starts last
LEAST_STEP, LARGEST_STEP = 1.02, 2.0  # by which durations are stretched at a time to respect a thrust limit
STRETCHINGS = 16  # times at most
HALVINGS = 5  # and how often the last stretch is halved
FULL = 1 + 1e-9  # of a limit


def tried_openly(
    request: Request, plan: Plan, attempt: Attempt, if_blocked: Sequence[Fallback]
) -> tuple[Request, Plan]:
    """The first plan that works, and what it answers; else the one given.  `measures`: what was tried."""
    done: list[str] = []
    for fallback in if_blocked:
        for changed, words in _changes(request, fallback):
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
    """A plan that respects the thrust limits: the shortest stretch of all durations that was found to.

    TOO_WEAK where none does, or where `longer` is not allowed.
    """
    excess = _excess(request, plan.paths)
    if excess.max() <= FULL:
        return request, plan
    if not longer:
        return request, _too_weak(request, plan, excess, 'allow "longer", or give more time')
    weak, worst = request, excess
    short = long = 1.0
    best: Plan | None = None
    for _ in range(STRETCHINGS):
        short = long
        long *= float(np.clip(np.sqrt(worst.max()), LEAST_STEP, LARGEST_STEP))  # thrust: as 1 / time^2
        changed = request.longer(long)
        excess = _excess(changed, changed.direct)
        if excess.max() <= FULL:
            other = attempt(changed, False)
            if not other.ok:
                continue
            excess = _excess(changed, other.paths)
            if excess.max() <= FULL:
                best = other
                break
        weak, worst = changed, excess
    if best is None:
        words = f"longer, up to {long:.4g} times the duration: the thrust limit is not kept"
        plan = replace(plan, measures=(*plan.measures, words))
        return request, _too_weak(weak, plan, worst, "give it more")
    for _ in range(HALVINGS):
        middle = 0.5 * (short + long)
        other = attempt(request.longer(middle), False)
        if other.ok and _excess(request, other.paths).max() <= FULL:
            best, long = other, middle
        else:
            short = middle
    words = f"longer, {long:.6g} times the duration: the thrust limit is kept"
    return request.longer(long), replace(best, measures=(*plan.measures, words))


def _excess(request: Request, paths: Path | None) -> Any:
    """Peak thrust over its limit (N,)."""
    return np.zeros(1) if paths is None else paths.peak_thrust / request.limits


def _too_weak(request: Request, plan: Plan, excess: Any, remedy: str) -> Plan:
    worst = int(np.argmax(excess))
    limit = request.limits[worst] if request.limits is not None else nan
    reason = (
        f"{request.names[worst]} needs {excess[worst] * limit:.4g} m/s² in {request.durations[worst]:.6g} s, "
        f"its limit is {limit:.4g} m/s²; {remedy}"
    )
    plan = replace(plan, paths=None, energy=nan, delta_v=nan, contacts=(), proven=False)
    return replace(plan, status=Status.TOO_WEAK, reason=reason)
