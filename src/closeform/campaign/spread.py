"""Spread of a quantity over the cases of a study: mean, exact quantiles and largest values, from chunks.

A quantile is an order statistic. It is found without all values in memory: the bit patterns of non-negative
floats sort like the values. They are counted 16 bits at a time, and only values with a wanted prefix are
inspected further.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import ceil, floor
from typing import Any, NamedTuple, Self

import numpy as np

from closeform.arrays import Floats
from closeform.confidence import CONFIDENCE

QUANTILES = (0.5, 0.95, 0.999)
WORST = 10  # number of largest values that are kept
HELD = 1 << 20  # maximum number of values that are sorted in memory
DIGIT = 16  # number of bits counted in one pass
# chunk after chunk, values (K,) and the numbers of their cases
Values = Callable[[], Iterable[tuple[Floats, Any]]]


class Quantile(NamedTuple):
    """Quantile of a sample, and its 95 % confidence interval, None with too few values."""

    value: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Spread:
    """Mean of `count` values, `quantiles` by share, and the largest values with their cases, in order."""

    count: int
    mean: float
    quantiles: dict[float, Quantile]
    worst: tuple[tuple[float, int], ...]

    @classmethod
    def of(cls, values: Values, shares: Sequence[float] = QUANTILES) -> Self | None:
        """Return the spread of non-negative values, with quantiles by `shares`; None without values."""
        count, total, worst = 0, 0.0, list[tuple[float, int]]()
        for some, cases in values():
            count += len(some)
            total += float(some.sum())
            top = greatest(some)
            worst += zip(some[top].tolist(), cases[top].tolist(), strict=True)
            worst = sorted(worst, key=lambda row: (-row[0], row[1]))[:WORST]
        if not count:
            return None
        ranks = {share: ranks_of(share, count) for share in shares}
        wanted = {rank for some in ranks.values() for rank in some if rank is not None}
        found = order_statistics(values, count, wanted)
        return cls(
            count,
            total / count,
            {share: between(share, count, found, *some) for share, some in ranks.items()},
            tuple(worst),
        )


def greatest(values: Floats) -> Any:
    """Return the indices of the WORST largest values; of equal values, the first."""
    if len(values) <= WORST:
        return np.arange(len(values))
    least = np.partition(values, -WORST)[-WORST]
    above = np.flatnonzero(values > least)
    return np.concatenate([above, np.flatnonzero(values == least)[: WORST - len(above)]])


def ranks_of(share: float, count: int) -> tuple[int, int, int | None, int | None]:
    """Return the ranks around a quantile of `count` values, and those of its confidence interval."""
    from scipy.special import bdtr  # imported late: slow to import

    place, tail = share * (count - 1), (1.0 - CONFIDENCE) / 2.0
    # binomial confidence interval of the rank
    ranks = range(count)
    low = bisect_left(ranks, True, key=lambda k: bdtr(k, count, share) > tail)
    high = bisect_left(ranks, True, key=lambda k: bdtr(k, count, share) >= 1.0 - tail)
    return floor(place), ceil(place), low - 1 if low > 0 else None, high if high < count else None


def between(
    share: float, count: int, found: dict[int, float], below: int, above: int, *ends: int | None
) -> Quantile:
    """Return a quantile, interpolated linearly between two values, and its interval."""
    part = share * (count - 1) - below
    value = found[below] + part * (found[above] - found[below])
    return Quantile(value, *(None if rank is None else found[rank] for rank in ends))


@dataclass
class Window:
    """Values whose bits begin with `prefix`: the number of smaller values, and the wanted ranks."""

    prefix: int
    below: int
    size: int
    ranks: list[int]


def order_statistics(values: Values, count: int, ranks: set[int]) -> dict[int, float]:
    """Return the values at the given ranks, counted from 0, among `count` values in ascending order."""
    windows, shift, found = [Window(0, 0, count, sorted(ranks))], 64, dict[int, float]()
    while windows:
        many = [one for one in windows if one.size > HELD]
        counts = {one.prefix: np.zeros(1 << DIGIT, dtype=np.int64) for one in many}
        held: dict[int, list[Any]] = {one.prefix: [] for one in windows if one.size <= HELD}
        for some, _ in values():
            bits = (some + 0.0).view(np.uint64)
            for one in windows:
                inside = bits if shift == 64 else bits[bits >> np.uint64(shift) == np.uint64(one.prefix)]
                if one.prefix in held:
                    held[one.prefix].append(inside)
                else:
                    digits = inside >> np.uint64(shift - DIGIT) & np.uint64((1 << DIGIT) - 1)
                    counts[one.prefix] += np.bincount(digits.astype(np.int64), minlength=1 << DIGIT)
        for one in windows:
            if one.prefix in held:
                order = np.sort(np.concatenate(held[one.prefix]).view(np.float64))
                found |= {rank: float(order[rank - one.below]) for rank in one.ranks}
        shift -= DIGIT
        windows = [inner for one in many for inner in parted(one, counts[one.prefix])]
        if shift == 0:  # all bits are known
            for one in windows:
                value = float(np.array([one.prefix], dtype=np.uint64).view(np.float64)[0])
                found |= dict.fromkeys(one.ranks, value)
            break
    return found


def parted(window: Window, counts: Any) -> Iterator[Window]:
    """Yield the parts of a window, by the next digit, that contain a wanted rank."""
    ends = window.below + np.cumsum(counts)
    digits = np.searchsorted(ends, window.ranks, side="right")
    for digit in np.unique(digits).tolist():
        size = int(counts[digit])
        ranks = [rank for rank, its in zip(window.ranks, digits.tolist(), strict=True) if its == digit]
        yield Window(window.prefix << DIGIT | digit, int(ends[digit]) - size, size, ranks)
