"""Charts of plain numbers: curves of each spacecraft, time spans, and intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.plots.fonts import plain, short_names
from closeform.plots.palette import AFTER, CONFLICT, INK, colours
from closeform.plots.style import (
    DASHED,
    SMALL,
    Clock,
    area,
    chart,
    dress,
    headline,
    plain_unit,
    sheet,
    time_axes,
    zone_band,
)

ENDS_NAMED = 12  # maximum number of curves with names at their ends
LEAST_NAMED = 6  # number of smallest results with labels
APART = (0.08, 0.06)  # of the axes: of dots closer together only the smallest has a label
MARGIN = 0.03  # of the duration: free space on both sides
FAR = 30.0  # times the edge: a wider range has a logarithmic axis
MOST = 40  # maximum number of rows
WORDS, BESIDE, ROW = 2.6, 0.4, 0.34  # inches: left margin for names, right margin, height of a row


def curves(
    times: Floats,
    values: Floats,
    what: str,
    said: str,
    names: Sequence[str] | None = None,
    planned: Floats | None = None,
) -> Figure:
    """Plot non-negative values (N, T) of N spacecraft at times (T,) [s]; `planned` (N, T) is dashed."""
    called, ticks = short_names(names, len(values)), Clock(plain_unit(float(times[-1] - times[0])), None)
    figure, axes = chart(5.2, beside=1.1)
    for k, tint in enumerate(colours(len(values))):
        axes.plot(ticks(times), values[k], color=tint, linewidth=1.8)
        if planned is not None:
            axes.plot(ticks(times), planned[k], color=tint, linewidth=1.2, linestyle=DASHED)
        if len(values) <= ENDS_NAMED:
            place = (float(ticks(times[-1])), float(values[k, -1]))
            plain(axes.annotate(called[k], place, (5, -4), textcoords="offset points", fontsize=SMALL))
    axes.set_ylim(0.0, None)
    axes.set_ylabel(what)
    time_axes([axes], ticks, float(times[0]), float(times[-1]))
    plain(headline(figure, said))
    return figure


@dataclass(frozen=True, eq=False)
class Spans:
    """K results: a `height` (K,) at a `time` (K,) [s], each lasting from `start` to `end` (K,) [s].

    `called` returns the label of a result, drawn beside the smallest ones. `what` is the label of the height
    axis. Below `edge` is a zone.
    """

    start: Floats
    time: Floats
    end: Floats
    height: Floats
    called: Callable[[int], str]
    what: str
    edge: float | None = 1.0

    @property
    def known(self) -> Any:
        """Mask (K,) of the results that have a time and a height."""
        return np.isfinite(self.time) & np.isfinite(self.height)


def spans(told: Spans, said: str) -> Figure:
    """Plot results with a time as spans, under the headline `said`."""
    known = told.known
    start, time, end, height = (
        np.asarray(part, dtype=float)[known] for part in (told.start, told.time, told.end, told.height)
    )
    rows = np.flatnonzero(known)
    figure, axes = chart(5.2)
    first, last = (float(start.min()), float(end.max())) if len(time) else (0.0, 1.0)
    first, last = (first, last) if last > first else (first - 0.5, last + 0.5)
    ticks = Clock(plain_unit(last - first), None)
    tint = AFTER if told.edge is None else np.where(height < told.edge, CONFLICT, AFTER)
    if told.edge is not None:
        zone_band(axes, told.edge)
    if len(time):
        lines = np.stack([np.stack([ticks(start), height], 1), np.stack([ticks(end), height], 1)], 1)
        axes.add_collection(LineCollection(list(lines), colors=tint, linewidths=2.0, alpha=0.6))
        axes.scatter(ticks(time), height, s=26.0, c=tint, zorder=4, clip_on=False)
    most = float(height.max(initial=told.edge or 0.0)) or 1.0
    if told.edge is not None and most > FAR * told.edge:
        axes.set_yscale("symlog", linthresh=2.0 * told.edge)
    axes.set_ylim(0.0, 1.12 * most)
    late, taken = first + 0.8 * (last - first), np.empty((0, 2))
    for k in np.argsort(height, kind="stable")[:LEAST_NAMED].tolist():
        spot = np.array([(time[k] - first) / (last - first), height[k] / most])
        if (np.abs(taken - spot) < APART).all(axis=1).any():
            continue
        taken = np.vstack([taken, spot])
        side = (-6, "right") if time[k] > late else (6, "left")
        look: dict[str, Any] = {"textcoords": "offset points", "fontsize": SMALL, "color": INK, "ha": side[1]}
        place = (float(ticks(time[k])), float(height[k]))
        plain(axes.annotate(told.called(int(rows[k])), place, (side[0], 5), **look))
    axes.set_ylabel(told.what)
    room = MARGIN * (last - first)
    time_axes([axes], ticks, first - room, last + room)
    plain(headline(figure, said))
    return figure


def intervals(
    names: Sequence[str], values: ArrayLike, low: ArrayLike, high: ArrayLike, what: str, said: str
) -> Figure:
    """Plot a row for each of the first 40 names: a dot at its value, and a line from `low` to `high`."""
    value, below, above = (np.ravel(np.asarray(part, dtype=float))[:MOST] for part in (values, low, high))
    rows = np.arange(len(value))[::-1]
    figure = sheet(1.9 + ROW * max(2, len(rows)))
    wide, tall = figure.get_size_inches()
    axes = area(figure, WORDS, 0.7, wide - WORDS - BESIDE, tall - 0.7 - 0.7)
    dress(axes)
    axes.hlines(rows, below, above, color=AFTER, linewidth=5.0, alpha=0.35)
    axes.plot(value, rows, "o", color=AFTER, markersize=7, linestyle="")
    axes.set_yticks(rows, list(names)[: len(rows)], fontsize=SMALL)
    for words in axes.get_yticklabels():
        plain(words)
    axes.set_ylim(-0.6, len(rows) - 0.4)
    axes.set_xlabel(what)
    plain(headline(figure, said))
    return figure
