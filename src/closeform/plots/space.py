"""Figure of one path before and after avoidance, in space and in three planes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from closeform.arrays import Floats, instance
from closeform.conflicts.two_paths import Approach, closest_approach, find_conflicts
from closeform.motion.path import Path
from closeform.plots.camera import AXES, ORBITAL, framed, window
from closeform.plots.fleet import space_corner, three_planes
from closeform.plots.fonts import short_names
from closeform.plots.inputs import crafts, one_craft, same
from closeform.plots.label_placement import Names
from closeform.plots.palette import AFTER, BEFORE, CONFLICT, INK, OTHER, ZONE
from closeform.plots.style import DASHED, common_time, headline, instants, legend
from closeform.plots.zones_and_tracks import headings, place
from closeform.zones.outlines import drawn, shadow
from closeform.zones.zone import Zone

TOUCHED = 1.001  # clearance ratio up to which the path after counts as touching a zone


@dataclass(frozen=True, eq=False)
class Guard:
    """Zone at the position of its obstacle at one instant, and the position of the spacecraft then."""

    centre: Floats
    craft: Floats
    colour: str
    name: str


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that is drawn, as positions [m]."""

    zone: Zone
    before: Floats
    after: Floats | None
    stays: list[Floats]
    obstacles: list[Floats]
    guards: list[Guard]

    @property
    def points(self) -> list[Floats]:
        """All tracks (K, 3), and the extreme points of the zones."""
        reach = drawn(self.zone).extents * np.array([[-1.0], [1.0]])
        guarded = [guard.centre + reach for guard in self.guards]
        return [self.before, *self.obstacles, *([] if self.after is None else [self.after]), *guarded]

    @property
    def headed(self) -> tuple[list[Floats], list[str]]:
        """Tracks that carry a direction arrow, and their colours."""
        flown = [self.before] if self.after is None else [self.before, self.after]
        return [*self.obstacles, *flown], [OTHER] * len(self.obstacles) + [BEFORE, AFTER][: len(flown)]


def before_after(
    before: Path,
    after: Path,
    obstacles: Path | Sequence[Path],
    zone: Zone,
    names: Sequence[str] | None = None,
) -> Figure:
    """Plot a path before and after avoidance, in three planes and in space: SP11 figure 3.

    Thick stretches are in conflict. A zone is drawn at the obstacle's position when the path before is
    deepest in it, and as an outline where the path after touches it. If neither occurs, the zone is drawn at
    the closest approach. All panels have the same scale.

    Parameters
    ----------
    before, after : Path
        Paths of one spacecraft; the same path if nothing changed.
    obstacles : Path or sequence of Path
        Path of any shape, or a sequence of paths.
    zone : Zone
        Keep-out zone around each obstacle.
    names : sequence of str, optional
        Names of the obstacles.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If a path is a batch, an obstacle shares no time with it, the number of names is wrong, or
        an argument has the wrong type.

    References
    ----------
    SP11 (Sauter and Palmer 2011) figure 3.
    """
    one_craft("before", before)
    one_craft("after", after)
    instance("zone", zone, Zone)
    others = crafts("obstacles", obstacles)
    called = short_names(names, len(others), "obstacles") if names is not None else [""] * len(others)
    after = before if same(before, after) else after
    scene = compose(before, after, others, zone, called)
    figure, unit, panels = three_planes(np.vstack(scene.points), 1.06)
    for axes, camera, _ in panels:
        plane_panel(figure, axes, camera.basis[:2] / unit.size, scene)
    space_panel(space_corner(figure, panels[2][0], panels[1][0]), scene)
    handles, words = figure.axes[0].get_legend_handles_labels()
    unique = dict(zip(words, handles, strict=True))
    legend(figure, list(unique.values()), list(unique), ncols=6, columnspacing=1.4, handlelength=1.8)
    headline(figure, title(before, after, others, zone))
    return figure


def compose(before: Path, after: Path, others: list[Path], zone: Zone, names: list[str]) -> Scene:
    """Sample the tracks and return the scene with the instants to show."""
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
    """Return zones entered by the path before or touched by the path after, otherwise the closest one."""
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


