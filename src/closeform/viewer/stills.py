"""Still views: three small drawings of a mission, for browsers without WebGL and for print."""

from collections.abc import Callable, Iterator
from html import escape
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.plots.drawing.palette import INK, ZONE
from closeform.viewer.scene import Scene
from closeform.viewer.shown import Shown
from closeform.viewer.tracks import before
from closeform.zones.outlines import PLANES, shadow

POINTS, FEWEST, MOST = 4000, 8, 120  # points of all tracks of a stage in one view; limits for one track
SIDE, BELOW = 300.0, 36.0  # pixels of a view, and of the text area below it
NAMED, APART = 16, (26.0, 12.0)  # largest number of craft with names; pixels between names
ZONES = 60  # largest number of drawn zones

Placed = Callable[[Floats], Floats]


def stills(scene: Scene) -> str:
    """Return the tracks of all craft in three planes as SVG, with craft and zones at the closest approach."""
    shown = scene.shown
    time = moment(scene.record)
    views = "\n".join(view(shown, scene.record, plane, time) for plane in PLANES)
    return f"<div>{views}</div>\n<p>Craft and zones are shown at {time:.1f} s.</p>"


def moment(record: dict[str, Any]) -> float:
    """Return the time [s] of the closest approach, or the end of the scene."""
    return float(record["approaches"][0]["time"] if record["approaches"] else record["end"])


def view(shown: Shown, record: dict[str, Any], plane: tuple[int, int], time: float) -> str:
    """Return one plane of the whole scene as SVG, at the scale of the other planes, on white."""
    low, high = np.array(record["low"]), np.array(record["high"])
    scale = SIDE / float((high - low).max())
    middle = 0.5 * (low + high)[list(plane)]

    def placed(points: Floats) -> Floats:
        flat = (points[..., list(plane)] - middle) * scale
        return np.asarray(flat * [1.0, -1.0] + SIDE / 2.0)

    right, up = (record["axes"][axis] for axis in plane)
    result = next(one for one in shown.results if time <= one.end)
    places = placed(result.after.paths.position(time))
    look = f'font-family="sans-serif" font-size="12" fill="{INK}"'
    parts = [
        f'<rect width="{SIDE:g}" height="{SIDE + BELOW:g}" fill="white"/>',
        *zones(shown, plane, places, scale),
        *lines(shown, record, placed),
        *marks(record["craft"], places),
        f'<text x="6" y="{SIDE + 12:g}">{right} to the right, {up} upwards</text>',
        f'<text x="6" y="{SIDE + 28:g}">{SIDE / scale:.4g} m across</text>',
    ]
    label = f"{len(places)} craft, {right} and {up}"
    return (
        f'<svg viewBox="0 0 {SIDE:g} {SIDE + BELOW:g}" role="img" aria-label="{label}" '
        f'xmlns="http://www.w3.org/2000/svg" {look}>{"".join(parts)}</svg>'
    )


def lines(shown: Shown, record: dict[str, Any], placed: Placed) -> Iterator[str]:
    """Yield the tracks; those without avoidance are dashed."""
    craft = record["craft"]
    count = int(np.clip(POINTS / len(craft), FEWEST, MOST))
    for result in shown.results:
        for k, path in before(result):
            points = path.position(np.linspace(path.start, path.end, count))
            yield line(placed(points), craft[k]["colour"], 'stroke-dasharray="4 3" stroke-opacity="0.6"')
        times = np.linspace(result.start, result.end, count)
        for k, points in enumerate(result.after.paths.position(times)):
            yield line(placed(points), craft[k]["colour"], 'stroke-width="1.6"')


def line(points: Floats, colour: str, look: str) -> str:
    """Return a polyline through points (K, 2)."""
    return f'<polyline points="{steps(points)}" fill="none" stroke="{colour}" {look}/>'


def steps(points: Floats) -> str:
    """Return points (K, 2) in the format of an SVG point list."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def marks(craft: list[dict[str, Any]], places: Floats) -> Iterator[str]:
    """Yield a dot for each craft; in a small formation also the names that fit."""
    written: list[Floats] = []
    for one, place in zip(craft, places, strict=True):
        x, y = place
        yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{one["colour"]}"/>'
        free = all((np.abs(place - other) > APART).any() for other in written)
        if len(craft) <= NAMED and free:
            written.append(place)
            beside = f'x="{x - 6:.1f}" text-anchor="end"' if x > 0.8 * SIDE else f'x="{x + 6:.1f}"'
            yield f'<text {beside} y="{y - 5:.1f}">{escape(one["name"])}</text>'


def zones(shown: Shown, plane: tuple[int, int], places: Floats, scale: float) -> Iterator[str]:
    """Yield the outlines of zones around their craft."""
    for k, place in enumerate(places[:ZONES]):
        if (zone := shown.around[k]) is not None:
            outline = shadow(zone, np.eye(3)[list(plane)])[::4] * scale * [1.0, -1.0] + place
            yield f'<polygon points="{steps(outline)}" fill="{ZONE}" fill-opacity="0.18" stroke="{ZONE}"/>'
