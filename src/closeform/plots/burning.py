"""Figure of the burns of all spacecraft of a formation against time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from closeform.arrays import Floats
from closeform.fuel.burns import Burns, burns_of, burns_of_pulses
from closeform.fuel.firing import ThrusterFiring
from closeform.motion.path import Path
from closeform.plots.fonts import short_names
from closeform.plots.inputs import crafts
from closeform.plots.label_placement import Names
from closeform.plots.palette import AFTER, FAINT, INK, colours
from closeform.plots.style import SMALL, chart, clock, headline, speed, speed_unit, time_axes

NARROWEST = 1.0 / 400.0  # of the time axis: minimum width of a bar
LETTERED = 8  # maximum number of larger burns in a row with labels
SMALLEST = 0.1  # of the largest burn: smaller burns have no label
MARGIN = 0.015  # of the duration: free space on both sides, so that bars at the ends are visible
HIGH = 0.8  # of the row height: the largest burn
LOW = 0.35  # of the row height: minimum height of a label
LETTERS, BESIDE = SMALL - 2.0, 4.0  # points: font size of a label, and its distance from a bar
MOST_ROWS = 60
Interval = Sequence[float]  # of pixels: start and end


def burns(paths: Path | Sequence[Path] | ThrusterFiring, names: Sequence[str] | None = None) -> Figure:
    """Plot the burns of each spacecraft: a row per spacecraft, a bar per burn, scaled to its delta-v.

    An impulse or a thruster pulse is a thin bar. Continuous thrust from one coast to the next is one bar of
    that length.

    Parameters
    ----------
    paths : Path, sequence of Path, or ThrusterFiring
        Path of shape (N,), up to 60 paths, or a `ThrusterFiring`, whose pulses are shown.
    names : sequence of str, optional
        Names of the spacecraft; default: their indices.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If there are more than 60 paths, the number of names is wrong, or an argument has the wrong type.
    """
    flown = crafts("paths", paths.path if isinstance(paths, ThrusterFiring) else paths)
    if len(flown) > MOST_ROWS:
        raise ValueError(f"paths: up to {MOST_ROWS}, got {len(flown)}; show some of them")
    called, count = short_names(names, len(flown)), len(flown)
    every = (
        [burns_of_pulses(paths.pulses, k) for k in range(count)]
        if isinstance(paths, ThrusterFiring)
        else [burns_of(path).told for path in flown]
    )
    start, end = min(path.start for path in flown), max(path.end for path in flown)
    ticks, greatest = clock(flown[0], start, end), max(float(one.size.max(initial=0.0)) for one in every)
    figure, axes = chart(2.4 + 0.55 * count if count > 1 else 3.6)
    bars = []
    for row, (one, tint) in enumerate(zip(every, colours(count) if count > 1 else [AFTER], strict=True)):
        level = count - 1.0 - row
        axes.axhline(level, color=FAINT, linewidth=1.0)
        width = np.maximum(one.duration, NARROWEST * (end - start))
        middle, high = one.start + 0.5 * one.duration, level + HIGH * one.size / (greatest or 1.0)
        left, right = ticks(middle - 0.5 * width), ticks(middle + 0.5 * width)
        low = np.full_like(high, level)
        corners = np.stack([[left, low], [left, high], [right, high], [right, low]]).transpose(2, 0, 1)
        bars.append(corners)
        axes.add_collection(PolyCollection(list(corners), facecolors=tint, linewidths=0))
    axes.set_ylim(-0.15, count - 1.0 + 1.0)
    axes.set_yticks(np.arange(count)[::-1], called)
    axes.tick_params(axis="y", labelsize=SMALL if count <= 20 else SMALL - 3)
    time_axes([axes], ticks, start - MARGIN * (end - start), end + MARGIN * (end - start))
    if greatest:
        _sizes(figure, axes, [one.size for one in every], greatest, bars)
    planned = float(np.sum(paths.planned.delta_v)) if isinstance(paths, ThrusterFiring) else None
    headline(figure, _said(called, every, greatest, planned))
    return figure


def _sizes(figure: Figure, axes: Axes, sizes: list[Floats], greatest: float, bars: list[Floats]) -> None:
    """Label the larger burns (K,) of each row beside their bars (K, 4, 2), where there is room."""
    unit, gap = speed_unit(greatest), BESIDE * figure.dpi / 72.0
    for row, corners in zip(sizes, bars, strict=True):
        large = np.flatnonzero(row >= SMALLEST * greatest)
        if len(large) > LETTERED:
            continue
        words = [f"{size / unit.size:.4g} {unit.name}" for size in row.tolist()]
        wide = [width for width, _ in Names(figure, words, LETTERS).sizes]
        taken = axes.transData.transform(corners.reshape(-1, 2))[:, 0].reshape(-1, 4)[:, 1:3].tolist()
        for k in sorted(large.tolist(), key=lambda k: -row[k]):
            left, right = taken[k]
            after, before = (right + gap, right + gap + wide[k]), (left - gap - wide[k], left - gap)
            for room, edge, aside, where in ((after, 2, BESIDE, "left"), (before, 1, -BESIDE, "right")):
                if _is_free(room, axes.get_window_extent().intervalx, taken):
                    taken.append(room)
                    (x, top), level = corners[k, edge], corners[k, 0, 1]
                    look: dict[str, Any] = {"fontsize": LETTERS, "color": INK, "va": "top", "ha": where}
                    look |= {"textcoords": "offset points", "xytext": (aside, 0)}
                    axes.annotate(words[k], (x, max(top, level + LOW)), **look)
                    break


def _is_free(room: Interval, within: Interval, taken: Sequence[Interval]) -> bool:
    """Return True if an interval of pixels is within the axes and overlaps no taken interval."""
    (begin, end), (first, last) = room, within
    return first <= begin and end <= last and all(end <= one[0] or one[1] <= begin for one in taken)


def _said(called: list[str], every: list[Burns], greatest: float, planned: float | None) -> str:
    """Return the headline: number of burns, total and largest delta-v."""
    spent = [float(one.size.sum()) for one in every]
    if not greatest:
        return "No spacecraft burns"
    k, number = int(np.argmax(spent)), sum(len(one.size) for one in every)
    unit = speed_unit(sum(spent))
    burns = f"{number} {'burn' if planned is None else 'pulse'}{'s' * (number != 1)}, "
    burns += f"{sum(spent) / unit.size:.4g} {unit.name}"
    if planned is not None:
        burns += f" fired for {speed(planned)} planned"
    if len(every) == 1:
        return f"{called[0]}: {burns}; the largest is {speed(greatest)}"
    return f"{burns} in all; {called[k]} spends most: {speed(spent[k])}"
