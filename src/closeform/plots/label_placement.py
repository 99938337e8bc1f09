"""Placement of spacecraft names beside their points without overlap."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.text import Text

from closeform.arrays import Floats
from closeform.plots.fonts import plain
from closeform.plots.palette import INK
from closeform.plots.style import SMALL

ENOUGH = 2000  # maximum number of track points that are checked
CLEAR = 11.0  # pixels between a name and a mark
SPOTS = (  # offsets of a name [typographic points]: right, up, and its anchored edge
    (6, 5, 0.0),
    (-6, 5, 1.0),
    (6, -11, 0.0),
    (-6, -11, 1.0),
    (0, 9, 0.5),
    (0, -15, 0.5),
    (18, 16, 0.0),  # from here on farther away, connected by a line
    (-18, 16, 1.0),
    (18, -24, 0.0),
    (-18, -24, 1.0),
    (32, 2, 0.0),
    (-32, 2, 1.0),
)
FAR = 6  # index of the first such spot
EDGES = {0.0: "left", 0.5: "center", 1.0: "right"}


class Names:
    """Names for one figure, with their measured sizes [pixels]."""

    def __init__(self, figure: Figure, called: Sequence[str], size: float = SMALL) -> None:
        renderer = FigureCanvasAgg(figure).get_renderer()
        self.called, self.size = called, size
        self.sizes = []  # pixels
        for name in called:
            text = plain(Text(0, 0, name, fontsize=size))
            text.set_figure(figure)
            box = text.get_window_extent(renderer)
            self.sizes.append((box.width, box.height))
        self.point = figure.dpi / 72.0  # pixels per typographic point

    def beside(
        self, axes: Axes, points: Floats, marks: Floats, tracks: Floats, tints: Floats | None = None
    ) -> None:
        """Draw each name by its point (N, 2), clear of `marks` and other names, over the fewest `tracks`.

        If there is no room beside its point, a line connects the name to it; a name without any room is
        omitted. The position and limits of `axes` must be final.
        """
        to_pixels = axes.transData.transform
        (left, low), (right, top) = axes.get_window_extent().get_points()
        taken: list[tuple[float, float, float, float]] = []
        spots = to_pixels(points)
        dots = to_pixels(np.vstack([points, marks]))
        lines = to_pixels(tracks[:: max(1, len(tracks) // ENOUGH)])
        for k, (spot, name, (wide, high)) in enumerate(zip(spots, self.called, self.sizes, strict=True)):
            best: tuple[bool, int, int, tuple[float, float, float, float]] | None = None
            for place, (aside, up, edge) in enumerate(SPOTS):
                x, y = spot[0] + aside * self.point - edge * wide, spot[1] + up * self.point
                box = x, y - 0.25 * high, x + wide, y + high
                if box[0] < left or box[2] > right or box[1] < low or box[3] > top:
                    continue
                padded = box[0] - CLEAR, box[1] - CLEAR, box[2] + CLEAR, box[3] + CLEAR
                if covered(dots, padded) or any(overlap(box, other) for other in taken):
                    continue
                cost = place >= FAR, covered(lines, box), place, box
                if best is None or cost < best:
                    best = cost
            if best is None:
                continue
            away, hides, place, box = best
            aside, up, edge = SPOTS[place]
            taken.append(box)
            look: dict[str, Any] = {"ha": EDGES[edge], "va": "baseline", "fontsize": self.size}
            colour = INK if tints is None else dark(tints[k])
            if away:
                look["arrowprops"] = {"arrowstyle": "-", "color": colour, "linewidth": 0.7, "shrinkB": 3.0}
            words = axes.annotate(
                name, tuple(points[k]), (aside, up), textcoords="offset points", color=colour, **look
            )
            words.set_zorder(6)
            if hides:  # readable on what it covers
                words.set_bbox({"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 0.5})
            plain(words)


def dark(tint: Floats) -> str:
    """Return a darker colour in which a name is readable, from an RGBA colour."""
    red, green, blue, _ = (0.75 * float(part) for part in tint)
    return to_hex((red, green, blue))


def covered(points: Floats, box: Sequence[float]) -> int:
    """Return how many points (N, 2) a box covers."""
    return int(((points > box[:2]) & (points < box[2:])).all(axis=1).sum())


def overlap(one: Sequence[float], other: Sequence[float]) -> bool:
    """Return True if two boxes overlap."""
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
