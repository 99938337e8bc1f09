"""Figure of the two avoidance trajectories around one obstacle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from closeform.arrays import Floats, instance, sequence
from closeform.conflicts.two_paths import closest_approach, find_conflicts
from closeform.motion.path import Path
from closeform.planning.both_sides import ways_around
from closeform.plots.fonts import plain, short_names
from closeform.plots.inputs import one_craft
from closeform.plots.palette import AFTER, ALTERNATIVE, BEFORE, CONFLICT, DIRECTIONS, INK, OTHER, ZONE
from closeform.plots.style import (
    DASHED,
    DOTTED,
    HALO,
    SMALL,
    TEXT,
    area,
    clock,
    common_time,
    dress,
    headline,
    instants,
    legend,
    length_unit,
    sheet,
    signed_percent,
    speed,
)
from closeform.plots.zones_and_tracks import headings, place, spot, square
from closeform.zones.outlines import PLANES, drawn, section, shadow
from closeform.zones.zone import Zone

SIDES = ((AFTER, "way 1", 1.0), (ALTERNATIVE, "way 2", -1.0))


@dataclass(frozen=True, eq=False)
class Passage:
    """Path at its closest approach to the obstacle: time, ratio, position and relative state `gap`."""

    path: Path
    obstacle: Path
    time: float
    ratio: float
    point: Floats
    gap: Floats

    @classmethod
    def of(cls, path: Path, obstacle: Path, zone: Zone) -> Passage:
        common_time(path, obstacle)
        near = closest_approach(path, obstacle, zone)
        state = path.state(near.time)
        return cls(path, obstacle, near.time, near.ratio, state[:3], state - obstacle.state(near.time))

    def plane(self, side: float) -> Floats:
        """Return unit vectors (2, 3) along the relative velocity and towards the passing side."""
        basis: list[Floats] = []
        for vector in (self.gap[3:], side * self.gap[:3], *np.eye(3)):
            length = np.linalg.norm(vector)
            rest = vector - sum(((vector @ u) * u for u in basis), np.zeros(3))
            if length > 0 and np.linalg.norm(rest) > 1e-6 * length:
                basis.append(rest / np.linalg.norm(rest))
        return np.array(basis[:2])

    def seen(self, start: float, end: float, show: Floats, relative: bool) -> Floats:
        """Return positions (K, 2) in a plane from start to end, or while the obstacle's path lasts."""
        if relative:
            first, last = common_time(self.path, self.obstacle)
            start, end = max(start, first), min(end, last)
        times = instants(start, end, self.path, self.obstacle)
        position = self.path.position(times)
        return (position - self.obstacle.position(times) if relative else position) @ show.T


def two_ways(
    path: Path, obstacle: Path, zone: Zone, ways: Sequence[Path] | None = None, name: str | None = None
) -> Figure:
    """Plot the avoidance trajectories around one obstacle, each with its two legs: SP11 figure 2.

    The left panel shows the orbital frame: the path, the zone at the obstacle's position at closest approach,
    and the avoidance trajectories. Each is solid up to its own closest approach (initial leg) and dotted
    after it (terminal leg). The right panel shows the motion relative to the obstacle, with a section of the
    zone. If the path is clear, it is drawn alone.

    Parameters
    ----------
    path : Path
        Path of one spacecraft.
    obstacle : Path
        Path of one obstacle.
    zone : Zone
        Keep-out zone around the obstacle.
    ways : sequence of Path, optional
        Up to two paths between the same end states; default: the path of lowest cost that was found, and that
        of lowest cost on the other passing side.
    name : str, optional
        Name of the obstacle.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If a path is a batch, there are more than two ways, there is no common time, or an argument has
        the wrong type.

    References
    ----------
    SP11 (Sauter and Palmer 2011) figure 2.
    """
    one_craft("path", path)
    one_craft("obstacle", obstacle)
    instance("zone", zone, Zone)
    planned = Passage.of(path, obstacle, zone)
    chosen = ways_around(path, obstacle, zone) if ways is None else sequence("ways", ways, Path)
    if len(chosen) > len(SIDES):
        raise ValueError(f"ways: at most {len(SIDES)}, got {len(chosen)}")
    around = [Passage.of(way, obstacle, zone) for way in chosen]

    (called,) = short_names([instance("name", name, str)], 1) if name is not None else ("obstacle",)

    figure = sheet(6.5)
    left, right = (area(figure, 0.95 + 5.25 * k, 1.35, 4.25, 4.25) for k in range(2))
    for axes in (left, right):
        axes.yaxis.set_label_coords(-0.15, 0.5)
    in_orbit(left, planned, around, zone)
    from_obstacle(right, planned, around, zone, called if name is not None else "it")
    seen = f"seen from {called if name is not None else 'the obstacle'}"
    plain(right.set_title(seen, fontsize=TEXT, color=INK))
    handles, words = left.get_legend_handles_labels()
    words = [called if word == "obstacle" else word for word in words]
    legend(figure, handles, words, ncols=4, handlelength=2.8)
    headline(figure, summary(planned, len(around)))
    return figure


