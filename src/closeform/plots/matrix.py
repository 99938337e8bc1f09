"""Matrix of the minimum clearance ratios of all pairs of a formation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.plots.drawing.inputs import Zones, picture
from closeform.plots.drawing.pairs import Pairs, asked_pairs, ratio_text, verdict_of_pairs
from closeform.plots.drawing.palette import CONFLICT, FAINT, INK, OTHER
from closeform.plots.drawing.style import headline, legend, sheet
from closeform.plots.drawing.text import SMALL, TEXT, plain

NUMBERED = 14  # maximum number of spacecraft with numbers in the cells
NAMED = 36  # maximum number of names on each axis
LEVELS = (0.0, 0.5, 1.0, 1.5, 2.0, 5.0, 10.0)  # limits of the colours; 1 is the keep-out boundary
COLOURS = (CONFLICT, "#f2a56b", "#5aa5d1", "#8cc2e0", "#b9d9ec", "#dcecf6")  # and FAR beyond the last
FAR = "#f1f7fb"


@picture("there are fewer than two spacecraft, or no pair has a zone")
def ratio_matrix(
    paths: Path | Sequence[Path],
    zones: Zones,
    names: Sequence[str] | None = None,
) -> Figure:
    """Plot the minimum clearance ratio of each pair as a matrix; 1 is the keep-out boundary.

    The matrix is symmetric. Pairs in conflict are bold, or crossed if there are many spacecraft. Pairs
    without a zone or a common time are grey.
    """
    pairs, called = asked_pairs(paths, zones, names)
    count = len(called)
    least = np.full((count, count), np.nan)
    first, second = pairs.craft.T
    least[first, second] = least[second, first] = np.where(np.isfinite(pairs.ratio), pairs.ratio, np.nan)
    side = float(np.clip(0.55 * count, 2.4, 7.6))
    figure = sheet(side + 1.9, max(side + 2.6, 6.4))
    axes = figure.subplots()
    axes.set_facecolor(FAINT)
    shades = ListedColormap(COLOURS).with_extremes(over=FAR)
    norm = BoundaryNorm(LEVELS, len(COLOURS))
    image = axes.imshow(least, cmap=shades, norm=norm, interpolation="nearest")
    mark(axes, pairs, least)
    name_cells(axes, called)
    bar = figure.colorbar(image, ax=axes, extend="max", spacing="uniform", pad=0.03, aspect=30)
    bar.set_ticks(list(LEVELS), labels=[f"{level:g}" for level in LEVELS])
    bar.ax.axhline(1.0, color=INK, linewidth=1.6)
    bar.ax.tick_params(labelsize=SMALL, colors=INK, length=3)
    bar.set_label("minimum clearance ratio [× zone]", fontsize=TEXT, color=INK)
    handles: list[Patch] = []
    if pairs.hit.any():
        words = f"{'bold' if count <= NUMBERED else 'crossed'}: in conflict"
        handles.append(Patch(facecolor=CONFLICT, label=words))
    if np.isnan(least[np.triu_indices(count, 1)]).any():
        handles.append(Patch(facecolor=FAINT, edgecolor=OTHER, label="no zone or no common time"))
    if handles:
        legend(figure, handles, [str(one.get_label()) for one in handles])
    headline(figure, verdict_of_pairs(pairs, called))
    return figure


def mark(axes: Axes, pairs: Pairs, least: Floats) -> None:
    """Write numbers into the cells, bold in conflict, or crosses into small cells in conflict."""
    count = len(least)
    hit = np.concatenate([pairs.craft[pairs.hit], pairs.craft[pairs.hit][:, ::-1]])
    if count > NUMBERED:
        size = float(np.clip(270.0 / count, 1.0, 9.0))
        axes.plot(hit[:, 1], hit[:, 0], "x", color=INK, markersize=size, markeredgewidth=0.22 * size)
        return
    met = set(map(tuple, hit.tolist()))
    for row, column in np.argwhere(np.isfinite(least)).tolist():
        ratio, bold = least[row, column], (row, column) in met
        look: dict[str, Any] = {
            "color": "white" if ratio < LEVELS[1] else INK,
            "ha": "center",
            "va": "center",
        }
        look |= {"fontsize": SMALL - 0.25 * max(0, count - 8), "fontweight": "bold" if bold else "normal"}
        axes.text(column, row, ratio_text(ratio), **look)


def name_cells(axes: Axes, called: list[str]) -> None:
    """Write names above and on the left, and draw white lines between the cells."""
    count = len(called)
    chosen = range(0, count, -(-count // NAMED))
    words = [called[k] for k in chosen]
    axes.xaxis.tick_top()
    axes.set_xticks(chosen, words, rotation=90 if count * max(map(len, words)) > 70 else 0)
    axes.set_yticks(chosen, words)
    axes.tick_params(labelsize=SMALL if count <= 20 else SMALL - 3.0, colors=INK, length=0)
    for name in (*axes.get_xticklabels(), *axes.get_yticklabels()):
        plain(name)
    edges = np.arange(1, count) - 0.5
    axes.set_xticks(edges, minor=True)
    axes.set_yticks(edges, minor=True)
    axes.tick_params(which="minor", length=0)
    axes.grid(which="minor", color="white", linewidth=1.5 if count <= NAMED else 0.3)
    axes.spines[:].set_visible(False)
