"""Paths in space: of a formation, around obstacles, in free drift, with their uncertainty, and simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from closeform.arrays import Floats, instance, number, sequence
from closeform.conflicts.flight import stays_rather
from closeform.conflicts.two_paths import Approach, closest_approach, find_conflicts
from closeform.dynamics.simulation.simulation_result import Simulation
from closeform.motion.path import Path
from closeform.planning.methods.both_sides import ways_around
from closeform.planning.requirements import ApproachCone
from closeform.plots.clearances import Deviations, Failed
from closeform.plots.drawing import space, style, units
from closeform.plots.drawing.inputs import Paths, Zones, crafts, picture, same
from closeform.plots.drawing.pairs import Pairs, ratio_text
from closeform.plots.drawing.palette import (
    AFTER,
    ALTERNATIVE,
    BEFORE,
    CONFLICT,
    DIRECTIONS,
    INK,
    OTHER,
    ZONE,
    colours,
)
from closeform.plots.drawing.text import SMALL, obstacle_labels, plain, short_names
from closeform.uncertainty.clearance import clearance_in_sigmas
from closeform.uncertainty.errors import Uncertainty
from closeform.zones.outlines import CIRCLE, drawn
from closeform.zones.zone import Zone

MANY, NAMED = 200, 20  # spacecraft above which only the closest are shown, and how many of them
SAMPLE = 150  # of the others, as faint tracks
ROOM = 48  # characters of a headline for the names of pairs
TOUCHED = 1.001  # clearance ratio up to which the path after counts as touching a zone
TUBE = "#cfe4f3"
SWEPT, OUTLINED = 400, 9  # maximum number of ellipses of a tube, and of those with an outline
FAN = 36  # number of failed motions drawn
LAST, LONGEST = 3.0, 32.0  # orbits drawn: of the worst before its closest approach, of any near the zone
UNSAFE, SAFE = "#d9a7a0", "#a9c4d6"  # of a failed motion that enters the zone, and of one that does not
RUNS, FEWEST = 60, 4  # maximum and minimum number of runs drawn besides the worst
POINTS, A_TURN = 240, 48  # points of each line: minimum, and per orbit
VERTICES = 30_000  # per spacecraft over all runs; beyond it fewer runs are drawn
SHARE = 0.06  # of the figure's extent: maximum size of a magnified deviation
ORIGIN = np.zeros(3)


def track_of(path: Path, colour: Any, *args: Any, **look: Any) -> space.Track:
    """Return a path, sampled for a smooth curve, as a track."""
    return space.Track(path.position(units.instants(path.start, path.end, path)), colour, *args, **look)


def stretches(path: Path, intervals: Any, width: float = 4.5) -> list[space.Track]:
    """Return the stretches of a path in conflict, as thick tracks."""
    look: dict[str, Any] = {"label": "in conflict", "arrow": False, "order": 3.0}
    times = [np.linspace(start, end, 60) for start, end in intervals]
    return [space.Track(path.position(some), CONFLICT, width, **look) for some in times]


# ----- a formation before and after a plan


@dataclass(frozen=True, eq=False)
class Formation:
    """Paths of a formation at one stage of a plan: scene, pairs with a zone, and spacecraft with tracks."""

    scene: space.Scene
    pairs: Pairs
    shown: list[int]

    @classmethod
    def of(
        cls, title: str, paths: Path, others: list[Path], zone: object, called: list[str], shown: Any = None
    ) -> Formation:
        """Sample the tracks and find the conflicts.

        Of many spacecraft only `shown` have tracks, by default those of the closest pairs, and others are
        faint.
        """
        craft_paths = crafts("paths", paths)
        count = len(craft_paths)
        pairs = Pairs.of([*craft_paths, *others], zone, count, "zone", MANY**2 / 2)
        if shown is None:
            shown = list(range(count)) if count <= MANY else closest_craft(pairs, count)
        rest = np.setdiff1d(np.arange(count), shown)
        sample = rest[np.linspace(0, len(rest) - 1, min(len(rest), SAMPLE)).astype(int)]
        look: dict[str, Any] = {"label": f"{len(sample)} of the others", "arrow": False, "order": 1.2}
        faint = [track_of(craft_paths[k], "#8a9ba84d", 0.5, **look) for k in sample]
        passive = [track_of(one, OTHER, 1.2, label="obstacles") for one in others]
        lines = [track_of(craft_paths[k], INK).points for k in shown]
        tracks = [*faint, *passive, *own_tracks(lines)]
        shapes, nearest, story = closest_pair(pairs, count, called)
        for path, intervals in zip(craft_paths, conflicts_of(pairs, count), strict=True):
            tracks += stretches(path, intervals, 4.5 if len(shown) <= NAMED else 2.2)
        if len(sample) and shown:
            story = f"{story}; in colour the {len(shown)} craft of the closest pairs"
        marks = [*ends(lines, [called[k] for k in shown]), *nearest]
        scene = space.Scene(tracks, marks, shapes, "\n".join(filter(None, (title, story))))
        return cls(scene, pairs, shown)


def own_tracks(lines: Sequence[Floats]) -> list[space.Track]:
    """Return the lines (K, 3) of several spacecraft as tracks in their colours."""
    few = len(lines) <= NAMED
    pairs = zip(lines, colours(len(lines)), strict=True)
    return [
        space.Track(line, tint, 2.0 if few else 1.0, arrow=len(lines) <= 3 * NAMED) for line, tint in pairs
    ]


def ends(lines: Sequence[Floats], called: Sequence[str]) -> list[space.Mark]:
    """Return the starts, with names if there are few, and ends of lines (K, 3) in their colours."""
    few, tints = len(lines) <= NAMED, colours(len(lines))
    size = 6.0 if few else 3.5
    found = [
        space.Mark(line[-1], tint, size=size, label="end") for line, tint in zip(lines, tints, strict=True)
    ]
    for line, tint, name in zip(lines, tints, called, strict=True):
        found.append(space.Mark(line[0], tint, "o", "none", 1.3 * size, "start", name if few else "", 4.1))
    return found


def closest_craft(pairs: Pairs, count: int) -> list[int]:
    """Return the sorted indices of the spacecraft in the closest pairs."""
    found: dict[int, None] = {}
    for k in pairs.order:
        both = [craft for craft in pairs.craft[k].tolist() if craft < count]
        if len({*found, *both}) > NAMED:
            break
        found |= dict.fromkeys(both)
    return sorted(found)


def closest_pair(
    pairs: Pairs, count: int, called: list[str]
) -> tuple[list[space.Shape], list[space.Mark], str]:
    """Return zone, marks and description of the closest pair at its closest approach."""
    if not pairs.order:
        return [], [], ""
    near = pairs.order[0]
    one, other = pairs.craft[near].tolist()
    pair = [other, one] if carries(pairs.paths, count, other, one) else [one, other]
    places = [pairs.paths[k].position(pairs.time[near]) for k in pair]
    look: dict[str, Any] = {"marker": "D", "size": 4.0, "label": "closest pair at that time", "order": 4.2}
    return (
        [space.Shape(pairs.zone[near], places[0], "zone at closest approach")],
        [space.Mark(place, INK, **look) for place in places],
        f"closest {called[one]} and {called[other]}, {ratio_text(pairs.ratio[near])} × zone",
    )


def carries(paths: Path, count: int, one: int, other: int) -> bool:
    """Return True if the zone is drawn at spacecraft `one`: it is the obstacle, or moves less."""
    if (one >= count) != (other >= count):
        return one >= count
    return stays_rather(paths[one], paths[other])


def conflicts_of(pairs: Pairs, count: int) -> list[list[tuple[float, float]]]:
    """Return the merged conflict intervals of each spacecraft with any other."""
    merged: list[list[tuple[float, float]]] = [[] for _ in range(count)]
    met = [
        (stay.start, stay.end, k)
        for craft, stays in zip(pairs.craft.tolist(), pairs.stays, strict=True)
        for stay in stays
        for k in craft
        if k < count
    ]
    for start, end, k in sorted(met):
        own = merged[k]
        if own and start <= own[-1][1]:
            own[-1] = own[-1][0], max(end, own[-1][1])
        else:
            own.append((start, end))
    return merged


def in_words(pairs: Pairs, called: list[str]) -> str:
    """Return the pairs in conflict as text, closest first, as far as the headline has room."""
    hit = [k for k in pairs.order if pairs.stays[k]]
    named = [" and ".join(called[craft] for craft in pairs.craft[k].tolist()) for k in hit]
    if len(named) < 2:
        return ""
    kept = max(1, sum(len(", ".join(named[: k + 1])) <= ROOM for k in range(len(named))))
    more = f", {len(named) - kept} more" if len(named) > kept else ""
    return f": {', '.join(named[:kept])}{more}"


@picture("the paths differ in shape (N,) or orbit")
def formation_paths(
    before: Paths,
    after: Paths,
    names: Sequence[str] | None = None,
    zone: Zones = None,
    obstacles: Path | Sequence[Path] = (),
) -> Figure:
    """Plot the paths of a formation before and after a plan, side by side at one scale.

    Paths in an orbit are shown in the three planes of the orbital frame. Paths in deep space are shown
    obliquely. A ring marks the start of a path and a dot its end.

    With zones, stretches in conflict are thick. The zone of the closest pair is drawn at the time of closest
    approach, around an obstacle if one is involved, otherwise around the spacecraft with less delta-v or the
    shorter track.

    For more than 200 spacecraft, only those of the closest pairs (at most 20) and a faint sample of the
    others are drawn. Conflicts are drawn for all.
    """
    matching = before.shape == after.shape and before.orbit == after.orbit
    if not matching or len(before.shape) != 1 or not len(before):
        raise ValueError(
            f"before, after: must be of one orbit and one shape (N,), got {before.shape} and {after.shape}"
        )
    others = crafts("obstacles", obstacles)
    called = short_names(names, len(crafts("before", before)))
    sides = [("", before)] if same(before, after) else [("Before", before), ("After", after)]
    every = [*called, *obstacle_labels(len(others))]
    stages: list[Formation] = []
    for title, paths in sides:
        shown = stages[0].shown if stages else None
        stages.append(Formation.of(title, paths, others, zone, every, shown))
    draw = space.in_planes if np.isfinite(before.orbit.period) else space.in_space
    return draw(
        [stage.scene for stage in stages],
        formation_story([stage.pairs for stage in stages], len(called), every),
    )


def formation_story(stages: list[Pairs], count: int, called: list[str]) -> str:
    """Return the headline: the number of pairs in conflict, at one or two stages."""
    craft, two = f"{count} craft", len(stages) > 1
    if not stages[0].total:
        return f"{craft}: {'paths before and after' if two else 'all paths'}"
    counted, conflicts = units.plural(stages[0].total, "pair"), [int(one.hit.sum()) for one in stages]
    if not any(conflicts):
        return f"{craft}, {counted}: paths clear{' before and after' if two else ''}"
    words = [str(number) if number else "none" for number in conflicts]
    if two:
        return f"{craft}, {counted}: {words[0]} in conflict before, {words[1]} after"
    return f"{craft}, {counted}: {words[0]} in conflict{in_words(stages[0], called)}"


# ----- one spacecraft and its obstacles


@picture("an obstacle shares no time with a path", source="SP11 figure 3")
def before_after(
    before: Path,
    after: Path,
    obstacles: Path | Sequence[Path],
    zone: Zone,
    names: Sequence[str] | None = None,
    corridor: ApproachCone | None = None,
) -> Figure:
    """Plot a path before and after avoidance, in three planes and in space: SP11 figure 3.

    Thick stretches are in conflict. A zone is drawn at the obstacle's position when the path before is
    deepest in it, and as an outline where the path after touches it. If neither occurs, the zone is drawn at
    the closest approach. All panels have the same scale.

    Parameters
    ----------
    names : sequence of str, optional
        Names of the obstacles.
    """
    others = crafts("obstacles", obstacles)
    called = short_names(names, len(others), "obstacles") if names is not None else [""] * len(others)
    changed = not same(before, after)
    versions: list[tuple[Path, str, Any, str, float]] = [
        (before, BEFORE, style.DASHED, "before" if changed else "path", 1.0)
    ]
    if changed:
        versions.append((after, AFTER, "-", "after", TOUCHED))
    tracks, marks, shapes, stories = list[space.Track](), list[space.Mark](), list[space.Shape](), list[str]()
    for other in others:
        times = units.instants(*units.common_time(before, other), other)
        tracks.append(space.Track(other.position(times), OTHER, 1.1, label="obstacles"))
    if corridor is not None:
        for line in corridor._outline(after.position(units.instants(after.start, after.end, after))):
            tracks.append(space.Track(line, ALTERNATIVE, 1.2, "-", "corridor", arrow=False))
    hit, closest = set[int](), list[tuple[float, int]]()
    for path, colour, dashes, role, limit in versions:
        tracks.append(track_of(path, colour, 2.2, dashes, role))
        near = [closest_approach(path, other, zone) for other in others]
        found = [find_conflicts(path, other, zone) for other in others]
        for met in found:
            tracks += stretches(path, [(stay.start, stay.end) for stay in met])
        for k, one in enumerate(near):
            if one.ratio <= limit or k in hit:
                hit.add(k)
                passage = passage_of(path, others[k], one, zone, called[k], role == "after")
                shapes, marks = shapes + passage[0], marks + passage[1]
            elif role != "after":
                closest.append((one.ratio, k))
        clear = {0: "clear", 1: "1 conflict"}.get(count := sum(map(len, found)), f"{count} conflicts")
        least = f", {min(one.ratio for one in near):.2f} × zone" if near else ""
        if corridor is not None:
            least += f", {'in' if corridor._worst(path)[0] >= 0.0 else 'outside'} the corridor"
        stories.append(f"{role}: {clear}{least}")
    if closest and not shapes:
        _, k = min(closest)
        near_k = closest_approach(before, others[k], zone)
        shapes, marks = passage_of(before, others[k], near_k, zone, called[k], after=False)
    first, last = before.position([before.start, before.end])
    marks.append(space.Mark(first, INK, face="white", label="start", order=6.0))
    marks.append(space.Mark(last, INK, label="end", order=6.0))
    said = ". ".join(f"{story[0].upper()}{story[1:]}" for story in stories)
    scene = space.Scene(tracks, marks, shapes)
    return (space.in_planes if np.isfinite(before.orbit.period) else space.in_space)([scene], said)


def passage_of(
    path: Path, other: Path, near: Approach, zone: Zone, name: str, after: bool
) -> tuple[list[space.Shape], list[space.Mark]]:
    """Return the zone at its obstacle's position at closest approach, and the positions of both then."""
    centre = other.position(near.time)
    tint = AFTER if after else CONFLICT if near.ratio <= 1.0 else BEFORE
    words = "zone at closest approach, after" if after else "zone at closest approach"
    shape = space.Shape(zone, centre, words, AFTER if after else ZONE, not after)
    host = space.Mark(
        centre,
        AFTER if after else OTHER,
        "s",
        size=4.0,
        label="obstacle at that time",
        name=name * (not after),
    )
    return [shape], [
        host,
        space.Mark(path.position(near.time), tint, label="spacecraft at that time", order=5.0),
    ]


