"""What a user waits for: the help, the first run of an example with compilation, and later runs."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from tables import Figure, Report, Table, seconds
from timing import Timing, side_by_side

COMMAND = Path(sys.executable).with_name("closeform")
EXAMPLE = Path(__file__).parents[2] / "examples" / "cluster.toml"


def measure(quick: bool) -> Report:
    repeats = 1 if quick else 5
    with tempfile.TemporaryDirectory() as folder:
        # an empty cache, as on a new machine; HOME too, for what else the run may keep there
        environment = os.environ | {"XDG_CACHE_HOME": f"{folder}/cache", "HOME": folder}

        def called(*arguments: str) -> None:
            subprocess.run([COMMAND, *arguments], env=environment, stdout=subprocess.DEVNULL, check=True)

        def example() -> None:
            called("run", str(EXAMPLE), "--out", f"{folder}/results", "--overwrite")

        first = side_by_side({"first run of an example": example}, 1)
        later = side_by_side({"closeform --help": lambda: called("--help"), "later runs": example}, repeats)
    timings = later | first
    rows = [
        [name, seconds(t.median), f"±{t.spread:.0%}" if len(t.runs) > 1 else ""]
        for name, t in timings.items()
    ]
    title = f"Start: {EXAMPLE.name}, an empty cache at first, all cores"
    return Report([Table(title, ["command", "time", "spread"], rows)], figures(timings))


def figures(timings: dict[str, Timing]) -> list[Figure]:
    asked = {"closeform --help": 0.3, "first run of an example": 15.0, "later runs": 2.0}
    return [
        Figure(name, f"<= {most:g} s", seconds(timings[name].median), timings[name].median <= most)
        for name, most in asked.items()
    ]
