"""Histories of a single error, or of none: exactly, as a line that each history is a point of.

Where all that is uncertain is one number xi, histories at a time t are the line m(t) + xi c(t), and those
inside a ball are an interval of xi.  Over time intervals begin, move and end: who is ever inside is in
their union, and who enters is what an interval begins with and what its ends move outward over.

          xi |      ____hi
             |   __/    \\____        entries: from `first` on upward along hi, downward along lo
             |  (first        )
             |   \\__lo_____/
             +--------------------- t
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr

from closeform.arrays import Floats
from closeform.uncertainty.histories import Histories

SAMPLES = 512  # times an orbit (or a piece, in deep space), between which a line may come and go unseen
ROUNDS = 12  # each looks between neighbours of what counts, at SPLIT times
SPLIT = 8
STEP = 1e-10  # deviations, by which an interval's end may turn unseen
NOTHING = 1e-9  # of the zone: an error that moves craft less is none
THIN = 1e-7, 1e-6  # of the greatest, and of the zone: what 16 digits of a covariance leave across a line


@dataclass(frozen=True, eq=False)
class SingleError:
    """Probability to be inside at the start, to be ever inside, and how many entries are expected."""

    at_start: float
    ever: float
    entries: float

    @classmethod
    def of(cls, histories: Histories, along: Floats) -> SingleError:
        """Of errors along a direction (M,) of length 1, or nil of no errors."""
        times = _grid(histories)
        for _ in range(ROUNDS):
            near, low, high, _ = _intervals(histories, along, times)
            times = _finer(times, near, low, high)
        _, low, high, columns = _intervals(histories, along, times)
        met, goes = low <= high, _goes_on(low, high, columns)
        at_start = float(_between(low[0], high[0])) if met[0] else 0.0
        lowest, highest = np.minimum(low[1:], low[:-1])[goes], np.maximum(high[1:], high[:-1])[goes]
        swept = np.concatenate([low[met], lowest]), np.concatenate([high[met], highest])
        return cls(at_start, _union(*swept), _entries(low, high, goes))


def single_direction(histories: Histories) -> Floats | None:
    """The direction (M,) of all errors where they are along one, nil where there are none; None of others."""
    _, factor = histories.states(_grid(histories))
    moved = np.einsum("ij,tjm->tim", histories.zone.matrix, factor[:, :3]).reshape(-1, factor.shape[2])
    _, sizes, directions = np.linalg.svd(moved / np.sqrt(len(factor)), full_matrices=False)
    if sizes[0] <= NOTHING:
        return np.zeros(factor.shape[2])
    if len(sizes) > 1 and sizes[1] > max(NOTHING, min(THIN[0] * sizes[0], THIN[1])):
        return None
    return np.asarray(directions[0])


def _grid(histories: Histories) -> Floats:
    """Times among which a line's approaches to the zone are looked for."""
    n = histories.mean_motion
    grid = []
    for begin, end in zip(histories.edges[:-1], histories.edges[1:], strict=True):
        turns = n * (end - begin) / (2.0 * np.pi) if n else 1.0
        grid.append(np.linspace(begin, end, int(np.ceil(SAMPLES * turns)) + 9))
    return np.unique(np.concatenate(grid))


def _intervals(histories: Histories, along: Floats, times: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """How near each line (T,) comes, above 0 inside; between which xi it is inside, or inf and -inf.

    And where each leads with xi (T, 3).
    """
    mean, factor = histories.states(times)
    matrix = histories.zone.matrix
    middle, column = mean[:, :3] @ matrix.T, (factor[:, :3] @ along) @ matrix.T
    a, b = (column**2).sum(axis=1), (middle * column).sum(axis=1)
    g = (middle**2).sum(axis=1) - 1.0
    moves = a > 0.0
    nearest = middle - np.divide(b, a, out=np.zeros_like(b), where=moves)[:, None] * column
    near = 1.0 - (nearest**2).sum(axis=1)
    low, high = np.full(len(times), np.inf), np.full(len(times), -np.inf)
    always = ~moves & (g <= 0.0)
    low[always], high[always] = -np.inf, np.inf
    met = moves & (near >= 0.0)
    a, b, near_met = a[met], b[met], near[met]
    half = np.sqrt(near_met / a)
    low[met], high[met] = -b / a - half, -b / a + half
    return near, low, high, column


def _goes_on(low: Floats, high: Floats, columns: Floats) -> Any:
    """From which times to the next (T - 1,) an interval moves: fast ones over all that is in between.

    Not where what leads along the line turns round: there one leaves by infinity, and another comes by it.
    """
    met = low <= high
    turns = (columns[1:] * columns[:-1]).sum(axis=1) < 0.0
    apart = np.maximum(low[1:], low[:-1]) > np.minimum(high[1:], high[:-1])
    return met[1:] & met[:-1] & ~(turns & apart)


def _finer(times: Floats, near: Floats, low: Floats, high: Floats) -> Floats:
    """More times where a line comes or goes, may come in between, or an interval's end turns."""
    met = low <= high
    counts = np.zeros(len(times), dtype=bool)
    counts[1:] |= met[1:] != met[:-1]
    counts[:-1] |= met[1:] != met[:-1]
    back, on = _steps(near)
    counts[1:-1] |= ~met[1:-1] & (back >= 0.0) & (on <= 0.0) & (near[1:-1] + np.maximum(back, -on) >= 0.0)
    with np.errstate(invalid="ignore"):  # an interval without an end has no step
        for ends in (low, high):
            back, on = _steps(ends)
            smooth = 1.0 + np.abs(ends[1:-1])
            counts[1:-1] |= met[1:-1] & (back * on < 0.0) & (np.maximum(abs(back), abs(on)) > STEP * smooth)
    (place,) = np.nonzero(counts)
    before, after = times[np.maximum(place - 1, 0)], times[np.minimum(place + 1, len(times) - 1)]
    wide = after - before > 1e-13 * (times[-1] - times[0])
    inner = before[wide] + (after - before)[wide] * np.linspace(0.0, 1.0, SPLIT + 2)[1:-1, None]
    return np.unique(np.concatenate([times, inner.ravel()]))


def _steps(values: Floats) -> tuple[Floats, Floats]:
    """From those before and to those after, of all but the first and the last."""
    with np.errstate(invalid="ignore"):
        step = np.diff(values)
    return step[:-1], step[1:]


def _between(low: Any, high: Any) -> Any:
    """Probability of a standard normal number between two, by its smaller tail, which keeps its digits."""
    side = np.where(low > 0.0, -1.0, 1.0)
    return np.abs(ndtr(side * high) - ndtr(side * low))


def _union(low: Floats, high: Floats) -> float:
    """Probability of the union of intervals."""
    order = np.argsort(low)
    low, high = low[order], high[order]
    reached = np.maximum.accumulate(high)
    first = np.concatenate([[True], low[1:] > reached[:-1]])[: len(low)]
    last = np.concatenate([first[1:], [True]])[: len(low)]
    return float(_between(low[first], reached[last]).sum())


def _entries(low: Floats, high: Floats, goes: Any) -> float:
    """Entries after the start: what intervals begin with, and what their ends move outward over."""
    begins = (low <= high)[1:] & ~goes
    out = _between(low[1:][begins], high[1:][begins]).sum()
    lower, before = low[1:][goes], low[:-1][goes]
    out += _between(lower, before)[lower < before].sum()
    upper, before = high[1:][goes], high[:-1][goes]
    out += _between(before, upper)[upper > before].sum()
    return float(out)
