"""Expected number of entries of a random motion into a zone: the rate integrated over time."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.quadrature import GAUSS, KRONROD, NODES
from closeform.uncertainty.collision.entry_rate import surface_integrals
from closeform.uncertainty.collision.sampled_trajectories import CORES, SampledTrajectories

TOLERANCE = 1e-4  # relative tolerance of the integral over time
ROUND = 1e-4  # relative tolerance of a rate over the surface
FINENESS = (1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0)  # factors on the number of nodes on the surface
MOST = 96  # maximum number of nodes in height, or along an arc
ZOOMS = 10  # refinements of the time of a passage, each to a quarter
SAMPLES = 128  # samples in an orbit (or a piece, in deep space) for the closest times
LADDER = np.array([-10.0, -3.0, -1.0, 0.0, 1.0, 3.0, 10.0])  # in units of the width of a passage
NEAR = 60.0  # squared distance in deviations above the least: passages that count
SURE = 6.0  # deviations: a closer approach must have some rate of entries
FADED = 10.0  # deviations, in squares, beyond those of the largest rate: rates are 1e-21 of it
QUARTERS = np.array([0.125, 0.375, 0.625, 0.875])  # initial samples of a piece of time
CHECKED = 24  # times at which a rate is compared with one from more nodes
# 7-point Gauss and 15-point Kronrod rules
PLACES = np.array([*(-p for p in NODES[:-1]), *NODES[::-1]])
WEIGHTS, LESS = (np.array([*half[:-1], *half[::-1]]) for half in (KRONROD, GAUSS))
ROUNDS = 48
ROUGH = 3.0  # times the tolerance: a piece with a smaller relative error is not divided
PIECES = 4000  # maximum number of pieces


class Unresolved(ValueError):
    """Errors for which the rate of entries over the zone's surface cannot be computed."""

    def __init__(self) -> None:
        super().__init__(
            "errors: too small relative to the zone, or too nearly singular, to resolve its surface; "
            'use method="monte-carlo"'
        )


@dataclass(frozen=True, eq=False)
class Flux:
    """Expected entries from the start onward: their number, its error, and their distribution in time.

    `of_time` holds the sampled times, with the rate and the part of all entries at each. `nearest` [s] are
    the times at which the mean is closest to the zone, the closest first.
    """

    value: float
    error: float
    of_time: Integral
    fineness: float
    nearest: Floats


@cache
def rules() -> Floats:
    """Return Gauss's nodes in (-1, 1) and weights (MOST + 1, MOST, 2), a rule for each number of nodes."""
    out = np.zeros((MOST + 1, MOST, 2))
    for k in range(1, MOST + 1):
        out[k, :k] = np.stack(np.polynomial.legendre.leggauss(k), axis=1)
    return out


@cache
def pool() -> ThreadPoolExecutor:
    """Return the thread pool for all cores."""
    return ThreadPoolExecutor(CORES)


