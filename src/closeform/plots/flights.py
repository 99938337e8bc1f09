"""Figures of simulations in the high-fidelity model: deviations, clearance ratios, costs and paths."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from closeform.arrays import Floats, instance
from closeform.dynamics.least_ratios import FINER, cubic, nearest_pair, nearest_pairs
from closeform.dynamics.simulation_result import Simulation
from closeform.dynamics.tube import Tube
from closeform.plots.camera import word
from closeform.plots.closest import ratio_axis
from closeform.plots.fleet import SIDE, three_planes
from closeform.plots.fonts import plain, short_names
from closeform.plots.label_placement import Names
from closeform.plots.palette import AFTER, ALTERNATIVE, BEFORE, CONFLICT, INK, ZONE, colours
from closeform.plots.style import (
    ABOVE,
    DASHED,
    LEFT,
    SMALL,
    TEXT,
    WIDTH,
    Clock,
    area,
    chart,
    clock,
    dress,
    headline,
    legend,
    length,
    length_unit,
    rounded_down,
    sheet,
    speed,
    speed_unit,
    time_axes,
    zone_band,
)
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone

PALE = "#9ec5df"
DRAWN = 300  # maximum number of runs that are drawn, besides the worst
MOST = 24  # maximum number of spacecraft in the cost figure
WIDER = 3.0  # times the spread of the minimum ratios: range of the close-up above the planned minimum
UNDER = 20.0  # typographic points from the worst point down to its label
BESIDE = 0.25  # of the axes width: a label outside the middle half starts or ends at its dot
SPACE = 0.22  # of the range of the close-up: free space below its minimum
PATHS_DRAWN, FEW = 60, 4  # maximum and minimum number of runs drawn besides the worst
POINTS, A_TURN = 240, 48  # points of each line: minimum, and per orbit
LONG = 5  # orbits
VERTICES = 30_000  # per spacecraft over all runs; beyond it fewer runs are drawn
SHARE = 0.06  # of the figure's extent: maximum size of a magnified deviation
NAMED = 12  # maximum number of spacecraft with names


def flight_deviations(
    flight: Simulation, tube: Tube | None = None, names: Sequence[str] | None = None
) -> Figure:
    """Plot the largest deviation from the plan against time, for every simulation run, with the tube.

    Each pale line is the largest deviation of any spacecraft in one run. The blue line is the median of all
    runs; the red line is the run with the largest deviation.

    Parameters
    ----------
    flight : Simulation
        Result of `simulate`.
    tube : Tube, optional
        Tracking-error tube predicted by `tube`.
    names : sequence of str, optional
        Names of the spacecraft; default: their indices.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If the number of names is wrong, or an argument has the wrong type.
    """
    instance("flight", flight, Simulation)
    instance("tube", tube, Tube, type(None))
    called = short_names(names, flight.states.shape[1])
    off, ticks = flight.deviations.max(axis=1), _clock(flight)
    seed, craft, step = (
        int(k) for k in np.unravel_index(int(np.argmax(flight.deviations)), flight.deviations.shape)
    )
    radius, share = 0.0, ""
    if tube is not None:
        share = f"{100.0 * tube.probability:.3f} % of flights"
        lasts = float(flight.times[-1] - flight.times[0])
        radius = float(np.max(tube.containment(lasts, craft=flight.states.shape[1])))
    unit = length_unit(max(float(off.max()), radius))
    figure, axes = chart(5.8, 1.1)
    _all(axes, ticks, flight.times, off / unit.size, seed)
    if tube is not None:
        axes.axhline(radius / unit.size, color=ZONE, linewidth=2.0, linestyle=DASHED)
        corner = float(ticks(flight.times[0])), radius / unit.size
        said = f"{share} stay below {length(radius)}"
        plain(word(axes, corner, said, shift=(6, -16), ha="left", va="baseline"))
    axes.set_ylim(0.0, 1.12 * max(float(off.max()), radius) / unit.size or 1.0)
    axes.set_ylabel(f"deviation from the plan [{unit.name}]")
    time_axes([axes], ticks, float(flight.times[0]), float(flight.times[-1]))
    name = f"{_which(flight, seed)}{called[craft]}"
    _dot(axes, ticks, flight.times[step], off[seed, step] / unit.size, name, 8)
    most = f"Off by at most {length(float(off.max()))} in {_flights(flight)}"
    inside = ""
    if tube is not None:
        inside = f"; {share} stay within {length(radius)}, said beforehand"
    _meanings(
        figure, flight, ("each flight, its craft farthest off", "median", f"farthest off, flight {seed}")
    )
    plain(headline(figure, f"{most}{inside}"))
    return figure


def flight_ratios(flight: Simulation, zone: Zone | PairZones, names: Sequence[str] | None = None) -> Figure:
    """Plot the minimum clearance ratio of all pairs against time, for every run, with a close-up.

    Each pale line is the minimum of all pairs in one run; the dashed line is that of the plan. The blue line
    is the median of all runs; the red line is the run with the closest approach. A ratio below 1 is a
    conflict.

    Parameters
    ----------
    flight : Simulation
        Result of `simulate`.
    zone : Zone or PairZones
        One zone for all pairs, or one for each.
    names : sequence of str, optional
        Names of the spacecraft; default: their indices.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If there are fewer than two spacecraft, no pair has a zone, the number of names is wrong, or an
        argument has the wrong type.
    """
    instance("flight", flight, Simulation)
    instance("zone", zone, Zone, PairZones)
    count = flight.states.shape[1]
    called = short_names(names, count)
    if count < 2:
        raise ValueError("flight: has one spacecraft and so no pair; give a simulation of two or more")
    least = np.stack([nearest_pairs(one, zone) for one in flight.states])
    if not np.isfinite(least).any():
        raise ValueError("zone: no pair has one; give a zone")
    planned = nearest_pairs(flight.planned.state(flight.times), zone)
    seed, step = (int(k) for k in np.unravel_index(int(np.argmin(least)), least.shape))
    pair = " and ".join(called[k] for k in nearest_pair(flight.states[seed, :, step], zone))
    figure, ticks = sheet(8.6), _clock(flight)
    top, close = _two(figure)
    for axes in (top, close):
        dress(axes)
        zone_band(axes)
        axes.set_ylabel("minimum of all pairs [× zone]", fontsize=SMALL, color=INK)
    _all(top, ticks, flight.times, least, seed)
    top.plot(ticks(flight.times), planned, color=INK, linewidth=1.4, linestyle=DASHED)
    ratio_axis(top, float(least.min()), float(least.max()))
    time_axes([top], ticks, float(flight.times[0]), float(flight.times[-1]))
    some = _near(least, planned, step)
    fine, nearer, asked = _finely(flight, zone, some)
    _all(close, ticks, fine, nearer, seed)
    close.plot(ticks(fine), asked, color=INK, linewidth=1.4, linestyle=DASHED)
    low, high = min(float(least.min()), 1.0), _top(least, planned)
    close.set_ylim(low - SPACE * (high - low), high)
    time_axes([close], Clock(ticks.unit, None), float(fine[0]), float(fine[-1]))
    now = int(np.argmin(nearer[seed]))
    lowest = float(nearer[seed, now])
    name = f"{_which(flight, seed)}{pair}, {lowest:.4f} × zone"
    _dot(close, ticks, float(fine[now]), lowest, name, -UNDER - _line_below(close, lowest))
    _meanings(figure, flight, ("each flight", "median", f"nearest, flight {seed}", "planned"))
    entered = int((least.min(axis=1) < 1.0).sum())
    found = (
        f"{entered} of {_flights(flight)} enter a zone"
        if entered
        else f"No zone is entered in {_flights(flight)}"
    )
    plain(headline(figure, f"{found}; least {lowest:.4f} × zone flown, {asked.min():.4f} planned"))
    return figure


def flight_costs(flight: Simulation, names: Sequence[str] | None = None) -> Figure:
    """Plot the delta-v of each spacecraft in every run: plan, model compensation and feedback.

    Only the spacecraft with the largest delta-v are shown if there are many.

    Parameters
    ----------
    flight : Simulation
        Result of `simulate`.
    names : sequence of str, optional
        Names of the spacecraft; default: their indices.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If the number of names is wrong, or an argument has the wrong type.
    """
    instance("flight", flight, Simulation)
    called = short_names(names, flight.states.shape[1])
    who = np.argsort(-flight.delta_v.max(axis=0), kind="stable")[:MOST]
    who = np.sort(who)
    back = np.asarray(flight.feedback_delta_v)[:, who]
    rows = np.arange(len(who))[::-1]
    high = 0.42 * len(who) + 0.4
    figure = sheet(high + 1.4)
    wide = (WIDTH - LEFT - 0.9) / 3.0
    parts = (flight.planned_delta_v[who], flight.field_delta_v[who], back)
    for k, (part, what, tint) in enumerate(
        zip(parts, ("plan", "field", "feedback"), (BEFORE, ALTERNATIVE, AFTER), strict=True)
    ):
        axes = area(figure, LEFT + k * (wide + 0.3), 0.75, wide, high)
        dress(axes)
        unit = speed_unit(float(np.abs(part).max()))
        many = part.ndim > 1 and len(part) > 1
        middle = np.median(part, axis=0) if part.ndim > 1 else part
        axes.barh(rows, middle / unit.size, height=0.62, color=tint, alpha=0.55 if many else 0.9)
        if many:
            spread = np.linspace(-0.24, 0.24, len(part))
            for row, some in zip(rows, part.T, strict=True):
                axes.plot(some / unit.size, row + spread, ".", color=tint, markersize=3.0, alpha=0.6)
        axes.axvline(0.0, color=INK, linewidth=0.8)
        axes.set_ylim(-0.6, len(who) - 0.4)
        axes.set_yticks(rows, [called[j] for j in who] if k == 0 else [""] * len(who), fontsize=SMALL)
        for words in axes.get_yticklabels():
            plain(words)
        axes.set_xlabel(
            f"{what}{', each flight' * many} [{unit.name}]",
            fontsize=TEXT,
            color=INK,
        )
    total, planned = float(flight.delta_v.sum(axis=1).mean()), float(flight.planned_delta_v.sum())
    extra = f" ({100.0 * (total / planned - 1.0):+.2g} %)".replace("-", "−") if planned else ""
    average = f"flown{' on average' * (len(flight.states) > 1)}"
    plain(
        headline(figure, f"{speed(total)} {average}, {speed(planned)} planned{extra}, of {_flights(flight)}")
    )
    return figure


def _clock(flight: Simulation) -> Clock:
    return clock(flight.planned[0], float(flight.times[0]), float(flight.times[-1]))


def _flights(flight: Simulation) -> str:
    count = len(flight.states)
    return f"{count} flight{'s' * (count != 1)}"


def _which(flight: Simulation, seed: int) -> str:
    return f"flight {seed}: " if len(flight.states) > 1 else ""


def _all(axes: Axes, ticks: Clock, times: Floats, values: Floats, seed: int) -> None:
    """Draw every run (S, T), the median of all runs, and the worst run."""
    some = np.stack([np.broadcast_to(ticks(times), values[:DRAWN].shape), values[:DRAWN]], axis=-1)
    axes.add_collection(LineCollection(list(some), colors=PALE, linewidths=0.6, alpha=0.6))
    if len(values) > 1:
        axes.plot(ticks(times), np.median(values, axis=0), color=AFTER, linewidth=1.8)
    axes.plot(ticks(times), values[seed], color=CONFLICT, linewidth=1.4)


def _meanings(figure: Figure, flight: Simulation, words: Sequence[str]) -> None:
    """Add the legend; a single run has no median."""
    looks: list[dict[str, Any]] = [
        {"color": PALE, "linewidth": 1.2},
        {"color": AFTER, "linewidth": 1.8},
        {"color": CONFLICT, "linewidth": 1.4},
        {"color": INK, "linewidth": 1.4, "linestyle": DASHED},
    ]
    if len(flight.states) == 1:
        looks, words = looks[2:], ("the flight", *words[3:])
    legend(figure, [Line2D([], [], **look) for look in looks[: len(words)]], words, ncols=4)


def _dot(axes: Axes, ticks: Clock, time: float, height: float, words: str, away: float) -> None:
    """Mark the worst point; its label stands `away` typographic points above it."""
    axes.plot([ticks(time)], [height], "o", color=CONFLICT, markersize=7.0, zorder=5)
    first, last = axes.get_xlim()
    share = (float(ticks(time)) - first) / (last - first)
    side = "left" if share < BESIDE else "right" if share > 1.0 - BESIDE else "center"
    plain(word(axes, (float(ticks(time)), height), words, shift=(0, away), ha=side, va="baseline"))


def _line_below(axes: Axes, ratio: float) -> float:
    """Return the distance [points] down to the zone's edge if a label would overlap it, otherwise 0."""
    low, high = axes.get_ylim()
    below = (ratio - 1.0) / (high - low) * axes.get_window_extent().height * 72.0 / axes.figure.dpi
    return below if 0.0 <= below < 1.6 * UNDER else 0.0


