"""Whole formations: joint and sequential plans of closeform, and joint convex programs."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

import closeform as cf
from closeform.zones.shapes import CUBE
from formations import LOW_ORBIT, Task, cases, conflicting_cases, reconfiguration, swap
from peers import convex, joint_convex
from peers.motion import Array
from tables import Figure, Report, Table, seconds, times
from timing import say

SAME_TIMES = ("more sides",)  # the only fallback that keeps the task: others change its times
NODES = (60, 240)
AGAIN = 0.3  # s; total time of the repeats of a plan


@dataclass
class Outcome:
    """Result of one method on one task; energy is nan without a plan."""

    time: float
    energy: float = np.nan
    ratio: float = np.nan  # least norm of any pair, by the march
    plan: Any = None

    @property
    def clear(self) -> bool:
        return bool(self.ratio > 1.0)


@dataclass
class Row:
    """Results on one task."""

    task: Task
    bound: float
    conflicts: int  # pairs whose unconstrained paths meet
    joint: Outcome
    sequential: Outcome
    convex: joint_convex.Formed | None = None
    convex_ratio: float = np.nan  # by the march
    restarted: joint_convex.Formed | None = None  # from closeform's plan


def measure(quick: bool) -> Report:
    for method in ("joint", "sequential"):
        planned(reconfiguration(8, 1, spacing=3.0), method, 1)  # compile
    rows = [row(task, programs, quick) for task, programs in tasks(quick)]
    every = cases()[: 10 if quick else None]
    outcomes = [tried(task) for task in said("random case", every)]
    ending = conflicting_cases()[: 5 if quick else None]
    refused = [cf.reconfigure(**task.arguments) for task in said("conflicting case", ending)]
    rightly = sum(names_pair(plan, task) for plan, task in zip(refused, ending, strict=True))
    tables = [
        formations(rows),
        nodes_table(rows[0], NODES[:1] if quick else NODES),
        random_table(every, outcomes),
    ]
    found = figures(rows)
    count = sum(outcome.clear for outcome in outcomes)
    found.append(Figure("random cases planned", "all", f"{count} of {len(every)}", count == len(every)))
    found.append(
        Figure(
            "conflicts at the ends refused, pair named",
            "all",
            f"{rightly} of {len(ending)}",
            rightly == len(ending),
        )
    )
    return Report(tables, found)


def tasks(quick: bool) -> list[tuple[Task, bool]]:
    """Return the tasks of the table, and whether the convex programs solve them."""
    if quick:
        return [(swap(4, orbit=LOW_ORBIT), True), (reconfiguration(8, 1, spacing=3.0), True)]
    some = [swap(orbit=LOW_ORBIT), circle_swap(), swap()]
    some += [reconfiguration(count, 2, spacing=3.0) for count in (4, 8, 12, 20, 30)]
    some += [reconfiguration(count, 2, LOW_ORBIT, spacing=3.0) for count in (4, 8, 12, 20)]
    many = [reconfiguration(count, 1, orbit) for count in (50, 200) for orbit in (cf.Orbit(0.0), LOW_ORBIT)]
    many.append(reconfiguration(1000, 1, LOW_ORBIT))
    return [(task, True) for task in some] + [(task, False) for task in many]


def circle_swap() -> Task:
    """Return the swap of twelve spacecraft on a projected circle of 120 m within a twentieth of an orbit."""
    orbit, turn = LOW_ORBIT, 0.05
    initial = cf.targets.projected_circular(orbit, 12, 120.0)
    final = cf.targets.projected_circular(orbit, 12, 120.0, np.pi + 2 * np.pi * turn)
    name = "swap of 12 on a projected circle"
    return Task(name, orbit, initial, final, turn * orbit.period, cf.Sphere(15.0))


def said(name: str, tasks: list[Task]) -> Any:
    for k, task in enumerate(tasks):
        if k % 20 == 0:
            say(f"  {name} {k} of {len(tasks)}")
        yield task


def row(task: Task, programs: bool, quick: bool) -> Row:
    say(f"  {task.name}")
    direct = task.orbit.transfer(task.initial, task.final, task.duration)
    met = len(np.unique(cf.screen(direct, task.zone).pairs, axis=0))
    repeats = 1 if quick else 20 if task.count <= 200 else 3
    joint, sequential = (planned(task, method, repeats) for method in ("joint", "sequential"))
    made = Row(task, float(direct.energy.sum()), met, joint, sequential)
    if programs:
        made.convex = programmed(task, starts=4 if task.count <= 12 and not quick else 2)
        if made.convex:
            instants = np.linspace(0.0, task.duration, joint_convex.NODES + 1)
            made.convex_ratio = least_ratio(task, task.orbit.sampled(instants, made.convex.states))
        if joint.plan.ok:
            made.restarted = programmed(task, guess=nodes_of(task, joint, joint_convex.NODES))
    return made


def planned(task: Task, method: str, repeats: int) -> Outcome:
    """Plan with closeform in the given time; the time is the median of whole calls."""
    runs: list[float] = []
    while len(runs) < repeats and sum(runs) <= AGAIN:
        begin = perf_counter()
        plan = cf.reconfigure(**task.arguments, method=method, if_blocked=SAME_TIMES)
        runs.append(perf_counter() - begin)
    if not plan.ok:
        return Outcome(median(runs), plan=plan)
    return Outcome(median(runs), plan.energy, least_ratio(task, plan.paths), plan)


def tried(task: Task) -> Outcome:
    """Plan with closeform and all its fallbacks."""
    begin = perf_counter()
    plan = cf.reconfigure(**task.arguments)
    time = perf_counter() - begin
    if not plan.ok:
        say(f"  {task.name}: {plan.reason}")
        return Outcome(time, plan=plan)
    return Outcome(time, plan.energy, least_ratio(task, plan.paths), plan)


def least_ratio(task: Task, paths: cf.Path) -> float:
    """Return the minimum clearance ratio of all pairs, including obstacles, from the certified search."""
    count, least = task.count, np.inf
    if isinstance(task.zone, cf.Zone):
        first, second = np.triu_indices(count, 1)
        least = float(np.min(cf.closest_approach(paths[first], paths[second], task.zone).ratio))
        pairs = []
    else:
        pairs = [(i, j) for j in range(count) for i in range(j)]
    pairs += [(i, count + k) for k in range(len(task.obstacles)) for i in range(count)]
    for i, j in pairs:
        zone = task.zone_of(i, j)
        if zone:
            other = paths[j] if j < count else task.obstacles[j - count]
            least = min(least, float(cf.closest_approach(paths[i], other, zone).ratio))
    return least


def names_pair(plan: Any, task: Task) -> bool:
    """Return True if a plan is refused for the conflict in its task."""
    named = plan.blocked is not None and tuple(sorted(plan.blocked)) == task.pair
    return bool(plan.status == "end inside a zone" and named)


def programmed(task: Task, **how: Any) -> joint_convex.Formed | None:
    n, zone = task.orbit.mean_motion, task.zone
    return joint_convex.solve(
        task.initial, task.final, task.duration, n, zone.matrix, zone.shape == CUBE, **how
    )


def nodes_of(task: Task, outcome: Outcome, nodes: int) -> Array:
    """Return the states (N, nodes + 1, 6) of a plan at the nodes."""
    states: Array = outcome.plan.paths.state(np.linspace(0.0, task.duration, nodes + 1))
    return states


def above(energy: float, bound: float) -> str:
    """Return the excess of an energy over a bound in percent, as text."""
    return f"{100 * (energy / bound - 1):.3f}" if np.isfinite(energy) else "no plan"


def brief(task: Task) -> str:
    name = re.sub(", seed [0-9]+", "", task.name).replace("craft", "spacecraft")
    return re.sub(",? in (deep )?(?=space|orbit)", ", ", name)


def formations(rows: list[Row]) -> Table:
    out = []
    for made in rows:
        cells = [brief(made.task), f"{made.conflicts}"]
        for outcome in (made.joint, made.sequential):
            cells += [seconds(outcome.time), above(outcome.energy, made.bound)]
        found = made.convex
        if found:
            cells += [seconds(found.solver_time), times(found.solver_time / made.joint.time)]
            cells += [seconds(found.one_start), above(found.energy, made.bound)]
        out.append(cells + ["-"] * (10 - len(cells)))
    columns = [
        "task",
        "conflicts",
        "joint",
        "above bound",
        "sequential",
        "above bound",
        "convex",
        "relative time",
        "best start",
        "above bound",
    ]
    title = "Formations: joint and sequential plans and convex programs, one core"
    return Table(title, columns, out, notes([made for made in rows if made.convex]))


def notes(rows: list[Row]) -> list[str]:
    """Return the notes on the columns, and the settings of the convex programs."""
    solved = [made.convex for made in rows if made.convex]
    clear = sum(made.convex_ratio > 1.0 for made in rows)
    free = max(abs(found.free_energy / made.bound - 1) for made in rows if (found := made.convex))
    again = [found.energy / made.joint.energy - 1 for made in rows if (found := made.restarted)]
    low, high = (100 * extreme(again, default=np.nan) for extreme in (min, max))
    inflated = 100 * max(found.inflation - 1 for found in solved)
    alone = median(found.one_start / made.joint.time for made in rows if (found := made.convex))
    each = median(
        found.solver_time / found.starts * made.joint.plan.tried / made.joint.time
        for made in rows
        if (found := made.convex)
    )
    return [
        (
            "Conflicts: pairs whose unconstrained paths conflict. Above bound: control energy above the "
            "sum of the unconstrained optima, a lower bound, in percent. The time of closeform includes "
            "search and certificate; it is the median of its repeats. That of the convex programs is "
            "solver time, for 4 starts up to 12 spacecraft and otherwise 2, and for the best start alone. "
            f"In the median the best start takes {times(alone)} the time of closeform, and one start "
            f"{times(each)} the time of one candidate of closeform."
        ),
        (
            f"Convex programs: {joint_convex.NODES} nodes with linear thrust between them, Clarabel to "
            f"{convex.TOLERANCE:g}, supporting planes for close pairs only, updated until the energy "
            f"changes by less than {joint_convex.SETTLED:g}. Each zone is then inflated (by up to "
            f"{inflated:.1f} %) until its pair is clear between nodes. The certified search "
            f"of closeform finds {clear} of {len(solved)} clear. Without zones the "
            f"programs cost at most {free:.1e} more than the optimum; with constant thrust between nodes, "
            f"2.8e-4 in deep space. Started at the plans of closeform, they end "
            f"{low:+.4f} % to {high:+.4f} % from them."
        ),
    ]


def nodes_table(made: Row, counts: tuple[int, ...]) -> Table:
    """Return the convex programs started at the plan of closeform, by number of nodes."""
    out = []
    for nodes in counts if made.joint.plan.ok else ():
        say(f"  {nodes} nodes")
        found = programmed(made.task, nodes=nodes, guess=nodes_of(made.task, made.joint, nodes))
        if found is None:
            out.append([f"{nodes}", *["-"] * 5])
            continue
        cells = [f"{found.free_energy / made.bound - 1:.1e}", above(found.node_energy, made.bound)]
        cells += [f"{100 * (found.inflation - 1):.2f} %", above(found.energy, made.bound)]
        out.append([f"{nodes}", *cells, seconds(found.solver_time)])
    out.append(["closeform", "0", "-", "-", above(made.joint.energy, made.bound), seconds(made.joint.time)])
    columns = ["nodes", "without zones", "zones at nodes", "inflation", "certified clear", "solver time"]
    note = (
        "Without zones: relative excess over the exact optimum. Zones at nodes and certified clear: "
        "percent above the lower bound."
    )
    return Table(f"Convex programs started at closeform's plan, {made.task.name}", columns, out, [note])


def random_table(tasks: list[Task], outcomes: list[Outcome]) -> Table:
    kinds: dict[str, Callable[[Task], bool]] = {
        "all": lambda task: True,
        "deep space": lambda task: task.orbit.mean_motion == 0,
        "in orbit": lambda task: task.orbit.mean_motion > 0,
        "own time windows": lambda task: bool(np.ndim(task.start)),
        "coasting obstacles": lambda task: bool(task.obstacles),
        "boxes": lambda task: isinstance(task.zone, cf.Box),
        "own zones": lambda task: isinstance(task.zone, list),
    }
    out = []
    for name, belongs in kinds.items():
        own = [outcome for task, outcome in zip(tasks, outcomes, strict=True) if belongs(task)]
        clear = [outcome for outcome in own if outcome.clear]
        if not own:
            continue
        gaps = [100 * outcome.plan.gap for outcome in clear] or [np.nan]
        taken = [outcome.time for outcome in own]
        cells = [f"{len(clear)} of {len(own)}", f"{sum(bool(o.plan.measures) for o in clear)}"]
        cells += [seconds(median(taken)), seconds(max(taken)), f"{median(gaps):.2f} %", f"{max(gaps):.1f} %"]
        out.append([name, *cells])
    note = (
        "4 to 30 spacecraft in deep space and in orbits from 400 km to GEO (tests/formations.py). "
        "Planned: plans that the certified search finds clear. With fallback: plans that needed a "
        "fallback, which they name."
    )
    columns = ["random cases", "planned", "with fallback", "median time", "maximum", "median gap", "maximum"]
    return Table("Random reconfigurations, one core", columns, out, [note])


def swap_figures(made: Row) -> list[Figure]:
    """Return time, energy and clear pairs of one swap."""
    name, taken, over = made.task.name, made.joint.time, made.joint.energy / made.bound
    # in deep space all 66 pairs of the twelve conflict at one point, so its limits are wider
    most, dearest = (0.08, 1.07) if made.task.orbit.mean_motion == 0.0 else (0.05, 1.03)
    pairs = made.task.count * (made.task.count - 1) // 2
    met = pairs
    if made.joint.plan.ok:
        met = len(np.unique(cf.screen(made.joint.plan.paths, made.task.zone).pairs, axis=0))
    return [
        Figure(f"{name} ({made.conflicts} pairs meet)", f"<= {seconds(most)}", seconds(taken), taken <= most),
        Figure(f"{name}: energy over the lower bound", f"<= {dearest}", f"{over:.4f}", bool(over <= dearest)),
        Figure(f"{name}: pairs certified clear", f"{pairs}", f"{pairs - met}", met == 0),
    ]


def figures(rows: list[Row]) -> list[Figure]:
    found = [figure for made in rows if made.task.name.startswith("swap") for figure in swap_figures(made)]
    for count, most in ((50, 2.0), (200, 1.0), (1000, 10.0)):
        own = [made.joint for made in rows if made.task.count == count]
        if own:
            slowest, all_clear = max(joint.time for joint in own), all(joint.clear for joint in own)
            measured = seconds(slowest) + ("" if all_clear else ", not clear")
            met = slowest <= most and all_clear
            found.append(Figure(f"reconfigure, {count} spacecraft", f"<= {seconds(most)}", measured, met))
    compared = [made for made in rows if made.convex and made.conflicts]
    faster = median(formed.solver_time / made.joint.time for made in compared if (formed := made.convex))
    dearer = [
        100 * (made.joint.energy / other.energy - 1)
        for made in compared
        for other in (made.convex, made.restarted)
        if other
    ]
    most_dear = float(np.max(dearer))
    found.append(Figure("joint plan: speed-up over convex programs", ">= 100x", times(faster), faster >= 100))
    found.append(
        Figure(
            "joint plan: maximum energy above the convex programs",
            "<= 0.1 %",
            f"{most_dear:+.3f} %",
            bool(most_dear <= 0.1),
        )
    )
    return found
