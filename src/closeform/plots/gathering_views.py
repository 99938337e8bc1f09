"""Three views of a gathering, still or animated: from the Sun, oblique, and a close-up (H03 figures 9-11)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike
from typing import IO, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from closeform.arrays import instance, number
from closeform.plots.camera import GROUP_COLOURS, OBLIQUE, triad
from closeform.plots.fonts import plain, short_names
from closeform.plots.inputs import filmed
from closeform.plots.palette import INK, OTHER
from closeform.plots.panels import DIRECTIONS, FEW, STYLES, SUN_VIEW, CloseUp, Overview, Strip, style_of, tint
from closeform.plots.reel import Reel
from closeform.plots.snapshot import Knots, Moment, clock_text
from closeform.plots.style import SMALL, TEXT, sheet
from closeform.search.gather_result import Event, EventKind, Gathering
from closeform.search.sets import FORMATION, LOST

SET_NAMES = {LOST: "lost", FORMATION: "formation set"}
WIDE, NARROW = 900, 720  # width in pixels for few and for many spacecraft; many moving lines make large files
PLAY, HOLD, LAST = 80, 1200, 3000  # ms per frame: in motion, at a lock, at the end
STOPS = 12_000  # ms: maximum total pause at locks


class ThreeViews:
    """Figure with its three views and time strip; `show` moves them to a time."""

    def __init__(self, gathering: Gathering, craft: int, names: Sequence[str] | None) -> None:
        count = len(gathering.groups)
        instance("craft", craft, int, np.integer)
        if isinstance(craft, bool) or not 0 <= craft < count:
            raise ValueError(f"craft: must be from 0 to {count - 1}, got {craft!r}")
        self.gathering = gathering
        self.names = short_names(names, count)
        self.knots = [Knots.of(gathering.paths[k]) for k in range(count)]
        self.figure = sheet(7.9)
        self.oblique = Overview(
            self.figure,
            (0.01, 0.205, 0.575, 0.715),
            "Oblique view",
            OBLIQUE,
            gathering,
            self.knots,
            craft,
            self.names,
        )
        sun = Overview(
            self.figure,
            (0.595, 0.525, 0.395, 0.395),
            "Sun view",
            SUN_VIEW,
            gathering,
            self.knots,
            craft,
            self.names,
        )
        close = CloseUp(self.figure, (0.595, 0.205, 0.395, 0.31), gathering, craft, self.names[craft])
        strip = Strip(self.figure, (0.01, 0.105, 0.98, 0.035), gathering)
        for view in (self.oblique, sun):
            left, low = view.axes.get_xlim()[0], view.axes.get_ylim()[0]
            width = float(np.diff(view.axes.get_xlim())[0])
            reach = (0.06 if view is self.oblique else 0.075) * width
            triad(
                view.axes, view.camera, np.array([left + 1.7 * reach, low + 1.9 * reach]), reach, DIRECTIONS
            )
        self.parts = (self.oblique, sun, close, strip)
        self.clock = self.figure.text(0.99, 0.965, "", ha="right", va="center", fontsize=TEXT + 5, color=INK)
        self.clock.set_fontweight("bold")
        self.story = self.figure.text(0.01, 0.965, "", ha="left", va="center", fontsize=TEXT, color=INK)
        plain(self.story, *self.names)
        self.figure.legend(
            handles=self.legend(),
            loc="lower center",
            ncols=4,
            frameon=False,
            fontsize=SMALL,
            handlelength=2.2,
            bbox_to_anchor=(0.5, -0.005),
            columnspacing=1.6,
            labelspacing=0.35,
        )

    @property
    def artists(self) -> list[Artist]:
        """Moving artists, in their current order from back to front."""
        moving = [artist for part in self.parts for artist in part.artists]
        return [*sorted(moving, key=Artist.get_zorder), self.clock, self.story]

    def show(self, time: float) -> None:
        """Move all parts to a time [s]."""
        moment = Moment(self.gathering, self.knots, time)
        for part in self.parts:
            part.show(moment)
        self.clock.set_text(f"{clock_text(time)}  {moment.leg.phase}")
        past = [event for event in self.gathering.events if event.time <= time]
        self.story.set_text(self.told(past) if past else "All are lost")

    def told(self, past: list[Event]) -> str:
        """Return the last lock, or the last separate burn after it, as text."""
        told = [event for event in past if event.kind != EventKind.BURN]
        last = [event for event in told if event.time == told[-1].time]
        event = max(last, key=lambda one: one.kind == EventKind.LOCK)
        when, name = clock_text(event.time), self.names[event.first]
        if event.kind == EventKind.LOCK:
            other = self.names[event.second]
            labels = Moment(self.gathering, self.knots, event.time).labels
            held = [self.names[k] for k in np.flatnonzero(labels == event.label)]
            what = "formation set" if event.label == FORMATION else f"knowledge set {event.label}"
            members = ", ".join(held) if len(held) <= 8 else f"{len(held)} craft"
            return f"{when}  {name} and {other} lock: {what} holds {members}"
        size = 1e3 * float(np.linalg.norm(event.delta_v))
        why = "to keep clear" if event.kind == EventKind.CORRECTION else "out of the near field"
        return f"{when}  {name} burns {size:.3g} mm/s {why}"

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
        lines.append(("way so far, burns" if view.few else "way so far", way | bend))
        lines += [("in lock now", view.now_look), ("locked before", view.past_look)]
        handles: list[Artist] = [Line2D([], [], label=name, **look) for name, look in lines]
        for group, colour in GROUP_COLOURS.items():
            name = f"cone of {group}, cut at {float(f'{view.cone:.2g}'):g} m"
            handles.append(Patch(facecolor=tint(colour, 0.3), edgecolor=colour, label=name))
        return handles


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
    gathering : Gathering
        Gathering to draw.
    time : float [s]
        Time from the start of the search, up to the duration of the gathering.
    craft : int, default 0
        Index of the spacecraft in the close-up.
    names : sequence of str, optional
        Names of the spacecraft; default: their indices.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If `time` is outside the gathering, there is no such spacecraft, the number of names is wrong, or
        an argument has the wrong type.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) figures 9 to 11.
    """
    instance("gathering", gathering, Gathering)
    if not 0.0 <= number("time", time) <= gathering.duration:
        raise ValueError(f"time: must lie in the gathering, from 0 to {gathering.duration:g} s, got {time:g}")
    views = ThreeViews(gathering, craft, names)
    views.show(time)
    return views.figure


