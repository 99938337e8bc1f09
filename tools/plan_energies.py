"""Energies that the planners reach on fixed cases, so that a change of a planner can be held against them.

    python tools/plan_energies.py [--to FILE]

Plans every passage of tests/passages.py with `avoid` and with `reconfigure`, its crowds and the random
formations of tests/formations.py with `reconfigure`, and writes tests/data/plan_energies.json, one line
a case.  It takes some minutes.  Of each plan: energy [m^2/s^3]; `extra`, the energy beyond the direct
optimum; whether that is proven least; contacts; seconds, which depend on the machine.  A plan counts
if no two in it come closer than their zone; else its energy is null, and the reason is given.
"""

import argparse
import json
import os
import subprocess
import sys
from datetime import UTC, datetime
from itertools import combinations
from pathlib import Path
from time import perf_counter

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before NumPy: small matrices
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import numpy as np

import closeform as cf
from formations import CASES, random_case
from passages import GROUPS, crowds, passages

FILE = Path(__file__).resolve().parents[1] / "tests" / "data" / "plan_energies.json"
CLEAR = 1.0 - 1e-12  # least ratio of a clear path
DIGITS = 12


def one_craft(passage):
    """What both planners make of a passage."""
    direct = passage.path.energy
    single, spent = timed(cf.avoid, passage.path, passage.obstacles, passage.zones)
    line = {"direct": shortened(direct), "avoid": single_found(passage, single, spent)}
    try:
        plan, spent = timed(
            cf.reconfigure,
            passage.orbit,
            [passage.initial],
            [passage.final],
            passage.duration,
            [None, *passage.zones],
            obstacles=passage.obstacles,
            if_blocked=("more sides",),
        )
    except ValueError as error:
        return line | {"reconfigure": nothing(str(error))}
    ratio = passage.least_ratio(plan.paths[0]) if plan.ok else np.nan
    return line | {"reconfigure": plan_found(plan, ratio, spent)}


def many_craft(task):
    """What `reconfigure` makes of a formation."""
    plan, spent = timed(cf.reconfigure, **task.arguments)
    ratio = least_ratio(task, plan.paths) if plan.ok else np.nan
    direct = task.orbit.transfer(task.initial, task.final, task.duration, task.start).energy.sum()
    return {"direct": shortened(direct), "reconfigure": plan_found(plan, ratio, spent)}


def single_found(passage, answer, spent):
    if not answer.ok:
        return nothing(answer.reason, spent)
    ratio = passage.least_ratio(answer.path)
    return found(answer, answer.extra_energy, len(answer.contacts), ratio, spent)


def plan_found(plan, ratio, spent):
    if not plan.ok:
        return nothing(plan.reason, spent) | tried(plan)
    # of the times as flown, which differ from those asked for where `measures` says so
    extra = max(plan.energy - float(plan.direct.energy.sum()), 0.0)
    return found(plan, extra, len(plan.contacts), ratio, spent) | tried(plan)


def found(plan, extra, contacts, ratio, spent):
    if not ratio >= CLEAR:
        return nothing(f"not clear: {ratio!r} x zone", spent)
    return {
        "energy": shortened(plan.energy),
        "extra": shortened(extra),
        "proven": plan.proven or not contacts,
        "contacts": contacts,
        "seconds": shortened(spent, 3),
    }


def nothing(reason, spent=None):
    return {"energy": None, "reason": reason} | ({} if spent is None else {"seconds": shortened(spent, 3)})


def tried(plan):
    """What was tried where the first plan failed."""
    return {"measures": list(plan.measures)} if plan.measures else {}


def least_ratio(task, paths):
    """Least norm of any pair in its zone."""
    bodies = cf.stack([*paths, *task.obstacles])
    zones = {pair: task.zone_of(*pair) for pair in combinations(range(len(bodies)), 2)}
    moving = [(*pair, zone) for pair, zone in zones.items() if zone and pair[0] < len(paths)]
    return min(
        (cf.closest_approach(bodies[i], bodies[j], zone).ratio for i, j, zone in moving), default=np.inf
    )


def timed(call, *arguments, **named):
    begin = perf_counter()
    return call(*arguments, **named), perf_counter() - begin


def shortened(value, digits=DIGITS):
    return float(f"{value:.{digits}g}")


def made():
    """With which code, and when."""
    package = Path(cf.__file__).parent
    words = ["git", "-C", str(package)]
    commit = subprocess.run([*words, "rev-parse", "HEAD"], capture_output=True, text=True, check=True).stdout
    changed = subprocess.run([*words, "status", "--porcelain", "."], capture_output=True, text=True).stdout
    return {
        "by": "tools/plan_energies.py",
        "commit": commit.strip() + " with changes" * bool(changed),
        "on": datetime.now(UTC).strftime("%Y-%m-%d"),
        "energies": "m^2/s^3, half the integral of the squared thrust acceleration, summed over craft",
    }


def groups():
    """Every group: its name, cases by name, and what plans them."""
    for group in GROUPS:
        yield group, [(passage.name, passage) for passage in passages(group)], one_craft
    yield "crowds", [(task.name, task) for task in crowds()], many_craft
    yield "random formations", [(task.name, task) for task in map(random_case, range(CASES))], many_craft


def written(head, tables):
    """JSON with one line a case."""
    parts = [f'"made": {json.dumps(head, ensure_ascii=False)}']
    for group, lines in tables.items():
        rows = [f"{json.dumps(name)}: {json.dumps(line, ensure_ascii=False)}" for name, line in lines.items()]
        parts.append(f"{json.dumps(group)}: {{\n" + ",\n".join(rows) + "\n}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--to", type=Path, default=FILE, help="the file to write")
    options = parser.parse_args()
    head, tables = made(), {}
    one_craft(passages("one ellipsoid")[0])  # kernels are loaded before anything is timed
    for group, cases, planned in groups():
        begin, tables[group] = perf_counter(), {}
        for k, (name, case) in enumerate(cases, 1):
            line = tables[group][name] = planned(case)
            planners = {who: said for who, said in line.items() if who != "direct"}
            failed = "; ".join(f"{who}: {it['reason']}" for who, it in planners.items() if "reason" in it)
            if failed or k % 20 == 0 or k == len(cases):
                print(f"{group}: {k} of {len(cases)}, {perf_counter() - begin:.1f} s. {failed}", flush=True)
    options.to.parent.mkdir(exist_ok=True)
    options.to.write_text(written(head, tables), encoding="utf-8")


if __name__ == "__main__":
    main()
