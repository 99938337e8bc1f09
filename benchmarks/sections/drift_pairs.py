"""Loss of thrust at any instant, all pairs of a hundred manoeuvring spacecraft."""

import closeform as cf
from cases import MEAN_MOTION, PERIOD, RADIUS, cluster
from tables import Figure, Report, Table, seconds
from timing import say, timed

CRAFT, SIZE = 100, 500.0  # within so many metres of each other, before and after
DRIFTS = {"2 orbits": 2 * PERIOD, "24 h": 86400.0}  # after the transfers


def measure(quick: bool) -> Report:
    craft = 12 if quick else CRAFT
    orbit, zone = cf.Orbit(MEAN_MOTION), cf.Sphere(RADIUS)
    fleet = orbit.transfer(cluster(craft, SIZE, 11), cluster(craft, SIZE, 12), PERIOD)
    rows, figures = [], []
    for name, drift in DRIFTS.items():
        for failing, searches, repeats in (
            ("either", craft * (craft - 1), 5),
            ("both", craft * (craft - 1) // 2, 1),
        ):
            say(f"  {failing}, {name}")
            took, found = timed(
                lambda d=drift, f=failing: cf.drift_screen(fleet, zone, PERIOD + d, failing=f),
                1 if quick else repeats,
            )
            cells = [f"{searches:,}", f"{len(found):,}", seconds(took), seconds(took / searches)]
            rows.append([f"{failing}, {name} of drift", *cells])
            if failing == "either":
                label = f"drift, all pairs of {craft} manoeuvring spacecraft, {name}"
                figures.append(Figure(label, "<= 1 s", seconds(took), took <= 1.0))
    columns = ["failing spacecraft and horizon", "searches", "unsafe", "time", "time per search"]
    note = (
        f"Transfers of one orbit between relative orbits in a cluster of {SIZE:g} m. Either: for both "
        "spacecraft of each pair, one fails while the other continues. Both: each fails at its own "
        "instant."
    )
    title = (
        f"Loss of thrust at any instant, all pairs of {craft} spacecraft, sphere of {RADIUS:g} m, all cores"
    )
    return Report([Table(title, columns, rows, [note])], figures)
