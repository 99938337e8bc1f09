"""Conflicts and closest approaches of random pairs: the library against the package.

Usage: compare_conflicts.py GROUPS SIZE SEED [e] (e: eccentricity of the chief; else Hill's equations)
"""

import sys
from time import perf_counter

import numpy as np
from random_pairs import groups

from closeform.conflicts.pair_rows import approaches_of, conflicts_of
from closeform.flight.pairs import conflict_search, nearest, pair_of

NUMBER, SIZE, SEED = (int(a) for a in (*sys.argv[1:4], *("80", "250", "1")[len(sys.argv) - 1 :]))
CHIEF = sys.argv[4] if len(sys.argv) > 4 else None


def off_surface(one, other, zone, k, times):
    """Return how far the norm of pair `k` is from 1 at the times that are no ends of the paths."""
    ends = max(one.start[k], other.start[k]), min(one.end[k], other.end[k])
    inner = [t for t in times if ends[0] < t < ends[1]]
    return [abs(float(zone.norm((one[k].state(t) - other[k].state(t))[:3])) - 1.0) for t in inner]


def main():
    pairs = total = 0
    worst = dict.fromkeys(("time", "surface", "surface_package", "approach"), 0.0)
    differs, used, used_near = [], [], []
    spent = {"package": 0.0, "library": 0.0}
    for _orbit, one, other, zone, label in groups(SEED, NUMBER, SIZE, CHIEF):
        which = np.arange(SIZE)
        since = perf_counter()
        of, theirs = conflicts_of(one, other, zone, which, which)
        near = approaches_of(one, other, zone, which, which)[:, 1]
        spent["package"] += perf_counter() - since
        pairs, total = pairs + SIZE, total + len(theirs)
        for k in which:
            pair = pair_of(one[int(k)], other[int(k)], zone)
            since = perf_counter()
            spans, search = conflict_search(*pair)
            least = nearest(*pair, max(one.start[k], other.start[k]), min(one.end[k], other.end[k]))
            spent["library"] += perf_counter() - since
            used.append(search.evaluations_used)
            used_near.append(least.evaluations_used)
            worst["approach"] = max(worst["approach"], abs(least.ratio - near[k]) / max(near[k], 1.0))
            expected = theirs[of[:, 0] == k, :2]
            if len(spans) != len(expected):
                differs.append((label, int(k), len(expected), len(spans)))
                continue
            worst["time"] = max([worst["time"], *np.abs(expected - np.reshape(spans, (-1, 2))).ravel()])
            for name, times in (("surface", spans), ("surface_package", expected)):
                off = off_surface(one, other, zone, int(k), np.ravel(times))
                worst[name] = max([worst[name], *off])
    print(f"{pairs} pairs, {total} conflicts; counts differ in {len(differs)}: {differs[:5]}")
    print("largest differences:", {k: float(f"{v:.2g}") for k, v in worst.items()})
    for name, v in (("conflicts", used), ("closest approach", used_near)):
        print(f"evaluations, {name}: mean {np.mean(v):.1f}, 99 % {np.percentile(v, 99):.0f}, most {max(v)}")
    print("us per pair:", {k: round(1e6 * v / pairs, 2) for k, v in spent.items()})


if __name__ == "__main__":
    main()
