"""Animation of a formation, with its closest pair and the minimum clearance ratio against time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from closeform.arrays import Floats, whole
from closeform.motion.path import Path
from closeform.plots.drawing.charts import Curve, Panel, draw
from closeform.plots.drawing.inputs import File, Progress, Zones, crafts, picture
from closeform.plots.drawing.moving import NARROW, PLAY, WIDE, MovingView, Reel
from closeform.plots.drawing.pairs import Pairs, ratio_text
from closeform.plots.drawing.palette import CONFLICT, INK, OTHER, ZONE, colours, dark
from closeform.plots.drawing.space import AXES, INERTIAL, OBLIQUE, ORBITAL, PLANES, space_axes, three_planes
from closeform.plots.drawing.style import clock, dress, headline, instants, sheet, wrapped
from closeform.plots.drawing.text import SMALL, plain, short_names
from closeform.plots.paths import NAMED, carries
from closeform.zones.outlines import drawn, shadow
from closeform.zones.zone import Zone

HOLD, LAST = 1600, 2400  # ms per frame: at the closest approach, at the end
TRAIL, TURN = 0.25, 0.5  # length of a trail: share of the total duration, but at most so many orbits
FEW = 8  # maximum number of spacecraft with names in every view; more have names in one view
STRIP = 1.6  # inches: height of the time strip with its labels
MOST = 2_000_000  # maximum number of clearance ratios for the curve


def ratios_at(pairs: Pairs, places: Floats, times: Floats) -> Floats:
    """Return clearance ratios (M, T) of all pairs from positions (N, T, 3); inf where one has no path."""
    found = np.full((len(pairs), len(times)), np.inf)
    for zone in dict.fromkeys(pairs.zone):
        for row in [k for k, one in enumerate(pairs.zone) if one is zone]:
            gap = np.subtract(*places[pairs.craft[row]])
            both = np.isfinite(gap[:, 0])
            found[row, both] = zone._norm(gap[both])
    return found


def places_at(paths: Sequence[Path], times: Floats) -> Floats:
    """Return positions (N, T, 3) [m] of spacecraft, nan outside of their paths."""
    found = np.full((len(paths), len(times), 3), np.nan)
    for places, path in zip(found, paths, strict=True):
        there = (times >= path.start) & (times <= path.end)
        places[there] = path.position(times[there])
    return found


class FormationFilm:
    """Figure of the animation of a formation, with its views and its time strip."""

    def __init__(self, paths: Any, names: Sequence[str] | None, zone: Any, frames: int) -> None:
        self.paths = crafts("paths", paths)
        self.called, self.tints = short_names(names, len(self.paths)), colours(len(self.paths))
        self.pairs = Pairs.of(self.paths, zone, name="zone")
        start, end = min(path.start for path in self.paths), max(path.end for path in self.paths)
        self.closest = float(self.pairs.time[self.pairs.order[0]]) if self.pairs.order else start
        self.times = np.union1d(np.linspace(start, end, frames), [self.closest])
        self.tracks = [path.position(instants(path.start, path.end, path)) for path in self.paths]
        self.where = places_at(self.paths, self.times)
        self.ratios = ratios_at(self.pairs, self.where, self.times)
        self.met = np.zeros((len(self.times), len(self.paths)), dtype=bool)
        for row, step in np.argwhere(self.ratios <= 1.0).tolist():
            self.met[step, self.pairs.craft[row]] = True
        orbit = self.paths[0].orbit
        self.trail, self.ticks = (
            min(TRAIL * (end - start), TURN * orbit.period),
            clock(self.paths[0], start, end),
        )
        sizes = [drawn(one).extents for one in dict.fromkeys(self.pairs.zone)]
        reach = np.max(sizes, axis=0, initial=0.0) if sizes else np.zeros(3)
        points = np.vstack([np.vstack(self.tracks) + sign * reach for sign in (-1.0, 1.0)])
        few, named = len(self.called) <= FEW, len(self.called) <= NAMED
        if np.isfinite(orbit.period):
            self.figure, unit, ((*planes, space),) = three_planes(points, below=STRIP)
            cameras = [(axes, camera, unit.size) for axes, (_, camera) in zip(planes, PLANES, strict=True)]
            space_axes(space, ORBITAL(points), ORBITAL, AXES)
            self.views = [*(MovingView(*one) for one in cameras), MovingView(space, ORBITAL)]
            self.named = [view for view in self.views[:3] if named and (few or view is self.views[1])]
            strip = self.figure.add_subplot(planes[0].get_subplotspec().get_gridspec()[-1, :])  # type: ignore[union-attr]
        else:
            self.figure = sheet(8.2, 8.4)
            view, strip = self.figure.subplots(2, 1, height_ratios=[6.6, STRIP])
            space_axes(view, OBLIQUE(points), OBLIQUE, INERTIAL)
            self.views = [MovingView(view, OBLIQUE)]
            self.named = self.views if named else []
        thin, faint = (
            len(self.tints) > NAMED,
            np.column_stack([self.tints[:, :3], np.full(len(self.tints), 0.22)]),
        )
        for one in self.views:
            lines = [one.flat(track) for track in self.tracks]
            still: dict[str, Any] = {"colors": faint, "linewidths": 0.8 if thin else 1.2, "zorder": 1.5}
            one.axes.add_collection(LineCollection(lines, **still))
        self.strip(strip, start, end)
        self.story = headline(self.figure, " \n ")
        plain(self.story, *self.called)

    def strip(self, axes: Axes, start: float, end: float) -> None:
        """Draw the minimum ratio of all pairs against time, with a moving cursor."""
        dress(axes)
        if len(self.pairs):
            fine = min(4 * len(self.times), max(len(self.times), MOST // len(self.pairs)))
            some = self.pairs.time[self.pairs.order[:50]]
            times = np.unique(np.concatenate([np.linspace(start, end, fine), some]))
            least = ratios_at(self.pairs, places_at(self.paths, times), times).min(axis=0)
            curve = Curve(times, np.where(least < np.inf, least, np.nan), colour=INK, width=1.6)
            draw(axes, Panel("closest\n[× zone]", [curve], 1.0, "", "ratio"), self.ticks, [], [])
            axes.yaxis.label.set_fontsize(SMALL)
        else:
            axes.set_yticks([])
        axes.set_xlim(self.ticks(start), self.ticks(end))
        axes.set_xlabel(f"time [{self.ticks.unit.name}]")
        self.cursor = axes.axvline(self.ticks(start), color=OTHER, linewidth=2.5)

    @property
    def artists(self) -> list[Artist]:
        """All moving artists."""
        return [*(one for view in self.views for one in view.artists.values()), self.cursor, self.story]

    def closest_at(self, step: int) -> int | None:
        """Return the row of the closest pair at a step, or None if no pair shares this time."""
        ratios = self.ratios[:, step]
        return int(ratios.argmin()) if len(ratios) and ratios.min() < np.inf else None

    def trails(self, step: int) -> list[Floats]:
        """Return the recent track (K, 3) [m] of each spacecraft."""
        now, found = self.times[step], list[Floats]()
        for path in self.paths:
            first, last = max(path.start, now - self.trail), min(path.end, now)
            found.append(path.position(np.linspace(first, last, 40)) if first < last else np.zeros((0, 3)))
        return found

    def kept(self, step: int) -> list[tuple[int, Zone]]:
        """Return the zones to draw, each with the index of its spacecraft; that of the closest pair is first.

        If there are few spacecraft, a zone is drawn around each: that of the pair with its nearest neighbour.
        """
        pairs, found, near = self.pairs, dict[int, Zone](), self.closest_at(step)
        if near is None:
            return []
        one, other = pairs.craft[near].tolist()
        found[other if carries(pairs.paths, len(self.called), other, one) else one] = pairs.zone[near]
        if 2 < len(self.called) <= NAMED:
            for k in np.argsort(self.ratios[:, step], kind="stable")[1:].tolist():
                if self.ratios[k, step] < np.inf:
                    for craft in pairs.craft[k].tolist():
                        found.setdefault(craft, pairs.zone[k])
        return list(found.items())

    def move(self, view: MovingView, step: int) -> None:
        """Move zones, trails and spacecraft of a view to a step of the animation."""
        where, thin, near = self.where[:, step], len(self.tints) > NAMED, self.closest_at(step)
        outlines = [
            shadow(zone, view.camera.basis[:2]) / view.unit + view.flat(where[k])
            for k, zone in self.kept(step)
        ]
        view.shapes("zone", outlines[:1], ZONE, ZONE, alpha=0.45, linewidths=1.2)
        view.shapes("outlines", outlines[1:], "none", ZONE, linewidths=0.9)
        view.lines("trails", self.trails(step), colors=self.tints, linewidths=1.2 if thin else 2.4)
        link = [] if near is None else [where[self.pairs.craft[near]]]
        view.lines("link", link, colors=INK, linewidths=1.0)
        edges = [CONFLICT if hit else tint for hit, tint in zip(self.met[step], self.tints, strict=True)]
        view.points("dots", where, edges, s=14.0 if thin else 40.0, c=self.tints, linewidths=1.8)
        if view in self.named:
            view.names(self.called, where, [dark(tint) for tint in self.tints])

    def show(self, time: float) -> None:
        """Move all artists to the time [s] of a frame."""
        step = int(np.searchsorted(self.times, time))
        for view in self.views:
            self.move(view, step)
        self.cursor.set_xdata([self.ticks(time)] * 2)
        other, near = self.ticks.other, self.closest_at(step)
        said = self.ticks.text(time) + (f", {time / other.size:.2f} {other.name}" if other else "")
        if near is not None:
            pair = self.pairs.craft[near]
            apart = np.linalg.norm(np.subtract(*self.where[pair, step]))
            ratio = ratio_text(float(self.ratios[near, step]))
            said += (
                f"\nclosest now: {' and '.join(self.called[k] for k in pair)}, {ratio} × zone, {apart:.4g} m"
            )
        self.story.set_text(wrapped(self.figure, said))


@picture("`frames` is below 2")
def formation_animation(
    paths: Path | Sequence[Path],
    file: File,
    names: Sequence[str] | None = None,
    zone: Zones = None,
    *,
    frames: int = 100,
    progress: Progress = None,
) -> None:
    """Write an animated GIF of a formation: every spacecraft with its trail.

    Paths in an orbit are shown in the three planes of the orbital frame and in space; paths in deep space in
    one oblique view. With zones, a line joins the closest pair, and its zone is filled. In a formation of up
    to 20, each spacecraft has the outline of the zone between it and its nearest neighbour. A spacecraft in
    conflict has a red edge. The strip below shows the minimum ratio of all pairs against time.

    Parameters
    ----------
    frames : int, default 100
        Number of frames, at least 2, evenly spaced in time; one more at the closest approach, where the
        animation pauses.
    """
    whole("frames", frames, 2)
    found = reel(paths, names, zone, frames=frames)
    found.save(file, found.frames(slice(None), progress))


def reel(
    paths: Path | Sequence[Path],
    names: Sequence[str] | None = None,
    zone: Zones = None,
    *,
    frames: int = 100,
) -> Reel:
    """Return the animation of `formation_animation` without drawing it."""
    film = FormationFilm(paths, names, zone, frames)
    waits = np.where((film.times == film.closest) & (len(film.pairs) > 0), HOLD, PLAY)
    waits[-1] = LAST
    moments = list(zip(film.times.tolist(), waits.tolist(), strict=True))
    pixels = WIDE if len(film.called) <= NAMED else NARROW
    return Reel(film.figure, lambda: film.artists, film.show, moments, pixels)
