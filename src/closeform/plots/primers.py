"""Why impulses are the least, and what time is worth: a primer's length, and delta-v against duration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from closeform.arrays import instance
from closeform.fuel.arrivals import Arrivals
from closeform.fuel.bound import least_delta_v
from closeform.motion.path import Path, ends_of
from closeform.plots.given import crafts, one_craft
from closeform.plots.look import (
    AFTER,
    BEFORE,
    DASHED,
    INK,
    SMALL,
    TEXT,
    ZONE,
    clock,
    column,
    dress,
    headline,
    instants,
    plain_unit,
    sheet,
    speed,
    speed_unit,
    time_axes,
)

LETTERED = 12  # impulses or slots that are labelled
SMALLEST = 0.02  # of the largest impulse: smaller ones are not labelled
BESIDE = 0.12  # of the duration: labels nearer than that stand above each other


def primer(path: Path) -> Figure:
    """The length of the primer of a path's ends against time: 1 where impulses pay, nowhere more.

    Dots mark the path's impulses with their sizes, at what each metre per second of them is worth: p . v/|v|.
    On the least plan all stand at 1, on another path those below are wasted by as much.

    Parameters
    ----------
    path : Path
        Of one craft, over at most 100 orbits: of `Orbit.impulsive`, or any other between its ends.

    Returns
    -------
    Figure
        Of matplotlib; save it with its `savefig`.

    Raises
    ------
    ValueError
        If the path is a batch, takes too long, or is no path.
    """
    one_craft("path", path)
    start, end = path.start, path.end
    pushes = path.impulses
    bound = least_delta_v(path.orbit, *ends_of(path), end - start)
    times, ticks = instants(start, end, path), clock(path, start, end)
    lengths = np.linalg.norm(bound.primer.position(times - start), axis=-1)

    figure = sheet(4.6)
    (axes,) = column(figure, [1.0])
    dress(axes)
    axes.axhline(1.0, color=ZONE, linewidth=1.6)
    axes.plot(ticks(times), lengths, color=AFTER, linewidth=2.0)
    lowest, last, row = 0.0, -np.inf, 0
    sizes = np.array([float(np.linalg.norm(push)) for _, push in pushes])
    named = sizes >= SMALLEST * sizes.max(initial=0.0)
    named &= np.cumsum(named) <= LETTERED
    for k, (time, push) in enumerate(pushes):
        size = float(np.linalg.norm(push))
        height = float(bound.primer.position(time - start) @ push) / size
        lowest = min(lowest, height)
        axes.plot(ticks(time), height, "o", color=INK, markersize=7, zorder=5)
        if named[k]:
            late = time > start + 0.85 * (end - start)  # its words stand before it, where those of others end
            row = (row + 1) % 3 if time - last < BESIDE * (1.0 + late) * (end - start) else 0
            last = time
            axes.annotate(
                speed(size),
                (ticks(time), 1.0),
                (-7 if late else 7, 9 + 13 * row),
                textcoords="offset points",
                ha="right" if late else "left",
                fontsize=SMALL,
                color=INK,
            )
    axes.set_ylim(1.1 * lowest, 1.35)
    axes.set_ylabel("length of the primer", fontsize=TEXT, color=INK)
    time_axes([axes], ticks, start, end)
    least = "the least there is" if bound.proven else f"at least {speed(float(bound.lower))}"
    spent = float(path.delta_v)
    if spent > float(bound.upper) * (1.0 + 1e-6):
        least = f"{100 * (spent / float(bound.lower) - 1):.3g} % above the least, {speed(float(bound.lower))}"
    headline(figure, f"{speed(spent)} with {len(pushes)} impulse{'s' * (len(pushes) != 1)}: {least}")
    return figure


def trade(found: Arrivals, plan: Path | Sequence[Path] | None = None) -> Figure:
    """Delta-v against duration, to the cheapest slot in each: what time is worth.

    The dashed line is the least of all; where the cheapest slot changes seldom, labels name it.

    Parameters
    ----------
    found : Arrivals
        Of `arrivals`.
    plan : Path or sequence of Path, optional
        What a ring is drawn for: a plan by its duration and its delta-v, of several craft by the sum.

    Returns
    -------
    Figure
        Of matplotlib; save it with its `savefig`.

    Raises
    ------
    ValueError
        If there is no duration, or `found` is no `Arrivals`.
    """
    instance("found", found, Arrivals)
    if not len(found.duration):
        raise ValueError("found: has no duration; give arrivals one at least")
    order = np.argsort(found.duration)
    durations, costs, slots = found.duration[order], found.delta_v[order], found.slot[order]
    across, up = plain_unit(float(durations[-1])), speed_unit(float(costs[-1]))

    figure = sheet(4.6)
    (axes,) = column(figure, [1.0])
    dress(axes)
    axes.axhline(costs.min() / up.size, color=BEFORE, linestyle=DASHED, linewidth=1.2)
    axes.plot(durations / across.size, costs / up.size, "o-", color=AFTER, linewidth=1.6, markersize=4)
    axes.set_yscale("log" if costs.min() > 0.0 and costs.max() > 30.0 * costs.min() else "linear")
    changes = np.flatnonzero(np.diff(slots, prepend=slots[0] - 1))
    told = len(changes) <= LETTERED and (len(changes) > 1 or plan is None)
    for k in changes if told else ():
        axes.annotate(
            f"slot {slots[k]}",
            (durations[k] / across.size, costs[k] / up.size),
            (4, 6),
            textcoords="offset points",
            fontsize=SMALL,
            color=INK,
        )
    if plan is not None:
        flown = crafts("plan", plan)
        lasts, spent = max(one.end - one.start for one in flown), sum(one.delta_v for one in flown)
        axes.plot(lasts / across.size, spent / up.size, "o", markersize=10, markerfacecolor="none", color=INK)
        look: dict[str, Any] = {"textcoords": "offset points", "fontsize": SMALL, "color": INK}
        axes.annotate("this plan", (lasts / across.size, spent / up.size), (8, 6), **look)
    axes.set_xlabel(f"duration [{across.name}]", fontsize=TEXT, color=INK)
    axes.set_ylabel(f"least delta-v [{up.name}]", fontsize=TEXT, color=INK)
    first, last = (speed(float(cost)) for cost in (costs[0], costs[-1]))
    ends = (f"{duration / across.size:.4g} {across.name}" for duration in (durations[0], durations[-1]))
    short, long = ends
    headline(figure, f"{first} in {short}, {last} in {long}")
    return figure
