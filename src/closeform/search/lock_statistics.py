"""Statistics of a search: outcomes counted by phase, and the histogram of lock times."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.search.schedule import Search

AT_ONCE, NEVER = "at once", "never"
FINER = 12  # fine bins in a bin


def phase_labels(search: Search) -> tuple[str, ...]:
    """Return the labels that `count_by_phase` counts, in order."""
    return (AT_ONCE, *(f"{phase} {number}" for phase, number, *_ in search.phases), NEVER)


def count_by_phase(search: Search, time: Any, leg: Any) -> tuple[int, ...]:
    """Return the number of cases done at once, in each phase and never, from times (C,) [s] and legs (C,)."""
    index = phase_index(search, time, leg)
    return tuple(np.bincount(index, minlength=len(phase_labels(search))).tolist())


def phase_index(search: Search, time: Any, leg: Any) -> Any:
    """Return the index of the label (C,) under which each case ended."""
    phases = {f"{phase} {number}": k for k, (phase, number, *_) in enumerate(search.phases, 1)}
    never = len(phases) + 1
    row = np.array([phases[f"{one.phase} {one.round}"] for one in search.legs] + [never])[leg]
    return np.where(time == 0.0, 0, row)


@dataclass(eq=False)
class TimeHistogram:
    """Counts of `every` times: those equal to 0, and those in bins of length `bin` [s] and in finer ones.

    `inside`: the counts in each phase of a search; `last`: the largest time [s].
    """

    bin: float
    counts: Any
    finer: Any
    inside: Any
    every: int = 0
    at_once: int = 0
    last: float = 0.0

    @classmethod
    def of(cls, parts: Iterable[Floats], longest: float, search: Search | None, bin: float = 60.0) -> Self:
        """Count times [s] up to `longest` part after part; nan is not a time."""
        bins, phases = int(np.ceil(longest / bin)), search.phases if search is not None else ()
        edges, finer = bin * np.arange(bins + 1), bin / FINER * np.arange(FINER * bins + 1)
        ends = np.array([(start, end) for *_, start, end in phases]).reshape(-1, 2)
        sizes = bins, FINER * bins, len(phases)
        counts, finer_counts, inside = (np.zeros(size, dtype=np.int64) for size in sizes)
        one = cls(bin, counts, finer_counts, inside)
        for times in parts:
            later = np.sort(times[times > 0.0])
            one.counts += counted_in(later, edges)
            one.finer += counted_in(later, finer)
            one.inside += np.diff(np.searchsorted(later, ends, side="right"), axis=1).ravel()
            one.every += len(times)
            one.at_once += int(np.count_nonzero(times == 0.0))
            one.last = max(one.last, float(later[-1]) if len(later) else 0.0)
        return one

    @property
    def later(self) -> int:
        """Number of times above 0, without absent ones."""
        return int(self.counts.sum())


def counted_in(ordered: Floats, edges: Any) -> Any:
    """Return the number of sorted times in each bin; the last edge belongs to the last bin."""
    places = np.searchsorted(ordered, edges)
    places[-1] = len(ordered)
    return np.diff(places)
