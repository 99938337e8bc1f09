"""A path before and after, in space and in three planes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from closeform.arrays import Floats
from closeform.conflicts.two_paths import Approach, closest_approach, find_conflicts
from closeform.motion.path import Path
from closeform.plots.look import (
    AFTER,
    BEFORE,
    CONFLICT,
    DASHED,
    DIRECTIONS,
    FAINT,
    HALO,
    INK,
    OTHER,
    SMALL,
    TEXT,
    ZONE,
    Unit,
    common_time,
    crafts,
    dress,
    headline,
    instants,
    length_unit,
    page,
)
from closeform.plots.scene import PLANES, drawn, place, shadow, shell, spot
from closeform.zones.zone import Zone

TOUCHED = 1.001  # ratio up to which the path after counts as passing along a zone
SPACE = (1, 2, 0)  # along-track to the right, cross-track into the picture, radial upwards


@dataclass(frozen=True, eq=False)
class Guard:
    """A zone where its obstacle is at one moment, and the craft then."""

    centre: Floats
    craft: Floats
    colour: str
    name: str


@dataclass(frozen=True, eq=False)
class Scene:
    """All that is drawn, as positions [m]."""

    zone: Zone
    before: Floats
    after: Floats | None
    stays: list[Floats]
    obstacles: list[Floats]
    guards: list[Guard]

    @property
    def centre_and_reach(self) -> tuple[Floats, Floats]:
        """Middle of all tracks and zones, and half of what they span along each axis."""
        corners = [guard.centre + s * drawn(self.zone).extents for guard in self.guards for s in (-1, 1)]
        all_points = [self.before, *self.obstacles, *([] if self.after is None else [self.after])]
        points = np.vstack([*all_points, *corners])
        low, high = points.min(axis=0), points.max(axis=0)
        return (low + high) / 2, 1.06 * (high - low) / 2


def before_after(
    before: Path, after: Path, obstacles: Any, zone: Zone, names: Sequence[str] | None = None
) -> Figure:
    """A path before and after among obstacles, in three planes and in space: SP11 figure 3.

    `before` and `after` are of one craft, the same path where nothing changed; `obstacles` is a
    Path of any shape or a sequence of paths, and `names` are theirs.  Strong stretches are in
    conflict.  A zone is drawn where its obstacle is when the path before is deepest in it, and
    an outline where the path after touches it; without either, at the closest approach.  All
    panels have one scale.

    Raises ValueError for batches, or an obstacle that shares no time with a path.
    """
    others = crafts(obstacles)
    if names is not None and len(names) != len(others):
        raise ValueError(f"names: {len(names)} names for {len(others)} obstacles")
    scene = compose(before, after, others, zone, list(names) if names else [""] * len(others))
    centre, reach = scene.centre_and_reach
    unit = length_unit(float(2 * reach.max()))
    reach = np.maximum(reach, 0.62 * reach.max()) / unit.size
    centre = centre / unit.size

    radial, along, cross = reach
    figure = page(min(10.4, 1.2 + 0.9 * 10.6 * (radial + cross) / (along + cross)))
    grid = figure.add_gridspec(2, 2, width_ratios=[along, cross], height_ratios=[radial, cross])
    cells = (grid[0, 0], grid[1, 0], grid[0, 1])
    for cell, plane in zip(cells, PLANES, strict=True):
        plane_panel(figure.add_subplot(cell), plane, scene, unit, centre, reach)
    space_panel(figure.add_subplot(grid[1, 1], projection="3d"), scene, unit, centre, reach)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    figure.legend(
        unique.values(), unique.keys(), loc="outside lower center", ncols=6, frameon=False, fontsize=SMALL
    )
    headline(figure, title(before, after, others, zone))
    return figure


def compose(before: Path, after: Path, others: list[Path], zone: Zone, names: list[str]) -> Scene:
    """Sample the tracks and find the moments to show."""
    changed = after is not before
    flown = [before, after] if changed else [before]
    for path in flown:
        for other in others:
            common_time(path, other)
    stays = [
        path.position(np.linspace(stay.start, stay.end, 120))
        for path in flown
        for other in others
        for stay in find_conflicts(path, other, zone)
    ]
    tracks = [other.position(instants(*common_time(before, other), other)) for other in others]
    return Scene(
        zone,
        before.position(instants(before.start, before.end, before)),
        after.position(instants(after.start, after.end, after)) if changed else None,
        stays,
        tracks,
        guards(flown, others, zone, names),
    )


def guards(flown: list[Path], others: list[Path], zone: Zone, names: list[str]) -> list[Guard]:
    """Zones in conflict with the path before or touched by the path after; else the nearest."""
    found: list[Guard] = []
    hit: set[int] = set()
    nearest: tuple[float, Guard] | None = None

    def guard(path: Path, other: Path, near: Approach, colour: str, name: str) -> Guard:
        return Guard(other.position(near.time), path.position(near.time), colour, name)

    for path, limit, colour in zip(flown, (1.0, TOUCHED), (CONFLICT, AFTER), strict=False):
        for k, (other, name) in enumerate(zip(others, names, strict=True)):
            near = closest_approach(path, other, zone)
            if near.ratio <= limit or k in hit:
                hit.add(k)
                found.append(guard(path, other, near, colour, "" if path is not flown[0] else name))
            if nearest is None or near.ratio < nearest[0]:
                nearest = near.ratio, guard(path, other, near, BEFORE, name)
    return found or ([nearest[1]] if nearest else [])


def plane_panel(
    axes: Axes, plane: tuple[int, int], scene: Scene, unit: Unit, centre: Floats, reach: Floats
) -> None:
    """One plane: `plane` holds the axis to the right and the axis upwards."""
    pick = list(plane)
    basis = np.eye(3)[pick] / unit.size
    dress(axes)
    for track in scene.obstacles:
        axes.plot(*(basis @ track.T), color=OTHER, linewidth=1.1, alpha=0.8, label="obstacles")
    outline = shadow(scene.zone, basis)
    for guard in scene.guards:
        filled = guard.colour != AFTER
        place(
            axes,
            outline,
            basis @ guard.centre,
            facecolor=ZONE if filled else "none",
            edgecolor=ZONE if filled else AFTER,
            alpha=0.35 if filled else 1.0,
            linewidth=1.2,
            label="zone at closest approach" if filled else "the same, after",
        )
        axes.plot(*(basis @ guard.centre), "s", color=OTHER if filled else AFTER, markersize=4)
    name = "path" if scene.after is None else "before"
    axes.plot(*(basis @ scene.before.T), color=BEFORE, linestyle=DASHED, linewidth=2, label=name)
    if scene.after is not None:
        axes.plot(*(basis @ scene.after.T), color=AFTER, linewidth=2.4, label="after")
    for stay in scene.stays:
        axes.plot(
            *(basis @ stay.T), color=CONFLICT, linewidth=4.5, label="in conflict", solid_capstyle="butt"
        )
    for guard in scene.guards:
        axes.plot(*(basis @ guard.craft), "o", color=guard.colour, markersize=6, zorder=5)
        axes.annotate(
            guard.name,
            (float(outline[:, 0].max()) + spot(basis, guard.centre)[0], spot(basis, guard.centre)[1]),
            (7, 0),
            textcoords="offset points",
            va="center",
            fontsize=SMALL,
            color="#4d5b66",
            path_effects=HALO,
        )
    first, last = scene.before[0], scene.before[-1]
    closed = float(np.linalg.norm(basis @ (last - first))) < 0.03 * reach.max()
    words = ("start, end", "") if closed else ("start", "end")
    for point, word, face in zip((first, last), words, ("white", INK), strict=True):
        axes.plot(*(basis @ point), "o", color=INK, markerfacecolor=face, markersize=6, zorder=6)
        label = axes.annotate(word, spot(basis, point), (7, 6), textcoords="offset points", fontsize=SMALL)
        label.set(color=INK, path_effects=HALO)
    right, up = pick
    axes.set_aspect("equal")
    axes.set_xlim(centre[right] - reach[right], centre[right] + reach[right])
    axes.set_ylim(centre[up] - reach[up], centre[up] + reach[up])
    axes.set_xlabel(f"{DIRECTIONS[right].name} [{unit.name}]", fontsize=TEXT, color=INK)
    axes.set_ylabel(f"{DIRECTIONS[up].name} [{unit.name}]", fontsize=TEXT, color=INK)


def space_panel(axes: Any, scene: Scene, unit: Unit, centre: Floats, reach: Floats) -> None:
    """The same in space."""
    basis = np.eye(3)[list(SPACE)] / unit.size
    for track in scene.obstacles:
        axes.plot(*(basis @ track.T), color=OTHER, linewidth=0.9, alpha=0.8)
    for guard in scene.guards:
        colour = AFTER if guard.colour == AFTER else ZONE
        for line in shell(scene.zone):
            axes.plot(*(basis @ (line + guard.centre).T), color=colour, linewidth=0.8, alpha=0.8)
    axes.plot(*(basis @ scene.before.T), color=BEFORE, linestyle=DASHED, linewidth=1.8)
    if scene.after is not None:
        axes.plot(*(basis @ scene.after.T), color=AFTER, linewidth=2.2)
    for stay in scene.stays:
        axes.plot(*(basis @ stay.T), color=CONFLICT, linewidth=4)
    for point, face in ((scene.before[0], "white"), (scene.before[-1], INK)):
        axes.plot(*(basis @ point)[:, None], "o", color=INK, markerfacecolor=face, markersize=5)
    for k, axis in enumerate(SPACE):
        name = "xyz"[k]
        getattr(axes, f"set_{name}lim")(centre[axis] - reach[axis], centre[axis] + reach[axis])
        getattr(axes, f"set_{name}label")(f"{DIRECTIONS[axis].name} [{unit.name}]", fontsize=SMALL, color=INK)
        drawn = getattr(axes, f"{name}axis")
        drawn.set_pane_color((1, 1, 1, 0))
        drawn.set_major_locator(MaxNLocator(4))
        drawn._axinfo["grid"].update(color=FAINT, linewidth=0.6)
    axes.tick_params(labelsize=SMALL - 1.5, colors=INK, pad=0)
    axes.set_box_aspect(reach[list(SPACE)], zoom=0.78)
    axes.view_init(elev=22, azim=-58)


def title(before: Path, after: Path, others: list[Path], zone: Zone) -> str:
    """What the picture shows, in one line."""

    def count(path: Path) -> str:
        found = sum(len(find_conflicts(path, other, zone)) for other in others)
        least = min((closest_approach(path, other, zone).ratio for other in others), default=np.inf)
        words = {0: "clear", 1: "1 conflict"}.get(found, f"{found} conflicts")
        return f"{words}, {least:.2f} × zone" if others else words

    if after is before:
        return f"The path: {count(before)}"
    return f"Before: {count(before)}. After: {count(after)}"
