"""Drawing of zones, tracks and direction arrows in the planes and in space."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.path import Path as Outline
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import IdentityTransform

from closeform.arrays import Floats

HEAD = np.array([[1.0, 0.0], [-0.8, 0.75], [-0.35, 0.0], [-0.8, -0.75], [1.0, 0.0]])  # arrowhead
ALONG = 0.35  # of the length of a track; tracks that swap places cross in the middle
SHORT = 0.04  # of the width of the axes: shorter tracks have no arrow


def spot(basis: Floats, point: Floats) -> tuple[float, float]:
    """Return the projection of a position (3,) onto a plane."""
    right, up = basis @ point
    return float(right), float(up)


def square(axes: Axes, middle: Any, reach: float) -> None:
    """Set equal scales and a square range around a centre."""
    axes.set_xlim(middle[0] - reach, middle[0] + reach)
    axes.set_ylim(middle[1] - reach, middle[1] + reach)
    axes.set_aspect("equal")
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.yaxis.set_major_locator(MaxNLocator(6))


def place(axes: Axes, outline: Floats, centre: Any, **look: Any) -> None:
    """Draw an outline around a centre (2,)."""
    axes.fill(*(outline + centre).T, **look)


def heading(track: Floats) -> Floats:
    """Return a point before the middle of a track (M, 3), and the direction there, as (2, 3)."""
    steps = np.diff(track, axis=0)
    far = np.cumsum(np.linalg.norm(steps, axis=1))
    k = int(np.searchsorted(far, far[-1] * ALONG))
    return np.array([(track[k] + track[k + 1]) / 2, steps[k]])


def headings(
    axes: Axes, project: Callable[[Floats], Floats], tracks: Sequence[Floats], tints: Any, size: float = 5.5
) -> Floats:
    """Draw a small arrowhead on each track (M, 3) along its motion; return the positions (K, 2).

    `project` maps positions to the figure, which has one scale in both directions; `size` is in typographic
    points.
    """
    long = SHORT * float(np.ptp(axes.get_xlim()))
    seen = [k for k, track in enumerate(tracks) if np.ptp(project(track), axis=0).max() > long]
    places = np.empty((len(seen), 2))
    heads = []
    for row, k in enumerate(seen):
        point, way = heading(tracks[k])
        places[row] = project(point)
        right, up = project(way) / max(float(np.linalg.norm(project(way))), np.finfo(float).tiny)
        heads.append(Outline(HEAD @ np.array([[right, up], [-up, right]])))
    if seen:
        look: dict[str, Any] = {
            "facecolors": np.asarray(tints)[seen],
            "edgecolors": "white",
            "linewidths": 0.1 * size,
        }
        look |= {"offsets": places, "offset_transform": axes.transData, "zorder": 3.6}
        marks = PathCollection(heads, [size**2], **look)
        marks.set_transform(IdentityTransform())
        axes.add_collection(marks, autolim=False)
    return places
