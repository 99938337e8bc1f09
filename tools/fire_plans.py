"""Fire thousands of random plans with on-off thrusters, and compare deviation bounds with deviations.

    python tools/fire_plans.py --plans 10000

The plans are those of tests/firings.py: energy-optimal transfers, burns, impulses and mixtures, in orbits of
three periods and in deep space. Thrusters point along axes, cubes and tetrahedra, fixed in the orbit or in
inertial axes; impulse bits and periods cover orders of magnitude. In every fifth plan impulses are so close
that burns of one thruster would overlap, and are merged. The exit status is 1 if a bound is violated.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

import closeform as cf  # noqa: E402
from firings import clustered, deviation, modulated  # noqa: E402


def compared(seeds):
    """Return the ratios of bound and deviation (N,), and which plans (N,) drop impulse bits."""
    ratios, dropped = [], []
    for seed in seeds:
        drawn = modulated if seed % 5 else clustered
        firing = cf.fire_thrusters(*drawn(np.random.default_rng(seed)))
        ratios.append(firing.deviation_bound / deviation(firing, looks=12))
        dropped.append(len(firing.dropped) > 0)
    return np.array(ratios), np.array(dropped)


def main() -> int:
    """Print the comparison and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plans", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    given = parser.parse_args()
    ratios, some = compared(range(given.first, given.first + given.plans))
    broken = [given.first + int(k) for k in np.flatnonzero(~(ratios >= 1.0))]
    print(f"{len(ratios)} plans, {some.sum()} with bits dropped; bounds broken: {len(broken)} {broken[:5]}")
    for name, values in (("all", ratios), ("nothing dropped", ratios[~some])):
        low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
        print(f"bound over deviation, {name}: median {middle:.2f}, 5 to 95 % {low:.2f} to {high:.2f}")
    return int(bool(broken))


if __name__ == "__main__":
    sys.exit(main())
