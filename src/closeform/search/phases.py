"""Phases of a search, and the counts of outcomes by phase."""

from typing import Any

import numpy as np

from closeform.search.schedule import Search

AT_ONCE, NEVER = "at once", "never"


def labels(search: Search) -> tuple[str, ...]:
    """Return the labels that `tally` counts, in order."""
    return (AT_ONCE, *(f"{phase} {number}" for phase, number, *_ in search.phases), NEVER)


def tally(search: Search, time: Any, leg: Any) -> tuple[int, ...]:
    """Return how many cases are done at once, in each phase and never, from times (C,) [s] and legs (C,)."""
    ended = ended_in(search, time, leg)
    return tuple(np.bincount(ended, minlength=len(labels(search))).tolist())


def ended_in(search: Search, time: Any, leg: Any) -> Any:
    """Return the index of the label (C,) under which each case ended."""
    phases = {f"{phase} {number}": k for k, (phase, number, *_) in enumerate(search.phases, 1)}
    never = len(phases) + 1
    row = np.array([phases[f"{one.phase} {one.round}"] for one in search.legs] + [never])[leg]
    return np.where(time == 0.0, 0, row)
