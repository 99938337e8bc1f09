"""Primer magnitude against time, and minimum delta-v against transfer duration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from closeform.arrays import Floats, instance, number, whole
from closeform.fuel.arrivals import TransferCostTable
from closeform.fuel.bound import least_delta_v
from closeform.fuel.burns import burns_of
from closeform.fuel.thrusters import Thrusters
from closeform.motion.path import Path, ends_of
from closeform.planning.plan import Avoidance, Plan
from closeform.plots.inputs import crafts, one_craft
from closeform.plots.palette import AFTER, BEFORE, INK, OTHER, ZONE
from closeform.plots.plan_primer import PlanePushes, Worth
from closeform.plots.style import (
    DASHED,
    HALO,
    SMALL,
    chart,
    clock,
    headline,
    instants,
    plain_unit,
    speed,
    speed_unit,
    time_axes,
)

LEAST = 0.05  # per cent above a bound that count as equal to it
LETTERED = 12  # impulses or slots that are labelled
SMALLEST = 0.02  # of the largest impulse: smaller ones are not labelled
TOGETHER = 0.01  # of the duration: impulses closer together share one label
ALIKE = 0.02  # of the delta-v of a plan: a smaller difference between planned and fired delta-v is invisible
STEEP = 4.0  # times the minimum delta-v: a curve that rises higher has a logarithmic axis
CROWDED = 40.0  # pixels: of two marks closer together, the lower one has its label below it
BESIDE = 0.12  # of the duration: labels closer together are stacked


def primer(path: Path | Avoidance | Plan, craft: int = 0, thrusters: Thrusters | None = None) -> Figure:
    """Plot the magnitude of a primer against time: 1 at optimal impulses, nowhere above 1.

    Each dot is an impulse, labelled with its size, at the height p . v/|v|: its value per metre per second.
    Finite burns are grey. For a path, the primer is that of its end states without obstacles. On the optimal
    plan all dots lie at 1; on another path, a dot below 1 shows the wasted share. A plan around zones has a
    primer of its own, whose rate jumps at each contact with a zone; pass the plan itself to plot it.

    Parameters
    ----------
    path : Path, Avoidance or Plan
        Path of one spacecraft over at most 100 orbits, from `Orbit.impulsive` or any other between its end
        states; or a minimum-delta-v plan.
    craft : int, default 0
        Index of the spacecraft in a `Plan`.
    thrusters : Thrusters, optional
        Thrusters for which the plan was made; d . p of the best thruster replaces the primer magnitude.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If the path is a batch, is too long or is not a path, or if a plan has no path or no such spacecraft.

    References
    ----------
    docs/theory.md (26, 27, 36, 38).
    """
    flown = _flown(path, craft)
    if thrusters is not None:
        instance("thrusters", thrusters, Thrusters)
    planes = PlanePushes.of(path, craft, flown)
    if flown.impulses and (len(planes) or thrusters is not None):
        return _of_plan(flown, planes, thrusters)
    return _of_ends(flown)


def _flown(path: Any, craft: int) -> Path:
    """Return the path of one spacecraft."""
    flown = path.paths if isinstance(path, Plan) else path.path if isinstance(path, Avoidance) else path
    count = len(flown) if isinstance(path, Plan) and flown is not None else 1
    if whole("craft", craft) >= count:
        raise ValueError(f"craft: from 0 to {count - 1}, got {craft}")
    return one_craft("path", flown[craft] if isinstance(path, Plan) and flown is not None else flown)


def _of_ends(path: Path) -> Figure:
    """Plot the primer of a path's end states without obstacles."""
    start, end = path.start, path.end
    bound = least_delta_v(path.orbit, *ends_of(path), end - start)
    times = instants(start, end, path)
    lengths = np.linalg.norm(bound.primer.position(times - start), axis=-1)
    sizes = [float(np.linalg.norm(push)) for _, push in path.impulses]
    heights = [
        float(bound.primer.position(time - start) @ push) / size
        for (time, push), size in zip(path.impulses, sizes, strict=True)
    ]
    figure = _drawn(path, times, lengths, heights, sizes, "primer magnitude")
    least = "the least there is" if bound.proven else f"at least {speed(float(bound.lower))}"
    spent = float(path.delta_v)
    if spent > float(bound.upper) * (1.0 + 1e-6):
        above = 100.0 * (spent / float(bound.lower) - 1.0) if bound.lower > 0.0 else np.inf
        share = f"{above:.3g} % above the least" if np.isfinite(above) else "more than the least"
        near = above < LEAST
        least = f"{f'within {LEAST} % of the least' if near else share}, {speed(float(bound.lower))}"
        words = "" if near else "by the primer of the ends alone, with nothing in the way"
        look: dict[str, Any] = {"textcoords": "offset points", "fontsize": SMALL, "color": INK}
        look |= {"path_effects": HALO, "zorder": 6}
        figure.axes[0].annotate(words, (0.0, 0.0), (6, 5), "axes fraction", **look)
    headline(figure, f"{_spent(path, spent)}: {least}")
    return figure


