"""How near each craft of a formation comes to each other: a matrix of least ratios."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import FuncNorm, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from closeform.arrays import Floats
from closeform.conflicts.two_paths import Conflict, closest_approach, find_conflicts
from closeform.motion.path import Path, stack
from closeform.plots.look import CONFLICT, FAINT, INK, OTHER, SMALL, TEXT, crafts, headline, page
from closeform.zones.pair_zones import NONE, pair_zones
from closeform.zones.zone import Zone

SURE = 1e-8  # above 1: beyond what a least ratio leaves open, and no conflict
TOUCH = 1e-6  # above 1: as good as on the zone's surface
NUMBERED = 14  # craft up to which each pair has its number
NAMED = 36  # craft up to which each has its name at the axes
LONG = 13  # characters of a name
BELOW = ("#8f3300", CONFLICT, "#f2a56b")  # from meeting centres to the zone's surface
BLANK: dict[str, Any] = {"facecolor": "white", "edgecolor": OTHER, "hatch": "////", "linewidth": 0}
ABOVE = ("#5aa5d1", "#b9d9ec", "#f1f7fb")  # from there to the farthest pair


@dataclass(frozen=True, eq=False)
class Pairs:
    """The pairs of craft that have a zone, each with its closest approach.

    `craft` (M, 2) with i < j, in order; the `zone` of each (M), its least `ratio` (M,), inf where
    the two share no time, and the `time` of that (M,) [s].
    """

    paths: Path
    craft: Any
    zone: list[Zone]
    ratio: Floats
    time: Floats

    @classmethod
    def of(cls, paths: Any, zones: Any, flown: int | None = None) -> Self:
        """Pairs of N `paths`, with one zone for all, one for each, or `PairZones`; or none.

        The first two hold for pairs of which one at least is among the first `flown` craft.
        Raises ValueError for another number of zones, or where two do not hold each other.
        """
        batch = stack(crafts(paths))
        flying = len(batch) if flown is None else flown
        kept = pair_zones("zones", zones or [None] * len(batch), flying, len(batch) - flying)
        craft = np.stack(np.triu_indices(len(batch), 1), axis=1)
        which = kept.which(*craft.T)
        craft = craft[which != NONE]
        chosen = [kept.zones[k] for k in which[which != NONE]]
        ratio, time = np.full((2, len(craft)), np.nan)
        for zone in dict.fromkeys(chosen):
            rows = np.array([one is zone for one in chosen])
            near = closest_approach(batch[craft[rows, 0]], batch[craft[rows, 1]], zone)
            ratio[rows], time[rows] = near.ratio, near.time
        return cls(batch, craft, chosen, ratio, time)

    def __len__(self) -> int:
        return len(self.craft)

    @cached_property
    def stays(self) -> list[tuple[Conflict, ...]]:
        """Every stay in its zone of each pair."""
        return [
            find_conflicts(self.paths[i], self.paths[j], zone) if ratio <= 1.0 + SURE else ()
            for (i, j), zone, ratio in zip(self.craft.tolist(), self.zone, self.ratio, strict=True)
        ]

    @property
    def hit(self) -> Any:
        """Which pairs are in conflict (M,)."""
        return np.array([bool(stays) for stays in self.stays], dtype=bool)

    @property
    def order(self) -> list[int]:
        """The pairs that share a time, the closest first; of equals the earliest."""
        ranked = zip(np.round(self.ratio, 6).tolist(), self.time.tolist(), range(len(self)), strict=True)
        return [k for ratio, _, k in sorted(ranked) if ratio < np.inf]


def labels(names: Sequence[str] | None, count: int) -> list[str]:
    """What craft are called: their names, in the middle cut short where long, or their indices."""
    if names is None:
        return [str(k) for k in range(count)]
    if len(names) != count:
        raise ValueError(f"names: {len(names)} names for {count} craft")
    half = LONG // 2
    return [name if len(name) <= LONG else f"{name[:half]}…{name[-half:]}" for name in names]


def ratio_text(ratio: float) -> str:
    """A ratio in words; one in conflict never reads 1.00."""
    if ratio <= 1.0 and round(ratio, 2) == 1.0:
        return "<1"
    if ratio >= 9999.5:
        return f"{ratio:.0e}".replace("e+0", "e")
    return f"{ratio:.{2 if ratio < 9.995 else 1 if ratio < 99.95 else 0}f}"


def ratio_matrix(paths: Any, zones: Any, names: Sequence[str] | None = None) -> Figure:
    """How near each two craft come, as a matrix of least ratios; at 1 their zone begins.

    `paths` is a Path of shape (N,) or a sequence of paths; `zones` is one zone, one for each craft (or
    None; of two as in `screen`), or `PairZones`; `names` are the
    craft's, else they go by their indices.  Both halves say the same.  Pairs in conflict are framed,
    or crossed among many craft; pairs without a zone or without a common time are left blank.

    Raises ValueError for fewer than two craft, another number of names, or where no pair has a zone.
    """
    pairs, called = asked(paths, zones, names)
    count = len(called)
    least = np.full((count, count), np.nan)
    first, second = pairs.craft.T
    least[first, second] = least[second, first] = np.where(np.isfinite(pairs.ratio), pairs.ratio, np.nan)

    figure = page(float(np.clip(3.0 + 0.46 * count, 4.4, 9.4)))
    figure.set_layout_engine("compressed", w_pad=0.06, h_pad=0.05)
    axes = figure.subplots()
    top = ceiling(least)
    image = axes.imshow(least, cmap=colours(), norm=scale(top))
    mark(axes, pairs, least)
    grid(axes, called)
    bar = figure.colorbar(image, ax=axes, extend="max" if np.nanmax(least, initial=0.0) > top else "neither")
    shown = [tick for tick in (0, 0.5, 1, 2, 5, 10, 20, 50, 100) if tick <= top]
    bar.set_ticks(shown, labels=[f"{tick:g}" for tick in shown])
    bar.minorticks_off()
    bar.ax.axhline(1.0, color=INK, linewidth=1.6)
    bar.ax.tick_params(labelsize=SMALL, colors=INK, length=3)
    bar.outline.set_edgecolor(OTHER)
    bar.set_label("least ratio [× zone]", fontsize=TEXT, color=INK)
    headline(figure, title(pairs, called))
    return figure


def asked(paths: Any, zones: Any, names: Sequence[str] | None) -> tuple[Pairs, list[str]]:
    """The pairs to show and what their craft are called."""
    if paths is None:
        raise ValueError("paths: expected a Path, got None; a plan that is not ok has none")
    flown = crafts(paths)
    if len(flown) < 2:
        raise ValueError(f"paths: give at least two craft, got {len(flown)}")
    called = labels(names, len(flown))
    pairs = Pairs.of(flown, zones)
    if not len(pairs):
        raise ValueError("zones: no two craft have a zone")
    return pairs, called


def title(pairs: Pairs, called: list[str]) -> str:
    """How many are in conflict, and the closest pair."""
    hits, total = int(pairs.hit.sum()), len(pairs)
    if not pairs.order:
        return "No two craft that have a zone share a time"
    near = pairs.order[0]
    one, other = (called[craft] for craft in pairs.craft[near])
    least = f"{ratio_text(pairs.ratio[near])} × zone"
    if total == 1:
        return f"{one} and {other}: {'in conflict' if hits else 'clear'}, {least}"
    verdict = f"{hits} of {total} pairs in conflict" if hits else f"All {total} pairs clear"
    touching = int((pairs.ratio <= 1.0 + TOUCH).sum())
    if not hits and touching > 1:
        return f"{verdict}; {touching} of them touch, {least}"
    return f"{verdict}; closest {one} and {other}, {least}"


def ceiling(least: Floats) -> float:
    """Where the scale ends, a round number."""
    most = np.nanmax(least, initial=0.0)
    return next((float(top) for top in (2, 5, 10, 20, 50) if most <= top), 100.0)


def scale(top: float) -> FuncNorm:
    """Linear below 1, logarithmic above, and 1 in the middle."""

    def forward(ratio: Any) -> Any:
        known: Floats = np.ma.filled(np.ma.asarray(ratio, dtype=float), np.nan)
        return np.where(known < 1.0, known - 1.0, np.log(np.maximum(known, 1.0)) / np.log(top))

    def backward(place: Any) -> Any:
        return np.where(np.less(place, 0.0), np.add(place, 1.0), top ** np.maximum(place, 0.0))

    return FuncNorm((forward, backward), vmin=0.0, vmax=top)


def colours() -> LinearSegmentedColormap:
    """Two families of colours that meet, with a step, in the middle."""
    lower, upper = np.linspace(0.0, 0.5, 3), np.linspace(0.5, 1.0, 3)
    stops = [*zip(lower, BELOW, strict=True), *zip(upper, ABOVE, strict=True)]
    return LinearSegmentedColormap.from_list("ratio", stops, N=512)


def mark(axes: Axes, pairs: Pairs, least: Floats) -> None:
    """Numbers in the cells and frames around conflicts, or crosses where cells are small."""
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
        below = (0.0, -0.02)
        axes.legend(
            handles=handles, loc="upper left", bbox_to_anchor=below, ncols=2, frameon=False, fontsize=SMALL
        )


def number(axes: Axes, row: int, column: int, ratio: float, is_hit: bool, size: float) -> None:
    """The ratio in its cell."""
    text = axes.text(column, row, ratio_text(ratio), ha="center", va="center", fontsize=size)
    text.set(color="white" if is_hit and ratio < 0.75 else INK, fontweight="bold" if is_hit else "normal")
    text.set_in_layout(False)  # inside of the axes, and many


def grid(axes: Axes, called: list[str]) -> None:
    """Names above and to the left, and white lines between the cells."""
    count = len(called)
    step = -(-count // NAMED)
    chosen = range(0, count, step)
    longest = max(len(called[k]) for k in chosen)
    words = [called[k] for k in chosen]
    size = SMALL if count <= 20 else SMALL - 3.0
    axes.xaxis.tick_top()
    upright = longest * size > 600.0 / len(words)
    axes.set_xticks(chosen, words, rotation=90 if upright else 0)
    axes.set_yticks(chosen, words)
    axes.tick_params(labelsize=size, colors=INK, length=0)
    axes.set_xticks(np.arange(count + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(count + 1) - 0.5, minor=True)
    axes.tick_params(which="minor", length=0)
    axes.grid(which="minor", color="white", linewidth=1.5 if count <= NAMED else 0.3)
    for spine in axes.spines.values():
        spine.set_visible(False)
