"""Clearance in sigmas: verdicts, values and a fleet; nearest-point grids and sampled errors as peers."""

import numpy as np

import closeform as cf
from closeform.uncertainty.covariance_propagation import propagate_errors
from closeform.uncertainty.sigmas.conflicts import sigma_conflicts
from peers.sigmas import drawn, on_grid
from sections.probability import CASES, ORBIT, PERIOD, N
from tables import Figure, Report, Table, seconds
from timing import say, timed

MOVING = ("hold 200 m ahead", "safety ellipse", "walking ellipse")
ZONES = {
    "sphere": cf.Sphere(15.0),
    "box": cf.Box([15.0, 30.0, 15.0]),
    "cylinder": cf.Cylinder(15.0, 30.0, [1.0, 1.0, 0.0]),
}
PAIRS = 200  # in one call, so that a pair's share is the search's


def measure(quick: bool) -> Report:
    repeats, pairs = (1, 5) if quick else (7, PAIRS)
    rows, slowest, longest = [], 0.0, {2: 0.0, 5: 0.0}
    for name in MOVING:
        say(f"  {name}")
        for shape, zone in ZONES.items():
            verdict, least, k = one_pair(name, zone, pairs, repeats)
            slowest = max(slowest, verdict)
            longest[CASES[name][2]] = max(longest[CASES[name][2]], least)
            cells = [f"{CASES[name][2]}", f"{k:.4f}", seconds(verdict), seconds(least)]
            rows.append([f"{name}, {shape}", *cells])
    say("  a fleet")
    craft, took, found = fleet(quick)
    columns = ["case", "orbits", "sigmas", "verdict at 0.9 sigmas", "sigmas to 1e-9"]
    note = (
        f"Time per pair of {pairs} in one call, one core; 500 km, standard deviations of some metres "
        "and mm/s."
    )
    return Report(
        [
            Table("Clearance in sigmas, by pair", columns, rows, [note]),
            peers(quick),
        ],
        [
            Figure("verdict at k sigmas, 2 to 5 orbits", "<= 30 us", seconds(slowest), slowest <= 30e-6),
            *(
                Figure(f"sigmas of a pair to 1e-9, {turns} orbits", "<= 0.5 ms", seconds(took), took <= 5e-4)
                for turns, took in longest.items()
            ),
            Figure(
                f"{craft} spacecraft with uncertainty, {found} pairs below 3 sigma",
                "<= 2 s",
                seconds(took),
                took <= 2.0,
            ),
        ],
    )


def one_pair(name: str, zone: cf.Zone, pairs: int, repeats: int) -> tuple[float, float, float]:
    """Return the times [s] of a verdict just below the sigmas and of the sigmas, and the sigmas."""
    state, deviations, orbits = CASES[name]
    duration = orbits * PERIOD
    path, other = ORBIT.coast([state] * pairs, duration), ORBIT.coast(np.zeros(6), duration)
    errors = cf.Uncertainty(np.diag(deviations) ** 2)
    k = float(cf.clearance_in_sigmas(path[0], other, zone, errors).sigmas)
    one, two = propagate_errors(path, [errors] * pairs), propagate_errors(other, [None])
    first, second = np.arange(pairs), np.zeros(pairs, dtype=np.int64)

    def verdict() -> None:
        assert len(sigma_conflicts(one, two, first, second, zone, N, 0.9 * k)) == 0

    least, _ = timed(lambda: cf.clearance_in_sigmas(path, other, zone, errors), repeats)
    judged, _ = timed(verdict, repeats)
    return judged / pairs, least / pairs, k


def peers(quick: bool) -> Table:
    """Compare the results and times of grids and samples with the certified search."""
    samples, rows = 2000 if quick else 20_000, []
    for name in MOVING:
        state, deviations, orbits = CASES[name]
        told = ORBIT, np.array(state), np.array(deviations), orbits * PERIOD, 15.0
        pair = ORBIT.coast(state, orbits * PERIOD), ORBIT.coast(np.zeros(6), orbits * PERIOD)
        errors = cf.Uncertainty(np.diag(deviations) ** 2)
        methods = {
            lambda p=pair, e=errors: cf.clearance_in_sigmas(*p, ZONES["sphere"], e).sigmas: 1 if quick else 7,
            lambda t=told: on_grid(*t): 1,
            lambda t=told: drawn(*t, samples): 1,
        }
        certified, *others = found = [method() for method in methods]
        assert certified <= min(others) * (1 + 1e-9)
        times = [timed(method, repeats)[0] for method, repeats in methods.items()]
        cells = [(f"{k:.7g}", seconds(took)) for k, took in zip(found, times, strict=True)]
        rows.append([name, *(cell for both in cells for cell in both)])
    note = (
        "Sphere of 15 m. The grid solves the secular equation of the nearest point every 10 s, with "
        "NumPy for all times at once, and overestimates the sigmas. The samples column is the "
        f"smallest of {samples:,} sampled errors that leads to a conflict (inf: none). Neither method "
        "is certified."
    )
    columns = ["case", "certified", "time", "grid", "time", "samples", "time"]
    return Table("Sigmas at first contact: certified search, grid, samples", columns, rows, [note])


def fleet(quick: bool) -> tuple[int, float, int]:
    """Screen a thousand coasting spacecraft with hard bodies of 5 m and uncertainty, for two orbits."""
    craft = 60 if quick else 1000
    random = np.random.default_rng(1)
    states = random.normal(size=(craft, 6)) * [4e3, 13e3, 4e3, 4e3 * N, 0, 4e3 * N]
    states[:, 4] = -2 * N * states[:, 0]
    paths = ORBIT.coast(states, 2 * PERIOD)
    errors = cf.Uncertainty(np.diag([2.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2)
    body = cf.Body(cf.Sphere(5.0))
    took, found = timed(lambda: cf.screen(paths, body, errors=errors), 1 if quick else 5)
    return craft, took, len({tuple(pair) for pair in found.pairs.tolist()})
