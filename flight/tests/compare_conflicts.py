"""Conflicts and closest approaches of random pairs: the library against the package.

Usage: compare_conflicts.py GROUPS SIZE SEED [e] (e: eccentricity of the chief; else Hill's equations)
"""

import sys
import time

import numpy as np
from random_pairs import groups

from bridge import approaches, conflicts, library
from closeform.conflicts.pair_rows import approaches_of, conflicts_of

NUMBER, SIZE, SEED = (int(a) for a in (*sys.argv[1:4], *("80", "250", "1")[len(sys.argv) - 1 :]))
CHIEF = sys.argv[4] if len(sys.argv) > 4 else None


def main():
    lib = library()
    pairs = total = 0
    worst = {"time": 0.0, "surface": 0.0, "surface_package": 0.0, "approach": 0.0}
    differs, used, used_near, spent = [], [], [], {"package": 0.0, "library": 0.0}
    for _orbit, one, other, zone, label in groups(SEED, NUMBER, SIZE, CHIEF):
        count = len(one.offsets) - 1
        which = np.arange(count)
        since = time.perf_counter()
        of, theirs = conflicts_of(one, other, zone, which, which)
        of = of[:, 0]
        spent["package"] += time.perf_counter() - since
        since = time.perf_counter()
        mine, evaluations, status = conflicts(lib, one, other, zone)
        spent["library"] += time.perf_counter() - since
        assert (status == 0).all(), (label, np.unique(status))
        pairs, total = pairs + count, total + len(theirs)
        here, there = (np.bincount(np.asarray(x, dtype=int), minlength=count) for x in (mine[:, 0], of))
        bad = np.nonzero(here != there)[0]
        differs += [(label, int(p), int(there[p]), int(here[p])) for p in bad]
        x, y = theirs[~np.isin(of, bad)], mine[~np.isin(mine[:, 0], bad)]
        if len(x):
            pair = y[:, 0].astype(int)
            worst["time"] = max(worst["time"], np.abs(x[:, :2] - y[:, 1:3]).max())
            for name, times in (("surface", y[:, 1:3]), ("surface_package", x[:, :2])):
                for column in times.T:
                    inner = (column > np.maximum(one.start, other.start)[pair]) & (
                        column < np.minimum(one.end, other.end)[pair]
                    )
                    gap = (one._at(pair, column) - other._at(pair, column))[inner, :3]
                    if len(gap):
                        worst[name] = max(worst[name], np.abs(zone.norm(gap) - 1.0).max())
        used.append(evaluations[:, 0])
        near, evaluations, status = approaches(lib, one, other, zone)
        assert (status == 0).all(), (label, np.unique(status))
        out = approaches_of(one, other, zone, which, which)
        worst["approach"] = max(
            worst["approach"], (np.abs(out[:, 1] - near[:, 1]) / np.maximum(out[:, 1], 1.0)).max()
        )
        used_near.append(evaluations)
    print(f"{pairs} pairs, {total} conflicts; counts differ in {len(differs)}: {differs[:5]}")
    print("largest differences:", {k: float(f"{v:.2g}") for k, v in worst.items()})
    for name, v in (("conflicts", np.concatenate(used)), ("closest approach", np.concatenate(used_near))):
        print(f"evaluations, {name}: mean {v.mean():.1f}, 99 % {np.percentile(v, 99):.0f}, most {v.max()}")
    print("us per pair:", {k: round(1e6 * v / pairs, 2) for k, v in spent.items()})


if __name__ == "__main__":
    main()
