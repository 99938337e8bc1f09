"""Views in space: cameras, scenes of tracks, marks and zones, and their views in planes and obliquely."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import atan2, cos, sin
from typing import Any, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.markers import MarkerStyle
from matplotlib.patches import FancyArrowPatch
from matplotlib.path import Path as Outline
from matplotlib.text import OffsetFrom
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Affine2D
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar  # type: ignore[import-untyped]
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.plots.drawing.palette import AFTER, CONFLICT, DIRECTIONS, INK, OTHER, ZONE
from closeform.plots.drawing.style import WIDTH, dress, headline, legend, sheet
from closeform.plots.drawing.text import HALO, SMALL, label, plain, word
from closeform.plots.drawing.units import Unit, length_unit, rounded_down
from closeform.search.leg import SUN
from closeform.zones.outlines import CIRCLE, drawn, shadow
from closeform.zones.zone import Zone

GROUP_COLOURS = {"A": AFTER, "B": CONFLICT}
SUN_COLOUR = "#F2B705"
ROMAN = {1: "I", 2: "II", 3: "III", 4: "IV"}  # regions of the complementary cones, S04 figure 5
SUNWARD = np.array([0.0, 0.0, -1.0])  # Sun direction in deep space, as in searches
FLAT = np.array([0.2, 0.3, 0.33])  # of the longest side: minimum extent shown along each axis
WIDE, TALL = 9.0, 6.8  # inches: maximum width and height of all planes of a figure
FRAME = np.array([1.7, 2.4])  # inches: room next to and above the planes for labels, headline and legend
ALONG = 0.35  # of the length of a track: place of its arrow; tracks that swap places cross in the middle
SHORT = 0.04  # of the width of the axes: shorter tracks have no arrow


@dataclass(frozen=True, eq=False)
class Camera:
    """Orthographic camera: the rows of `basis` (3, 3) point right, up and towards the viewer."""

    basis: Floats

    @classmethod
    def at(cls, toward: ArrayLike, up: ArrayLike) -> Self:
        """Return a camera with the viewer in the direction `toward` (3,) and `up` (3,) upwards."""
        back = np.asarray(toward, dtype=float)
        back = back / np.linalg.norm(back)
        right = np.cross(np.asarray(up, dtype=float), back)
        right /= np.linalg.norm(right)
        return cls(np.array([right, np.cross(back, right), back]))

    @classmethod
    def around(cls, azimuth: float, elevation: float, pole: Floats, front: Floats) -> Self:
        """Return a camera above the plane normal to `pole`, at an azimuth from `front`; angles in rad."""
        side = np.cross(pole, front)
        level = cos(azimuth) * front + sin(azimuth) * side
        return cls.at(cos(elevation) * level + sin(elevation) * pole, pole)

    def __call__(self, points: ArrayLike) -> Floats:
        """Project points (..., 3) to the figure plane (..., 2)."""
        return np.asarray(np.asarray(points) @ self.basis[:2].T)

    def nearness(self, points: ArrayLike) -> Floats:
        """Return the coordinate (...) of points (..., 3) towards the viewer."""
        return np.asarray(np.asarray(points) @ self.basis[2])


OBLIQUE = Camera.around(-0.45, 0.5, SUNWARD, np.array([0.0, 1.0, 0.0]))  # the Sun is up
ORBITAL = Camera.at([0.75, -0.45, -0.5], [1.0, 0.0, 0.0])  # radial up, along-track to the right
PLANES = (  # axes to the right and up, and the camera for that view
    ((1, 0), Camera(np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]))),
    ((1, 2), Camera(np.eye(3)[[1, 2, 0]])),
    ((2, 0), Camera(np.eye(3)[[2, 0, 1]])),
)
AXES = dict(zip(("radial", "along", "cross"), np.eye(3), strict=True))
INERTIAL = dict(zip("xyz", np.eye(3), strict=True))


# ----- a scene as data, and its views


@dataclass(frozen=True, eq=False)
class Track:
    """Line through `points` (K, 3) [m]; with an `arrow` that shows the direction of motion."""

    points: Floats
    colour: Any
    width: float = 2.0
    dashes: Any = "-"
    label: str = ""
    arrow: bool = True
    order: float = 2.0


@dataclass(frozen=True, eq=False)
class Mark:
    """Mark at a `point` (3,) [m]; a `name` is written next to it where there is room."""

    point: Floats
    colour: Any
    marker: str = "o"
    face: Any = None  # default: the colour
    size: float = 6.0
    label: str = ""
    name: str = ""
    order: float = 4.0


@dataclass(frozen=True, eq=False)
class Shape:
    """Keep-out zone around a `centre` (3,) [m]."""

    zone: Zone
    centre: Floats
    label: str = "zone"
    colour: str = ZONE
    filled: bool = True


@dataclass(frozen=True, eq=False)
class Scene:
    """Tracks, marks and zones; each of `extras` draws more into axes, by camera and unit [m]."""

    tracks: Sequence[Track]
    marks: Sequence[Mark] = ()
    shapes: Sequence[Shape] = ()
    title: str = ""
    extras: Sequence[Callable[[Axes, Camera, float], Any]] = ()
    reach: Floats | None = None  # (K, 3): more points that must be in the view

    @property
    def points(self) -> Floats:
        """All positions (M, 3) [m], including the extremes of the zones."""
        ends = [one.centre + sign * drawn(one.zone).extents for one in self.shapes for sign in (-1, 1)]
        more = [] if self.reach is None else [self.reach]
        every = [*(one.points for one in self.tracks), *ends, *(one.point for one in self.marks), *more]
        return np.vstack(every)

    def draw(self, axes: Axes, camera: Camera, unit: float = 1.0) -> None:
        """Draw everything but the names; the limits of the axes must be set."""
        for extra in self.extras:
            extra(axes, camera, unit)
        for shape in self.shapes:
            outline = (shadow(shape.zone, camera.basis[:2]) + camera(shape.centre)) / unit
            face = shape.colour if shape.filled else "none"
            look: dict[str, Any] = {"facecolor": face, "alpha": 0.4 if shape.filled else 1.0, "zorder": 1.5}
            axes.fill(*outline.T, edgecolor=shape.colour, linewidth=1.2, label=shape.label or "_", **look)
        groups: dict[Any, list[Track]] = {}
        for track in self.tracks:
            groups.setdefault((track.width, track.dashes, track.label, track.order), []).append(track)
        for (width, dashes, name, order), some in groups.items():
            lines = [camera(one.points) / unit for one in some]
            look = {"colors": [one.colour for one in some], "linestyles": dashes, "linewidths": width}
            butt = {"capstyle": "butt"} if dashes == "-" else {}
            axes.add_collection(LineCollection(lines, label=name or "_", zorder=order, **look, **butt))
        arrows = [one for one in self.tracks if one.arrow]
        headings(axes, [camera(one.points) / unit for one in arrows], [one.colour for one in arrows])
        kinds: dict[Any, list[Mark]] = {}
        for mark in self.marks:
            kinds.setdefault((mark.marker, mark.size, mark.label, mark.order, mark.face), []).append(mark)
        for (marker, size, name, order, face), same in kinds.items():
            places, tints = camera(np.array([one.point for one in same])) / unit, [one.colour for one in same]
            look = {"edgecolors": tints, "facecolors": tints if face is None else face, "linewidths": 1.4}
            look |= {"s": size**2, "marker": marker, "label": name or "_", "zorder": order}
            axes.scatter(places[:, 0], places[:, 1], **look)

    def name(self, axes: Axes, camera: Camera, unit: float = 1.0) -> None:
        """Write the names of the marks next to them, where they cover as little as possible."""
        named = [mark for mark in self.marks if mark.name]
        if named:
            others = [mark.point for mark in self.marks if not mark.name]
            points, marks = (
                camera(np.reshape(some, (-1, 3))) / unit for some in ([one.point for one in named], others)
            )
            tracks = camera(np.vstack([one.points for one in self.tracks])) / unit
            tints = [to_rgb(one.colour) for one in named]
            label(axes, points, [one.name for one in named], marks, tracks, tints)


def headings(axes: Axes, tracks: Sequence[Floats], tints: Sequence[Any], size: float = 8.0) -> None:
    """Draw an arrowhead on each track (K, 2) along its motion."""
    long = SHORT * float(np.ptp(axes.get_xlim()))
    for track, tint in zip(tracks, tints, strict=True):
        if np.ptp(track, axis=0).max() > long:
            steps = np.diff(track, axis=0)
            far = np.cumsum(np.linalg.norm(steps, axis=1))
            k = int(np.searchsorted(far, far[-1] * ALONG))
            turned = MarkerStyle(">", transform=Affine2D().rotate(atan2(steps[k, 1], steps[k, 0])))
            look: dict[str, Any] = {"color": tint, "markersize": size, "markeredgecolor": "white"}
            axes.plot(*track[k], marker=turned, markeredgewidth=0.6, zorder=3.6, **look)


def extent(points: Floats, room: float = 1.14) -> tuple[Floats, Floats, Unit]:
    """Return middle (3,) and span (3,) [m] of points (M, 3) with a minimum span per axis, and the unit."""
    low, top = points.min(axis=0), points.max(axis=0)
    span = room * np.maximum(top - low, FLAT * ((top - low).max() or 1.0))
    return (low + top) / 2, span, length_unit(float(span.max()))


def three_planes(
    points: Floats, columns: int = 1, below: float = 0.0
) -> tuple[Figure, Unit, list[list[Axes]]]:
    """Return a figure whose planes hold points (M, 3) at one scale, its unit, and the axes of each column.

    A single column has two planes above each other, the third next to them, and a fourth panel for a view in
    space. `below` [inches] adds a row to the grid, for axes below the planes.
    """
    middle, span, unit = extent(points)
    if columns == 1:
        sides, ups = span[[1, 2]], span[[0, 2]]
    else:
        sides, ups = np.full(columns, max(span[1], span[2])), span[[0, 2, 0]]
    size = min(WIDE / sides.sum(), (TALL if columns == 1 else 1.25 * TALL) / ups.sum())
    wide, high = size * np.array([sides.sum(), ups.sum()]) + FRAME
    room = below + 0.9 if below else 0.0  # with its labels
    figure = sheet(high + room, max(wide, 7.4), layout="compressed")
    rows = [*ups] + ([below / size] if below else [])
    grid = figure.add_gridspec(len(rows), len(sides), width_ratios=sides, height_ratios=rows)
    if columns == 1:
        places = [[grid[0, 0], grid[1, 0], grid[0, 1], grid[1, 1]]]
    else:
        places = [[grid[row, column] for row in range(3)] for column in range(columns)]
    made = [[figure.add_subplot(place) for place in column] for column in places]
    for column, axes_of in enumerate(made):
        for k, (axes, (pair, _)) in enumerate(zip(axes_of, PLANES, strict=False)):
            spans = span[list(pair)] if columns == 1 else np.array([sides[0], span[pair[1]]])
            limits = (middle[list(pair)] + np.array([[-0.5], [0.5]]) * spans) / unit.size
            axes.set(xlim=limits[:, 0], ylim=limits[:, 1], aspect="equal")
            dress(axes)
            for axis, long in zip((axes.xaxis, axes.yaxis), size * spans, strict=True):
                axis.set_major_locator(MaxNLocator(max(2, min(7, int(1.4 * long)))))
            own_left = column == 0 and (columns > 1 or k < 2)
            own_below = columns > 1 or k > 0
            if own_left:
                axes.set_ylabel(f"{DIRECTIONS[pair[1]].name} [{unit.name}]")
            if own_below:
                axes.set_xlabel(f"{DIRECTIONS[pair[0]].name} [{unit.name}]")
            axes.tick_params(labelleft=own_left, labelbottom=own_below)
    return figure, unit, made


def in_planes(scenes: Sequence[Scene], said: str) -> Figure:
    """Return a figure of the three planes of each scene at one scale; a single scene has a space view."""
    points = np.vstack([scene.points for scene in scenes])
    figure, unit, made = three_planes(points, len(scenes))
    views: list[tuple[Axes, Scene, Camera, float]] = []
    for column, scene in zip(made, scenes, strict=True):
        plain(column[0].set_title(scene.title, loc="left", fontsize=SMALL, color=INK))
        views += [(axes, scene, camera, unit.size) for axes, (_, camera) in zip(column, PLANES, strict=False)]
        if len(scenes) == 1:
            space_axes(column[3], ORBITAL(points), ORBITAL, AXES)
            column[3].set_box_aspect(1.0)
            views.append((column[3], scene, ORBITAL, 1.0))
    return finished(figure, views, said)


def in_space(scenes: Sequence[Scene], said: str) -> Figure:
    """Return a figure of an oblique view of each scene, for paths in deep space."""
    points = np.vstack([OBLIQUE(scene.points) for scene in scenes])
    across, up = np.ptp(points, axis=0)
    wide = WIDTH if len(scenes) > 1 else float(np.clip(6.5 * across / (up or 1.0), 7.4, WIDTH))
    figure, views = sheet(7.0, wide), list[tuple[Axes, Scene, Camera, float]]()
    for axes, scene in zip(figure.subplots(1, len(scenes), squeeze=False)[0], scenes, strict=True):
        space_axes(axes, points, OBLIQUE, INERTIAL)
        plain(axes.set_title(scene.title, loc="left", fontsize=SMALL, color=INK))
        views.append((axes, scene, OBLIQUE, 1.0))
    return finished(figure, views, said)


def finished(figure: Figure, views: Sequence[tuple[Axes, Scene, Camera, float]], said: str) -> Figure:
    """Draw scenes into their axes, with one legend, a headline, and the names of the marks."""
    known: dict[str, Any] = {}
    for axes, scene, camera, unit in views:
        scene.draw(axes, camera, unit)
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            known.setdefault(name, handle)
    if known:
        legend(figure, list(known.values()), list(known), columnspacing=1.4, handlelength=1.8)
    headline(figure, said)
    figure.draw_without_rendering()  # names depend on the final layout, which takes two steps
    for axes, scene, camera, unit in views:
        scene.name(axes, camera, unit)
    return figure


# ----- axes of a view in space


def space_axes(axes: Axes, points: Floats, camera: Camera, directions: dict[str, Floats]) -> None:
    """Frame axes at equal scales that hold points (M, 2), with a scale bar and the directions below them."""
    low, top = points.min(axis=0), points.max(axis=0)
    room = 0.06 * float((top - low).max() or 1.0)
    low, top = low - room, top + room
    inches = min(axes.bbox.width, axes.bbox.height) / float(axes.figure.dpi)
    size = float(np.clip(9.0 * inches, 17.0, 32.0))  # points
    share = min(0.4, (1.5 * size + 17.0) / (72.0 * inches))  # of the height: the directions
    wide, high = top - low
    below = max(0.0, 2.0 * share * wide - wide + high)
    below = below if high + below <= wide else share * high / (1.0 - share)
    fitted(axes, (low[0], low[1] - below), top)
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_color(OTHER)
    long = rounded_down(0.25 * max(float((top - low).max()), 1e-9))
    unit = length_unit(long)
    look: dict[str, Any] = {"frameon": False, "size_vertical": 0.0, "pad": 0.4, "sep": 3, "color": INK}
    bar = AnchoredSizeBar(axes.transData, long, f"{long / unit.size:g} {unit.name}", "lower right", **look)
    bar.txt_label.get_children()[0].set_fontsize(SMALL)
    axes.add_artist(bar)
    triad(axes, camera, directions, size)


def triad(axes: Axes, camera: Camera, directions: dict[str, Floats], size: float = 32.0) -> None:
    """Draw named directions in the lower left corner; one along the line of sight is a dot in a ring."""
    corner: Any = OffsetFrom(axes.bbox, (0.0, 0.0), "points")
    tips = {name: size * camera(axis) for name, axis in directions.items()}
    start = np.array([18.0, 23.0]) - np.minimum(0.0, np.min([*tips.values()], axis=0))
    start[0] += 6.0 * max(map(len, tips))
    look: dict[str, Any] = {"xycoords": corner, "textcoords": corner}
    for name, tip in tips.items():
        if np.hypot(*tip) < 0.08 * size:
            towards = camera.nearness(directions[name]) > 0.0
            words: dict[str, Any] = {"fontsize": SMALL, "color": INK, "ha": "center", "va": "center"}
            axes.annotate("⊙" if towards else "⊗", start, start, **look, **words)
            axes.annotate(name, start, start - [12.0, 9.0], **look, **words)
            continue
        arrows = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", start + tip, start, arrowprops=arrows, **look)
        aside = 0 if abs(tip[0]) < 0.3 * np.hypot(*tip) else int(np.sign(tip[0]))
        place = start + tip + [4.0 * aside, (8.0 if aside else 12.0) * np.sign(tip[1])]
        ends: dict[str, Any] = {
            "ha": ("center", "left", "right")[aside],
            "va": "center",
            "fontsize": SMALL,
            "color": INK,
        }
        axes.annotate(name, start, place, path_effects=HALO, **look, **ends)


def fitted(axes: Axes, low: Any, top: Any) -> None:
    """Let axes at equal scales fill their place and hold the corners `low` (2,) and `top` (2,)."""
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.0)
    axes.update_datalim([low, top])
    axes.autoscale_view()


def bare(axes: Axes, middle: Any, width: float, height: float) -> None:
    """Hide the frame of axes at equal scales, which hold a window around a point."""
    axes.set_axis_off()
    half = 0.5 * np.array([width, height])
    fitted(axes, np.asarray(middle) - half, np.asarray(middle) + half)


# ----- shapes in a view


def across(axis: Floats) -> Floats:
    """Return two unit vectors (2, 3) that complete an axis to a right-handed frame."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first)])


