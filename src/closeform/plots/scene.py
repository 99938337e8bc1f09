"""Zones and tracks as they are drawn in the planes and in space."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from closeform.arrays import Floats
from closeform.zones.shapes import CUBE
from closeform.zones.zone import Zone

PLANES = ((1, 0), (1, 2), (2, 0))  # horizontal and vertical axis: radial upwards
AROUND = np.linspace(0, 2 * np.pi, 145)
CIRCLE: Floats = np.stack([np.cos(AROUND), np.sin(AROUND)], axis=-1)


def shadow(zone: Zone, basis: Floats) -> Floats:
    """Outline (K, 2) of a zone seen along the normal of a plane, `basis` its unit vectors (2, 3)."""
    half_axes = basis @ np.linalg.inv(zone.matrix)
    reach = CIRCLE @ half_axes
    support = np.sign(reach) if zone.shape == CUBE else reach / np.linalg.norm(reach, axis=1, keepdims=True)
    outline: Floats = support @ half_axes.T
    return outline


def section(zone: Zone, basis: Floats) -> Floats:
    """Outline (K, 2) of the cut through a zone's centre by a plane of unit vectors `basis` (2, 3)."""
    outline: Floats = CIRCLE / zone.norm(CIRCLE @ basis)[:, None]
    return outline


def shell(zone: Zone) -> list[Floats]:
    """Lines (K, 3) that show a zone in space: a box's edges, an ellipsoid's circles."""
    half_axes = np.linalg.inv(zone.matrix)
    if zone.shape == CUBE:
        corners = np.array([(i, j, k) for i in (-1.0, 1) for j in (-1.0, 1) for k in (-1.0, 1)])
        apart = np.abs(corners[:, None] - corners[None]).sum(axis=2)
        lines = [corners[[a, b]] for a, b in np.argwhere(np.triu(apart == 2))]
    else:
        lines = []
        for axis in range(3):
            for height in (-0.6, 0.0, 0.6):
                ring = np.insert(CIRCLE * np.sqrt(1 - height**2), axis, height, axis=1)
                lines.append(ring)
    return [line @ half_axes.T for line in lines]


def spot(basis: Floats, point: Floats) -> tuple[float, float]:
    """A position (3,) in a plane."""
    right, up = basis @ point
    return float(right), float(up)


def square(axes: Axes, middle: Any, reach: float) -> None:
    """Equal scales, and as far in each direction."""
    axes.set_xlim(middle[0] - reach, middle[0] + reach)
    axes.set_ylim(middle[1] - reach, middle[1] + reach)
    axes.set_aspect("equal")
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.yaxis.set_major_locator(MaxNLocator(6))


def place(axes: Axes, outline: Floats, centre: Any, **look: Any) -> None:
    """Draw an outline around a centre (2,)."""
    axes.fill(*(outline + centre).T, **look)
