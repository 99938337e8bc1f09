"""Matrix of the minimum clearance ratios of all pairs of a formation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import FuncNorm, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.plots.fonts import inches, plain
from closeform.plots.pairs import Pairs, asked, ratio_text, title
from closeform.plots.palette import CONFLICT, FAINT, INK, OTHER
from closeform.plots.style import LETTERS, SMALL, TEXT, area, headline, sheet
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones

NUMBERED = 14  # maximum number of spacecraft with numbers in the cells
NAMED = 36  # maximum number of names on each axis
BELOW = ("#8f3300", CONFLICT, "#f2a56b")  # from ratio 0 to the keep-out boundary
BLANK: dict[str, Any] = {"facecolor": "white", "edgecolor": OTHER, "hatch": "////", "linewidth": 0}
ABOVE = ("#5aa5d1", "#b9d9ec", "#f1f7fb")  # from the keep-out boundary to the farthest pair


def ratio_matrix(
    paths: Path | Sequence[Path],
    zones: OwnZone | Sequence[OwnZone | None] | PairZones | None,
    names: Sequence[str] | None = None,
) -> Figure:
    """Plot the minimum clearance ratio of each pair as a matrix; 1 is the keep-out boundary.

    The matrix is symmetric. Pairs in conflict are framed, or crossed if there are many spacecraft. Pairs
    without a zone or a common time are hatched.

    Parameters
    ----------
    paths : Path or sequence of Path
        Path of shape (N,), or N paths.
    zones : Zone, CovarianceZone, Body, None, sequence of these, or PairZones
        One zone for all spacecraft or one for each, combined for a pair as in `screen`; None: no zone of its
        own.
    names : sequence of str, optional
        Names of the spacecraft; default: their indices.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If there are fewer than two spacecraft, the number of names is wrong, no pair has a zone, or an
        argument has the wrong type.
    """
    pairs, called = asked(paths, zones, names)
    count = len(called)
    least = np.full((count, count), np.nan)
    first, second = pairs.craft.T
    least[first, second] = least[second, first] = np.where(np.isfinite(pairs.ratio), pairs.ratio, np.nan)

    keyed = bool(np.isnan(least[np.triu_indices(count, 1)]).any() or pairs.hit.any())
    figure, axes, scale_axes, upright = framework(pairs, called, keyed)
    top = ceiling(least)
    image = axes.imshow(least, cmap=colours(), norm=scale(top), interpolation="nearest")
    mark(axes, pairs, least)
    grid(axes, called, upright)
    extend = "max" if np.nanmax(least, initial=0.0) > top else "neither"
    bar = figure.colorbar(image, cax=scale_axes, extend=extend)
    shown = [tick for tick in (0, 0.5, 1, 2, 5, 10, 20, 50, 100) if tick <= top]
    bar.set_ticks(shown, labels=[f"{tick:g}" for tick in shown])
    bar.minorticks_off()
    bar.ax.axhline(1.0, color=INK, linewidth=1.6)
    bar.ax.tick_params(labelsize=SMALL, colors=INK, length=3)
    bar.outline.set_edgecolor(OTHER)
    bar.set_label("ratio [× zone]", fontsize=TEXT, color=INK)
    headline(figure, title(pairs, called))
    return figure


def framework(pairs: Pairs, called: list[str], keyed: bool) -> tuple[Figure, Axes, Axes, bool]:
    """Return the figure, the axes of matrix and colour scale, and whether column names are vertical.

    With `keyed`, the figure has room for a legend.
    """
    count = len(called)
    side = float(np.clip(0.52 * count, 2.0, 7.6))
    longest = max(inches(name, SMALL) for name in called)
    upright = longest > 0.92 * side / min(count, NAMED)
    left, below = 0.35 + longest, 0.6 if keyed else 0.2
    above = 0.55 + (longest if upright else 0.3)
    wide = max(min(6.4, len(title(pairs, called)) / LETTERS), left + side + 1.4)
    figure = sheet(below + side + above, wide)
    axes = area(figure, left, below, side, side)
    return figure, axes, area(figure, left + side + 0.3, below, 0.28, side), upright


def ceiling(least: Floats) -> float:
    """Return the upper end of the colour scale, a round number."""
    most = np.nanmax(least, initial=0.0)
    return next((float(top) for top in (2, 5, 10, 20, 50) if most <= top), 100.0)


def scale(top: float) -> FuncNorm:
    """Return a norm that is linear below 1 and logarithmic above, with 1 in the middle."""

    def forward(ratio: Any) -> Any:
        known: Floats = np.ma.filled(np.ma.asarray(ratio, dtype=float), np.nan)
        return np.where(known < 1.0, known - 1.0, np.log(np.maximum(known, 1.0)) / np.log(top))

    def backward(place: Any) -> Any:
        return np.where(np.less(place, 0.0), np.add(place, 1.0), top ** np.maximum(place, 0.0))

    return FuncNorm((forward, backward), vmin=0.0, vmax=top)


def colours() -> LinearSegmentedColormap:
    """Return a colour map of two ranges with a step between them in the middle."""
    lower, upper = np.linspace(0.0, 0.5, 3), np.linspace(0.5, 1.0, 3)
    stops = [*zip(lower, BELOW, strict=True), *zip(upper, ABOVE, strict=True)]
    return LinearSegmentedColormap.from_list("ratio", stops, N=512)


def mark(axes: Axes, pairs: Pairs, least: Floats) -> None:
    """Draw numbers in the cells and frames around conflicts, or crosses in small cells."""
    count = len(least)
    both = np.concatenate([pairs.craft, pairs.craft[:, ::-1]])
    hit = np.tile(pairs.hit, 2)
    few = count <= NUMBERED
    handles: list[Any] = []
    if few:
        known = np.isfinite(least[both[:, 0], both[:, 1]])
        for (row, column), is_hit in zip(both[known].tolist(), hit[known], strict=True):
            number(axes, row, column, least[row, column], is_hit, SMALL - 0.25 * max(0, count - 8))
        frames = [Rectangle((column - 0.46, row - 0.46), 0.92, 0.92) for row, column in both[hit]]
        axes.add_collection(PatchCollection(frames, facecolors="none", edgecolors=INK, linewidths=2))
    else:
        size = float(np.clip(270.0 / count, 1.0, 9.0))
        rows, columns = both[hit].T
        axes.plot(columns, rows, "x", color=INK, markersize=size, markeredgewidth=0.22 * size)
    diagonal = [Rectangle((k - 0.5, k - 0.5), 1, 1) for k in range(count)]
    axes.add_collection(PatchCollection(diagonal, facecolors=FAINT, linewidths=0))
    if hit.any():
        edge = INK if few else BELOW[1]
        words = f"{'framed' if few else 'crossed'}: in conflict"
        handles.append(Patch(facecolor=BELOW[1], edgecolor=edge, linewidth=2, label=words))
    if np.isnan(least[np.triu_indices(count, 1)]).any():
        axes.add_patch(Rectangle((-0.5, -0.5), count, count, **BLANK, zorder=-1))
        handles.append(Patch(label="no zone or no common time", **BLANK))
    if handles:
        look: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (-0.01, -0.02), "borderaxespad": 0.0}
        axes.legend(handles=handles, ncols=2, frameon=False, fontsize=SMALL, **look)


def number(axes: Axes, row: int, column: int, ratio: float, is_hit: bool, size: float) -> None:
    """Write the ratio in its cell."""
    text = axes.text(column, row, ratio_text(ratio), ha="center", va="center", fontsize=size)
    text.set(color="white" if is_hit and ratio < 0.75 else INK, fontweight="bold" if is_hit else "normal")


def grid(axes: Axes, called: list[str], upright: bool) -> None:
    """Draw names above and on the left, and white lines between the cells."""
    count = len(called)
    step = -(-count // NAMED)
    chosen = range(0, count, step)
    words = [called[k] for k in chosen]
    axes.xaxis.tick_top()
    axes.set_xticks(chosen, words, rotation=90 if upright else 0)
    axes.set_yticks(chosen, words)
    axes.tick_params(labelsize=SMALL if count <= 20 else SMALL - 3.0, colors=INK, length=0)
    for name in (*axes.get_xticklabels(), *axes.get_yticklabels()):
        plain(name)
    edges = np.arange(count + 1) - 0.5
    ends = np.full(count + 1, -0.5)
    lines = np.stack([np.stack([edges, ends], -1), np.stack([edges, count + ends], -1)], 1)
    width = 1.5 if count <= NAMED else 0.3
    axes.add_collection(
        LineCollection([*lines, *lines[..., ::-1]], colors="white", linewidths=width, zorder=1)
    )
    for spine in axes.spines.values():
        spine.set_visible(False)
