"""Thrust against time."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.plots.letters import plain, short_names
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
    column,
    crafts,
    dress,
    headline,
    instants,
    legend,
    sheet,
    speed_unit,
    thrust_unit,
    time_axes,
)
from closeform.plots.tracks import colours

FEW = 12  # craft up to which each stands in the legend
WORDS = 0.065  # of the height of the axis, for a line of words
ROUNDING = 1e-9  # of a limit
LINES = ((AFTER, "-"), (BEFORE, DASHED), (ALTERNATIVE, DOTTED))  # of the last path, the one before ...


def thrust(paths: Any, labels: Sequence[str], mass: float | None = None) -> Figure:
    """Magnitude and components of the thrust of up to three paths, against time.

    Impulses are stems with their own axis on the right.

    Parameters
    ----------
    paths : Path or sequence of Path
        A batch, or single craft, such as before and after; the last is drawn strongest.
    labels : sequence of str
        One for each path.
    mass : float [kg], optional
        Of the craft: the picture is in newtons; in m/s^2 unless given.

    Returns
    -------
    Figure
        Of matplotlib; save it with its `savefig`.

    Raises
    ------
    ValueError
        If there are more than three paths or none, labels are not as many, `mass` is not positive and finite,
        or an argument is of another kind.
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

    greatest = max((float(np.linalg.norm(jump)) for path in flown for _, jump in path.impulses), default=0.0)

    figure = sheet(9.0)
    panels = column(figure, [1.25, 1, 1, 1], beside=0.95 if greatest else 0.3)
    names = [("magnitude", INK), *((d.name, d.colour) for d in DIRECTIONS)]
    for axes, (name, colour) in zip(panels, names, strict=True):
        dress(axes)
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
    paths: Any,
    names: Sequence[str] | None = None,
    limits: ArrayLike | None = None,
    masses: ArrayLike | None = None,
) -> Figure:
    """How strongly each craft of a formation thrusts, against time, with its limit.

    Among up to 12 craft each stands in the legend.

    Parameters
    ----------
    paths : Path or sequence of Path
        A Path of shape (N,), or N paths.
    names : sequence of str, optional
        Of the craft; their indices unless given.
    limits : array_like of shape (N,) [m/s^2], optional
        Greatest thrust accelerations; nan or inf for a craft without one.
    masses : array_like of shape (N,) [kg], optional
        Of the craft: the picture is in newtons; in m/s^2 unless given.

    Returns
    -------
    Figure
        Of matplotlib; save it with its `savefig`.

    Raises
    ------
    ValueError
        If names, limits or masses are not as many as the craft, masses are not positive, or an argument is of
        another kind.
    """
    flown = crafts(paths)
    called, count = short_names(names, len(flown)), len(flown)
    kilograms = np.ones(count) if masses is None else vector("masses", masses, count)
    if not (kilograms > 0.0).all():
        raise ValueError("masses: must be positive")
    most = np.full(count, np.nan) if limits is None else vector("limits", limits, count)
    peaks, most = np.array([path.peak_thrust for path in flown]) * kilograms, most * kilograms
    top = float(max(peaks.max(), most.max(initial=0.0, where=np.isfinite(most))))
    unit = thrust_unit(top, "m/s²" if masses is None else "N")
    start, end = min(path.start for path in flown), max(path.end for path in flown)
    ticks = clock(flown[0], start, end)

    few = 1 < count <= FEW
    rows = -(-count // 6) if few else 0
    figure = sheet(5.5 + 0.3 * rows)
    (axes,) = column(figure, [1.0], 0.75 + 0.3 * rows)
    dress(axes)
    lines = []
    for path, tint, mass in zip(flown, colours(count), kilograms, strict=True):
        times = instants(path.start, path.end, path)
        push = np.linalg.norm(path.thrust(times), axis=1) * mass / unit.size
        lines += axes.plot(ticks(times), push, color=tint, linewidth=2.0 if count <= FEW else 1.0)
    axes.set_ylim(0.0, 1.08 * top / unit.size if top else 1.0)
    axes.set_ylabel(f"thrust [{unit.name}]", fontsize=TEXT, color=INK)
    limited(axes, most / unit.size, called, unit)
    time_axes([axes], ticks, start, end)
    if few:
        legend(figure, lines, called, ncols=min(6, count), handlelength=2.2)
    k = int(peaks.argmax())
    said = f"{called[k]} thrusts most: {peaks[k] / unit.size:.4g} {unit.name}"
    over = int((peaks > most * (1.0 + ROUNDING)).sum())
    if np.isfinite(most).any():
        said += f"; {over} of {count} craft above their limit" if over else "; all within their limits"
    headline(figure, said if peaks[k] > 0.0 else "Nobody thrusts")
    return figure


def vector(name: str, given: ArrayLike, count: int) -> Floats:
    """One number for each craft."""
    values = np.asarray(given, dtype=float)
    if values.shape != (count,):
        raise ValueError(f"{name}: expected shape ({count},), got {values.shape}")
    return values


def limited(axes: Axes, limits: Floats, called: list[str], unit: Unit) -> None:
    """A dashed line at each limit that occurs, and where there is room in words, with whose it is."""
    free = -np.inf  # up to where words stand
    for limit in np.unique(limits[np.isfinite(limits)]):
        whose = np.flatnonzero(limits == limit)
        words = f"limit {limit:.4g} {unit.name}"
        if len(whose) < len(limits):
            words += f" of {called[whose[0]] if len(whose) == 1 else f'{len(whose)} craft'}"
        axes.axhline(limit, color=INK, linewidth=1.2, linestyle=DASHED)
        if limit < free:
            continue
        free = limit + WORDS * axes.get_ylim()[1]
        look: dict[str, Any] = {"ha": "right", "va": "top", "fontsize": SMALL, "color": INK}
        place = ("axes fraction", "data"), "offset points"
        plain(axes.annotate(words, (0.995, limit), (0, -4), *place, **look))


def level(axes: Axes, top: float, positive: bool) -> None:
    """Limits with zero at the bottom, or in the middle for what has a sign."""
    axes.set_ylim(0 if positive else -top, top)


def stems(panels: list[Axes], flown: list[Path], ticks: Clock, unit: Unit, greatest: float) -> None:
    """Impulses on an axis of their own, its zero level with that of the thrust."""
    styles = LINES[len(flown) - 1 :: -1]
    for row, axes in enumerate(panels):
        right = axes.twinx()
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
        right.tick_params(labelsize=SMALL, colors=INK, length=3)
        for side in ("top", "left", "bottom"):
            right.spines[side].set_visible(False)
        right.spines["right"].set_color(OTHER)