@dataclass(frozen=True, eq=False)
class SquareView:
    """Scene seen by a camera in a square of half-width `half` [m] around a `middle` (2,) [m]."""

    scene: space.Scene
    camera: space.Camera
    axes_names: tuple[str, str]
    middle: Any
    half: float


def squares(views: Sequence[SquareView], said: str) -> Figure:
    """Return a figure of square views side by side."""
    figure = style.sheet(6.6)
    shown = []
    for axes, view in zip(figure.subplots(1, len(views)), views, strict=True):
        unit = units.length_unit(view.half)
        limits = (np.asarray(view.middle)[:, None] + view.half * np.array([-1.0, 1.0])) / unit.size
        axes.set(xlim=limits[0], ylim=limits[1], aspect="equal", anchor="S")  # so that labels have room
        style.dress(axes)
        plain(axes.set_title(view.scene.title, fontsize=SMALL, color=INK))
        for axis, name in zip((axes.xaxis, axes.yaxis), view.axes_names, strict=True):
            axis.set_label_text(f"{name} [{unit.name}]")
            axis.set_major_locator(MaxNLocator(6))
        shown.append((axes, view.scene, view.camera, unit.size))
    return space.finished(figure, shown, said)


def around(points: Floats) -> tuple[Floats, float]:
    """Return the middle and the half-width of a square that holds points (K, 2)."""
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, 0.6 * float((high - low).max() or 1.0)


