"""Distances of two spacecraft against time, with timelines of their conflicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from closeform.arrays import Floats, instance
from closeform.conflicts.two_paths import Conflict, closest_approach, find_conflicts
from closeform.motion.path import Path
from closeform.plots.fonts import short_names
from closeform.plots.palette import CONFLICT, DIRECTIONS, INK, OTHER, ZONE
from closeform.plots.style import (
    SMALL,
    TEXT,
    Clock,
    clock,
    column,
    common_time,
    headline,
    instants,
    length_unit,
    say_scale,
    sheet,
    time_axes,
)
from closeform.zones.shapes import CUBE
from closeform.zones.solids import HalfSpaces
from closeform.zones.zone import Zone

BEYOND = 1e12  # [m] stands for an open side of a zone, beyond all spacecraft
FAR = 20.0  # zone extents above which a distance has a logarithmic scale


def ends(zone: Zone, axis: int) -> Floats:
    """Return the extent of a zone along one axis (2,), forwards and backwards; inf if it is open."""
    way = np.eye(3)[axis]
    return np.asarray(zone.support(np.stack([way, -way])))


def slab(zone: Zone, *those: int) -> Zone:
    """Return the zone of all points within the extent of a zone along some axes."""
    ways = [sign * np.eye(3)[axis] for axis in those for sign in (1.0, -1.0)]
    return HalfSpaces(ways, np.minimum(np.concatenate([ends(zone, axis) for axis in those]), BEYOND))


def distances(path: Path, other: Path, zone: Zone, names: Sequence[str] | None = None) -> Figure:
    """Plot the distance along each axis against time, with zone limits and timelines: SP11 figure 1.

    The shaded bands are the extent of the zone. The bars below show the intervals within the extent along
    each axis, along all three axes (the box around the zone) and, if different, in the zone itself. Their
    edges are the exact times of `find_conflicts`.

    Parameters
    ----------
    path, other : Path
        Paths of one spacecraft each, in one orbit; the position of the first relative to the other is shown.
    zone : Zone
        Keep-out zone around the other spacecraft.
    names : sequence of str, optional
        Names of the two spacecraft.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If a path is a batch, orbits differ, there is no common time, the number of names is not two, or an
        argument has the wrong type.

    References
    ----------
    SP11 (Sauter and Palmer 2011) figure 1.
    """
    instance("zone", zone, Zone)
    start, end = common_time(path, other)
    one, two = short_names(names, 2)
    conflicts = find_conflicts(path, other, zone)
    ticks = clock(path, start, end)
    times = instants(start, end, path, other)
    gaps = path.position(times) - other.position(times)
    rows = bars(path, other, zone, conflicts)

    figure = sheet(8.6)
    panels = column(figure, [1, 1, 1, 0.19 * len(rows) + 0.1], beside=0.65)
    for axis, axes in enumerate(panels[:3]):
        distance_panel(axes, axis, ticks(times), gaps[:, axis], ends(zone, axis))
        for conflict in conflicts:
            axes.axvspan(ticks(conflict.start), ticks(conflict.end), color=CONFLICT, alpha=0.18, linewidth=0)
    bar_panel(panels[3], rows, ticks)
    time_axes(panels, ticks, start, end)
    said = verdict(path, other, zone, conflicts, ticks)
    headline(figure, f"{one} relative to {two}: {said[0].lower()}{said[1:]}" if names is not None else said)
    return figure


def distance_panel(axes: Axes, axis: int, times: Floats, gap: Floats, reach: Floats) -> None:
    """Draw the distance along one axis, with the band of the zone's extent."""
    direction = DIRECTIONS[axis]
    known = reach[np.isfinite(reach)]
    extent = float(known.max(initial=0.0))
    unit = length_unit(max(float(np.abs(gap).max()), extent))
    edge = extent / unit.size
    edge_lines(axes, reach / unit.size)
    axes.plot(times, gap / unit.size, color=direction.colour, linewidth=2.2)
    if np.abs(gap).max() > FAR * extent > 0.0:
        axes.set_yscale("symlog", linthresh=2 * edge, linscale=0.6)
        say_scale(axes, "logarithmic beyond twice the zone")
        farthest = float(np.abs(gap).max()) / unit.size
        decades = 10.0 ** np.arange(np.ceil(np.log10(4 * edge)), np.log10(farthest) + 0.3)
        ticks = [*-decades, 0.0, *decades]
        axes.set_yticks(ticks, [f"{tick:g}".replace("-", "−") for tick in ticks])
        axes.set_yticks([], minor=True)
        low, high = min(gap.min(), -2 * extent), max(gap.max(), 2 * extent)
        axes.set_ylim(1.5 * low / unit.size, 1.5 * high / unit.size)
    low, high = axes.get_ylim()  # an open side extends to them
    forwards, backwards = reach / unit.size
    axes.axhspan(max(low, -backwards), min(high, forwards), color=ZONE, alpha=0.2, linewidth=0)
    axes.set_ylim(low, high)
    axes.set_ylabel(f"{direction.name} [{unit.name}]", fontsize=TEXT, color=direction.colour)


