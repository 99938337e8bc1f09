"""Figure of the free-drift trajectories of a spacecraft after a loss of thrust, relative to another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.plots.drifts import RING, Failed, told
from closeform.plots.fonts import plain, short_names
from closeform.plots.inputs import one_craft
from closeform.plots.palette import AFTER, CONFLICT, DIRECTIONS, INK, ZONE
from closeform.plots.style import (
    HALO,
    SMALL,
    TEXT,
    area,
    clock,
    dress,
    headline,
    instants,
    legend,
    length_unit,
    sheet,
)
from closeform.plots.zones_and_tracks import headings, place, spot, square
from closeform.zones.outlines import drawn, shadow
from closeform.zones.zone import Zone

FAN = 36  # number of failed motions drawn
LAST, MOST = 3.0, 32.0  # orbits drawn: of the worst before its closest approach, of any near the zone
CURVE = "#d9a7a0"  # of a failed motion that enters the zone
QUIET = "#a9c4d6"  # of one that does not
ZONED = "keep-out zone; tracks pass before it or behind"


def drift_fan(
    path: Path, other: Path, zone: Zone, until: float, names: Sequence[str] | None = None
) -> Figure:
    """Plot the free drift after a loss of thrust, relative to another spacecraft, for a fan of failures.

    Thin lines are failures at equal time steps; red ones enter the zone. The thick line is the certified
    worst case. The left panel shows the planned path, one orbit of each failed motion, and the worst one up
    to its closest approach. The right panel looks along the track. It shows the parts of the drift (at most
    32 orbits) that are no further ahead or behind than the zone extends.

    Parameters
    ----------
    path : Path
        Path of the failing spacecraft.
    other : Path
        Path of the other spacecraft, up to the end of the drift.
    zone : Zone
        Keep-out zone of the pair.
    until : float [s]
        End of the drift, as in `drift_approach`.
    names : sequence of str, optional
        Names of the two spacecraft.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If a path is a batch, the number of names is not two, or under the same conditions as
        `drift_approach`.
    """
    one_craft("path", path)
    one_craft("other", other)
    called = short_names(names, 2) if names is not None else ["The craft", "the other"]
    found = Failed.of(path, other, zone, until)
    figure = sheet(6.6)
    left, right = (area(figure, 0.95 + 5.25 * k, 1.4, 4.25, 4.25) for k in range(2))
    for axes in (left, right):
        axes.yaxis.set_label_coords(-0.15, 0.5)
    whole(left, found)
    abeam(right, found)
    plain(left.set_title(f"relative to {called[1]}, from the side", fontsize=TEXT, color=INK))
    right.set_title("abeam of the zone, seen along the track", fontsize=TEXT, color=INK)
    handles, words = left.get_legend_handles_labels()
    legend(figure, handles, words, ncols=3)
    worst, ticks = found.worst, clock(path, path.start, path.end)
    fate = "stays clear" if worst.ratio > 1.0 else "drifts into the zone"
    headline(figure, f"{called[0]} {fate}: {told(found, ticks)}")
    return figure


def whole(axes: Axes, found: Failed) -> None:
    """Draw the planned path, and the failed motions that leave it."""
    path, zone = found.path, found.zone
    course = gap(found, None, instants(path.start, path.end, path))
    size = float(drawn(zone).extents.max())
    reach = np.vstack([course, np.eye(3) * size, -np.eye(3) * size])
    unit = length_unit(float(np.abs(reach).max()))
    show = np.eye(3)[[1, 0]] / unit.size
    place(axes, shadow(zone, show), (0, 0), facecolor=ZONE, edgecolor=ZONE, alpha=0.35, label=ZONED)
    said = set()
    for k in picked(found):
        unsafe = bool(found.ratios[k] <= 1.0)
        label = "thrust lost, enters the zone" if unsafe else "thrust lost, stays clear"
        track = show @ gap(found, found.times[k], span(found, found.times[k], found.met[k])).T
        tint, level = (CURVE, 2.2) if unsafe else (QUIET, 2.1)
        axes.plot(*track, color=tint, linewidth=0.9, zorder=level, label=None if label in said else label)
        said.add(label)
    axes.plot(*(show @ course.T), color=INK, linewidth=2.4, label="as planned", zorder=3)
    bold(axes, found, show)
    low, high = (show @ reach.T).min(axis=1), (show @ reach.T).max(axis=1)
    square(axes, (low + high) / 2, 0.62 * float((high - low).max()))
    headings(axes, lambda points: points @ show.T, [course], [INK])
    for word, time, face in (("start", path.start, "white"), ("end", path.end, INK)):
        point = spot(show, gap(found, None, np.array([time]))[0])
        axes.plot(*point, "o", color=INK, markersize=6, markerfacecolor=face, zorder=5)
        text = axes.annotate(word, point, (7, 7), textcoords="offset points", fontsize=SMALL, color=INK)
        text.set(path_effects=HALO)
    labelled(axes, (1, 0), unit.name)


def abeam(axes: Axes, found: Failed) -> None:
    """Draw the parts of the failed motions within the along-track extent of the zone."""
    zone, worst = found.zone, found.worst
    unit = length_unit(float(drawn(zone).extents.max()))
    show = np.eye(3)[[2, 0]] / unit.size
    outline = shadow(zone, show)
    place(axes, outline, (0, 0), facecolor=ZONE, edgecolor=ZONE, alpha=0.35)
    for k in picked(found):
        unsafe = bool(found.ratios[k] <= 1.0)
        track = beside(found, found.times[k])
        axes.plot(
            *(show @ track.T), color=CURVE if unsafe else QUIET, linewidth=0.9, zorder=2.1 + 0.1 * unsafe
        )
    tint = CONFLICT if worst.ratio <= 1.0 else AFTER
    axes.plot(*(show @ beside(found, worst.failed_at).T), color=tint, linewidth=2.0, zorder=4)
    if np.isfinite(worst.time):
        nearest = spot(show, gap(found, worst.failed_at, np.array([worst.time]))[0])
        axes.plot(*nearest, "o", color=tint, zorder=6, **RING)
    square(axes, (0, 0), max(2.6, 1.3 * min(worst.ratio, 5.0)) * float(np.abs(outline).max()))
    labelled(axes, (2, 0), unit.name)


def beside(found: Failed, failed_at: float) -> Floats:
    """Return a failed motion (K, 3), nan outside the along-track extent of the zone."""
    period, end = found.path.orbit.period, found.until
    if np.isfinite(period):
        end = min(end, failed_at + MOST * period)
    count = int(np.clip(300 * (end - failed_at) / period, 600, 300 * MOST)) if np.isfinite(period) else 2000
    track = gap(found, failed_at, np.linspace(failed_at, end, count))
    ahead, behind = drawn(found.zone).support(np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]))
    far = (track[:, 1] > ahead) | (track[:, 1] < -behind)
    track[far] = np.nan
    return track


def bold(axes: Axes, found: Failed, show: Floats) -> None:
    """Draw the worst failure up to its closest approach; of many orbits, the first and the last."""
    worst, period = found.worst, found.path.orbit.period
    tint = CONFLICT if worst.ratio <= 1.0 else AFTER
    track = show @ gap(found, worst.failed_at, span(found, worst.failed_at, worst.time)).T
    if np.isfinite(worst.time):
        last = max(worst.failed_at, worst.time - (LAST * period if np.isfinite(period) else np.inf))
        ending = show @ gap(found, worst.failed_at, np.linspace(last, worst.time, 600)).T
        axes.plot(*ending, color=tint, linewidth=2.2, zorder=4)
    axes.plot(*track, color=tint, linewidth=2.2, zorder=4, label="the worst of all failures")
    begin = spot(show, gap(found, None, np.array([worst.failed_at]))[0])
    axes.plot(
        *begin, "X", color=tint, markersize=9, markeredgecolor="white", zorder=6, label="thrust is lost"
    )
    if np.isfinite(worst.time):
        nearest = spot(show, gap(found, worst.failed_at, np.array([worst.time]))[0])
        axes.plot(*nearest, "o", color=tint, zorder=6, label="nearest", **RING)


def picked(found: Failed) -> Any:
    """Return the indices of the failures to draw."""
    wanted = np.linspace(found.times[0], found.times[-1], FAN)
    return np.unique(np.searchsorted(found.times, wanted).clip(0, len(found.times) - 1))


def gap(found: Failed, failed_at: float | None, times: Floats) -> Floats:
    """Return positions (K, 3) relative to the other spacecraft, planned or drifting since `failed_at`."""
    path, orbit = found.path, found.path.orbit
    if failed_at is None:
        places = path.position(np.minimum(times, path.end))
    else:
        states = orbit.transition(times - failed_at) @ path.state(failed_at)
        places = states[..., :3]
    inside = np.minimum(times, found.other.end)
    beyond = (times - inside)[:, None, None] > 0.0
    flown = found.other.state(inside)
    carried = np.where(
        beyond[..., 0], np.einsum("tij,tj->ti", orbit.transition(times - inside), flown), flown
    )
    return np.asarray(places - carried[:, :3])


def span(found: Failed, failed_at: float, met: float) -> Floats:
    """Return times after a failure: one orbit, or in deep space up to the closest approach."""
    period = found.path.orbit.period
    soon = (
        failed_at + period if np.isfinite(period) else max(met, failed_at + 0.2 * (found.until - failed_at))
    )
    return np.linspace(failed_at, min(found.until, soon), 300)


def labelled(axes: Axes, plane: tuple[int, int], unit: str) -> None:
    """Set the axis labels."""
    axes.set_xlabel(f"{DIRECTIONS[plane[0]].name} [{unit}]")
    axes.set_ylabel(f"{DIRECTIONS[plane[1]].name} [{unit}]")
    dress(axes)
