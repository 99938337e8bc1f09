"""Thrust and speed with their limits, burns and thruster pulses against time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, numbers, shown, whole
from closeform.fuel.allocation import Allocation
from closeform.fuel.burns import Burns, burns_of, burns_of_pulses
from closeform.fuel.chunks import thrust_in_frame
from closeform.fuel.firing import ThrusterFiring
from closeform.fuel.pulses import Pulses
from closeform.fuel.thrusters import Thrusters
from closeform.motion.path import Path
from closeform.planning.requirements import SpeedLimit
from closeform.plots.drawing import style, units
from closeform.plots.drawing.charts import DASHES, Curve, Panel, name_rows, series
from closeform.plots.drawing.inputs import crafts, picture, texts
from closeform.plots.drawing.palette import (
    AFTER,
    ALTERNATIVE,
    BEFORE,
    DIRECTIONS,
    FAINT,
    INK,
    OTHER,
    ZONE,
    colours,
)
from closeform.plots.drawing.text import NEAR, SMALL, label, short_names, word

FEW = 12  # maximum number of spacecraft in the legend
FAR = 3.0  # times the maximum: a limit above that would flatten all curves
ROUNDING = 1e-9  # of a limit
LINES = ((AFTER, "-"), (BEFORE, style.DASHED), (ALTERNATIVE, style.DOTTED))  # last path first
NARROWEST = 1.0 / 400.0  # of the time axis: minimum width of a burn
LABELLED = 8  # maximum number of larger burns in a row with labels
SMALLEST = 0.1  # of the largest burn: smaller burns have no label
HIGH = 0.8  # of the row height: the largest burn
MOST_ROWS = 60
MOST = 8  # maximum number of panels; the thrusters with the largest delta-v are kept
OPPOSITE = 1e-9  # largest component of the sum of two opposite directions
IDLE = 1e-6  # of the largest delta-v of a thruster; smaller values count as zero


@picture(
    "there are more than three paths or none, the number of labels is wrong, or `mass` is not positive "
    "and finite"
)
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
    """
    if mass is not None and not 0.0 < number("mass", mass) < np.inf:
        raise ValueError(f"mass: must be positive and finite [kg], got {mass!r:.60}")
    single_paths = crafts("paths", paths)
    if not 1 <= len(single_paths) <= len(LINES):
        raise ValueError(f"paths: give one to {len(LINES)}, got {len(single_paths)}")
    labels = texts("labels", labels, len(single_paths), "paths")
    start, end = min(path.start for path in single_paths), max(path.end for path in single_paths)
    ticks = units.clock(single_paths[0], start, end)
    force, basic = (1.0, "m/s²") if mass is None else (mass, "N")
    unit = units.thrust_unit(force * max(path.peak_thrust for path in single_paths), basic)
    greatest = max(
        (float(np.linalg.norm(jump)) for path in single_paths for _, jump in path.impulses), default=0.0
    )

    spent = units.speed_unit(max(path.delta_v for path in single_paths))
    names = [("magnitude", INK), *((d.name, d.colour) for d in DIRECTIONS)]
    curves: list[list[Curve]] = [[] for _ in names]
    looks = LINES[len(single_paths) - 1 :: -1]
    for path, (colour, dashes), name in zip(single_paths, looks, labels, strict=True):
        times = units.instants(path.start, path.end, path)
        push = force * path.thrust(times) / unit.size
        energy = f", energy {path.energy:.4g} m²/s³" if np.isfinite(path.energy) else ""
        words = f"{name}: Δv {spent.text(path.delta_v)}{energy}"
        for own, values in zip(curves, [np.linalg.norm(push, axis=1), *push.T], strict=True):
            own.append(Curve(times, values, "" if own is not curves[0] else words, colour, dashes, 2.2))
    panels = [Panel(f"{name} [{unit.name}]", own) for (name, _), own in zip(names, curves, strict=True)]
    costs = [f"{name} {units.speed(one.delta_v)}" for name, one in zip(labels, single_paths, strict=True)]
    figure = series(f"Delta-v: {', '.join(costs)}", panels, ticks, start, end, height=9.0)
    for axes, (_, colour) in zip(figure.axes, names, strict=True):
        axes.yaxis.label.set(fontsize=SMALL, color=colour)
        axes.axhline(0, color=INK, linewidth=0.8)
        level(axes, max(np.abs(axes.get_ylim())), axes is figure.axes[0])
    if greatest > 0:
        stems(figure.axes[:4], single_paths, ticks, greatest)
    return figure


