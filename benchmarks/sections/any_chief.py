"""Path past one obstacle about eccentric and J2-perturbed chiefs, beside plans in Hill's equations."""

from statistics import median
from time import perf_counter

import numpy as np

import closeform as cf
from cases import ZONE, cluster
from tables import Figure, Report, Table, seconds, times


def measure(quick: bool) -> Report:
    """Return times and optimality gaps of plans about any chief, beside those in Hill's equations."""
    count, repeats = (2, 3) if quick else (24, 20)
    orbits = {
        "circular, Hill": cf.Orbit.circular(500e3),
        **{f"eccentric, e = {e:g}": cf.Orbit.eccentric(e, perigee_altitude=500e3) for e in (0.1, 0.3, 0.6)},
        "J2, e = 0.01": cf.Orbit.perturbed(0.01, np.radians(97.4), perigee_altitude=500e3, span=20_000.0),
    }
    zone, runs, gaps = cf.Ellipsoid(ZONE), {name: [] for name in orbits}, {name: [] for name in orbits}
    for k in range(-1, count):  # the first one compiles and warms up
        for name, orbit in orbits.items():  # interleaved, on the same tasks
            rng = np.random.default_rng(abs(k))
            duration, start = rng.uniform(0.4, 1.0) * orbit.period, rng.uniform(0.0, 1.0) * orbit.period
            path = orbit.transfer(*cluster(2, 200.0, abs(k)), duration, start)
            middle_time = start + rng.uniform(0.25, 0.75) * duration
            met = path.state(middle_time) + np.append(0.3 * ZONE * rng.uniform(-1, 1, 3), [0.02, 0.0, 0.05])
            flow = orbit.transition(start - middle_time, middle_time)
            obstacle, each = orbit.coast(flow @ met, duration, start), []
            for _ in range(repeats):
                begin = perf_counter()
                plan = cf.avoid(path, obstacle, zone)
                each.append(perf_counter() - begin)
            if k >= 0 and plan.status.name == "AVOIDED":
                runs[name].append(median(each))
                gaps[name].append(100.0 * plan.gap)
    times_of = {name: float(np.median(own)) for name, own in runs.items()}
    hill = times_of["circular, Hill"]
    rows = [
        [name, len(runs[name]), seconds(time), times(time / hill), f"{np.nanmedian(gaps[name]):.3f} %"]
        for name, time in times_of.items()
    ]
    title = "Path past one obstacle about any chief, ellipsoid 20 x 40 x 20 m, one core"
    columns = ["chief", "avoided", "median time", "relative time", "proven gap, median"]
    most = max(times_of.values()) / hill
    table = Table(title, columns, rows, ["The gap is that of the first bound, without `prove`."])
    figure = Figure("avoid about any chief, against Hill", "<= 2x", times(most), most <= 2.0)
    return Report([table], [figure], {})
