"""The paths of a whole formation, before and after, side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.plots.camera import Camera, framing, sheet, triad, word
from closeform.plots.look import (
    AFTER,
    ALONG,
    ALTERNATIVE,
    BEFORE,
    CONFLICT,
    CROSS,
    DIRECTIONS,
    INK,
    OTHER,
    RADIAL,
    SMALL,
    TEXT,
    WIDTH,
    ZONE,
    crafts,
    dress,
    headline,
    instants,
    length_unit,
)
from closeform.plots.matrix import Pairs, labels, ratio_text
from closeform.plots.panels import framed, scale_bar
from closeform.plots.scene import drawn, place, shadow
from closeform.zones.zone import Zone

FEW = 8  # craft up to which colours are those of a list; more have shades from blue to yellow-green
COLOURS = (RADIAL.colour, AFTER, ALTERNATIVE, CROSS.colour, "#56B4E9", "#7a6a00", "#882255", BEFORE)
SHADES = (RADIAL.colour, AFTER, ALONG.colour, "#6aa84f", "#b5bd3a")
NAMED = 20  # craft up to which names are tried
SCENE, FOOT = 0.78, 0.08  # of a view in space: between its words and its scale, and below
PIECES = 48  # of a track, each as near to the viewer as its middle
PLANES = (Camera(np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])), Camera(np.eye(3)[[1, 2, 0]]))
OBLIQUE = Camera.around(-1.0, 0.42, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]))
CLEAR = 11.0  # pixels between a name and a mark
SPOTS = (
    (6, 5, "left"),
    (-6, 5, "right"),
    (6, -11, "left"),
    (-6, -11, "right"),
    (0, 9, "center"),
    (0, -15, "center"),
)


@dataclass(frozen=True, eq=False)
class Formation:
    """All paths at one stage of a plan: positions [m] as they are drawn."""

    title: str
    tracks: list[Floats]
    stays: list[Floats]  # stretches in conflict
    obstacles: list[Floats]
    closest: tuple[Zone, Floats] | None  # zone of the closest pair, where it is then
    story: str  # which pair that is
    conflicts: int  # pairs in conflict
    pairs: int  # pairs that have a zone

    @property
    def points(self) -> Floats:
        """All positions (M, 3), and those that the zone reaches."""
        every = [*self.tracks, *self.obstacles]
        if self.closest is not None:
            zone, centre = self.closest
            every += [centre + s * drawn(zone).extents[None] for s in (-1, 1)]
        return np.vstack(every)


def formation_paths(
    before: Path,
    after: Path,
    names: Sequence[str] | None = None,
    zone: Any = None,
    obstacles: Any = (),
) -> Figure:
    """The paths of a whole formation before and after, side by side, at one scale.

    `before` and `after` are Paths of shape (N,), such as a plan's direct paths and its own; the same
    where nothing changed, which makes one picture.  In an orbit seen along its normal and along the
    radius, in deep space obliquely, where what is nearer passes over what is farther.  A ring is
    the start of a craft, a dot its end; `names`, else the indices, stand at the start where they
    fit.  `obstacles` is a Path of any shape or a sequence of paths.  With a `zone` stretches in
    conflict are strong and the zone of the closest pair is drawn where it is then: one for all, one
    for each craft (or None; of two as in `screen`), or `PairZones`; obstacle k counts as craft N + k.

    Raises ValueError for paths that are not of one shape (N,), another number of names, or
    zones that make none for a pair.
    """
    if not isinstance(after, Path):
        raise ValueError(f"after: expected a Path, got {after!r:.60}; a plan that is not ok has none")
    alike = before.shape == after.shape and before.orbit.mean_motion == after.orbit.mean_motion
    if not alike or len(before.shape) != 1 or not len(before):
        raise ValueError(
            f"before, after: must be of one orbit and one shape (N,), got {before.shape} and {after.shape}"
        )
    others = crafts(obstacles)
    called = labels(names, len(crafts(before)))
    sides = [("Before", before), ("After", after)] if after is not before else [("Paths", before)]
    every = [*called, *(f"obstacle {k}" for k in range(len(others)))]
    stages = [formation(title, paths, others, zone, every) for title, paths in sides]
    deep = not before.orbit.mean_motion
    figure = oblique(stages, called) if deep else planes(stages, called)
    legend(figure, stages)
    headline(figure, verdict(stages, len(called)))
    return figure


def verdict(stages: list[Formation], count: int) -> str:
    """How many pairs are in conflict, in one line."""
    craft = f"{count} craft" if count > 1 else "1 craft"
    if not stages[0].pairs:
        return f"{craft}: {'paths before and after' if len(stages) > 1 else 'all paths'}"
    counted = f"{stages[0].pairs} pair{'s' * (stages[0].pairs > 1)}"
    words = [str(stage.conflicts) if stage.conflicts else "none" for stage in stages]
    if not any(stage.conflicts for stage in stages):
        return f"{craft}, {counted}: all clear{' before and after' if len(stages) > 1 else ''}"
    when = f"{words[0]} in conflict before, {words[1]} after" if len(words) > 1 else f"{words[0]} in conflict"
    return f"{craft}, {counted}: {when}"


def formation(title: str, paths: Path, others: list[Path], zone: Any, called: list[str]) -> Formation:
    """Sample the tracks and find what is in conflict."""
    flown = crafts(paths)
    tracks, passed = (
        [path.position(instants(path.start, path.end, path)) for path in some] for some in (flown, others)
    )
    pairs = Pairs.of([*flown, *others], zone, len(flown))
    stays: list[Floats] = []
    for path, spans in zip(flown, together(pairs, len(flown)), strict=True):
        stays += [path.position(np.linspace(start, end, 60)) for start, end in spans]
    closest, story = None, ""
    if pairs.order:
        near = pairs.order[0]
        one, other = pairs.craft[near].tolist()
        closest = pairs.zone[near], pairs.paths[other].position(pairs.time[near])
        story = f"closest {called[one]} and {called[other]}, {ratio_text(pairs.ratio[near])} × zone"
    return Formation(title, tracks, stays, passed, closest, story, int(pairs.hit.sum()), len(pairs))


def together(pairs: Pairs, count: int) -> list[list[tuple[float, float]]]:
    """When each craft is in conflict with any other: its stays, those that overlap as one."""
    spans: list[list[tuple[float, float]]] = [[] for _ in range(count)]
    for craft, stays in zip(pairs.craft.tolist(), pairs.stays, strict=True):
        for k in craft:
            if k < count:
                spans[k] += [(stay.start, stay.end) for stay in stays]
    merged: list[list[tuple[float, float]]] = []
    for one in spans:
        whole: list[tuple[float, float]] = []
        for start, end in sorted(one):
            if whole and start <= whole[-1][1]:
                whole[-1] = whole[-1][0], max(end, whole[-1][1])
            else:
                whole.append((start, end))
        merged.append(whole)
    return merged


def colours(count: int) -> Floats:
    """A colour (RGBA) of each craft, none of them that of a conflict."""
    if count <= FEW:
        return np.asarray(to_rgba_array(COLOURS[:count]))
    stops = to_rgba_array(SHADES)
    at = np.linspace(0.0, len(stops) - 1.0, count)
    return np.stack([np.interp(at, range(len(stops)), channel) for channel in stops.T], axis=1)


def oblique(stages: list[Formation], called: list[str]) -> Figure:
    """Views from above at an angle, with a scale bar and the axes' directions."""
    wide, high = (WIDTH - 0.2) / len(stages) - 0.1, 5.4
    figure = sheet(high + 1.25)
    points = np.vstack([OBLIQUE(stage.points) for stage in stages])
    middle, width = framing(points, wide, SCENE * high, 1.12)
    width = width or 1.0
    tall = width * high / wide
    floor = middle[1] - (SCENE / 2 + FOOT) * tall
    for column, stage in enumerate(stages):
        left = 0.1 + column * (wide + 0.2)
        axes = area(figure, left, 0.6, wide, high)
        axes.set_xlim(middle[0] - width / 2, middle[0] + width / 2)
        axes.set_ylim(floor, floor + tall)
        framed(axes, stage.title)
        axes.text(0.015, 0.935, stage.story, transform=axes.transAxes, va="top", fontsize=SMALL, color=INK)
        scale_bar(axes, width)
        reach = 0.07 * width
        corner = np.array([axes.get_xlim()[0] + 1.2 * reach, axes.get_ylim()[0] + 1.2 * reach])
        triad(axes, OBLIQUE, corner, reach, dict(zip("xyz", np.eye(3), strict=True)))
        draw(axes, OBLIQUE, 1.0, stage, called)
    return figure