def _two(figure: Figure) -> tuple[Axes, Axes]:
    """Add two stacked axes, each with its own time axis."""
    wide, high = (float(side) for side in figure.get_size_inches())
    tall = (high - ABOVE - 2.0) / 2.0
    below, above = 1.1, 1.1 + tall + 0.9
    made = [area(figure, LEFT, low, wide - LEFT - 0.3, tall) for low in (above, below)]
    for axes in made:
        axes.yaxis.set_label_coords(-0.72 / (wide - LEFT - 0.3), 0.5)
    return made[0], made[1]


def _top(least: Floats, planned: Floats) -> float:
    """Return the upper limit of the clearance ratio in the close-up."""
    each = least.min(axis=1)
    spread = max(float(each.max() - each.min()), 1e-3)
    return max(float(planned.min()), float(each.max())) + WIDER * spread


def _near(least: Floats, planned: Floats, step: int) -> slice:
    """Return the slice of instants around a step at which any run is below the close-up limit."""
    near = least.min(axis=0) <= _top(least, planned)
    before, after = np.flatnonzero(~near[:step]), np.flatnonzero(~near[step:])
    first = int(before[-1]) if len(before) else 0
    last = step + int(after[0]) if len(after) else len(near) - 1
    return slice(max(0, first - 1), min(len(near), last + 2))


