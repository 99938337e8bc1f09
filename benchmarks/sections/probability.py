"""Collision probabilities: entry-rate method, Monte Carlo, Alfano's cases; plain Monte Carlo as the peer."""

from time import perf_counter

import numpy as np

import closeform as cf
from peers.motion import Array
from peers.probability import sampled
from tables import Figure, Report, Table, seconds
from timing import say, timed

ORBIT = cf.Orbit.circular(500e3)
N, PERIOD = ORBIT.mean_motion, ORBIT.period
ZONE = cf.Sphere(15.0)
CASES = {  # state, deviations, orbits
    "hold 120 m ahead": ([0, 120, 0, 0, 0, 0], [3, 6, 3, 2e-3, 2e-3, 2e-3], 2),
    "hold 155 m ahead": ([0, 155, 0, 0, 0, 0], [3, 6, 3, 2e-3, 2e-3, 2e-3], 2),
    "hold 200 m ahead": ([0, 200, 0, 0, 0, 0], [2, 5, 2, 1e-3, 1.5e-3, 2e-3], 2),
    "hold 300 m ahead": ([0, 300, 0, 0, 0, 0], [2, 5, 2, 1e-3, 1.4e-3, 2e-3], 2),
    "walking ellipse": ([50, 400, 0, 0, -2 * N * 50 - 2 * N, N * 50], [2, 6, 2, 2e-3, 2e-3, 2e-3], 5),
    "safety ellipse": ([60, 0, 0, 0, -2 * N * 60, N * 60], [3, 6, 3, 3e-3, 3e-3, 3e-3], 2),
    "wider ellipse": ([64.5, 0, 0, 0, -2 * N * 64.5, N * 64.5], [3, 6, 3, 3e-3, 3e-3, 3e-3], 2),
}


def measure(quick: bool) -> Report:
    rows, slowest, widest, repeats = [], 0.0, 0.0, 1 if quick else 7
    for name, (state, deviations, orbits) in CASES.items():
        say(f"  {name}")
        pair = ORBIT.coast(state, orbits * PERIOD), ORBIT.coast(np.zeros(6), orbits * PERIOD)
        errors = cf.Uncertainty(np.diag(deviations) ** 2)
        took, figure = timed(lambda p=pair, e=errors: cf.collision_probability(*p, ZONE, e), repeats)
        half = 0.5 * (figure.high - figure.low) / figure.value
        drawn, share = timed(lambda s=state, d=deviations, o=orbits: peer(s, d, o, quick), 1)
        rows.append(
            [
                name,
                f"{figure.value:.5g}",
                f"{100 * half:.3f} %",
                seconds(took),
                f"{share:.3g}",
                seconds(drawn),
            ]
        )
        if figure.value <= 0.1:
            slowest, widest = max(slowest, took), max(widest, half)
    note = (
        "500 km, sphere of 15 m. The half-width of the interval includes quadrature and sampling "
        f"errors. Plain Monte Carlo samples {peer_samples(quick):,} states with NumPy, propagates them "
        "by matrices and checks them every 10 s. It misses shorter conflicts and returns 0 for events "
        "rarer than one in its samples."
    )
    columns = ["entry-rate method", "probability", "half-width", "time", "plain Monte Carlo", "time"]
    samples = 20_000 if quick else 1_000_000
    state, deviations, _ = CASES["hold 200 m ahead"]
    pair = ORBIT.coast(state, 2 * PERIOD), ORBIT.coast(np.zeros(6), 2 * PERIOD)
    errors = cf.Uncertainty(np.diag(deviations) ** 2)
    marched, _ = timed(
        lambda: cf.collision_probability(*pair, ZONE, errors, method="monte-carlo", samples=samples), repeats
    )
    alfano, met = alfanos()
    return Report(
        [Table("Collision probabilities, two cores", columns, rows, [note])],
        [
            Figure("probability by entries, 0.1 to 1e-20", "<= 0.1 s", seconds(slowest), slowest <= 0.1),
            Figure("its interval's half-width", "<= 0.1 %", f"{100 * widest:.3f} %", widest <= 1e-3),
            Figure(
                f"Monte Carlo, {samples:,} certified trajectories of two orbits",
                "<= 0.6 s",
                seconds(marched),
                marched <= 0.6,
            ),
            Figure("Alfano's twelve cases", "<= 2 s", seconds(alfano), alfano <= 2.0),
            Figure("Alfano's cases whose entries agree to 0.1 %", "12", f"{met}", met == 12),
        ],
    )


def peer_samples(quick: bool) -> int:
    return 2000 if quick else 50_000


def peer(state: Array, deviations: Array, orbits: int, quick: bool) -> float:
    return sampled(ORBIT, state, deviations, orbits * PERIOD, 15.0, peer_samples(quick))


def alfanos() -> tuple[float, int]:
    """Return the time of all cases, and the number of those whose entries are within 0.1 % of CARA's."""
    from test_alfano import CASES as CONJUNCTIONS
    from test_alfano import probability

    begin, met = perf_counter(), 0
    for number, case in CONJUNCTIONS.items():
        _, figure = probability(number)
        met += abs(figure.mean_entries / case["entries"] - 1.0) < 1e-3
    return perf_counter() - begin, met
