"""Importance sampling of trajectories that enter a zone, sampled from the rate of entries."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.special import betaincinv

from closeform.arrays import Floats
from closeform.confidence import CONFIDENCE, DEVIATIONS
from closeform.uncertainty.collision.entry_rate import fill_entry_errors
from closeform.uncertainty.collision.expected_entries import Flux, Unresolved, pool, rules
from closeform.uncertainty.collision.sampled_trajectories import CORES, SampledTrajectories

SEEN = 5  # trajectories with repeated entries that suffice to estimate their reduction
FEW = 30  # number up to which the interval of Clopper and Pearson is used
PRECISION = 1e-3  # relative half-interval of the probability by default
COARSER = 0.5  # relative number of surface nodes in the pilot run
GRAZES = 1e-3  # share of entering trajectories that rounding may lose
# trajectories of the pilot run; minimum and maximum number of samples
TRIED, FEWEST, MOST = 4000, 8000, 100_000
SURE = 1.1  # safety factor on the number from the pilot run
FINELY = 8  # strata across the surface, and of speeds, if there are enough trajectories


def sufficient_samples(
    sampled: SampledTrajectories, flux: Flux, at_start: float, off: float, seed: int
) -> int:
    """Return the number of trajectories for a half-interval of `PRECISION` times the probability.

    An independent pilot run determines it, so that the interval stays valid. `off` is the quadrature error.
    """
    coarser = replace(flux, fineness=COARSER * flux.fineness)
    lost = repeated_shares(sampled.count(sample_entries(sampled, coarser, TRIED, seed, stream=1)))
    mean, low, high = interval_of_mean(lost)
    half = PRECISION * (at_start + flux.value * (1.0 - mean))
    wide = 0.5 * flux.value * (high - low) / max(half - off, 0.5 * half)
    return int(np.clip(SURE * TRIED * wide**2, FEWEST, MOST))


def strata(samples: int) -> tuple[Any, Any]:
    """Return the stratum of each sample, with two or a few per stratum, and the number of strata per axis.

    Strata are equal parts of all entries in time, across the surface and in speed.
    """
    side = min(FINELY, int(np.cbrt(samples / 4)))
    axes = samples // (2 * side * side), side, side
    return np.arange(samples) * int(np.prod(axes)) // samples, axes


def sample_entries(
    sampled: SampledTrajectories, flux: Flux, samples: int, seed: int, stream: int = 0
) -> Floats:
    """Return errors (samples, M) of trajectories that enter, sampled from the rate in all its strata."""
    random = np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, 0, stream]))
    shares = random.uniform(size=(samples, 3))
    errors = random.standard_normal((samples, len(sampled.columns)))
    stratum, axes = strata(samples)
    shares = (np.stack(np.unravel_index(stratum, axes), axis=1) + shares) / axes
    parts = flux.of_time.parts
    some = parts > 0.0
    times, parts = flux.of_time.times[some], parts[some]
    reached = np.concatenate([[0.0], np.cumsum(parts)])
    owner = np.minimum(np.searchsorted(reached[1:], shares[:, 0] * reached[-1], "right"), len(parts) - 1)
    rising = np.argsort(owner + shares[:, 1])  # in the order of nodes on the surface
    first = np.searchsorted(owner[rising], np.arange(len(parts) + 1))
    shares, errors = shares[rising, 1:], errors[rising]
    states, matrix = sampled.states(times), sampled.zone.matrix

    def some_times(some: slice) -> None:
        held = slice(first[some.start], first[min(some.stop, len(times))])
        mean, factor = (np.ascontiguousarray(one[some]) for one in states)
        from_zero = first[some.start : some.stop + 1] - first[some.start]
        fill_entry_errors(mean, factor, matrix, rules(), flux.fineness, from_zero, shares[held], errors[held])

    size = max(1, -(-len(times) // (4 * CORES)))
    list(pool().map(some_times, [slice(k, k + size) for k in range(0, len(times), size)]))
    out = np.empty_like(errors)
    out[rising] = errors
    return out


def repeated_shares(counts: Any) -> Floats:
    """Return the reduction of each drawn entry (began inside, entries) relative to one trajectory.

    theory (62). Raises Unresolved if rounding loses more entries than grazes.
    """
    if np.mean(counts[:, 1] == 0) > GRAZES:
        raise Unresolved
    entries = np.maximum(counts[:, 1], 1)  # a graze can be lost to rounding
    return np.where(counts[:, 0] > 0, 1.0, 1.0 - 1.0 / entries)


def interval_of_mean(lost: Floats) -> tuple[float, float, float]:
    """Return the mean and its interval of stratified samples in [0, 1]."""
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
    """Return the exact confidence interval of a share (Clopper and Pearson 1934), valid also for 0."""
    tail = 0.5 * (1.0 - CONFIDENCE)
    low = float(betaincinv(count, total - count + 1, tail)) if count > 0 else 0.0
    high = float(betaincinv(count + 1, total - count, 1.0 - tail)) if count < total else 1.0
    return low, high