def in_orbit(axes: Axes, planned: Passage, ways: Sequence[Passage], zone: Zone) -> None:
    """Draw the paths in the plane of the orbital frame that shows the deviations best."""
    path, obstacle = planned.path, planned.obstacle
    course = planned.seen(path.start, path.end, np.eye(3), False)
    spread = np.ptp([planned.point, *(way.point for way in ways)] if ways else course, axis=0)

    def shown_well(pair: Sequence[int]) -> float:
        """Score a plane by the spread of the deviations and of the path in it."""
        long, wide = np.linalg.svd((course - course.mean(axis=0))[:, list(pair)], compute_uv=False)
        return float(np.hypot(*spread[list(pair)]) * (long + 3 * wide))

    plane = max(map(list, PLANES), key=shown_well)
    unit = length_unit(float(np.abs(course).max()))
    show = np.eye(3)[plane] / unit.size
    host = obstacle.position(planned.time)
    look = {"facecolor": ZONE, "edgecolor": ZONE, "alpha": 0.3, "label": "zone at closest approach"}
    place(axes, shadow(zone, show), show @ host, **look)
    both = instants(*common_time(path, obstacle), path, obstacle)
    axes.plot(*(show @ obstacle.position(both).T), color=OTHER, linewidth=1.6, label="obstacle")
    axes.plot(*spot(show, host), "s", color=OTHER, markersize=6)
    shown = draw_planned(axes, planned, zone, show, False)
    for way, side in zip(ways, SIDES, strict=False):
        shown = np.vstack([shown, draw_legs(axes, way, show, False, side)])
        arrow = {"arrowstyle": "->", "color": side[0], "linewidth": 1.5}
        axes.annotate("", spot(show, way.point), spot(show, planned.point), arrowprops=arrow)
    for word, time, face in (("start", path.start, "white"), ("end", path.end, INK)):
        point = spot(show, path.position(time))
        axes.plot(*point, "o", color=INK, markersize=6, markerfacecolor=face, zorder=5)
        axes.annotate(word, point, (7, 7), textcoords="offset points", fontsize=SMALL, color=INK)
    low, high = shown.min(axis=0), shown.max(axis=0)
    square(axes, (low + high) / 2, 0.58 * float((high - low).max()))
    flown = [obstacle, path, *(way.path for way in ways)]
    tracks = [one.position(instants(one.start, one.end, one)) for one in flown]
    headings(axes, lambda points: points @ show.T, tracks, [OTHER, BEFORE, *(side[0] for side in SIDES)])
    axes.set_xlabel(f"{DIRECTIONS[plane[0]].name} [{unit.name}]")
    axes.set_ylabel(f"{DIRECTIONS[plane[1]].name} [{unit.name}]")
    axes.set_title("in the orbit's frame", fontsize=TEXT, color=INK)
    dress(axes)


