"""Shadows of zones along the track: where a drift along the track passes a zone at some time."""

from functools import lru_cache

import numpy as np

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.zones.shapes import BALL, CUBE, CYLINDER, FACES
from closeform.zones.zone import Zone, enclosing

ALONG = 1e-14  # of a face: a smaller component is along the track


@lru_cache(maxsize=64)
def shadow_form(zone: Zone) -> tuple[int, Floats, Floats]:
    """Return the shadow of a zone along the track, as the form of an unbounded zone.

    For half-spaces, and for cylinders oblique to the track, it is that of an enclosing ellipsoid.
    """
    if zone.shape == CUBE:  # a hexagon, with two sides along the shadow of each edge
        edges = np.linalg.inv(zone.matrix)
        normals = np.cross([0.0, 1.0, 0.0], edges.T)
        reach = np.abs(normals @ edges).sum(axis=1, keepdims=True)
        return CUBE, normals / np.where(reach > 0.0, reach, 1.0), np.empty((0, 3))
    slanting = zone.matrix[:2, 1].any() and zone.matrix[2, 1] != 0.0
    own = zone.shape == CYLINDER and not slanting
    shape, matrix = (CYLINDER, zone.matrix) if own else (BALL, enclosing(zone))
    along = matrix[:, 1]
    square = float(along @ along)
    shadow = matrix - np.outer(along, along @ matrix) / square if square > 0.0 else matrix
    return shape, np.ascontiguousarray(shadow), np.empty((0, 3))


@lru_cache(maxsize=64)
def shadow_of_faces(zone: Zone) -> tuple[int, Floats, Floats] | None:
    """Return the shadow of half-spaces along the track, whose faces are along the track, or None.

    It has the faces along the track themselves, and for each two that lean against each other their mix; None
    where the track leads ever deeper into them, and for other zones.
    """
    if zone.shape != FACES:
        return None
    along = zone.matrix[:, 1]
    lean = zone.faces @ along
    flat = np.abs(lean) <= ALONG * np.linalg.norm(zone.faces, axis=1) * np.linalg.norm(along)
    up, down = np.flatnonzero((lean > 0.0) & ~flat), np.flatnonzero((lean < 0.0) & ~flat)
    share = lean[up, None, None] / (lean[up, None, None] - lean[down, None])
    mixed = zone.faces[up, None] + share * (zone.faces[down] - zone.faces[up, None])
    faces = np.concatenate([zone.faces[flat], mixed.reshape(-1, 3)])
    faces -= np.outer(faces @ along, along) / (along @ along)
    shadow = zone.matrix - np.outer(along, along @ zone.matrix) / (along @ along)
    return (FACES, np.ascontiguousarray(shadow), faces) if len(faces) else None


@lru_cache(maxsize=64)
def floor_of(zone: Zone) -> float:
    """Return a lower bound on all norms: 0, or -inf for half-spaces that some direction never leaves."""
    if zone.shape != FACES:
        return 0.0
    from scipy.optimize import nnls  # a third of a second, for these alone

    mixed = np.vstack([zone.faces.T, np.ones(len(zone.faces))])
    return 0.0 if nnls(mixed, np.array([0.0, 0.0, 0.0, 1.0]))[1] <= 1e-12 else -np.inf


@kernel()
def along_track(matrix):
    """Return the direction of the track in zone coordinates, and its squared length there."""
    x, y, z = matrix[0, 1], matrix[1, 1], matrix[2, 1]
    return (x, y, z), x * x + y * y + z * z


@kernel()
def is_shadow(shadow):
    """Return True if a form is a shadow along the track; for half-spaces it may be the zone itself."""
    return shadow[0] != FACES or along_track(shadow[1])[1] == 0.0