def _finely(flight: Simulation, zone: Zone | PairZones, some: slice) -> tuple[Floats, Floats, Floats]:
    """Return times (K,) and interpolated minimum ratios of the runs (S, K) and of the plan (K,)."""
    times, step = flight.times[some], np.diff(flight.times[some])
    begin, end = flight.states[:, :, some][:, :, :-1], flight.arrivals[:, :, some][:, :, 1:]
    seeds, count, parts = begin.shape[:3]
    steps = np.broadcast_to(step, (seeds, count, parts)).reshape(-1, 1, 1)
    places = cubic(begin.reshape(-1, 6), end.reshape(-1, 6), steps)[:, :-1]
    places = places.reshape(seeds, count, -1, 3)
    fine = (times[:-1, None] + step[:, None] * np.arange(FINER) / FINER).ravel()
    least = np.stack([nearest_pairs(one, zone) for one in places])
    return fine, least, nearest_pairs(flight.planned.position(fine), zone)


def flight_paths(flight: Simulation, names: Sequence[str] | None = None) -> Figure:
    """Plot the paths of all runs and of the plan, with magnified deviations.

    Coloured lines are planned paths, pale lines are runs, red lines are the worst run. The figure states the
    magnification.

    Parameters
    ----------
    flight : Simulation
        Result of `simulate`.
    names : sequence of str, optional
        Names of the spacecraft; default: their indices.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If the number of names is wrong, or an argument has the wrong type.
    """
    instance("flight", flight, Simulation)
    count = flight.states.shape[1]
    called, tints = short_names(names, count), colours(count)
    turns = float(np.ptp(flight.times)) / flight.planned.orbit.period
    points = max(POINTS, ceil(A_TURN * turns))
    some = np.unique(np.linspace(0, len(flight.times) - 1, points).astype(int))
    planned = flight.planned.position(flight.times[some])
    drawn = min(PATHS_DRAWN, max(FEW, VERTICES // len(some)), len(flight.states))
    seeds = [*range(drawn), flight.worst]
    off = flight.states[seeds][:, :, some, :3] - planned
    most = np.ptp(planned.reshape(-1, 3), axis=0).max() or 1.0
    gain = _gain(SHARE * most, float(np.abs(off).max()))
    shown = planned + gain * off
    every = np.concatenate([planned.reshape(-1, 3), shown.reshape(-1, 3)])
    figure, unit, panels = three_planes(every, 1.2)
    across, high = figure.get_size_inches()
    for axes, _, pair in panels:
        flown = shown[..., pair] / unit.size
        for k, tint in enumerate(tints):
            pale = [*tint[:3], 0.18]
            axes.add_collection(LineCollection(list(flown[:-1, k]), colors=[pale], linewidths=0.6))
            above = 3.0 if turns > LONG else 2.0  # otherwise the runs hide it
            axes.plot(*(planned[k][:, pair].T / unit.size), color=tint, linewidth=1.8, zorder=above)
            axes.plot(*flown[-1, k].T, color=CONFLICT, linewidth=0.9)
            axes.plot(*(planned[k, -1, pair] / unit.size), "o", color=tint, markersize=5.0)
        if count <= NAMED and pair == [1, 2]:
            lines = planned[..., pair].reshape(-1, 2) / unit.size
            ends = planned[:, -1, pair] / unit.size
            Names(figure, called).beside(axes, ends, ends, lines, tints)
    handles = [
        Line2D([], [], color=INK, linewidth=1.8),
        Line2D([], [], color=INK, linewidth=0.6, alpha=0.4),
        Line2D([], [], color=CONFLICT, linewidth=0.9),
        Line2D([], [], color=INK, linestyle="", marker="o", markersize=5.0),
    ]
    why = "a pair comes nearest" if flight.ratios.size else "a craft ends farthest off"
    words = ["planned", "flown", f"flight {flight.worst}, in which {why}", "end"]
    if len(flight.states) == 1:
        handles, words = [handles[0], *handles[2:]], ["planned", "flown", "end"]
    legend(figure, handles, words, ncols=4)
    told = (
        f"Deviations are drawn {gain:g} times as large" if gain != 1.0 else "Deviations are drawn as they are"
    )
    figure.text(SIDE / across, 1.0 - 0.55 / high, told, fontsize=SMALL, color=INK)
    many = f"{len(flight.states)} flight{'s' * (len(flight.states) != 1)}"
    headline(figure, f"{many} of {count} craft, off the plan by at most {length(flight.greatest_deviation)}")
    return figure


def _gain(room: float, most: float) -> float:
    """Return the magnification of deviations: 1, 2 or 5 times a power of ten, at least 1."""
    return rounded_down(room / most) if most > 0.0 and room > most else 1.0
