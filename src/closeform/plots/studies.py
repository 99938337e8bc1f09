"""Studies of many cases: distributions, lock times, sweeps, and collision probability."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, log10
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from closeform.arrays import instance, number, numbers, sequence
from closeform.motion.path import Path
from closeform.plots.drawing import style, units
from closeform.plots.drawing.charts import Curve, Panel, series
from closeform.plots.drawing.inputs import picture
from closeform.plots.drawing.palette import AFTER, ALTERNATIVE, BEFORE, CONFLICT, INK, OTHER, colours
from closeform.plots.drawing.text import short_names, word
from closeform.search.lock_statistics import FINER, TimeHistogram
from closeform.search.schedule import Search
from closeform.uncertainty.probability import Probability

BINS = 60  # maximum; few cases have twice the root of their number
CURVE = "#7a2a10"
PHASE_COLOURS = {"IPS": AFTER, "OPS": ALTERNATIVE, "mOPS": ALTERNATIVE, "NFS": "#AA4499"}
LETTERS = 90.0  # of a label, over the whole width
MOST, LONG = 12, 40  # maximum number of lines of a sweep, and characters of a name
FAR = 5.0  # times the largest value: a limit above that is not shown


@picture(
    "`values` has another shape, is infinite or all nan, or `tail` is not between 0 and 1",
    source="docs/scenario.md",
)
def distribution(values: ArrayLike, what: str, tail: float = 0.95) -> Figure:
    """Plot a histogram of values, and the cumulative fraction of cases up to each value.

    Dashed lines mark the median and the `tail` quantile. Quantiles interpolate linearly between two cases, as
    in NumPy and in the tables of studies.

    Parameters
    ----------
    values : array_like of shape (M,), no unit
        One value per case, in the unit that `what` states; nan if a case has none, counted in the headline.
    what : str
        Name of the quantity with its unit, such as "delta-v [m/s]".
    tail : float, no unit, default 0.95
        Fraction of cases below the second dashed line, between 0 and 1; use 0.05 if small values are
        critical.
    """
    given = numbers("values", values)
    instance("what", what, str)
    if not 0.0 < (end := number("tail", tail)) < 1.0:
        raise ValueError(f"tail: must be a fraction between 0 and 1, got {end:g}")
    if given.ndim != 1:
        raise ValueError(f"values: expected shape (M,), got {given.shape}")
    found = np.sort(given[~np.isnan(given)])
    if not len(found) or not np.isfinite(found).all():
        raise ValueError("values: expected finite numbers, nan where a case has none; got none, or infinity")
    figure, (axes,) = style.chart(5.4)
    low, high = float(found[0]), float(found[-1])
    room = 0.02 * (high - low) or 0.01 * max(abs(high), 1.0)
    bins = min(BINS, int(np.ceil(2.0 * np.sqrt(len(found)))))
    counts, edges = np.histogram(found, bins, (low - room, high + room))
    axes.stairs(counts, edges, fill=True, color=OTHER, zorder=3)
    axes.set_xlim(low - room, high + room)
    axes.set_xlabel(what)
    axes.set_ylabel("cases")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    right = style.right_axis(axes, "cumulative share [%]", AFTER)
    right.ecdf(found, color=AFTER, linewidth=2.2, zorder=4)
    right.set_ylim(0.0, 1.03)
    right.set_yticks(np.linspace(0.0, 1.0, 6), [f"{share}" for share in range(0, 101, 20)])
    middle, most = (float(np.quantile(found, one)) for one in (0.5, end))
    for value in (middle, most):
        axes.axvline(value, color=INK, linewidth=1.0, linestyle=style.DASHED, zorder=5)
    without = f", {len(given) - len(found)} without" if len(found) < len(given) else ""
    name, _, unit = what.partition(" [")
    marked = f"median {middle:.4g}, {100.0 * end:g} % {most:.4g} {unit.rstrip(']')}"
    said = f"{name} of {len(found)} cases{without}: {marked}"
    style.headline(figure, f"{said[0].upper()}{said[1:]}".rstrip())
    return figure


@picture(
    "`times` has another shape or lies outside the search, or `bin` is not positive and finite",
    source="S04 figure 7",
)
def histogram(
    times: ArrayLike, search: Search | None = None, bin: float = 60.0, what: str = "pairs lock"
) -> Figure:
    """Plot the number of pairs that lock in each bin of a search: S04 figure 7.

    Pairs that lock at once (time 0) are counted in the headline but not in the bars, as in S04. The count has
    a logarithmic axis. The curve is the cumulative fraction of all pairs, on the right axis. Bands are the
    phases of the search with their counts, up to the phase of the last lock. Dashed lines are the ends of
    turns.

    Parameters
    ----------
    times : array_like of shape (M,) [s]
        Lock times from `lock_times`; nan if there was no lock.
    search : Search, optional
        Search in which the times lie; without it, phases and turns are not shown.
    bin : float [s], default 60
        Width of a bin.
    what : str, default "pairs lock"
        Plural noun and verb of the event, such as "formations gather" for the durations of `gather_cases`.
    """
    instance("what", what, str)
    given = numbers("times", times)
    if given.ndim != 1:
        raise ValueError(f"times: expected shape (M,), got {given.shape}")
    if not 0.0 < number("bin", bin) < np.inf:
        raise ValueError(f"bin: must be positive and finite, got {bin!r} s")
    found = given[~np.isnan(given)]
    longest = search.duration if search is not None else max(bin, float(found.max(initial=0.0)))
    if found.size and not (found.min() >= 0.0 and found.max() <= longest < np.inf):
        raise ValueError(f"times: must lie in the search, from 0 to {longest:g} s")
    return binned(TimeHistogram.of([given], longest, search, bin), search, what)


def binned(times: TimeHistogram, search: Search | None = None, what: str = "pairs lock") -> Figure:
    """Plot the histogram of times that are already counted."""
    edges = times.bin * np.arange(len(times.counts) + 1)
    figure, (axes,) = style.chart(5.8)
    end = float(edges[-1])
    if search is not None:  # up to the end of the phase with the last event
        end = next((end for *_, end in search.phases if end >= times.last), search.duration)
    unit, noun = units.plain_unit(end), what.partition(" ")[0]
    axes.set_yscale("log")
    axes.set_ylim(0.7, 6.0 * max(10.0, float(times.counts.max(initial=0))))
    axes.set_xlim(0.0, end / unit.size)
    axes.set_xlabel(f"time [{unit.name}]")
    axes.set_ylabel(f"{noun} [1 per {times.bin:g} s]")
    axes.stairs(times.counts, edges / unit.size, baseline=0.7, fill=True, color=OTHER, zorder=3)
    right = style.right_axis(axes, "cumulative share [%]", CURVE)
    finer = np.minimum(times.bin / FINER * np.arange(len(times.finer) + 1), end) / unit.size
    done = times.at_once + np.concatenate([[0], np.cumsum(times.finer)])
    right.plot(finer, 100.0 * done / max(1, times.every), color=CURVE, linewidth=2.2)
    right.set_ylim(0.0, 133.0)
    right.set_yticks(range(0, 101, 20))
    if search is not None:
        phases(axes, search, unit, times.inside, end)
    found, verb = times.at_once + times.later, what.partition(" ")[2]
    said = f"{spaced(times.at_once)} of {spaced(times.every)} {noun} {verb} at once (not shown), "
    said += f"{spaced(times.later)} later"
    style.headline(figure, said + (f", {spaced(times.every - found)} never" if found < times.every else ""))
    return figure


def phases(axes: Axes, search: Search, unit: units.Unit, counts: Any, until: float) -> None:
    """Draw bands for the phases with their counts where there is room, and the ends of the turns."""
    for (name, turn, start, end), count in zip(search.phases, counts.tolist(), strict=True):
        colour, text = PHASE_COLOURS.get(name, OTHER), f"{name} {turn}: {spaced(count)}"
        axes.axvspan(start / unit.size, end / unit.size, facecolor=colour, alpha=0.13, linewidth=0.0)
        axes.axvline(end / unit.size, color=OTHER, linewidth=1.2)
        if len(text) < LETTERS * (min(end, until) - start) / until:
            middle = 0.5 * (start + min(end, until)) / unit.size
            word(axes, (middle, axes.get_ylim()[1] / 2.0), text)
    for leg in search.legs:
        axes.axvline(leg.end / unit.size, ymax=0.76, color=BEFORE, linewidth=0.7, linestyle=(0, (3, 3)))


def spaced(count: int) -> str:
    """Return a count with spaces between thousands."""
    return f"{count:,}".replace(",", " ")


@picture("shapes are wrong, or a number is not finite", source="docs/scenario.md")
def sweep(
    values: ArrayLike,
    share: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    what: str,
    names: Sequence[str] = ("",),
) -> Figure:
    """Plot the fraction of cases against a swept value, with a line for each combination of other values.

    Bands are 95 % confidence intervals.

    Parameters
    ----------
    values : array_like of shape (P,), no unit
        Swept values, in the unit that `what` states.
    share : array_like of shape (K, P), no unit
        Fraction of cases at each point, from 0 to 1; the first 12 lines are drawn.
    low, high : array_like of shape (K, P), no unit
        Ends of the intervals.
    what : str
        Name of the swept quantity with its unit.
    names : sequence of str, default one without a name
        Names of the K lines.
    """
    where, called = numbers("values", values), sequence("names", names, str)
    instance("what", what, str)
    given = {"share": share, "low": low, "high": high}
    parts = {name: numbers(name, one) for name, one in given.items()}
    if where.ndim != 1 or not where.size or not np.isfinite(where).all():
        raise ValueError(f"values: expected finite numbers of shape (P,), got {where.shape}")
    for name, part in parts.items():
        if part.shape != (len(called), len(where)) or not np.isfinite(part).all():
            raise ValueError(f"{name}: expected finite numbers of shape (K, P), K names, got {part.shape}")
    words = short_names(called[:MOST], len(called[:MOST]), "lines", LONG)
    figure, (axes,) = style.chart(5.4)
    shown = 100.0 * np.stack([parts["share"], parts["low"], parts["high"]])[:, :MOST]
    lines = []
    for k, tint in enumerate(colours(shown.shape[1])):
        middle, below, above = shown[:, k]
        lines += axes.plot(where, middle, "o-", color=tint, linewidth=1.6)
        axes.fill_between(where, below, above, color=tint, alpha=0.18, linewidth=0.0)
        axes.vlines(where, below, above, color=tint, linewidth=1.0)
    axes.set_xlabel(what)
    axes.set_ylabel("cases that meet all requirements [%]")
    if any(called):
        style.legend(figure, lines, words)
    least, most = 100.0 * float(parts["share"].min()), 100.0 * float(parts["share"].max())
    between = f"{least:.3g} to {most:.3g}" if most > least else f"{most:.3g}"
    style.headline(figure, f"All requirements are met in {between} % of cases")
    return figure


@picture(
    "`found` has no rate because of its method or because there are no entries, or `limit` is not a "
    "probability above 0"
)
def collision(
    found: Probability, path: Path | None = None, limit: float | None = None, what: str = ""
) -> Figure:
    """Plot the mean rate of entries into the zone and, below it, the cumulative probability, against time.

    The lower curve is the probability of being inside at the start plus the expected number of entries so
    far. It is an upper bound on the probability of a conflict up to that time, and equals it if each case
    enters at most once. The mark at the end is the probability of being inside at any time, with its
    interval.

    Parameters
    ----------
    found : Probability
        Result of `collision_probability` with the method "entries" or "bound", which compute the rate.
    path : Path, optional
        Path of either spacecraft, which defines the time axis by its start, end and orbit; default: the times
        at which the rate was computed.
    limit : float, no unit, optional
        Required maximum probability.
    what : str, default ""
        Name of the pair, placed at the start of the headline.
    """
    instance("found", found, Probability)
    instance("what", what, str)
    if limit is not None and not 0.0 < number("limit", limit) <= 1.0:
        raise ValueError(f"limit: must be a probability above 0 and at most 1, got {limit:g}")
    if len(found.rate_times) < 2 or not found.mean_entries > 0.0:
        raise ValueError(
            f'found: method "{found.method}" gave no rate of entries; give one of method="entries" above 0'
        )
    order = np.argsort(found.rate_times)
    start, end = (path.start, path.end) if path is not None else found.rate_times[order[[0, -1]]].tolist()
    ticks = units.clock(path, start, end) if path is not None else units.Clock(units.plain_unit(end - start))
    times, rates = found.rate_times[order], found.rates[order]
    times = np.concatenate([[min(start, times[0])], times, [max(end, times[-1])]])
    rates = np.concatenate([rates[:1], rates, rates[-1:]])
    so_far = np.concatenate([[0.0], np.cumsum(np.diff(times) * 0.5 * (rates[1:] + rates[:-1]))])
    so_far = found.at_start + so_far * (found.mean_entries / so_far[-1])

    per = "orbit" if ticks.unit.name == "orbits" else ticks.unit.name
    size, power = scaled(float(rates.max()) * ticks.unit.size)
    rate = Curve(times, rates * ticks.unit.size / size, colour=CONFLICT)
    most = max(so_far[-1], found.high)
    size, chance = scaled(most)
    ever = f"ever inside: {found.value:.4g} ({found.low:.4g} to {found.high:.4g})"
    span: dict[str, Any] = {"colour": ALTERNATIVE, "width": 5.0, "dot": (end, found.value / size)}
    curves = [
        Curve(times, so_far / size, "inside at the start, and entries so far"),
        Curve(np.full(2, end), np.array([found.low, found.high]) / size, ever, **span),
    ]
    if limit is not None:
        far = limit > FAR * most
        words = f"required: at most {limit:g}{', far above' if far else ''}"
        flat = np.full(2, np.nan if far else limit / size)
        curves.append(Curve(times[[0, -1]], flat, words, INK, style.DASHED, 1.4))
    panels = [Panel(f"entries per {per}{power}", [rate]), Panel(f"probability{chance}", curves)]
    highest = ticks.text(float(times[np.argmax(rates)]))
    lead = f"{what}: p" if what else "P"
    said = f"{lead}robability of collision {found.value:.4g}, highest entry rate at {highest}"
    return series(said, panels, ticks, start, end, height=7.2)


def scaled(greatest: float) -> tuple[float, str]:
    """Return the power of ten in which numbers up to `greatest` are shown, and its axis label."""
    power = floor(log10(greatest))
    return (1.0, "") if -2 <= power < 4 else (10.0**power, f" [$10^{{{power}}}$]")