def from_obstacle(axes: Axes, planned: Passage, ways: Sequence[Passage], zone: Zone, obstacle: str) -> None:
    """Draw the encounter relative to the obstacle, each path in the plane in which it passes the zone.

    In that plane the path meets the section of the zone exactly where it touches the zone. The figure is
    therefore folded along the relative motion: each half shows the section by its own plane.
    """
    size = float(drawn(zone).extents.max())
    unit = length_unit(size)
    planes = [way.plane(side) for way, (_, _, side) in zip(ways, SIDES, strict=False)]
    own = planes[0] if planes else planned.plane(1.0)
    for sign, basis in ((1.0, own), (-1.0, planes[-1] if planes else own)):
        outline = section(zone, basis) / unit.size
        half = outline[sign * outline[:, 1] >= -1e-9 * size]
        place(axes, half, (0, 0), facecolor=ZONE, edgecolor="none", alpha=0.3)
    axes.plot(0, 0, "s", color=OTHER, markersize=6)
    draw_planned(axes, planned, zone, own / unit.size, True)
    for way, side, basis in zip(ways, SIDES, planes, strict=False):
        draw_legs(axes, way, basis / unit.size, True, side)
        words = axes.annotate(
            f"{side[1]}: {price(planned.path, way.path)} for {obstacle} alone",
            spot(basis / unit.size, way.gap[:3]),
            (0, 18 * side[2]),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=TEXT,
            color=side[0],
            path_effects=HALO,
        )
        plain(words)
    farthest = max(size, *(float(np.linalg.norm(one.gap[:3])) for one in (planned, *ways)))
    square(axes, (0, 0), 1.6 * farthest / unit.size)
    axes.set_xlabel(f"along the relative motion [{unit.name}]")
    axes.set_ylabel(f"perpendicular to it [{unit.name}]")
    dress(axes)


def draw_planned(axes: Axes, planned: Passage, zone: Zone, show: Floats, relative: bool) -> Floats:
    """Draw the planned path, thick in conflict; return its points (K, 2)."""
    path = planned.path
    course = planned.seen(path.start, path.end, show, relative)
    axes.plot(*course.T, color=BEFORE, linestyle=DASHED, linewidth=2, label="path as planned")
    for k, stay in enumerate(find_conflicts(path, planned.obstacle, zone)):
        if stay.start < stay.end:
            stretch = planned.seen(stay.start, stay.end, show, relative)
            label = "in conflict" if k == 0 else None
            axes.plot(*stretch.T, color=CONFLICT, linewidth=4.5, label=label, solid_capstyle="butt")
    return course


def draw_legs(axes: Axes, way: Passage, show: Floats, relative: bool, side: tuple[str, str, float]) -> Floats:
    """Draw initial leg, deviation point and terminal leg of a path; return its points (K, 2)."""
    colour, name, _ = side
    legs = ((way.path.start, way.time, "-", "initial"), (way.time, way.path.end, DOTTED, "terminal"))
    drawn = [np.empty((0, 2))]
    for start, end, dashes, leg in legs:
        if start < end:
            drawn.append(way.seen(start, end, show, relative))
            label = f"{name}, {leg} leg"
            axes.plot(*drawn[-1].T, color=colour, linestyle=dashes, linewidth=2.4, label=label)
    axes.plot(*spot(show, way.gap[:3] if relative else way.point), "o", color=colour, markersize=8, zorder=5)
    return np.vstack(drawn)


def price(path: Path, way: Path) -> str:
    """Return the extra cost of a path as text: energy if both are finite, otherwise delta-v."""
    if 0 < path.energy < np.inf and way.energy < np.inf:
        return f"{signed_percent(way.energy / path.energy - 1)} energy"
    return f"{'+' if way.delta_v >= path.delta_v else '−'}{speed(abs(way.delta_v - path.delta_v))} Δv"


def summary(planned: Passage, count: int) -> str:
    """Return the headline of the figure."""
    time = clock(planned.path, planned.path.start, planned.path.end).text(planned.time)
    if planned.ratio > 1:
        return f"No way around is needed: closest {planned.ratio:.2f} × zone at {time}"
    found = ("No way", "One way", "Two ways")[count]
    alone = ", none found on the other side" if count == 1 else ""
    return f"{found} around the conflict at {time} ({planned.ratio:.2f} × zone){alone}"