@picture("there are more than two ways, or no common time", source="SP11 figure 2")
def two_ways(
    path: Path, obstacle: Path, zone: Zone, ways: Sequence[Path] | None = None, name: str | None = None
) -> Figure:
    """Plot the avoidance trajectories around one obstacle, each with its two legs: SP11 figure 2.

    The zone is drawn at the obstacle's position at closest approach. Each avoidance trajectory is solid up to
    its own closest approach (initial leg) and dotted after it (terminal leg). If the path is clear, it is
    drawn alone.

    Parameters
    ----------
    ways : sequence of Path, optional
        Up to two paths between the same end states; default: the path of lowest cost that was found, and that
        of lowest cost on the other passing side.
    name : str, optional
        Name of the obstacle.
    """
    shared = units.common_time(path, obstacle)
    near = closest_approach(path, obstacle, zone)
    chosen = ways_around(path, obstacle, zone) if ways is None else sequence("ways", ways, Path)
    if len(chosen) > 2:
        raise ValueError(f"ways: give at most 2, got {len(chosen)}")
    (called,) = short_names([instance("name", name, str)], 1) if name is not None else ("obstacle",)
    other = obstacle.position(near.time)
    stays = [(stay.start, stay.end) for stay in find_conflicts(path, obstacle, zone)]
    tracks = [space.Track(obstacle.position(units.instants(*shared, obstacle)), OTHER, 1.6, label=called)]
    tracks += [track_of(path, BEFORE, 2.2, style.DASHED, "path"), *stretches(path, stays)]
    marks = [space.Mark(other, OTHER, "s", label=f"{called} then")]
    for k, (avoidance, tint) in enumerate(zip(chosen, (AFTER, ALTERNATIVE), strict=False), 1):
        units.common_time(avoidance, obstacle)
        at = closest_approach(avoidance, obstacle, zone).time
        for start, end, dashes, leg in (
            (avoidance.start, at, "-", "initial"),
            (at, avoidance.end, style.DOTTED, "terminal"),
        ):
            if start < end:
                words = f"way {k}, {extra_cost(path, avoidance)}" if leg == "initial" else "terminal leg"
                points = avoidance.position(units.instants(start, end, avoidance))
                tracks.append(space.Track(points, tint, 2.2, dashes, words, leg == "initial"))
        marks.append(space.Mark(avoidance.position(at), tint, size=8.0, order=5.0))
    first, last = path.position([path.start, path.end])
    marks += [space.Mark(first, INK, face="white", label="start"), space.Mark(last, INK, label="end")]
    time = units.clock(path, path.start, path.end).text(near.time)
    said = f"No avoidance is needed: closest {near.ratio:.2f} × zone at {time}"
    if near.ratio <= 1:
        count = ("No avoidance trajectory", "One avoidance trajectory", "Two avoidance trajectories")[
            len(chosen)
        ]
        alone = ", none found on the other side" if len(chosen) == 1 else ""
        said = f"{count} for the conflict at {time} ({near.ratio:.2f} × zone){alone}"
    scene = space.Scene(tracks, marks, [space.Shape(zone, other, "zone at closest approach")])
    return (space.in_planes if np.isfinite(path.orbit.period) else space.in_space)([scene], said)


