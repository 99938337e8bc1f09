"""Histories that enter a zone, drawn from their rate: what each counts, and how many of them are enough."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.special import betaincinv

from closeform.arrays import Floats
from closeform.confidence import CONFIDENCE, DEVIATIONS
from closeform.uncertainty.entry_rate import draw_entries
from closeform.uncertainty.mean_entries import Flux, Unresolved, pool, rules
from closeform.uncertainty.sampled_trajectories import CORES, Histories

SEEN = 5  # histories that tell how much each of them counts less; none counts less than nothing
FEW = 30  # histories, up to which their share is told by the interval of Clopper and Pearson
PRECISION = 1e-3  # of a probability, half of its interval, where nobody says how many histories
COARSER = 0.5  # nodes on the surface, from which those are drawn that tell how many are enough
GRAZES = 1e-3  # of histories that enter, lost to rounding
TRIED, FEWEST, MOST = 4000, 8000, 100_000  # histories that tell how many are enough; how many these may be
SURE = 1.1  # times as many as the tried ones tell
FINELY = 8  # strata across the surface, and as many of speeds, where there are histories enough


def enough(histories: Histories, flux: Flux, at_start: float, off: float, seed: int) -> int:
    """How many histories make half of the interval `PRECISION` of the probability.

    Others tell that, which are not counted: a number that depends on nothing counted leaves intervals as
    they are.  `off` is what quadrature takes of the interval.
    """
    coarser = replace(flux, fineness=COARSER * flux.fineness)
    lost = lost_of(histories.counted(drawn(histories, coarser, TRIED, seed, stream=1)))
    mean, low, high = interval_of_mean(lost)
    half = PRECISION * (at_start + flux.value * (1.0 - mean))
    wide = 0.5 * flux.value * (high - low) / max(half - off, 0.5 * half)
    return int(np.clip(SURE * TRIED * wide**2, FEWEST, MOST))


def strata(samples: int) -> tuple[Any, Any]:
    """In which stratum each of the samples is, two or a few in each, and how many there are along each axis.

    Strata cut up equal parts of all entries: in time, across the surface and in speed.
    """
    side = min(FINELY, int(np.cbrt(samples / 4)))
    axes = samples // (2 * side * side), side, side
    return np.arange(samples) * int(np.prod(axes)) // samples, axes


def drawn(histories: Histories, flux: Flux, samples: int, seed: int, stream: int = 0) -> Floats:
    """Errors (samples, M) of histories that enter, drawn from the rate; some in each of its strata."""
    random = np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, 0, stream]))
    shares = random.uniform(size=(samples, 3))
    errors = random.standard_normal((samples, len(histories.columns)))
    stratum, axes = strata(samples)
    shares = (np.stack(np.unravel_index(stratum, axes), axis=1) + shares) / axes
    parts = flux.of_time.parts
    some = parts > 0.0
    times, parts = flux.of_time.times[some], parts[some]
    reached = np.concatenate([[0.0], np.cumsum(parts)])
    owner = np.minimum(np.searchsorted(reached[1:], shares[:, 0] * reached[-1], "right"), len(parts) - 1)
    rising = np.argsort(owner + shares[:, 1])  # as places on the surface are looked for
    first = np.searchsorted(owner[rising], np.arange(len(parts) + 1))
    shares, errors = shares[rising, 1:], errors[rising]
    states, matrix = histories.states(times), histories.zone.matrix

    def some_times(some: slice) -> None:
        held = slice(first[some.start], first[min(some.stop, len(times))])
        mean, factor = (np.ascontiguousarray(one[some]) for one in states)
        from_zero = first[some.start : some.stop + 1] - first[some.start]
        draw_entries(mean, factor, matrix, rules(), flux.fineness, from_zero, shares[held], errors[held])

    size = max(1, -(-len(times) // (4 * CORES)))
    list(pool().map(some_times, [slice(k, k + size) for k in range(0, len(times), size)]))
    out = np.empty_like(errors)
    out[rising] = errors
    return out


def lost_of(counts: Any) -> Floats:
    """What each drawn entry (began inside, entries) counts less than one history.  # theory (62)

    Raises Unresolved where more than grazes are lost, of histories that all enter.
    """
    if np.mean(counts[:, 1] == 0) > GRAZES:
        raise Unresolved
    entries = np.maximum(counts[:, 1], 1)  # a graze can be lost to rounding
    return np.where(counts[:, 0] > 0, 1.0, 1.0 - 1.0 / entries)


def interval_of_mean(lost: Floats) -> tuple[float, float, float]:
    """Of numbers from 0 to 1, some from each of the strata, the mean and its interval."""
    stratum, _ = strata(len(lost))
    sizes = np.bincount(stratum)
    means = np.bincount(stratum, lost) / sizes
    mean, count = float(means.mean()), int((lost > 0.0).sum())
    if count <= FEW:
        low, high = clopper_pearson(count, len(lost))
        each = mean * len(lost) / max(count, 1)
        return mean, low * each, high * (each if count >= SEEN else 1.0)
    squares = np.bincount(stratum, (lost - means[stratum]) ** 2)
    deviation = float(np.sqrt((squares / (sizes * (sizes - 1))).sum())) / len(sizes)
    half = DEVIATIONS * deviation
    return mean, mean - half, mean + half


def clopper_pearson(count: int, total: int) -> tuple[float, float]:
    """The exact interval of a share (Clopper and Pearson 1934), which holds for 0 too."""
    tail = 0.5 * (1.0 - CONFIDENCE)
    low = float(betaincinv(count, total - count + 1, tail)) if count > 0 else 0.0
    high = float(betaincinv(count + 1, total - count, 1.0 - tail)) if count < total else 1.0
    return low, high
