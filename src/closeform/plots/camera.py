"""Orthographic views of scenes in space: cameras, windows, and shapes in the scene."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, sin
from typing import Any, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from matplotlib.path import Path as Outline
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.plots.fonts import plain
from closeform.plots.palette import AFTER, CONFLICT, INK, OTHER
from closeform.plots.style import HALO, SMALL, TEXT, length_unit, rounded_down
from closeform.search.leg import SUN
from closeform.zones.outlines import CIRCLE

GROUP_COLOURS = {"A": AFTER, "B": CONFLICT}
SUN_COLOUR = "#F2B705"
ROMAN = {1: "I", 2: "II", 3: "III", 4: "IV"}  # regions of the complementary cones, S04 figure 5
SUNWARD = np.array([0.0, 0.0, -1.0])  # Sun direction in deep space, as in searches
AXES = ("radial", "along", "cross")  # of the orbital frame
FOOT = 0.9  # inches for the scale and the directions
LETTER, LENGTH = 0.1, 0.45  # inches: width of a letter, and length of a direction arrow
LAYERS = 40  # of depth


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


def across(axis: Floats) -> Floats:
    """Return two unit vectors (2, 3) that complete an axis to a right-handed frame."""
    first = cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    return np.array([first, cross(axis, first)])


def cross(one: Floats, other: Floats) -> Floats:
    """Return the cross product of two vectors (3,); ten times faster than `np.cross`, for animations."""
    (x, y, z), (u, v, w) = one.tolist(), other.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


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


def word(
    axes: Axes, point: Any, text: str, colour: str = INK, shift: tuple[float, float] = (0, 0), **look: Any
) -> Any:
    """Add text at a point (2,), shifted in typographic points, with a white halo."""
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": SMALL, "path_effects": HALO} | look
    return axes.annotate(text, (point[0], point[1]), shift, textcoords="offset points", color=colour, **style)


def beside(axes: Axes, words: Sequence[Any], points: Floats) -> None:
    """Move texts to the right of their points (N, 2), or to the left if another point is close."""
    places = axes.transData.transform(points) * 72.0 / axes.figure.dpi  # typographic points
    for text, point, place in zip(words, points, places, strict=True):
        right, up = (places - place).T
        taken = bool(((right > 0.0) & (right < 45.0) & (abs(up) < SMALL)).any())
        text.xy, text.xyann = point, (-5 if taken else 5, 9)
        text.set_ha("right" if taken else "left")


def scale_bar(axes: Axes, width: float) -> None:
    """Draw a scale bar of round length in the lower right corner."""
    length = rounded_down(0.25 * width)
    unit = length_unit(length)
    right, low = axes.get_xlim()[1] - 0.04 * width, axes.get_ylim()[0] + 0.03 * width
    axes.plot([right - length, right], [low, low], color=INK, linewidth=2.5, solid_capstyle="butt")
    word(axes, (right - length / 2, low), f"{length / unit.size:g} {unit.name}", shift=(0, 9))


def to_sun(axes: Axes, camera: Camera, start: ArrayLike, length: float, text: str = "Sun") -> None:
    """Draw an arrow of a `length` from `start` (3,) towards the Sun, with the Sun at its end."""
    tail = np.asarray(start, dtype=float)
    head = tail + length * SUN
    points = camera(np.array([tail, head]))
    arrow(axes, points, SUN_COLOUR, linewidth=2.2)
    axes.plot(*points[1], "o", color=SUN_COLOUR, markeredgecolor=INK, markersize=11, zorder=6)
    word(axes, points[1], text, shift=(12, 0), ha="left")


def triad(axes: Axes, camera: Camera, origin: Floats, length: float, names: dict[str, Floats]) -> None:
    """Draw named directions from a point (2,); a direction along the line of sight is a dot in a ring."""
    for name, direction in names.items():
        tip = camera(direction)
        if np.hypot(*tip) < 0.08:
            towards = camera.nearness(direction) > 0.0
            axes.plot(*origin, "o", color=INK, markerfacecolor="white", markersize=9)
            axes.plot(*origin, "." if towards else "x", color=INK, markersize=5)
            word(axes, origin, name, shift=(-11, -9))
        else:
            arrow(axes, origin + length * np.array([np.zeros(2), tip]), INK, linewidth=1.2, mutation_scale=10)
            aside = 0 if abs(tip[0]) < 0.3 * np.hypot(*tip) else int(np.sign(tip[0]))
            look = {"ha": ("center", "left", "right")[aside]}
            word(axes, origin + length * tip, name, shift=(4 * aside, 8 * np.sign(tip[1])), **look)


def framing(points: Floats, wide: float, high: float, room: float = 1.08) -> tuple[Floats, float]:
    """Return the middle (2,) and width of a `wide` by `high` window that holds points (M, 2)."""
    low, top = points.min(axis=0), points.max(axis=0)
    span = top - low
    return (low + top) / 2.0, room * float(max(span[0], span[1] * wide / high))


def stage(figure: Figure, place: tuple[float, float, float, float], middle: Any, width: float) -> Axes:
    """Add bare axes at equal scales; `place` is in shares of the figure, `width` in data units."""
    axes = figure.add_axes(place)
    axes.set_axis_off()
    inches = figure.get_size_inches() * place[2:]
    high = width * inches[1] / inches[0]
    axes.set_xlim(middle[0] - width / 2, middle[0] + width / 2)
    axes.set_ylim(middle[1] - high / 2, middle[1] + high / 2)
    return axes


def window(axes: Axes, points: Floats, camera: Camera, directions: Sequence[str], above: float) -> None:
    """Set limits that hold points (M, 2) below a title; add a scale bar and the directions."""
    wide, high = (float(pixels / axes.figure.dpi) for pixels in axes.get_window_extent().size)  # inches
    middle, width = framing(points, wide, high - above - FOOT, 1.1)
    inch = (width or 1.0) / wide
    floor = middle[1] - ((high - above - FOOT) / 2 + FOOT) * inch
    axes.set_xlim(middle[0] - inch * wide / 2, middle[0] + inch * wide / 2)
    axes.set_ylim(floor, floor + inch * high)
    scale_bar(axes, inch * wide)
    letters = LETTER * max(map(len, directions))  # a direction may point left
    down = max(0.0, -float(camera(np.eye(3))[:, 1].min()))  # a direction may point down
    corner = np.array([axes.get_xlim()[0] + (0.5 + letters) * inch, floor + (0.3 + LENGTH * down) * inch])
    triad(axes, camera, corner, LENGTH * inch, dict(zip(directions, np.eye(3), strict=True)))


def layered(camera: Camera, tracks: Sequence[Floats]) -> tuple[list[int], list[Floats]]:
    """Return pieces (K, 2) of tracks (M, 3) from back to front, with the track index of each.

    Tracks are cut at fixed layers of depth and keep one order within a layer, so that merging tracks do not
    cut each other into dashes.
    """
    depths = [camera.nearness(track) for track in tracks]
    low, high = min(map(np.min, depths)), max(map(np.max, depths))
    pieces = []
    for k, (track, depth) in enumerate(zip(tracks, depths, strict=True)):
        seen, layer = camera(track), np.floor((depth - low) * LAYERS / ((high - low) or 1.0))
        cuts = [0, *(np.flatnonzero(np.diff(layer)) + 1).tolist(), len(seen) - 1]
        pieces += [(layer[one], k, seen[one : other + 1]) for one, other in pairwise(cuts)]
    pieces.sort(key=lambda piece: piece[:2])
    return [k for _, k, _ in pieces], [piece for *_, piece in pieces]


def framed(axes: Axes, title: str) -> None:
    """Add a thin frame with a title in its upper left corner."""
    axes.set_axis_on()
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color(OTHER)
    look: dict[str, Any] = {
        "ha": "left",
        "va": "top",
        "fontsize": TEXT,
        "fontweight": "bold",
        "path_effects": HALO,
    }
    plain(axes.text(0.015, 0.985, title, transform=axes.transAxes, color=INK, **look))
