"""Shares of a study's cases by phase, each with its confidence interval."""

from collections.abc import Sequence
from dataclasses import dataclass

from closeform.confidence import Estimate, estimate
from closeform.search.phases import NEVER


@dataclass(frozen=True)
class Share:
    """Number of `cases` that ended in one phase, as a share `inside` it and, cumulatively, `by_end` of it.

    `label` is "at once" (at time 0), a phase and its round like "IPS 1", or "never".
    """

    label: str
    cases: int
    inside: Estimate
    by_end: Estimate | None  # None for "never"


def shares(names: Sequence[str], counts: Sequence[int]) -> tuple[Share, ...]:
    """Return the table of shares; its last row counts the cases that were never done."""
    total, ended, rows = sum(counts), 0, []
    for name, count in zip(names, counts, strict=True):
        ended += count
        by_end = None if name == NEVER else estimate(ended, total)
        rows.append(Share(name, count, estimate(count, total), by_end))
    return tuple(rows)
