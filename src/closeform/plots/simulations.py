"""Simulations in the high-fidelity model: deviations and clearance ratios of all runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from closeform.arrays import Floats, instance
from closeform.dynamics.clearance import ratios_at_times
from closeform.dynamics.control.tracking_tube import Tube
from closeform.dynamics.simulation.simulation_result import Simulation
from closeform.plots.drawing import style, units
from closeform.plots.drawing.charts import PALE, Curve, Panel, draw, series
from closeform.plots.drawing.inputs import picture
from closeform.plots.drawing.palette import AFTER, CONFLICT, INK, ZONE
from closeform.plots.drawing.text import short_names
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone

DRAWN = 300  # maximum number of runs that are drawn, besides the worst
CLOSE_UP = 0.012  # of the duration: half the width of the close-up


@picture()
def flight_deviations(
    flight: Simulation, tube: Tube | None = None, names: Sequence[str] | None = None
) -> Figure:
    """Plot the largest deviation from the plan against time, for every simulation run, with the tube.

    Each pale line is the largest deviation of any spacecraft in one run. The blue line is the median of all
    runs; the red line is the run with the largest deviation.
    """
    called = short_names(names, flight.states.shape[1])
    off, worst = flight.deviations.max(axis=1), int(np.argmax(flight.deviations))
    run, craft, step = (int(k) for k in np.unravel_index(worst, flight.deviations.shape))
    radius, share = 0.0, ""
    if tube is not None:
        lasts = float(flight.times[-1] - flight.times[0])
        radius = float(np.max(tube.containment(lasts, craft=flight.states.shape[1])))
        share = f"; predicted: {100.0 * tube.probability:.3f} % of runs within {units.length(radius)}"
    unit = units.length_unit(max(float(off.max()), radius))
    dot = (float(flight.times[step]), off[run, step] / unit.size)
    words = ("each run: largest of all craft", "median", f"largest deviation, run {run}")
    curves = runs(flight, flight.times, off / unit.size, run, words, dot, called[craft])
    if tube is not None:
        flat = np.full(2, radius / unit.size)
        curves.append(Curve(flight.times[[0, -1]], flat, "tracking-error tube", ZONE, style.DASHED))
    most = f"Deviation at most {units.length(float(off.max()))} in {units.plural(len(off), 'run')}"
    panel = Panel(f"deviation from the plan [{unit.name}]", curves)
    start, end = flight.times[[0, -1]].tolist()
    return series(most + share, [panel], clock_of(flight), start, end, height=5.8)


@picture("there are fewer than two spacecraft, or no pair has a zone")
def flight_ratios(flight: Simulation, zone: Zone | PairZones, names: Sequence[str] | None = None) -> Figure:
    """Plot the minimum clearance ratio of all pairs against time, for every run, with a close-up.

    Each pale line is the minimum of all pairs in one run; the dashed line is that of the plan. The blue line
    is the median of all runs; the red line is the run with the closest approach. A ratio below 1 is a
    conflict.

    Parameters
    ----------
    zone : Zone or PairZones
        One zone for all pairs, or one for each.
    """
    instance("zone", zone, Zone, PairZones)
    count = flight.states.shape[1]
    called = short_names(names, count)
    if count < 2:
        raise ValueError("flight: has one spacecraft and so no pair; give a simulation of two or more")
    every = (*flight.states, flight.planned.state(flight.times))
    *flown, planned = (ratios_at_times(one, zone)[1].min(axis=0, initial=np.inf) for one in every)
    least = np.stack(flown)
    if not np.isfinite(least).any():
        raise ValueError("zone: no pair has a zone; give one")
    run, step = (int(k) for k in np.unravel_index(int(np.argmin(least)), least.shape))
    pairs, ratios = ratios_at_times(flight.states[run, :, step : step + 1], zone)
    pair = " and ".join(called[k] for k in pairs[int(np.argmin(ratios))])
    dot = (float(flight.times[step]), float(least[run, step]))
    words = ("each run", "median", f"closest approach, run {run}")
    curves = runs(flight, flight.times, least, run, words, dot, f"{pair}, {dot[1]:.4f} × zone")
    curves.append(Curve(flight.times, planned, "plan", INK, style.DASHED, 1.4))

    ticks, (start, end) = clock_of(flight), flight.times[[0, -1]].tolist()
    figure, handles, legends = style.sheet(8.6), list[Any](), list[str]()
    above, below = figure.subplots(2, 1)
    for axes in (above, below):
        style.dress(axes)
    near = np.abs(flight.times - dot[0]) <= CLOSE_UP * (end - start)
    near[max(0, step - 2) : step + 3] = True
    close = [
        Curve(flight.times[near], one.values[..., near], "", one.colour, one.dashes, one.width, one.dot)
        for one in curves
    ]
    top = max(float(planned[near].max()), float(np.median(least[:, near], axis=0).max()))
    room = 0.15 * (top - dot[1]) or 0.05
    draw(above, Panel("minimum of all pairs [× zone]", curves, 1.0, scale="ratio"), ticks, handles, legends)
    draw(below, Panel("close-up [× zone]", close, 1.0, ""), ticks, [], [])
    below.set_ylim(dot[1] - room, top + room)
    style.time_axes([above], ticks, start, end)
    style.time_axes([below], units.Clock(ticks.unit), *flight.times[near][[0, -1]].tolist())
    style.legend(figure, handles, legends)
    entered = int(
        (flight.ratios.min(axis=1) < 1.0).sum() if flight.ratios.size else (least.min(axis=1) < 1.0).sum()
    )
    runs_in = units.plural(len(least), "run")
    found = f"Conflicts in {entered} of {runs_in}" if entered else f"No conflict in {runs_in}"
    style.headline(figure, f"{found}; minimum {dot[1]:.4f} × zone simulated, {planned.min():.4f} planned")
    return figure


def runs(
    flight: Simulation, times: Floats, values: Floats, worst: int, words: Sequence[str], dot: Any, name: str
) -> list[Curve]:
    """Return the curves of all runs (S, T), of their median, and of the worst run."""
    if len(values) == 1:
        return [Curve(times, values[0], "simulated", CONFLICT, width=1.4, dot=dot, name=name)]
    return [
        Curve(times, values[:DRAWN], words[0], PALE, width=0.6),
        Curve(times, np.median(values, axis=0), words[1], AFTER, width=1.8),
        Curve(times, values[worst], words[2], CONFLICT, width=1.4, dot=dot, name=name),
    ]


def clock_of(flight: Simulation) -> units.Clock:
    """Return the time axis of a simulation."""
    return units.clock(flight.planned[0], float(flight.times[0]), float(flight.times[-1]))
