"""Paths as flown about the paths as planned, with deviations so many times as large that they are seen."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from closeform.arrays import instance
from closeform.dynamics.simulation_result import Simulation
from closeform.plots.fleet import SIDE, three_planes
from closeform.plots.fonts import short_names
from closeform.plots.label_placement import Names
from closeform.plots.palette import CONFLICT, INK, colours
from closeform.plots.style import SMALL, headline, legend, length, rounded_down

DRAWN, FEW = 60, 4  # flights beside the worst at most, the first ones, and of long ones
POINTS, A_TURN = 240, 48  # of each line, at least, and for each orbit
LONG = 5  # orbits
VERTICES = 30_000  # of all flights of one craft, beyond which fewer are drawn
SHARE = 0.06  # of what is shown, that the greatest deviation may take
NAMED = 12  # craft up to which each has its name


def flight_paths(flight: Simulation, names: Sequence[str] | None = None) -> Figure:
    """The paths of all flights about those of the plan, with deviations drawn many times as large.

    Lines in the colours of the craft are planned, pale ones flown, red ones those of the worst flight; the
    picture says how many times as large deviations are.

    Parameters
    ----------
    flight : Simulation
        What `fly` answered.
    names : sequence of str, optional
        Of the craft; their indices unless given.

    Returns
    -------
    Figure
        Of matplotlib; save it with its `savefig`.

    Raises
    ------
    ValueError
        If names are not as many as craft, or an argument is of another kind.
    """
    instance("flight", flight, Simulation)
    count = flight.states.shape[1]
    called, tints = short_names(names, count), colours(count)
    turns = float(np.ptp(flight.times)) / flight.planned.orbit.period
    points = max(POINTS, ceil(A_TURN * turns))
    some = np.unique(np.linspace(0, len(flight.times) - 1, points).astype(int))
    planned = flight.planned.position(flight.times[some])
    drawn = min(DRAWN, max(FEW, VERTICES // len(some)), len(flight.states))
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
            above = 3.0 if turns > LONG else 2.0  # flights would hide it
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
    """By how much deviations are enlarged: 1, 2 or 5 times a power of ten, and 1 at least."""
    return rounded_down(room / most) if most > 0.0 and room > most else 1.0
