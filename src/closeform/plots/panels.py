"""Panels of a gathering figure: views of all spacecraft, a close-up of one, and a time strip."""

from collections.abc import Sequence
from math import degrees, pi
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.transforms import blended_transform_factory

from closeform.arrays import Floats
from closeform.plots.camera import (
    GROUP_COLOURS,
    OBLIQUE,
    SUN_COLOUR,
    Camera,
    beside,
    framed,
    framing,
    ring,
    scale_bar,
    solid,
    stage,
    triad,
    word,
)
from closeform.plots.fonts import plain
from closeform.plots.palette import BEFORE, FAINT, INK, OTHER
from closeform.plots.snapshot import Knots, Moment, clock_text
from closeform.plots.style import DASHED, SMALL
from closeform.search.gather_result import EventKind, Gathering
from closeform.search.leg import SPELLED, SUN
from closeform.search.sets import FORMATION, LOST

NORTH, EAST = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])  # up and right, as seen from the Sun
SUN_VIEW = Camera(np.array([EAST, NORTH, SUN]))
DIRECTIONS = {"x": EAST, "y": -NORTH, "z": -SUN}
NARROW, SPACIOUS = 0.035, 0.35  # of the time strip: bands for a short and a full phase name
FEW = 12  # maximum number of spacecraft that all have cones, shades and names
STYLES: dict[int, tuple[str, str, str]] = {  # of sets: marker, edge and face colour
    LOST: ("o", BEFORE, "white"),
    FORMATION: ("o", INK, INK),
    1: ("s", "#00614a", "#009E73"),
    2: ("D", "#7a2a7a", "#CC79A7"),
    3: ("^", "#8a6d00", "#F0E442"),
    4: ("v", "#1f6f9c", "#56B4E9"),
}


def style_of(label: int) -> int:
    """Return the style key of a set; knowledge sets beyond the fourth reuse the four styles."""
    return label if label <= FORMATION else 1 + (label - 1) % 4


class Overview:
    """View of all spacecraft from one direction, at one scale for the whole gathering."""

    def __init__(
        self,
        figure: Figure,
        place: tuple[float, float, float, float],
        title: str,
        camera: Camera,
        gathering: Gathering,
        knots: Sequence[Knots],
        craft: int,
        names: Sequence[str],
    ) -> None:
        self.camera, self.gathering, self.names = camera, gathering, names
        self.few = len(gathering.groups) <= FEW
        self.coned = range(len(gathering.groups)) if self.few else [craft]
        points, sensor = np.vstack([one.points for one in knots]), gathering.search.sensor
        span = max(float(np.ptp(points, axis=0).max()), 10.0 * sensor.offset) or 10.0
        self.cone = min(sensor.range, (0.17 if self.few else 0.12) * span)
        self.shade = max(sensor.offset, 0.017 * span)
        margin = 0.9 * self.cone + sensor.offset
        ends = np.vstack([camera(points) - margin, camera(points) + margin])
        room = 1.06 if self.few else 1.25
        wide, high = figure.get_size_inches() * place[2:]
        middle, width = framing(ends, wide, high, room)
        self.axes = stage(figure, place, middle, width)
        framed(self.axes, title)
        scale_bar(self.axes, width)
        self.pairs = self._pairs()

        self.trails = LineCollection([], colors=OTHER, linewidths=1.3 if self.few else 0.6)
        self.bodies = PolyCollection([], linewidths=0.0)
        self.mouths = PolyCollection([], linewidths=0.9)
        self.edges = LineCollection([], linewidths=0.5)
        self.shades = PolyCollection([], facecolors="#c9ced6", edgecolors=INK, linewidths=0.8)
        self.past_look: dict[str, Any] = {"color": BEFORE, "linewidth": 1.0, "linestyle": DASHED}
        self.now_look: dict[str, Any] = {"color": INK, "linewidth": 2.4}
        if not self.few:
            self.past_look = {"color": OTHER, "linewidth": 0.4}
            self.now_look = {"color": INK, "linewidth": 0.7}
        self.past = LineCollection([], **self.past_look)
        self.now = LineCollection([], **self.now_look)
        for collection in (
            self.bodies,
            self.mouths,
            self.edges,
            self.trails,
            self.past,
            self.now,
            self.shades,
        ):
            self.axes.add_collection(collection, autolim=False)
        size = 5.0 if self.few else 4.5
        self.marks = {
            label: self.axes.plot([], [], marker, color=edge, markerfacecolor=face, markersize=size)[0]
            for label, (marker, edge, face) in STYLES.items()
        }
        (self.kinks,) = self.axes.plot([], [], ".", color=INK, markersize=5 if self.few else 0)
        self.words = [plain(word(self.axes, (0, 0), names[k])) for k in self.coned]  # moved by `beside`
        stacked(self.artists)

    @property
    def artists(self) -> list[Artist]:
        """Moving artists, from back to front."""
        lines = [
            self.bodies,
            self.mouths,
            self.edges,
            self.trails,
            self.past,
            self.kinks,
            self.shades,
            self.now,
        ]
        return [*lines, *self.marks.values(), *self.words]

    def _pairs(self) -> Any:
        """Return pairs whose locks are drawn: all of A with B if few, otherwise those that joined sets."""
        groups = self.gathering.groups
        if self.few:
            return np.array([(i, j) for i, a in enumerate(groups) for j, b in enumerate(groups) if a < b])
        locks = [event for event in self.gathering.events if event.kind == EventKind.LOCK]
        return np.array([(event.first, event.second) for event in locks]).reshape(-1, 2)

    def show(self, moment: Moment) -> None:
        """Move all artists to a moment."""
        where, camera = moment.positions, self.camera
        self._cones(moment, where)
        trails = moment.trails
        self.trails.set_segments([camera(trail) for trail in trails])
        bends = camera(np.vstack([np.empty((0, 3)), *(trail[1:-1] for trail in trails)]))
        self.kinks.set_data(bends[:, 0], bends[:, 1])
        seen = moment.in_lock(self.pairs)
        met = {frozenset((event.first, event.second)) for event in moment.locks}
        known = np.array([frozenset(pair) in met for pair in self.pairs.tolist()], dtype=bool)
        self.past.set_segments(list(camera(where[self.pairs[known & ~seen]])))
        self.now.set_segments(list(camera(where[self.pairs[seen if self.few else seen & known]])))
        flat, labels = camera(where), np.array([style_of(label) for label in moment.labels])
        for label, mark in self.marks.items():
            mark.set_data(*flat[labels == label].T)
        beside(self.axes, self.words, flat[list(self.coned)])

    def _cones(self, moment: Moment, where: Floats) -> None:
        """Move the sensor cones and the shades to the attitudes of their spacecraft."""
        sensor, camera = self.gathering.search.sensor, self.camera
        bodies, mouths, edges, shades, colours, facing = [], [], [], [], [], []
        for k in sorted(self.coned, key=lambda k: self.gathering.groups[k]):
            attitude, colour = moment.attitudes[k], GROUP_COLOURS[self.gathering.groups[k]]
            rim = ring(attitude[:, 2], float(moment.half_angles[k]), self.cone)
            apex = camera(where[k] + sensor.offset * attitude[:, 2])
            bodies.append(apex + solid(camera, np.zeros(3), rim))
            mouths.append(apex + camera(rim))
            edges += [np.array([apex, apex + tip]) for tip in camera(rim[:-1:12])]
            shades.append(camera(where[k]) + camera(ring(attitude[:, 0], pi / 2.0, self.shade)))
            colours.append(colour)
            facing.append(0.3 if camera.nearness(attitude[:, 2]) > 0.05 else 0.0)
        self.bodies.set_verts(bodies)
        self.bodies.set_facecolor([tint(colour, 0.2) for colour in colours])
        self.mouths.set_verts(mouths)
        self.mouths.set_facecolor(
            [tint(colour, share) for colour, share in zip(colours, facing, strict=True)]
        )
        self.mouths.set_edgecolor([tint(colour, 0.75) for colour in colours])
        self.edges.set_segments(edges)
        self.edges.set_color([tint(colour, 0.6) for colour in colours for _ in range(12)])
        self.shades.set_verts(shades)


