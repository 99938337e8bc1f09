"""Stills: three views of a mission as one small drawing, for a browser without WebGL, and for paper."""

from collections.abc import Iterator
from html import escape
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission_result import Mission
from closeform.plots.zones_and_tracks import PLANES, shadow
from closeform.viewer.fleet import around
from closeform.viewer.scene import Scene
from closeform.viewer.tracks import before

POINTS, FEWEST, MOST = 4000, 8, 120  # of all tracks of a stage in one view, of one track
SIDE, GAP, BELOW = 300.0, 20.0, 34.0  # of a view, between two, below it for words: pixels
NAMED = 16  # craft up to which names are written
ZONES = 60  # that are drawn


def stills(mission: Mission, scene: Scene) -> str:
    """An SVG of everybody's tracks in three planes, with zones as they are at the closest approach."""
    if not mission.results:
        return ""
    record = scene.record
    wide, high = 3 * SIDE + 2 * GAP, SIDE + BELOW
    views = [view(mission, record, plane, k * (SIDE + GAP)) for k, plane in enumerate(PLANES)]
    label = f"Tracks of {len(record['craft'])} craft in three planes"
    return (
        f'<svg viewBox="0 0 {wide:g} {high:g}" role="img" aria-label="{label}" '
        f'xmlns="http://www.w3.org/2000/svg" font-family="sans-serif" font-size="11">{"".join(views)}</svg>'
    )


def view(mission: Mission, record: dict[str, Any], plane: tuple[int, int], left: float) -> str:
    """One plane, all of the scene in it, at the same scale as the others."""
    low, high = np.array(record["low"]), np.array(record["high"])
    scale = SIDE / float((high - low).max())
    middle = 0.5 * (low + high)[list(plane)]

    def placed(points: Floats) -> Floats:
        flat = (points[..., list(plane)] - middle) * scale
        return np.asarray(flat * [1.0, -1.0] + [left + SIDE / 2.0, SIDE / 2.0])

    right, up = (record["axes"][axis] for axis in plane)
    parts = [
        f'<rect x="{left:g}" y="0" width="{SIDE:g}" height="{SIDE:g}" fill="none" stroke="currentColor" '
        'stroke-opacity="0.3"/>',
        *zones(mission, record, plane, placed, scale),
        *lines(mission, record, placed),
        f'<text x="{left:g}" y="{SIDE + 15:g}" fill="currentColor">{right} to the right, {up} upwards; '
        f"{SIDE / scale:.4g} m across</text>",
    ]
    return "".join(parts)


def lines(mission: Mission, record: dict[str, Any], placed: Any) -> Iterator[str]:
    """The tracks, thin and dashed without avoidance, and the craft at the end."""
    craft = record["craft"]
    count = int(np.clip(POINTS / len(craft), FEWEST, MOST))
    for result in mission.results:
        times = np.linspace(result.start, result.end, count)
        for k, path in before(result):
            points = path.position(np.linspace(path.start, path.end, count))
            yield line(placed(points), craft[k]["colour"], 'stroke-dasharray="4 3" stroke-opacity="0.6"')
        for k, points in enumerate(result.after.paths.position(times)):
            yield line(placed(points), craft[k]["colour"], 'stroke-width="1.6"')
    last = mission.results[-1]
    for one, spot in zip(craft, placed(last.after.paths.position(last.end)), strict=True):
        yield f'<circle cx="{spot[0]:.1f}" cy="{spot[1]:.1f}" r="3" fill="{one["colour"]}"/>'
        if len(craft) <= NAMED:
            yield (
                f'<text x="{spot[0] + 5:.1f}" y="{spot[1] - 4:.1f}" fill="currentColor">'
                f"{escape(one['name'])}</text>"
            )


def line(points: Floats, colour: str, look: str) -> str:
    """A polyline through points (K, 2)."""
    steps = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{steps}" fill="none" stroke="{colour}" {look}/>'


def zones(
    mission: Mission, record: dict[str, Any], plane: tuple[int, int], placed: Any, scale: float
) -> Iterator[str]:
    """Outlines of zones about their craft when two are closest, or else at the end."""
    time = record["approaches"][0]["time"] if record["approaches"] else record["end"]
    result = next(one for one in mission.results if time <= one.end)
    places = placed(result.after.paths.position(time))
    for k, place in enumerate(places[:ZONES]):
        if (zone := around(mission, k)) is not None:
            outline = shadow(zone, np.eye(3)[list(plane)])[::4] * scale * [1.0, -1.0] + place
            steps = " ".join(f"{x:.1f},{y:.1f}" for x, y in outline)
            yield f'<polygon points="{steps}" fill="#E69F00" fill-opacity="0.18" stroke="#E69F00"/>'
