"""Gatherings of lost spacecraft, from five as in H03 to a thousand."""

from collections.abc import Callable
from math import inf, radians

import numpy as np

import closeform as cf
from cases import lost_craft
from peers.motion import Array
from tables import Figure, Report, Table, seconds
from timing import Timing, cores, side_by_side

SPEED = 0.12  # m/s: H03's greatest relative speed, which sizes its near-field search
BALL, APART, SHORT = "in a ball", "back to back", "back to back, range 200 m"
NOTE = (
    "Spacecraft of H03: 70 deg, 0.25 deg/s, sensors at 7.5 m, IPS of one turn, tips of 25 deg, "
    "near-field search for 12 cm/s, two rounds, with the density of five in 300 m. The search "
    "evaluates all three options of the first burn. Back to back: group A is the half towards +x "
    "and looks there first, B is the other half, so that no pair is locked at the start. Locks: "
    "those that join two sets."
)


def measure(quick: bool) -> Report:
    five, figure = fives(1_000 if quick else 20_000, quick)
    report = Report([five], [figure])
    rows = []
    for count, most in ((20, 50e-3), (50, 5.0)) if quick else ((100, 50e-3), (1000, 5.0)):
        timings, some = swarm(count, 1 if quick else 3)
        rows += some
        taken = max(timings[name].median for name in (BALL, APART))
        met = None if quick else taken <= most
        report.figures.append(
            Figure(f"gather, {count:,} spacecraft", f"<= {seconds(most)}", seconds(taken), met)
        )
    columns = [
        "spacecraft",
        "initial state",
        "time",
        "spread",
        "locks",
        "at 0 s",
        "median lock",
        "last lock",
        "gathered",
        "rounds",
    ]
    report.tables.append(Table("Gathering of many spacecraft (gather)", columns, rows, [NOTE]))
    return report


def basic(longest: float = inf) -> cf.Search:
    """Return the search of H03 as simulated there."""
    sensor = cf.Sensor(radians(70), offset=7.5, range=longest)
    return cf.Search.basic(sensor, radians(0.25), radians(25), in_plane_turn=radians(360))


def fives(cases: int, quick: bool) -> tuple[Table, Figure]:
    """Time five spacecraft in a batch: all cases, and the last tenth to gather."""
    positions, velocities = lost_craft(cases, 5, seed=2003)
    every = flown(positions, velocities)()
    late = np.flatnonzero(every.duration > np.quantile(every.duration, 0.9))
    slow = np.resize(late, cases)  # as many, so that both batches use the cores alike
    names = {"as sampled": np.arange(cases), "last tenth to gather": slow}
    timings = side_by_side(
        {name: flown(positions[which], velocities[which]) for name, which in names.items()}, 1 if quick else 5
    )
    phases = np.array([leg.phase for leg in every.search.legs])
    first = (phases == "IPS")[every.leg] & (every.rounds == 1) & (every.left == 0)
    rows = []
    for name, which in names.items():
        duration, timing = every.duration[which], timings[name]
        shares = (duration == 0).mean(), first[which].mean(), (every.left[which] > 0).mean()
        row = [name, seconds(timing.median / cases), f"±{timing.spread:.0%}", *(f"{p:.2%}" for p in shares)]
        rows.append([*row, f"{np.median(duration):.0f} s", f"{duration.max():.0f} s"])
    columns = [
        "five spacecraft",
        "time per case",
        "spread",
        "gathered at 0 s",
        "gathered in IPS",
        "incomplete",
        "median end",
        "last end",
    ]
    title = f"Five spacecraft, {cases:,} gatherings in a batch (gather_cases), {cores()} cores"
    each = timings["as sampled"].median / cases
    figure = Figure("gather_cases, five spacecraft", "<= 0.2 ms", seconds(each), each <= 0.2e-3)
    note = "The spacecraft and the search are those of the next table, in groups of three and two."
    return Table(title, columns, rows, [note]), figure


def flown(positions: Array, velocities: Array) -> Callable[[], cf.Gatherings]:
    return lambda: cf.gather_cases(basic(), positions, velocities, "balanced", max_speed=SPEED)


def swarm(count: int, repeats: int) -> tuple[dict[str, Timing], list[list[str]]]:
    """Time a gathering of many spacecraft from three initial states."""
    (positions,), (velocities,) = lost_craft(1, count, seed=100)
    ahead = np.argsort(np.argsort(-positions[:, 0])) < count // 2
    halves = ["A" if there else "B" for there in ahead]
    ways = {BALL: (basic(), "alternating"), APART: (basic(), halves), SHORT: (basic(200.0), halves)}
    gatherings: dict[str, cf.Gathering] = {}

    def gather(name: str) -> Callable[[], None]:
        def run() -> None:
            search, groups = ways[name]
            gatherings[name] = cf.gather(search, positions, velocities, groups, max_speed=SPEED)

        return run

    timings = side_by_side({name: gather(name) for name in ways}, repeats)
    rows = []
    for name, timing in timings.items():
        g = gatherings[name]
        locks = np.array([event.time for event in g.events if event.kind == "lock"])
        taken = [seconds(timing.median), f"±{timing.spread:.0%}"]
        when = [
            f"{len(locks):,}",
            f"{(locks == 0).sum():,}",
            f"{np.median(locks):.0f} s",
            f"{locks.max():.0f} s",
        ]
        formation = len(g.sets[0]) if g.sets else 0
        rows.append([f"{count:,}", name, *taken, *when, f"{formation:,} of {count:,}", f"{g.rounds}"])
    return timings, rows
