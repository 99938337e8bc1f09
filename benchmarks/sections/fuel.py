"""Minimum delta-v: impulses of many random transfers, single and in one call, against cone programs."""

from collections.abc import Callable
from time import perf_counter

import numpy as np

import closeform as cf
from cases import MEAN_MOTION
from peers import impulse_cone
from peers.motion import Array
from tables import Figure, Report, Table, seconds, times
from timing import side_by_side

CURTIS = np.array([20e3, 20e3, 20e3, -20.0, 20.0, -5.0])  # Orbital Mechanics, chapter 7: to rest in 8 h
TIMES = 121  # of the cone programs


def relative(rng: np.random.Generator, size: float, drift: float = 0.0) -> Array:
    """Return a state on a relative orbit, from Palmer coordinates."""
    n, (wide, high), (a, b) = MEAN_MOTION, rng.uniform(0, size, 2), rng.uniform(0, 2 * np.pi, 2)
    e1, e2, h1, h2 = wide * np.cos(a), wide * np.sin(a), high * np.cos(b), high * np.sin(b)
    d, along = drift * rng.uniform(-1, 1), rng.uniform(-2.5, 2.5) * size
    return np.array([2 * d - e1, along + 2 * e2, h1, n * e2, n * (2 * e1 - 3 * d), n * h2])


def transfers(seed: int, count: int) -> tuple[Array, Array, Array]:
    """Return transfers with nT from 1e-4 to 60 and 0.1 m to 10 km.

    They are free, planar, cross-track only, to rest, closed and drifting in turn.
    """
    rng = np.random.default_rng(seed)
    ends = np.empty((2, count, 6))
    durations = 10 ** rng.uniform(-4, np.log10(60), count) / MEAN_MOTION
    for k in range(count):
        size, kind = 10 ** rng.uniform(-1, 4), k % 6
        for states in ends:
            if kind < 4:
                states[k] = rng.normal(size=6) * size * np.array([1, 1, 1, *[MEAN_MOTION] * 3])
            else:
                states[k] = relative(rng, size, 0.15 * size * (kind == 5))
        if kind in (1, 2):
            ends[:, k, [2, 5] if kind == 1 else [0, 1, 3, 4]] = 0.0
        if kind == 3:
            ends[1, k] = 0.0
    return ends[0], ends[1], durations


def measure(quick: bool) -> Report:
    orbit, report = cf.Orbit(MEAN_MOTION), Report()
    orbit.impulsive(CURTIS, np.zeros(6), 28800.0)
    alone(report, orbit, 200 if quick else 10_000)
    curtis(report)
    cones(report, orbit, 3 if quick else 60)
    slots(report, orbit, 1 if quick else 9)
    pulses(report, 20 if quick else 10_000)
    return report


def alone(report: Report, orbit: cf.Orbit, count: int) -> None:
    """Time single calls and one call for all transfers."""
    initials, finals, durations = transfers(1, count)
    bound = cf.least_delta_v(orbit, initials, finals, durations)
    gap = float(bound.gap.max())
    name = f"impulses, {count:,} random transfers: maximum certified gap"
    report.figures.append(Figure(name, "<= 1e-9", f"{gap:.1e}", gap <= 1e-9))
    ends = zip(initials, finals, durations, strict=True)
    spent = each([lambda one=one: orbit.impulsive(*one) for one in ends])
    median, high = np.percentile(spent, [50, 99])
    batch = side_by_side({"batch": lambda: orbit.impulsive(initials, finals, durations)}, 5)["batch"].median
    figures = [
        ("impulses, one transfer, median", 100e-6, float(median)),
        ("impulses, one transfer, 99th percentile", 1e-3, float(high)),
        ("impulses, 10,000 transfers in one call", 0.6, batch * 10_000 / count),
    ]
    for label, asked, measured in figures:
        report.figures.append(Figure(label, f"<= {seconds(asked)}", seconds(measured), measured <= asked))
    rows = [
        ["transfers", f"{count:,}"],
        ["several optimal solutions", f"{100 * (1 - bound.unique.mean()):.1f} %"],
    ]
    title = "Impulses of minimum delta-v, nT from 1e-4 to 60, 0.1 m to 10 km"
    report.tables.append(Table(title, ["random transfers", "value"], rows))


