"""Monte Carlo studies on the command line: start, time and memory, on one core, two cores and a cluster."""

import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from tables import Figure, Report, Table, seconds, times
from timing import say

EXAMPLES = Path(__file__).parents[2] / "examples"
CLOSEFORM = [sys.executable, "-m", "closeform"]
GB = 1e9
DRAWS = """
[study]
cases = 10_000
seed = 1

[study.vary]
"craft.position" = { normal = "2 m" }
"craft.velocity" = { normal = "2 mm/s" }
"""


class Ran(NamedTuple):
    """Resources of a command: wall time and CPU time [s], peak memory and disk space [bytes]."""

    wall: float
    cpu: float
    memory: int
    disk: int


def measure(quick: bool) -> Report:
    many, few, gatherings = (200_000, 100_000, 2_000) if quick else (10_000_000, 1_000_000, 100_000)
    swaps = 16 if quick else 10_000
    with tempfile.TemporaryDirectory() as folder:
        desk = Path(folder)
        text = (EXAMPLES / "s04.toml").read_text()
        (desk / "s04.toml").write_text(re.sub(r"(?m)^sampled.*\n", "", text))
        (desk / "h03.toml").write_text((EXAMPLES / "h03.toml").read_text())
        eight = (EXAMPLES / "swap.toml").read_text().replace(', "S9", "S10", "S11", "S12"', "")
        (desk / "eight.toml").write_text(eight.replace("Swap: twelve", "Swap: eight") + DRAWS)
        for file in ("s04.toml", "h03.toml", "eight.toml"):
            ran(desk, file, 2)  # kernels are compiled
        begun = statistics.median(started(desk, "h03.toml") for _ in range(1 if quick else 5))
        single = ran(desk, "h03.toml", 1)
        start = ran(desk, "s04.toml", 1000)
        locks = {few: ran(desk, "s04.toml", few), many: ran(desk, "s04.toml", many)}
        gathered = ran(desk, "h03.toml", gatherings)
        swapped = ran(desk, "eight.toml", swaps)
        one = ran(desk, "s04.toml", many, cores=1)
        rows = [
            row("H03, a single case", 1, single),
            row("S04, 1,000 pairs", 1000, start),
            *(row("S04 pairs", count, found) for count, found in locks.items()),
            row("S04 pairs, one core", many, one),
            row("H03 gatherings of five", gatherings, gathered),
            row("swaps of eight spacecraft", swaps, swapped),
        ]
        overhead = cluster_overhead(desk, 4_000 if quick else 8_000_000)  # a minute
    title = "Monte Carlo studies with all output files, all cores"
    columns = ["study", "cases", "time", "CPU time", "CPU time per case", "peak memory", "files"]
    speed = (one.wall - start.wall) / (locks[many].wall - start.wall)
    notes = [
        f"Without the start, two cores are {times(speed)} as fast as one.",
        "CPU time and memory are those of the main process; other processes draw the pictures.",
    ]
    growth = locks[many].memory / locks[few].memory
    figures = [
        Figure("10^7 S04 pairs", "<= 10 s", seconds(locks[many].wall), met(quick, locks[many].wall <= 10.0)),
        Figure(
            "10^7 S04 pairs: peak memory",
            "< 1.5 GB",
            f"{locks[many].memory / GB:.2f} GB",
            locks[many].memory < 1.5 * GB,
        ),
        Figure("10^7 over 10^6 S04 pairs: peak memory", "< 1.2x", times(growth), growth < 1.2),
        Figure("10^5 gatherings", "<= 3 s", seconds(gathered.wall), met(quick, gathered.wall <= 3.0)),
        Figure("start of a study until its first case", "<= 1 s", seconds(begun), met(quick, begun <= 1.0)),
        Figure(
            "10^4 reconfigurations of eight",
            "<= 3 min",
            seconds(swapped.wall),
            met(quick, swapped.wall <= 180.0),
        ),
    ]
    if overhead is not None:
        figures.append(
            Figure(
                "two local Dask workers: overhead", "< 15 %", f"{overhead:.1%}", met(quick, overhead < 0.15)
            )
        )
    return Report([Table(title, columns, rows, notes)], figures)


def met(quick: bool, reached: bool) -> bool | None:
    """Return None for a quick run, otherwise whether the limit is met."""
    return None if quick else reached


def row(name: str, count: int, found: Ran) -> list[str]:
    each = f"{found.cpu / count * 1e6:.3g} µs"
    sizes = f"{found.memory / 1e6:.0f} MB", f"{found.disk / 1e6:.1f} MB"
    return [name, f"{count:,}", seconds(found.wall), seconds(found.cpu), each, *sizes]


def ran(desk: Path, file: str, count: int, cores: int | None = None, scheduler: Path | None = None) -> Ran:
    """Run a study with a number of cases and cores."""
    say(f"  {file}: {count:,} cases")
    command = [*CLOSEFORM, "study", file, "--cases", str(count), "--out", "out", "--overwrite"]
    if scheduler is not None:
        command += ["--scheduler", str(scheduler)]
    fewer = lambda: os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:cores])  # noqa: E731
    begin = time.perf_counter()
    process = subprocess.Popen(
        command, cwd=desk, stdout=subprocess.DEVNULL, preexec_fn=fewer if cores is not None else None
    )
    _, status, used = os.wait4(process.pid, 0)
    wall = time.perf_counter() - begin
    if os.waitstatus_to_exitcode(status) not in (0, 1):  # 1: some cases are not met
        raise RuntimeError(f"{' '.join(command)} failed")
    disk = sum(file.stat().st_size for file in (desk / "out").rglob("*.parquet"))
    return Ran(wall, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024, disk)


def started(desk: Path, file: str) -> float:
    """Return the time [s] from a command to its first case, when its folder has a manifest."""
    say(f"  {file}: start")
    begin, place = time.perf_counter(), desk / "begun" / ".unfinished" / "manifest.jsonl"
    command = [*CLOSEFORM, "study", file, "--cases", "1", "--out", "begun"]
    process = subprocess.Popen(command, cwd=desk, stdout=subprocess.DEVNULL)
    while not place.exists() and process.poll() is None:
        time.sleep(0.001)
    wall = time.perf_counter() - begin
    process.wait()
    shutil.rmtree(desk / "begun")
    return wall


def cluster_overhead(desk: Path, count: int) -> float | None:
    """Return the extra time of a cluster of two local workers over the cores alone, without the start."""
    if find_spec("distributed") is None:
        return None
    with machines(desk) as scheduler:
        ran(desk, "h03.toml", count // 10, scheduler=scheduler)  # workers load what they need
        there = [ran(desk, "h03.toml", some, scheduler=scheduler).wall for some in (count // 10, count)]
    here = [ran(desk, "h03.toml", some).wall for some in (count // 10, count)]
    return (there[1] - there[0]) / (here[1] - here[0]) - 1.0


@contextmanager
def machines(desk: Path):
    """Start a scheduler and two workers of one thread each, and yield the file of the scheduler."""
    file = desk / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": desk}
    dask = [sys.executable, "-m"]
    where = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
    processes = [subprocess.Popen([*dask, "distributed.cli.dask_scheduler", *where], **quiet)]
    while not file.exists():
        time.sleep(0.05)
    worker = ["--scheduler-file", str(file), "--nthreads", "1", "--no-dashboard", "--no-nanny"]
    for _ in range(2):
        processes.append(subprocess.Popen([*dask, "distributed.cli.dask_worker", *worker], **quiet))
    try:
        yield file
    finally:
        for process in processes:
            process.kill()
            process.wait()
