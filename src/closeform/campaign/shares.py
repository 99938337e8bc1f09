"""Shares of a study's cases, each with the interval that would hold the true one 19 times in 20."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

from scipy.special import ndtri

from closeform.search.phases import NEVER

CONFIDENCE = 0.95
DEVIATIONS = float(ndtri(0.5 + 0.5 * CONFIDENCE))


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
    """A share with the interval of Wilson (1927), which holds for 0 cases too."""
    share, turn = count / total, DEVIATIONS**2 / total
    middle = (share + 0.5 * turn) / (1.0 + turn)
    half = sqrt(turn * (share * (1.0 - share) + 0.25 * turn)) / (1.0 + turn)
    return Estimate(share, middle - half if count > 0 else 0.0, middle + half if count < total else 1.0)


def shares(names: Sequence[str], counts: Sequence[int]) -> tuple[Share, ...]:
    """The table of shares; the last row is those who never did."""
    total, ended, rows = sum(counts), 0, []
    for name, count in zip(names, counts, strict=True):
        ended += count
        by_end = None if name == NEVER else estimate(ended, total)
        rows.append(Share(name, count, estimate(count, total), by_end))
    return tuple(rows)
