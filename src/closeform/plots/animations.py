"""Animation of a formation, with its closest pair and the minimum clearance ratio against time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from closeform.arrays import Floats, whole
from closeform.conflicts.flight import ALL_PAIRS
from closeform.motion.path import Path
from closeform.plots.drawing import space
from closeform.plots.drawing.charts import Curve, Panel, draw
from closeform.plots.drawing.inputs import File, Zones, crafts, picture
from closeform.plots.drawing.moving import NARROW, PLAY, WIDE, name_moving, write_gif
from closeform.plots.drawing.pairs import Pairs, places_at, ratio_text
from closeform.plots.drawing.palette import CONFLICT, INK, OTHER, ZONE, colours, dark
from closeform.plots.drawing.style import dress, headline, sheet, wrapped
from closeform.plots.drawing.text import SMALL, short_names
from closeform.plots.drawing.units import clock, instants
from closeform.plots.paths import NAMED, carries
from closeform.zones.outlines import drawn, shadow

HOLD, LAST = 1600, 2400  # ms per frame: at the closest approach, at the end
TRAIL, TURN = 0.25, 0.5  # length of a trail: share of the total duration, but at most so many orbits
FEW = 8  # maximum number of spacecraft with names in every view; more have names in one view
STRIP = 1.6  # inches: height of the time strip with its labels
MOST = 2_000_000  # maximum number of clearance ratios in memory, for the curve


@picture("`frames` is below 2")
def formation_animation(
    paths: Path | Sequence[Path],
    file: File,
    names: Sequence[str] | None = None,
    zone: Zones = None,
    *,
    frames: int = 100,
) -> None:
    """Write an animated GIF of a formation: every spacecraft with its trail.

    Paths in an orbit are shown in the three planes of the orbital frame and in space; paths in deep space in
    one oblique view. With zones, a line joins the closest pair, and its zone is filled. In a formation of up
    to 20, each spacecraft has the outline of the zone between it and its nearest neighbour. A spacecraft in
    conflict has a red edge. The strip below shows the minimum ratio of all pairs against time; of more than
    447 spacecraft, only the closest pairs count.

    Parameters
    ----------
    frames : int, default 100
        Number of frames, at least 2, evenly spaced in time; one more at the closest approach, where the
        animation pauses.
    """
    whole("frames", frames, 2)
    film = FormationFilm(crafts("paths", paths), names, zone)
    start, end, closest = film.start, film.end, film.closest
    times = np.union1d(np.linspace(start, end, frames), [start if closest is None else closest])
    waits = np.where(times == closest, HOLD, PLAY)
    waits[-1] = LAST
    moments = list(zip(times.tolist(), waits.tolist(), strict=True))
    write_gif(file, film.figure, film.show, moments, WIDE if len(film.called) <= NAMED else NARROW)


class FormationFilm:
    """Figure of the animation of a formation, with its views and its time strip."""

    def __init__(self, paths: list[Path], names: Sequence[str] | None, zone: Any) -> None:
        self.paths, self.pairs = paths, Pairs.of(paths, zone, name="zone", most=ALL_PAIRS)
        self.called, self.tints = short_names(names, len(paths)), colours(len(paths))
        self.start, self.end = min(path.start for path in paths), max(path.end for path in paths)
        self.closest = float(self.pairs.time[self.pairs.order[0]]) if self.pairs.order else None
        orbit, tracks = (
            paths[0].orbit,
            [path.position(instants(path.start, path.end, path)) for path in paths],
        )
        self.trail = min(TRAIL * (self.end - self.start), TURN * orbit.period)
        self.ticks = clock(paths[0], self.start, self.end)
        reach = np.max([np.zeros(3), *(drawn(one).extents for one in dict.fromkeys(self.pairs.zone))], axis=0)
        points = np.vstack([np.vstack(tracks) + sign * reach for sign in (-1.0, 1.0)])
        self.views: list[tuple[Axes, space.Camera, float]]
        if np.isfinite(orbit.period):
            self.figure, unit, ((*planes, oblique),) = space.three_planes(points, below=STRIP)
            space.space_axes(oblique, space.ORBITAL(points), space.ORBITAL, space.AXES)
            self.views = [
                (axes, camera, unit.size) for axes, (_, camera) in zip(planes, space.PLANES, strict=True)
            ]
            self.views.append((oblique, space.ORBITAL, 1.0))
            strip = self.figure.add_subplot(planes[0].get_subplotspec().get_gridspec()[-1, :])  # type: ignore[union-attr]
        else:
            self.figure = sheet(8.2, 8.4)
            view, strip = self.figure.subplots(2, 1, height_ratios=[6.6, STRIP])
            space.space_axes(view, space.OBLIQUE(points), space.OBLIQUE, space.INERTIAL)
            self.views = [(view, space.OBLIQUE, 1.0)]
        count = len(paths)
        self.named = self.views[:3] if count <= FEW else self.views[:2][-1:] if count <= NAMED else []
        faint = np.column_stack([self.tints[:, :3], np.full(count, 0.22)])
        for axes, camera, size in self.views:
            lines = [camera(track) / size for track in tracks]
            still: dict[str, Any] = {"linewidths": 1.2 if count <= NAMED else 0.8, "zorder": 1.5}
            axes.add_collection(LineCollection(lines, colors=faint, **still))
        self.strip = strip
        self.draw_strip(strip)
        headline(self.figure, "Mg\nMg")  # holds the place of two lines

    def draw_strip(self, axes: Axes) -> None:
        """Draw the minimum ratio of all pairs against time."""
        dress(axes)
        if len(self.pairs):
            fine = int(np.clip(MOST // len(self.pairs), 100, 400))
            some = self.pairs.time[self.pairs.order[:50]]
            times = np.unique(np.concatenate([np.linspace(self.start, self.end, fine), some]))
            parts = np.array_split(times, 1 + len(times) * len(self.pairs) // MOST)
            least = np.concatenate([self.pairs.ratios(some).min(axis=0) for some in parts])
            curve = Curve(times, np.where(least < np.inf, least, np.nan), colour=INK, width=1.6)
            draw(axes, Panel("closest\n[× zone]", [curve], 1.0, "", "ratio"), self.ticks, [], [])
            axes.yaxis.label.set_fontsize(SMALL)
        else:
            axes.set_yticks([])
        axes.set_xlim(self.ticks(self.start), self.ticks(self.end))
        axes.set_xlabel(f"time [{self.ticks.unit.name}]")

    def trails(self, now: float) -> dict[int, Floats]:
        """Return the recent tracks (K, 3) [m] by the index of their spacecraft."""
        spans = [(max(path.start, now - self.trail), min(path.end, now)) for path in self.paths]
        moving = {k: span for k, span in enumerate(spans) if span[0] < span[1]}
        return {k: self.paths[k].position(np.linspace(*span, 40)) for k, span in moving.items()}

    def kept(self, ratios: Floats, near: int) -> dict[int, Any]:
        """Return the zones to draw by the index of their spacecraft, that of the closest pair first.

        If there are few spacecraft, a zone is drawn around each: that of the pair with its nearest neighbour.
        """
        pairs = self.pairs
        one, other = pairs.craft[near].tolist()
        found = {other if carries(pairs.paths, len(self.called), other, one) else one: pairs.zone[near]}
        if 2 < len(self.called) <= NAMED:
            for k in np.argsort(ratios, kind="stable")[1:].tolist():
                for craft in pairs.craft[k].tolist() if ratios[k] < np.inf else ():
                    found.setdefault(craft, pairs.zone[k])
        return found

    def show(self, time: float) -> str:
        """Draw zones, trails and spacecraft at a time [s] in all views; return the headline."""
        where, ratios = (
            places_at(self.pairs.paths, np.array([time]))[:, 0],
            self.pairs.ratios(np.array([time]))[:, 0],
        )
        thin, pairs = len(self.called) > NAMED, self.pairs
        near = int(ratios.argmin()) if ratios.min(initial=np.inf) < np.inf else None
        zones = {} if near is None else self.kept(ratios, near)
        met = set(pairs.craft[ratios <= 1.0].ravel().tolist())
        edges = [CONFLICT if k in met else tint for k, tint in enumerate(self.tints)]
        tints, trails = [dark(tint) for tint in self.tints], self.trails(time)
        for axes, camera, size in self.views:
            at = camera(where) / size
            outlines = [shadow(zone, camera.basis[:2]) / size + at[k] for k, zone in zones.items()]
            axes.add_artist(PolyCollection(outlines[:1], facecolor=ZONE, edgecolor=ZONE, alpha=0.45))
            axes.add_artist(PolyCollection(outlines[1:], facecolor="none", edgecolor=ZONE, linewidth=0.9))
            lines = [camera(line) / size for line in trails.values()]
            look: dict[str, Any] = {"colors": self.tints[list(trails)], "linewidths": 1.2 if thin else 2.4}
            axes.add_artist(LineCollection(lines, **look))
            if near is not None:
                axes.plot(*at[pairs.craft[near]].T, color=INK, linewidth=1.0)
            dots: dict[str, Any] = {"s": 14.0 if thin else 40.0, "linewidths": 1.8, "zorder": 4}
            axes.scatter(at[:, 0], at[:, 1], c=self.tints, edgecolors=edges, **dots)
            if any(axes is one for one, *_ in self.named):
                name_moving(axes, at, self.called, tints)
        self.strip.axvline(self.ticks(time), color=OTHER, linewidth=2.5)
        return wrapped(self.figure, self.story(time, where, near, ratios))

    def story(self, time: float, where: Floats, near: int | None, ratios: Floats) -> str:
        """Return the time and the closest pair as text."""
        other = self.ticks.other
        said = self.ticks.text(time) + (f", {time / other.size:.2f} {other.name}" if other else "")
        if near is None:
            return said
        pair = self.pairs.craft[near]
        both, apart = " and ".join(self.called[k] for k in pair), np.linalg.norm(np.subtract(*where[pair]))
        return f"{said}\nclosest now: {both}, {ratio_text(float(ratios[near]))} × zone, {apart:.4g} m"
