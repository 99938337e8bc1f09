"""All pairs of a coasting cluster over one orbit, on one core."""

import numpy as np

import closeform as cf
from cases import MEAN_MOTION, PERIOD, RADIUS, ZONE, cluster
from comparison import MISSED, OURS, Comparison, Method, as_found, compare, from_screening, pairs_among
from peers import sampling, vbar_peer, zero_crossings
from peers.motion import Array, natural
from tables import Figure, Report, Table, seconds, times

EACH, TABLE = "1 s sampling, sine and cosine per sample", "1 s sampling, table"
VECTOR, NUMPY = "1 s sampling, table, vectorised", "1 s sampling, NumPy"
CROSSINGS, MINIMA = "SP11's zero crossings", "V-BAR's segment_minima"


def measure(quick: bool) -> Report:
    count = 50 if quick else 700
    scattered, crowded = cluster(count, 300.0, seed=1), cluster(count, 60.0, seed=2)
    main = ellipsoids("scattered over 300 m", scattered, quick, [MISSED])
    other = ellipsoids("crowded into 60 m", crowded, quick, [])
    report = Report([main.table, other.table])
    ours = main.per_pair[OURS]
    report.speeds = {"natural": ours, "natural SP11": main.per_pair[CROSSINGS]}
    figure = Figure("screen, natural motion, a pair", "<= 0.15 µs", seconds(ours), ours <= 0.15e-6)
    report.figures.append(figure)
    for peer, least in ((EACH, 100), (TABLE, 20)):
        ratio = main.per_pair[peer] / ours
        report.figures.append(Figure(f"against {peer}", f">= {least}x", times(ratio), ratio >= least))
    ratio = other.per_pair[TABLE] / other.per_pair[OURS]
    report.figures.append(Figure(f"crowded, against {TABLE}", ">= 8x", times(ratio), ratio >= 8))
    spheres(report, scattered, quick)
    return report


def ellipsoids(name: str, states: Array, quick: bool, notes: list[str]) -> Comparison:
    """Compare with sampling and the method of SP11 on one cluster."""
    orbit, zone, count = cf.Orbit(MEAN_MOTION), cf.Ellipsoid(ZONE), len(states)
    few = 2 if quick else 12
    work = (np.ascontiguousarray(natural(states, MEAN_MOTION)), PERIOD, MEAN_MOTION, ZONE)

    def sampled(way: str, last: int) -> Method:
        return Method(lambda: sampling.search(way, *work, box=False, thrust=False, last=last), last, as_found)

    methods = {
        OURS: Method(lambda: cf.screen(orbit.coast(states, PERIOD), zone), count, from_screening),
        VECTOR: sampled("vector", count),
        TABLE: sampled("table", count),
        EACH: sampled("each", few),
        NUMPY: Method(lambda: sampling.search_numpy(*work, box=False, last=few), few, as_found),
        CROSSINGS: Method(lambda: zero_crossings.conflicts(*work, box=False), count, as_found),
    }
    title = f"Natural motion, {count} spacecraft {name}, one orbit, ellipsoid 20 x 40 x 20 m, one core"
    return compare(title, methods, count, 1 if quick else 5, notes)


def spheres(report: Report, states: Array, quick: bool) -> None:
    """Compare with V-BAR, which supports spheres and returns only the minimum margin."""
    figure = Figure("against V-BAR's batch", ">= 30x", vbar_peer.MISSING, None)
    report.figures.append(figure)
    craft = f"{len(states)} spacecraft scattered over 300 m"
    title = f"Natural motion, {craft}, one orbit, sphere of {RADIUS:g} m, one core"
    if not vbar_peer.available():
        report.tables.append(Table(title, ["method"], [], [vbar_peer.MISSING]))
        return
    orbit, zone, count = cf.Orbit(MEAN_MOTION), cf.Sphere(RADIUS), len(states)
    few = 2 if quick else 12
    pairs = np.stack(np.triu_indices(count, 1), axis=1)[: pairs_among(count, few)]
    spacing, batch = vbar_peer.fastest(states, pairs, PERIOD, MEAN_MOTION, RADIUS)
    methods = {
        OURS: Method(lambda: cf.screen(orbit.coast(states, PERIOD), zone), count, from_screening),
        MINIMA: Method(
            lambda: vbar_peer.minima(states, pairs, PERIOD, MEAN_MOTION, RADIUS, spacing, batch),
            few,
            lambda margins: whole(pairs[margins <= 0]),
        ),
    }
    note = (
        "V-BAR returns the minimum margin of a pair without times, so its conflicts are pairs. Its "
        f"spacing ({spacing:g} s) and batch size ({batch} pairs) are the fastest of those tested."
    )
    comparison = compare(title, methods, count, 1 if quick else 5, [note])
    report.tables.append(comparison.table)
    ratio = comparison.per_pair[MINIMA] / comparison.per_pair[OURS]
    figure.measured, figure.met = times(ratio), ratio >= 30


def whole(pairs: Array) -> Array:
    """Return conflicting pairs with unknown times as conflicts over the whole orbit."""
    return np.column_stack([pairs, np.zeros(len(pairs)), np.full(len(pairs), PERIOD)])
