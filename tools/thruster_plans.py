"""Compare minimum delta-v plans past obstacles between machines, settings and budgets.

Run the tool once for each setting, and pass the files to the last run:

    OPENBLAS_CORETYPE=Haswell python tools/thruster_plans.py --save haswell.json
    OPENBLAS_CORETYPE=SkylakeX python tools/thruster_plans.py --save skylakex.json
    python tools/thruster_plans.py --budget 400 --save best.json
    python tools/thruster_plans.py --compare haswell.json skylakex.json best.json

The best plan of all files is the best known. 47 passages have one box and thrusters along R, T and N. 100
others have one or three obstacles, boxes or ellipsoids. Their thrusters are along R, T and N, inertially
fixed, in a tetrahedron, or free.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import closeform as cf

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from passages import Passage, passage

GROUPS = {"one ellipsoid": 34, "three boxes": 33, "three ellipsoids": 33}
FOUR = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3.0)
SETS = (
    cf.Thrusters.rtn(),
    cf.Thrusters.rtn(frame="inertial"),
    cf.Thrusters(FOUR),
    None,
)


def tasks() -> Iterator[tuple[str, Passage, cf.Thrusters | None]]:
    """Yield the name, the passage and the thrusters of each plan."""
    for seed in range(47):
        yield f"one box {seed}", passage("one box", seed), SETS[0]
    number = 0
    for group, count in GROUPS.items():
        for seed in range(count):
            yield f"{group} {seed}", passage(group, seed), SETS[number % len(SETS)]
            number += 1


def measure(budget: int | None) -> dict[str, Any]:
    """Plan every task and return its status, costs [m/s] and CPU time [s]."""
    rows = {}
    for name, task, thrusters in tasks():
        path = task.orbit.impulsive(task.initial, task.final, task.duration)
        began = process_time()
        plan = cf.avoid(path, task.obstacles, task.zones, cost="delta-v", thrusters=thrusters, budget=budget)
        spent = process_time() - began
        rows[name] = plan.status.value, plan.delta_v, plan.lower_bound, spent
        clear = plan.path is None or not task.conflicts(plan.path)
        if not clear:
            raise SystemExit(f"{name}: the plan is not clear")
    return rows


def compare(files: list[str]) -> None:
    """Print the excess of each file over the best known plans, and the differences between files."""
    runs = [json.loads(Path(file).read_text()) for file in files]
    names = list(runs[0])
    costs = np.array([[run[name][1] for name in names] for run in runs])
    bounds = np.array([runs[0][name][2] for name in names])
    times = np.array([[run[name][3] for name in names] for run in runs])
    best = np.nanmin(costs, axis=0)
    heads = f"{'plans':>5} {'above 0.1 %':>11} {'above 2 %':>9} {'worst':>7} {'CPU ms, median':>14} max"
    print(f"{'file':24} {heads}")
    for file, cost, spent in zip(files, costs, times, strict=True):
        over = cost / best - 1.0
        print(
            f"{Path(file).stem:24} {np.isfinite(cost).sum():5} {(over > 1e-3).sum():11} "
            f"{(over > 0.02).sum():9} "
            f"{100.0 * np.nanmax(over):5.1f} % {1e3 * np.median(spent):14.1f} {1e3 * spent.max():.0f}"
        )
    print(f"{(best <= 1.02 * bounds).sum()} of {len(names)} within 2 % of the bound")
    for k, name in enumerate(names):
        statuses = [run[name][0] for run in runs]
        apart = np.nanmax(costs[:, k]) / best[k] - 1.0
        if len(set(statuses)) > 1 or apart > 1e-3:
            print(f"{name:22} {' '.join(f'{cost:.6f}' for cost in costs[:, k])} {' '.join(set(statuses))}")


def main() -> None:
    """Measure, or compare saved results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--budget", type=int, help="maximum number of starts (default of the planner)")
    parser.add_argument("--save", help="file to write")
    parser.add_argument("--compare", nargs="+", help="files to compare")
    given = parser.parse_args()
    if given.compare:
        compare(given.compare)
        return
    rows = measure(given.budget)
    if given.save:
        Path(given.save).write_text(json.dumps(rows))


if __name__ == "__main__":
    main()