class CloseUp:
    """Close-up of one spacecraft: its shade and normal, the sensor cone, and the sun line."""

    def __init__(
        self,
        figure: Figure,
        place: tuple[float, float, float, float],
        gathering: Gathering,
        craft: int,
        name: str,
    ) -> None:
        self.gathering, self.craft, self.camera = gathering, craft, OBLIQUE
        self.axes = stage(figure, place, (-0.45, 0.0), 7.0)
        framed(self.axes, f"Close view: {name}")
        sun = self.camera(np.array([np.zeros(3), 2.05 * SUN]))
        self.axes.plot(*sun.T, color=OTHER, linestyle=DASHED, linewidth=1.2)
        self.axes.plot(*sun[1], "o", color=SUN_COLOUR, markeredgecolor=INK, markersize=11)
        word(self.axes, sun[1], "Sun", shift=(12, 0), ha="left")
        low, left = self.axes.get_ylim()[0], self.axes.get_xlim()[0]
        triad(self.axes, self.camera, np.array([left + 0.65, low + 0.9]), 0.5, DIRECTIONS)
        colour = GROUP_COLOURS[gathering.groups[craft]]
        self.body = PolyCollection([], facecolors=[tint(colour, 0.2)], linewidths=0.0)
        self.mouth = PolyCollection([], edgecolors=[tint(colour, 0.8)], linewidths=1.2)
        self.shade = PolyCollection([], facecolors="#c9ced6", edgecolors=INK, linewidths=1.2)
        self.arrows = LineCollection([], colors=[INK, colour], linewidths=[2.0, 2.4])
        for collection in (self.body, self.mouth, self.shade, self.arrows):
            self.axes.add_collection(collection, autolim=False)
        self.edges = LineCollection([], colors=[tint(colour, 0.6)], linewidths=0.6)
        self.axes.add_collection(self.edges, autolim=False)
        (self.heads,) = self.axes.plot([], [], "o", color=INK, markersize=3.5)
        self.words = [word(self.axes, (0, 0), "body x"), word(self.axes, (0, 0), "boresight", colour)]
        look: dict[str, Any] = {"ha": "left", "va": "top", "fontsize": SMALL, "color": INK}
        self.turn = self.axes.text(0.02, 0.87, "", transform=self.axes.transAxes, **look)
        stacked(self.artists)

    @property
    def artists(self) -> list[Artist]:
        """Moving artists, from back to front."""
        return [
            self.body,
            self.mouth,
            self.edges,
            self.shade,
            self.arrows,
            self.heads,
            *self.words,
            self.turn,
        ]

    def show(self, moment: Moment) -> None:
        """Turn the spacecraft to its attitude at a moment."""
        group = self.gathering.groups[self.craft]
        attitude, camera = moment.attitudes[self.craft], self.camera
        normal, boresight = attitude[:, 0], attitude[:, 2]
        sensor = self.gathering.search.sensor
        apex = boresight if sensor.offset > 0.0 else np.zeros(3)  # shade radius equals the offset
        rim = apex + ring(boresight, float(moment.half_angles[self.craft]), 1.1)
        self.body.set_verts([solid(camera, apex, rim)])
        self.mouth.set_verts([camera(rim)])
        self.edges.set_segments([camera(np.array([apex, tip])) for tip in rim[:-1:12]])
        near = camera.nearness(boresight) > 0.05
        self.shade.set_zorder(self.body.get_zorder() - 0.1 if near else self.edges.get_zorder() + 0.05)
        share = 0.3 if near else 0.0
        self.mouth.set_facecolor([tint(GROUP_COLOURS[group], share)])
        self.shade.set_verts([camera(ring(normal, pi / 2.0))])
        tips = np.array([1.25 * normal, apex + 0.95 * boresight])
        roots = np.array([np.zeros(3), apex])
        self.arrows.set_segments(list(camera(np.stack([roots, tips], axis=1))))
        self.heads.set_data(*camera(tips).T)
        for text, tip in zip(self.words, camera(tips + 0.2 * np.array([normal, boresight])), strict=True):
            text.xy = tip
        self.turn.set_text(self.doing(moment, float(np.arccos(np.clip(normal @ SUN, -1.0, 1.0)))))

    @staticmethod
    def doing(moment: Moment, off_sun: float) -> str:
        """Return the current turn, and the angle between the shade's normal and the Sun, as text."""
        leg = moment.leg
        axis = "the sun line" if leg.about == "sun line" else leg.about
        about = f"turning about\n{axis}" if leg.angle else "waiting"
        return f"{about}\nSun angle {degrees(off_sun):.1f}°"


