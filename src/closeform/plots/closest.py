"""Clearance ratios of the closest pairs of a formation, against time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from closeform.arrays import Floats, whole
from closeform.motion.path import Path
from closeform.plots.fonts import plain
from closeform.plots.pairs import SURE, Pairs, asked, ratio_text, title
from closeform.plots.palette import AFTER, ALONG, ALTERNATIVE, BEFORE, CONFLICT, CROSS, INK
from closeform.plots.style import (
    ABOVE,
    DOTTED,
    SMALL,
    TEXT,
    Clock,
    chart,
    clock,
    column,
    headline,
    instants,
    legend,
    say_scale,
    sheet,
    time_axes,
    zone_band,
)
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones

COLOURS = (AFTER, ALTERNATIVE, CROSS.colour, BEFORE)  # the closest pair first
DASHES = ("-", ALONG.dashes, CROSS.dashes, DOTTED)
LINEAR, LOW_LINEAR = 12.0, 6.0  # maximum ratio of a fully linear axis: single axis, stacked panels
TANGLED = 8.0  # curves times orbits above which each pair has its own panel
BANDED = 24.0  # orbits from which a curve is the band between minimum and maximum of each orbit
BAND = "#b9d9ec"
Curve = tuple[Floats, Floats]  # times [s] and clearance ratios
HIGH, BESIDE, LOW = 0.9, 2.5, 0.75  # inches: height of a panel, right margin for its label, bottom margin


def closest_pairs(
    paths: Path | Sequence[Path],
    zones: OwnZone | Sequence[OwnZone | None] | PairZones | None,
    names: Sequence[str] | None = None,
    count: int = 4,
) -> Figure:
    """Plot the clearance ratio of the closest pairs against time; below 1 is a conflict.

    Each line is the clearance ratio of one pair over its common time, with a dot at the exact minimum. The
    axis is logarithmic above 1 if a line exceeds the linear range. Many pairs over many orbits have a panel
    each; from 24 orbits on, a panel shows the band between the minimum and maximum of each orbit.

    Parameters
    ----------
    paths : Path or sequence of Path
        Path of shape (N,), or N paths.
    zones : Zone, CovarianceZone, Body, None, sequence of these, or PairZones
        One zone for all spacecraft or one for each, combined for a pair as in `screen`; None: no zone of its
        own.
    names : sequence of str, optional
        Names of the spacecraft; default: their indices.
    count : int, default 4
        Maximum number of pairs shown.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If there are fewer than two spacecraft, the number of names is wrong, `count` is below 1, no pair has
        a zone and a common time, or an argument has the wrong type.
    """
    pairs, called = asked(paths, zones, names)
    whole("count", count, 1)
    shown = pairs.order[:count]
    curves = [curve(pairs, k) for k in shown]
    start = min((float(times[0]) for times, _ in curves), default=0.0)
    end = max((float(times[-1]) for times, _ in curves), default=0.0)
    if not start < end:
        raise ValueError("paths: no two craft that have a zone share a time")
    ticks = clock(pairs.paths, start, end)

    words = [said(pairs, k, called, ticks) for k in shown]
    orbits = (end - start) / pairs.paths.orbit.period
    drawn = in_panels if len(shown) > 1 and len(shown) * orbits > TANGLED else in_one
    figure, panels = drawn(pairs, shown, words, curves, ticks)
    time_axes(panels, ticks, start, end)
    more = int(pairs.hit.sum()) - sum(bool(pairs.stays[k]) for k in shown)
    headline(figure, title(pairs, called) + (f"; {more} more in conflict" if more else ""))
    return figure


def in_one(
    pairs: Pairs, shown: list[int], words: list[str], curves: list[Curve], ticks: Clock
) -> tuple[Figure, list[Axes]]:
    """Draw all curves on one axis with a legend; return the figure and its axes."""
    columns = 2 if max(map(len, words)) <= 52 else 1
    below = LOW + 0.25 * -(-len(shown) // columns)
    figure, axes = chart(5.5 + below, below)
    zone_band(axes)
    lines = [
        line(axes, row, ticks, pairs, k, word, *curve)
        for row, (k, word, curve) in enumerate(zip(shown, words, curves, strict=True))
    ]
    ratio_axis(axes, float(pairs.ratio[shown[0]]), max(float(norms.max()) for _, norms in curves))
    axes.set_ylabel("clearance ratio [× zone]")
    axes.annotate(
        "keep-out zone",
        (0.008, 1.0),
        (0, -5),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        va="top",
        fontsize=SMALL,
        color="#9a6a00",
    )
    legend(figure, lines, words, ncols=columns, handlelength=3.2)
    return figure, [axes]


def in_panels(
    pairs: Pairs, shown: list[int], words: list[str], curves: list[Curve], ticks: Clock
) -> tuple[Figure, list[Axes]]:
    """Draw one panel per pair with a common ratio axis, conflicts as bars; return figure and axes."""
    figure = sheet(ABOVE + LOW + len(shown) * HIGH)
    panels = column(figure, [1.0] * len(shown), LOW, BESIDE)
    least, most = float(pairs.ratio[shown[0]]), max(float(norms.max()) for _, norms in curves)
    for axes, k, word, curve in zip(panels, shown, words, curves, strict=True):
        zone_band(axes)
        stays, (called, _, told) = pairs.stays[k], word.partition(": ")
        often = [f"{len(stays)} conflict{'s' * (len(stays) != 1)}"] if stays else []
        beside: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points", "va": "center"}
        beside |= {"fontsize": SMALL - 1.5, "color": CONFLICT if stays else INK, "linespacing": 1.35}
        plain(axes.annotate("\n".join([called, told, *often]), (1.0, 0.5), (8, 0), **beside))
        band(axes, pairs.paths.orbit.period, ticks, *curve)
        for stay in stays:
            begin, over = ticks(stay.start), ticks(stay.end)
            axes.fill_between([begin, over], 0.0, 1.0, color=CONFLICT, alpha=0.5, linewidth=0, zorder=2.5)
            axes.vlines(0.5 * (begin + over), 0.0, 1.0, color=CONFLICT, linewidth=2.0, zorder=2.5)
        dot: dict[str, Any] = {"color": AFTER, "markeredgecolor": "white", "markersize": 8, "zorder": 5}
        axes.plot(ticks(pairs.time[k]), pairs.ratio[k], "o", clip_on=False, **dot)
        ratio_axis(axes, least, most, few=True)
    scale = ", logarithmic beyond it" if most > LOW_LINEAR and len(shown) > 2 else ""
    figure.text(
        0.012, 0.5, f"clearance ratio [× zone]{scale}", rotation=90, va="center", fontsize=TEXT, color=INK
    )
    return figure, panels


def band(axes: Axes, period: float, ticks: Clock, times: Floats, norms: Floats) -> None:
    """Draw a curve, or the band between minimum and maximum of each orbit if there are many orbits."""
    if times[-1] - times[0] < BANDED * period:
        axes.plot(ticks(times), norms, color=AFTER, linewidth=1.5, zorder=3)
        return
    orbit = ((times - times[0]) / period).astype(int)
    begins = np.flatnonzero(np.diff(orbit, prepend=-1))
    low, high = np.minimum.reduceat(norms, begins), np.maximum.reduceat(norms, begins)
    edges = ticks(np.append(times[begins], times[-1]))
    axes.fill_between(edges, np.append(low, low[-1]), np.append(high, high[-1]), step="post", color=BAND)
    axes.step(edges, np.append(low, low[-1]), where="post", color=AFTER, linewidth=1.5, zorder=3)


def curve(pairs: Pairs, k: int) -> Curve:
    """Return times [s] and ratios of a pair, including its minimum and the ends of conflicts."""
    one, other = (pairs.paths[craft] for craft in pairs.craft[k].tolist())
    start, end = max(one.start, other.start), min(one.end, other.end)
    edges = [time for stay in pairs.stays[k] for time in (stay.start, stay.end)]
    times = np.union1d(instants(start, end, one, other), [pairs.time[k], *edges])
    return times, pairs.zone[k].norm(one.position(times) - other.position(times))


def said(pairs: Pairs, k: int, called: list[str], ticks: Clock) -> str:
    """Return a pair and its closest approach as text."""
    one, other = (called[craft] for craft in pairs.craft[k])
    return f"{one} and {other}: {ratio_text(pairs.ratio[k])} × zone at {ticks.text(float(pairs.time[k]))}"


def line(
    axes: Axes, row: int, ticks: Clock, pairs: Pairs, k: int, label: str, times: Floats, norms: Floats
) -> Line2D:
    """Draw the curve of one pair, thick in conflict, with a dot at its minimum; return the line."""
    colour, dashes, order = COLOURS[row % 4], DASHES[(row + row // 4) % 4], 3.0 + 0.01 * row
    when, least = ticks(pairs.time[k]), pairs.ratio[k]
    look: dict[str, Any] = {"color": colour, "linestyle": dashes, "linewidth": 2.2, "zorder": order}
    (drawn,) = axes.plot(ticks(times), norms, label=label, **look)
    if pairs.stays[k]:
        inside = np.where(norms <= 1.0 + SURE, norms, np.nan)
        axes.plot(ticks(times), inside, color=CONFLICT, linewidth=5.0, alpha=0.55, zorder=order - 0.5)
    dot: dict[str, Any] = {"color": colour, "markeredgecolor": "white", "markersize": 9}
    axes.plot(when, least, "o", **dot, zorder=5.0 - 0.01 * row, clip_on=False)
    return drawn


def ratio_axis(axes: Axes, least: float, most: float, few: bool = False) -> None:
    """Set the ratio axis from 0 to `most`, logarithmic above 1 if needed; `few` for few ticks and no note."""
    bottom = 0.0 if least > 0.02 else -0.03  # keeps a line at 0 visible
    if most <= (LOW_LINEAR if few else LINEAR):
        axes.set_ylim(bottom, 1.06 * max(most, 1.2))
        if few:
            axes.yaxis.set_major_locator(FixedLocator([0.0, 1.0, np.floor(max(most, 1.0))]))
        return
    axes.set_yscale("symlog", linthresh=1.0, linscale=0.7, subs=range(2, 10))
    if not few:
        say_scale(axes, "logarithmic beyond the zone", low=True)
    axes.set_ylim(bottom, 1.2 * most)
    decades = 10.0 ** np.arange(np.ceil(np.log10(1.2 * most)))
    steps = (1, 2, 5) if len(decades) <= 3 and not few else (1, 5) if len(decades) == 1 else (1,)
    ticks = [
        0.0,
        *([] if few else [0.5]),
        *(step * decade for decade in decades for step in steps if step * decade <= 1.2 * most),
    ]
    axes.yaxis.set_major_locator(FixedLocator(ticks))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
