"""Figure of the paths of a formation before and after a plan, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.plots.camera import AXES, FOOT, OBLIQUE, ORBITAL, Camera, framed, layered, window
from closeform.plots.fonts import plain, short_names
from closeform.plots.inputs import crafts, one_path, same
from closeform.plots.label_placement import Names
from closeform.plots.palette import CONFLICT, DIRECTIONS, INK, OTHER, ZONE, colours
from closeform.plots.style import SMALL, TEXT, WIDTH, Unit, area, dress, headline, legend, length_unit, sheet
from closeform.plots.tracks import NAMED, Formation
from closeform.plots.zones_and_tracks import headings, place
from closeform.zones.combined_zones import OwnZone
from closeform.zones.outlines import shadow
from closeform.zones.pair_zones import PairZones

HEAD = 0.75  # inches for the text of a view in space
PLANES = (  # axes to the right and up, and the camera for that view
    (1, 0, Camera(np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]))),
    (1, 2, Camera(np.eye(3)[[1, 2, 0]])),
    (2, 0, Camera(np.eye(3)[[2, 0, 1]])),
)
FLAT = np.array([0.2, 0.3, 0.33])  # of the longest side: minimum extent shown along each axis
SIDE, STEP, WORDS, UPPER, BELOW = 1.0, 0.25, 0.7, 0.75, 1.25  # inches: left, between, above and below planes
TALL = 8.4  # inches: total height of stacked planes
NEAREST: dict[str, Any] = {"linestyle": "", "marker": "D", "color": INK, "markersize": 4}
Corners = tuple[tuple[float, float], ...]


def formation_paths(
    before: Path,
    after: Path,
    names: Sequence[str] | None = None,
    zone: OwnZone | Sequence[OwnZone | None] | PairZones | None = None,
    obstacles: Path | Sequence[Path] = (),
) -> Figure:
    """Plot the paths of a formation before and after a plan, side by side at one scale.

    Paths in an orbit are shown in the three planes of the orbital frame. Paths in deep space are shown
    obliquely, with nearer tracks over farther ones. A ring marks the start of a path and a dot its end.

    With zones, stretches in conflict are thick. The zone of the closest pair is drawn at the time of closest
    approach, around an obstacle if one is involved, otherwise around the spacecraft with less delta-v or the
    shorter track.

    For more than 200 spacecraft, only those of the closest pairs (at most 20) and a faint sample of the
    others are drawn. Conflicts are drawn for all.

    Parameters
    ----------
    before, after : Path
        Paths of shape (N,), such as the direct paths and the paths of a plan; one panel is drawn if both are
        the same.
    names : sequence of str, optional
        Names of the spacecraft, drawn at the starts where they fit; default: their indices.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones, optional
        One zone for all spacecraft or one for each, combined for a pair as in `screen` (None: no zone of its
        own); obstacle k counts as spacecraft N + k.
    obstacles : Path or sequence of Path, default none
        Path of any shape, or a sequence of paths.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If the paths differ in shape (N,) or orbit, the number of names is wrong, two zones cannot be combined
        for a pair, or an argument has the wrong type.
    """
    one_path("before", before)
    one_path("after", after)
    alike = before.shape == after.shape and before.orbit.mean_motion == after.orbit.mean_motion
    if not alike or len(before.shape) != 1 or not len(before):
        raise ValueError(
            f"before, after: must be of one orbit and one shape (N,), got {before.shape} and {after.shape}"
        )
    others = crafts("obstacles", obstacles)
    called = short_names(names, len(crafts("before", before)))
    sides = [("Paths", before)] if same(before, after) else [("Before", before), ("After", after)]
    every = [*called, *(f"obstacle {k}" for k in range(len(others)))]
    stages: list[Formation] = []
    for title, paths in sides:
        shown = stages[0].shown if stages else None
        stages.append(Formation.of(title, paths, others, zone, every, shown))
    named = [called[k] for k in stages[0].shown]
    figure = planes(stages, named) if before.orbit.mean_motion else oblique(stages, named)
    marks(figure, stages)
    headline(figure, verdict(stages, len(called)))
    return figure


def verdict(stages: list[Formation], count: int) -> str:
    """Return the headline: how many pairs are in conflict."""
    craft = f"{count} craft" if count > 1 else "1 craft"
    if not stages[0].pairs:
        if stages[0].faint:
            return f"{craft}: the closest pairs"
        return f"{craft}: {'paths before and after' if len(stages) > 1 else 'all paths'}"
    counted = f"{stages[0].pairs} pair{'s' * (stages[0].pairs > 1)}"
    words = [str(stage.conflicts) if stage.conflicts else "none" for stage in stages]
    if not any(stage.conflicts for stage in stages):
        return f"{craft}, {counted}: paths clear{' before and after' if len(stages) > 1 else ''}"
    when = (
        f"{words[0]} in conflict before, {words[1]} after"
        if len(words) > 1
        else f"{words[0]} in conflict{stages[0].named}"
    )
    return f"{craft}, {counted}: {when}"


def oblique(stages: list[Formation], called: list[str]) -> Figure:
    """Return a figure of oblique views, each with a scale bar and the directions of the axes."""
    high = 5.4
    points = np.vstack([OBLIQUE(stage.points) for stage in stages])
    wide = (WIDTH - 0.2) / len(stages) - 0.1
    if len(stages) == 1:
        across, up = np.ptp(points, axis=0)
        wide = float(np.clip(1.2 * (high - HEAD - FOOT) * across / up if up else wide, 6.4, wide))
    figure = sheet(high + 1.3, len(stages) * (wide + 0.2))
    names = Names(figure, called if len(called) <= NAMED else ())
    for k, stage in enumerate(stages):
        axes = area(figure, 0.1 + k * (wide + 0.2), 0.7, wide, high)
        window(axes, points, OBLIQUE, "xyz", HEAD)
        framed(axes, stage.title)
        said = axes.text(0.015, 0.935, stage.story, transform=axes.transAxes, va="top", fontsize=SMALL)
        plain(said).set_color(INK)
        in_space(axes, OBLIQUE, stage, names)
    return figure


def planes(stages: list[Formation], called: list[str]) -> Figure:
    """Return a figure of the three planes of each stage at one scale; a single stage has a space view."""
    points = np.vstack([stage.points for stage in stages])
    middle, span, unit = extent(points, 1.16)
    lone = len(stages) == 1
    size, (wide, high), corners = (beside if lone else below)(span)
    figure = sheet(high, wide)
    names = Names(figure, called if len(called) <= NAMED else ())
    for k, stage in enumerate(stages):
        left = k * (wide - SIDE) / 2
        titled(figure, SIDE + left, stage, lone)
        for (across, up, camera), (x, y) in zip(PLANES, corners, strict=True):
            pair = [across, up]
            left_most, lowest = owned((x, y), corners)
            place_of = left + x, y, *(size * span[pair])
            axes = plane(figure, place_of, pair, middle, span, unit, (left_most and k == 0, lowest))
            draw(axes, camera, unit.size, stage, names)
        if lone:
            space = area(figure, corners[2][0], corners[1][1], size * span[2], size * span[2])
            window(space, ORBITAL(points), ORBITAL, AXES, 0.1)
            framed(space, "")
            in_space(space, ORBITAL, stage, names)
    return figure


def extent(points: Floats, room: float) -> tuple[Floats, Floats, Unit]:
    """Return middle (3,) and span (3,) [m] of points (M, 3) with a minimum span per axis, and the unit."""
    low, top = points.min(axis=0), points.max(axis=0)
    span = room * np.maximum(top - low, FLAT * ((top - low).max() or 1.0))
    return (low + top) / 2, span, length_unit(float(span.max()))


def plane(
    figure: Figure,
    place: tuple[float, ...],
    pair: list[int],
    middle: Floats,
    span: Floats,
    unit: Unit,
    own: tuple[bool, bool],
) -> Axes:
    """Add axes of one plane at a place in inches; `pair` holds the directions to the right and up."""
    axes = area(figure, *place)
    limits = (middle[pair] + np.array([[-0.5], [0.5]]) * span[pair]) / unit.size
    axes.set(xlim=limits[:, 0], ylim=limits[:, 1])
    dress(axes)
    scaled(axes, pair, unit, np.asarray(place[2:]), own)
    return axes


def three_planes(
    points: Floats, room: float, below: float = 0.0
) -> tuple[Figure, Unit, list[tuple[Axes, Camera, list[int]]]]:
    """Return a figure with three planes that hold points (M, 3), its unit, and axes, camera and directions.

    `below` reserves inches below the planes; the square in the lower right corner stays free.
    """
    middle, span, unit = extent(points, room)
    size, (wide, high), corners = beside(span)
    figure = sheet(high + below, wide)
    made = []
    for (across, up, camera), corner in zip(PLANES, corners, strict=True):
        pair, (x, y) = [across, up], corner
        inches = (x, y + below, *(size * span[pair]))
        made.append((plane(figure, inches, pair, middle, span, unit, owned(corner, corners)), camera, pair))
    return figure, unit, made


def space_corner(figure: Figure, upper: Axes, lower: Axes) -> Axes:
    """Add square axes below the `upper` right plane, beside the `lower` left one."""
    wide, high = figure.get_size_inches()
    left, _, across, _ = upper.get_position(original=True).bounds
    low = lower.get_position(original=True).y0
    return area(figure, left * wide, low * high, across * wide, across * wide)


def beside(span: Floats) -> tuple[float, tuple[float, float], Corners]:
    """Return inches per metre, figure size and plane corners for one stage with a view in space."""
    radial, along, cross = span
    room = WIDTH - SIDE - 2 * STEP
    size = min(room / (along + cross), (TALL - WORDS) / (radial + cross))
    right, upper = SIDE + size * along + STEP, BELOW + size * cross + WORDS
    whole = right + size * cross + STEP, upper + size * radial + UPPER
    return size, whole, ((SIDE, upper), (SIDE, BELOW), (right, upper))


def below(span: Floats) -> tuple[float, tuple[float, float], Corners]:
    """Return inches per metre, figure size and plane corners for two stages with stacked planes."""
    radial, along, cross = span
    size = min((WIDTH - SIDE) / 2 - STEP, TALL * max(along, cross) / (2 * radial + cross)) / max(along, cross)
    middle = BELOW + size * radial + WORDS
    upper = middle + size * cross + STEP
    whole = SIDE + 2 * (size * max(along, cross) + STEP), upper + size * radial + UPPER + 0.3
    return size, whole, ((SIDE, upper), (SIDE, middle), (SIDE, BELOW))


def owned(corner: tuple[float, float], corners: Corners) -> tuple[bool, bool]:
    """Return whether a plane has its own tick labels on the left and below."""
    return corner[0] == SIDE, corner != corners[0]


def titled(figure: Figure, left: float, stage: Formation, lone: bool) -> None:
    """Add the title of a stage, unless it is alone, and its closest pair."""
    wide, high = figure.get_size_inches()
    if not lone:
        figure.text(left / wide, 1.0 - 0.62 / high, stage.title, fontsize=TEXT, color=INK, fontweight="bold")
    said = figure.text(left / wide, 1.0 - (0.55 if lone else 0.88) / high, stage.story, fontsize=SMALL)
    plain(said).set_color(INK)


def scaled(axes: Axes, pair: list[int], unit: Unit, inches: Floats, own: tuple[bool, bool]) -> None:
    """Set ticks and labels of both axes of a plane; `own` selects the axes that carry labels."""
    axes.xaxis.set_major_locator(MaxNLocator(max(2, int(1.3 * inches[0]))))
    axes.yaxis.set_major_locator(MaxNLocator(max(2, int(2 * inches[1]))))
    axes.tick_params(labelleft=own[0], labelbottom=own[1])
    look: dict[str, Any] = {"fontsize": TEXT, "color": INK}
    if own[0]:
        axes.set_ylabel(f"{DIRECTIONS[pair[1]].name} [{unit.name}]", **look)
        axes.yaxis.set_label_coords(-0.72 / inches[0], 0.5)
    if own[1]:
        axes.set_xlabel(f"{DIRECTIONS[pair[0]].name} [{unit.name}]", **look)
        axes.xaxis.set_label_coords(0.5, -0.3 / inches[1])


def draw(axes: Axes, camera: Camera, unit: float, stage: Formation, names: Names) -> None:
    """Draw a stage in one plane, with each track as one line."""
    tints = colours(len(stage.tracks))
    thin = len(stage.tracks) > NAMED
    lines = [camera(track) / unit for track in stage.tracks]
    axes.add_collection(LineCollection(lines, colors=tints, linewidths=1.0 if thin else 2.0, zorder=2))
    around(axes, camera, unit, stage, tints, names)


def in_space(axes: Axes, camera: Camera, stage: Formation, names: Names) -> None:
    """Draw a stage in space, with tracks ordered from back to front."""
    tints, width = colours(len(stage.tracks)), 1.0 if len(stage.tracks) > NAMED else 2.0
    whose, pieces = layered(camera, stage.tracks)
    axes.add_collection(LineCollection(pieces, colors=tints[whose], linewidths=width, zorder=2))
    around(axes, camera, 1.0, stage, tints, names)


def around(axes: Axes, camera: Camera, unit: float, stage: Formation, tints: Floats, names: Names) -> None:
    """Draw everything but the tracks: obstacles, closest zone, conflicts, starts, ends and names."""
    many = len(stage.tracks) > NAMED
    if stage.faint:
        lines = [camera(track) / unit for track in stage.faint]
        axes.add_collection(LineCollection(lines, colors=OTHER, linewidths=0.5, alpha=0.3, zorder=1.2))
    if stage.obstacles:
        lines = [camera(track) / unit for track in stage.obstacles]
        axes.add_collection(LineCollection(lines, colors=OTHER, linewidths=1.2, label="obstacles"))
        axes.plot(*np.array([line[-1] for line in lines]).T, "s", color=OTHER, markersize=4)
    if stage.closest is not None:
        centre, other = camera(np.array([stage.closest.centre, stage.closest.other])) / unit
        if (zone := stage.closest.zone) is not None:
            filled: dict[str, Any] = {"facecolor": ZONE, "edgecolor": ZONE, "alpha": 0.4, "zorder": 1.5}
            place(axes, shadow(zone, camera.basis[:2]) / unit, centre, linewidth=1.2, **filled)
        axes.plot(*np.array([centre, other]).T, **NEAREST, zorder=4.2)
    stays = [camera(track) / unit for track in stage.stays]
    thick = 2.2 if many else 4.5
    axes.add_collection(LineCollection(stays, colors=CONFLICT, linewidths=thick, zorder=3, capstyle="butt"))
    starts, ends = (camera(np.array([track[k] for track in stage.tracks])) / unit for k in (0, -1))
    size = 12.0 if many else 36.0
    axes.scatter(ends[:, 0], ends[:, 1], s=size, c=tints, zorder=4, label="end")
    ring: dict[str, Any] = {"s": 1.6 * size, "facecolors": "none", "edgecolors": tints, "linewidths": 1.4}
    axes.scatter(starts[:, 0], starts[:, 1], **ring, zorder=4.1, label="start")
    flown = headings(axes, lambda points: camera(points) / unit, stage.tracks, tints, 3.5 if many else 6.0)
    if names.called:
        marks = np.vstack([ends, flown, *([] if stage.closest is None else [centre, other])])
        names.beside(axes, starts, marks, camera(np.vstack(stage.tracks)) / unit, tints)


def marks(figure: Figure, stages: list[Formation]) -> None:
    """Add the legend."""
    ring: dict[str, Any] = {"linestyle": "", "marker": "o", "color": INK}
    handles: list[Any] = [
        Line2D([], [], markerfacecolor="none", markersize=8, label="start", **ring),
        Line2D([], [], markersize=6, label="end", **ring),
    ]
    if any(stage.stays for stage in stages):
        handles.append(Line2D([], [], color=CONFLICT, linewidth=4.5, label="in conflict"))
    if any(stage.closest for stage in stages):
        handles.append(Line2D([], [], **NEAREST, label="closest pair then"))
    if any(stage.closest and stage.closest.zone for stage in stages):
        handles.append(Patch(facecolor=ZONE, edgecolor=ZONE, alpha=0.4, label="its zone"))
    if stages[0].faint:
        label = f"{len(stages[0].faint)} of the others"
        handles.append(Line2D([], [], color=OTHER, linewidth=1.0, alpha=0.6, label=label))
    if stages[0].obstacles:
        handles.append(Line2D([], [], color=OTHER, linewidth=1.2, label="obstacles"))
    columns = len(handles) if figure.get_figwidth() > 1.6 * len(handles) else 3
    legend(figure, handles, [handle.get_label() for handle in handles], ncols=columns, columnspacing=1.4)
