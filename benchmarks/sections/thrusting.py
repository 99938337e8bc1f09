"""All pairs of spacecraft on energy-optimal transfers, on one core."""

import numpy as np

import closeform as cf
from cases import MEAN_MOTION, PERIOD, ZONE, cluster
from comparison import MISSED, OURS, Method, as_found, compare, from_screening
from peers import sampling, zero_crossings
from peers.motion import transfer
from tables import Figure, Report, seconds, times

CROSSINGS, VECTOR = "SP11's zero crossings", "1 s sampling, table, vectorised"


def measure(quick: bool) -> Report:
    count, few = (60, 2) if quick else (400, 12)
    orbit, zone = cf.Orbit(MEAN_MOTION), cf.Ellipsoid(ZONE)
    initial, final = cluster(count, 300.0, seed=3), cluster(count, 300.0, seed=4)
    paths = np.ascontiguousarray(transfer(initial, final, PERIOD, MEAN_MOTION))
    work = (paths, PERIOD, MEAN_MOTION, ZONE)

    def sampled(way: str, last: int) -> Method:
        return Method(lambda: sampling.search(way, *work, box=False, thrust=True, last=last), last, as_found)

    methods = {
        OURS: Method(lambda: cf.screen(orbit.transfer(initial, final, PERIOD), zone), count, from_screening),
        VECTOR: sampled("vector", count),
        "1 s sampling, table": sampled("table", count),
        "1 s sampling, sine and cosine per sample": sampled("each", few),
        "1 s sampling, NumPy": Method(
            lambda: sampling.search_numpy(*work, box=False, last=few), few, as_found
        ),
        CROSSINGS: Method(lambda: zero_crossings.conflicts(*work, box=False), count, as_found),
    }
    title = f"Thrusting, {count} spacecraft on transfers of one orbit, ellipsoid 20 x 40 x 20 m, one core"
    comparison = compare(title, methods, count, 1 if quick else 5, [MISSED])
    ours = comparison.per_pair[OURS]
    ratio = comparison.per_pair[VECTOR] / ours
    figures = [
        Figure("screen, thrusting, a pair", "<= 1.5 µs", seconds(ours), ours <= 1.5e-6),
        Figure(f"thrusting, against {VECTOR}", ">= 4x", times(ratio), ratio >= 4),
    ]
    speeds = {"thrusting": ours, "thrusting SP11": comparison.per_pair[CROSSINGS]}
    return Report([comparison.table], figures, speeds)
