"""Overview of a mission: paths in space; thrust, conflicts, locks and clearance ratio against time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.plots.camera import AXES, OBLIQUE, ORBITAL, framed, window
from closeform.plots.closest import ratio_axis
from closeform.plots.fleet import NEAREST, in_space
from closeform.plots.fonts import inches, plain, short_names
from closeform.plots.label_placement import Names
from closeform.plots.palette import AFTER, CONFLICT, FAINT, INK, OTHER, ZONE, colours
from closeform.plots.stage_flights import Lock, StageFlight, asked, impulses, pairs_found
from closeform.plots.style import (
    SMALL,
    WIDTH,
    Clock,
    area,
    clock,
    dress,
    headline,
    legend,
    sheet,
    speed,
    thrust_unit,
    time_axes,
    zone_band,
)
from closeform.plots.tracks import NAMED, Formation, closest, together
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones

HIGH, SPACE = 6.0, 4.45  # inches: height of the figure, and side of the square view in space
LEFT, RIGHT, ABOVE, BELOW = 5.6, 0.35, 1.0, 1.25  # inches beside, above and below the panels of time
STRIP, GAP = 0.32, 0.1  # inches of the row of stages, and between panels
MARK = 0.75  # inches of a mark in the legend, including its margin
THIN = 1.0  # points: pulses of seconds in hours have no width
TALL = 0.8  # of the row height: the strongest thrust and the largest impulse
SHADE = "#eef1f4"


def overview(
    stages: Sequence[Path],
    names: Sequence[str] | None = None,
    zone: OwnZone | Sequence[OwnZone | None] | PairZones | None = None,
    titles: Sequence[str] | None = None,
    locks: Sequence[Lock] = (),
) -> Figure:
    """Plot a whole mission: all paths in space, and thrust, conflicts and closest approach against time.

    The left panel shows every path from its start (ring) to its end (dot). The right panel has a row for each
    spacecraft, with thrust as areas and impulses as lines, both scaled to the strongest. A lock joins the
    rows of its two spacecraft, and so does a conflict. If there are zones, the panel below shows the minimum
    clearance ratio of the 300 closest pairs of each stage.

    Parameters
    ----------
    stages : sequence of Path
        Paths of shape (N,) in one orbit for each stage, in order of time.
    names : sequence of str, optional
        Names of the spacecraft; default: their indices.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones, optional
        One zone for all spacecraft or one for each, combined for a pair as in `screen` (None: no zone of its
        own).
    titles : sequence of str, optional
        Titles of the stages; default: their numbers.
    locks : sequence of tuple of (float [s], int, int), default none
        Time of each lock and the indices of its two spacecraft.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If there is no stage, shapes or orbits differ, a stage begins before the last has ended, the number of
        names or titles is wrong, a lock names an unknown spacecraft, or an argument has the wrong type.
    """
    flights = asked(stages, zone, titles)
    first = flights[0].paths
    called = short_names(names, len(first))
    found = pairs_found(locks, len(first))
    figure = sheet(HIGH)
    in_orbit, tints = bool(first.orbit.mean_motion), colours(len(first))
    flown = whole(flights, called)
    space = area(figure, 0.1, BELOW - 0.5, SPACE, SPACE)
    camera = ORBITAL if in_orbit else OBLIQUE
    window(space, camera(flown.points), camera, AXES if in_orbit else "xyz", 0.35)
    framed(space, "")
    in_space(space, camera, flown, Names(figure, called if len(called) <= NAMED else ()))
    start, end = flights[0].start, flights[-1].end
    ticks = clock(first, start, end)
    panels = against_time(figure, bool(len(flights[0].pairs)))
    shown = [
        *stage_strip(panels[0], flights, ticks, end - start),
        *rows(panels[1], flights, ticks, called, tints),
    ]
    shown += meetings(panels[1], flights, ticks, len(called), found)
    if len(panels) > 2:
        nearness(panels[2], flights, ticks)
    for axes in panels[1:]:
        for flight in flights[1:]:
            axes.axvline(float(ticks(flight.start)), color=OTHER, linewidth=0.8, zorder=1)
    time_axes(panels, ticks, start, end)
    marks(figure, flown, shown)
    headline(figure, said(flights, flown, len(called)))
    return figure


def whole(flights: list[StageFlight], called: list[str]) -> Formation:
    """Return all stages as one Formation for the view in space."""
    count = len(called)
    pieces = [flight.paths.position(flight.times) for flight in flights]
    tracks = [np.concatenate([piece[k] for piece in pieces]) for k in range(count)]
    stays = [
        flight.paths[k].position(np.linspace(start, end, 60))
        for flight in flights
        for k, spans in enumerate(together(flight.pairs, count))
        for start, end in spans
    ]
    nearest = min(flights, key=lambda flight: round(flight.least, 6))
    near = closest(nearest.pairs, count, called)
    hit = {tuple(pair) for flight in flights for pair in flight.pairs.craft[flight.pairs.hit].tolist()}
    every = list(range(count))
    return Formation("", tracks, stays, [], near, len(hit), len(flights[0].pairs), "", every, [])


def against_time(figure: Figure, zones: bool) -> list[Axes]:
    """Add stacked axes: the strip of stages, the rows of spacecraft and, with `zones`, the ratio."""
    wide = WIDTH - LEFT - RIGHT
    room = HIGH - ABOVE - BELOW - STRIP - GAP
    shares = (0.55 * room, 0.45 * room - GAP) if zones else (room,)
    made, top = [area(figure, LEFT, HIGH - ABOVE - STRIP, wide, STRIP)], HIGH - ABOVE - STRIP
    for tall in shares:
        made.append(area(figure, LEFT, top - GAP - tall, wide, tall))
        top -= GAP + tall
        dress(made[-1])
        made[-1].yaxis.set_label_coords(-0.5 / wide, 0.5)
    return made


def stage_strip(axes: Axes, flights: list[StageFlight], ticks: Clock, duration: float) -> list[Any]:
    """Draw the strip of stages, with titles where they fit."""
    axes.set(ylim=(0.0, 1.0), yticks=[])
    axes.tick_params(bottom=False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    per_inch = duration / (WIDTH - LEFT - RIGHT)
    for k, flight in enumerate(flights):
        begin, over = float(ticks(flight.start)), float(ticks(flight.end))
        axes.axvspan(begin, over, color=FAINT if k % 2 else SHADE, linewidth=0)
        room = (flight.end - flight.start) / per_inch
        word = flight.title if inches(flight.title, SMALL) < room else flight.title.split()[0]
        if inches(word, SMALL) < room:
            look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": SMALL, "color": INK}
            plain(axes.text(0.5 * (begin + over), 0.46, word, **look))
    return []


def rows(axes: Axes, flights: list[StageFlight], ticks: Clock, called: list[str], tints: Floats) -> list[Any]:
    """Draw thrust of each spacecraft as areas and impulses as lines; return legend handles."""
    count = len(called)
    levels = np.arange(count)[::-1]
    thrusts = [np.linalg.norm(flight.paths.thrust(flight.times), axis=-1) for flight in flights]
    strongest = max(float(one.max(initial=0.0)) for one in thrusts)
    axes.hlines(
        levels, float(ticks(flights[0].start)), float(ticks(flights[-1].end)), color=FAINT, linewidth=1.0
    )
    kicks = [impulses(flight.paths) for flight in flights]
    largest = max(float(sizes.max(initial=0.0)) for _, _, sizes in kicks)
    handles: list[Any] = []
    if strongest > 0.0:
        for flight, thrust in zip(flights, thrusts, strict=True):
            if not thrust.any():
                continue
            along = ticks(flight.times)
            feet = np.r_[along[0], along, along[-1]]
            shapes = [
                np.column_stack([feet, level + TALL * np.r_[0.0, one, 0.0] / strongest])
                for level, one in zip(levels, thrust, strict=True)
                if one.any()
            ]
            axes.add_collection(
                PolyCollection(shapes, color=tints[thrust.any(axis=1)], linewidths=THIN, alpha=0.85, zorder=2)
            )
        unit = thrust_unit(strongest)
        words = f"thrust, up to {strongest / unit.size:.3g} {unit.name}"
        first = int(np.argmax([one.max(axis=1) for one in thrusts]) % count)
        handles.append(Patch(facecolor=tints[first], alpha=0.85, label=words))  # colour of the strongest
    if largest > 0.0:
        for time, who, size in kicks:
            feet = np.column_stack([ticks(time), levels[who]])
            tops = np.column_stack([ticks(time), levels[who] + TALL * size / largest])
            axes.add_collection(
                LineCollection(
                    list(np.stack([feet, tops], axis=1)), colors=tints[who], linewidths=2.2, zorder=2.5
                )
            )
        whose, sizes = (np.concatenate([kick[k] for kick in kicks]) for k in (1, 2))
        words = f"impulse, up to {speed(largest)}"
        tint = tuple(tints[whose[np.argmax(sizes)]])
        handles.append(Line2D([], [], color=tint, linewidth=2.2, label=words))
    axes.set_ylim(-0.35, count - 1 + 1.0)
    axes.grid(axis="y", visible=False)
    few = count <= NAMED
    axes.set_yticks(levels if few else [], called if few else [])
    axes.tick_params(axis="y", labelsize=SMALL - (0.0 if count <= 10 else 2.5), length=0)
    for word in axes.get_yticklabels():
        plain(word)
    if not few:
        axes.set_ylabel(f"{count} craft")
    return handles


def meetings(
    axes: Axes, flights: list[StageFlight], ticks: Clock, count: int, locks: Sequence[Lock]
) -> list[Any]:
    """Draw conflicts and locks between the rows of their spacecraft; return legend handles."""
    handles: list[Any] = []
    top = count - 1
    met = [
        (stay, *pair)
        for flight in flights
        for pair, stays in zip(flight.pairs.craft.tolist(), flight.pairs.stays, strict=True)
        for stay in stays
    ]
    if met:
        bars = [
            [(float(ticks(stay.start)), top - k), (float(ticks(stay.end)), top - k)]
            for stay, *two in met
            for k in two
        ]
        axes.add_collection(LineCollection(bars, colors=CONFLICT, linewidths=5.0, zorder=3))
        links = [[(float(ticks(stay.time)), top - k) for k in two] for stay, *two in met]
        axes.add_collection(LineCollection(links, colors=CONFLICT, linewidths=1.0, zorder=3))
        handles.append(Line2D([], [], color=CONFLICT, linewidth=5.0, label="in conflict"))
    if len(locks):
        joined = [[(float(ticks(time)), top - k) for k in two] for time, *two in locks]
        axes.add_collection(LineCollection(joined, colors=INK, linewidths=1.1, zorder=4))
        ends = np.array(joined).reshape(-1, 2)
        axes.plot(*ends.T, "o", color=INK, markersize=4, zorder=4)
        look: dict[str, Any] = {"marker": "o", "markersize": 4, "color": INK, "linewidth": 1.1}
        handles.append(Line2D([], [], label="lock", **look))
    return handles


def nearness(axes: Axes, flights: list[StageFlight], ticks: Clock) -> None:
    """Plot the minimum ratio of any pair against time, with a dot at the minimum of each stage."""
    zone_band(axes)
    curves = [flight.nearness() for flight in flights]
    for flight, (times, least) in zip(flights, curves, strict=True):
        axes.plot(ticks(times), least, color=AFTER, linewidth=1.8, zorder=3)
        inside = np.where(least <= 1.0, least, np.nan)
        axes.plot(ticks(times), inside, color=CONFLICT, linewidth=4.0, alpha=0.6, zorder=2.9)
        near = flight.pairs.order[0]
        dot: dict[str, Any] = {"color": AFTER, "markeredgecolor": "white", "markersize": 7, "zorder": 5}
        axes.plot(ticks(flight.pairs.time[near]), flight.pairs.ratio[near], "o", clip_on=False, **dot)
    ratio_axis(axes, min(flight.least for flight in flights), max(float(least.max()) for _, least in curves))
    axes.set_ylabel("closest [× zone]")


def marks(figure: Figure, flown: Formation, shown: list[Any]) -> None:
    """Add the legend."""
    ring: dict[str, Any] = {"linestyle": "", "marker": "o", "color": INK}
    handles: list[Any] = [
        Line2D([], [], markerfacecolor="none", markersize=8, label="start", **ring),
        Line2D([], [], markersize=6, label="end", **ring),
    ]
    if flown.closest is not None:
        handles.append(Line2D([], [], **NEAREST, label="closest pair then"))
        handles.append(Patch(facecolor=ZONE, edgecolor=ZONE, alpha=0.4, label="its zone"))
    handles += shown
    words = [str(one.get_label()) for one in handles]
    lines = -(-sum(inches(word, SMALL) + MARK for word in words) // WIDTH)
    legend(figure, handles, words, ncols=int(-(-len(words) // lines)), columnspacing=1.3)


def said(flights: list[StageFlight], flown: Formation, count: int) -> str:
    """Return the headline: numbers of spacecraft and stages, conflicts, and the closest pair."""
    number = f"{len(flights)} stage{'s' * (len(flights) > 1)}"
    words = f"{count} craft, {number}"
    if not flown.pairs:
        return words
    clear = f"{flown.conflicts} of {flown.pairs} pairs in conflict" if flown.conflicts else "paths clear"
    return f"{words}: {clear}" + (f"; {flown.story}" if flown.story else "")
