"""Passively safe plans and plans at k sigmas: success rate and cost."""

from functools import partial
from time import process_time

import numpy as np

import closeform as cf
from cases import MEAN_MOTION, PERIOD
from ring_formations import ring_formations
from ring_transfers import ring_transfers
from tables import Figure, Report, Table, seconds
from timing import say

ORBIT = cf.Orbit(MEAN_MOTION)
SIGMAS, PASSAGES = 3.0, 60
ZONE, KNOWN = cf.Sphere(15.0), cf.Uncertainty(np.diag([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2)


def measure(quick: bool) -> Report:
    rows, figures = [], []
    for group, least in (("thirty", 29), ("hundred", 97)):
        cases = ring_transfers(group)[: 2 if quick else None]
        for cost in ("energy", "delta-v"):
            say(f"  {group}, {cost}")
            row, extra, took = timed_each([partial(around, case, cost) for case in cases])
            rows.append([f"ring transfers, {group}, {cost}", *row])
            if cost == "energy":
                name, many = f"ring transfers planned, {group}", quick or len(extra) >= least
                figures.append(Figure(name, f">= {least}", row[0], many))
                good = np.median(extra) <= 0.05 and np.median(took) <= 0.1
                name = f"their extra energy and time in the median, {group}"
                figures.append(Figure(name, "<= 5 %, 0.1 s", f"{row[1]}, {row[3]}", bool(good)))
    for count in (4, 8, 12)[: 1 if quick else 3]:
        say(f"  {count} spacecraft")
        cases = ring_formations(count)[: 1 if quick else None]
        row, _, took = timed_each([partial(formation, case) for case in cases])
        rows.append([f"rings of {count} spacecraft by pairs", *row])
    if not quick:
        name = "12 spacecraft passively safe, the slowest"
        figures.append(Figure(name, "<= 20 s", seconds(max(took)), max(took) <= 20.0))
    pairs = passages(3 if quick else PASSAGES)
    for cost in ("energy", "delta-v"):
        say(f"  {SIGMAS:g} sigma, {cost}")
        kept = {"errors": KNOWN, "sigmas": SIGMAS, "cost": cost}
        row, _, _ = timed_each([partial(cf.avoid, *pair, ZONE, **kept) for pair in pairs])
        rows.append([f"passages at {SIGMAS:g} sigma, {cost}", *row])
    columns = ["task", "planned", "above the bound, median", "maximum", "median time", "maximum"]
    note = (
        "CPU time of one plan, certified plans only. The bound of delta-v is the cost without zones. "
        "tests/ring_transfers.py and tests/ring_formations.py define the cases."
    )
    return Report([Table("Passively safe plans, and plans at 3 sigma", columns, rows, [note])], figures)


def timed_each(tasks) -> tuple[list[str], list[float], list[float]]:
    """Return the cells of a row, extra costs and times [s] of plans, after a warm-up."""
    tasks[0]()
    plans, took = [], []
    for task in tasks:
        begin = process_time()
        plans.append(task())
        took.append(process_time() - begin)
    extra = [plan.spent / plan.lower_bound - 1.0 for plan in plans if plan.ok]
    median, most = (f"{np.median(extra):+.1%}", f"{max(extra):+.1%}") if extra else ("-", "-")
    times = seconds(float(np.median(took))), seconds(max(took))
    return [f"{len(extra)} of {len(plans)}", median, most, *times], extra, took


def around(case, cost: str) -> cf.Plan:
    """Plan a path of one spacecraft around its client."""
    return cf.avoid(case.path, case.client, case.zone, drift=case.drift, cost=cost)


def formation(case) -> cf.Plan:
    """Plan a formation in which any one spacecraft may fail."""
    task = case.orbit, case.initial, case.final, case.duration, case.zone
    return cf.reconfigure(*task, drift=case.drift, if_blocked=())


def passages(number: int) -> list[tuple[cf.Path, cf.Path]]:
    """Return paths that pass a client below 3 sigma, with ends above."""
    rng, found = np.random.default_rng(7), []
    while len(found) < number:
        ends = rng.normal(size=(2, 6)) * [40, 80, 40, 0.02, 0.02, 0.02]
        path = ORBIT.transfer(*ends, rng.uniform(0.3, 0.8) * PERIOD)
        client = ORBIT.coast(np.zeros(6), path.end)
        there = cf.Uncertainty(KNOWN.covariance(path, path.end))
        asked = [
            (path, KNOWN),
            *((ORBIT.coast(path.state(t), 1e-3), one) for t, one in ((0.0, KNOWN), (path.end, there))),
        ]
        clear, *ends_clear = (cf.clearance_in_sigmas(one, client, ZONE, known).sigmas for one, known in asked)
        if clear < SIGMAS and min(ends_clear) > 1.2 * SIGMAS:
            found.append((path, client))
    return found
