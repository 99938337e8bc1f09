"""Matrix of the minimum clearance ratios of all pairs of a formation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import FuncNorm, LinearSegmentedColormap
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
BELOW = ("#8f3300", CONFLICT, "#f2a56b")  # from ratio 0 to the keep-out boundary
ABOVE = ("#5aa5d1", "#b9d9ec", "#f1f7fb")  # from the keep-out boundary to the farthest pair


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
    most = np.nanmax(least, initial=0.0)
    top = next((float(top) for top in (2, 5, 10, 20, 50) if most <= top), 100.0)

    side = float(np.clip(0.55 * count, 2.4, 7.6))
    figure = sheet(side + 1.9, max(side + 2.6, 6.4))
    axes = figure.subplots()
    axes.set_facecolor(FAINT)
    image = axes.imshow(least, cmap=colour_map(), norm=ratio_norm(top), interpolation="nearest")
    mark(axes, pairs, least)
    name_cells(axes, called)
    bar = figure.colorbar(image, ax=axes, extend="max" if most > top else "neither", pad=0.03, aspect=30)
    ticks = [tick for tick in (0, 0.5, 1, 2, 5, 10, 20, 50, 100) if tick <= top]
    bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    bar.minorticks_off()
    bar.ax.axhline(1.0, color=INK, linewidth=1.6)
    bar.ax.tick_params(labelsize=SMALL, colors=INK, length=3)
    bar.set_label("minimum clearance ratio [× zone]", fontsize=TEXT, color=INK)
    handles: list[Patch] = []
    if pairs.hit.any():
        words = f"{'bold' if count <= NUMBERED else 'crossed'}: in conflict"
        handles.append(Patch(facecolor=BELOW[1], label=words))
    if np.isnan(least[np.triu_indices(count, 1)]).any():
        handles.append(Patch(facecolor=FAINT, edgecolor=OTHER, label="no zone or no common time"))
    if handles:
        legend(figure, handles, [str(one.get_label()) for one in handles])
    headline(figure, verdict_of_pairs(pairs, called))
    return figure


def ratio_norm(top: float) -> FuncNorm:
    """Return a norm that is linear below 1 and logarithmic above, with 1 in the middle."""

    def forward(ratio: Any) -> Any:
        known: Floats = np.ma.filled(np.ma.asarray(ratio, dtype=float), np.nan)
        return np.where(known < 1.0, known - 1.0, np.log(np.maximum(known, 1.0)) / np.log(top))

    def backward(place: Any) -> Any:
        return np.where(np.less(place, 0.0), np.add(place, 1.0), top ** np.maximum(place, 0.0))

    return FuncNorm((forward, backward), vmin=0.0, vmax=top)


def colour_map() -> LinearSegmentedColormap:
    """Return a colour map of two ranges with a step between them in the middle."""
    lower, upper = np.linspace(0.0, 0.5, 3), np.linspace(0.5, 1.0, 3)
    stops = [*zip(lower, BELOW, strict=True), *zip(upper, ABOVE, strict=True)]
    return LinearSegmentedColormap.from_list("ratio", stops, N=512)


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
        look: dict[str, Any] = {"color": "white" if ratio < 0.75 else INK, "ha": "center", "va": "center"}
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
