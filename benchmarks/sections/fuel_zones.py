"""Minimum delta-v around zones: one sphere against sequential convex programs, a swap, random formations."""

from time import perf_counter

import numpy as np

import closeform as cf
from formations import LOW_ORBIT, cases
from peers import impulse_zones
from peers.impulse_zones import Passage
from tables import Figure, Report, Table, seconds, times
from timing import say, side_by_side

DEARER = 5e-4  # maximum excess over the sequential programs
SIDES = 6  # as many as `avoid` looks at
LIMITS = (1.0, 3.0, 30.0)  # of the peak thrust of the path of minimum energy around the same sphere
NOTE = (
    "Limits are relative to the peak thrust of the minimum-energy path around the sphere. Plans "
    "consist of burns and coasts, certified clear. Medians are over the plans within the given "
    "time."
)


def measure(quick: bool) -> Report:
    report = Report()
    spheres(report, 3 if quick else 40)
    within_limits(report, 3 if quick else 40)
    swap(report, 2 if quick else 15)
    formations(report, 3 if quick else 200)
    return report


def passage(seed: int) -> Passage:
    """Return a transfer between two relative orbits, with a sphere near the direct path."""
    rng = np.random.default_rng(seed)
    n = LOW_ORBIT.mean_motion
    while True:
        x, y, z, vx, vz = rng.normal(size=(5, 2)) * 150.0 * np.array([[1], [1], [1], [n], [n]])
        a, b = np.stack([x, y, z, vx, -2.0 * n * x, vz]).T
        duration = LOW_ORBIT.period * rng.uniform(0.3, 1.5)
        when, radius = duration * rng.uniform(0.3, 0.7), rng.uniform(15.0, 60.0)
        beside = np.concatenate([0.3 * radius * rng.normal(size=3), 0.02 * rng.normal(size=3)])
        hit = LOW_ORBIT.impulsive(a, b, duration).state(when) + beside
        obstacle = LOW_ORBIT.coast(LOW_ORBIT.transition(-when) @ hit, duration)
        apart = [np.linalg.norm(obstacle.position(t) - s[:3]) for t, s in ((0.0, a), (duration, b))]
        if min(apart) > 1.1 * radius:
            return Passage(LOW_ORBIT, a, b, duration, obstacle, radius)


def avoided(one: Passage, cost: str) -> cf.Plan:
    make = one.orbit.impulsive if cost == "delta-v" else one.orbit.transfer
    path = make(one.initial, one.final, one.duration)
    return cf.avoid(path, one.obstacle, cf.Sphere(one.radius), cost=cost)


def one_side(one: Passage) -> tuple[float, float]:
    """Return the times [s] of closeform and of the programs from one start."""
    path, zone = one.orbit.impulsive(one.initial, one.final, one.duration), cf.Sphere(one.radius)
    marks = [perf_counter()]
    cf.avoid(path, one.obstacle, zone, cost="delta-v", budget=1)
    marks.append(perf_counter())
    impulse_zones.plan(one, 1)
    marks.append(perf_counter())
    return marks[1] - marks[0], marks[2] - marks[1]


def spheres(report: Report, count: int) -> None:
    """Solve passages of one sphere with both methods."""
    passages = [passage(seed) for seed in range(count)]
    avoided(passages[0], "delta-v")
    spent, theirs, above, extra, energy = [], [], [], [], []
    single = []
    for k, one in enumerate(passages):
        if k % 10 == 0:
            say(f"  passage {k} of {count}")
        runs = side_by_side({"ours": lambda one=one: avoided(one, "delta-v")}, 5)
        spent.append(runs["ours"].median)
        begin = perf_counter()
        cost = impulse_zones.plan(one, SIDES)
        theirs.append(perf_counter() - begin)
        single.append(one_side(one))
        found = avoided(one, "delta-v")
        above.append(found.delta_v / cost - 1)
        extra.append(found.gap)
        energy.append(avoided(one, "energy").delta_v / found.delta_v - 1)
    median, ratio = float(np.median(spent)), float(np.median(np.array(theirs) / spent))
    worst = float(np.nanmax(above))
    for figure in (
        Figure("avoid for delta-v: median time past one sphere", "<= 10 ms", seconds(median), median <= 0.01),
        Figure("avoid for delta-v: speed-up over sequential programs", ">= 40x", times(ratio), ratio >= 40),
        Figure(
            "avoid for delta-v: maximum above sequential programs",
            "<= 0.05 %",
            f"{100 * worst:.3f} %",
            worst <= DEARER,
        ),
    ):
        report.figures.append(figure)
    alone = np.median(single, axis=0)
    rows = [
        ["closeform, six starts, certified", seconds(median), f"{100 * np.median(extra):.2f} %"],
        [
            f"sequential programs at {impulse_zones.TIMES} or more times, six starts",
            seconds(float(np.median(theirs))),
            f"{100 * float(np.nanmedian(-np.array(above))):+.3f} % of closeform",
        ],
        ["closeform, one start", seconds(float(alone[0])), ""],
        ["sequential programs, one start", seconds(float(alone[1])), ""],
        ["minimum-energy plan", "", f"{100 * float(np.nanmedian(energy)):+.1f} % of closeform"],
    ]
    title = f"Delta-v around one sphere, {count} passages, above the minimum without zones"
    report.tables.append(Table(title, ["method", "median time", "delta-v"], rows))


