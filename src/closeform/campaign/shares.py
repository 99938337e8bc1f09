"""Shares of a study's cases, each with its confidence interval."""

from collections.abc import Sequence
from dataclasses import dataclass

from closeform.confidence import Estimate, estimate
from closeform.search.phases import NEVER


@dataclass(frozen=True)
class Share:
    """How many `cases` ended in one phase, `inside` it as a share and by `by_end` of it, all before included.

    `label` is "at once" (at time 0), a phase and its round like "IPS 1", or "never".
    """

    label: str
    cases: int
    inside: Estimate
    by_end: Estimate | None  # None for "never"


def shares(names: Sequence[str], counts: Sequence[int]) -> tuple[Share, ...]:
    """The table of shares; the last row is those who never did."""
    total, ended, rows = sum(counts), 0, []
    for name, count in zip(names, counts, strict=True):
        ended += count
        by_end = None if name == NEVER else estimate(ended, total)
        rows.append(Share(name, count, estimate(count, total), by_end))
    return tuple(rows)
