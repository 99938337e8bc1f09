"""Waiting times of a user: the help, the first run of an example with compilation, and later runs."""

import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from tables import Figure, Report, Table, seconds
from timing import say, side_by_side

COMMAND = Path(sys.executable).with_name("closeform")
PHASES = Path(__file__).parents[1] / "phases.py"
EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = ("cluster", *sorted(file.stem for file in EXAMPLES.glob("*.toml") if file.stem != "cluster"))
BY_FUEL = re.compile(r'^\s*(cost\s*=\s*"delta-v"|thrusters\s*=|do\s*=\s*"transfer")', re.MULTILINE)
FUEL = ("fuel.", "motion.minimum_delta_v.", "planning.delta_v.")
PLANNED = "swap_impulses"  # compared with the same file at minimum energy
COLUMNS = ("imports", "kernels", "planning", "pictures", "tables, page", "animation")


def measure(quick: bool) -> Report:
    rows, first, later, needless = [], {}, {}, 0
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # otherwise each run compiles all modules: 0.4 s
    with tempfile.TemporaryDirectory() as folder:
        for name in NAMES[:1] if quick else NAMES:
            say(f"  {name}")
            # empty cache and home folder, as on a new machine
            empty = {"XDG_CACHE_HOME": f"{folder}/{name}", "HOME": folder}
            environment = os.environ | ({} if quick else empty)  # compilation takes most of a minute
            file = EXAMPLES / f"{name}.toml"
            anew = run(file, folder, environment)
            if not quick and not BY_FUEL.search(file.read_text()):
                kept = Path(folder, name, "closeform", "kernels").iterdir()
                needless += sum(one.name.startswith(FUEL) for one in kept)
            again = [run(file, folder, environment) for _ in range(1 if quick else 5)]
            typical = {phase: statistics.median(one.get(phase, 0.0) for one in again) for phase in anew}
            first[name], later[name] = anew["total"], typical["total"] - typical.get("animation", 0.0)
            rows.append([name, seconds(first[name]), seconds(anew["kernels"]), seconds(later[name])])
            rows[-1] += [seconds(typical[phase]) if phase in typical else "" for phase in COLUMNS]
        added = None if quick else added_by_fuel(folder)
        helped = side_by_side(
            {"closeform --help": lambda: subprocess.run([COMMAND, "--help"], stdout=subprocess.DEVNULL)},
            1 if quick else 7,
        )["closeform --help"].median
    columns = ["example", "first run", "kernels", "later run", *COLUMNS]
    notes = [
        (
            "First run: empty cache, kernels compiled in two processes; the kernels column is the waiting "
            "time of the main process. Later run: median without the animation, and its parts in the main "
            "process. Other processes draw the pictures at the same time. Imports: Python, libraries, "
            "reading the file and printing."
        )
    ]
    reached = figures(helped, first, later)
    if added is not None:
        reached += compiled(added, needless)
    return Report([Table("Start: every example, all cores", columns, rows, notes)], reached)


def added_by_fuel(folder: str) -> float:
    """Return the extra time of minimum delta-v in the first run of `PLANNED` [s], median of three."""
    text = (EXAMPLES / f"{PLANNED}.toml").read_text()
    by_fuel, by_energy = Path(folder, "by_fuel.toml"), Path(folder, "by_energy.toml")
    by_fuel.write_text(text)
    by_energy.write_text(text.replace('cost = "delta-v"', ""))
    added = []
    for turn in range(3):
        say(f"  {PLANNED}, and by energy: {turn + 1} of 3")
        dear, cheap = (
            run(file, folder, os.environ | {"XDG_CACHE_HOME": f"{folder}/{file.stem}{turn}", "HOME": folder})
            for file in (by_fuel, by_energy)
        )
        added.append(dear["total"] - cheap["total"])
    return statistics.median(added)


def run(file: Path, folder: str, environment: dict[str, str]) -> dict[str, float]:
    """Return the times of the phases of one run [s]; `total` is the wall time."""
    case = ["--case", "7"] if re.search(r"^\[study\]", file.read_text(), re.MULTILINE) else []
    command = [sys.executable, PHASES, "run", file, "--out", f"{folder}/results", "--overwrite", *case]
    begin = perf_counter()
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    total = perf_counter() - begin
    spent: dict[str, float] = json.loads(done.stdout)
    return {**spent, "imports": spent["imports"] + total - sum(spent.values()), "total": total}


def figures(helped: float, first: dict[str, float], later: dict[str, float]) -> list[Figure]:
    longest = max(first, key=lambda name: first[name])
    slowest = max(later, key=lambda name: later[name])
    return [
        Figure(name, f"<= {most:g} s", seconds(measured), measured <= most)
        for name, most, measured in (
            ("closeform --help", 0.2, helped),
            (f"first run of every example ({longest})", 12.0, first[longest]),
            (f"later run of every example ({slowest})", 2.0, later[slowest]),
        )
    ]


def compiled(added: float, needless: int) -> list[Figure]:
    """Return the extra time of minimum delta-v in a first run, and its kernels in runs without it."""
    name = f"first run of {PLANNED}: excess over minimum energy"
    others = "delta-v kernels compiled in first runs without delta-v"
    return [
        Figure(name, "<= 3 s", f"{added:.1f} s", added <= 3.0),
        Figure(others, "0", str(needless), needless == 0),
    ]