def ring(axis: Floats, half_angle: float, size: float = 1.0) -> Floats:
    """Return the rim (K, 3) of a cone from the origin, `size` away at `half_angle` [rad] from its axis."""
    return np.asarray(size * (cos(half_angle) * axis + sin(half_angle) * (CIRCLE @ across(axis))))


def hull(points: Floats) -> Floats:
    """Return the convex hull (K, 2) of points (M, 2)."""
    chains: list[list[tuple[float, float]]] = []
    ordered = sorted({(x, y) for x, y in points.tolist()})
    for side in (ordered, ordered[::-1]):
        chain: list[tuple[float, float]] = []
        for x, y in side:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2], chain[-1]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                    break
                chain.pop()
            chain.append((x, y))
        chains.append(chain[:-1] or chain)
    return np.array(chains[0] + chains[1])


def solid(camera: Camera, *parts: ArrayLike) -> Floats:
    """Return the silhouette (K, 2) of the convex hull of points (..., 3)."""
    return hull(camera(np.vstack([np.atleast_2d(np.asarray(part, dtype=float)) for part in parts])))


def fill(axes: Axes, outline: Floats, colour: str, alpha: float, **look: Any) -> None:
    """Draw a translucent shape."""
    axes.fill(*outline.T, facecolor=colour, alpha=alpha, linewidth=0.0, **look)


