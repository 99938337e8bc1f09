"""First locks of lost pairs of S04 on all cores, against samples each second and the numbers of S04."""

from collections.abc import Callable
from math import degrees, inf, radians, sqrt

import numpy as np

import closeform as cf
from cases import lost_pairs
from peers import boresight_scan
from peers.motion import Array
from tables import Figure, Report, Table, seconds, times
from timing import cores, side_by_side

OURS = "closeform.lock_times"
TABLE, VECTOR = "1 s scan, table", "1 s scan, table, vectorised"
TURNING = "1 s scan, attitude per sample"
NUMPY, BLOCKS = "1 s scan, NumPy", "1 s scan, NumPy, blocks"
LEAST = {TABLE: 4, TURNING: 20, NUMPY: 50}
STEP = 1.0  # s
SEARCH = cf.Search.modified(cf.Sensor(radians(70)), radians(0.25), radians(25))  # S04 section V
NOTE = (
    "Late: mean delay after the time of closeform, for pairs not locked at the start. Missed: "
    "first locks between two samples; the method reports a later lock or none. Early: locks "
    "before that of closeform. NumPy runs on one core, all other methods on all cores."
)
SAMPLED = (1, 10, 20, 60)  # s: S04 does not say how it looked for locks
PHASES = {
    "at once": "33.37 %",
    "IPS 1": "97.33 %",
    "mOPS 1": "2.65 %",
    "IPS 2": "37",
    "mOPS 2": "0",
    "never": "0",
}


def measure(quick: bool) -> Report:
    comparison, figures = compared(*lost_pairs(20_000 if quick else 1_000_000, seed=6), quick)
    shares, more = published(15_000 if quick else 150_000)
    return Report([comparison, shares], figures + more)


def compared(positions: Array, velocities: Array, quick: bool) -> tuple[Table, list[Figure]]:
    """Compare all methods on the same pairs."""
    methods = ways(positions, velocities)
    found = {name: method() for name, method in methods.items()}  # and compile
    timings = side_by_side(methods, 1 if quick else 5)
    first, count, base = found.pop(OURS), len(positions), timings[OURS].median
    faults = {name: against(first, samples) for name, samples in found.items()}
    rows = []
    for name, timing in timings.items():
        row = [name, seconds(timing.median), seconds(timing.median / count), f"±{timing.spread:.0%}"]
        late, *counts = faults.get(name, (None,))
        cells = ["", "", ""] if late is None else [f"{late:.2f} s", *map(str, counts)]
        rows.append([*row, times(timing.median / base), *cells])
    columns = ["method", "time", "time per pair", "spread", "relative time", "late", "missed", "early"]
    title = f"First locks of {count:,} pairs as in S04 section V, modified search, {cores()} cores"
    lost, early = int(np.isnan(first).sum()), max(fault[2] for fault in faults.values())
    figures = [
        Figure(f"lock_times, {count:,} pairs", "<= 0.15 s", seconds(base), None if quick else base <= 0.15),
        Figure("lock_times, pairs missed", "0", f"{lost}", lost == 0),
        Figure("lock_times, later than a 1 s scan", "0", f"{early}", early == 0),
    ]
    for name, least in LEAST.items():
        ratio = timings[name].median / base
        figures.append(Figure(f"locks, against {name}", f">= {least}x", times(ratio), ratio >= least))
    return Table(title, columns, rows, [NOTE]), figures


def ways(positions: Array, velocities: Array) -> dict[str, Callable[[], Array]]:
    """Return the methods: lock times of closeform, first samples of all others."""
    looks, turns = boresight_scan.boresights(SEARCH, STEP), boresight_scan.turns(SEARCH)
    work, threads = (positions, velocities, SEARCH.sensor.cosine, STEP), cores()
    return {
        OURS: lambda: cf.lock_times(SEARCH, positions, velocities).time,
        TABLE: lambda: boresight_scan.scan("table", looks, *work, threads),
        VECTOR: lambda: boresight_scan.scan("vector", looks, *work, threads),
        TURNING: lambda: boresight_scan.scan("turning", turns, *work, threads),
        NUMPY: lambda: boresight_scan.scan_numpy(looks, *work, blocks=False),
        BLOCKS: lambda: boresight_scan.scan_numpy(looks, *work, blocks=True),
    }


