"""Check the conflict search on many random pairs against dense sampling with refinement.

    python tools/certify.py --pairs 100000 --grazing 10000 [--seed 1]

The package and an independent integrator (tests/truth.py) propagate each pair. The search runs with and
without the quick rejection by tracks that `screen` uses. The pairs cover heights of 200 to 40 000 km and deep
space, eight zone shapes, nine kinds of path, and durations from seconds to ten orbits. A grazing pair has its
zone scaled so that one extremum of its clearance ratio is within 1 % of the boundary, down to 1e-10. The exit
status is 1 if a conflict is missed, false or off the boundary at an end, if a minimum ratio is wrong, or if
the quick rejection changes a result.
"""

import argparse
import sys
import time
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import closeform as cf
from closeform.conflicts.pair_rows import conflicts_of
from closeform.conflicts.tracks import follow
from pairs import draw, graze
from truth import faults

BATCH = 25  # pairs of one orbit, duration and kinds of path
KINDS_OF_FAULT = ("missed", "false", "surface", "ratio", "approach", "tracks")
ENOUGH = 1_000_000  # number of pairs from which spacecraft are followed


def judge(batch, tally, seconds):
    """Search every pair of a batch, count the faults and return their descriptions."""
    begun = time.perf_counter()
    extrema = batch.relative.extrema()
    searching = time.perf_counter()
    found, near, tracked = [], [], []
    one = np.zeros(1, dtype=np.int64)
    for path, other, zone in zip(batch.path, batch.other, batch.zones, strict=True):
        found.append([(c.start, c.end, c.time, c.ratio) for c in cf.find_conflicts(path, other, zone)])
        bodies = path.arcs, path.offsets, other.arcs, other.offsets
        tracks = follow(*bodies, (zone,), ENOUGH)[zone]
        tracked.append(conflicts_of(path, other, zone, one, one, tracks)[1].tolist())
        near.append(cf.closest_approach(path, other, zone))
    ended = time.perf_counter()
    words = faults(batch.relative, extrema, found)
    _, sampled, (who, _, norms, _) = extrema
    attained = batch.relative.at(np.arange(len(near)), np.array([approach.time for approach in near]))[0]
    for pair, approach in enumerate(near):
        # never above the sampled minimum, and attained; sampling may miss the minimum itself
        least = min(sampled[pair].min(), norms[who == pair].min(initial=np.inf))
        slack = 1e-9 * abs(least) + 1e-12 + batch.relative.rounding[pair]
        if approach.ratio > least + slack or abs(approach.ratio - attained[pair]) > slack:
            words[pair].append(f"approach: {approach.ratio!r}, sampled {least!r}, there {attained[pair]!r}")
    for pair, rows in enumerate(tracked):
        if rows != [list(stay) for stay in found[pair]]:
            words[pair].append(f"tracks: {rows!r}, without {found[pair]!r}")
    tally["pairs"] += len(found)
    tally["in conflict"] += sum(map(bool, found))
    tally["stays"] += sum(map(len, found))
    for said in words:
        for kind in KINDS_OF_FAULT:
            tally[kind] += any(word.startswith(kind) for word in said)
    seconds["searches"] += ended - searching
    seconds["truth"] += searching - begun + time.perf_counter() - ended
    return [f"{batch.label}, pair {k}: {'; '.join(said)}" for k, said in enumerate(words) if said]


def shown(title, tally):
    counts = "".join(f"{tally[key]:>13,}" for key in ("pairs", "in conflict", "stays", *KINDS_OF_FAULT))
    print(f"{title:<10}{counts}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100_000)
    parser.add_argument("--grazing", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    rng = np.random.Generator(np.random.Philox(asked.seed))
    tallies, seconds, complaints = {"random": Counter(), "grazing": Counter()}, defaultdict(float), []
    begun = said = time.perf_counter()
    for title, wanted in (("random", asked.pairs), ("grazing", asked.grazing)):
        tally = tallies[title]
        while tally["pairs"] < wanted:
            drawing = time.perf_counter()
            batch = draw(rng, min(BATCH, wanted - tally["pairs"]))
            if title == "grazing":
                batch = graze(rng, batch)
            seconds["truth"] += time.perf_counter() - drawing
            complaints += judge(batch, tally, seconds)
            if sys.stderr.isatty() and time.perf_counter() - said > 1:
                said = time.perf_counter()
                rate = sum(t["pairs"] for t in tallies.values()) / (said - begun)
                left = (asked.pairs + asked.grazing - sum(t["pairs"] for t in tallies.values())) / rate
                print(
                    f"\r{title} {tally['pairs']:,}, {rate:,.0f} pairs/s, {left:.0f} s left ",
                    end="",
                    file=sys.stderr,
                )
    if sys.stderr.isatty():
        print("\r" + " " * 60 + "\r", end="", file=sys.stderr)
    total = time.perf_counter() - begun
    print(f"{'':<10}" + "".join(f"{k:>13}" for k in ("pairs", "in conflict", "stays", *KINDS_OF_FAULT)))
    for title, tally in tallies.items():
        shown(title, tally)
    count = sum(t["pairs"] for t in tallies.values())
    print(f"{total:.0f} s, {count / total:,.0f} pairs/s; seed {asked.seed}")
    print(f"searches {seconds['searches']:.1f} s, independent truth {seconds['truth']:.1f} s")
    for complaint in complaints[:20]:
        print(complaint)
    sys.exit(bool(complaints))


if __name__ == "__main__":
    main()
