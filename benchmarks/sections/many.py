"""All pairs of up to a hundred thousand spacecraft: time and memory after a warm-up."""

import resource
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from swarm import crowd

import closeform as cf
from cases import MEAN_MOTION, PERIOD, ZONE, cluster
from comparison import pairs_among
from peers import sampling
from peers.motion import natural
from tables import Figure, Report, Table, seconds, times
from timing import cores, side_by_side

VECTOR = "1 s sampling, table, vectorised"
CROWDS = {1_000: 5, 3_000: 5, 10_000: 5, 30_000: 3, 100_000: 1}  # spacecraft, and how often they are screened
QUICK = {1_000: 1, 3_000: 1}
ASKED = {10_000: 4.0, 100_000: 60.0}  # s


def measure(quick: bool) -> Report:
    count, threads = 200 if quick else 1000, cores()
    orbit, zone = cf.Orbit(MEAN_MOTION), cf.Ellipsoid(ZONE)
    states = cluster(count, 300.0, seed=5)
    cf.screen(orbit.coast(states[:10], PERIOD), zone)
    ours = lambda: cf.screen(orbit.coast(states, PERIOD), zone)  # noqa: E731
    spells = len(ours())
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024  # before the peer takes any
    paths = np.ascontiguousarray(natural(states, MEAN_MOTION))
    # rows of equal work: spacecraft i is searched against count - i - 1 others
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
        f"{count:,} spacecraft, {pairs}, natural motion, one orbit, {threads} cores",
        ["method", "time", "spread", "relative time", "conflicts"],
        rows,
        [f"Peak memory of the process with closeform: {memory / 1e6:.0f} MB."],
    )
    figures = [
        Figure("1,000 spacecraft, all pairs", "<= 1 s", seconds(base), base <= 1.0 if not quick else None),
        Figure("1,000 spacecraft, memory", "< 500 MB", f"{memory / 1e6:.0f} MB", memory < 500e6),
    ]
    growth, more = grown(QUICK if quick else CROWDS)
    return Report([table, growth], figures + more)


def grown(crowds: dict[int, int]) -> tuple[Table, list[Figure]]:
    """Time the search of one orbit for crowds of equal density."""
    orbit, ball = cf.Orbit(MEAN_MOTION), cf.Sphere(20.0)
    cf.screen(orbit.coast(crowd(2000, MEAN_MOTION), PERIOD), ball)
    rows, figures = [], []
    for count, repeats in crowds.items():
        paths, found = orbit.coast(crowd(count, MEAN_MOTION), PERIOD), []
        screened = lambda paths=paths, found=found: found.append(cf.screen(paths, ball))  # noqa: E731
        took = side_by_side({f"{count:,} spacecraft": screened}, repeats)[f"{count:,} spacecraft"].median
        memory = f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6:.0f} MB"
        cells = [seconds(took), f"{took / count * 1e6:.0f} µs", memory, f"{len(found[-1]):,}"]
        rows.append([f"{count:,}", f"{pairs_among(count, count):,}", *cells])
        if count in ASKED:
            name = f"{count:,} spacecraft, one orbit, all pairs"
            figures.append(Figure(name, f"<= {ASKED[count]:g} s", seconds(took), took <= ASKED[count]))
    if 100_000 in crowds:
        few = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 < 4e9
        figures.append(Figure("100,000 spacecraft, memory", "< 4 GB", memory, few))
    notes = [
        ("Closed relative orbits, 10,000 spacecraft in a cube of 50 km at the start (`tools/swarm.py`)."),
        (
            "At equal density a larger swarm has higher relative speeds, so conflicts grow faster than "
            "the number of spacecraft."
        ),
        "Memory is the peak of the process so far, including the sampling method of the table above.",
    ]
    columns = ["spacecraft", "pairs", "time", "time per spacecraft", "memory", "conflicts"]
    return Table("Crowds of equal density, one orbit, spheres of 20 m", columns, rows, notes), figures