def planes(stages: list[Formation], called: list[str]) -> Figure:
    """Two planes, one above the other, that share the along-track axis and one scale."""
    points = np.vstack([stage.points for stage in stages])
    low, top = points.min(axis=0), points.max(axis=0)
    middle, span = (low + top) / 2, 1.16 * np.maximum(top - low, 0.3 * (top - low).max() or 1.0)
    unit = length_unit(float(span.max()))
    wide = (WIDTH - 1.15) / len(stages) - 0.15
    size = min(wide / span[1], 7.6 / (span[0] + span[2]))  # inches per metre
    heights = size * span[[0, 2]]
    height = float(heights.sum()) + 2.4
    figure = sheet(height)
    bold: dict[str, Any] = {"fontsize": TEXT, "color": INK, "fontweight": "bold"}
    for column, stage in enumerate(stages):
        left, bottom = 0.95 + column * (wide + 0.25), 1.25
        figure.text(left / WIDTH, 1.0 - 0.62 / height, stage.title, **bold)
        for row, up in ((1, 2), (0, 0)):
            axes = area(figure, left, bottom, wide, heights[row])
            bottom += heights[row] + 0.2
            reach = np.array([wide, heights[row]]) / size / 2
            low, top = (middle[[1, up]] - reach) / unit.size, (middle[[1, up]] + reach) / unit.size
            axes.set(xlim=(low[0], top[0]), ylim=(low[1], top[1]))
            dress(axes)
            axes.tick_params(labelbottom=row == 1, labelleft=column == 0)
            axes.yaxis.set_major_locator(MaxNLocator(max(3, int(2 * heights[row]))))
            axes.xaxis.set_major_locator(MaxNLocator(6))
            if row == 1:
                axes.set_xlabel(f"{DIRECTIONS[1].name} [{unit.name}]", fontsize=TEXT, color=INK)
            else:
                axes.set_title(stage.story, loc="left", fontsize=SMALL, color=INK)
            if column == 0:
                axes.set_ylabel(f"{DIRECTIONS[up].name} [{unit.name}]", fontsize=TEXT, color=INK)
            draw(axes, PLANES[row], unit.size, stage, called)
    figure.align_ylabels()
    return figure


