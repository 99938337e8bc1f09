"""Loss of thrust at any instant, with horizons of two orbits and a day; V-BAR at 101 instants."""

from time import process_time
from typing import Any

import numpy as np

import closeform as cf
from cases import MEAN_MOTION, PERIOD, RADIUS
from peers import vbar_drift, vbar_peer
from tables import Figure, Report, Table, seconds, times
from timing import timed

INSTANTS = 101
PEERS = {
    f"V-BAR, minimum margin of {INSTANTS} instants": vbar_drift.least_margin,
    f"V-BAR, refined margin at each of {INSTANTS} instants": vbar_drift.refined_margins,
}


def transfers(count: int) -> list[cf.Path]:
    """Return transfers of half an orbit to two orbits, within some hundred metres of the other spacecraft."""
    rng = np.random.default_rng(5)
    orbit, scale = cf.Orbit(MEAN_MOTION), np.array([60, 250, 60, 0.05, 0.1, 0.05])
    found = []
    for _ in range(count):
        ends = rng.normal(size=(2, 6)) * scale
        ends[:, 4] = -2 * MEAN_MOTION * ends[:, 0] + rng.normal(size=2) * 2e-3
        found.append(orbit.transfer(*ends, rng.uniform(0.5, 2.0) * PERIOD))
    return found


def pairs(paths: list[cf.Path], drift: float, thrusting: bool) -> list[tuple[Any, ...]]:
    """Return each path with a coasting spacecraft or the next path, its zone and the end of the horizon."""
    orbit, found = cf.Orbit(MEAN_MOTION), []
    for path, other in zip(paths, paths[1:] + paths[:1], strict=True):
        until = path.end + drift
        if thrusting:
            until = max(path.end, other.end) + drift
            rest = orbit.coast(other.state(other.end), until - other.end, start=other.end)
        beside = cf.join([other, rest]) if thrusting else orbit.coast(np.zeros(6), until)
        found.append((path, beside, cf.Sphere(RADIUS), until))
    return found


def measure(quick: bool) -> Report:
    zone, orbit = cf.Sphere(RADIUS), cf.Orbit(MEAN_MOTION)
    paths, repeats = transfers(5 if quick else 60), 1 if quick else 5
    rows, figures, least, theirs, below = [], [], {}, {}, 0
    for name, orbits, thrusting in (
        ("2 orbits", 2.0, False),
        ("24 h", 86400.0 / PERIOD, False),
        ("2 orbits past a thrusting spacecraft", 2.0, True),
        ("24 h past a thrusting spacecraft", 86400.0 / PERIOD, True),
    ):
        asked = pairs(paths, orbits * PERIOD, thrusting)
        for what, search in (("verdict", cf.passively_safe), ("least ratio", cf.drift_approach)):
            found = [timed(lambda p=pair, s=search: s(*p), repeats, process_time)[0] for pair in asked]
            median, slowest = float(np.median(found)), float(np.max(found))
            rows.append([f"{what}, {name}", seconds(median), seconds(slowest), "-", "-"])
            least[what, name] = median, slowest
    if vbar_peer.available():
        for path in paths[: 2 if quick else 10]:
            until = path.end + 2.0 * PERIOD
            near = cf.drift_approach(path, orbit.coast(np.zeros(6), until), zone, until)
            drifts = (
                path.state(np.linspace(path.start, path.end, INSTANTS)),
                MEAN_MOTION,
                RADIUS,
                2.0 * PERIOD,
            )
            for name, method in PEERS.items():
                took, margin = timed(lambda m=method, d=drifts: np.min(m(*d)), repeats, process_time)
                theirs.setdefault(name, []).append(took)
                below += int(margin < (near.ratio - 1.0) * RADIUS - 1e-6)
        ours = least["least ratio", "2 orbits"][0]
        for name, found in theirs.items():
            ratio = float(np.median(found)) / ours
            rows.append([name, seconds(np.median(found)), seconds(max(found)), times(ratio), ""])
        rows[-1][-1] = str(below)
        figures.append(
            Figure(
                "passive safety: speed-up over V-BAR's refined margins",
                ">= 300x",
                times(ratio),
                bool(ratio >= 300),
            )
        )
        figures.append(Figure("V-BAR's margin below ours", "never", str(below), below == 0))
    for what, name, asked in (
        ("verdict", "2 orbits", 0.15e-3),
        ("verdict", "24 h", 0.4e-3),
        ("least ratio", "2 orbits", 1e-3),
        ("least ratio", "2 orbits past a thrusting spacecraft", 1e-3),
        ("least ratio", "24 h past a thrusting spacecraft", 1e-3),
    ):
        median, slowest = least[what, name]
        figures.append(
            Figure(f"drift, {what}, {name}", f"<= {seconds(asked)}", seconds(median), median <= asked)
        )
        if what == "verdict":
            figures.append(
                Figure(f"drift, slowest {what}, {name}", "<= 5 ms", seconds(slowest), slowest <= 5e-3)
            )
    columns = ["search", "median time", "maximum", "relative time", "lower margins"]
    note = (
        "CPU time. The horizon starts at the end of the path of the failing spacecraft, and every "
        "instant of failure counts. V-BAR searches two orbits of free drift from each of its "
        "instants. Its first line is its standard method, which refines only candidates of the "
        "minimum. Lower margins: cases in which V-BAR finds a lower margin."
    )
    title = f"Loss of thrust at any instant, {len(paths)} transfers, sphere of {RADIUS:g} m, one core"
    return Report([Table(title, columns, rows, [note])], figures)
