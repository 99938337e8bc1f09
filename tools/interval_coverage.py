"""Check the coverage of the confidence intervals of collision probabilities: 930 to 970 of 1000 seeds.

    python tools/interval_coverage.py --seeds 1000

The entry-rate method has the sample size for 0.1 % of the probability, in cases with 5 % and 2 % repeated
entries. Monte Carlo has Clopper-Pearson intervals, which should cover the truth at least 930 times. The truth
comes from a million sampled entries with twice as many nodes on the surface.
"""

import argparse
import sys
from dataclasses import replace

import numpy as np

import closeform as cf
from closeform.uncertainty.collision.entry_sampling import (
    interval_of_mean,
    repeated_shares,
    sample_entries,
    sufficient_samples,
)
from closeform.uncertainty.collision.expected_entries import expected_entries
from closeform.uncertainty.collision.sampled_trajectories import SampledTrajectories, relative_errors
from closeform.uncertainty.collision.short_encounter import probability_inside

ORBIT = cf.Orbit.circular(500e3)
ZONE = cf.Sphere(15.0)
SLOW = cf.Uncertainty(np.diag([3.0, 6.0, 3.0, 2e-3, 2e-3, 2e-3]) ** 2)
AHEAD = {"a hold 120 m ahead": 120.0, "a hold 200 m ahead": 200.0}


def main() -> int:
    parser = argparse.ArgumentParser(description="Coverage of the intervals of collision probabilities.")
    parser.add_argument("--seeds", type=int, default=1000)
    seeds = parser.parse_args().seeds
    good = True
    for name, ahead in AHEAD.items():
        path = ORBIT.coast([0, ahead, 0, 0, 0, 0], 2 * ORBIT.period)
        other = ORBIT.coast(np.zeros(6), 2 * ORBIT.period)
        columns, _ = relative_errors(path, other, ZONE, SLOW, None)
        seen = SampledTrajectories.of(path, other, columns, 0.0, ZONE)
        flux = expected_entries(seen)
        finer = replace(flux, fineness=2.0 * flux.fineness)
        counts = seen.count(sample_entries(seen, finer, 1_000_000, seeds))
        truth, *_ = interval_of_mean(repeated_shares(counts))
        at_start, off = probability_inside(seen, 0.0)
        held, drawn_each = 0, []
        for seed in range(seeds):
            drawn_each.append(sufficient_samples(seen, flux, at_start, off + flux.error, seed))
            _, low, high = interval_of_mean(
                repeated_shares(seen.count(sample_entries(seen, flux, drawn_each[-1], seed)))
            )
            held += low < truth < high
        value = at_start + flux.value * (1.0 - truth)
        twice = 100.0 * (counts[:, 1] > 1).mean()
        shares = 0
        for seed in range(seeds):
            figure = cf.collision_probability(
                path, other, ZONE, SLOW, method="monte-carlo", samples=2000, seed=seed
            )
            shares += figure.low < value < figure.high
        said = (
            f"entries {held} of {seeds} with {np.mean(drawn_each):,.0f} each, Monte Carlo {shares} of {seeds}"
        )
        print(f"{name}, {value:.5g}, {twice:.1f} % enter twice: {said}", flush=True)
        good &= 0.93 * seeds <= held <= 0.97 * seeds and shares >= 0.93 * seeds
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
