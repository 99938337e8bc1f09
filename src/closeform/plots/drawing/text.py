"""Text in figures: no math parsing, names that the font can show, and labels that do not overlap."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from closeform.arrays import Floats
from closeform.plots.drawing.inputs import texts
from closeform.plots.drawing.palette import INK, dark

TEXT, SMALL = 13.0, 11.5  # points, readable at half size
LONG = 13  # maximum number of characters of a name
HALO = [withStroke(linewidth=4, foreground="white")]  # keeps words readable on lines
NEAR = 6  # number of SPOTS next to a point; those farther away are joined to it by a line
SPOTS = (  # offsets of a label [typographic points], and its horizontal alignment
    (6, 5, "left"),
    (-6, 5, "right"),
    (6, -13, "left"),
    (-6, -13, "right"),
    (0, 9, "center"),
    (0, -17, "center"),
    (18, 16, "left"),
    (-18, 16, "right"),
    (18, -26, "left"),
    (-18, -26, "right"),
    (32, 2, "left"),
    (-32, 2, "right"),
)
ENOUGH = 2000  # maximum number of track points that labels avoid


def short_names(names: Sequence[str] | None, count: int, what: str = "craft", long: int = LONG) -> list[str]:
    """Return short labels of spacecraft: their names, shortened in the middle, or their indices.

    A name with characters that the font does not contain becomes its position in the list, such as "#3".
    """
    if names is None:
        return [str(k) for k in range(count)]
    names, half = texts("names", names, count, what), long // 2
    short = [name if len(name) <= long else f"{name[:half]}…{name[-half:]}" for name in names]
    return [name if legible(name) == name else f"#{k}" for k, name in enumerate(short, 1)]


def obstacle_labels(count: int) -> list[str]:
    """Return labels of obstacles without names: their indices, unless there is only one."""
    return ["obstacle"] if count == 1 else [f"obstacle {k}" for k in range(count)]


def legible(text: str) -> str:
    """Return a text with a question mark in place of each character that the font does not contain."""
    font = get_font(findfont(FontProperties()))
    return "".join(one if one == "\n" or font.get_char_index(ord(one)) else "?" for one in text)


def plain(text: Text) -> Text:
    """Disable the math parsing of a text, which may contain a name, and make it legible."""
    text.set_parse_math(False)
    text.set_text(legible(text.get_text()))
    return text


def word(
    axes: Axes, point: Any, text: str, colour: Any = INK, shift: tuple[float, float] = (0, 0), **look: Any
) -> Any:
    """Add text with a white halo at a point (2,), shifted in typographic points."""
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": SMALL, "path_effects": HALO} | look
    return axes.annotate(text, (point[0], point[1]), shift, textcoords="offset points", color=colour, **style)


def label(
    axes: Axes,
    points: Floats,
    names: Sequence[str],
    marks: Floats | None = None,
    tracks: Floats | None = None,
    tints: Any = None,
    spots: int = len(SPOTS),
) -> None:
    """Write each name by its point (N, 2), clear of other names and `marks`, over the fewest `tracks`.

    The first `spots` of SPOTS are tried; a name without room at any of them is omitted. The limits of the
    axes must be final.
    """
    axes.autoscale_view()
    axes.apply_aspect()
    renderer, to_pixels = FigureCanvasAgg(axes.get_figure(root=True)).get_renderer(), axes.transData.transform
    frame, taken, pixel = axes.get_window_extent(), list[Bbox](), axes.figure.dpi / 72.0
    dots = to_pixels(points if marks is None else np.vstack([points, marks]))
    lines = np.empty((0, 2)) if tracks is None else to_pixels(tracks[:: max(1, len(tracks) // ENOUGH)])
    for k, (name, end) in enumerate(zip(names, to_pixels(points), strict=True)):
        tint = INK if tints is None else dark(tints[k])
        leader = {"arrowstyle": "-", "color": tint, "linewidth": 0.7, "shrinkA": 0.0, "shrinkB": 3.0}
        text: Any = plain(word(axes, points[k], name, tint, zorder=6, va="baseline", arrowprops=leader))
        size, boxes, free = (
            Text.get_window_extent(text, renderer),
            list[Bbox](),
            list[tuple[bool, int, int]](),
        )
        for place, (right, up, edge) in enumerate(SPOTS[:spots]):
            left = end[0] + right * pixel - size.width * {"left": 0.0, "center": 0.5, "right": 1.0}[edge]
            low = end[1] + up * pixel - 0.25 * size.height  # below the baseline
            boxes.append(Bbox.from_bounds(left, low, size.width, size.height))
            inside = frame.count_contains(boxes[-1].corners()) == len(boxes[-1].corners())
            if (
                inside
                and not boxes[-1].count_overlaps(taken)
                and not boxes[-1].padded(4 * pixel).count_contains(dots)
            ):
                free.append((place >= NEAR, boxes[-1].count_contains(lines), place))
        if not free:
            text.remove()
            continue
        away, _, place = min(free)
        taken.append(boxes[place])
        text.set(position=SPOTS[place][:2], ha=SPOTS[place][2])
        text.arrow_patch.set_visible(away)
