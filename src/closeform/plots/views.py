"""Views in space: from where one looks, what they hold, and which track passes over which."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from closeform.arrays import Floats
from closeform.plots.camera import Camera, framing, scale_bar, triad

SUNWARD = np.array([0.0, 0.0, -1.0])  # in deep space, where searches have the sun
OBLIQUE = Camera.around(-0.45, 0.5, SUNWARD, np.array([0.0, 1.0, 0.0]))  # the sun is above
ORBITAL = Camera.at([0.75, -0.45, -0.5], [1.0, 0.0, 0.0])  # radial up, along-track to the right
AXES = ("radial", "along", "cross")  # of an orbit
FOOT = 0.9  # inches for the scale and the directions
LETTER, LENGTH = 0.1, 0.45  # inches of a letter, and of a direction
LAYERS = 40  # of depth


def window(axes: Axes, points: Floats, camera: Camera, directions: Sequence[str], above: float) -> None:
    """Limits that hold points (M, 2) `above` inches below a title, with a scale bar and the directions."""
    wide, high = (float(pixels / axes.figure.dpi) for pixels in axes.get_window_extent().size)  # inches
    middle, width = framing(points, wide, high - above - FOOT, 1.1)
    inch = (width or 1.0) / wide
    floor = middle[1] - ((high - above - FOOT) / 2 + FOOT) * inch
    axes.set_xlim(middle[0] - inch * wide / 2, middle[0] + inch * wide / 2)
    axes.set_ylim(floor, floor + inch * high)
    scale_bar(axes, inch * wide)
    letters = LETTER * max(map(len, directions))  # one may point to the left
    down = max(0.0, -float(camera(np.eye(3))[:, 1].min()))  # one may point there
    corner = np.array([axes.get_xlim()[0] + (0.5 + letters) * inch, floor + (0.3 + LENGTH * down) * inch])
    triad(axes, camera, corner, LENGTH * inch, dict(zip(directions, np.eye(3), strict=True)))


def layered(camera: Camera, tracks: Sequence[Floats]) -> tuple[list[int], list[Floats]]:
    """Pieces (K, 2) of tracks (M, 3) from back to front, and of which track each is.

    Within a layer of depth tracks keep one order, and all are cut where it ends, so that those that
    merge do not cut each other into dashes.
    """
    depths = [camera.nearness(track) for track in tracks]
    low, high = min(map(np.min, depths)), max(map(np.max, depths))
    pieces = []
    for k, (track, depth) in enumerate(zip(tracks, depths, strict=True)):
        seen, layer = camera(track), np.floor((depth - low) * LAYERS / ((high - low) or 1.0))
        cuts = [0, *(np.flatnonzero(np.diff(layer)) + 1).tolist(), len(seen) - 1]
        pieces += [(layer[one], k, seen[one : other + 1]) for one, other in pairwise(cuts)]
    pieces.sort(key=lambda piece: piece[:2])
    return [k for _, k, _ in pieces], [piece for *_, piece in pieces]
