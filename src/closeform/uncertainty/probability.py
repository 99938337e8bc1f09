"""The probability of a collision over a time, with an interval that holds all that it may be off by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from closeform.arrays import Floats, shown, whole
from closeform.motion.path import Path
from closeform.result import Result, Rows
from closeform.uncertainty.ball_share import inside
from closeform.uncertainty.drawn_entries import clopper_pearson, drawn, enough, interval_of_mean, lost_of
from closeform.uncertainty.errors import Uncertainty
from closeform.uncertainty.few_errors import FewErrors, few_ways
from closeform.uncertainty.mean_entries import Flux, Unresolved, expected_entries
from closeform.uncertainty.noisy_trajectories import NoisyHistories
from closeform.uncertainty.relative_errors import relative_errors
from closeform.uncertainty.sampled_trajectories import Histories
from closeform.uncertainty.short_encounter import passes_through
from closeform.zones.shapes import BALL
from closeform.zones.zone import Zone

LEAST = 100  # samples
HISTORIES = 40_000  # by Monte Carlo, where nobody says how many
PASSAGES = 8  # nearest ones, at which a bound looks at who is inside
UNRESOLVED = 0.05  # of a probability, that quadrature may be off by
Method = Literal["entries", "bound", "monte-carlo", "short-encounter"]
METHODS = ("entries", "bound", "monte-carlo", "short-encounter")
NONE = np.empty(0)


@dataclass(frozen=True, eq=False, repr=False)
class Probability(Rows):
    """How probable it is that two craft come within a zone, made by `collision_probability`.

    `value` counts histories that are ever inside, however often they enter: those that begin inside too.
    `mean_entries` counts entries after the start, more than one of a history if it enters again.

    Attributes
    ----------
    value : float, no unit
        Probability to be ever inside, over the common time of both paths.
    low, high : float, no unit
        Between them it lies: for "bound" certainly, otherwise with 95 % confidence; errors of quadrature
        and of sampling are both in it.
    at_start : float, no unit
        Probability to be inside at the start, a part of `value`; nan for "short-encounter".
    mean_entries : float, no unit
        Expected number of entries after the start.
    repeated : float, no unit
        Share of the drawn histories that enter more than once; nan where none are drawn.
    rate_times : array of shape (K,) [s]
        Times at which the mean rate of entries was looked at; none where it was not.
    rates : array of shape (K,) [1/s]
        The mean rate of entries then.
    method : "entries", "bound", "monte-carlo" or "short-encounter"
        How `value` was found.
    samples : int
        How many histories were drawn.
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

    _repr_html_ = Result._repr_html_  # the rate of entries is the lesser part of it

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
    """The probability that one craft comes within the zone around another, over their common time.

    Parameters
    ----------
    path : Path
        Of one craft, as planned.
    other : Path
        Of the craft that the zone is around, in the same orbit and from the same time on.
    zone : Zone
        Of the pair: a sphere of both radii for bodies.  "entries" and "bound" need a sphere or an
        ellipsoid, "short-encounter" too.
    errors : Uncertainty
        Of the first craft, or of the relative motion of both.
    other_errors : Uncertainty, optional
        Of the other craft, independent of the first's.
    method : "entries", "bound", "monte-carlo" or "short-encounter", default "entries"
        "entries" integrates the mean rate of entries, draws entries from it and counts how often their
        histories enter: as precise for 1e-20 as for 0.1.  "bound" stops at that rate, and gives an interval
        that is certain up to quadrature.  "monte-carlo" draws histories.  "short-encounter" is Foster's
        integral in two dimensions, of straight motion past each other with the covariance of that moment.
    samples : int, optional
        Histories to draw, at least 100.  Without it "entries" draws as many as make half of the interval
        0.1 % of the probability, up to 100000; "monte-carlo" draws 40000.
    seed : int, default 0
        Of the random numbers: the same for any number of cores.

    Returns
    -------
    Probability
        Its interval is one of 95 % confidence.

    Raises
    ------
    ValueError
        If a path is a batch, orbits or starts differ, there is no common time, a method is unknown or does
        not hold for the zone or the errors (the message names one that does), or the errors are so small
        that the zone's surface cannot be resolved.

    Notes
    -----
    Where all that is uncertain is one number or two, or nothing moves by 1e-9 of the zone, "entries" and
    "bound" give the exact integral of these, and draw nothing.  Of more they refuse those whose rate of
    entries cannot be told.
    Histories are counted by the certified march: no entry between time steps is missed.  White noise has no
    finite number of columns: "bound" counts it, and "monte-carlo" draws it in short exact steps.  What a path
    between them leaves out is bounded, mostly by a thousandth of the zone: `low` is of a zone that is smaller
    by as much, `high` of a larger one.

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
            'errors: "entries" draws errors, white noise has no finite number of them; use '
            'method="monte-carlo" or "bound"'
        )
    if method == "monte-carlo":
        kind = NoisyHistories if noise else Histories
        random = kind.of(path, other, columns, noise, zone)
        return _monte_carlo(random, HISTORIES if samples is None else samples, seed)
    histories = Histories.of(path, other, columns, noise, zone)
    if zone.shape != BALL:
        raise ValueError(f'zone: "{method}" holds for spheres and ellipsoids; use method="monte-carlo"')
    if method == "short-encounter":
        value, off = passes_through(histories)
        nan = float("nan")
        return Probability(value, value - off, value + off, nan, value, nan, NONE, NONE, method, 0)
    return _by_entries(histories, method, samples, seed)


def _by_entries(histories: Histories, method: Method, samples: int | None, seed: int) -> Probability:
    """By the mean rate of entries: a bound, or entries drawn from it; of one or two errors exactly."""
    if not histories.noise and (ways := few_ways(histories)) is not None:
        found, nan = FewErrors.of(histories, ways), float("nan")
        ever, entries = found.ever, found.entries
        low, high = ever * (1.0 - found.off), min(ever * (1.0 + found.off), 1.0)
        return Probability(ever, low, high, found.at_start, entries, nan, NONE, NONE, method, 0)
    flux = expected_entries(histories)
    start = float(histories.edges[0])
    at_start, off = inside(histories, start)
    off += flux.error
    known = at_start, flux.value
    if not off <= UNRESOLVED * (at_start + flux.value):  # nor if it is no number
        raise Unresolved
    if method == "bound":
        times = flux.nearest[:PASSAGES].tolist()
        low = max(at_start, *(inside(histories, time)[0] for time in times))
        high = at_start + flux.value
        nan = float("nan")
        return _told(high, low, high, off, known, nan, flux, method, 0)
    if flux.value == 0.0:
        return _told(at_start, at_start, at_start, off, known, 0.0, flux, method, 0)
    if samples is None:
        samples = enough(histories, flux, at_start, off, seed)
    counts = histories.counted(drawn(histories, flux, samples, seed))
    lost = lost_of(counts)
    mean, low, high = interval_of_mean(lost)
    value = at_start + flux.value * (1.0 - mean)
    return _told(
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


def _told(
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


def _monte_carlo(histories: Histories | NoisyHistories, samples: int, seed: int) -> Probability:
    """The share of drawn histories that are ever inside."""
    began, met, entries, again, least, most = histories.drawn(samples, seed)
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