def curtis(report: Report) -> None:
    """Compare with the published transfer."""
    orbit = cf.Orbit(1.15697e-3)
    for name, plan, published, within in (
        ("two impulses", orbit.two_impulse, 109.66945, 1e-5),
        ("minimum delta-v", orbit.impulsive, 78.53298, 1e-5),
    ):
        found = plan(CURTIS, np.zeros(6), 28800.0).delta_v
        figure = Figure(
            f"Curtis, 8 h, {name}", f"{published} m/s", f"{found:.5f} m/s", abs(found - published) <= within
        )
        report.figures.append(figure)


def cones(report: Report, orbit: cf.Orbit, count: int) -> None:
    """Compare with cone programs at 121 equal times."""
    initials, finals, durations = transfers(2, 40 * count)
    turns = MEAN_MOTION * durations
    some = np.flatnonzero((turns > 0.3) & (turns < 25.0))[:count]
    ends = [(initials[k], finals[k], float(durations[k])) for k in some]
    programs = [impulse_cone.build(MEAN_MOTION, *one, TIMES) for one in ends]
    names = "closeform", f"Clarabel, {TIMES} times"
    calls = [lambda one=one: orbit.impulsive(*one) for one in ends], [program.solve for program in programs]
    runs = np.array([[each(some_calls) for some_calls in calls] for _ in range(5)])
    ours, theirs = np.median(runs, axis=0)
    costs = np.array([[orbit.impulsive(*one).delta_v for one in ends], [one.solve() for one in programs]])
    above = costs[0] / costs[1] - 1
    ratio, worst = float(np.median(theirs / ours)), float(above.max())
    name = f"impulses: speed-up over a cone program at {TIMES} times"
    report.figures.append(Figure(name, ">= 40x", times(ratio), ratio >= 40))
    name = "impulses: maximum delta-v above the cone program"
    report.figures.append(Figure(name, "<= 1e-8", f"{worst:.1e}", worst <= 1e-8))
    words = "all times, certified", f"{-100 * above.mean():.2g} % higher"
    spent = [seconds(float(np.median(one))) for one in (ours, theirs)]
    rows = [list(row) for row in zip(names, spent, words, strict=True)]
    title = f"{len(some)} transfers of nT from 0.3 to 25, matrices of the programs prepared"
    report.tables.append(Table(title, ["method", "median time", "delta-v"], rows))


def each(calls: list[Callable[[], object]]) -> Array:
    """Return the time of each call [s]."""
    marks = [perf_counter()]
    for call in calls:
        call()
        marks.append(perf_counter())
    return np.diff(marks)


def slots(report: Report, orbit: cf.Orbit, repeats: int) -> None:
    """Time the cost matrix of 50 spacecraft and 50 slots."""
    rng = np.random.default_rng(3)
    a, b = (np.array([relative(rng, 200.0) for _ in range(50)]) for _ in range(2))
    matrix = side_by_side({"slots": lambda: cf.least_delta_v(orbit, a[:, None], b, 6000.0)}, repeats)[
        "slots"
    ].median
    report.figures.append(
        Figure("50 x 50 slots by minimum delta-v", "<= 150 ms", seconds(matrix), matrix <= 0.15)
    )


def pulses(report: Report, count: int) -> None:
    """Compare the deviation of pulsed plans with its bound."""
    from fire_plans import compared

    ratios, _ = compared(range(count))
    broken, middle = int((~(ratios >= 1.0)).sum()), float(np.median(ratios))
    name = f"{count:,} pulsed plans: violations of the deviation bound"
    report.figures.append(Figure(name, "0", f"{broken}", broken == 0))
    name = "pulsed plans: bound over deviation, median"
    report.figures.append(Figure(name, "<= 5", f"{middle:.2f}", middle <= 5))
