"""Figures of thrust against time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from closeform.arrays import Floats, number, numbers, shown
from closeform.motion.path import Path
from closeform.plots.fonts import plain, short_names
from closeform.plots.inputs import crafts, texts
from closeform.plots.palette import AFTER, ALTERNATIVE, BEFORE, DIRECTIONS, INK, OTHER, colours
from closeform.plots.style import (
    DASHED,
    DOTTED,
    SMALL,
    TEXT,
    Clock,
    Unit,
    clock,
    column,
    headline,
    instants,
    legend,
    right_axis,
    sheet,
    speed_unit,
    thrust_unit,
    time_axes,
)

FEW = 12  # maximum number of spacecraft in the legend
WIDEST = 5.0  # points: width of the first of few curves, so that coinciding curves stay visible
FAR = 3.0  # times the maximum: a limit above that would flatten all curves
LOW = 0.12  # of the maximum: a limit below that has its label above the line
ROUNDING = 1e-9  # of a limit
LINES = ((AFTER, "-"), (BEFORE, DASHED), (ALTERNATIVE, DOTTED))  # last path first


def thrust(paths: Path | Sequence[Path], labels: Sequence[str], mass: float | None = None) -> Figure:
    """Plot the magnitude and the components of the thrust of up to three paths against time.

    Impulses are stems with their own axis on the right.

    Parameters
    ----------
    paths : Path or sequence of Path
        Batch or single paths, such as before and after; the last one is drawn in the main colour.
    labels : sequence of str
        Label of each path.
    mass : float [kg], optional
        Mass of the spacecraft; if given, thrust is shown in newtons instead of m/s^2.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If there are more than three paths or none, the number of labels is wrong, `mass` is not positive and
        finite, or an argument has the wrong type.
    """
    if mass is not None and not 0.0 < number("mass", mass) < np.inf:
        raise ValueError(f"mass: must be positive and finite [kg], got {mass!r:.60}")
    flown = crafts("paths", paths)
    if not 1 <= len(flown) <= len(LINES):
        raise ValueError(f"paths: from one to {len(LINES)}, got {len(flown)}")
    labels = texts("labels", labels, len(flown), "paths")
    start, end = min(path.start for path in flown), max(path.end for path in flown)
    ticks = clock(flown[0], start, end)
    force, basic = (1.0, "m/s²") if mass is None else (mass, "N")
    unit = thrust_unit(force * max(path.peak_thrust for path in flown), basic)

    greatest = max((float(np.linalg.norm(jump)) for path in flown for _, jump in path.impulses), default=0.0)

    figure = sheet(9.0)
    panels = column(figure, [1.25, 1, 1, 1], beside=0.95 if greatest else 0.3)
    names = [("magnitude", INK), *((d.name, d.colour) for d in DIRECTIONS)]
    for axes, (name, colour) in zip(panels, names, strict=True):
        if axes is not panels[0]:
            axes.axhline(0, color=INK, linewidth=0.8)
        axes.set_ylabel(f"{name} [{unit.name}]", fontsize=SMALL, color=colour)
    spent = speed_unit(max(path.delta_v for path in flown))
    lines, words = [], []
    for path, (colour, dashes), label in zip(flown, LINES[len(flown) - 1 :: -1], labels, strict=True):
        times = instants(path.start, path.end, path)
        push = force * path.thrust(times)
        text = f"{label}: Δv {path.delta_v / spent.size:.4g} {spent.name}"
        if np.isfinite(path.energy):
            text += f", energy {path.energy:.4g} m²/s³"
        look: dict[str, Any] = {"color": colour, "linestyle": dashes, "linewidth": 2.2, "label": text}
        for axes, curve in zip(panels, [np.linalg.norm(push, axis=1), *push.T], strict=True):
            (line,) = axes.plot(ticks(times), curve / unit.size, **look)
        lines.append(line)
        words.append(text)
    for axes in panels:
        level(axes, 1.1 * max(np.abs(axes.get_ylim())), axes is panels[0])
    if greatest > 0:
        stems(panels, flown, ticks, speed_unit(greatest), greatest)
    time_axes(panels, ticks, start, end)
    look = {"loc": "upper left", "ncols": len(flown) if len(flown) < 3 else 1, "handlelength": 2.6}
    legend(figure, lines, words, **look, fontsize=TEXT if len(flown) < 3 else SMALL - 2.5)
    return figure


def formation_thrust(
    paths: Path | Sequence[Path],
    names: Sequence[str] | None = None,
    limits: ArrayLike | None = None,
    masses: ArrayLike | None = None,
    on_off: ArrayLike = False,
) -> Figure:
    """Plot the thrust magnitude of each spacecraft of a formation against time, with its limit.

    Up to 12 spacecraft have a legend. For on-off thrusters, curves are the planned thrust and limits the
    thrust of one thruster while it is on; `pulses` shows the pulses.

    Parameters
    ----------
    paths : Path or sequence of Path
        Path of shape (N,), or N paths.
    names : sequence of str, optional
        Names of the spacecraft; default: their indices.
    limits : array_like of shape (N,) [m/s^2], optional
        Maximum thrust accelerations; nan or inf for no limit. If they differ, a second panel shows the share
        of its own limit that each spacecraft uses.
    masses : array_like of shape (N,) [kg], optional
        Masses of the spacecraft; if given, thrust is shown in newtons instead of m/s^2.
    on_off : array_like of bool of shape () or (N,), default False
        True for spacecraft whose limit is the thrust of one on-off thruster.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If the number of names, limits, masses or on_off is wrong, masses are not positive, or an argument
        has the wrong type.
    """
    flown = crafts("paths", paths)
    called, count = short_names(names, len(flown)), len(flown)
    kilograms = np.ones(count) if masses is None else vector("masses", masses, count)
    if not (kilograms > 0.0).all():
        raise ValueError("masses: must be positive")
    most = np.full(count, np.nan) if limits is None else vector("limits", limits, count)
    pulsed = np.asarray(on_off)
    if pulsed.dtype != bool or pulsed.shape not in ((), (count,)):
        raise ValueError(
            f"on_off: expected True, False, or one for each of {count} craft, got {shown(on_off)}"
        )
    pulsed = np.broadcast_to(pulsed, count)
    peaks, most = np.array([path.peak_thrust for path in flown]) * kilograms, most * kilograms
    free, basic = ~np.isfinite(most), "m/s²" if masses is None else "N"
    known = most[~free]
    unit = thrust_unit(float(peaks.max() or known.max(initial=0.0)), basic)
    start, end = min(path.start for path in flown), max(path.end for path in flown)
    ticks = clock(flown[0], start, end)

    few = 1 < count <= FEW
    unlike = len(known) > 0 and known.min() > 0.0 and known.max() > (1.0 + ROUNDING) * known.min()
    rows = -(-count // 6) if few else 0
    figure = sheet((8.0 if unlike else 5.5) + 0.3 * rows)
    panels = column(figure, [1.0] * (1 + unlike), 0.75 + 0.3 * rows)
    lines = []
    widths = np.linspace(WIDEST, 2.0, count) if few else np.full(count, 2.0 if count == 1 else 1.0)
    for path, tint, mass, limit, wide in zip(flown, colours(count), kilograms, most, widths, strict=True):
        times = instants(path.start, path.end, path)
        push = np.linalg.norm(path.thrust(times), axis=1) * mass
        look: dict[str, Any] = {"color": tint, "linewidth": wide}
        lines += panels[0].plot(ticks(times), push / unit.size, **look)
        if unlike and np.isfinite(limit):
            panels[1].plot(ticks(times), 100.0 * push / limit, **look)
    planned = "planned " if pulsed.any() else ""
    scaled(panels[0], f"{planned}thrust [{unit.name}]", float(peaks.max()) / unit.size)
    if unlike:
        scaled(panels[1], "share of own limit [%]", 100.0 * float((peaks[~free] / known).max()))
        limited(panels[1], 100.0, "what a thruster gives" if pulsed[~free].all() else "the limit of each")
    elif len(known):
        whose = [name for name, none in zip(called, free, strict=True) if not none]
        some = f" of {whose[0] if len(whose) == 1 else f'{len(whose)} craft'}" if free.any() else ""
        own = thrust_unit(known[0], basic)
        one = "each thruster, while on," if pulsed[~free].all() else "limit"
        limited(panels[0], known[0] / unit.size, f"{one} {known[0] / own.size:.4g} {own.name}{some}")
    time_axes(panels, ticks, start, end)
    if few:
        legend(figure, lines, called, ncols=min(6, count), handlelength=2.2)
    headline(figure, most_of_all(called, peaks, most, pulsed, basic))
    return figure


def most_of_all(called: list[str], peaks: Floats, limits: Floats, pulsed: Any, basic: str) -> str:
    """Return the headline: the largest thrust, and how it compares with the limits."""
    k = int(peaks.argmax())
    if not peaks[k] > 0.0:
        return "No spacecraft thrusts"
    unit = thrust_unit(peaks[k], basic)
    most = f"{peaks[k] / unit.size:.4g} {unit.name}"
    if pulsed[k] and np.isfinite(limits[k]):
        own = thrust_unit(limits[k], basic)
        gives = f"thrusters fire {limits[k] / own.size:.4g} {own.name} each, on or off"
        return f"{called[k]}'s plan asks for most, {most}; {gives}"
    said = f"{called[k]} thrusts most: {most}"
    known = np.isfinite(limits)
    if not known.any():
        return said
    over = int((peaks > limits * (1.0 + ROUNDING)).sum())
    kept = f"{over} of {len(peaks)} craft above their limit" if over else "all within their limits"
    return f"{said}; {kept}"


def vector(name: str, given: ArrayLike, count: int) -> Floats:
    """Return an argument as one number per spacecraft, or raise ValueError."""
    values = numbers(name, given)
    if values.shape != (count,):
        raise ValueError(f"{name}: expected shape ({count},), got {values.shape}")
    return values


def scaled(axes: Axes, words: str, top: float) -> None:
    """Set the range from zero to slightly above `top`, and the axis label."""
    axes.set_ylim(0.0, 1.08 * top if top > 0.0 else 1.0)
    axes.set_ylabel(words)


def limited(axes: Axes, limit: float, words: str) -> None:
    """Draw a dashed line at a limit; only mention a limit far above all curves."""
    look: dict[str, Any] = {"ha": "right", "va": "top", "fontsize": SMALL, "color": INK}
    at, place, shift = (0.995, 1.0), "axes fraction", -4
    top = axes.get_ylim()[1] / 1.08
    if limit <= FAR * top:
        axes.set_ylim(0.0, 1.08 * max(top, limit))
        axes.axhline(limit, color=INK, linewidth=1.2, linestyle=DASHED)
        if limit < LOW * top:
            look["va"], shift = "bottom", 4
        plain(axes.annotate(words, (0.995, limit), (0, shift), (place, "data"), "offset points", **look))
    else:
        plain(axes.annotate(f"{words}, far above", at, (0, -4), place, "offset points", **look))


def level(axes: Axes, top: float, positive: bool) -> None:
    """Set the range from zero, or symmetric about zero for signed values."""
    axes.set_ylim(0 if positive else -top, top)


def stems(panels: list[Axes], flown: list[Path], ticks: Clock, unit: Unit, greatest: float) -> None:
    """Draw impulses on a right axis whose zero coincides with that of the thrust."""
    styles = LINES[len(flown) - 1 :: -1]
    for row, axes in enumerate(panels):
        right = right_axis(axes, INK)
        level(right, 1.15 * greatest / unit.size, row == 0)
        for path, (colour, dashes) in zip(flown, styles, strict=True):
            for time, jump in path.impulses:
                height = float(np.linalg.norm(jump) if row == 0 else jump[row - 1]) / unit.size
                right.plot(
                    [float(ticks(time))] * 2, [0.0, height], color=colour, linestyle=dashes, linewidth=2
                )
                right.plot(ticks(time), height, "o", color=colour, markersize=7, clip_on=False)
        right.yaxis.set_label_coords(1.0 + 0.72 / 8.65, 0.5)
        right.set_ylabel(f"impulse [{unit.name}]", fontsize=SMALL, color=INK)
        right.spines["right"].set(visible=True, color=OTHER)