def extra_cost(path: Path, avoidance: Path) -> str:
    """Return the extra cost of a path as text: energy if both are finite, otherwise delta-v."""
    if 0 < path.energy < np.inf and avoidance.energy < np.inf:
        return f"{units.signed_percent(avoidance.energy / path.energy - 1)} energy"
    more = avoidance.delta_v - path.delta_v
    return f"{'+' if more >= 0.0 else '−'}{units.speed(abs(more))} Δv"


# ----- free drift after a loss of thrust


@picture("the arguments do not suit `drift_approach`")
def drift_fan(
    path: Path, other: Path, zone: Zone, until: float, names: Sequence[str] | None = None
) -> Figure:
    """Plot the free drift after a loss of thrust, relative to another spacecraft, for a fan of failures.

    Thin lines are failures at equal time steps; red ones enter the zone. The thick line is the certified
    worst case. The left panel shows the planned path, one orbit of each failed motion, and the worst one up
    to its closest approach. The right panel looks along the track. It shows the parts of the drift (at most
    32 orbits) that are no further ahead or behind than the zone extends.

    Parameters
    ----------
    path : Path
        Path of the failing spacecraft.
    other : Path
        Path of the other spacecraft, up to the end of the drift.
    """
    called = short_names(names, 2) if names is not None else ["The craft", "the other"]
    found = Failed.of(path, other, zone, until)
    worst, period = found.worst, path.orbit.period
    lost, met = worst.failed_at, worst.time
    planned = gap(found, None, units.instants(path.start, path.end, path))
    whole, beside = list[space.Track](), list[space.Track]()
    wanted = np.linspace(found.times[0], found.times[-1], FAN)
    for k in np.unique(np.searchsorted(found.times, wanted).clip(0, len(found.times) - 1)).tolist():
        unsafe, time = bool(found.ratios[k] <= 1.0), float(found.times[k])
        words = f"free drift that {'enters the zone' if unsafe else 'stays clear'}"
        look: dict[str, Any] = {"colour": UNSAFE if unsafe else SAFE, "width": 0.9, "arrow": False}
        look |= {"label": words, "order": 2.1 + 0.1 * unsafe}
        failed = time, found.states[k]
        whole.append(space.Track(gap(found, failed, first_orbit(found, time, found.met[k])), **look))
        beside += [space.Track(piece, **look) for piece in abeam(found, failed)]
    tint = CONFLICT if worst.ratio <= 1.0 else AFTER
    look = {
        "colour": tint,
        "width": 2.2,
        "arrow": False,
        "label": "closest free drift",
        "order": 4.0,
    }
    failed = lost, found.lost
    whole.append(space.Track(gap(found, failed, first_orbit(found, lost, met)), **look))
    beside += [space.Track(piece, **look) for piece in abeam(found, failed)]
    start, end = gap(found, None, np.array([path.start, path.end]))
    marks = [
        space.Mark(start, INK, face="white", label="start of the plan", order=5.0),
        space.Mark(end, INK, label="end of the plan", order=5.0),
        space.Mark(
            gap(found, None, np.array([lost]))[0], tint, "X", size=9.0, label="loss of thrust", order=6.0
        ),
    ]
    nearest: list[space.Mark] = []
    if np.isfinite(met):
        last = max(lost, met - (LAST * period if np.isfinite(period) else np.inf))
        whole.append(space.Track(gap(found, failed, np.linspace(last, met, 600)), **look))
        point = gap(found, failed, np.array([met]))[0]
        nearest = [space.Mark(point, tint, face="none", size=10.0, label="closest approach", order=6.0)]
    whole.append(space.Track(planned, INK, 2.4, label="plan", order=3.0))
    shape, extents = space.Shape(zone, ORIGIN, "keep-out zone"), drawn(zone).extents
    reach = np.vstack([planned, np.diag(extents), -np.diag(extents)])
    cameras = space.PLANES[0], space.PLANES[2]
    names_of = [tuple(DIRECTIONS[axis].name for axis in pair) for pair, _ in cameras]
    scenes = (
        space.Scene(whole, [*marks, *nearest], [shape], f"relative to {called[1]}, from the side"),
        space.Scene(beside, nearest, [shape], "near the zone, seen along the track"),
    )
    half = max(2.6, 1.3 * min(worst.ratio, 5.0)) * float(extents[[0, 2]].max())
    views = [
        SquareView(scenes[0], cameras[0][1], names_of[0], *around(cameras[0][1](reach))),  # type: ignore[arg-type]
        SquareView(scenes[1], cameras[1][1], names_of[1], np.zeros(2), half),  # type: ignore[arg-type]
    ]
    fate = "stays clear" if worst.ratio > 1.0 else "drifts into the zone"
    said = f"{called[0]} {fate}: {found.story(units.clock(path, path.start, path.end))}"
    return squares(views, said)


