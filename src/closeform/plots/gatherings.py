"""Gathering of lost spacecraft in three views, still or animated: from the Sun, oblique, and a close-up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import degrees, pi
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from closeform.arrays import Floats, instance, number, whole
from closeform.motion.arc import END, START
from closeform.plots.drawing import space
from closeform.plots.drawing.inputs import File, picture
from closeform.plots.drawing.moving import NARROW, PLAY, WIDE, name_moving, write_gif
from closeform.plots.drawing.palette import BEFORE, CONFLICT, FAINT, INK, OTHER
from closeform.plots.drawing.style import DASHED, headline, legend, sheet, wrapped
from closeform.plots.drawing.text import SMALL, plain, short_names, word
from closeform.search.gathering.join_rule import FORMATION, LOST
from closeform.search.gathering.result import Event, EventKind, Gathering
from closeform.search.leg import SPELLED, SUN, Leg
from closeform.search.search_errors import SearchErrors, errors_of_each
from closeform.search.slew_profile import ExecutedTurns

NORTH, EAST = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])  # up and right, as seen from the Sun
SUN_VIEW = space.Camera(np.array([EAST, NORTH, SUN]))
DIRECTIONS = {"x": EAST, "y": -NORTH, "z": -SUN}
NARROWEST, SPACIOUS = 0.035, 0.35  # of the time strip: bands for a short and a full phase name
FEW = 12  # maximum number of spacecraft that all have cones, shades and names
SHADE = "#c9ced6"
HOLD, LAST = 1200, 3000  # ms per frame: at a lock, at the end
STOPS = 12_000  # ms: maximum total pause at locks
SET_NAMES = {LOST: "lost", FORMATION: "formation set"}
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


Knots = tuple[Floats, Floats]  # times (K,) [s] and positions (K, 3) [m] of start, burns and end of a path


def knots_of(gathering: Gathering) -> list[Knots]:
    """Return the knots of the path of each spacecraft."""
    paths = [gathering.paths[k] for k in range(len(gathering.groups))]
    times = [np.append(path.arcs[:, START], path.arcs[-1, END]) for path in paths]
    return [(some, path.position(some)) for path, some in zip(paths, times, strict=True)]


@dataclass(frozen=True, eq=False)
class Moment:
    """Gathering at a `time` [s]: positions, attitudes, locks and sets of its spacecraft."""

    gathering: Gathering
    knots: Sequence[Knots]
    time: float

    @cached_property
    def positions(self) -> Floats:
        """Positions (N, 3) [m]."""
        return self.gathering.paths.position(self.time)

    @cached_property
    def attitudes(self) -> Floats:
        """Actual attitudes (N, 3, 3); columns are the body axes."""
        gathering = self.gathering
        return ExecutedTurns(gathering.search, gathering.groups, self.errors).attitudes(self.time)

    @cached_property
    def errors(self) -> SearchErrors:
        """Errors of each spacecraft (N,) relative to the search."""
        return errors_of_each(self.gathering.errors or SearchErrors(), (len(self.gathering.groups),))

    @cached_property
    def half_angles(self) -> Floats:
        """Half-angles (N,) [rad] of the sensor cones."""
        return np.asarray(self.gathering.search.sensor.half_angle + self.errors.half_angle)

    @property
    def leg(self) -> Leg:
        """Current leg of the search; the last one at the end."""
        legs = self.gathering.search.legs
        return next((leg for leg in legs if leg.start <= self.time < leg.end), legs[-1])

    @cached_property
    def locks(self) -> list[Event]:
        """Locks up to this time."""
        return [one for one in self.gathering.events if one.kind == EventKind.LOCK and one.time <= self.time]

    @cached_property
    def labels(self) -> Any:
        """Set of each spacecraft (N,): -1 lost, 0 the formation set, k >= 1 knowledge set k."""
        times = [event.time for event in self.gathering.events]
        return self.gathering.history[np.searchsorted(times, self.time, side="right")]

    @cached_property
    def trails(self) -> list[Floats]:
        """Track of each spacecraft so far, (K, 3) each: its start, its burns and its position now."""
        both = zip(self.knots, self.positions, strict=True)
        return [np.vstack([points[times < self.time], now]) for (times, points), now in both]


def clock_text(time: float) -> str:
    """Return a time [s] as minutes and seconds."""
    minutes, seconds = divmod(int(time + 0.5), 60)
    return f"{minutes:02d}:{seconds:02d}"


Cone = tuple[Floats, Floats, Floats, str]  # apex (3,), rim (K, 3) relative to it, shade (K, 3), and colour


def cones(axes: Axes, camera: space.Camera, some: Sequence[Cone], width: float) -> None:
    """Draw sensor cones and shades of spacecraft."""
    for apex, rim, shade, colour in some:
        mouth = camera(apex + rim)
        facing = 0.3 if camera.nearness(rim.mean(axis=0)) > 0.0 else 0.0
        edge: dict[str, Any] = {"edgecolor": tint(colour, 0.75), "linewidth": width}
        axes.add_artist(Polygon(space.solid(camera, apex, apex + rim), facecolor=tint(colour, 0.2)))
        axes.add_artist(Polygon(mouth, facecolor=tint(colour, facing), **edge))
        rays = [[camera(apex), tip] for tip in mouth[:-1:12]]
        axes.add_artist(LineCollection(rays, colors=[tint(colour, 0.6)], linewidths=0.6 * width))
        axes.add_artist(Polygon(camera(shade), facecolor=SHADE, edgecolor=INK, linewidth=width))


class Overview:
    """View of all spacecraft from one direction, at one scale for the whole gathering."""

    def __init__(
        self,
        axes: Axes,
        title: str,
        camera: space.Camera,
        gathering: Gathering,
        knots: Sequence[Knots],
        craft: int,
        called: Sequence[str],
    ) -> None:
        self.axes, self.camera = axes, camera
        self.gathering, self.few = gathering, len(gathering.groups) <= FEW
        groups, sensor = gathering.groups, gathering.search.sensor
        self.coned = sorted(range(len(groups)) if self.few else [craft], key=lambda k: groups[k])
        self.called = [called[k] for k in self.coned]
        points = np.vstack([points for _, points in knots])
        span = max(float(np.ptp(points, axis=0).max()), 10.0 * sensor.offset) or 10.0
        self.cone = min(sensor.range, (0.17 if self.few else 0.12) * span)
        self.shade, margin = max(sensor.offset, 0.017 * span), 0.9 * self.cone + sensor.offset
        space.space_axes(
            axes, np.vstack([camera(points) - margin, camera(points) + margin]), camera, DIRECTIONS
        )
        axes.set_title(title, loc="left", fontsize=SMALL, color=INK)

    def lines(self, lines: Sequence[Any], label: str, **look: Any) -> None:
        """Draw lines (K, 3) [m]."""
        self.axes.add_artist(LineCollection([self.camera(line) for line in lines], label=label, **look))

    def show(self, moment: Moment) -> None:
        """Draw everything at a moment."""
        where, offset = moment.positions, self.gathering.search.sensor.offset
        some: list[Cone] = []
        for k in self.coned:
            attitude, colour = moment.attitudes[k], space.GROUP_COLOURS[self.gathering.groups[k]]
            rim = space.ring(attitude[:, 2], float(moment.half_angles[k]), self.cone)
            shade = where[k] + space.ring(attitude[:, 0], pi / 2.0, self.shade)
            some.append((where[k] + offset * attitude[:, 2], rim, shade, colour))
        cones(self.axes, self.camera, some, 0.9)
        self.lines(moment.trails, "tracks", color=OTHER, linewidths=1.3 if self.few else 0.6)
        locked = [where[[event.first, event.second]] for event in moment.locks]
        self.lines(locked, "locks", color=INK, linewidths=1.6 if self.few else 0.6)
        if self.few:
            bends = self.camera(np.vstack([np.empty((0, 3)), *(trail[1:-1] for trail in moment.trails)]))
            self.axes.plot(*bends.T, ".", color=INK, markersize=5)
        flat, labels = self.camera(where), np.array([style_of(label) for label in moment.labels])
        for label, (marker, edge, face) in STYLES.items():
            look: dict[str, Any] = {"color": edge, "markerfacecolor": face, "markersize": 5.0}
            self.axes.plot(*flat[labels == label].T, marker, linestyle="", **look)
        name_moving(self.axes, flat[self.coned], self.called, [INK] * len(self.called))


class CloseUp:
    """Close-up of one spacecraft: its shade and normal, the sensor cone, and the sun line."""

    def __init__(self, axes: Axes, gathering: Gathering, craft: int, name: str) -> None:
        self.axes, self.gathering, self.craft = axes, gathering, craft
        space.fitted(axes, (-2.2, -1.8), (2.2, 2.2))
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set_color(OTHER)
        plain(axes.set_title(f"Close view: {name}", loc="left", fontsize=SMALL, color=INK))
        space.triad(axes, space.OBLIQUE, DIRECTIONS)
        sun = space.OBLIQUE(np.array([np.zeros(3), 2.05 * SUN]))
        axes.plot(*sun.T, color=OTHER, linestyle=DASHED, linewidth=1.2)
        axes.plot(*sun[1], "o", color=space.SUN_COLOUR, markeredgecolor=INK, markersize=11)
        word(axes, sun[1], "Sun", shift=(12, 0), ha="left")
        self.colour = space.GROUP_COLOURS[gathering.groups[craft]]

    def show(self, moment: Moment) -> None:
        """Draw the spacecraft in its attitude at a moment."""
        attitude, axes = moment.attitudes[self.craft], self.axes
        normal, boresight = attitude[:, 0], attitude[:, 2]
        offset = self.gathering.search.sensor.offset
        apex = boresight if offset > 0.0 else np.zeros(3)  # shade radius equals the offset
        rim = space.ring(boresight, float(moment.half_angles[self.craft]), 1.1)
        cones(axes, space.OBLIQUE, [(apex, rim, space.ring(normal, pi / 2.0), self.colour)], 1.2)
        look: dict[str, Any] = {"linewidth": 2.2, "marker": "o", "markevery": [1], "markersize": 3.5}
        axes.plot(*space.OBLIQUE([0.0 * normal, 1.25 * normal]).T, color=INK, **look)
        axes.plot(*space.OBLIQUE([apex, apex + 0.95 * boresight]).T, color=self.colour, **look)
        word(axes, space.OBLIQUE(1.45 * normal), "body x")
        word(axes, space.OBLIQUE(apex + 1.15 * boresight), "boresight", self.colour)
        leg, off_sun = moment.leg, float(np.arccos(np.clip(normal @ SUN, -1.0, 1.0)))
        axis = "the sun line" if leg.about == "sun line" else leg.about
        about = f"turning about\n{axis}" if leg.angle else "waiting"
        corner: dict[str, Any] = {"shift": (5, -5), "xycoords": "axes fraction", "ha": "left", "va": "top"}
        word(axes, (0, 1), f"{about}\nSun angle {degrees(off_sun):.1f}°", **corner)


def strip(axes: Axes, gathering: Gathering) -> None:
    """Draw the time strip of the whole gathering with its phases and locks."""
    end = gathering.duration or 1.0
    axes.set(xlim=(0.0, end), ylim=(0.0, 1.0), xticks=[], yticks=[])
    axes.spines[:].set_color(OTHER)
    for k, (name, _, first, last) in enumerate(gathering.search.phases):
        if first < end:
            share = (min(last, end) - first) / end
            axes.axvspan(first, min(last, end), facecolor=FAINT, alpha=0.35 + 0.5 * (k % 2), linewidth=0)
            text = f"{name}: {SPELLED[name]} search" if share > SPACIOUS else name
            if share > NARROWEST:
                word(axes, (first, 0.5), text, shift=(5, 0), ha="left")
    times = sorted({event.time for event in gathering.events if event.kind == EventKind.LOCK})
    apart, free = 0.06 * end, -end  # between two labels
    axes.vlines(times, 0.0, 1.0, color=INK, linewidth=1.4 if len(times) <= FEW else 0.6)
    named = [time for time in times if time >= free and (free := time + apart)]
    axes.set_xticks(named, [clock_text(time) for time in named], fontsize=SMALL, color=INK)
    axes.set_xlabel("locks [min:s]", fontsize=SMALL, color=INK)


def tint(colour: str, share: float) -> tuple[float, float, float, float]:
    """Return a colour as red, green, blue and opacity."""
    return (*to_rgb(colour), share)


class ThreeViews:
    """Figure with its three views and time strip; `show` draws the moving parts at a time."""

    def __init__(self, gathering: Gathering, craft: int, names: Sequence[str] | None) -> None:
        count = len(gathering.groups)
        instance("craft", craft, int, np.integer)
        if isinstance(craft, bool) or not 0 <= craft < count:
            raise ValueError(f"craft: must be from 0 to {count - 1}, got {craft!r}")
        self.gathering, self.names = gathering, short_names(names, count)
        self.knots = knots_of(gathering)
        self.figure = sheet(7.9)
        axes = self.figure.subplot_mosaic(
            [["oblique", "sun"], ["oblique", "close"], ["strip", "strip"]],
            width_ratios=[0.58, 0.42],
            height_ratios=[0.5, 0.5, 0.06],
        )
        headline(self.figure, "Mg")  # holds the place of a line
        shared = (gathering, self.knots, craft, self.names)
        self.oblique = Overview(axes["oblique"], "Oblique view", space.OBLIQUE, *shared)
        sun = Overview(axes["sun"], "Sun view", SUN_VIEW, *shared)
        self.parts = (self.oblique, sun, CloseUp(axes["close"], gathering, craft, self.names[craft]))
        self.strip = axes["strip"]
        strip(self.strip, gathering)
        handles = self.legend()
        legend(self.figure, handles, [str(one.get_label()) for one in handles], ncols=4, columnspacing=1.6)

    def show(self, time: float) -> str:
        """Draw all parts at a time [s], and return the headline."""
        moment = Moment(self.gathering, self.knots, time)
        for part in self.parts:
            part.show(moment)
        look: dict[str, Any] = {"linewidth": 3.0, "clip_on": False, "in_layout": False}
        self.strip.plot([time, time], [-0.15, 1.15], color=CONFLICT, **look)
        past = [event for event in self.gathering.events if event.time <= time]
        said = self.last_event(past) if past else "all spacecraft are lost"
        return wrapped(self.figure, f"{clock_text(time)}  {moment.leg.phase}: {said}")

    def last_event(self, past: list[Event]) -> str:
        """Return the last lock, or the last separate burn after it, as text."""
        marked = [event for event in past if event.kind != EventKind.BURN]
        last = [event for event in marked if event.time == marked[-1].time]
        event = max(last, key=lambda one: one.kind == EventKind.LOCK)
        when, name = clock_text(event.time), self.names[event.first]
        if event.kind == EventKind.LOCK:
            labels = Moment(self.gathering, self.knots, event.time).labels
            held = [self.names[k] for k in np.flatnonzero(labels == event.label)]
            what = "formation set" if event.label == FORMATION else f"knowledge set {event.label}"
            members = ", ".join(held) if len(held) <= 8 else f"{len(held)} craft"
            return f"{name} and {self.names[event.second]} lock at {when}; {what}: {members}"
        size = 1e3 * float(np.linalg.norm(event.delta_v))
        why = "to keep clear" if event.kind == EventKind.CORRECTION else "to leave the near field"
        return f"{name} burns {size:.3g} mm/s at {when} {why}"

    def legend(self) -> list[Artist]:
        """Return legend handles for marks, tracks, locks and cones; only for the sets that occur."""
        labels = {event.label for event in self.gathering.events if event.kind == EventKind.LOCK}
        lines: list[tuple[str, dict[str, Any]]] = []
        for style, (marker, edge, face) in STYLES.items():
            several = sorted(label for label in labels if label > FORMATION and style_of(label) == style)
            if style in SET_NAMES or several:
                name = SET_NAMES.get(style) or "knowledge set " + ", ".join(map(str, several[:3]))
                name += ", …" if len(several) > 3 else ""
                mark = {"marker": marker, "color": edge, "markerfacecolor": face, "markersize": 7}
                lines.append((name, mark | {"linestyle": ""}))
        view = self.oblique
        way = {"color": OTHER, "linewidth": 1.3, "marker": "." if view.few else ""}
        bend = {"markerfacecolor": INK, "markeredgecolor": INK}
        lines.append(("track so far, burns" if view.few else "track so far", way | bend))
        lines.append(("have locked", {"color": INK, "linewidth": 1.6}))
        handles: list[Artist] = [Line2D([], [], label=name, **look) for name, look in lines]
        for group, colour in space.GROUP_COLOURS.items():
            name = f"cone of {group}, cut at {float(f'{view.cone:.2g}'):g} m"
            handles.append(Patch(facecolor=tint(colour, 0.3), edgecolor=colour, label=name))
        return handles


@picture("`time` is outside the gathering, or there is no such spacecraft", source="H03 figures 9 to 11")
def three_views(
    gathering: Gathering, time: float, craft: int = 0, names: Sequence[str] | None = None
) -> Figure:
    """Plot a gathering at one time in three views: H03 figures 9 to 11.

    The views are oblique, from the Sun, and a close-up of one spacecraft. The close-up shows its shade, whose
    radius is the offset of the sensor, and the sensor cone. Cones have the colour of their group and marks
    the style of their set: lost, formation set or a knowledge set. Trails lead from the start and bend at
    burns. The scale is the same for all times of a gathering. For more than 12 spacecraft only the selected
    one has a cone, shade and name, and only locks that joined sets are drawn.

    Parameters
    ----------
    time : float [s]
        Time from the start of the search, up to the duration of the gathering.
    craft : int, default 0
        Index of the spacecraft in the close-up.
    """
    if not 0.0 <= number("time", time) <= gathering.duration:
        raise ValueError(f"time: must lie in the gathering, from 0 to {gathering.duration:g} s, got {time:g}")
    views = ThreeViews(gathering, craft, names)
    views.figure.texts[0].set_text(views.show(time))
    return views.figure


@picture("`frames` is below 2, or there is no such spacecraft", source="H03 figures 9 to 11")
def animation(
    gathering: Gathering,
    file: File,
    craft: int = 0,
    names: Sequence[str] | None = None,
    *,
    frames: int = 150,
) -> None:
    """Write an animated GIF of a gathering in three views, as in the simulation of H03.

    Parameters
    ----------
    craft : int, default 0
        Index of the spacecraft in the close-up, as in `three_views`.
    frames : int, default 150
        Number of frames, at least 2, evenly spaced in time; one more at each lock, where the animation
        pauses, as it does at the end.
    """
    whole("frames", frames, 2)
    views = ThreeViews(gathering, craft, names)
    pixels = WIDE if len(gathering.groups) <= FEW else NARROW
    write_gif(file, views.figure, views.show, schedule(gathering, frames), pixels)


def schedule(gathering: Gathering, frames: int) -> list[tuple[float, int]]:
    """Return the times [s] of the frames with their durations [ms]."""
    locks = np.unique([event.time for event in gathering.events if event.kind == EventKind.LOCK])
    times = np.unique(np.concatenate([np.linspace(0.0, gathering.duration, frames), locks]))
    stop = min(HOLD, STOPS // max(1, len(locks)) // 10 * 10)
    stays = np.where(np.isin(times, locks), max(stop, PLAY), PLAY)
    stays[-1] = LAST
    return list(zip(times.tolist(), stays.tolist(), strict=True))
