"""Write tests/data/plan_energies.json: energies of the planners on fixed cases.

    python tools/plan_energies.py [--to FILE]
    python tools/plan_energies.py --outside [--to FILE]

The file serves to compare changes of a planner. The tool plans every passage of tests/passages.py with
`avoid` and `reconfigure`, and its crowds and the random formations of tests/formations.py with
`reconfigure`. It takes a minute or two. Each plan has the energy [m^2/s^3]; `extra`, the energy beyond the
direct optimum; whether that is proven minimal; contacts; and seconds, which depend on the machine. A plan
with a conflict has a null energy and a reason.

--outside adds the results of benchmarks/peers/exchange.py from many starts, on the first hundred passages of
each group, in half an hour: `extra` of its path, rebuilt as optimal transfers from contact to contact and
certified clear. It is an independent upper bound on the minimum extra energy. `best` is the minimum of all
three.
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
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import numpy as np

import closeform as cf
from formations import CASES, random_case
from passages import GROUPS, crowds, passages
from peers.exchange import Exchange

FILE = Path(__file__).resolve().parents[1] / "tests" / "data" / "plan_energies.json"
CLEAR = 1.0 - 1e-12  # minimum ratio of a clear path
DIGITS = 12
INFLATIONS = 20  # maximum inflations of the zones until the path is clear between its contacts
OUTWARD = 1e-9  # first inflation
OUTSIDE = 100  # number of passages per group for the independent optimiser
PLANNERS = "avoid", "reconfigure", "outside"


def one_craft(passage):
    """Plan a passage with both planners."""
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
    ratio = float(passage.ratios(plan.paths[0]).min()) if plan.ok else np.nan
    return line | {"reconfigure": plan_found(plan, ratio, spent)}


def many_craft(task):
    """Plan a formation with `reconfigure`."""
    plan, spent = timed(cf.reconfigure, **task.arguments)
    ratio = least_ratio(task, plan.paths) if plan.ok else np.nan
    direct = task.orbit.transfer(task.initial, task.final, task.duration, task.start).energy.sum()
    return {"direct": shortened(direct), "reconfigure": plan_found(plan, ratio, spent)}


def single_found(passage, answer, spent):
    if not answer.ok:
        return nothing(answer.reason, spent)
    ratio = float(passage.ratios(answer.path).min())
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
    """Return the attempts after a failed first plan."""
    return {"measures": list(plan.measures)} if plan.measures else {}


def least_ratio(task, paths):
    """Return the minimum clearance ratio of all pairs."""
    bodies = cf.stack([*paths, *task.obstacles])
    zones = {pair: task.zone_of(*pair) for pair in combinations(range(len(bodies)), 2)}
    moving = [(*pair, zone) for pair, zone in zones.items() if zone and pair[0] < len(paths)]
    return min(
        (cf.closest_approach(bodies[i], bodies[j], zone).ratio for i, j, zone in moving), default=np.inf
    )


def outside(passage, seed):
    """Solve a passage with the independent optimiser."""
    begin = perf_counter()
    task = Exchange(
        passage.initial,
        passage.final,
        passage.duration,
        passage.orbit.mean_motion,
        passage.obstacles.position,
        [zone.matrix for zone in passage.zones],
        [zone.box for zone in passage.zones],
    )
    paths = (rebuilt(passage, task, path) for path in task.solve(seed))
    path = next((path for path in paths if path is not None), None)
    if path is None:
        return nothing("no start led to a clear path", perf_counter() - begin)
    extra = path.energy - passage.path.energy
    return {"extra": shortened(extra), "seconds": shortened(perf_counter() - begin, 3)}


def rebuilt(passage, task, path):
    """Return an independent path as optimal transfers from contact to contact; None if it is not clear."""
    factors = np.ones(len(passage.zones))
    for k in range(INFLATIONS):
        times = np.concatenate([[0.0], path.times, [passage.duration]])
        states = np.stack([passage.initial, *path.states, passage.final])
        chain = cf.join(
            passage.orbit.transfer(states[i], states[i + 1], times[i + 1] - times[i], times[i])
            for i in range(len(times) - 1)
        )
        ratios = passage.ratios(chain)
        if ratios.min() >= CLEAR and not passage.conflicts(chain):
            return chain
        factors *= np.where(ratios < 1.0 + OUTWARD, (1.0 + OUTWARD * 2.0**k) / ratios, 1.0)
        path = task.inflated(path, factors)
        if path is None:
            return None
    return None


def best(line):
    """Return the minimum extra energy found."""
    found = [line[who]["extra"] for who in PLANNERS if line.get(who, {}).get("extra") is not None]
    return min(found, default=None)


def timed(call, *arguments, **named):
    begin = perf_counter()
    return call(*arguments, **named), perf_counter() - begin


def shortened(value, digits=DIGITS):
    return float(f"{value:.{digits}g}")


def made():
    """Return the commit and the date."""
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
    """Return every group: its name, cases by name, and its planner."""
    for group in GROUPS:
        yield group, [(passage.name, passage) for passage in passages(group)], one_craft
    yield "crowds", [(task.name, task) for task in crowds()], many_craft
    yield "random formations", [(task.name, task) for task in map(random_case, range(CASES))], many_craft


def planned(known):
    """Plan all cases anew, and keep the results of the independent optimiser."""
    tables = {}
    one_craft(passages("one ellipsoid")[0])  # kernels are loaded before anything is timed
    for group, cases, planner in groups():
        begin, tables[group] = perf_counter(), {}
        for k, (name, case) in enumerate(cases, 1):
            line = tables[group][name] = planner(case)
            failed = "; ".join(
                f"{who}: {line[who]['reason']}" for who in PLANNERS if "reason" in line.get(who, {})
            )
            old = known.get(group, {}).get(name, {})
            if "outside" in old:
                line["outside"] = old["outside"]
            if group in GROUPS:
                line["best"] = best(line)
            if failed or k % 20 == 0 or k == len(cases):
                print(f"{group}: {k} of {len(cases)}, {perf_counter() - begin:.1f} s. {failed}", flush=True)
    return {"made": made()} | tables


def compared(known):
    """Add the results of the independent optimiser to the tables, group by group."""
    for group in sorted(GROUPS, key=lambda group: "ellipsoid" in group):  # boxes first
        begin = perf_counter()
        for seed, passage in enumerate(passages(group)[:OUTSIDE]):
            line = known[group][passage.name]
            before = best({who: line[who] for who in PLANNERS[:2]})
            line["outside"] = outside(passage, seed)
            line["best"] = best(line)
            extra = line["outside"].get("extra")
            ratio = extra / before if extra is not None and before else np.nan
            words = f"{ratio:.6f} of the planners' least extra energy"
            print(f"{passage.name}: {words}, {perf_counter() - begin:.0f} s", flush=True)
        yield known


def written(tables):
    """Return JSON with one line per case."""
    parts = []
    for group, lines in tables.items():
        if group == "made":
            parts.append(f'"made": {json.dumps(lines, ensure_ascii=False)}')
            continue
        rows = [f"{json.dumps(name)}: {json.dumps(line, ensure_ascii=False)}" for name, line in lines.items()]
        parts.append(f"{json.dumps(group)}: {{\n" + ",\n".join(rows) + "\n}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--outside", action="store_true", help="add the results of the independent optimiser")
    parser.add_argument("--to", type=Path, default=FILE, help="the file to write")
    options = parser.parse_args()
    known = json.loads(options.to.read_text(encoding="utf-8")) if options.to.exists() else {}
    for tables in compared(known) if options.outside else [planned(known)]:
        options.to.write_text(written(tables), encoding="utf-8")


if __name__ == "__main__":
    main()
