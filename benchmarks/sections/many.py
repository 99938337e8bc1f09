"""All pairs of a thousand craft on all cores: time and memory after a warm-up."""

import resource
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import closeform as cf
from cases import MEAN_MOTION, PERIOD, ZONE, cluster
from comparison import pairs_among
from peers import sampling
from peers.motion import natural
from tables import Figure, Report, Table, seconds, times
from timing import cores, side_by_side

VECTOR = "1 s sampling, table, vectorised"


def measure(quick: bool) -> Report:
    count, threads = 200 if quick else 1000, cores()
    orbit, zone = cf.Orbit(MEAN_MOTION), cf.Ellipsoid(ZONE)
    states = cluster(count, 300.0, seed=5)
    cf.screen(orbit.coast(states[:10], PERIOD), zone)
    ours = lambda: cf.screen(orbit.coast(states, PERIOD), zone)  # noqa: E731
    spells = len(ours())
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024  # before the peer takes any
    paths = np.ascontiguousarray(natural(states, MEAN_MOTION))
    # rows of equal work: craft i is searched against count - i - 1 others
    edges = count * (1 - np.sqrt(1 - np.arange(8 * threads + 1) / (8 * threads)))
    ranges = list(zip(edges.astype(int)[:-1], edges.astype(int)[1:], strict=True))

    def part(bounds: tuple[int, int]) -> int:
        first, last = bounds
        rows = sampling.search(
            "vector", paths, PERIOD, MEAN_MOTION, ZONE, box=False, thrust=False, first=first, last=last
        )
        return len(rows)

    def sampled() -> int:
        with ThreadPoolExecutor(threads) as pool:
            return sum(pool.map(part, ranges))

    sampled_spells = sampled()
    timings = side_by_side({"closeform.screen": ours, VECTOR: sampled}, 1 if quick else 5)
    base = timings["closeform.screen"].median
    rows = [
        [name, seconds(timing.median), f"±{timing.spread:.0%}", times(timing.median / base), f"{found:,}"]
        for (name, timing), found in zip(timings.items(), (spells, sampled_spells), strict=True)
    ]
    pairs = f"all {pairs_among(count, count):,} pairs"
    table = Table(
        f"{count:,} craft, {pairs}, natural motion, one orbit, {threads} cores",
        ["method", "time", "spread", "takes", "stays in the zone"],
        rows,
        [f"Most memory of the whole process with closeform: {memory / 1e6:.0f} MB."],
    )
    figures = [
        Figure("1,000 craft, all pairs", "<= 1 s", seconds(base), base <= 1.0 if not quick else None),
        Figure("1,000 craft, memory", "< 500 MB", f"{memory / 1e6:.0f} MB", memory < 500e6),
    ]
    return Report([table], figures)
