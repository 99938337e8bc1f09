"""Colours of figures and of the web page, chosen to be distinguishable with colour blindness and in grey."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from closeform.arrays import Floats

BEFORE, AFTER, ALTERNATIVE = "#5f6368", "#0072B2", "#009E73"
CONFLICT, ZONE, OTHER = "#D55E00", "#E69F00", "#8a9ba8"
INK, FAINT = "#202124", "#dadce0"


@dataclass(frozen=True)
class Direction:
    """Name, colour and line style of one axis of the orbital frame."""

    name: str
    colour: str
    dashes: Any


RADIAL = Direction("radial", "#332288", "-")
ALONG = Direction("along-track", "#1B8A7A", (0, (6, 2)))
CROSS = Direction("cross-track", "#AA4499", (0, (6, 1.5, 1.5, 1.5)))
DIRECTIONS = (RADIAL, ALONG, CROSS)

FEW = 8  # spacecraft that take their colours from a list; larger sets use shades from blue to yellow-green
COLOURS = (RADIAL.colour, AFTER, ALTERNATIVE, CROSS.colour, "#56B4E9", "#7a6a00", "#882255", BEFORE)
SHADES = (RADIAL.colour, AFTER, ALONG.colour, "#6aa84f", "#b5bd3a")


def colours(count: int) -> Floats:
    """Return an RGBA colour (N, 4) for each spacecraft; none equals the conflict colour."""
    if count <= FEW:
        return rgba(COLOURS[:count])
    stops = rgba(SHADES)
    at = np.linspace(0.0, len(stops) - 1.0, count)
    return np.stack([np.interp(at, range(len(stops)), channel) for channel in stops.T], axis=1)


def rgba(written: tuple[str, ...]) -> Floats:
    """Return opaque RGBA colours (K, 4) for #rrggbb strings."""
    parts = [[*bytes.fromhex(colour[1:]), 255] for colour in written]
    return np.asarray(parts, dtype=np.float64).reshape(-1, 4) / 255.0


def written(colour: Floats) -> str:
    """Return a colour (RGB or RGBA) as a #rrggbb string."""
    return "#" + bytes(np.rint(255.0 * colour[:3]).astype(np.uint8)).hex()


def dark(tint: Any) -> str:
    """Return a darker colour in which a name is readable, from an RGBA colour."""
    return written(0.75 * np.asarray(tint, dtype=np.float64))