def edge_lines(axes: Axes, reach: Floats) -> None:
    """Draw a line with its distance at each finite end of the zone."""
    edges = {
        edge: text for edge, text in zip(reach * (1.0, -1.0), ("", "−"), strict=True) if np.isfinite(edge)
    }
    for edge in edges:
        axes.axhline(edge, color=ZONE, linewidth=1.2)
    if reach[0] == reach[1]:
        edges = {reach[0]: "±"} if edges else {}
    for edge, sign in edges.items():
        axes.annotate(
            f"{sign}{abs(edge):.3g}",
            (1.0, edge),
            (4, 0),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            fontsize=SMALL,
            color="#9a6a00",
            va="center",
        )


def bars(
    path: Path, other: Path, zone: Zone, conflicts: Sequence[Conflict]
) -> list[tuple[str, str, Sequence[Conflict]]]:
    """Return the rows of the timeline: name, colour and conflicts."""
    rows: list[tuple[str, str, Sequence[Conflict]]] = [
        (d.name, d.colour, find_conflicts(path, other, slab(zone, axis))) for axis, d in enumerate(DIRECTIONS)
    ]
    aligned_box = zone.shape == CUBE and np.count_nonzero(zone.matrix) == 3
    if not aligned_box:
        rows.append(("all three", INK, find_conflicts(path, other, slab(zone, 0, 1, 2))))
    rows.append(("conflict" if aligned_box else "in the zone", CONFLICT, conflicts))
    return rows


def bar_panel(axes: Axes, rows: list[tuple[str, str, Sequence[Conflict]]], ticks: Clock) -> None:
    """Draw the timelines, one row each; edge lines keep the shortest conflict visible."""
    axes.grid(visible=False, axis="y")
    for row, (name, colour, stays) in enumerate(rows):
        axes.axhline(row, color=OTHER, linewidth=0.7, zorder=1)
        spans = [(ticks(stay.start), ticks(stay.end - stay.start)) for stay in stays]
        axes.broken_barh(
            spans, (row - 0.3, 0.6), facecolors=colour, edgecolors=colour, linewidth=0.8, label=name, zorder=2
        )
    axes.set_yticks(range(len(rows)), [name for name, _, _ in rows], fontsize=SMALL)
    for text, (_, colour, _) in zip(axes.get_yticklabels(), rows, strict=True):
        text.set_color(colour)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(rows) - 0.4, -0.6)


def verdict(path: Path, other: Path, zone: Zone, conflicts: Sequence[Conflict], ticks: Clock) -> str:
    """Return the headline: the conflicts, or the closest approach."""
    if not conflicts:
        near = closest_approach(path, other, zone)
        return f"Clear all the time: closest {near.ratio:.2f} × zone at {ticks.text(near.time)}"
    worst = min(conflicts, key=lambda conflict: conflict.ratio)
    unit = ticks.unit.name
    spans = [f"{ticks(c.start):.2f} to {ticks(c.end):.2f}" for c in conflicts]
    listed = f"{', '.join(spans)} {unit}" if len(spans) <= 2 else f"{len(spans)} times"
    return f"In conflict {listed}; deepest {worst.ratio:.2f} × zone at {ticks.text(worst.time)}"