def plane_panel(figure: Figure, axes: Axes, basis: Floats, scene: Scene) -> None:
    """Draw one plane; the rows of `basis` (2, 3) point right and up."""
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
        mark: dict[str, Any] = {"color": OTHER if filled else AFTER, "markersize": 4}
        axes.plot(*(basis @ guard.centre), "s", **mark, linestyle="", label="obstacle then")
    name = "path" if scene.after is None else "before"
    axes.plot(*(basis @ scene.before.T), color=BEFORE, linestyle=DASHED, linewidth=2, label=name)
    if scene.after is not None:
        axes.plot(*(basis @ scene.after.T), color=AFTER, linewidth=2.4, label="after")
    for stay in scene.stays:
        axes.plot(
            *(basis @ stay.T), color=CONFLICT, linewidth=4.5, label="in conflict", solid_capstyle="butt"
        )
    for guard in scene.guards:
        mark = {"color": guard.colour, "markersize": 6, "zorder": 5, "linestyle": ""}
        axes.plot(*(basis @ guard.craft), "o", **mark, label="craft then")
    first, last = scene.before[0], scene.before[-1]
    for point, face in ((first, "white"), (last, INK)):
        axes.plot(*(basis @ point), "o", color=INK, markerfacecolor=face, markersize=6, zorder=6)
    widest = max(np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()))
    closed = float(np.linalg.norm(basis @ (last - first))) < 0.015 * widest
    said = [("start, end", first)] if closed else [("start", first), ("end", last)]
    said += [(guard.name, guard.centre) for guard in scene.guards if guard.name]
    shown = [track for track in (scene.before, scene.after, *scene.stays) if track is not None]
    where = np.array([point for _, point in said]) @ basis.T
    flown = headings(axes, lambda points: points @ basis.T, *scene.headed)
    craft = np.array([guard.craft for guard in scene.guards]).reshape(-1, 3) @ basis.T
    Names(figure, [word for word, _ in said]).beside(
        axes, where, np.vstack([craft, flown]), np.vstack(shown) @ basis.T
    )


def space_panel(axes: Axes, scene: Scene) -> None:
    """Draw the scene in space, seen obliquely from above."""
    camera = ORBITAL
    window(axes, np.vstack([camera(points) for points in scene.points]), camera, AXES, 0.1)
    framed(axes, "")
    for track in scene.obstacles:
        axes.plot(*camera(track).T, color=OTHER, linewidth=0.9, alpha=0.8)
    for guard in scene.guards:
        filled = guard.colour != AFTER
        look: dict[str, Any] = {
            "facecolor": ZONE if filled else "none",
            "edgecolor": ZONE if filled else AFTER,
        }
        outline = shadow(scene.zone, camera.basis[:2])
        place(axes, outline, camera(guard.centre), alpha=0.35 if filled else 1.0, linewidth=1.2, **look)
    axes.plot(*camera(scene.before).T, color=BEFORE, linestyle=DASHED, linewidth=1.8)
    if scene.after is not None:
        axes.plot(*camera(scene.after).T, color=AFTER, linewidth=2.2)
    for stay in scene.stays:
        axes.plot(*camera(stay).T, color=CONFLICT, linewidth=4, solid_capstyle="butt")
    for point, face in ((scene.before[0], "white"), (scene.before[-1], INK)):
        axes.plot(*camera(point), "o", color=INK, markerfacecolor=face, markersize=5)
    headings(axes, camera, *scene.headed)


def title(before: Path, after: Path, others: list[Path], zone: Zone) -> str:
    """Return the headline: conflicts and smallest clearance ratio before and after."""

    def count(path: Path) -> str:
        found = sum(len(find_conflicts(path, other, zone)) for other in others)
        least = min((closest_approach(path, other, zone).ratio for other in others), default=np.inf)
        words = {0: "clear", 1: "1 conflict"}.get(found, f"{found} conflicts")
        return f"{words}, {least:.2f} × zone" if others else words

    if after is before:
        return f"The path: {count(before)}"
    return f"Before: {count(before)}. After: {count(after)}"
