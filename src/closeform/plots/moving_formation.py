"""Animation of a formation: all spacecraft with their trails, and the closest pair."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike
from typing import IO, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.plots.camera import AXES, FOOT, OBLIQUE, ORBITAL, Camera, framed, window
from closeform.plots.closest import ratio_axis
from closeform.plots.fleet import space_corner, three_planes
from closeform.plots.fonts import plain, short_names
from closeform.plots.inputs import crafts, filmed
from closeform.plots.label_placement import dark
from closeform.plots.pairs import Pairs, ratio_text
from closeform.plots.palette import CONFLICT, INK, OTHER, ZONE, colours
from closeform.plots.reel import Reel
from closeform.plots.style import SMALL, TEXT, WIDTH, area, clock, dress, instants, sheet
from closeform.plots.tracks import NAMED, stays
from closeform.zones.combined_zones import OwnZone
from closeform.zones.outlines import drawn, shadow
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone

WIDE, NARROW = 900, 720  # width in pixels for few and for many spacecraft; many moving lines make large files
PLAY, HOLD, LAST = 80, 1600, 2400  # ms per frame: in motion, at the closest approach, at the end
TRAIL = 0.25  # of the total duration, but at most TURN orbits
TURN = 0.5
STRIP, UNDER = 1.0, 0.6  # inches: height of the time strip, and of the labels below it
CROWD = 26.0  # pixels: names of spacecraft closer together are hidden
CALLED = 8  # maximum number of spacecraft with names in every view; larger sets have names in one view
MOST = 2_000_000  # maximum number of clearance ratios for the curve


class Meetings:
    """Clearance ratios of all pairs at `times` (T,) [s]."""

    def __init__(self, pairs: Pairs, times: Floats) -> None:
        self.pairs, self.times = pairs, times
        count = len(pairs.paths)
        self.ratios = np.full((len(pairs), len(times)), np.inf)
        where = [held(pairs.paths[k], times) for k in range(count)]
        for zone in dict.fromkeys(pairs.zone):
            for row in [k for k, one in enumerate(pairs.zone) if one is zone]:
                one, other = pairs.craft[row]
                gap = where[one] - where[other]
                both = np.isfinite(gap[:, 0])
                self.ratios[row, both] = zone._norm(gap[both])

    def at(self, step: int, count: int | None = None) -> list[int]:
        """Return the rows of pairs that share this time, closest first, at most `count`."""
        ratios = self.ratios[:, step]
        if not len(ratios):
            return []
        order = np.argsort(ratios, kind="stable") if count != 1 else np.array([ratios.argmin()])
        return [k for k in order[:count].tolist() if ratios[k] < np.inf]


def held(path: Any, times: Floats) -> Floats:
    """Return positions (T, 3) [m] of a spacecraft, nan outside of its path."""
    found = np.full((len(times), 3), np.nan)
    there = (times >= path.start) & (times <= path.end)
    found[there] = path.position(times[there])
    return found


class View:
    """View of all spacecraft from one direction; `show` moves them."""

    def __init__(self, axes: Axes, camera: Camera, unit: float, scene: Flying, named: bool) -> None:
        self.axes, self.camera, self.unit, self.scene = axes, camera, unit, scene
        thin = len(scene.tints) > NAMED
        faint = scene.tints.copy()
        faint[:, 3] = 0.22
        lines = [camera(track) / unit for track in scene.tracks]
        axes.add_collection(LineCollection(lines, colors=faint, linewidths=0.8 if thin else 1.2, zorder=1.5))
        self.zone = PolyCollection([], facecolors=ZONE, edgecolors=ZONE, alpha=0.45, linewidths=1.2)
        self.outlines = PolyCollection([], facecolors="none", edgecolors=ZONE, linewidths=0.9)
        self.trails = LineCollection([], colors=scene.tints, linewidths=1.2 if thin else 2.4)
        (self.link,) = axes.plot([], [], color=INK, linewidth=1.0)
        for collection in (self.zone, self.outlines, self.trails):
            axes.add_collection(collection, autolim=False)
        size = 14.0 if thin else 40.0
        nowhere = np.zeros(len(scene.tints))
        look: dict[str, Any] = {"s": size, "c": scene.tints, "linewidths": 1.8, "zorder": 4}
        self.dots: Any = axes.scatter(nowhere, nowhere, **look)
        self.words: list[Any] = []
        for name, tint in zip(scene.called if named else (), scene.tints, strict=False):
            look = {"color": dark(tint), "fontsize": SMALL, "annotation_clip": True}
            text = axes.annotate(name, (0, 0), (6, 5), textcoords="offset points", **look)
            self.words.append(plain(text))

    @property
    def artists(self) -> list[Artist]:
        """Moving artists, from back to front."""
        return [self.zone, self.outlines, self.trails, self.link, self.dots, *self.words]

    def show(self, step: int) -> None:
        """Move all artists to a step of the animation."""
        scene, camera = self.scene, self.camera
        where = camera(scene.where[:, step]) / self.unit
        self.dots.set_offsets(where)
        met = scene.met[step]
        self.dots.set_edgecolors(
            [CONFLICT if hit else tint for hit, tint in zip(met, scene.tints, strict=True)]
        )
        self.trails.set_segments([camera(trail) / self.unit for trail in scene.trails(step)])
        places = self.axes.transData.transform(where)
        for text, point, place in zip(self.words, where, places, strict=False):
            text.xy = point
            text.set_visible(int((np.abs(places - place).max(axis=1) < CROWD).sum()) == 1)
        outlines = [shadow(zone, camera.basis[:2]) / self.unit + where[k] for k, zone in scene.kept(step)]
        self.zone.set_verts(outlines[:1])
        self.outlines.set_verts(outlines[1:])
        near = scene.meetings.at(step, 1)
        self.link.set_data(*(where[scene.pairs.craft[near[0]]].T if near else ([], [])))


class Flying:
    """Figure of the animation with its views and its time strip."""

    def __init__(self, paths: Any, names: Sequence[str] | None, zone: Any, frames: int) -> None:
        flown = crafts("paths", paths)
        self.called = short_names(names, len(flown))
        self.tints = colours(len(flown))
        self.pairs = Pairs.of(flown, zone, name="zone")
        start, end = min(path.start for path in flown), max(path.end for path in flown)
        self.closest = float(self.pairs.time[self.pairs.order[0]]) if self.pairs.order else start
        self.times = np.union1d(np.linspace(start, end, frames), [self.closest])
        self.tracks = [path.position(instants(path.start, path.end, path)) for path in flown]
        self.where = np.stack([held(path, self.times) for path in flown])
        self.meetings = Meetings(self.pairs, self.times)
        inside = self.meetings.ratios <= 1.0
        self.met = np.zeros((len(self.times), len(flown)), dtype=bool)
        for row, step in np.argwhere(inside).tolist():
            self.met[step, self.pairs.craft[row]] = True
        period = flown[0].orbit.period
        self.trail = min(TRAIL * (end - start), TURN * period)
        self.paths, self.ticks = flown, clock(flown[0], start, end)
        self.views = self.in_orbit() if flown[0].orbit.mean_motion else self.in_deep_space()
        self.strip(start, end)
        high = float(self.figure.get_figheight())
        self.clock = self.figure.text(0.985, 1 - 0.3 / high, "", ha="right", va="center", fontsize=TEXT + 2)
        self.clock.set(color=INK, fontweight="bold")
        self.story = self.figure.text(0.012, 1 - 0.3 / high, "", va="center", fontsize=TEXT, color=INK)
        plain(self.story, *self.called)

    @property
    def points(self) -> Floats:
        """All positions (M, 3) [m], extended by the zones."""
        points = np.vstack(self.tracks)
        sizes = [drawn(zone).extents for zone in dict.fromkeys(self.pairs.zone)]
        reach = np.max(sizes, axis=0, initial=0.0) if sizes else np.zeros(3)
        return np.vstack([points - reach, points + reach])

    def in_orbit(self) -> list[View]:
        """Return the views in the three planes and in space."""
        points = self.points
        self.figure, unit, panels = three_planes(points, 1.1, STRIP + 0.35)
        views = []
        for axes, camera, pair in panels:
            named = len(self.called) <= CALLED or (pair == [1, 2] and len(self.called) <= NAMED)
            views.append(View(axes, camera, unit.size, self, named))
        axes = space_corner(self.figure, panels[2][0], panels[1][0])
        window(axes, ORBITAL(points), ORBITAL, AXES, 0.1)
        framed(axes, "")
        return [*views, View(axes, ORBITAL, 1.0, self, False)]

    def in_deep_space(self) -> list[View]:
        """Return one oblique view."""
        high, points = 6.2, OBLIQUE(self.points)
        across, up = np.ptp(points, axis=0)
        wide = float(np.clip(1.2 * (high - FOOT) * across / (up or 1.0), 7.4, WIDTH))
        self.figure = sheet(high + UNDER + STRIP + 0.8, wide)
        axes = area(self.figure, 0.12, UNDER + STRIP + 0.2, wide - 0.24, high)
        window(axes, points, OBLIQUE, "xyz", 0.1)
        framed(axes, "")
        return [View(axes, OBLIQUE, 1.0, self, len(self.called) <= NAMED)]

    def strip(self, start: float, end: float) -> None:
        """Draw the minimum ratio of all pairs against time, with a moving cursor."""
        wide = float(self.figure.get_figwidth())
        axes = area(self.figure, 1.0, UNDER, wide - 1.25, STRIP)
        dress(axes)
        axes.set_xlim(self.ticks(start), self.ticks(end))
        axes.set_xlabel(f"time [{self.ticks.unit.name}]")
        if len(self.pairs):
            fine = min(4 * len(self.times), max(len(self.times), MOST // len(self.pairs)))
            some = self.pairs.time[self.pairs.order[:50]]
            times = np.unique(np.concatenate([np.linspace(start, end, fine), some]))
            least = Meetings(self.pairs, times).ratios.min(axis=0)
            axes.axhspan(-1, 1, color=ZONE, alpha=0.25, linewidth=0)
            axes.plot(self.ticks(times), np.where(least < np.inf, least, np.nan), color=INK, linewidth=1.6)
            known = least[least < np.inf]
            ratio_axis(axes, float(known.min(initial=np.inf)), float(known.max(initial=0.0)))
            axes.set_ylabel("closest\n[× zone]", fontsize=SMALL, color=INK)
            axes.yaxis.set_label_coords(-0.55 / (wide - 1.25), 0.5)
        else:
            axes.set_yticks([])
        self.cursor = axes.axvline(self.ticks(start), color=OTHER, linewidth=2.5)

    @property
    def artists(self) -> list[Artist]:
        """All moving artists."""
        return [*(one for view in self.views for one in view.artists), self.cursor, self.clock, self.story]

    def trails(self, step: int) -> list[Floats]:
        """Return the recent track (K, 3) [m] of each spacecraft."""
        now = self.times[step]
        found = []
        for path in self.paths:
            first, last = max(path.start, now - self.trail), min(path.end, now)
            found.append(path.position(np.linspace(first, last, 40)) if first < last else np.zeros((0, 3)))
        return found

    def kept(self, step: int) -> list[tuple[int, Zone]]:
        """Return the zones to draw, each with the index of its spacecraft; that of the closest pair is first.

        With few spacecraft, each has the zone between it and its nearest neighbour.
        """
        pairs, found = self.pairs, dict[int, Zone]()
        for k in self.meetings.at(step, None if len(self.called) <= NAMED else 1):
            one, other = pairs.craft[k].tolist()
            if not found:
                first = other if stays(pairs.paths, len(self.called), other, one) else one
                found[first] = pairs.zone[k]
            elif len(self.called) > 2:
                found.setdefault(one, pairs.zone[k])
                found.setdefault(other, pairs.zone[k])
        return list(found.items())

    def show(self, time: float) -> None:
        """Move all artists to the time [s] of a frame."""
        step = int(np.searchsorted(self.times, time))
        for view in self.views:
            view.show(step)
        self.cursor.set_xdata([self.ticks(time)] * 2)
        other = self.ticks.other
        more = f"  {time / other.size:.2f} {other.name}" if other is not None else ""
        self.clock.set_text(self.ticks.text(time) + more)
        for near in self.meetings.at(step, 1):
            one, two = (self.called[k] for k in self.pairs.craft[near])
            ratio = float(self.meetings.ratios[near, step])
            apart = np.linalg.norm(np.subtract(*self.where[self.pairs.craft[near], step]))
            self.story.set_text(f"closest now: {one} and {two}, {ratio_text(ratio)} × zone, {apart:.4g} m")


def formation_animation(
    paths: Path | Sequence[Path],
    file: str | PathLike[str] | IO[bytes],
    names: Sequence[str] | None = None,
    zone: OwnZone | Sequence[OwnZone | None] | PairZones | None = None,
    *,
    frames: int = 100,
    progress: Callable[[int, int], object] | None = None,
) -> None:
    """Write an animated GIF of a formation: every spacecraft with its trail.

    Paths in an orbit are shown in the three planes of the orbital frame and in space; paths in deep space in
    one oblique view. With zones, a line joins the closest pair, and its zone is filled. In a formation of up
    to 20, each spacecraft has the outline of the zone between it and its nearest neighbour. A spacecraft in
    conflict has a red edge. The strip below shows the minimum ratio of all pairs against time.

    Parameters
    ----------
    paths : Path or sequence of Path
        Path of shape (N,), such as the paths of a plan, or N paths.
    file : str, path-like or file of bytes
        Output file; an existing file is overwritten.
    names : sequence of str, optional
        Names of the spacecraft; default: their indices.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones, optional
        One zone for all spacecraft or one for each, combined for a pair as in `screen`; None: no zone of its
        own.
    frames : int, default 100
        Number of frames, at least 2, evenly spaced in time; one more at the closest approach, where the
        animation pauses.
    progress : callable of int and int, optional
        Function called with the number of finished frames and the total.

    Raises
    ------
    ValueError
        If `frames` is below 2, the number of names is wrong, two zones cannot be combined for a pair, or an
        argument has the wrong type.
    """
    filmed(file, frames, progress)
    found = reel(paths, names, zone, frames=frames)
    found.save(file, found.frames(slice(None), progress))


def reel(
    paths: Path | Sequence[Path],
    names: Sequence[str] | None = None,
    zone: OwnZone | Sequence[OwnZone | None] | PairZones | None = None,
    *,
    frames: int = 100,
) -> Reel:
    """Return the animation of `formation_animation` without drawing it."""
    scene = Flying(paths, names, zone, frames)
    waits = np.where((scene.times == scene.closest) & (len(scene.pairs) > 0), HOLD, PLAY)
    waits[-1] = LAST
    moments = list(zip(scene.times.tolist(), waits.tolist(), strict=True))
    pixels = WIDE if len(scene.called) <= NAMED else NARROW
    return Reel(scene.figure, lambda: scene.artists, scene.show, moments, pixels)
