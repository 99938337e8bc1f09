"""Text in figures: no math parsing, fonts that contain the characters, and labels that do not overlap."""

from collections.abc import Sequence
from functools import cache
from typing import Any
from unicodedata import bidirectional

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.font_manager import FontProperties, findfont, fontManager, get_font
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from closeform.arrays import Floats
from closeform.plots.drawing.inputs import texts
from closeform.plots.drawing.palette import INK, dark

TEXT, SMALL = 13.0, 11.5  # points, readable at half size
LONG = 13  # maximum number of characters of a name
LEFT_TO_RIGHT = "\u200e"  # zero-width mark
HALO = [withStroke(linewidth=4, foreground="white")]  # keeps words readable on lines
NEAR, FAR = 6, 12  # number of SPOTS next to a point, and of those farther away, joined by a line
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


def short_names(names: Sequence[str] | None, count: int, what: str = "craft") -> list[str]:
    """Return short labels of spacecraft: their names, shortened in the middle, or their indices.

    A name with characters that no installed font contains becomes its position in the list, such as "#3".
    """
    if names is None:
        return [str(k) for k in range(count)]
    names = texts("names", names, count, what)
    half = LONG // 2
    short = [name if len(name) <= LONG else f"{name[:half]}…{name[-half:]}" for name in names]
    return [upright(name) if None not in fonts(name) else f"#{k}" for k, name in enumerate(short, 1)]


def upright(name: str) -> str:
    """Append a left-to-right mark to a right-to-left name, so that digits after it keep their order."""
    return name + LEFT_TO_RIGHT if any(bidirectional(one) in ("R", "AL") for one in name) else name


def fonts(text: str) -> tuple[str | None, ...]:
    """Return the font families that a text needs besides the default; None for a character without a font."""
    if text.isascii():
        return ()
    usual = get_font(findfont(FontProperties()))
    return tuple(dict.fromkeys(font_of(one) for one in text if not usual.get_char_index(ord(one))))


@cache
def font_of(letter: str) -> str | None:
    """Return an installed scalable font family that contains a character, or None."""
    for entry in fontManager.ttflist:
        if entry.name.startswith("Last Resort") or "color" in entry.name.lower():
            continue  # placeholder glyphs and colour bitmaps
        font = get_font(entry.fname)
        if font.scalable and font.get_char_index(ord(letter)):
            return entry.name
    return None


def plain(text: Text, *names: str) -> Text:
    """Disable math parsing of a text and set fonts for it and for `names` that it may show later."""
    text.set_parse_math(False)
    if more := [family for family in fonts(text.get_text() + "".join(names)) if family is not None]:
        text.set_fontfamily(["sans-serif", *dict.fromkeys(more)])
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
    spots: int = FAR,
    first: int = 0,
) -> None:
    """Write each name by its point (N, 2), clear of other names and `marks`, over the fewest `tracks`.

    Of `SPOTS`, those from `first` up to `spots` are tried; a name without room at any of them is omitted. The
    limits of the axes must be final.
    """
    axes.autoscale_view()
    axes.apply_aspect()
    renderer = FigureCanvasAgg(axes.get_figure(root=True)).get_renderer()
    to_pixels, pixel = axes.transData.transform, axes.figure.dpi / 72.0
    frame, taken = axes.get_window_extent(), list[Bbox]()
    ends = to_pixels(points)
    dots = ends if marks is None else np.vstack([ends, to_pixels(marks)])
    lines = np.empty((0, 2)) if tracks is None else to_pixels(tracks[:: max(1, len(tracks) // ENOUGH)])
    for k, (name, end) in enumerate(zip(names, ends, strict=True)):
        tint = INK if tints is None else dark(tints[k])
        text = plain(word(axes, points[k], name, tint, zorder=6, va="baseline"))
        box = text.get_window_extent(renderer)
        found: list[tuple[bool, int, int, Bbox]] = []
        for place, (right, up, edge) in enumerate(SPOTS[:spots]):
            if place < first:
                continue
            left = end[0] + right * pixel - box.width * {"left": 0.0, "center": 0.5, "right": 1.0}[edge]
            here = Bbox.from_bounds(left, end[1] + up * pixel - 0.25 * box.height, box.width, box.height)
            inside = (
                frame.x0 <= here.x0 and here.x1 <= frame.x1 and frame.y0 <= here.y0 <= here.y1 <= frame.y1
            )
            if inside and not here.count_overlaps(taken) and not here.padded(4 * pixel).count_contains(dots):
                found.append((place >= NEAR, here.count_contains(lines), place, here))
        if not found:
            text.remove()
            continue
        away, _, place, here = min(found, key=lambda one: one[:3])
        taken.append(here)
        right, up, edge = SPOTS[place]
        text.set(position=(right, up), ha=edge)
        if away:
            axes.annotate(
                "",
                tuple(points[k]),
                (0.8 * right, up + 3),
                textcoords="offset points",
                arrowprops={"arrowstyle": "-", "color": tint, "linewidth": 0.7, "shrinkB": 3.0},
            )


def follow(axes: Axes, words: Sequence[Any], points: Floats) -> None:
    """Move labels to the right of their moving points (N, 2), or to the left; hide those without room."""
    places = axes.transData.transform(points) * 72.0 / axes.figure.dpi  # typographic points
    for text, point, place in zip(words, points, places, strict=False):
        right, up = (places - place).T
        near, room = np.abs(up) < 1.4 * SMALL, 0.6 * SMALL * len(text.get_text())
        taken, blocked = (bool((near & (side > 0.0) & (side < room)).any()) for side in (right, -right))
        text.xy, text.xyann = point, (-5 if taken else 5, 9)
        text.set(ha="right" if taken else "left", visible=not (taken and blocked))
