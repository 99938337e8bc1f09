"""Several requirements in one plan, an approach beside a cone program, and a thousand spacecraft."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from time import process_time

import numpy as np

import closeform as cf
from formations import DEEP_SPACE, LOW_ORBIT, reconfiguration
from hold_transfers import ORBITS, hold_and_ring
from peers.approach_cone import Approach, solve
from ring_transfers import RingTransfer, ring_transfers, unsafe_transfers
from tables import Figure, Report, Table, seconds, times
from timing import say, timed

COUNT, LEAST, DEARER = 30, 28, 1.1  # plans asked of each kind, and their cost over a single requirement's
SIGMAS, ERRORS = 3.0, cf.Uncertainty(np.diag([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2)
SIX = cf.Thrusters.rtn(acceleration=1e-2, minimum_bit=1e-3)
HOLDS = 41  # seed
TOO_LOW = 1e-9  # m/s^2, a limit that no transfer respects: its refusal states the least one
GRIDS = (61, 121), (121, 241)  # times of impulses, and of requirements
STATION, KEPT = cf.Sphere(1.0), cf.Sphere(10.0)  # keep-out zones of a docking, and of an approach to a hold
CROWD, LONGEST = 1000, 10.0  # spacecraft, and seconds asked for their plan


@dataclass(frozen=True)
class Combination:
    """A combination of requirements, and each of them alone, for one transfer."""

    both: Callable[[], cf.Plan]
    alone: tuple[Callable[[], cf.Plan], ...]


def measure(quick: bool) -> Report:
    rows, figures = [], []
    for name, cases in combinations(2 if quick else COUNT).items():
        row, figure = compared(name, cases)
        rows.append(row)
        figures.append(figure)
    columns = ["task", "planned", "cost over a single one's, median", "maximum", "median time", "maximum"]
    note = (
        "Minimum delta-v. The cost is relative to that of the costlier plan with a single requirement. "
        "The least thrust is that of the transfer alone."
    )
    approach, fast = approaches(quick)
    crowd, together = crowds(quick)
    tables = [Table("Combined requirements", columns, rows, [note]), approach, crowd]
    return Report(tables, [*figures, fast, together])


def combinations(count: int) -> dict[str, list[Combination]]:
    """Return the cases of each combination by name."""
    rings = ring_transfers("thirty")[:count]
    holds = unsafe_transfers(HOLDS, count, ORBITS, lambda orbit, rng, k: hold_and_ring(orbit, rng, 2 * k))
    return {
        "passively safe and at 3 sigma": [
            combined(case, {"drift": case.drift}, {"errors": ERRORS, "sigmas": SIGMAS}) for case in rings
        ],
        "passively safe within twice the least thrust": [
            combined(
                case,
                {"drift": case.drift},
                {"max_acceleration": 2.0 * least_thrust(case), "longer": False},
            )
            for case in rings
        ],
        "passively safe from a V-bar hold, on-off thrusters": [
            combined(case, {"drift": case.drift}, {"thrusters": SIX}) for case in holds
        ],
    }


def combined(case: RingTransfer, *options: dict) -> Combination:
    """Return the plans of a transfer with all the options, and with each of them."""

    def plan(**given) -> Callable[[], cf.Plan]:
        return lambda: cf.avoid(case.path, case.client, case.zone, cost="delta-v", **given)

    return Combination(plan(**options[0], **options[1]), tuple(plan(**one) for one in options))


def least_thrust(case: RingTransfer) -> float:
    """Return the least acceleration [m/s^2] with which the transfer is possible in its time."""
    given = case.path, case.client, case.zone
    refused = cf.avoid(*given, cost="delta-v", max_acceleration=TOO_LOW, longer=False)
    return float(refused.weak.needed)


def compared(name: str, cases: Sequence[Combination]) -> tuple[list[str], Figure]:
    """Return the row of a combination, and the figure that is asked of it."""
    say(f"  {name}")
    cases[0].both()  # compile
    ratios, took = [], []
    for number, case in enumerate(cases):
        begin = process_time()
        plan = case.both()
        took.append(process_time() - begin)
        say(f"    {number + 1} of {len(cases)}: {plan.status.value}, {seconds(took[-1])}")
        if plan.ok:
            ratios.append(plan.delta_v / max(alone().delta_v for alone in case.alone))
    planned = f"{len(ratios)} of {len(cases)}"
    good = len(ratios) * COUNT >= LEAST * len(cases) and median(ratios) <= DEARER
    cells = [
        planned,
        f"{median(ratios):.3f}",
        f"{max(ratios):.3f}",
        seconds(median(took)),
        seconds(max(took)),
    ]
    return [name, *cells], Figure(name, f">= {LEAST}, <= {DEARER}", ", ".join(cells[:2]), good)


def approaches(quick: bool) -> tuple[Table, Figure]:
    """Return V-bar approaches from 200 m in a cone of 10 degrees with a speed limit, with their peers."""
    begin, dock, hold = np.zeros(6), np.zeros(6), np.zeros(6)
    begin[1], dock[1], hold[1] = -200.0, -1.0, -20.0
    duration, astern = 2400.0, [0, -1, 0]
    cone = cf.requirements.ApproachCone(axis=astern, half_angle=np.radians(10), radius=0.5)
    limit = cf.requirements.SpeedLimit(limit=0.05, rate=1e-3, axis=astern)
    wanted = {"requirements": [cone, limit], "cost": "delta-v", "if_blocked": ()}
    station = LOW_ORBIT.coast(np.zeros(6), duration + 2 * LOW_ORBIT.period)
    rows, repeats = [], 1 if quick else 5
    took, plan = timed(
        lambda: cf.reconfigure(LOW_ORBIT, [begin], [dock], duration, STATION, **wanted), repeats
    )
    rows.append(["closeform, to the dock", seconds(took), "1x", f"{plan.delta_v:.5f}", "certified"])
    for fires, seen in GRIDS[: 1 if quick else 2]:
        say(f"  cone program, {fires} times")
        task = Approach(LOW_ORBIT.mean_motion, begin, dock, duration, np.radians(10), 0.5, 0.05, 1e-3)
        found = solve(task, fires, seen)
        outside = f"{100 * found.outside:.2g} cm, {1e3 * found.faster:.2g} mm/s beyond"
        cells = [seconds(found.time), times(found.time / took), f"{found.delta_v:.5f}", outside]
        rows.append([f"cone program, impulses at {fires} times", *cells])
    safe_took, safe = timed(
        lambda: cf.reconfigure(
            *(LOW_ORBIT, [begin], [hold], duration, KEPT),
            obstacles=station,
            drift=LOW_ORBIT.period,
            **wanted,
        ),
        repeats,
    )
    cells = [seconds(safe_took), "", f"{safe.delta_v:.5f}", "certified" if safe.ok else safe.status.value]
    rows.append(["closeform, to a hold at 20 m, passively safe", *cells])
    columns = ["approach", "time", "relative time", "delta-v [m/s]", "requirements between the times"]
    note = (
        "500 km, from 200 m behind the target, in 2400 s, a cone of 10 deg, a speed limit of 0.05 m/s plus "
        "0.001/s times the range. Time of the cone program: the solver alone. Passively safe: after a loss "
        "of thrust at any instant the spacecraft stays 10 m away for one orbit."
    )
    title = "V-bar approach from 200 m in a cone with a speed limit"
    fast = max(took, safe_took) <= 0.1 and plan.ok and safe.ok
    return Table(title, columns, rows, [note]), Figure(title, "<= 0.1 s", seconds(max(took, safe_took)), fast)


def crowds(quick: bool) -> tuple[Table, Figure]:
    """Return joint plans of many spacecraft in deep space and in orbit."""
    count, rows, slowest, good = 100 if quick else CROWD, [], 0.0, True
    for place, orbit in (("deep space", DEEP_SPACE), ("orbit", LOW_ORBIT)):
        say(f"  {count} spacecraft, {place}")
        task = reconfiguration(count, 1, orbit)
        took, plan = timed(lambda task=task: cf.reconfigure(**task.arguments), 1)
        slowest, good = max(slowest, took), good and plan.ok
        gap = f"{100 * (plan.energy / plan.lower_bound - 1.0):.3f} %"
        rows.append([f"{count} spacecraft, {place}", seconds(took), gap, plan.status.value])
    title = f"{count} spacecraft jointly, minimum energy"
    columns = ["task", "time", "above the lower bound", "status"]
    figure = Figure(title, f"<= {LONGEST:g} s", seconds(slowest), good and slowest <= LONGEST)
    return Table(title, columns, rows, ["One core, with the certificate of all pairs."]), figure
