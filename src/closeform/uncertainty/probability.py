"""Collision probability over a time span, with an interval that includes all errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from closeform.arrays import Floats, shown, whole
from closeform.motion.path import Path
from closeform.result import Result, Rows
from closeform.uncertainty.collision.entry_sampling import (
    clopper_pearson,
    interval_of_mean,
    repeated_shares,
    sample_entries,
    sufficient_samples,
)
from closeform.uncertainty.collision.expected_entries import Flux, Unresolved, expected_entries
from closeform.uncertainty.collision.low_rank import LowRankProbability, low_rank_directions
from closeform.uncertainty.collision.sampled_trajectories import (
    SampledTrajectories,
    noise_step,
    relative_errors,
)
from closeform.uncertainty.collision.short_encounter import passes_through, probability_inside
from closeform.uncertainty.errors import Uncertainty
from closeform.zones.shapes import BALL
from closeform.zones.zone import Zone

LEAST = 100  # samples
SAMPLES = 40_000  # default number of Monte Carlo samples
PASSAGES = 8  # closest passages at which a bound evaluates the probability to be inside
UNRESOLVED = 0.05  # largest relative quadrature error of a probability
Method = Literal["entries", "bound", "monte-carlo", "short-encounter"]
METHODS = ("entries", "bound", "monte-carlo", "short-encounter")
NONE = np.empty(0)


@dataclass(frozen=True, eq=False, repr=False)
class Probability(Rows):
    """Probability that two craft enter a zone; returned by `collision_probability`.

    `value` counts trajectories that are ever inside, however often they enter, including those that begin
    inside. `mean_entries` counts all entries after the start.

    Attributes
    ----------
    value : float, no unit
        Probability of ever being inside, over the common time of both paths.
    low, high : float, no unit
        Interval of `value`: certain for "bound", otherwise of 95 % confidence; it includes quadrature and
        sampling errors.
    at_start : float, no unit
        Probability of being inside at the start, a part of `value`; nan for "short-encounter".
    mean_entries : float, no unit
        Expected number of entries after the start.
    repeated : float, no unit
        Fraction of the samples that enter more than once; nan without samples.
    rate_times : array of shape (K,) [s]
        Times at which the mean rate of entries was evaluated; empty otherwise.
    rates : array of shape (K,) [1/s]
        Mean rate of entries at these times.
    method : "entries", "bound", "monte-carlo" or "short-encounter"
        Method of computation.
    samples : int
        Number of samples.
    """

    _columns: ClassVar = {
        "rate_times": "time_s",
        "rates": "entries_1_s",
    }

    value: float
    low: float
    high: float
    at_start: float
    mean_entries: float
    repeated: float
    rate_times: Floats
    rates: Floats
    method: Method
    samples: int

    _repr_html_ = Result._repr_html_  # without the table of rates

    def __str__(self) -> str:
        interval = f"{self.low:.5g} to {self.high:.5g}"
        if self.method == "short-encounter":
            return f"passes through the zone with probability {self.value:.5g}, if the encounter is short"
        sure = "certainly" if self.method == "bound" else "95 %:"
        return (
            f"ever inside with probability {self.value:.5g} ({sure} {interval}), inside at the start with "
            f"{self.at_start:.5g}; {self.mean_entries:.5g} entries expected"
        )


def collision_probability(
    path: Path,
    other: Path,
    zone: Zone,
    errors: Uncertainty,
    other_errors: Uncertainty | None = None,
    method: Method = "entries",
    samples: int | None = None,
    seed: int = 0,
) -> Probability:
    """Return the probability that one craft enters the zone of another, over their common time.

    Parameters
    ----------
    path : Path
        Planned path of one craft.
    other : Path
        Path of the craft at the zone's centre, in the same orbit and with the same start.
    zone : Zone
        Zone of the pair: for bodies a sphere of the sum of both radii. "entries", "bound" and
        "short-encounter" require a sphere or an ellipsoid.
    errors : Uncertainty
        Uncertainty of the first craft, or of the relative motion.
    other_errors : Uncertainty, optional
        Uncertainty of the other craft, independent of the first.
    method : "entries", "bound", "monte-carlo" or "short-encounter", default "entries"
        "entries" integrates the mean rate of entries, samples entries from it and counts how often these
        trajectories enter: as precise for 1e-20 as for 0.1. "bound" stops at that rate, and gives an interval
        that is certain up to quadrature. "monte-carlo" samples trajectories. "short-encounter" is Foster's
        two-dimensional integral for straight relative motion with the covariance at closest approach.
    samples : int, optional
        Number of samples, at least 100. Default: for "entries" as many as give a half-interval of 0.1 % of
        the probability, up to 100000; for "monte-carlo" 40000.
    seed : int, default 0
        Seed of the random numbers; the result does not depend on the number of cores.

    Returns
    -------
    Probability
        Probability with its interval.

    Raises
    ------
    ValueError
        If a path is a batch, orbits or starts differ, there is no common time, a method is unknown or not
        valid for the zone or the errors (the message names one that is), or the errors are too small to
        resolve the zone's surface.

    Notes
    -----
    For one or two independent errors, and for errors that move craft by less than 1e-9 of the zone, "entries"
    and "bound" give the exact integral without samples. For more errors they raise ValueError if the rate of
    entries cannot be computed.
    Entries are counted by the signs of polynomials: none is missed between time steps. "bound" covers process
    noise, and "monte-carlo" samples it in short exact steps. The discretization error is bounded, usually by
    a thousandth of the zone: `low` is for a zone reduced by that, `high` for one enlarged by it.

    References
    ----------
    docs/theory.md section 9; Rice 1944; Foster and Estes 1992.
    """
    if not isinstance(method, str) or method not in METHODS:
        raise ValueError(f"method: expected {', '.join(METHODS)}, got {shown(method)}")
    if samples is not None:
        whole("samples", samples, LEAST)
    whole("seed", seed)
    columns, noise = relative_errors(path, other, zone, errors, other_errors)
    if noise and method == "entries":
        raise ValueError(
            'errors: "entries" cannot be combined with process noise; use method="monte-carlo" or "bound"'
        )
    if method == "monte-carlo":
        step = noise_step(path, other, noise, zone)
        random = SampledTrajectories.of(path, other, columns, noise, zone, step)
        return _monte_carlo(random, SAMPLES if samples is None else samples, seed)
    sampled = SampledTrajectories.of(path, other, columns, noise, zone)
    if zone.shape != BALL:
        raise ValueError(f'zone: "{method}" requires a sphere or an ellipsoid; use method="monte-carlo"')
    if method == "short-encounter":
        value, off = passes_through(sampled)
        nan = float("nan")
        return Probability(value, value - off, value + off, nan, value, nan, NONE, NONE, method, 0)
    return _by_entries(sampled, method, samples, seed)


def _by_entries(sampled: SampledTrajectories, method: Method, samples: int | None, seed: int) -> Probability:
    """Return the probability from the mean rate of entries: a bound, or sampled entries.

    For one or two errors it is exact.
    """
    if not sampled.noise and (ways := low_rank_directions(sampled)) is not None:
        found, nan = LowRankProbability.of(sampled, ways), float("nan")
        ever, entries = found.ever, found.entries
        low, high = ever * (1.0 - found.off), min(ever * (1.0 + found.off), 1.0)
        return Probability(ever, low, high, found.at_start, entries, nan, NONE, NONE, method, 0)
    flux = expected_entries(sampled)
    start = float(sampled.edges[0])
    at_start, off = probability_inside(sampled, start)
    off += flux.error
    known = at_start, flux.value
    if not off <= UNRESOLVED * (at_start + flux.value):  # also if it is nan
        raise Unresolved
    if method == "bound":
        times = flux.nearest[:PASSAGES].tolist()
        low = max(at_start, *(probability_inside(sampled, time)[0] for time in times))
        high = at_start + flux.value
        nan = float("nan")
        return _with_quadrature_error(high, low, high, off, known, nan, flux, method, 0)
    if flux.value == 0.0:
        return _with_quadrature_error(at_start, at_start, at_start, off, known, 0.0, flux, method, 0)
    if samples is None:
        samples = sufficient_samples(sampled, flux, at_start, off, seed)
    counts = sampled.count(sample_entries(sampled, flux, samples, seed))
    lost = repeated_shares(counts)
    mean, low, high = interval_of_mean(lost)
    value = at_start + flux.value * (1.0 - mean)
    return _with_quadrature_error(
        value,
        at_start + flux.value * (1.0 - high),
        at_start + flux.value * (1.0 - low),
        off,
        known,
        float((counts[:, 1] > 1).mean()),
        flux,
        method,
        samples,
    )


def _with_quadrature_error(
    value: float,
    low: float,
    high: float,
    off: float,
    known: tuple[float, float],
    repeated: float,
    flux: Flux,
    method: Method,
    samples: int,
) -> Probability:
    """Return the result with the quadrature error added to its interval."""
    some = flux.of_time.parts > 0.0
    return Probability(
        min(value, 1.0),
        max(low - off, 0.0),
        min(high + off, 1.0),
        *known,
        repeated,
        flux.of_time.times[some],
        flux.of_time.values[some],
        method,
        samples,
    )


def _monte_carlo(sampled: SampledTrajectories, samples: int, seed: int) -> Probability:
    """Return the probability as the fraction of samples that are ever inside."""
    began, met, entries, again, least, most = sampled.sample(samples, seed)
    low, high = clopper_pearson(least, samples)[0], clopper_pearson(most, samples)[1]
    return Probability(
        met / samples,
        low,
        high,
        began / samples,
        entries / samples,
        again / samples,
        NONE,
        NONE,
        "monte-carlo",
        samples,
    )
