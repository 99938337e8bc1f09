"""Minimum delta-v by at most six impulses: the library against the package.

Usage: compare_impulses.py COUNT [e] (e: eccentricity of the chief or "j2"; else deep space and circles)
"""

import sys

import numpy as np
from random_pairs import chief

import closeform as cf
from closeform.flight.motion import arcs_of, planned_impulses

COUNT = int(sys.argv[1]) if len(sys.argv) > 1 else 100
CHIEF = sys.argv[2] if len(sys.argv) > 2 else None


def main():
    rng, orbits = np.random.default_rng(4), [cf.Orbit(0.0), cf.Orbit(7.292e-5), cf.Orbit(1.1086e-3)]
    for orbit in [chief(CHIEF)] if CHIEF else orbits:
        period = orbit.period if CHIEF or orbit.mean_motion else 6000.0
        used, gaps, excess, ends_off, impulses = [], [], [], [], []
        for k in range(COUNT):
            duration = float(rng.uniform(0.05, 2.5)) * period
            ends = rng.normal(size=(2, 6)) * ([200.0] * 3 + [0.1] * 3)
            if k % 4 == 0:
                ends[:, [2, 5]] = 0.0  # in plane
            if k % 4 == 1:
                ends[:, 3:] = 0.0  # at rest
            plan = planned_impulses(orbit, *ends, duration, 0.0)
            path, least = arcs_of(orbit, plan.arcs, plan.count), orbit.impulsive(*ends, duration).delta_v
            cost, bound = plan.delta_v_m_s, plan.lower_bound_m_s
            assert abs(path.delta_v - cost) < 1e-9 * cost
            assert bound <= least * (1.0 + 1e-9), (k, bound, least)
            used.append(plan.evaluations_used)
            gaps.append(cost / bound - 1.0)
            excess.append(cost / least - 1.0)
            impulses.append(np.any(path.arcs[:, 3:6], axis=1).sum())
            ends_off.append(np.abs(path.state(duration) - ends[1])[:3].max())
        print(
            f"{orbit}: {COUNT} final; cost over bound {max(gaps):.2g}, over the package's "
            f"{max(excess):.2g} (least {min(excess):.2g}); end off {max(ends_off):.2g} m; "
            f"impulses {np.bincount(impulses)}; evaluations mean {np.mean(used):.0f}, most {max(used)}"
        )


if __name__ == "__main__":
    main()
