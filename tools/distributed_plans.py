"""Compare distributed with joint planning: convergence, messages and energy for 4, 8 and 12 spacecraft.

    python tools/distributed_plans.py [--seeds 20]

Prints the table of docs/formation.md. The random reconfigurations are those of tests/formations.py. Each mean
is over the cases with a conflict on the direct paths.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

import closeform as cf
from closeform.planning.methods.sequential import by_messages
from closeform.planning.request import Request

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from formations import DEEP_SPACE, LOW_ORBIT, reconfiguration

DELAYS = (1, 3)
HEAD = "| spacecraft | | cases | joint | one by one | distributed | new plans | rounds | rounds, delay 3 |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=20)
    seeds = parser.parse_args().seeds
    print(HEAD)
    print("|" + "---|" * (HEAD.count("|") - 1))
    for orbit, place in ((LOW_ORBIT, "orbit"), (DEEP_SPACE, "deep space")):
        for count in (4, 8, 12):
            rows = [row for seed in range(seeds) if (row := compared(count, seed, orbit))]
            joint, turns, own, plans, *rounds = np.mean(rows, axis=0)
            shares = " | ".join(f"{share:.2%}" for share in (joint, turns, own))
            numbers = " | ".join(f"{number:.1f}" for number in (plans, *rounds))
            print(f"| {count} | {place} | {len(rows)} | {shares} | {numbers} |")


def compared(count: int, seed: int, orbit: cf.Orbit) -> list[float] | None:
    """Return extra energies as shares of the direct ones, new plans, and rounds; None without a conflict."""
    task = reconfiguration(count, seed, orbit, spacing=3.0)
    request = Request.of_formation(**task.arguments, method="distributed")
    problem = request.problem()
    if not problem.conflicts(problem.direct):
        return None
    least = problem.energy(problem.direct)
    found = [by_messages(problem, range(count), delays=delay) for delay in DELAYS]
    others = [cf.reconfigure(**task.arguments, method=method) for method in ("joint", "sequential")]
    if any(one.trajectories is None for one in found) or not all(plan.ok for plan in others):
        return None
    extra = [plan.energy / least - 1.0 for plan in others] + [found[0].extra / least]
    return [*extra, float(found[0].messages), *(float(one.rounds) for one in found)]


if __name__ == "__main__":
    main()
