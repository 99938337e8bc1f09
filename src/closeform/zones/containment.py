"""Containment of one zone in another, by the largest norm over it."""

import numpy as np

from closeform.arrays import Floats
from closeform.zones.shapes import BALL, CYLINDER, FACES
from closeform.zones.zone import LEADING, Zone

ROUNDING = 1e-9


def containing_zone(*zones: Zone) -> Zone | None:
    """Return the zone that contains all others; None if there is none, as for a cigar and a disc."""
    for zone in zones:
        if all(greatest_norm(zone, other) <= 1.0 + ROUNDING for other in zones):
            return zone
    return None


def greatest_norm(outer: Zone, inner: Zone) -> float:
    """Return the largest norm of `outer` over the zone `inner`: at most 1 if it contains it; may be inf."""
    if outer.shape == FACES:
        return float(np.max(inner.support(outer.faces @ outer.matrix)))
    leading = LEADING.get(outer.shape, 0)
    flat = outer.matrix[leading:]
    parts = [np.max(inner.support(way)) for way in (flat, -flat) if len(flat)]
    if leading:
        parts.append(greatest_length(outer.matrix[:leading], inner))
    return float(max(parts))


def greatest_length(rows: Floats, inner: Zone) -> float:
    """Return the largest |rows r| over a zone, attained at a corner, along an axis or on a rim."""
    if not inner.bounded:
        return np.inf
    image = rows @ np.linalg.inv(inner.matrix)
    if inner.shape == BALL:
        return float(np.linalg.norm(image, 2))
    if inner.shape != CYLINDER:
        return float(np.linalg.norm(inner.vertices @ rows.T, axis=1).max())
    # |a cos u + b sin u + c|^2 around the rim has its extrema at roots of a quartic in exp(iu); the other
    # rim is the mirror image
    a, b, c = image.T
    second = a @ b + 0.5j * (a @ a - b @ b)
    first = b @ c + 1j * (a @ c)
    turns = np.roots([second, first, 0.0, first.conjugate(), second.conjugate()])
    angles = np.append(np.angle(turns), 0.0)
    rim = a * np.cos(angles)[:, None] + b * np.sin(angles)[:, None] + c
    return float(np.linalg.norm(rim, axis=1).max())
