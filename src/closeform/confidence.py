"""Confidence intervals of a share that was counted in samples."""

from dataclasses import dataclass
from math import sqrt

CONFIDENCE = 0.95
DEVIATIONS = 1.959963984540054  # standard deviations of a normal distribution for this confidence


@dataclass(frozen=True)
class Estimate:
    """A fraction of cases, and its 95 % confidence interval from `low` to `high`."""

    share: float
    low: float
    high: float

    def __str__(self) -> str:
        low, high = (float(f"{100 * one:.2g}") for one in (self.low, self.high))
        return f"95 % between {low:g} and {high:g} %"


def estimate(count: int, total: int) -> Estimate:
    """Return a share with its Wilson (1927) interval, which also holds for 0 cases."""
    share, turn = count / total, DEVIATIONS**2 / total
    middle = (share + 0.5 * turn) / (1.0 + turn)
    half = sqrt(turn * (share * (1.0 - share) + 0.25 * turn)) / (1.0 + turn)
    return Estimate(share, middle - half if count > 0 else 0.0, middle + half if count < total else 1.0)
