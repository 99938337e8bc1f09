"""Passive safety of random approaches: the library against `cf.passively_safe`, and against samples.

Usage: compare_passive.py COUNT [e]
"""

import sys
from time import perf_counter

import numpy as np
from random_pairs import chief

import closeform as cf
from closeform.flight.pairs import loss_of_thrust

COUNT = int(sys.argv[1]) if len(sys.argv) > 1 else 20
CHIEF = sys.argv[2] if len(sys.argv) > 2 else "0.3"


def sampled(path, other, zone, until, count=60):
    """Return the least norm of drifts after `count` failures."""
    least = np.inf
    for fails in np.linspace(path.start, path.end, count):
        drift = path.orbit.coast(path.state(fails), until - fails, fails)
        gap = [(drift.state(t) - other.state(t))[:3] for t in np.linspace(fails, until, 400)]
        least = min(least, float(zone.norm(np.array(gap)).min()))
    return least


def main():
    orbit, rng = chief(CHIEF), np.random.default_rng(8)
    period = orbit.period
    until = 1.5 * period
    tally, used, spent = np.zeros((2, 3), int), [], [0.0, 0.0]
    for k in range(COUNT):
        length = rng.uniform(0.1, 0.6) * period
        begin, end = rng.normal(size=(2, 6)) * ([[150.0] * 3 + [0.0] * 3, [60.0] * 3 + [0.0] * 3])
        begin[4] = -2.0 * 1.1086e-3 * begin[0]
        path = (orbit.impulsive if k % 2 else orbit.transfer)(begin, end, length)
        other, size = orbit.coast(np.zeros(6), until), rng.uniform(5.0, 30.0)
        shapes = cf.Sphere(size), cf.Box([size, 1.5 * size, size]), cf.Cylinder(size, 2 * size)
        zone = shapes[rng.choice(3)]
        times = [perf_counter()]
        found = loss_of_thrust(path, other, zone, until)
        times.append(perf_counter())
        safe = bool(cf.passively_safe(path, other, zone, until))
        times.append(perf_counter())
        spent = [a + b for a, b in zip(spent, np.diff(times), strict=True)]
        used.append(found.evaluations_used)
        tally[int(safe), found.verdict] += 1
        if found.verdict == 0 and k < 12:
            assert sampled(path, other, zone, until) > 1.0 - 1e-9, (k, "falsely called safe")
        if safe != (found.verdict == 0) and "-v" in sys.argv:
            print("   ", k, zone, safe, found.verdict, found.failure_s, found.time_s)
    print(
        f"e={CHIEF}: package unsafe: library {tally[0]}, package safe: library {tally[1]} "
        f"(safe, unsafe, undecided); evaluations mean {np.mean(used):.0f}, most {max(used)}; "
        f"ms {1e3 * spent[0] / COUNT:.1f}, package {1e3 * spent[1] / COUNT:.1f}"
    )


if __name__ == "__main__":
    main()
