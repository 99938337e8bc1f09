"""Times of several methods in the same run, and a description of the machine."""

import importlib.metadata
import os
import platform
import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TypeVar

Result = TypeVar("Result")


@dataclass(frozen=True)
class Timing:
    """Times of repeated runs [s]."""

    runs: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.runs)

    @property
    def spread(self) -> float:
        """Half the range over the median."""
        return (max(self.runs) - min(self.runs)) / 2 / self.median


def side_by_side(methods: dict[str, Callable[[], object]], repeats: int) -> dict[str, Timing]:
    """Run every method once in each of `repeats` rounds, so that a disturbance affects all methods."""
    runs: dict[str, list[float]] = {name: [] for name in methods}
    for round_ in range(repeats):
        for name, method in methods.items():
            say(f"  round {round_ + 1} of {repeats}: {name}")
            begin = perf_counter()
            method()
            runs[name].append(perf_counter() - begin)
    return {name: Timing(tuple(times)) for name, times in runs.items()}


def timed(
    task: Callable[[], Result], repeats: int, clock: Callable[[], float] = perf_counter
) -> tuple[float, Result]:
    """Return the median time [s] of some runs after a warm-up run, and the result."""
    result, runs = task(), []
    for _ in range(repeats):
        begin = clock()
        result = task()
        runs.append(clock() - begin)
    return statistics.median(runs), result


def say(line: str) -> None:
    """Print progress on standard error."""
    print(line, file=sys.stderr, flush=True)


def processor() -> str:
    """Return the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def machine() -> str:
    """Return one line with the machine and the relevant versions."""
    names = ("closeform", "numpy", "numba", "scipy", "clarabel", "vbar", "bsk")
    versions = []
    for name in names:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            versions.append(f"no {name}")
    system = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
    return f"{processor()}, {cores()} cores, {system}, {', '.join(versions)}"