def entry_rates(
    sampled: SampledTrajectories, times: Floats, fineness: float, farthest: float = np.inf
) -> Floats:
    """Return the rate of entries and the mean's distance in deviations (T, 2) at given times, on all cores.

    The rate is 0 beyond the `farthest` distance.
    """
    mean, factor = sampled.states(times)
    out = np.empty((len(times), 2))

    def some(part: slice) -> None:
        surface_integrals(
            mean[part], factor[part], sampled.zone.matrix, rules(), fineness, farthest, out[part]
        )

    size = max(24, -(-len(times) // (4 * CORES)))
    parts = [slice(k, k + size) for k in range(0, len(times), size)]
    if len(parts) == 1:
        some(parts[0])
    else:
        list(pool().map(some, parts))
    return out


def nearest_times(sampled: SampledTrajectories) -> tuple[Floats, Floats]:
    """Return the times at which the mean is closest to the zone, in deviations, and the distances.

    The times are all local minima that contribute to the integral.
    """
    times = sampled.spread(SAMPLES)
    distances = entry_rates(sampled, times, 0.0)[:, 1]
    if not np.isfinite(distances).all():
        raise Unresolved
    around = np.concatenate([[np.inf], distances, [np.inf]])
    least = (distances <= around[:-2]) & (distances <= around[2:])
    (low,) = np.nonzero(least & ((distances > 0.0) | (around[:-2] > 0.0) | (around[2:] > 0.0)))
    before, after = times[np.maximum(low - 1, 0)], times[np.minimum(low + 1, len(times) - 1)]
    for _ in range(ZOOMS):
        inner = before + (after - before) * np.linspace(0.0, 1.0, 9)[:, None]
        found = entry_rates(sampled, inner.ravel(), 0.0)[:, 1].reshape(inner.shape)
        place, each = found.argmin(axis=0), np.arange(len(low))
        before, after = inner[np.maximum(place - 1, 0), each], inner[np.minimum(place + 1, 8), each]
    best = np.concatenate([times[low], 0.5 * (before + after)])
    reached = entry_rates(sampled, best, 0.0)[:, 1]
    counts = reached**2 <= reached.min() ** 2 + NEAR
    return best[counts], reached[counts]


def passage_edges(sampled: SampledTrajectories, nearest: Floats) -> Floats:
    """Return times between which the rate varies slowly, around each of the closest times."""
    mean, factor = sampled.states(nearest)
    matrix = sampled.zone.matrix
    velocity = mean[:, 3:] @ matrix.T
    speed = np.linalg.norm(velocity, axis=1)
    spread = np.linalg.norm(matrix @ factor[:, :3], axis=(1, 2))
    with np.errstate(divide="ignore"):
        width = (1.0 + spread) / speed
    start, end = sampled.edges[0], sampled.edges[-1]
    width = np.minimum(width, end - start)
    even = sampled.path.orbit._spread(start, end, 4.0, 5)
    about = (nearest[:, None] + width[:, None] * LADDER).ravel()
    about = about[(about > start) & (about < end)]
    return np.unique(np.concatenate([sampled.edges, even, about]))


def expected_entries(sampled: SampledTrajectories) -> Flux:
    """Integrate the rate over time, with as many nodes on the surface as its largest values require.

    Raises Unresolved if the rate cannot be computed.
    """
    nearest, distances = nearest_times(sampled)
    order = np.argsort(distances, kind="stable")
    edges = passage_edges(sampled, nearest)
    widths = np.diff(edges)
    times = (edges[:-1, None] + widths[:, None] * QUARTERS).ravel()
    rate, distance = entry_rates(sampled, np.concatenate([times, nearest]), FINENESS[0]).T
    some = _sampled(rate[: len(times)] * np.repeat(widths, len(QUARTERS)))
    level, off = _sufficient_level(sampled, times[some], rate[some], 0)
    farthest = float(np.hypot(distance[rate.argmax()], FADED)) if rate.any() else np.inf
    while True:
        fineness = FINENESS[level]
        flux = integral(partial(_rate_at, sampled, fineness, farthest), edges, TOLERANCE)
        if not np.isfinite(flux.value):
            raise Unresolved
        if flux.value == 0.0:
            return Flux(0.0, float(distances.min() < SURE), flux, fineness, nearest[order])
        some = _sampled(flux.parts)
        finer, off = _sufficient_level(sampled, flux.times[some], flux.values[some], level)
        if finer == level:
            return Flux(flux.value, flux.error + off * flux.value, flux, fineness, nearest[order])
        level = finer


def _sampled(parts: Floats) -> Any:
    """Return the indices of `CHECKED` times, each for an equal part of the sum."""
    reached = np.cumsum(parts)
    return np.searchsorted(reached, (np.arange(CHECKED) + 0.5) / CHECKED * reached[-1])


def _rate_at(sampled: SampledTrajectories, fineness: float, farthest: float, times: Floats) -> Floats:
    """Return the rate of entries at given times."""
    return entry_rates(sampled, times, fineness, farthest)[:, 0]


def _sufficient_level(
    sampled: SampledTrajectories, times: Floats, few: Floats, level: int
) -> tuple[int, float]:
    """Return the first level at which more nodes hardly change the rates, and the relative change.

    `few` are the rates at the given level.
    """
    while True:
        many = entry_rates(sampled, times, FINENESS[level + 1])[:, 0]
        off = float(np.abs(many - few).sum() / many.sum()) if many.any() else 0.0
        if off <= ROUND or level + 2 == len(FINENESS):
            return level, off
        level, few = level + 1, many


@dataclass(frozen=True, eq=False)
class Integral:
    """Integral of a non-negative function, and its error.

    `times` and `values` (K,) are the final samples of the integrand; `parts` are values times weights, whose
    sum is the integral.
    """

    value: float
    error: float
    times: Floats
    values: Floats
    parts: Floats


def integral(function: Callable[[Floats], Floats], edges: Floats, tolerance: float) -> Integral:
    """Integrate from the first edge to the last, to a relative tolerance, by halving pieces."""
    low, high = np.array(edges[:-1]), np.array(edges[1:])
    done = _rule(function, low, high)
    for _ in range(ROUNDS):
        *_, sums, errors = done
        allowed = tolerance * sums.sum()
        if not errors.sum() > allowed or len(sums) > PIECES:
            break
        # divide the worst pieces, so that the others together are within half of the allowed error
        order = np.argsort(errors)
        wide = (high - low > 1e-13 * (np.abs(high) + np.abs(low))) & (errors > ROUGH * tolerance * sums)
        worst = np.zeros(len(sums), dtype=bool)
        worst[order[np.cumsum(errors[order]) > 0.5 * allowed]] = True
        worst &= wide
        if not worst.any():
            break
        middle = 0.5 * (low[worst] + high[worst])
        new = np.concatenate([low[worst], middle]), np.concatenate([middle, high[worst]])
        halves = _rule(function, *new)
        low, high = np.concatenate([low[~worst], new[0]]), np.concatenate([high[~worst], new[1]])
        done = tuple(np.concatenate([a[~worst], b]) for a, b in zip(done, halves, strict=True))
    times, values, sums, errors = done
    order = np.argsort(low)
    parts = values * WEIGHTS * (0.5 * (high - low))[:, None]
    return Integral(
        float(sums.sum()),
        float(errors.sum()),
        times[order].ravel(),
        values[order].ravel(),
        parts[order].ravel(),
    )


def _rule(function: Callable[[Floats], Floats], low: Floats, high: Floats) -> tuple[Floats, ...]:
    """Return nodes and values (P, 15), sums (P,) and errors (P,) of pieces, as QUADPACK's qk15."""
    half = 0.5 * (high - low)
    times = 0.5 * (low + high)[:, None] + half[:, None] * PLACES
    values = function(times.ravel()).reshape(times.shape)
    sums = half * (values @ WEIGHTS)
    gap = half * np.abs(values @ (WEIGHTS - LESS))
    mean = (values @ WEIGHTS) / 2.0
    swing = half * (np.abs(values - mean[:, None]) @ WEIGHTS)
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = np.where(swing > 0.0, swing * np.minimum(1.0, (200.0 * gap / swing) ** 1.5), gap)
    return times, values, sums, errors