def cone(
    axes: Axes, camera: Camera, apex: Floats, rim: Floats, colour: str, density: float, **look: Any
) -> None:
    """Draw a translucent cone with its rim (K, 3); `look` is the line style of the rim."""
    fill(axes, solid(camera, apex, apex + rim), colour, density)
    style: dict[str, Any] = {"color": colour, "linewidth": 1.0, "alpha": 0.8} | look
    axes.plot(*camera(apex + rim).T, **style)


def arrow(axes: Axes, points: Floats, colour: str, **look: Any) -> None:
    """Draw a line through points (K, 2) with an arrowhead at its end."""
    path = Outline(points, [Outline.MOVETO] + [Outline.LINETO] * (len(points) - 1))
    style: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 13, "linewidth": 1.6}
    style |= {"shrinkA": 0, "shrinkB": 0} | look
    axes.add_patch(FancyArrowPatch(path=path, color=colour, **style))


def to_sun(axes: Axes, camera: Camera, start: ArrayLike, length: float, text: str = "Sun") -> None:
    """Draw an arrow of a `length` from `start` (3,) towards the Sun, with the Sun at its end."""
    tail = np.asarray(start, dtype=float)
    points = camera(np.array([tail, tail + length * SUN]))
    arrow(axes, points, SUN_COLOUR, linewidth=2.2)
    axes.plot(*points[1], "o", color=SUN_COLOUR, markeredgecolor=INK, markersize=11, zorder=6)
    word(axes, points[1], text, shift=(12, 0), ha="left")