def within_limits(report: Report, count: int) -> None:
    """Plan the same passages within thrust limits relative to the peak of the minimum-energy path."""
    rows, kept = [], 0
    passages = [passage(seed) for seed in range(count)]
    plans = [(avoided(one, "energy"), avoided(one, "delta-v")) for one in passages]
    for share in LIMITS:
        say(f"  within {share:g} of the peak of minimum energy")
        spent, above, below, extra, weak = [], [], [], [], 0
        for one, (smooth, kicks) in zip(passages, plans, strict=True):
            limit = share * float(smooth.path.peak_thrust)
            path = one.orbit.impulsive(one.initial, one.final, one.duration)
            begin = perf_counter()
            found = cf.avoid(
                path, one.obstacle, cf.Sphere(one.radius), cost="delta-v", max_acceleration=limit
            )
            spent.append(perf_counter() - begin)
            longer = not found.ok or found.path.end > one.duration * (1 + 1e-9)
            weak += longer
            kept += longer or found.path.peak_thrust <= limit * (1 + 1e-9)
            if not longer:
                above.append(found.delta_v / kicks.delta_v - 1)
                below.append(1 - found.delta_v / smooth.delta_v)
                extra.append(found.gap)
        told = [f"{100 * float(np.median(values)):.2f} %" for values in (above, below, extra)]
        time = f"{seconds(float(np.median(spent)))}, {seconds(max(spent))}"
        rows.append([f"{share:g} of the peak", f"{len(above)}, {weak}", time, *told])
    name = f"{len(LIMITS) * count} passages within thrust limits: limit kept"
    report.figures.append(Figure(name, f"{len(LIMITS) * count}", f"{kept}", kept == len(LIMITS) * count))
    title = f"Delta-v around one sphere within a thrust limit, {count} passages"
    columns = [
        "limit",
        "on time, longer",
        "time, median and maximum",
        "above impulses",
        "below minimum energy",
        "gap",
    ]
    report.tables.append(Table(title, columns, rows, [NOTE]))


def swap(report: Report, repeats: int) -> None:
    """Plan the swap of twelve spacecraft across a ring in a quarter of an orbit."""
    angles = 2 * np.pi * np.arange(12) / 12
    ring = np.zeros((12, 6))
    ring[:, 1], ring[:, 2] = 120 * np.cos(angles), 120 * np.sin(angles)
    task = LOW_ORBIT, ring, -ring, LOW_ORBIT.period / 4, cf.Sphere(15.0)
    plan, smooth = cf.reconfigure(*task, cost="delta-v"), cf.reconfigure(*task)
    taken = side_by_side({"swap": lambda: cf.reconfigure(*task, cost="delta-v")}, repeats)["swap"].median
    less = 1 - plan.delta_v / smooth.delta_v
    name = "swap of 12 for delta-v"
    report.figures.append(Figure(name, "<= 150 ms", seconds(taken), plan.ok and taken <= 0.15))
    name = "swap of 12 for delta-v: below minimum energy"
    report.figures.append(Figure(name, ">= 25 %", f"{100 * less:.1f} %", less >= 0.25))


def formations(report: Report, count: int) -> None:
    """Plan the random formations of the formation section."""
    spent, shares, fired, planned, taken = [], [], [], 0, 0
    for k, task in enumerate(cases()):
        if k == count:
            break
        if k % 20 == 0:
            say(f"  formation {k} of {count}")
        taken += 1
        begin = perf_counter()
        plan = cf.reconfigure(**task.arguments, cost="delta-v")
        spent.append(perf_counter() - begin)
        smooth = cf.reconfigure(**task.arguments)
        planned += plan.ok
        fired += [len(path.impulses) for path in plan.paths] if plan.ok else []
        if plan.ok and smooth.ok and not plan.measures and not smooth.measures:
            shares.append(plan.delta_v / smooth.delta_v)
    name = f"{count} random formations for delta-v, planned and certified"
    report.figures.append(Figure(name, f"{taken}", f"{planned}", planned == taken))
    low, middle, high = np.percentile(shares, [5, 50, 95])
    rows = [
        ["time, median and maximum", f"{seconds(float(np.median(spent)))}, {seconds(max(spent))}"],
        ["ratio to the minimum-energy delta-v, median", f"{middle:.3f}"],
        ["5 to 95 %", f"{low:.3f} to {high:.3f}"],
        ["impulses per spacecraft, median and mean", f"{np.median(fired):.0f}, {np.mean(fired):.1f}"],
    ]
    title = f"Minimum delta-v of {taken} random formations"
    report.tables.append(Table(title, ["all plans", "value"], rows))
