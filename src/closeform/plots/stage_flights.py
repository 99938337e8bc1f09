"""Consecutive stages of a mission: their paths, pairs, impulses and closest approaches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from closeform.arrays import Floats, number, sequence, shown, whole
from closeform.motion.arc import IMPULSE, START
from closeform.motion.path import Path
from closeform.plots.inputs import one_path, texts
from closeform.plots.pairs import Pairs
from closeform.plots.style import instants

CLOSEST, LOOKS = 300, 500  # maximum number of pairs evaluated, and of sample times per stage
SAME = 1e-9  # of the total duration: overlap of stages allowed for rounding

Lock = tuple[float, int, int]


@dataclass(frozen=True, eq=False)
class StageFlight:
    """One stage: its paths, sample `times` (T,) [s] for smooth curves, and its pairs."""

    title: str
    paths: Path
    times: Floats
    pairs: Pairs

    @property
    def start(self) -> float:
        """Start time [s]."""
        return float(self.times[0])

    @property
    def end(self) -> float:
        """End time [s]."""
        return float(self.times[-1])

    @property
    def least(self) -> float:
        """Minimum clearance ratio of any pair; inf if there is none."""
        return float(self.pairs.ratio.min(initial=np.inf))

    def nearness(self) -> tuple[Floats, Floats]:
        """Return times (T,) [s], and the minimum clearance ratio of any pair at each."""
        shown = self.pairs.order[:CLOSEST]
        sparse = self.times[:: -(-len(self.times) // LOOKS)]
        times = np.union1d(np.append(sparse, self.end), self.pairs.time[shown])
        places = self.paths.position(times)
        least = np.full(len(times), np.inf)
        for zone in {id(self.pairs.zone[k]): self.pairs.zone[k] for k in shown}.values():
            one, other = self.pairs.craft[[k for k in shown if self.pairs.zone[k] is zone]].T
            least = np.minimum(least, zone._norm(places[one] - places[other]).min(axis=0))
        return times, least


def asked(stages: Any, zone: Any, titles: Any) -> list[StageFlight]:
    """Return the checked stages, each with its pairs."""
    paths = sequence("stages", stages, Path)
    if not paths:
        raise ValueError("stages: give at least one path")
    first = one_path("stages", paths[0])
    alike = all(
        path.shape == first.shape and path.orbit.mean_motion == first.orbit.mean_motion for path in paths
    )
    if len(first.shape) != 1 or not alike:
        raise ValueError(
            f"stages: must be of one orbit and one shape (N,), got {[one.shape for one in paths]}"
        )
    numbers = [str(number) for number in range(1, len(paths) + 1)]
    words = numbers if titles is None else texts("titles", titles, len(paths), "stages")
    flights: list[StageFlight] = []
    for title, path in zip(words, paths, strict=True):
        times = instants(float(np.max(path.start)), float(np.min(path.end)), path)
        if flights and times[0] < flights[-1].end - SAME * (times[-1] - flights[0].start):
            raise ValueError(
                f"stages: {title} begins at {times[0]:g} s, before {flights[-1].title} has ended"
            )
        flights.append(StageFlight(title, path, times, Pairs.of(path, zone, name="zone")))
    return flights


def pairs_found(locks: Any, count: int) -> list[Lock]:
    """Return the checked locks of `count` spacecraft."""
    found = []
    for lock in sequence("locks", locks, tuple):
        if len(lock) != 3:
            raise ValueError(f"locks: expected (time, craft, craft), got {shown(lock)}")
        time = number("locks", lock[0])
        one, other = (whole("locks", craft, 0) for craft in lock[1:])
        if max(one, other) >= count:
            raise ValueError(f"locks: there is no craft {max(one, other)}, of {count}")
        found.append((time, one, other))
    return found


def impulses(paths: Path) -> tuple[Floats, Any, Floats]:
    """Return times (K,) [s], spacecraft indices (K,) and sizes (K,) [m/s] of the impulses of a batch."""
    sizes = np.linalg.norm(paths.arcs[:, IMPULSE : IMPULSE + 3], axis=1)
    there = np.flatnonzero(sizes)
    who = np.repeat(np.arange(len(paths)), np.diff(paths.offsets))[there]
    return paths.arcs[there, START], who, sizes[there]