def gap(found: Failed, failed: tuple[float, Floats] | None, times: Floats) -> Floats:
    """Return positions (K, 3) relative to the other spacecraft, planned or since a failure (time, state)."""
    path, orbit = found.path, found.path.orbit
    if failed is None:
        places = path.position(np.minimum(times, path.end))
    else:
        places = (orbit.transition(times - failed[0], failed[0]) @ failed[1])[..., :3]
    inside = np.minimum(times, found.other.end)
    states = found.other.state(inside)
    carried = np.einsum("tij,tj->ti", orbit.transition(times - inside, inside), states)
    return np.asarray(places - np.where((times > inside)[:, None], carried, states)[:, :3])


def first_orbit(found: Failed, failed_at: float, met: float) -> Floats:
    """Return times after a failure: one orbit, or in deep space up to the closest approach."""
    period = found.path.orbit.period
    soon = max(met, failed_at + 0.2 * (found.until - failed_at))
    return np.linspace(failed_at, min(found.until, failed_at + period if np.isfinite(period) else soon), 300)


def abeam(found: Failed, failed: tuple[float, Floats]) -> list[Floats]:
    """Return the parts (K, 3) of a failed motion within the along-track extent of the zone."""
    period, end, failed_at = found.path.orbit.period, found.until, failed[0]
    count = 2000
    if np.isfinite(period):
        end = min(end, failed_at + LONGEST * period)
        count = int(np.clip(300 * (end - failed_at) / period, 600, 300 * LONGEST))
    track = gap(found, failed, np.linspace(failed_at, end, count))
    ahead, behind = drawn(found.zone).support(np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]))
    inside = (track[:, 1] <= ahead) & (track[:, 1] >= -behind)
    cuts = np.flatnonzero(np.diff(inside)) + 1
    pieces = zip(np.split(track, cuts), np.split(inside, cuts), strict=True)
    return [piece for piece, within in pieces if within[0] and len(piece) > 1]


