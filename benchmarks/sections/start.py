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
NAMES = (  # one of each kind, the one of README first
    "cluster",
    "swap_impulses",
    "passive_inspector",
    "docking",
    "eccentric_chief",
    "three_sigmas",
    "simulated_swap",
    "s04",
    "tpf",
)
COLUMNS = ("imports", "kernels", "planning", "pictures", "tables, page", "animation")


def measure(quick: bool) -> Report:
    rows, first, later = [], {}, {}
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # otherwise each run compiles all modules: 0.4 s
    with tempfile.TemporaryDirectory() as folder:
        for name in NAMES[:1] if quick else NAMES:
            say(f"  {name}")
            # empty cache and home folder, as on a new machine
            empty = {"XDG_CACHE_HOME": f"{folder}/{name}", "HOME": folder}
            environment = os.environ | ({} if quick else empty)  # compilation takes most of a minute
            file = EXAMPLES / f"{name}.toml"
            anew = run(file, folder, environment)
            again = [run(file, folder, environment) for _ in range(1 if quick else 5)]
            typical = {phase: statistics.median(one.get(phase, 0.0) for one in again) for phase in anew}
            first[name], later[name] = anew["total"], typical["total"] - typical.get("animation", 0.0)
            rows.append([name, seconds(first[name]), seconds(anew["kernels"]), seconds(later[name])])
            rows[-1] += [seconds(typical[phase]) if phase in typical else "" for phase in COLUMNS]
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
    return Report([Table("Start: examples, all cores", columns, rows, notes)], figures(helped, first, later))


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
            (f"first run of an example ({longest})", 25.0, first[longest]),
            (f"later run of an example ({slowest})", 3.0, later[slowest]),
        )
    ]