def primer_length(primer: Path, said: str) -> Figure:
    """Plot the magnitude of a given primer against time."""
    times = instants(primer.start, primer.end, primer)
    lengths = np.linalg.norm(primer.position(times), axis=-1)
    figure = _drawn(primer, times, lengths, [], [], "primer magnitude")
    headline(figure, said)
    return figure


def _of_plan(path: Path, planes: PlanePushes, thrusters: Thrusters | None) -> Figure:
    """Plot the primer of a plan with zone contacts, or of a plan made for thrusters."""
    worth, times = Worth.of(path, planes, thrusters), instants(path.start, path.end, path)
    lengths, when = worth.heights(times), np.array([time for time, _ in path.impulses])
    sizes = [worth.spent(time, push) for time, push in path.impulses]
    gained = [float(p @ push) for p, (_, push) in zip(worth(when), path.impulses, strict=True)]
    heights = [gain / size for gain, size in zip(gained, sizes, strict=True)]
    named = "primer magnitude" if thrusters is None else "primer along thrusters"
    figure = _drawn(path, times, lengths, heights, sizes, named)
    (axes,) = figure.axes
    ticks = clock(path, path.start, path.end)
    for time in planes.times:
        axes.axvline(ticks(time), color=ZONE, linestyle=DASHED, linewidth=1.2, zorder=1.5)
    if len(planes):
        late = planes.times[-1] > path.start + 0.8 * (path.end - path.start)
        look: dict[str, Any] = {"textcoords": "offset points", "fontsize": SMALL, "color": "#9a6a00"}
        place = (float(ticks(planes.times[0 if late else -1])), axes.get_ylim()[0])
        axes.annotate("touches a zone", place, (-5 if late else 5, 5), ha="right" if late else "left", **look)
    spent, least = sum(sizes), sum(gained) / max(1.0, float(lengths.max()))
    whose = (" of these thrusters" if thrusters is not None else "") + (
        " on these sides" if len(planes) else ""
    )
    above = 100.0 * (spent / least - 1.0)
    told = f"the least{whose}" if above < LEAST else f"at most {above:.2g} % above the least{whose}"
    headline(figure, f"{_spent(path, spent)}: {told}")
    return figure


def _spent(path: Path, spent: float) -> str:
    """Return the delta-v and the number of impulses or burns as text."""
    burns, impulses = len(burns_of(path).told.size), len(path.impulses)
    if burns > impulses:
        return f"{speed(spent)} with {burns} burn{'s' * (burns != 1)}"
    return f"{speed(spent)} with {impulses} impulse{'s' * (impulses != 1)}"


def _drawn(
    path: Path, times: Floats, lengths: Floats, heights: list[float], sizes: list[float], named: str
) -> Figure:
    """Draw the primer curve, and a labelled dot for each impulse."""
    start, end, ticks = path.start, path.end, clock(path, path.start, path.end)
    figure, axes = chart(4.6)
    axes.axhline(1.0, color=ZONE, linewidth=1.6)
    axes.plot(ticks(times), lengths, color=AFTER, linewidth=2.0)
    burns = burns_of(path)
    for begin, lasts in zip(burns.start.tolist(), burns.duration.tolist(), strict=True):
        if lasts > 0.0:
            axes.axvspan(ticks(begin), ticks(begin + lasts), color=OTHER, alpha=0.35, linewidth=0, zorder=1)
    times_of, large = np.array([time for time, _ in path.impulses]), np.array(sizes)
    axes.plot(ticks(times_of), heights, "o", color=INK, markersize=7, linestyle="", zorder=5)
    last, row, rows = -np.inf, 0, 0
    for some in _groups(times_of, large, TOGETHER * (end - start)):
        time, many = float(times_of[some[0]]), len(some)
        late = time > start + 0.85 * (end - start)  # its label ends at the dot instead of starting there
        row = (row + 1) % 3 if time - last < BESIDE * (1.0 + late) * (end - start) else 0
        last, rows = time, max(row, rows)
        axes.annotate(
            speed(float(large[some].sum())) + (f", {many} impulses" if many > 1 else ""),
            (ticks(time), 1.0),
            (-7 if late else 7, 9 + 13 * row),
            textcoords="offset points",
            ha="right" if late else "left",
            fontsize=SMALL,
            color=INK,
        )
    low = 1.1 * min([0.0, *heights, *lengths])
    room = (24 + 13 * rows) / (axes.get_window_extent().height * 72 / figure.dpi)  # of the labels above 1
    axes.set_ylim(low, max(1.35, 1.1 * float(lengths.max(initial=0.0)), (1.0 - room * low) / (1.0 - room)))
    axes.set_ylabel(named)
    time_axes([axes], ticks, start, end)
    return figure


