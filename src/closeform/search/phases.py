"""Phases: in which of a search's phases things ended."""

from typing import Any

import numpy as np

from closeform.search.schedule import Search

AT_ONCE, NEVER = "at once", "never"


def labels(search: Search) -> tuple[str, ...]:
    """What `tally` counts, in order."""
    return (AT_ONCE, *(f"{phase} {number}" for phase, number, *_ in search.phases), NEVER)


def tally(search: Search, time: Any, leg: Any) -> tuple[int, ...]:
    """How many ended at once, in each phase and never, from their times (C,) [s] and legs (C,)."""
    phases = {f"{phase} {number}": k for k, (phase, number, *_) in enumerate(search.phases, 1)}
    never = len(phases) + 1
    row = np.array([phases[f"{one.phase} {one.round}"] for one in search.legs] + [never])[leg]
    return tuple(np.bincount(np.where(time == 0.0, 0, row), minlength=never + 1).tolist())
