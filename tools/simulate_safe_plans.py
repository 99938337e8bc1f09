"""Check passively safe plans of the ring transfers by simulation with failures of thrust.

    python tools/simulate_safe_plans.py [--failures 1000] [--group thirty|hundred|both]

Each transfer is planned at minimum energy and at minimum delta-v, then simulated by independent integrators:
fourth-order Runge-Kutta under thrust that is lost at a random instant, and matrix exponentials between
impulses, one of which may stop half-way. The exit status is 1 if a drift enters the zone by more than the
integration error.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import closeform as cf
from ring_transfers import GROUPS, RADIUS, ring_transfers
from test_passive_delta_v import failed_states, least_ratio
from test_passive_plans import flown_with_failures

SLACK = 1e-5  # of the zone: a millimetre or less is the integrators' own


def under_thrust(case, plan, failures, seed):
    """Return the minimum ratio after loss of thrust at random instants."""
    _, places, lost = flown_with_failures(plan.path, case.duration + case.drift, failures, seed)
    return float(np.where(lost, np.linalg.norm(places, axis=2), np.inf).min()) / RADIUS


def between_impulses(case, plan, failures, seed):
    """Return the minimum ratio after random losses between impulses or within one."""
    rng = np.random.default_rng(seed)
    instants, shares = rng.uniform(0.0, case.duration, failures), rng.uniform(size=failures)
    if plan.path.impulses:
        amid = rng.integers(0, 3, failures) == 0
        instants[amid] = rng.choice([at for at, _ in plan.path.impulses], amid.sum())
    states = failed_states(case.initial, plan.path, instants, shares)
    return least_ratio(states, instants, case.duration + case.drift)


def flown(group, cost, failures):
    """Return the number of plans of a group, and the minimum ratio of their drifts."""
    cases, ratios, extra, took = ring_transfers(group), [], [], []
    for k, case in enumerate(cases):
        begun = time.process_time()
        plan = cf.avoid(case.path, case.client, case.zone, drift=case.drift, cost=cost)
        took.append(time.process_time() - begun)
        if not plan.ok:
            print(f"  {case.name}: {plan.reason}")
            continue
        impulsive = cost == "delta-v" and not plan.path.thrust(0.5 * case.duration).any()
        ratios.append((between_impulses if impulsive else under_thrust)(case, plan, failures, k))
        extra.append(plan.spent / plan.lower_bound - 1.0)
    worst = min(ratios)
    print(
        f"{group}, {cost}: {len(ratios)} of {len(cases)} planned; nearest drift {worst:.6f} x zone of "
        f"{failures * len(ratios):,} failures; {np.median(extra):+.1%} above the bound in the median, "
        f"{max(extra):+.1%} at most; {np.median(took):.3f} s in the median, {max(took):.1f} s at most",
        flush=True,
    )
    return worst >= 1.0 - SLACK


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--failures", type=int, default=1000)
    parser.add_argument("--group", choices=[*GROUPS, "both"], default="both")
    asked = parser.parse_args()
    groups = list(GROUPS) if asked.group == "both" else [asked.group]
    safe = [flown(group, cost, asked.failures) for group in groups for cost in ("energy", "delta-v")]
    sys.exit(not all(safe))


if __name__ == "__main__":
    main()