def _groups(times: Floats, sizes: Floats, near: float) -> list[Any]:
    """Return groups of impulse indices that share a label; small impulses are skipped."""
    large = np.flatnonzero(sizes >= SMALLEST * sizes.max(initial=0.0))
    if not len(large):
        return []
    return np.split(large, np.flatnonzero(np.diff(times[large]) > near) + 1)[:LETTERED]


def trade(
    found: TransferCostTable,
    plan: Path | Sequence[Path] | None = None,
    fired: float | None = None,
    asked: float | None = None,
) -> Figure:
    """Plot the minimum delta-v against the transfer duration, to the cheapest slot for each duration.

    The dashed line is the minimum over all durations. If the cheapest slot changes only a few times, labels
    name it by its index, from 0.

    Parameters
    ----------
    found : TransferCostTable
        Table from `transfer_cost_table`.
    plan : Path or sequence of Path, optional
        Plan to mark with a ring at its duration and delta-v, summed over several spacecraft.
    fired : float [m/s], optional
        Delta-v of the thruster firing that realizes the plan, summed over all spacecraft; marked by a dot.
    asked : float [s], optional
        Required duration, marked by a vertical line; for use without a plan.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If the table has no duration, `found` is not a `TransferCostTable`, `fired` is given without a plan,
        or `asked` is not positive.
    """
    instance("found", found, TransferCostTable)
    if not len(found.duration):
        raise ValueError("found: has no duration; give arrivals one at least")
    if fired is not None and (plan is None or not number("fired", fired) >= 0.0):
        raise ValueError("fired: the delta-v [m/s] with which a plan is flown; give it with the plan")
    if asked is not None and not number("asked", asked) > 0.0:
        raise ValueError(f"asked: a duration above 0 s, got {asked:g}")
    order = np.argsort(found.duration)
    durations, costs, slots = found.duration[order], found.delta_v[order], found.slot[order]
    across, up = plain_unit(float(durations[-1])), speed_unit(float(costs[-1]))

    figure, axes = chart(4.6)
    axes.axhline(costs.min() / up.size, color=BEFORE, linestyle=DASHED, linewidth=1.2)
    axes.plot(durations / across.size, costs / up.size, "o-", color=AFTER, linewidth=1.6, markersize=4)
    if costs.min() > 0.0 and costs.max() > STEEP * costs.min():
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
    changes = np.flatnonzero(np.diff(slots, prepend=slots[0] - 1))
    look: dict[str, Any] = {"textcoords": "offset points", "fontsize": SMALL, "color": INK}
    look |= {"path_effects": HALO, "zorder": 6}
    for k in changes if 1 < len(changes) <= LETTERED else ():
        axes.annotate(f"slot {slots[k]}", (durations[k] / across.size, costs[k] / up.size), (4, 6), **look)
    if asked is not None:
        axes.axvline(asked / across.size, color=INK, linestyle=DASHED, linewidth=1.2)
        top = asked / across.size, 1.0
        axes.annotate("required", top, (5, -12), xycoords=axes.get_xaxis_transform(), **look)
    if plan is not None:
        flown = crafts("plan", plan)
        lasts, spent = max(one.end - one.start for one in flown), sum(one.delta_v for one in flown)
        axes.plot(lasts / across.size, spent / up.size, "o", markersize=10, markerfacecolor="none", color=INK)
        places = {"this plan": spent}
        if fired is not None:
            axes.plot(lasts / across.size, fired / up.size, "o", markersize=8, color=INK)
            if abs(fired - spent) <= ALIKE * spent:
                places.clear()  # one mark
            places["this plan, as fired"] = fired
        low = min(places.values())
        where = {
            name: axes.transData.transform((lasts / across.size, y / up.size)) for name, y in places.items()
        }
        near = len(where) > 1 and np.ptp([place[1] for place in where.values()]) < CROWDED
        for name, delta_v in places.items():
            below = near and delta_v == low
            place = lasts / across.size, delta_v / up.size
            axes.annotate(name, place, (9, -8 if below else 8), va="center", **look)
    axes.set_xlabel(f"duration [{across.name}]")
    axes.set_ylabel(f"minimum delta-v [{up.name}]")
    ends = [
        f"{cost / up.size:.4g} {up.name} in {duration / across.size:.4g} {across.name}"
        for cost, duration in ((costs[0], durations[0]), (costs[-1], durations[-1]))
    ]
    headline(figure, f"Minimum delta-v {', '.join(ends[: len(durations)])}")
    return figure