def against(first: Array, samples: boresight_scan.Samples) -> tuple[float, int, int]:
    """Return the mean delay of samples [s], the number of missed and of early first locks."""
    later = np.where(samples >= 0, STEP * samples, inf) - np.where(np.isnan(first), inf, first)
    later[(samples < 0) & np.isnan(first)] = 0.0
    found = (later <= STEP) & (first > 0.0)
    return float(later[found].mean()), int((later > STEP).sum()), int((later < 0.0).sum())


def published(count: int) -> tuple[Table, list[Figure]]:
    """Compare with the lock shares and the exact numbers of S04."""
    positions, velocities = lost_pairs(count, seed=2004)
    exact = by_phase(cf.lock_times(SEARCH, positions, velocities).time)
    sampled = []
    for step in SAMPLED:
        looks = boresight_scan.boresights(SEARCH, step)
        samples = boresight_scan.scan(
            "vector", looks, positions, velocities, SEARCH.sensor.cosine, step, cores()
        )
        sampled.append(by_phase(np.where(samples >= 0, step * samples, np.nan)))
    rows = []
    for phase, theirs in PHASES.items():
        p = exact[phase] / count
        cells = [f"{p:.3%}", f"{sqrt(p * (1 - p) / count):.3%}", f"{exact[phase]:,}"]
        rows.append([phase, theirs, *cells, *(f"{numbers[phase]:,}" for numbers in sampled)])
    scans = [f"{step} s scan" for step in SAMPLED]
    columns = ["first lock", "S04, 150,000", "exact", "standard error", "pairs", *scans]
    note = (
        "IPS 1 includes the pairs locked at once. The count of S04 in IPS 2 agrees with samples every "
        "10 to 30 s, which miss short first locks."
    )
    table = Table(f"First locks of {count:,} pairs sampled as in S04 section V", columns, rows, [note])
    shares = [agreed(phase, exact[phase], count) for phase in ("IPS 1", "mOPS 1")]
    return table, [*shares, *closed_numbers()]


def by_phase(when: Array) -> dict[str, int]:
    """Return the number of pairs that lock in each phase."""
    starts = np.array([start for _, _, start, _ in SEARCH.phases])
    phase = np.searchsorted(starts[1:], when[np.isfinite(when)])  # an end belongs to its phase
    found = np.bincount(phase, minlength=len(starts))
    names = [f"{phase} {number}" for phase, number, _, _ in SEARCH.phases]
    counts = {"at once": int((when == 0.0).sum()), "never": int(np.isnan(when).sum())}
    return counts | dict(zip(names, map(int, found), strict=True))


def agreed(phase: str, number: int, count: int) -> Figure:
    """Compare two samples of the same share, within 2 standard errors of their difference."""
    p = float(PHASES[phase].split()[0]) / 100
    most = 2 * sqrt(p * (1 - p) * (1 / count + 1 / 150_000))
    asked = f"{PHASES[phase]} ± {100 * most:.2g} %"
    return Figure(
        f"S04: locks in {phase}", asked, f"{100 * number / count:.2f} %", abs(number / count - p) <= most
    )


def closed_numbers() -> list[Figure]:
    """Compare schedule, sky coverage and counterexample of S04, to all published digits."""
    counterexample = cf.lock_times(SEARCH, [2.08, 25.2, -305.6], [0.0, 0.0, 0.0831])
    numbers = {
        "S04: duration of the search": ("8566.0 s", f"{SEARCH.duration:.1f} s"),
        "S04: tip": ("21.344 deg", f"{degrees(SEARCH.tip_angle):.3f} deg"),
        "S04: sky coverage of IPS": ("93.97 %", f"{100 * SEARCH.coverage('IPS'):.2f} %"),
        "S04: lock time of the counterexample": ("6692.29 s", f"{counterexample.time[0]:.2f} s"),
    }
    return [Figure(name, asked, found, asked == found) for name, (asked, found) in numbers.items()]