# ----- uncertainty and simulations


@picture("orbits differ, there is no common time, or `sigmas` is not above 0")
def tube(
    path: Path,
    other: Path,
    zone: Zone,
    errors: Uncertainty,
    other_errors: Uncertainty | None = None,
    sigmas: float = 3.0,
    names: Sequence[str] | None = None,
) -> Figure:
    """Plot the relative position of two spacecraft within some sigmas, in three planes, with the zone.

    The tube is the union of the covariance ellipsoids of that size along the path. Some outlines are drawn at
    equal time steps. The outline in the conflict colour is at the closest approach in sigmas.

    Parameters
    ----------
    path, other : Path
        Paths of one spacecraft each, in one orbit; the position of the first relative to the other is shown.
    errors : Uncertainty
        Uncertainty of the first spacecraft, or of the relative state if `other_errors` is None.
    sigmas : float, no unit, default 3
        Size of the tube in standard deviations.
    """
    many = number("sigmas", sigmas)
    if not 0.0 < many < np.inf:
        raise ValueError(f"sigmas: must be finite and above 0, got {many:g}")
    one, two = short_names(names, 2)
    found = Deviations.of(path, other, errors, other_errors)
    least = clearance_in_sigmas(path, other, zone, errors, other_errors)
    touched = np.isfinite(least.time)
    nearest = int(np.argmin(np.abs(found.times - least.time))) if touched else None
    track = found.states[:, :3]
    wide = many * np.sqrt(np.einsum("tii->ti", found.covariances)[:, :3])

    def swept(axes: Axes, camera: space.Camera, unit: float) -> None:
        basis = camera.basis[:2] / unit
        every = ellipses(basis @ found.covariances[:, :3, :3] @ basis.T, many) + (track @ basis.T)[:, None]
        some = every[np.unique(np.linspace(0, len(every) - 1, SWEPT).astype(int))]
        hulls = [space.hull(np.concatenate(pair)) for pair in pairwise(some)]
        axes.add_collection(PolyCollection(hulls, facecolor=TUBE, edgecolor=TUBE, zorder=1))
        lined = every[np.unique(np.linspace(0, len(every) - 1, OUTLINED).astype(int))]
        look: dict[str, Any] = {"facecolor": "none", "edgecolor": AFTER, "linewidth": 0.7, "zorder": 2}
        axes.add_collection(PolyCollection(lined, label=f"{many:g} sigma at equal time steps", **look))
        if nearest is not None:
            look |= {"edgecolor": CONFLICT, "linewidth": 1.8, "zorder": 5}
            axes.add_collection(PolyCollection([every[nearest]], **look))

    marks = [
        space.Mark(track[0], INK, face="none", size=8.0, label="start"),
        space.Mark(track[-1], INK, label="end"),
    ]
    if nearest is not None:
        marks.append(space.Mark(track[nearest], CONFLICT, label="closest approach in sigmas", order=5.5))
    ticks = units.clock(path, float(found.times[0]), float(found.times[-1]))
    how = "clear" if least.sigmas >= many else "not clear"
    said = f"{how} at {many:g} sigma, minimum {least.sigmas:.2f} sigma at {ticks.text(least.time)}"
    said = said if touched else "no error of any size causes a conflict"
    shapes, reach = [space.Shape(zone, ORIGIN)], np.concatenate([track - wide, track + wide])
    scene = space.Scene(
        [space.Track(track, AFTER, 2.2, label="path", order=3.0)], marks, shapes, "", [swept], reach
    )
    return space.in_planes([scene], f"{one} relative to {two}: {said}")


