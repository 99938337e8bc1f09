"""Confidence: the interval of a share that was counted, which would hold the true one 19 times in 20."""

from dataclasses import dataclass
from math import sqrt

CONFIDENCE = 0.95
DEVIATIONS = 1.959963984540054  # between which a normal number lies as often


@dataclass(frozen=True)
class Estimate:
    """A share of cases, and its 95 % confidence interval from `low` to `high`."""

    share: float
    low: float
    high: float

    def __str__(self) -> str:
        low, high = (float(f"{100 * one:.2g}") for one in (self.low, self.high))
        return f"95 % between {low:g} and {high:g} %"


def estimate(count: int, total: int) -> Estimate:
    """A share with the interval of Wilson (1927), which holds for 0 cases too."""
    share, turn = count / total, DEVIATIONS**2 / total
    middle = (share + 0.5 * turn) / (1.0 + turn)
    half = sqrt(turn * (share * (1.0 - share) + 0.25 * turn)) / (1.0 + turn)
    return Estimate(share, middle - half if count > 0 else 0.0, middle + half if count < total else 1.0)
