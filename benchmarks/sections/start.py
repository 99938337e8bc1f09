"""What a user waits for: the help, the first run of an example with compilation, and later runs."""

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
NAMES = (
    "cluster",
    "swap",
    "swap_deep_space",
    "f6_scatter",
    "tpf",
    "find_then_fly",
    "swarm",
    "h03",
    "s04",
    "s04_counterexample",
)
COLUMNS = ("imports", "kernels", "flying", "pictures", "tables, page", "animation")


def measure(quick: bool) -> Report:
    rows, first, later = [], {}, {}
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # or each run compiles all modules: 0.4 s
    with tempfile.TemporaryDirectory() as folder:
        for name in NAMES[:1] if quick else NAMES:
            say(f"  {name}")
            # an empty cache, as on a new machine; HOME too, for what else the run may keep there
            empty = {"XDG_CACHE_HOME": f"{folder}/{name}", "HOME": folder}
            environment = os.environ | ({} if quick else empty)  # to compile anew takes most of a minute
            anew = run(name, folder, environment)
            again = [run(name, folder, environment) for _ in range(1 if quick else 5)]
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
        "First run: an empty cache; its kernels are compiled in two processes, and what the first one waits "
        "for is given. Later runs: the median, without the animation, and where the main process spends it: "
        "pictures are drawn in others, from before tables are written. Imports: Python, libraries, "
        "reading the file and printing."
    ]
    return Report(
        [Table("Start: every example, all cores", columns, rows, notes)], figures(helped, first, later)
    )


def run(name: str, folder: str, environment: dict[str, str]) -> dict[str, float]:
    """Where the time of one run goes [s]; `total` is what a user waits."""
    file = EXAMPLES / f"{name}.toml"
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