class Strip:
    """Time strip of the whole gathering with its phases, locks and a cursor."""

    def __init__(
        self, figure: Figure, place: tuple[float, float, float, float], gathering: Gathering
    ) -> None:
        self.axes = axes = figure.add_axes(place)
        axes.set_yticks([])
        axes.set_xticks([])
        end = gathering.duration or 1.0
        axes.set_xlim(0.0, end)
        axes.set_ylim(0.0, 1.0)
        for spine in axes.spines.values():
            spine.set_color(OTHER)
        for k, (name, _, first, last) in enumerate(gathering.search.phases):
            if first < end:
                axes.axvspan(
                    first, min(last, end), facecolor=FAINT, alpha=0.35 + 0.5 * (k % 2), linewidth=0.0
                )
                share = (min(last, end) - first) / end
                told = f"{name}: {SPELLED[name]} search" if share > SPACIOUS else name
                if share > NARROW:
                    word(axes, (first, 0.5), told, shift=(5, 0), ha="left")
        above = blended_transform_factory(axes.transData, axes.transAxes)
        times = sorted({event.time for event in gathering.events if event.kind == EventKind.LOCK})
        free = [-1.0, -1.0]  # start time of the free space in each row
        for time in times:
            axes.axvline(time, color=INK, linewidth=1.4 if len(times) <= FEW else 0.6)
            row = next((k for k in (0, 1) if time >= free[k]), None)
            if row is not None:
                free[row] = time + (0.06 if time >= 0.03 * end else 0.09) * end
                edge = "left" if time < 0.03 * end else ("right" if time > 0.97 * end else "center")
                look: dict[str, Any] = {"transform": above, "ha": edge, "fontsize": SMALL, "color": INK}
                axes.text(time, 1.12 + 0.75 * row, clock_text(time), **look)
        (self.cursor,) = axes.plot([], [], color="#D55E00", linewidth=3.0, clip_on=False)

    @property
    def artists(self) -> list[Artist]:
        """Moving artists."""
        return [self.cursor]

    def show(self, moment: Moment) -> None:
        """Move the cursor."""
        self.cursor.set_data([moment.time, moment.time], [-0.15, 1.15])


def stacked(artists: Sequence[Artist]) -> None:
    """Set the drawing order of artists from back to front."""
    for k, artist in enumerate(artists):
        artist.set_zorder(3.0 + 0.1 * k)


def tint(colour: str, share: float) -> tuple[float, float, float, float]:
    """Return a colour as red, green, blue and opacity."""
    red, green, blue = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return red, green, blue, share