def area(figure: Figure, left: float, bottom: float, wide: float, high: float) -> Axes:
    """Axes at a place in inches."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / up, wide / across, high / up))


def draw(axes: Axes, camera: Camera, unit: float, stage: Formation, called: list[str]) -> None:
    """Everything in one view."""
    tints = colours(len(called))
    many = len(called) > NAMED
    if stage.obstacles:
        lines = [camera(track) / unit for track in stage.obstacles]
        axes.add_collection(LineCollection(lines, colors=OTHER, linewidths=1.2, label="obstacles"))
        ends = np.array([line[-1] for line in lines])
        axes.plot(*ends.T, "s", color=OTHER, markersize=4)
    if stage.closest is not None:
        zone, centre = stage.closest
        outline = shadow(zone, camera.basis[:2]) / unit
        filled: dict[str, Any] = {"facecolor": ZONE, "edgecolor": ZONE, "alpha": 0.4, "zorder": 1.5}
        place(axes, outline, camera(centre) / unit, linewidth=1.2, **filled)
    weave(axes, camera, unit, stage.tracks, tints, 1.0 if many else 2.0)
    stays = [camera(track) / unit for track in stage.stays]
    thick = 2.2 if many else 4.5
    axes.add_collection(LineCollection(stays, colors=CONFLICT, linewidths=thick, zorder=3, capstyle="butt"))
    starts = camera(np.array([track[0] for track in stage.tracks])) / unit
    ends = camera(np.array([track[-1] for track in stage.tracks])) / unit
    size = 12.0 if many else 36.0
    axes.scatter(ends[:, 0], ends[:, 1], s=size, c=tints, zorder=4, label="end")
    ring: dict[str, Any] = {"s": 1.6 * size, "facecolors": "none", "edgecolors": tints, "linewidths": 1.4}
    axes.scatter(starts[:, 0], starts[:, 1], **ring, zorder=4.1, label="start")
    if not many:
        name(axes, starts, ends, camera(np.vstack(stage.tracks)) / unit, called, tints)


def weave(axes: Axes, camera: Camera, unit: float, tracks: list[Floats], tints: Floats, width: float) -> None:
    """Tracks in pieces, from back to front, each with a white edge that parts it from those behind."""
    pieces, depths, looks = [], [], []
    for track, tint in zip(tracks, tints, strict=True):
        seen = camera(track) / unit
        cuts = np.unique(np.linspace(0, len(track) - 1, PIECES + 1).astype(int))
        for first, last in zip(cuts[:-1], cuts[1:], strict=True):
            pieces.append((seen[first : last + 1], seen[max(first - 1, 0) : last + 2]))  # they overlap
            depths.append(float(camera.nearness(track[(first + last) // 2])))
            looks.append(tint)
    lines: list[Floats] = []
    paint: list[Any] = []
    order = 0.008 * float(np.ptp(depths)) * np.linspace(0.0, 1.0, len(depths))  # parts those that are as near
    for k in np.argsort(depths + order, kind="stable"):
        lines += pieces[k]
        paint += [(1.0, 1.0, 1.0, 1.0), looks[k]]
    widths = [width + 1.6, width] * len(pieces)
    axes.add_collection(LineCollection(lines, colors=paint, linewidths=widths, zorder=2, capstyle="butt"))


def name(axes: Axes, points: Floats, ends: Floats, tracks: Floats, called: list[str], tints: Floats) -> None:
    """Names beside points (N, 2), clear of each other and of `ends`, where they cover least `tracks`."""
    renderer = FigureCanvasAgg(axes.get_figure(root=True)).get_renderer()
    inside = axes.get_window_extent()
    marks, lines = axes.transData.transform(np.vstack([points, ends])), axes.transData.transform(tracks)
    taken = [written.get_window_extent(renderer) for written in axes.texts]
    for point, text, tint in zip(points, called, tints, strict=True):
        label = word(axes, point, text, to_hex(0.75 * tint[:3]), va="baseline", zorder=6)
        free: list[Any] = []
        for right, up, align in SPOTS:
            label.set(position=(right, up), ha=align)
            box = label.get_window_extent(renderer)
            out = box.x0 < inside.x0 or box.x1 > inside.x1 or box.y0 < inside.y0 or box.y1 > inside.y1
            if not (covered(marks, box.padded(CLEAR)) or out or any(box.overlaps(other) for other in taken)):
                free.append((covered(lines, box), len(free), (right, up), align, box))
        if not free:
            label.remove()
            continue
        _, _, spot, align, box = min(free)
        label.set(position=spot, ha=align)
        taken.append(box)


def covered(points: Floats, box: Bbox) -> int:
    """How many points (N, 2) a box covers."""
    return int(((points > box.min) & (points < box.max)).all(axis=1).sum())


def legend(figure: Figure, stages: list[Formation]) -> None:
    """What the marks mean."""
    ring: dict[str, Any] = {"linestyle": "", "marker": "o", "color": INK}
    handles: list[Any] = [
        Line2D([], [], markerfacecolor="none", markersize=8, label="start", **ring),
        Line2D([], [], markersize=6, label="end", **ring),
    ]
    if any(stage.stays for stage in stages):
        handles.append(Line2D([], [], color=CONFLICT, linewidth=4.5, label="in conflict"))
    if any(stage.closest for stage in stages):
        handles.append(Patch(facecolor=ZONE, edgecolor=ZONE, alpha=0.4, label="zone of the closest pair"))
    if stages[0].obstacles:
        handles.append(Line2D([], [], color=OTHER, linewidth=1.2, label="obstacles"))
    figure.legend(
        handles=handles,
        loc="lower center",
        bbox_to_anchor=(0.5, 0.0),
        ncols=len(handles),
        frameon=False,
        fontsize=SMALL,
    )
