"""Charts of plain numbers: curves against time with limits, timelines, spans and intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.plots.drawing.palette import AFTER, ALONG, ALTERNATIVE, BEFORE, CONFLICT, CROSS, INK, OTHER
from closeform.plots.drawing.style import (
    DOTTED,
    chart,
    headline,
    legend,
    log_axis,
    ratio_axis,
    time_axes,
    zone_band,
)
from closeform.plots.drawing.text import NEAR, SMALL, label, plain
from closeform.plots.drawing.units import Clock, plain_unit

SURE = 1e-8  # above a limit: numerical tolerance of a minimum
PALE = "#9ec5df"
COLOURS = (AFTER, ALTERNATIVE, CROSS.colour, BEFORE, "#882255", "#7a6a00")
DASHES = ("-", ALONG.dashes, CROSS.dashes, DOTTED)
WIDE = 30.0  # times the smallest value or the limit: a wider range has a logarithmic axis
LABELLED = 6  # number of smallest results with labels
MOST = 40  # maximum number of intervals


@dataclass(frozen=True, eq=False)
class Curve:
    """Line (T,), or family of pale lines (S, T), at `times` (T,) [s].

    A `dot` (time, value) marks the exact extreme, with its `name` next to it.
    """

    times: Floats
    values: Floats
    label: str = ""
    colour: Any = AFTER
    dashes: Any = "-"
    width: float = 2.0
    dot: tuple[float, float] | None = None
    name: str = ""


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves of one quantity, named `what` with its unit, with the limit that they must stay above.

    `scale` is "ratio" for clearance ratios, "log" for values that may span decades, otherwise "linear".
    """

    what: str
    curves: Sequence[Curve]
    limit: float | None = None
    limit_name: str = "keep-out zone"
    scale: str = "linear"