def level(axes: Axes, top: float, positive: bool) -> None:
    """Set the range from zero, or symmetric about zero for signed values."""
    axes.set_ylim(0 if positive else -top, top)


def stems(panels: list[Axes], single_paths: list[Path], ticks: units.Clock, greatest: float) -> None:
    """Draw impulses on a right axis whose zero coincides with that of the thrust."""
    unit = units.speed_unit(greatest)
    for row, axes in enumerate(panels):
        right = style.right_axis(axes, f"impulse [{unit.name}]", INK)
        level(right, 1.15 * greatest / unit.size, row == 0)
        for path, (colour, dashes) in zip(single_paths, LINES[len(single_paths) - 1 :: -1], strict=True):
            for time, jump in path.impulses:
                height = float(np.linalg.norm(jump) if row == 0 else jump[row - 1]) / unit.size
                at = float(ticks(time))
                right.plot([at, at], [0.0, height], color=colour, linestyle=dashes, linewidth=2)
                right.plot(at, height, "o", color=colour, markersize=7, clip_on=False)
        right.spines["right"].set(visible=True, color=OTHER)


@picture("the number of limits, masses or on_off is wrong, or masses are not positive")
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
    limits : array_like of shape (N,) [m/s^2], optional
        Maximum thrust accelerations, drawn as dashed lines; nan or inf for no limit.
    masses : array_like of shape (N,) [kg], optional
        Masses of the spacecraft; if given, thrust is shown in newtons instead of m/s^2.
    on_off : array_like of bool of shape () or (N,), default False
        True for spacecraft whose limit is the thrust of one on-off thruster.
    """
    single_paths = crafts("paths", paths)
    called, count = short_names(names, len(single_paths)), len(single_paths)
    kilograms = np.ones(count) if masses is None else vector("masses", masses, count)
    if not (kilograms > 0.0).all():
        raise ValueError("masses: must be positive")
    most = np.full(count, np.nan) if limits is None else vector("limits", limits, count)
    pulsed = np.asarray(on_off)
    if pulsed.dtype != bool or pulsed.shape not in ((), (count,)):
        raise ValueError(
            f"on_off: expected True or False, or one for each of {count} craft, got {shown(on_off)}"
        )
    pulsed = np.broadcast_to(pulsed, count)
    peaks, most = np.array([path.peak_thrust for path in single_paths]) * kilograms, most * kilograms
    known, basic = np.isfinite(most), "m/s²" if masses is None else "N"
    unit = units.thrust_unit(float(peaks.max() or most[known].max(initial=0.0)), basic)
    start, end = min(path.start for path in single_paths), max(path.end for path in single_paths)

    tints, few, curves = colours(count), 1 < count <= FEW, list[Curve]()
    for k, path in enumerate(single_paths):
        times = units.instants(path.start, path.end, path)
        push = np.linalg.norm(path.thrust(times), axis=1) * kilograms[k] / unit.size
        dashes = DASHES[1 + (k - 1) % 3 if k else 0]  # a curve on top of an equal one shows both
        curves.append(Curve(times, push, called[k] if few else "", tints[k], dashes, 2.0 if few else 1.0))
    limit = most[known].max(initial=0.0)
    panel = Panel(f"{'planned ' if pulsed.any() else ''}thrust [{unit.name}]", curves)
    said, ticks = thrust_verdict(called, peaks, most, pulsed, basic), units.clock(single_paths[0], start, end)
    figure = series(said, [panel], ticks, start, end)
    if known.any():
        what = "thrust of one thruster" if pulsed[known].all() else "limit"
        limited(figure.axes[0], most / unit.size, tints, what, units.thrust_unit(limit, basic).text(limit))
    return figure


def limited(axes: Axes, limits: Floats, tints: Any, what: str, highest: str) -> None:
    """Draw dashed lines at limits (N,), nan or inf for none; only mention limits far above all curves."""
    top, known = axes.get_ylim()[1] / 1.08, limits[np.isfinite(limits)]
    alike = np.ptp(known) <= ROUNDING * known.max()
    words = f"{what} {highest}" if alike else f"dashed: {what} of each, up to {highest}"
    near = known.min() <= FAR * top
    if near:
        axes.set_ylim(0.0, 1.15 * max(top, known[known <= FAR * top].max()))
        for limit, tint in zip(limits, tints, strict=True):
            if limit <= FAR * top:
                axes.axhline(limit, color=INK if alike else tint, linewidth=1.2, linestyle=style.DASHED)
    place: dict[str, Any] = {"xycoords": "axes fraction", "ha": "right", "va": "top", "shift": (0, -4)}
    word(axes, (0.995, 1.0), words if near else f"{words}, far above", **place)


def thrust_verdict(called: list[str], peaks: Floats, limits: Floats, pulsed: Any, basic: str) -> str:
    """Return the headline: the largest thrust, and how it compares with the limits."""
    k = int(peaks.argmax())
    if not peaks[k] > 0.0:
        return "No spacecraft thrusts"
    most = units.thrust_unit(peaks[k], basic).text(peaks[k])
    if pulsed[k] and np.isfinite(limits[k]):
        own = units.thrust_unit(limits[k], basic).text(limits[k])
        return f"{called[k]} has the largest planned thrust, {most}; its thrusters have {own} each, on or off"
    said = f"{called[k]} has the largest thrust: {most}"
    if not np.isfinite(limits).any():
        return said
    over = int((peaks > limits * (1.0 + ROUNDING)).sum())
    return (
        f"{said}; {f'{over} of {len(peaks)} craft above their limit' if over else 'all within their limits'}"
    )


@picture()
def speed(path: Path, limit: SpeedLimit) -> Figure:
    """Plot the speed of a path in the rotating frame against time, with its limit.

    The range above the limit is shaded. A limit that rises with the distance is shown at the place of the
    spacecraft. A dot marks the smallest margin.
    """
    times = units.instants(path.start, path.end, path)
    states, during = path.state(times), (times >= limit.start) & (times <= limit.end)
    speeds, margins = np.linalg.norm(states[:, 3:], axis=1), limit.margin(states)
    allowed = np.where(during, speeds + margins, np.nan)
    unit = units.speed_unit(float(np.nanmax([speeds, allowed])))
    ticks, dot, said = units.clock(path, path.start, path.end), None, "The speed limit does not apply"
    if during.any():
        k = int(np.argmin(np.where(during, margins, np.inf)))
        dot = float(times[k]), float(speeds[k]) / unit.size
        margin = f"{units.speed(abs(margins[k]))} {'below' if margins[k] >= 0.0 else 'above'} the limit"
        kept = "Speed limit kept" if limit.holds(path) else "Speed limit not kept"
        said = f"{kept}: {margin} at {ticks.text(dot[0])}"
    curves = [Curve(times, allowed / unit.size, "limit", ZONE, width=1.6)]
    curves.append(Curve(times, speeds / unit.size, "speed", dot=dot))
    panel = Panel(f"speed [{unit.name}]", curves)
    figure = series(said, [panel], ticks, path.start, path.end)
    axes, top = figure.axes[0], figure.axes[0].get_ylim()[1]
    axes.fill_between(ticks(times), allowed / unit.size, top, color=ZONE, alpha=0.2, linewidth=0)
    return figure


def vector(name: str, given: ArrayLike, count: int) -> Floats:
    """Return an argument as one number per spacecraft, or raise ValueError."""
    values = numbers(name, given)
    if values.shape != (count,):
        raise ValueError(f"{name}: expected shape ({count},), got {values.shape}")
    return values


@picture("there are more than 60 paths")
def burns(paths: Path | Sequence[Path] | ThrusterFiring, names: Sequence[str] | None = None) -> Figure:
    """Plot the burns of each spacecraft: a row per spacecraft, a bar per burn, scaled to its delta-v.

    An impulse or a thruster pulse is a thin bar. Continuous thrust from one coast to the next is one bar of
    that length.

    Parameters
    ----------
    paths : Path, sequence of Path, or ThrusterFiring
        Path of shape (N,), up to 60 paths, or a `ThrusterFiring`, whose pulses are shown.
    """
    firing = paths if isinstance(paths, ThrusterFiring) else None
    single_paths = crafts("paths", paths.path if isinstance(paths, ThrusterFiring) else paths)
    if len(single_paths) > MOST_ROWS:
        raise ValueError(
            f"paths: at most {MOST_ROWS} can be shown, got {len(single_paths)}; select some of them"
        )
    called, count = short_names(names, len(single_paths)), len(single_paths)
    if firing is not None:
        every = [burns_of_pulses(firing.pulses, k) for k in range(count)]
    else:
        every = [burns_of(path).significant for path in single_paths]
    start, end = min(path.start for path in single_paths), max(path.end for path in single_paths)
    ticks, room = units.clock(single_paths[0], start, end), 0.015 * (end - start)
    figure, (axes,) = style.chart(2.4 + 0.55 * count if count > 1 else 3.6)
    style.time_axes([axes], ticks, start - room, end + room)
    burn_rows(axes, ticks, every, called, colours(count) if count > 1 else [AFTER], end - start)
    axes.set_ylabel("bar height: delta-v", fontsize=SMALL)
    style.headline(figure, burns_story(called, every, firing))
    return figure


def burn_rows(
    axes: Axes,
    ticks: units.Clock,
    every: Sequence[Burns],
    called: list[str],
    tints: Any,
    span: float,
    names: bool = True,
) -> float:
    """Draw a row of bars for each spacecraft, as high as its burns; return the largest burn [m/s].

    If `names`, the larger burns have labels where there is room. `span` is the length of the time axis [s].
    """
    count, greatest = len(every), max(float(one.size.max(initial=0.0)) for one in every)
    unit, points, words = units.speed_unit(greatest), list[Floats](), list[str]()
    levels = np.arange(count)[::-1]
    axes.set_ylim(-0.15, float(count))
    axes.grid(axis="y", visible=False)
    for level, one, tint in zip(levels, every, tints, strict=True):
        axes.axhline(level, color=FAINT, linewidth=1.0)
        width = np.maximum(one.duration, NARROWEST * span)
        middle, high = one.start + 0.5 * one.duration, level + HIGH * one.size / (greatest or 1.0)
        left, right = ticks(middle - 0.5 * width), ticks(middle + 0.5 * width)
        low = np.full_like(high, level)
        corners = np.stack([[left, low], [left, high], [right, high], [right, low]]).transpose(2, 0, 1)
        axes.add_collection(PolyCollection(list(corners), facecolors=tint, linewidths=0))
        large = np.flatnonzero(one.size >= SMALLEST * greatest)
        if names and len(large) <= LABELLED:
            large = large[np.argsort(-one.size[large], kind="stable")]
            points += list(np.column_stack([right, np.maximum(high - 0.3, level + 0.05)])[large])
            words += [unit.text(size) for size in one.size[large].tolist()]
    if points:
        label(axes, np.array(points), words, spots=NEAR)
    name_rows(axes, levels, called)
    return greatest


def burns_story(called: list[str], every: Sequence[Burns], firing: ThrusterFiring | None) -> str:
    """Return the headline: number of burns, total and largest delta-v."""
    spent = [float(one.size.sum()) for one in every]
    k, count = int(np.argmax(spent)), sum(len(one.size) for one in every)
    if not count:
        return "No spacecraft burns"
    said = f"{units.plural(count, 'burn' if firing is None else 'pulse')}, {units.speed(sum(spent))}"
    if firing is not None:
        said += f" fired for {units.speed(float(np.sum(firing.planned.delta_v)))} planned"
    if len(every) == 1:
        return f"{called[0]}: {said}; the largest is {units.speed(float(every[0].size.max()))}"
    return f"{said} in total; {called[k]} has the largest delta-v, {units.speed(spent[k])}"


@picture("there is no such spacecraft")
def pulses(firing: ThrusterFiring, craft: int = 0, name: str | None = None) -> Figure:
    """Plot the pulses of each thruster of a spacecraft against time, over the planned thrust.

    Each pulse is a bar with its duration as width and its delta-v as height. The shaded area is the planned
    thrust multiplied by the period, which is the delta-v of one cycle. Two opposite thrusters share a panel,
    with the second one downwards. Thrusters along no axis are labelled by number, from 1.

    Parameters
    ----------
    craft : int, default 0
        Index of the spacecraft.
    name : str, optional
        Name of the spacecraft; default: its index if there are several.
    """
    if name is not None:
        instance("name", name, str)
    count = len(firing.thrusters)
    if whole("craft", craft) >= count:
        raise ValueError(f"craft: must be from 0 to {count - 1}, got {craft}")
    plan = firing.planned[craft] if firing.planned.shape else firing.planned
    thrusters = firing.thrusters[craft]
    fired = firing.pulses[firing.pulses.craft == craft]
    times, wanted = planned_per_period(plan, thrusters)
    rows = thruster_rows(thrusters, fired, wanted)
    unit, ticks = (
        units.speed_unit(float(max(fired.impulse.max(initial=0.0), wanted.max()))),
        units.clock(plan, plan.start, plan.end),
    )
    figure, panels = style.chart(2.3 + 1.9 * len(rows), [1.0] * len(rows))
    for axes, row in zip(panels, rows, strict=True):
        label_of_row, colour = row_name(thrusters, row)
        axes.set_ylabel(f"{label_of_row} [{unit.name}]", fontsize=SMALL, color=colour)
        for thruster, sign in zip(row, (1.0, -1.0), strict=False):
            own, area = fired[fired.thruster == thruster], sign * wanted[:, thruster] / unit.size
            axes.fill_between(ticks(times), 0.0, area, color=OTHER, alpha=0.45, linewidth=0)
            look: dict[str, Any] = {"align": "edge", "color": colour, "alpha": 0.9}
            look["linewidth"] = 0.9 if len(own) < 150 else 0.5  # the edge keeps a short pulse visible
            axes.bar(ticks(own.start), sign * own.impulse / unit.size, ticks(own.duration), **look)
        axes.axhline(0.0, color=INK, linewidth=0.8)
        axes.margins(y=0.12)
    style.time_axes(panels, ticks, plan.start, plan.end)
    handles, words = [Patch(color=INK, alpha=0.6)], ["pulse: height is its delta-v, width its duration"]
    if plan.peak_thrust > 0.0 and thrusters.period:
        handles.append(Patch(color=OTHER, alpha=0.45))
        words.append(f"planned thrust × period of {thrusters.period:g} s")
    style.legend(figure, handles, words)
    style.headline(figure, pulses_story(firing, craft, fired, name))
    return figure


def thruster_rows(thrusters: Thrusters, fired: Pulses, wanted: Floats) -> list[tuple[int, ...]]:
    """Return the used thrusters, each with its opposite one if there is one; at most MOST."""
    opposite = np.abs(thrusters.directions[:, None] + thrusters.directions).max(axis=2) < OPPOSITE
    found = sorted({tuple(sorted((k, *np.flatnonzero(row)[:1].tolist()))) for k, row in enumerate(opposite)})
    given = np.bincount(fired.thruster, fired.impulse, len(thrusters)) + wanted.max(axis=0, initial=0.0)
    used = [row for row in found if given[list(row)].max() > IDLE * given.max()] or found
    return sorted(sorted(used, key=lambda row: -given[list(row)].sum())[:MOST])


def planned_per_period(plan: Path, thrusters: Thrusters) -> tuple[Floats, Floats]:
    """Return the planned delta-v of each thruster per period: times (K,) [s] and delta-v (K, m) [m/s]."""
    times = units.instants(plan.start, plan.end, plan)
    wanted = np.zeros((len(times), len(thrusters)))
    peak = plan.peak_thrust
    if thrusters.period is not None and peak > 0.0:
        push = thrust_in_frame(plan, thrusters, times)
        allocation = Allocation.of(thrusters.directions)
        facets = allocation.facets(push, 1e-9 * peak)
        sizes, corners = allocation.amounts(facets, push), allocation.corners[facets]
        every = np.zeros((len(times), len(thrusters) + 6))
        np.put_along_axis(every, corners, np.maximum(sizes, 0.0), axis=1)
        wanted = thrusters.period * every[:, : len(thrusters)]
    return times, wanted


def row_name(thrusters: Thrusters, row: tuple[int, ...]) -> tuple[str, str]:
    """Return the label and the colour of a panel."""
    axis = int(np.abs(thrusters.directions[row[0]]).argmax())
    if thrusters.directions[row[0], axis] > 1.0 - OPPOSITE:
        direction = DIRECTIONS[axis]
        return direction.name if thrusters.frame == "orbit" else f"inertial {'xyz'[axis]}", direction.colour
    return f"thruster {row[0] + 1}" if len(row) < 2 else f"{row[0] + 1} up, {row[1] + 1} down", AFTER


def pulses_story(firing: ThrusterFiring, craft: int, fired: Pulses, name: str | None) -> str:
    """Return the headline: number of pulses, delta-v, propellant and deviation from the plan."""
    dropped = firing.dropped[firing.dropped.craft == craft]
    lead = f"{f'Craft {craft}' if name is None else name}: " if len(firing.thrusters) > 1 or name else ""
    if not len(fired):
        return f"{lead}no pulses"
    off, bound = np.ravel(firing.deviation)[craft], np.ravel(firing.deviation_bound)[craft]
    unit, burned = units.length_unit(bound), fired.propellant.sum()
    planned = float(np.ravel(firing.planned.delta_v)[craft])
    given = units.speed(fired.impulse.sum())
    words = f"{lead}{units.plural(len(fired), 'pulse')}, {given} fired for {units.speed(planned)} planned"
    if np.isfinite(burned):
        words += f", {1e3 * burned:.3g} g" if burned < 1.0 else f", {burned:.4g} kg"
    words += f"; {unit.text(off, 3)} from the plan, at most {unit.text(bound, 3)}"
    return words + (f"; {units.speed(dropped.impulse.sum())} omitted" if len(dropped) else "")
