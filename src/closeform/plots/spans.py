"""Answers against time: a dot for each, a line over the time that it lasts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from closeform.arrays import Floats
from closeform.plots.fonts import plain
from closeform.plots.palette import AFTER, CONFLICT, INK
from closeform.plots.style import SMALL, Clock, chart, headline, plain_unit, time_axes, zone_band

NAMED = 6  # of the least, whose names stand beside them
APART = (0.08, 0.06)  # of the axes: dots that are nearer share the name of the least
MARGIN = 0.03  # of the time, before and after it
FAR = 30.0  # times the least or the zone: farther ones have a logarithmic axis


@dataclass(frozen=True, eq=False)
class Spans:
    """K answers: a `height` (K,) at a `time` (K,) [s], of what lasts from `start` to `end` (K,) [s].

    What is `called` by its index stands beside the least; `what` the height is; below an `edge` is a zone.
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
        """Which of them (K,) have a time and a height."""
        return np.isfinite(self.time) & np.isfinite(self.height)


def spans(told: Spans, said: str) -> Figure:
    """Their picture, with a headline that says what they are; those without a time are left out."""
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
    for k in np.argsort(height, kind="stable")[:NAMED].tolist():
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