def styled(k: int, **more: Any) -> dict[str, Any]:
    """Return colour and dashes of curve k."""
    return {"colour": COLOURS[k % len(COLOURS)], "dashes": DASHES[(k + k // 4) % 4], **more}


def series(
    said: str,
    panels: Sequence[Panel],
    ticks: Clock,
    start: float,
    end: float,
    what: str = "time",
    height: float | None = None,
) -> Figure:
    """Plot panels of curves against time from `start` to `end` [s], under the headline `said`."""
    figure, column = chart(height or 3.2 + 2.2 * len(panels), [1.0] * len(panels))
    handles, words = list[Any](), list[str]()
    for axes, panel in zip(column, panels, strict=True):
        draw(axes, panel, ticks, handles, words)
    time_axes(column, ticks, start, end, what)
    if words:
        legend(figure, handles, words, handlelength=3.2)
    headline(figure, said)
    return figure


def draw(axes: Axes, panel: Panel, ticks: Clock, handles: list[Any], words: list[str]) -> None:
    """Draw the curves of a panel, and append those with a label to the legend."""
    if panel.limit is not None:
        zone_band(axes, panel.limit, panel.limit_name)
    for k, one in enumerate(panel.curves):
        when, order = ticks(one.times), 3.0 + 0.01 * k
        look: dict[str, Any] = {"linewidth": one.width, "linestyle": one.dashes, "color": one.colour}
        if one.values.ndim == 2:
            lines = np.stack([np.broadcast_to(when, one.values.shape), one.values], axis=-1)
            made: Any = LineCollection(list(lines), zorder=2, alpha=0.6, **look)
            axes.add_collection(made)
        else:
            (made,) = axes.plot(when, one.values, zorder=order, label=one.label or "_", **look)
            if panel.limit is not None and np.nanmin(one.values) <= panel.limit * (1.0 + SURE):
                inside = np.where(one.values <= panel.limit * (1.0 + SURE), one.values, np.nan)
                axes.plot(when, inside, color=CONFLICT, linewidth=5.0, alpha=0.55, zorder=order - 0.5)
        if one.dot is not None:
            time, value = one.dot
            hit = panel.limit is not None and value < panel.limit
            dot: dict[str, Any] = {"color": CONFLICT if hit else one.colour, "markeredgecolor": "white"}
            axes.plot(ticks(time), value, "o", markersize=9, zorder=5, clip_on=False, **dot)
        if one.label:
            handles.append(made)
            words.append(one.label)
    scaled(axes, panel)
    axes.set_ylabel(panel.what)
    named = [(*one.dot, one.name) for one in panel.curves if one.dot is not None and one.name]
    if named:
        points = np.array([(float(ticks(time)), value) for time, value, _ in named])
        label(axes, points, [name for *_, name in named])


def scaled(axes: Axes, panel: Panel) -> None:
    """Set the vertical axis of a panel."""
    every = np.concatenate([one.values.ravel() for one in panel.curves])
    every = every[np.isfinite(every)]
    least, most = (float(every.min()), float(every.max())) if len(every) else (0.0, 1.0)
    least, most = min(least, panel.limit or least), max(most, panel.limit or most)
    if panel.scale == "ratio":
        ratio_axis(axes, least, most)
    elif panel.scale == "log" and 0.0 < WIDE * least < most:
        log_axis(axes)
        axes.set_ylim(0.7 * least, 1.4 * most)
    else:
        axes.set_ylim(1.08 * min(0.0, least), 1.08 * most or 1.0)


@dataclass(frozen=True, eq=False)
class Spans:
    """K results: a `height` (K,) at a `time` (K,) [s], each lasting from `start` to `end` (K,) [s].

    `called` returns the label of a result, drawn next to the smallest ones. `what` is the label of the height
    axis. Below `edge` is a zone.
    """

    start: Floats
    time: Floats
    end: Floats
    height: Floats
    called: Callable[[int], str]
    what: str
    edge: float | None = 1.0


def spans(results: Spans, said: str) -> Figure:
    """Plot results that have a time as spans, with the headline `said`."""
    rows = np.flatnonzero(np.isfinite(results.time) & np.isfinite(results.height))
    start, time, end, height = (
        np.asarray(part, dtype=float)[rows]
        for part in (results.start, results.time, results.end, results.height)
    )
    figure, (axes,) = chart(5.2)
    first, last = (float(start.min()), float(end.max())) if len(time) else (0.0, 1.0)
    first, last = (first, last) if last > first else (first - 0.5, last + 0.5)
    ticks, room = Clock(plain_unit(last - first)), 0.03 * (last - first)
    tint = AFTER if results.edge is None else np.where(height < results.edge, CONFLICT, AFTER)
    if results.edge is not None:
        zone_band(axes, results.edge)
    if len(time):
        lines = np.stack([np.stack([ticks(start), height], 1), np.stack([ticks(end), height], 1)], 1)
        axes.add_collection(LineCollection(list(lines), colors=tint, linewidths=2.0, alpha=0.6))
        axes.scatter(ticks(time), height, s=26.0, c=tint, zorder=4, clip_on=False)
    most = float(height.max(initial=results.edge or 0.0)) or 1.0
    if results.edge is not None and most > WIDE * results.edge:
        axes.set_yscale("symlog", linthresh=2.0 * results.edge)
    axes.set_ylim(0.0, 1.12 * most)
    axes.set_ylabel(results.what)
    time_axes([axes], ticks, first - room, last + room)
    least = np.argsort(height, kind="stable")[:LABELLED]
    points = np.column_stack([ticks(time), height])[least]
    label(axes, points, [results.called(int(k)) for k in rows[least]], spots=NEAR)
    headline(figure, said)
    return figure


def intervals(
    names: Sequence[str], values: ArrayLike, low: ArrayLike, high: ArrayLike, what: str, said: str
) -> Figure:
    """Plot a row for each of the first 40 names: a dot at its value, and a line from `low` to `high`."""
    value, below, above = (np.ravel(np.asarray(part, dtype=float))[:MOST] for part in (values, low, high))
    rows = np.arange(len(value))[::-1]
    figure, (axes,) = chart(1.9 + 0.34 * max(2, len(rows)))
    axes.hlines(rows, below, above, color=AFTER, linewidth=5.0, alpha=0.35)
    axes.plot(value, rows, "o", color=AFTER, markersize=7, linestyle="")
    name_rows(axes, rows, list(names)[: len(rows)])
    axes.set_ylim(-0.6, len(rows) - 0.4)
    axes.set_xlabel(what)
    headline(figure, said)
    return figure


def name_rows(axes: Axes, levels: Any, names: Sequence[str], tints: Sequence[Any] = ()) -> None:
    """Write the names of rows on the left of axes."""
    axes.set_yticks(levels, list(names), fontsize=SMALL if len(names) <= 20 else SMALL - 3)
    axes.tick_params(axis="y", length=0)
    for k, text in enumerate(axes.get_yticklabels()):
        plain(text).set_color(tints[k] if len(tints) else INK)


def timeline(axes: Axes, ticks: Clock, rows: Sequence[tuple[str, Any, Floats]]) -> None:
    """Draw rows of bars: a name, a colour, and intervals (K, 2) [s]; edges keep short bars visible."""
    axes.grid(visible=False, axis="y")
    for row, (name, colour, bars) in enumerate(rows):
        axes.axhline(row, color=OTHER, linewidth=0.7, zorder=1)
        begin, over = ticks(np.reshape(bars, (-1, 2)).T)
        widths = np.column_stack([begin, over - begin])
        look: dict[str, Any] = {"facecolors": colour, "edgecolors": colour, "linewidth": 0.8}
        axes.broken_barh(widths.tolist(), (row - 0.3, 0.6), label=name, zorder=2, **look)
    name_rows(axes, range(len(rows)), [name for name, *_ in rows], [colour for _, colour, _ in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
