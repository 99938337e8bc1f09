"""Shares of a study's cases, each with the interval that would hold the true one 19 times in 20."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import betaincinv

from closeform.search.schedule import Search

CONFIDENCE = 0.95
AT_ONCE, NEVER = "at once", "never"


@dataclass(frozen=True)
class Estimate:
    """A share of cases, and its 95 % confidence interval from `low` to `high`."""

    share: float
    low: float
    high: float


@dataclass(frozen=True)
class Share:
    """How many `cases` ended in one phase, `inside` it as a share and by `by_end` of it, all before included.

    `label` is "at once" (at time 0), a phase and its round like "IPS 1", or "never".
    """

    label: str
    cases: int
    inside: Estimate
    by_end: Estimate | None  # None for "never"


def estimate(count: int, total: int) -> Estimate:
    """A share with the exact interval of Clopper and Pearson (1934), which holds for 0 cases too."""
    tail = (1.0 - CONFIDENCE) / 2.0
    low = float(betaincinv(count, total - count + 1, tail)) if count > 0 else 0.0
    high = float(betaincinv(count + 1, total - count, 1.0 - tail)) if count < total else 1.0
    return Estimate(count / total, low, high)


def labels(search: Search) -> tuple[str, ...]:
    """What `counted` counts, in order."""
    return (AT_ONCE, *(f"{phase} {number}" for phase, number, *_ in search.phases), NEVER)


def counted(search: Search, time: Any, leg: Any) -> tuple[int, ...]:
    """How many cases ended at once, in each phase and never, from their times (C,) [s] and legs (C,)."""
    phases = {f"{phase} {number}": k for k, (phase, number, *_) in enumerate(search.phases, 1)}
    never = len(phases) + 1
    row = np.array([phases[f"{one.phase} {one.round}"] for one in search.legs] + [never])[leg]
    return tuple(np.bincount(np.where(time == 0.0, 0, row), minlength=never + 1).tolist())


def shares(names: Sequence[str], counts: Sequence[int]) -> tuple[Share, ...]:
    """The table of shares; the last row is those who never did."""
    total, ended, rows = sum(counts), 0, []
    for name, count in zip(names, counts, strict=True):
        ended += count
        by_end = None if name == NEVER else estimate(ended, total)
        rows.append(Share(name, count, estimate(count, total), by_end))
    return tuple(rows)
