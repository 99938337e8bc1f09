"""Path past one obstacle: closeform, the method of SP11, and the rivals that SP11 discusses.

They are convex and mixed-integer programs, artificial potential functions and a genetic search.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

import closeform as cf
from cases import MEAN_MOTION, ZONE, Passage, passages
from peers import convex, genetic, mixed_integer, potential
from peers.motion import Array, position
from tables import Figure, Report, Table, seconds, times
from timing import say

EXACT, PAPER, CONVEX = "closeform, exact", "closeform, sauter-palmer", "convex programs, inflated"
POTENTIAL, GENETIC = "artificial potentials, best tuning", "differential evolution"
EXACT_BOX, MIXED = "closeform, exact", "mixed-integer, 20 steps"
SHAPE = np.diag(1 / ZONE**2)
TUNINGS = len(potential.PULLS) * len(potential.WIDTHS) * len(potential.PUSHES)
FINE = 20_001  # samples that judge a path


@dataclass
class Outcome:
    """Result of one method on one passage; energy and delta-v are nan without a path."""

    time: float
    energy: float = np.nan
    delta_v: float = np.nan
    ratio: float = np.nan  # least norm, judged by samples of the peers' own motion of the obstacle
    inside: float = 0.0  # seconds in the zone

    @property
    def clear(self) -> bool:
        return bool(self.ratio >= 1 - 1e-9)


def measure(quick: bool) -> Report:
    count, repeats = (2, 3) if quick else (24, 20)
    work = passages(count, seed=6)
    ellipsoid, box = cf.Ellipsoid(ZONE), cf.Box(ZONE)
    for method in ("exact", "sauter-palmer"):
        avoided(work[0], ellipsoid, method, 1)  # compile
    found: dict[str, list[Outcome]] = {name: [] for name in (EXACT, PAPER, CONVEX, POTENTIAL, GENETIC)}
    boxed: dict[str, list[Outcome]] = {name: [] for name in (EXACT_BOX, MIXED)}
    programs = []
    for number, passage in enumerate(work):
        say(f"  passage {number + 1} of {count}")
        found[EXACT].append(avoided(passage, ellipsoid, "exact", repeats))
        found[PAPER].append(avoided(passage, ellipsoid, "sauter-palmer", repeats))
        outcome, shaped = programmed(passage)
        found[CONVEX].append(outcome)
        programs.append(shaped)
        found[POTENTIAL].append(pushed(passage))
        found[GENETIC].append(evolved(passage, number))
        boxed[EXACT_BOX].append(avoided(passage, box, "exact", repeats))
        boxed[MIXED].append(mixed(passage))
    solved = [shaped for shaped in programs if shaped]
    speeds = {
        "shaping": middle(o.time for o in found[EXACT]),
        "shaping SP11": middle(o.time for o in found[PAPER]),
    }
    return Report([ellipsoids(found, solved), boxes(boxed)], figures(found), speeds)


def middle(values: Iterable[float]) -> float:
    """Return the median of the finite values."""
    return float(np.nanmedian(list(values)))


def ratios(others: list[Outcome], ours: list[Outcome], name: str) -> Array:
    """Return the ratio of a quantity to that of closeform for each passage; nan without a path."""
    pairs = zip(others, ours, strict=True)
    return np.array([getattr(other, name) / getattr(our, name) for other, our in pairs])


def ellipsoids(found: dict[str, list[Outcome]], programs: list[convex.Shaped]) -> Table:
    rows = []
    for name, outcomes in found.items():
        above = 100 * (ratios(outcomes, found[EXACT], "energy") - 1)
        rows.append(
            [
                name,
                seconds(middle(o.time for o in outcomes)),
                seconds(float(np.nanmax([o.time for o in outcomes]))),
                times(middle(ratios(outcomes, found[EXACT], "time"))),
                f"{np.nanmedian(above):+.3f} %",
                f"{np.nanmin(above):+.3f} %",
                f"{np.nanmax(above):+.2f} %",
                f"{sum(o.clear for o in outcomes)} of {len(outcomes)}",
            ]
        )
    one = middle(p.solver_time / p.programs for p in programs)
    inflations = [100 * (p.inflation - 1) for p in programs]
    notes = [
        (
            f"Convex programs: {convex.NODES} nodes with constant thrust between them, Clarabel to "
            f"{convex.TOLERANCE:g}, supporting planes updated until the energy changes by less than "
            f"{convex.SETTLED:g}, best of {convex.STARTS} starts. The zone is then inflated until the path "
            f"is clear between nodes (by {np.median(inflations):.3f} %, at most {np.max(inflations):.3f} "
            f"%); without inflation, {sum(p.inflation > 1 for p in programs)} of {len(programs)} paths cut "
            f"through the zone. Solver time: {int(middle(p.programs for p in programs))} programs of "
            f"{seconds(one)}."
        ),
        (
            "The time of closeform includes search, planning and certificate; it is the median of its "
            f"repeats. {FINE:,} samples of an independent motion model check its paths. The certified "
            "search of closeform checks the others."
        ),
        (
            f"Artificial potentials: {potential.STEPS} steps, a Gaussian around the obstacle and feedback to "
            f"the direct path. Of {TUNINGS} tunings for each passage, the one of least energy that is clear "
            f"and arrives within {potential.ARRIVED:g} m counts; the time is that of all."
        ),
        (
            "Differential evolution of SciPy varies the state in which two transfers meet, for at most "
            f"{genetic.GENERATIONS} generations of {6 * genetic.POPULATION}; the zone is checked at samples."
        ),
    ]
    title = f"Path past one obstacle, {len(found[EXACT])} passages, ellipsoid 20 x 40 x 20 m, one core"
    columns = [
        "method",
        "median time",
        "maximum",
        "relative time",
        "energy above exact, median",
        "minimum",
        "maximum",
        "clear",
    ]
    return Table(title, columns, rows, notes)


def boxes(found: dict[str, list[Outcome]]) -> Table:
    rows = []
    for name, outcomes in found.items():
        rows.append(
            [
                name,
                seconds(middle(o.time for o in outcomes)),
                times(middle(ratios(outcomes, found[EXACT_BOX], "time"))),
                f"{middle(ratios(outcomes, found[EXACT_BOX], 'energy')):.2f}",
                f"{middle(ratios(outcomes, found[EXACT_BOX], 'delta_v')):.2f}",
                f"{sum(o.inside > 0 for o in outcomes)} of {len(outcomes)}",
                f"{max(o.inside for o in outcomes):.0f} s",
            ]
        )
    notes = [
        (
            "The mixed-integer program minimises the sum of |u| over axes and steps. Neither its energy "
            "nor the delta-v of closeform is therefore optimal; both are relative to closeform. HiGHS to "
            f"a gap of {mixed_integer.GAP:g}, at most {mixed_integer.LIMIT:g} s. Cuts: paths that cross "
            "the box between nodes, which the program does not check."
        )
    ]
    title = (
        f"Path past one obstacle, {len(found[MIXED])} passages, box of half-widths 20 x 40 x 20 m, one core"
    )
    return Table(
        title,
        ["method", "median time", "relative time", "energy", "delta-v", "cuts", "longest cut"],
        rows,
        notes,
    )


def figures(found: dict[str, list[Outcome]]) -> list[Figure]:
    time = middle(o.time for o in found[EXACT])
    faster = middle(ratios(found[CONVEX], found[EXACT], "time"))
    above = 100 * float(np.nanmax(ratios(found[EXACT], found[CONVEX], "energy") - 1))
    paper = 100 * float(np.nanmax(ratios(found[EXACT], found[PAPER], "energy") - 1))
    clear = sum(o.clear for o in found[EXACT])
    return [
        Figure("avoid, one ellipsoid, median", "<= 1 ms", seconds(time), time <= 1e-3),
        Figure("avoid, clear paths", "all", f"{clear} of {len(found[EXACT])}", clear == len(found[EXACT])),
        Figure(
            "avoid: maximum energy above the convex program", "<= 0.05 %", f"{above:+.4f} %", above <= 0.05
        ),
        Figure("avoid: maximum energy above SP11's method", "<= 0 %", f"{paper:+.4f} %", paper <= 1e-6),
        Figure("avoid, against the convex program", ">= 500x", times(faster), faster >= 500),
    ]


def closeform_paths(passage: Passage) -> tuple[cf.Path, cf.Path]:
    orbit = cf.Orbit(MEAN_MOTION)
    path = orbit.transfer(passage.initial, passage.final, passage.duration)
    if passage.obstacle_final is None:
        return path, orbit.coast(passage.obstacle, passage.duration)
    return path, orbit.transfer(passage.obstacle, passage.obstacle_final, passage.duration)


def avoided(passage: Passage, zone: Any, method: str, repeats: int) -> Outcome:
    """Search for conflicts and plan with closeform, from two paths to a certified third."""
    path, obstacle = closeform_paths(passage)
    runs = []
    for _ in range(repeats):
        begin = perf_counter()
        result = cf.avoid(path, obstacle, zone, method=method)
        runs.append(perf_counter() - begin)
    if not result.ok:
        return Outcome(median(runs))
    instants = np.linspace(0, passage.duration, FINE)
    norms = zone.norm(result.path.position(instants) - position(passage.obstacle_path, instants, MEAN_MOTION))
    return Outcome(median(runs), result.energy, result.delta_v, float(norms.min()))


def programmed(passage: Passage) -> tuple[Outcome, convex.Shaped | None]:
    place = lambda instants: position(passage.obstacle_path, instants, MEAN_MOTION)  # noqa: E731
    shaped = convex.solve(passage.initial, passage.final, passage.duration, MEAN_MOTION, [place], SHAPE)
    if shaped is None:
        return Outcome(np.nan), None
    delta_v = float(np.linalg.norm(shaped.thrust, axis=1).sum() * passage.duration / convex.NODES)
    return Outcome(shaped.solver_time, shaped.energy, delta_v, certified(passage, shaped.thrust)), shaped


def certified(passage: Passage, thrust: Array) -> float:
    """Return the minimum clearance ratio of the exact path of held thrusts, from the certified search."""
    orbit, step = cf.Orbit(MEAN_MOTION), passage.duration / len(thrust)
    state, burns = passage.initial, []
    for k, push in enumerate(thrust):
        burns.append(orbit.burn(state, push, step, start=k * step))
        state = burns[-1].state(burns[-1].end)
    _, obstacle = closeform_paths(passage)
    return float(cf.closest_approach(cf.join(burns), obstacle, cf.Ellipsoid(ZONE)).ratio)


def pushed(passage: Passage) -> Outcome:
    begin = perf_counter()
    found = potential.solve(passage.path, passage.obstacle_path, passage.duration, MEAN_MOTION, ZONE)
    time = perf_counter() - begin
    if found is None:
        return Outcome(time)
    return Outcome(time, found.energy, found.delta_v, certified(passage, found.thrust))


def evolved(passage: Passage, seed: int) -> Outcome:
    begin = perf_counter()
    paths = passage.path, passage.obstacle_path
    found = genetic.solve(*paths, passage.duration, MEAN_MOTION, ZONE, seed)
    time = perf_counter() - begin
    if found is None:
        return Outcome(time)
    return Outcome(time, found.energy, found.delta_v, certified(passage, found.thrust))


def mixed(passage: Passage) -> Outcome:
    place = lambda instants: position(passage.obstacle_path, instants, MEAN_MOTION)  # noqa: E731
    found = mixed_integer.solve(passage.initial, passage.final, passage.duration, MEAN_MOTION, [place], ZONE)
    if found is None:
        return Outcome(np.nan)
    return Outcome(found.wall_time, found.energy, found.delta_v, found.least_ratio, found.inside)
