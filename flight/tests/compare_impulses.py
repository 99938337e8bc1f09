"""Minimum delta-v by at most six impulses: the library against the package.

Usage: compare_impulses.py COUNT [e] (e: eccentricity of the chief or "j2"; else Hill's equations and deep space)
"""

import sys

import numpy as np
from random_pairs import chief

import closeform as cf
from closeform.flight.library import check, core, doubles, filled
from closeform.flight.motion import chief_of
from closeform.motion.arc import WIDTH

COUNT = int(sys.argv[1]) if len(sys.argv) > 1 else 100
OPTIONS = [a for a in sys.argv[2:] if not a.startswith("-")]
CHIEF = OPTIONS[0] if OPTIONS else None
BUDGET = 2_000  # evaluations of a call
CALLS = 500


def planned(orbit, ends, duration):
    """Return the path, its delta-v, the lower bound, the evaluations and the status."""
    types, functions = core()
    plan = types.new("cff_impulses_t *")
    states = [filled("cff_state_t *", end) for end in ends]
    beside = chief_of(orbit)
    motion = 0.0 if beside.table is not None else orbit.mean_motion
    check(functions.cff_impulses_begin(plan, beside.pointer, motion, 0.0, duration, *states))
    status, calls, bound = "MORE", 0, 0.0
    while status == "MORE" and calls < CALLS:
        status = check(functions.cff_impulses_continue(plan, BUDGET), "MORE", "SINGULAR")
        assert plan.lower_bound_m_s >= bound
        bound, calls = plan.lower_bound_m_s, calls + 1
    arcs = doubles(plan.arcs)[: plan.count * WIDTH].reshape(-1, WIDTH)
    path = cf.Path(orbit, arcs, np.array([0, len(arcs)]), ())
    return path, plan.delta_v_m_s, plan.lower_bound_m_s, plan.evaluations_used, status


def main():
    rng, orbits = np.random.default_rng(4), [cf.Orbit(0.0), cf.Orbit(7.292e-5), cf.Orbit(1.1086e-3)]
    if CHIEF:
        orbits = [chief(CHIEF)]
    for orbit in orbits:
        used, gaps, excess, ends_off, impulses, final = [], [], [], [], [], 0
        for k in range(COUNT):
            duration = float(rng.uniform(0.05, 2.5)) * (
                orbit.period if CHIEF or orbit.mean_motion else 6000.0
            )
            ends = rng.normal(size=(2, 6)) * ([200.0] * 3 + [0.1] * 3)
            if k % 4 == 0:
                ends[:, [2, 5]] = 0.0  # in plane
            if k % 4 == 1:
                ends[:, 3:] = 0.0
            path, cost, bound, evaluations, status = planned(orbit, ends, duration)
            least = float(orbit.impulsive(*ends, duration).delta_v)
            final += status == "OK"
            if status != "OK" and "-v" in sys.argv:
                print(k, cost / bound - 1.0, cost / least - 1.0, duration)
            used.append(evaluations)
            gaps.append(cost / bound - 1.0)
            excess.append(cost / least - 1.0)
            impulses.append(np.linalg.norm(path.arcs[:, 3:6], axis=1).astype(bool).sum())
            ends_off.append(np.abs(path.state(duration) - ends[1])[:3].max())
            assert abs(path.delta_v - cost) < 1e-9 * cost, (path.delta_v, cost)
            assert bound <= least * (1.0 + 1e-9), (k, bound, least)
        print(
            f"{orbit}: {final} of {COUNT} final; cost over bound {max(gaps):.2g}, over the package's "
            f"{max(excess):.2g} (least {min(excess):.2g}); end off {max(ends_off):.2g} m; "
            f"impulses {np.bincount(impulses)}; evaluations mean {np.mean(used):.0f}, most {max(used)}"
        )


if __name__ == "__main__":
    main()
