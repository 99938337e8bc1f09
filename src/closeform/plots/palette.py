"""Colours of pictures and of the page that moves; they hold for the colour-blind and in grey."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from closeform.arrays import Floats

BEFORE, AFTER, ALTERNATIVE = "#5f6368", "#0072B2", "#009E73"
CONFLICT, ZONE, OTHER = "#D55E00", "#E69F00", "#8a9ba8"
INK, FAINT = "#202124", "#dadce0"


@dataclass(frozen=True)
class Direction:
    """One axis of the orbit's frame as it looks in every picture."""

    name: str
    colour: str
    dashes: Any


RADIAL = Direction("radial", "#332288", "-")
ALONG = Direction("along-track", "#1B8A7A", (0, (6, 2)))
CROSS = Direction("cross-track", "#AA4499", (0, (6, 1.5, 1.5, 1.5)))
DIRECTIONS = (RADIAL, ALONG, CROSS)

FEW = 8  # craft up to which colours are those of a list; more have shades from blue to yellow-green
COLOURS = (RADIAL.colour, AFTER, ALTERNATIVE, CROSS.colour, "#56B4E9", "#7a6a00", "#882255", BEFORE)
SHADES = (RADIAL.colour, AFTER, ALONG.colour, "#6aa84f", "#b5bd3a")


def colours(count: int) -> Floats:
    """A colour (RGBA) of each craft, none of them that of a conflict."""
    if count <= FEW:
        return rgba(COLOURS[:count])
    stops = rgba(SHADES)
    at = np.linspace(0.0, len(stops) - 1.0, count)
    return np.stack([np.interp(at, range(len(stops)), channel) for channel in stops.T], axis=1)


def rgba(written: tuple[str, ...]) -> Floats:
    """Opaque colours (K, 4) that are written as #rrggbb."""
    parts = [[*bytes.fromhex(colour[1:]), 255] for colour in written]
    return np.asarray(parts, dtype=np.float64).reshape(-1, 4) / 255.0


def written(colour: Floats) -> str:
    """A colour (RGB or RGBA) as #rrggbb."""
    return "#" + bytes(np.rint(255.0 * colour[:3]).astype(np.uint8)).hex()
