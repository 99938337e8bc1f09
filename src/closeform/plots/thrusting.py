"""Thrust against time."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from closeform.motion.path import Path
from closeform.plots.look import (
    AFTER,
    ALTERNATIVE,
    BEFORE,
    DASHED,
    DIRECTIONS,
    DOTTED,
    INK,
    OTHER,
    SMALL,
    TEXT,
    Clock,
    Unit,
    clock,
    crafts,
    dress,
    instants,
    page,
    speed,
    speed_unit,
    thrust_unit,
    time_axes,
)

LINES = ((AFTER, "-"), (BEFORE, DASHED), (ALTERNATIVE, DOTTED))  # of the last path, the one before ...


def thrust(paths: Any, labels: Sequence[str], mass: float | None = None) -> Figure:
    """Magnitude and components of the thrust of up to three paths against time.

    `paths` is a sequence of single craft, or a batch, with one label each, such as before and
    after; the last is drawn strongest.  Thrust is an acceleration, or in newtons with the `mass` [kg]
    of the craft.  Impulses are stems with their own axis on the right.

    Raises ValueError for more than three paths, another number of labels, or a mass that is not positive.
    """
    if mass is not None and not 0.0 < mass < np.inf:
        raise ValueError(f"mass: must be positive and finite [kg], got {mass!r:.60}")
    flown = crafts(paths)
    if not 1 <= len(flown) <= len(LINES):
        raise ValueError(f"paths: from one to {len(LINES)}, got {len(flown)}")
    if len(labels) != len(flown):
        raise ValueError(f"labels: {len(labels)} labels for {len(flown)} paths")
    start, end = min(path.start for path in flown), max(path.end for path in flown)
    ticks = clock(flown[0], start, end)
    force, basic = (1.0, "m/s²") if mass is None else (mass, "N")
    unit = thrust_unit(force * max(path.peak_thrust for path in flown), basic)

    figure = page(9.0)
    column = list(figure.subplots(4, 1, sharex=True, height_ratios=[1.25, 1, 1, 1]))
    names = [("magnitude", INK), *((d.name, d.colour) for d in DIRECTIONS)]
    for axes, (name, colour) in zip(column, names, strict=True):
        dress(axes)
        if axes is not column[0]:
            axes.axhline(0, color=INK, linewidth=0.8)
        axes.set_ylabel(f"{name} [{unit.name}]", fontsize=SMALL, color=colour)
    for path, (colour, dashes), label in zip(flown, LINES[len(flown) - 1 :: -1], labels, strict=True):
        times = instants(path.start, path.end, path)
        push = force * path.thrust(times)
        text = f"{label}: Δv {speed(path.delta_v)}"
        if np.isfinite(path.energy):
            text += f", energy {path.energy:.4g} m²/s³"
        curves = [np.linalg.norm(push, axis=1), *push.T]
        for axes, curve in zip(column, curves, strict=True):
            axes.plot(
                ticks(times), curve / unit.size, color=colour, linestyle=dashes, linewidth=2.2, label=text
            )
    for axes in column:
        level(axes, 1.1 * max(np.abs(axes.get_ylim())), axes is column[0])
    greatest = max((float(np.linalg.norm(jump)) for path in flown for _, jump in path.impulses), default=0.0)
    if greatest > 0:
        stems(column, flown, ticks, speed_unit(greatest), greatest)
    time_axes(column, ticks, start, end)
    figure.align_ylabels(column)
    figure.legend(
        *column[0].get_legend_handles_labels(),
        loc="outside upper left",
        ncols=len(flown),
        frameon=False,
        fontsize=TEXT,
        handlelength=2.6,
    )
    return figure


def level(axes: Axes, top: float, positive: bool) -> None:
    """Limits with zero at the bottom, or in the middle for what has a sign."""
    axes.set_ylim(0 if positive else -top, top)


def stems(column: list[Axes], flown: list[Path], ticks: Clock, unit: Unit, greatest: float) -> None:
    """Impulses on an axis of their own, its zero level with that of the thrust."""
    styles = LINES[len(flown) - 1 :: -1]
    for row, axes in enumerate(column):
        right = axes.twinx()
        level(right, 1.15 * greatest / unit.size, row == 0)
        for path, (colour, dashes) in zip(flown, styles, strict=True):
            for time, jump in path.impulses:
                height = float(np.linalg.norm(jump) if row == 0 else jump[row - 1]) / unit.size
                right.plot(
                    [float(ticks(time))] * 2, [0.0, height], color=colour, linestyle=dashes, linewidth=2
                )
                right.plot(ticks(time), height, "o", color=colour, markersize=7, clip_on=False)
        right.set_ylabel(f"impulse [{unit.name}]", fontsize=SMALL, color=INK)
        right.tick_params(labelsize=SMALL, colors=INK, length=3)
        for side in ("top", "left", "bottom"):
            right.spines[side].set_visible(False)
        right.spines["right"].set_color(OTHER)
