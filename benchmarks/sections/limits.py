"""Thrust limits: minimum energy and minimum delta-v in the given time, and minimum time."""

from statistics import median
from time import perf_counter

import numpy as np

import closeform as cf
from peers.motion import Array
from tables import Figure, Report, Table, seconds
from timing import say

ORBIT = cf.Orbit.circular(500e3)


def measure(quick: bool) -> Report:
    count = 200 if quick else 10_000
    begins, ends, durations = transfers(1, count)
    free = ORBIT.transfer(begins, ends, durations)
    peaks = np.asarray(free.peak_thrust)
    ORBIT.transfer(begins[0], ends[0], durations[0], max_acceleration=peaks[0], cost="delta-v")  # compiles
    taken, refused, dearer = energy(begins, ends, durations, free, peaks)
    decided = len(taken) + len(refused)
    rows = [
        ["minimum energy, 0.45 to 1 of the unlimited peak", f"{len(taken)}", *spread(taken), dearer],
        ["refused", f"{len(refused)}", *spread(refused), "proven infeasible, minimum limit to 1e-6"],
    ]
    some = slice(0, 30 if quick else 500)
    bounds = np.asarray(ORBIT.impulsive(begins[some], ends[some], durations[some]).delta_v)
    slowest = []
    for factor in (1.0, 3.0, 30.0, 3000.0):
        say(f"  delta-v, {factor:g} of the unlimited peak")
        times, spent = burns(begins[some], ends[some], durations[some], factor * peaks[some])
        slowest.append(median(times))
        saved = 1 - spent / np.asarray(free.delta_v)[some]
        above = 100 * np.median(spent / bounds - 1)
        told = f"{above:.2f} % above impulses, {100 * np.median(saved):.1f} % below minimum energy"
        rows.append(
            [f"minimum delta-v, {factor:g} of the unlimited peak", f"{len(times)}", *spread(times), told]
        )
    soon, longer = durations_of(begins, ends, peaks, 10 if quick else 100)
    quantiles = np.percentile(longer, [50, 95])
    told = f"`shortest_transfer` takes {quantiles[0]:.1f} % longer, 95th percentile {quantiles[1]:.0f} %"
    rows.append(["minimum time", f"{len(soon)}", *spread(soon), told])
    note = (
        "500 km, closed relative orbits of some hundred metres, 0.1 to 3 orbits; limits are relative "
        "to the peak of the energy-optimal path. Every path keeps its limit to 1e-9 and costs at most "
        "1e-6 more than its lower bound. Every refusal is proven."
    )
    columns = ["within a thrust limit, one core", "transfers", "median time", "99th percentile", "result"]
    return Report(
        [Table("Thrust limits in the given time", columns, rows, [note])],
        [
            Figure("thrust limits: solved or proven infeasible", f"{count}", f"{decided}", decided == count),
            Figure("limited energy, median", "<= 200 µs", seconds(median(taken)), median(taken) <= 2e-4),
            Figure(
                "burns and coasts, slowest median", "<= 5 ms", seconds(max(slowest)), max(slowest) <= 5e-3
            ),
            Figure("minimum time, median", "<= 10 ms", seconds(median(soon)), median(soon) <= 1e-2),
        ],
    )


def transfers(seed: int, count: int) -> tuple[Array, Array, Array]:
    """Return states without drift, and durations of 0.1 to 3 orbits."""
    draws = np.random.default_rng(seed)
    n = ORBIT.mean_motion
    states = draws.normal(size=(2, count, 6)) * 200.0 * np.array([1.0, 2.0, 1.0, n, 2 * n, n])
    states[..., 4] = -2 * n * states[..., 0]
    return states[0], states[1], ORBIT.period * draws.uniform(0.1, 3.0, count)


def spread(taken: list[float]) -> list[str]:
    return [seconds(median(taken)), seconds(float(np.percentile(taken, 99)))]


def energy(
    begins: Array, ends: Array, durations: Array, free: cf.Path, peaks: Array
) -> tuple[list[float], list[float], str]:
    """Return the times of solved and of refused cases, and the cost of the limit."""
    limits = peaks * np.random.default_rng(2).uniform(0.45, 1.0, len(peaks))
    taken, refused, costs = [], [], []
    for k, limit in enumerate(limits):
        if k % 2000 == 0:
            say(f"  energy {k} of {len(limits)}")
        begin = perf_counter()
        try:
            path = ORBIT.transfer(begins[k], ends[k], durations[k], max_acceleration=limit)
            taken.append(perf_counter() - begin)
            costs.append(path.energy / free.energy[k] - 1)
        except ValueError as error:
            if "no thrust within" in str(error):
                refused.append(perf_counter() - begin)
    return taken, refused, f"energy {100 * median(costs):.1f} % above the unlimited path"


def burns(begins: Array, ends: Array, durations: Array, limits: Array) -> tuple[list[float], Array]:
    """Return the time and the delta-v of each case."""
    taken, spent = [], []
    for task in zip(begins, ends, durations, limits, strict=True):
        begin = perf_counter()
        path = ORBIT.transfer(*task[:3], max_acceleration=task[3], cost="delta-v")
        taken.append(perf_counter() - begin)
        spent.append(path.delta_v)
    return taken, np.array(spent)


def durations_of(begins: Array, ends: Array, peaks: Array, count: int) -> tuple[list[float], Array]:
    """Return each time, and the extra duration of the shortest energy-optimal path in percent."""
    cf.least_time(ORBIT, begins[0], ends[0], peaks[0])  # compiles
    taken, longer = [], []
    for k in range(count):
        begin = perf_counter()
        path = cf.least_time(ORBIT, begins[k], ends[k], peaks[k])
        taken.append(perf_counter() - begin)
        steady = cf.shortest_transfer(ORBIT, begins[k], ends[k], peaks[k])
        longer.append(100 * (steady.end / path.end - 1))
    return taken, np.array(longer)
