"""Slow proof: the least norm after lost thrust among random transfers, against dense random sampling.

    python tools/certify_drift.py --cases 100000 [--samples 20000] [--seed 1]

Failures and times are drawn, and flown by the textbook's matrix (tests/pairs.py), which shares nothing
with the package. Exit status 1 if a drift comes nearer than the certified least by more than 1e-9, if that
is not attained by the failure that is named, or if the verdict is another one.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import closeform as cf
from pairs import ZONES, carried, zone

OFF = 1e-9  # of the least norm; above 1, of itself
SCALE = np.array([60, 250, 60, 0.05, 0.1, 0.05])


def judge(rng, samples):
    """What is wrong in one random case."""
    orbit = cf.Orbit.circular(rng.uniform(300e3, 1500e3))
    n, period = orbit.mean_motion, orbit.period
    states = rng.normal(size=(3, 6)) * SCALE
    states[:, 4] = -2 * n * states[:, 0] + rng.normal(size=3) * 2e-3
    path = orbit.transfer(*states[:2], rng.uniform(0.3, 2.0) * period)
    until = path.end + rng.choice([0.2, 1.0, 2.0, 15.0]) * period
    other = orbit.coast(0.1 * states[2], until)
    keep_out, matrix = zone(rng, rng.choice(ZONES), 20.0)
    found = cf.drift_approach(path, other, keep_out, until)
    s = rng.uniform(0.0, path.end, samples)
    t = rng.uniform(s, until)
    s[-1], t[-1] = found.failed_at, found.time
    gap = carried(n, path.state(s), t - s) - carried(n, np.tile(0.1 * states[2], (samples, 1)), t)
    norms = keep_out.norm(gap[:, :3])
    off, wrong = OFF * max(1.0, abs(found.ratio)), []
    if norms.min() < found.ratio - off:
        wrong.append(f"missed: {norms.min()!r} below {found.ratio!r}")
    if abs(norms[-1] - found.ratio) > off:
        wrong.append(f"not attained: {norms[-1]!r}, said {found.ratio!r}")
    if cf.passively_safe(path, other, keep_out, until) != (found.ratio > 1.0) and abs(found.ratio - 1) > off:
        wrong.append(f"verdict: of {found.ratio!r}")
    return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--samples", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    rng = np.random.Generator(np.random.Philox(asked.seed))
    complaints = [(k, *wrong) for k in range(asked.cases) if (wrong := judge(rng, asked.samples))]
    print(f"{asked.cases:,} cases, {len(complaints)} wrong; seed {asked.seed}")
    for complaint in complaints[:20]:
        print(*complaint)
    sys.exit(bool(complaints))


if __name__ == "__main__":
    main()
