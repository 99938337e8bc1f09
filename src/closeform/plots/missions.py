"""Overview of a mission: paths in space; burns, conflicts, locks and clearance ratio against time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from closeform.arrays import Floats, number, sequence, shown, whole
from closeform.fuel.burns import Burns, burns_of
from closeform.motion.path import Path
from closeform.plots.drawing.charts import Curve, Panel, draw
from closeform.plots.drawing.inputs import Zones, one_path, picture, texts
from closeform.plots.drawing.pairs import Pairs
from closeform.plots.drawing.palette import CONFLICT, FAINT, INK, OTHER, colours
from closeform.plots.drawing.space import AXES, INERTIAL, OBLIQUE, ORBITAL, Scene, finished, space_axes
from closeform.plots.drawing.style import dress, sheet, time_axes
from closeform.plots.drawing.text import SMALL, plain, short_names
from closeform.plots.drawing.units import Clock, clock, instants, plural, speed
from closeform.plots.paths import NAMED, closest_pair, conflicts_of, ends, own_tracks, stretches
from closeform.plots.thrusts import burn_rows

CLOSEST, LOOKS = 300, 500  # maximum number of pairs evaluated, and of sample times per stage
SAME = 1e-9  # of the total duration: overlap of stages allowed for rounding
ROUNDED = 6  # digits of ratios that are compared

Lock = tuple[float, int, int]


@dataclass(frozen=True, eq=False)
class Stage:
    """One stage: its paths, sample `times` (T,) [s] for smooth curves, and its pairs."""

    title: str
    paths: Path
    times: Floats
    pairs: Pairs

    @property
    def least(self) -> float:
        """Minimum clearance ratio of any pair; inf if there is none."""
        return float(self.pairs.ratio.min(initial=np.inf))

    @property
    def curve(self) -> Curve:
        """Minimum clearance ratio of any pair against time, with its exact minimum."""
        chosen = self.pairs.order[:CLOSEST]
        sparse = self.times[:: -(-len(self.times) // LOOKS)]
        times = np.union1d(np.append(sparse, self.times[-1]), self.pairs.time[chosen])
        least = self.pairs.ratios(times, chosen).min(axis=0)
        near = chosen[0]
        return Curve(times, least, dot=(float(self.pairs.time[near]), float(self.pairs.ratio[near])))


@picture(
    "there is no stage, shapes or orbits differ, a stage begins before the last has ended, the number of "
    "titles is wrong, or a lock names an unknown spacecraft"
)
def overview(
    stages: Sequence[Path],
    names: Sequence[str] | None = None,
    zone: Zones = None,
    titles: Sequence[str] | None = None,
    locks: Sequence[Lock] = (),
) -> Figure:
    """Plot a whole mission: all paths in space, and burns, conflicts and closest approach against time.

    The left panel shows every path from its start (ring) to its end (dot). The right panel has a row for each
    spacecraft with a bar for each burn, as high as its delta-v. A lock joins the rows of its two spacecraft,
    and so does a conflict. If there are zones, the panel below shows the minimum
    clearance ratio of the 300 closest pairs of each stage.

    Parameters
    ----------
    stages : sequence of Path
        Paths of shape (N,) in one orbit for each stage, in order of time.
    titles : sequence of str, optional
        Titles of the stages; default: their numbers.
    locks : sequence of tuple of (float [s], int, int), default none
        Time of each lock and the indices of its two spacecraft.
    """
    flights = stages_given(stages, zone, titles)
    first, start, end = flights[0].paths, float(flights[0].times[0]), float(flights[-1].times[-1])
    called, ticks, tints = short_names(names, len(first)), clock(first, start, end), colours(len(first))
    found, count = locks_given(locks, len(first)), len(first)

    figure, zones = sheet(6.4), bool(len(flights[0].pairs))
    grid = figure.add_gridspec(3 if zones else 2, 2, height_ratios=(0.12, 1.1, 0.9)[: 3 if zones else 2])
    view = figure.add_subplot(grid[:, 0])
    strip, rows, *below = (figure.add_subplot(grid[k, 1]) for k in range(3 if zones else 2))
    panels = [strip, rows, *below]
    for axes in panels[1:]:
        dress(axes)
        for flight in flights[1:]:
            axes.axvline(float(ticks(flight.times[0])), color=OTHER, linewidth=0.8, zorder=1)
    stage_strip(strip, flights, ticks, end - start)
    burns = [joined([burns_of(flight.paths[k]).significant for flight in flights]) for k in range(count)]
    largest = burn_rows(
        rows, ticks, burns, called if count <= NAMED else [""] * count, tints, end - start, False
    )
    rows.set_ylabel(f"burns, up to {speed(largest)}" if largest else "no burns", fontsize=SMALL)
    events(rows, flights, ticks, count, found)
    for axes in below:
        curves = [flight.curve for flight in flights]
        draw(axes, Panel("closest [× zone]", curves, 1.0, scale="ratio"), ticks, [], [])
    time_axes(panels, ticks, start, end)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)

    scene, conflicts, story = whole_mission(flights, called)
    in_orbit = bool(np.isfinite(first.orbit.period))
    camera = ORBITAL if in_orbit else OBLIQUE
    space_axes(view, camera(scene.points), camera, AXES if in_orbit else INERTIAL)
    said = f"{count} craft, {plural(len(flights), 'stage')}"
    if zones:
        pairs = f"{conflicts} of {len(flights[0].pairs)} pairs in conflict" if conflicts else "paths clear"
        said += f": {'; '.join(filter(None, (pairs, story)))}"
    return finished(figure, [(view, scene, camera, 1.0), (rows, Scene([]), camera, 1.0)], said)


def stages_given(stages: Any, zone: Any, titles: Any) -> list[Stage]:
    """Return the checked stages, each with its pairs."""
    paths = sequence("stages", stages, Path)
    if not paths:
        raise ValueError("stages: give at least one path")
    first = one_path("stages", paths[0])
    matching = all(path.shape == first.shape and path.orbit == first.orbit for path in paths)
    if len(first.shape) != 1 or not matching:
        raise ValueError(
            f"stages: must be of one orbit and one shape (N,), got {[one.shape for one in paths]}"
        )
    numbers = [str(number) for number in range(1, len(paths) + 1)]
    words = numbers if titles is None else texts("titles", titles, len(paths), "stages")
    found: list[Stage] = []
    for title, path in zip(words, paths, strict=True):
        times = instants(float(np.max(path.start)), float(np.min(path.end)), path)
        if found and times[0] < found[-1].times[-1] - SAME * (times[-1] - found[0].times[0]):
            raise ValueError(f"stages: {title} begins at {times[0]:g} s, before {found[-1].title} has ended")
        found.append(Stage(title, path, times, Pairs.of(path, zone, name="zone")))
    return found


def locks_given(locks: Any, count: int) -> list[Lock]:
    """Return the checked locks of `count` spacecraft."""
    found = []
    for lock in sequence("locks", locks, tuple):
        if len(lock) != 3:
            raise ValueError(f"locks: expected (time, craft, craft), got {shown(lock)}")
        time = number("locks", lock[0])
        one, other = (whole("locks", craft, 0) for craft in lock[1:])
        if max(one, other) >= count:
            raise ValueError(f"locks: there is no craft {max(one, other)} among {count}")
        found.append((time, one, other))
    return found


def whole_mission(flights: list[Stage], called: list[str]) -> tuple[Scene, int, str]:
    """Return the scene of all stages, the number of pairs in conflict, and the closest pair as text."""
    count = len(called)
    lines = [np.concatenate([one.paths[k].position(one.times) for one in flights]) for k in range(count)]
    tracks = own_tracks(lines)
    for one in flights:
        for k, intervals in enumerate(conflicts_of(one.pairs, count)):
            tracks += stretches(one.paths[k], intervals)
    nearest = min(flights, key=lambda one: round(one.least, ROUNDED))
    shapes, marks, story = closest_pair(nearest.pairs, count, called)
    hit = {tuple(pair) for one in flights for pair in one.pairs.craft[one.pairs.hit].tolist()}
    return Scene(tracks, [*ends(lines, called), *marks], shapes), len(hit), story


def joined(every: Sequence[Burns]) -> Burns:
    """Return the burns of consecutive stages."""
    return Burns(*(np.concatenate(column) for column in zip(*every, strict=True)))


def stage_strip(axes: Axes, flights: list[Stage], ticks: Clock, duration: float) -> None:
    """Draw the strip of stages, with titles (or their first words) where there is room."""
    axes.set(ylim=(0.0, 1.0), yticks=[])
    axes.tick_params(bottom=False)
    axes.spines[:].set_visible(False)
    for k, flight in enumerate(flights):
        begin, over = float(ticks(flight.times[0])), float(ticks(flight.times[-1]))
        axes.axvspan(begin, over, color=FAINT, alpha=1.0 if k % 2 else 0.5, linewidth=0)
        letters = 52 * (flight.times[-1] - flight.times[0]) / duration  # that fit into half the page
        fits = [word for word in (flight.title, flight.title.split()[0]) if len(word) <= letters]
        look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": SMALL, "color": INK}
        plain(axes.text(0.5 * (begin + over), 0.46, fits[0] if fits else "", **look))


def events(axes: Axes, flights: list[Stage], ticks: Clock, count: int, locks: Sequence[Lock]) -> None:
    """Draw conflicts and locks between the rows of their spacecraft."""
    bars, links, top = list[Any](), list[Any](), count - 1
    for flight in flights:
        for pair, stays in zip(flight.pairs.craft.tolist(), flight.pairs.stays, strict=True):
            for stay in stays:
                bars += [[(ticks(stay.start), top - k), (ticks(stay.end), top - k)] for k in pair]
                links.append([(ticks(stay.time), top - k) for k in pair])
    if bars:
        axes.add_collection(LineCollection(bars, colors=CONFLICT, linewidths=5.0, zorder=3))
        axes.add_collection(LineCollection(links, colors=CONFLICT, linewidths=1.0, zorder=3))
    if len(locks):
        joins = [[(float(ticks(time)), top - k) for k in pair] for time, *pair in locks]
        axes.add_collection(LineCollection(joins, colors=INK, linewidths=1.1, zorder=4))
        axes.plot(
            *np.array(joins).reshape(-1, 2).T, "o-", color=INK, markersize=4, linewidth=0.0, label="lock"
        )
