"""Avoidance of minimum energy: the best path found around the zones, or the reason why there is none."""

from collections.abc import Sequence
from dataclasses import replace
from math import nan

import numpy as np

from closeform.planning.plan import Avoidance, Status
from closeform.planning.planner import outcome, solve
from closeform.planning.problem import Problem
from closeform.planning.prove import closeness, is_proven
from closeform.planning.prove import prove as prove_bound
from closeform.planning.side_search import MARGINS, Found

TOO_DEAR = 1e8  # times the optimum: not a practical plan


def shaped(
    problem: Problem, budget: int | None, seconds: float, gap: float, fixed: bool, names: Sequence[str]
) -> Avoidance:
    """Return the avoidance of method "exact"."""
    found = solve(problem, budget)
    optimum, duration = problem.energy(problem.direct), problem.arrival - problem.first
    ways = f"{found.tried} candidate{'s' * (found.tried != 1)} examined"
    if found.flown is None:
        reason = f"no clear path among {ways}; raise budget"
        if problem.drift is not None:
            reason = f"no passively safe path among {ways}{found.near_miss(problem, names)}"
        return refused(problem, Status.NOT_FOUND, reason, found.tried)
    # a transfer from rest to rest over one zone in a hundredth of the time costs 1e6 of these
    zone = 1.0 / max(np.abs(one.matrix).max() for one in problem.zones)
    if found.extra > TOO_DEAR * (optimum + 6.0 * zone**2 / duration**3):
        reason = f"the cheapest of {ways} costs {found.extra:.3g} m²/s³ more; allow a longer transfer"
        return refused(problem, Status.NOT_FOUND, reason, found.tried)
    energy = optimum + found.extra
    proof = prove_bound(problem, found.contacts, found.extra, energy, seconds, gap=gap, fixed=fixed)
    if proof.better is not None:
        found = outcome(Found(proof.better, MARGINS[0], False, found.tried + proof.nodes))
    assert found.flown is not None
    path = problem.path(found.flown)[0]
    energy, bound = path.energy, optimum + proof.bound
    number = len(found.contacts)
    ways = f"the best of {found.tried} candidate{'s' * (found.tried != 1)} examined"
    best = f"{ways}, {closeness(energy, bound)}"
    return Avoidance(
        path=path,
        energy=energy,
        extra_energy=found.extra,
        delta_v=path.delta_v,
        lower_bound=min(bound, energy),
        contacts=found.contacts,
        status=Status.AVOIDED,
        reason=f"{number} contact{'s' * (number != 1)}, {best}",
        clearance_ratio=found.margin,
        proven=is_proven(energy, bound),
        tried=found.tried,
        priced=found.priced,
        drift=problem.drift,
        sigmas=problem.sigmas,
    )


def refused(
    problem: Problem, status: Status, reason: str, tried: int = 0, least: float | None = None
) -> Avoidance:
    """Return an avoidance without a path; `least` is the lower bound on delta-v [m/s], if minimised."""
    none = Avoidance(None, nan, nan, nan, nan, (), status, reason, tried=tried)
    none = replace(none, drift=problem.drift, sigmas=problem.sigmas)
    if least is not None:
        return replace(none, lower_bound=least, cost="delta-v")
    return replace(none, lower_bound=problem.energy(problem.direct))
