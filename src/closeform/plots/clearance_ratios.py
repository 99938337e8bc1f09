"""Clearance ratio of one spacecraft to its obstacles, against time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from closeform.arrays import Floats, instance
from closeform.conflicts.two_paths import closest_approach, nearest_first
from closeform.motion.path import Path
from closeform.plots.fonts import short_names
from closeform.plots.inputs import crafts, one_craft
from closeform.plots.palette import AFTER, BEFORE, CONFLICT
from closeform.plots.style import (
    DASHED,
    SMALL,
    Clock,
    chart,
    clock,
    common_time,
    headline,
    instants,
    legend,
    time_axes,
    zone_band,
)
from closeform.zones.zone import Zone


@dataclass(frozen=True)
class Nearness:
    """Clearance ratios of one path relative to its obstacles, and the exact minimum of all."""

    times: Floats
    norms: Floats  # (obstacles, times); nan where the two share no time
    ratio: float
    time: float
    nearest: int

    @classmethod
    def of(cls, path: Path, obstacles: list[Path], zone: Zone) -> Nearness:
        """Sample the ratios; raise ValueError if an obstacle shares no time with the path."""
        times = instants(path.start, path.end, path, *obstacles)
        norms = np.full((len(obstacles), len(times)), np.nan)
        for row, obstacle in zip(norms, obstacles, strict=True):
            start, end = common_time(path, obstacle)
            both = (times >= start) & (times <= end)
            row[both] = zone.norm(path.position(times[both]) - obstacle.position(times[both]))
        approaches = [closest_approach(path, obstacle, zone) for obstacle in obstacles]
        ranked = [nearest_first(one.ratio, one.time) for one in approaches]
        nearest = ranked.index(min(ranked))
        return cls(times, norms, approaches[nearest].ratio, approaches[nearest].time, nearest)


def ratios(
    before: Path,
    after: Path,
    obstacles: Path | Sequence[Path],
    zone: Zone,
    names: Sequence[str] | None = None,
) -> Figure:
    """Plot the clearance ratio of a spacecraft to its obstacles, before and after; below 1 is a conflict.

    Thin lines are the ratios to each obstacle on the path after, thick lines the minimum of all. A dot marks
    the exact minimum.

    Parameters
    ----------
    before, after : Path
        Paths of one spacecraft; the same path if nothing changed.
    obstacles : Path or sequence of Path
        Path of any shape, or a sequence of paths; at least one.
    zone : Zone
        Keep-out zone around each obstacle.
    names : sequence of str, optional
        Names of the obstacles.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If a path is a batch, there is no obstacle, one shares no time with a path, the number of names is
        wrong, or an argument has the wrong type.
    """
    one_craft("before", before)
    one_craft("after", after)
    instance("zone", zone, Zone)
    others = crafts("obstacles", obstacles)
    if not others:
        raise ValueError("obstacles: give at least one path")
    called = short_names(names, len(others), "obstacles") if names is not None else []
    start, end = min(before.start, after.start), max(before.end, after.end)
    ticks = clock(before, start, end)
    now = Nearness.of(after, others, zone)
    then = now if before is after else Nearness.of(before, others, zone)

    figure, axes = chart(5.9, 1.05)
    zone_band(axes)
    if len(others) > 1:
        axes.plot(ticks(now.times), now.norms.T, color=AFTER, linewidth=0.8, alpha=0.45)
    curves: list[tuple[Nearness, tuple[str, Any, str]]] = []
    if then is not now:
        curves.append((then, (BEFORE, DASHED, "before: ")))
    curves.append((now, (AFTER, "-", "after: " if then is not now else "closest: ")))
    lines, words = zip(*(nearness_line(axes, one, ticks, look, called) for one, look in curves), strict=True)
    legend(figure, lines, words, ncols=len(lines))
    axes.set_ylim(0, ceiling(then, now))
    axes.yaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.set_ylabel("clearance ratio [× zone]")
    axes.text(0.008, 0.03, "keep-out zone", transform=axes.transAxes, fontsize=SMALL, color="#9a6a00")
    time_axes([axes], ticks, start, end)
    change = "" if then is now else f"Before {then.ratio:.2f} × zone, after "
    headline(figure, f"{change or 'Closest '}{now.ratio:.2f} × zone at {ticks.text(now.time)}")
    return figure


def nearness_line(
    axes: Axes, near: Nearness, ticks: Clock, look: tuple[str, Any, str], names: Sequence[str]
) -> tuple[Line2D, str]:
    """Draw the minimum ratio, red below 1; return the line and its minimum as text."""
    colour, dashes, label = look
    least = np.fmin.reduce(near.norms, axis=0)
    when = ticks(near.times)
    (line,) = axes.plot(when, least, color=colour, linestyle=dashes, linewidth=2.4)
    axes.plot(when, np.where(least <= 1, least, np.nan), color=CONFLICT, linewidth=3)
    hit = CONFLICT if near.ratio < 1 else colour
    axes.plot(ticks(near.time), near.ratio, "o", color=hit, markersize=8, zorder=5)
    name = f", {names[near.nearest]}" if names else ""
    return line, f"{label}{near.ratio:.2f} × zone{name} at {ticks.text(near.time)}"


def ceiling(*curves: Nearness) -> float:
    """Return an upper limit that resolves ratios near the zone: five times the largest minimum."""
    most = max(float(np.nanmax(near.norms)) for near in curves)
    return min(1.05 * most, 5 * max(1.0, *(near.ratio for near in curves)))