def ellipses(covariances: Floats, sigmas: float) -> Floats:
    """Return outlines (T, K, 2) of covariances (T, 2, 2)."""
    values, vectors = np.linalg.eigh(covariances)
    axes = vectors * (sigmas * np.sqrt(np.maximum(values, 0.0)))[:, None, :]
    return np.asarray(CIRCLE @ axes.transpose(0, 2, 1))


@picture()
def flight_paths(flight: Simulation, names: Sequence[str] | None = None) -> Figure:
    """Plot the paths of all runs and of the plan, with magnified deviations.

    Coloured lines are planned paths, pale lines are runs, red lines are the worst run. The figure states the
    magnification.
    """
    count, runs = flight.states.shape[1], len(flight.states)
    called = short_names(names, count)
    turns = float(np.ptp(flight.times)) / flight.planned.orbit.period
    points = max(POINTS, int(np.ceil(A_TURN * turns)))
    some = np.unique(np.linspace(0, len(flight.times) - 1, points).astype(int))
    planned = flight.planned.position(flight.times[some])
    shown = [*range(min(RUNS, max(FEWEST, VERTICES // len(some)), runs)), flight.worst]
    off = flight.states[shown][:, :, some, :3] - planned
    room, most = SHARE * (np.ptp(planned.reshape(-1, 3), axis=0).max() or 1.0), float(np.abs(off).max())
    gain = units.rounded_down(room / most) if 0.0 < most < room else 1.0
    enlarged = planned + gain * off
    tracks = own_tracks(list(planned))
    for k, tint in enumerate(colours(count)):
        pale: dict[str, Any] = {"width": 0.6, "arrow": False, "order": 1.9, "label": "each run"}
        tracks += [space.Track(line, [*tint[:3], 0.25], **pale) for line in enlarged[:-1, k] if runs > 1]
        worst = f"run {flight.worst}, {'closest approach' if flight.ratios.size else 'largest deviation'}"
        words = worst if runs > 1 else "simulated"
        tracks.append(space.Track(enlarged[-1, k], CONFLICT, 0.9, label=words, arrow=False, order=2.5))
    scale = f"magnified {gain:g} times" if gain != 1.0 else "to scale"
    most_off = units.length(flight.greatest_deviation)
    said = f"{units.plural(runs, 'run')} of {count} craft: deviation at most {most_off}, {scale}"
    return space.in_planes([space.Scene(tracks, ends(list(planned), called))], said)