def animation(
    gathering: Gathering,
    file: str | PathLike[str] | IO[bytes],
    craft: int = 0,
    names: Sequence[str] | None = None,
    *,
    frames: int = 150,
    progress: Callable[[int, int], object] | None = None,
) -> None:
    """Write an animated GIF of a gathering in three views, as in the simulation of H03.

    Parameters
    ----------
    gathering : Gathering
        Gathering to draw.
    file : str, path-like or file of bytes
        Output file; an existing file is overwritten.
    craft : int, default 0
        Index of the spacecraft in the close-up, as in `three_views`.
    names : sequence of str, optional
        Names of the spacecraft; default: their indices.
    frames : int, default 150
        Number of frames, at least 2, evenly spaced in time; one more at each lock, where the animation
        pauses, as it does at the end.
    progress : callable of int and int, optional
        Function called with the number of finished frames and the total.

    Raises
    ------
    ValueError
        If `frames` is below 2, there is no such spacecraft, the number of names is wrong, or an argument
        has the wrong type.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) figures 9 to 11.
    """
    filmed(file, frames, progress)
    found = reel(gathering, craft, names, frames=frames)
    found.save(file, found.frames(slice(None), progress))


def reel(
    gathering: Gathering, craft: int = 0, names: Sequence[str] | None = None, *, frames: int = 150
) -> Reel:
    """Return the animation of `animation` without drawing it."""
    instance("gathering", gathering, Gathering)
    views = ThreeViews(gathering, craft, names)
    pixels = WIDE if len(gathering.groups) <= FEW else NARROW
    moments = schedule(gathering, frames)
    return Reel(views.figure, lambda: views.artists, views.show, moments, pixels)


def schedule(gathering: Gathering, frames: int) -> list[tuple[float, int]]:
    """Return the times [s] of the frames with their durations [ms]."""
    locks = np.unique([event.time for event in gathering.events if event.kind == EventKind.LOCK])
    times = np.unique(np.concatenate([np.linspace(0.0, gathering.duration, frames), locks]))
    stop = min(HOLD, STOPS // max(1, len(locks)) // 10 * 10)
    stays = np.where(np.isin(times, locks), max(stop, PLAY), PLAY)
    stays[-1] = LAST
    return list(zip(times.tolist(), stays.tolist(), strict=True))
