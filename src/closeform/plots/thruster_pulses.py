"""Figure of thruster pulses against time."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from closeform.arrays import Floats, instance, whole
from closeform.fuel.allocation import Allocation
from closeform.fuel.chunks import thrust_in_frame
from closeform.fuel.firing import ThrusterFiring
from closeform.fuel.pulses import Pulses
from closeform.fuel.thrusters import Thrusters
from closeform.motion.path import Path
from closeform.plots.palette import AFTER, CONFLICT, DIRECTIONS, INK, OTHER
from closeform.plots.style import (
    DASHED,
    SMALL,
    Clock,
    Unit,
    clock,
    column,
    headline,
    instants,
    legend,
    length_unit,
    sheet,
    speed,
    speed_unit,
    time_axes,
)

MOST = 8  # maximum number of panels; the thrusters with the largest delta-v are kept
OPPOSITE = 1e-9  # largest component of the sum of two opposite directions
IDLE = 1e-6  # of the largest delta-v of a thruster; smaller values count as zero


def pulses(firing: ThrusterFiring, craft: int = 0, name: str | None = None) -> Figure:
    """Plot the pulses of each thruster of a spacecraft against time, over the planned thrust.

    Each pulse is a bar with its duration as width and its delta-v as height. The shaded area is the planned
    thrust multiplied by the period, which is the delta-v of one cycle. Two opposite thrusters share a panel,
    with the second one downwards. Thrusters along no axis are labelled by number, from 1. Rings mark planned
    impulses, and omitted pulses are marked at their time.

    Parameters
    ----------
    firing : ThrusterFiring
        Result of `fire_thrusters`.
    craft : int, default 0
        Index of the spacecraft.
    name : str, optional
        Name of the spacecraft; default: its index if there are several.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If there is no such spacecraft, or an argument has the wrong type.
    """
    instance("firing", firing, ThrusterFiring)
    if name is not None:
        instance("name", name, str)
    count = len(firing.thrusters)
    if whole("craft", craft) >= count:
        raise ValueError(f"craft: from 0 to {count - 1}, got {craft}")
    plan = firing.planned[craft] if firing.planned.shape else firing.planned
    thrusters = firing.thrusters[craft]
    fired = firing.pulses[firing.pulses.craft == craft]
    dropped = firing.dropped[firing.dropped.craft == craft]
    times, wanted = _wanted(plan, thrusters)
    rows = _rows(thrusters, fired, dropped, wanted)
    greatest = float(max(fired.impulse.max(initial=0.0), wanted.max(initial=0.0)))
    unit, ticks = speed_unit(greatest or 1.0), clock(plan, plan.start, plan.end)
    figure = sheet(2.3 + 1.9 * len(rows))
    panels = column(figure, [1.0] * len(rows), 1.05)
    for axes, (one, other) in zip(panels, rows, strict=True):
        label, colour = _name(thrusters, one, other)
        reach = [0.0, 0.0]
        for side, (thruster, sign) in enumerate(((one, 1.0), (other, -1.0))):
            if thruster < 0:
                continue
            own, lost = fired[fired.thruster == thruster], dropped[dropped.thruster == thruster]
            asked, bit = wanted[:, thruster], float(thrusters.minimum_bit[thruster])
            axes.fill_between(
                ticks(times), 0.0, sign * asked / unit.size, color=OTHER, alpha=0.45, linewidth=0
            )
            _bars(axes, own, sign, ticks, unit, colour)
            _lost(axes, lost, sign, ticks, unit)
            _rings(axes, plan, thrusters, thruster, sign, ticks, unit)
            if bit > 0.0 and len(own) + len(lost):
                axes.axhline(sign * bit / unit.size, color=INK, linewidth=0.9, linestyle=DASHED)
            every = asked.max(), own.impulse.max(initial=0.0), lost.impulse.max(initial=0.0)
            reach[side] = max(*every, bit * (len(own) + len(lost) > 0))
        axes.axhline(0.0, color=INK, linewidth=0.8)
        least = 0.12 * max(reach) or 1e-3 * (greatest or unit.size)
        low = max(reach[1], least) if other >= 0 else 0.0
        axes.set_ylim(-1.12 * low / unit.size, 1.12 * max(reach[0], least) / unit.size)
        axes.set_ylabel(f"{label} [{unit.name}]", fontsize=SMALL, color=colour)
    time_axes(panels, ticks, plan.start, plan.end)
    tints = list(dict.fromkeys(_name(thrusters, *row)[1] for row in rows))
    _explained(figure, thrusters, len(dropped) > 0, plan, tints)
    headline(figure, _said(firing, craft, fired, dropped, name))
    return figure


def _rows(thrusters: Thrusters, fired: Pulses, dropped: Pulses, wanted: Floats) -> list[tuple[int, int]]:
    """Return the used thrusters, each with its opposite thruster or -1; at most MOST, by delta-v."""
    sums = np.abs(thrusters.directions[:, None] + thrusters.directions).max(axis=2) < OPPOSITE
    found: list[tuple[int, int]] = []
    for one, against in enumerate(sums):
        other = int(against.argmax()) if against.any() else -1
        if other < 0 or one < other:
            found.append((one, other))
    given = np.bincount(fired.thruster, fired.impulse, len(thrusters) + 1)
    asked = np.append(wanted.max(axis=0, initial=0.0), 0.0)
    asked += given + np.bincount(dropped.thruster, dropped.impulse, len(thrusters) + 1)
    used = [row for row in found if max(asked[list(row)]) > IDLE * asked.max()]
    most = sorted(used or found, key=lambda row: -given[row[0]] - given[row[1]])[:MOST]
    return sorted(most)


def _wanted(plan: Path, thrusters: Thrusters) -> tuple[Floats, Floats]:
    """Return the planned delta-v of each thruster per period: times (K,) [s] and delta-v (K, m) [m/s]."""
    times = instants(plan.start, plan.end, plan)
    wanted = np.zeros((len(times), len(thrusters)))
    peak = plan.peak_thrust
    if thrusters.period is not None and peak > 0.0:
        thrust = thrust_in_frame(plan, thrusters, times)
        allocation = Allocation.of(thrusters.directions)
        facets = allocation.facets(thrust, 1e-9 * peak)
        sizes, corners = allocation.amounts(facets, thrust), allocation.corners[facets]
        every = np.zeros((len(times), len(thrusters) + 6))
        np.put_along_axis(every, corners, np.maximum(sizes, 0.0), axis=1)
        wanted = thrusters.period * every[:, : len(thrusters)]
    return times, wanted


def _name(thrusters: Thrusters, one: int, other: int) -> tuple[str, str]:
    """Return the label and the colour of a panel."""
    axis = int(np.abs(thrusters.directions[one]).argmax())
    if thrusters.directions[one, axis] > 1.0 - OPPOSITE:
        direction = DIRECTIONS[axis]
        return direction.name if thrusters.frame == "orbit" else f"inertial {'xyz'[axis]}", direction.colour
    return f"thruster {one + 1}" if other < 0 else f"{one + 1} up, {other + 1} down", AFTER


def _bars(axes: Axes, own: Pulses, sign: float, ticks: Clock, unit: Unit, colour: str) -> None:
    """Draw pulses as bars as wide as their durations, with a line in each to keep short ones visible."""
    height = sign * own.impulse / unit.size
    begin, over = ticks(own.start), ticks(own.start + own.duration)
    axes.bar(begin, height, over - begin, align="edge", color=colour, linewidth=0, alpha=0.9)
    middle = 0.5 * (begin + over)
    lines = [((x, 0.0), (x, y)) for x, y in zip(middle.tolist(), height.tolist(), strict=True)]
    axes.add_collection(LineCollection(lines, colors=colour, linewidths=0.9 if len(own) < 150 else 0.5))


def _lost(axes: Axes, lost: Pulses, sign: float, ticks: Clock, unit: Unit) -> None:
    """Draw omitted pulses over their durations."""
    for start, length, impulse in zip(lost.start, lost.duration, lost.impulse, strict=True):
        span = [float(ticks(start)), float(ticks(start + length))]
        axes.fill_between(span, 0.0, sign * impulse / unit.size, color=CONFLICT, alpha=0.35, linewidth=0)
        axes.plot(span, [0.0, 0.0], color=CONFLICT, linewidth=3.5, solid_capstyle="butt")


def _rings(
    axes: Axes, plan: Path, thrusters: Thrusters, thruster: int, sign: float, ticks: Clock, unit: Unit
) -> None:
    """Draw planned impulses as rings."""
    for time, jump in plan.impulses:
        along = float(thrusters.directions_at(plan.orbit, time)[thruster] @ jump) / unit.size
        if along > 0.0:
            axes.plot(ticks(time), sign * along, "o", markersize=8, markerfacecolor="none", color=INK)


def _explained(figure: Figure, thrusters: Thrusters, dropped: bool, plan: Path, tints: list[str]) -> None:
    """Add the legend, with a pulse in the colour of each panel."""
    handles: list[Any] = [tuple(Patch(color=tint, alpha=0.9, linewidth=0) for tint in tints)]
    words = ["a pulse: as high as its Δv, as wide as it is long"]
    if thrusters.period is not None and plan.peak_thrust > 0.0:
        handles.append(Patch(color=OTHER, alpha=0.45))
        words.append(f"planned thrust, times the period of {thrusters.period:g} s")
    if thrusters.minimum_bit.any():
        handles.append(Line2D([], [], color=INK, linewidth=0.9, linestyle=DASHED))
        words.append("minimum impulse bit")
    if dropped:
        handles.append(Patch(color=CONFLICT, alpha=0.5))
        words.append("dropped, over its time")
    if plan.impulses:
        handles.append(Line2D([], [], marker="o", linestyle="", markerfacecolor="none", color=INK))
        words.append("planned impulse, along the thruster")
    each: dict[Any, Any] = {tuple: HandlerTuple(ndivide=None, pad=0.3)}
    legend(figure, handles, words, ncols=2, columnspacing=2.0, handlelength=2.2, handler_map=each)


def _said(firing: ThrusterFiring, craft: int, fired: Pulses, dropped: Pulses, name: str | None) -> str:
    """Return the headline: number of pulses, delta-v, propellant and deviation from the plan."""
    many, called = len(firing.thrusters) > 1 or name is not None, f"Craft {craft}" if name is None else name
    if not len(fired):
        return f"{f'{called} has' if many else 'There is'} nothing to fire"
    off, bound = np.ravel(firing.deviation)[craft], np.ravel(firing.deviation_bound)[craft]
    unit = length_unit(bound)
    number = f"{len(fired)} pulse{'s' * (len(fired) != 1)}"
    planned = float(np.ravel(firing.planned.delta_v)[craft])
    words = f"{f'{called}: ' if many else ''}{number}, Δv {speed(fired.impulse.sum())}"
    words += f" fired for {speed(planned)} planned"
    burned = fired.propellant.sum()
    if np.isfinite(burned):
        words += f", {1e3 * burned:.3g} g" if burned < 1.0 else f", {burned:.4g} kg"
    words += f"; {off / unit.size:.3g} {unit.name} from the plan, at most {bound / unit.size:.3g} {unit.name}"
    return words + (f"; {speed(dropped.impulse.sum())} dropped" if len(dropped) else "")
