"""Sums of zones: a zone that contains the Minkowski sum {a + b} of two zones.

Each zone is enlarged, in its own shape, to contain the sum, and the smaller of the two results is taken. For
two ellipsoids or spheres the result is the smallest of a family.              # theory (24)-(25)
"""

from math import pi, sqrt

import numpy as np

from closeform.arrays import Floats
from closeform.zones.containment import greatest_length
from closeform.zones.shapes import BALL, CUBE, CYLINDER, FACES
from closeform.zones.solids import HalfSpaces, Sphere
from closeform.zones.zone import LEADING, Zone, enclosing, face_normals

VOLUMES = {BALL: 4.0 * pi / 3.0, CUBE: 8.0, CYLINDER: 2.0 * pi}  # of unit shapes
HALVINGS = 60  # of the logarithm of p: full double precision from any start


def outer_sum(one: Zone, other: Zone) -> Zone:
    """Return a zone that contains the sum of two: the candidate of the smallest volume.

    Exact for spheres, for ellipsoids of one form, for boxes with the same axes and for cylinders about one
    axis. Raises ValueError where the sum is unbounded in every direction of a face.
    """
    if FACES in (one.shape, other.shape):
        return _between_planes(one, other)
    return min(_grown(one, other), _grown(other, one), key=_volume)


def padded(zone: Zone, metres: float) -> Zone:
    """Return a zone of the same shape that contains the sum with a ball of radius `metres`."""
    ball = Sphere(metres)
    return _between_planes(zone, ball) if zone.shape == FACES else _grown(zone, ball)


def _volume(zone: Zone) -> float:
    return float(VOLUMES[zone.shape] / abs(np.linalg.det(zone.matrix)))


def _grown(zone: Zone, other: Zone) -> Zone:
    """Return a zone of the first one's shape that contains the sum: each part of its norm is subadditive."""
    if zone.shape == BALL:
        return _ellipsoid(_half_axes(zone.matrix), _half_axes(enclosing(other)))
    matrix, leading = zone.matrix.copy(), LEADING.get(zone.shape, 0)
    if leading:
        matrix[:leading] /= 1.0 + greatest_length(matrix[:leading], other)
    matrix[leading:] /= 1.0 + other.support(matrix[leading:])[:, None]
    return Zone(zone.shape, matrix)


def _half_axes(matrix: Floats) -> Floats:
    return np.asarray(np.linalg.inv(matrix))


def _ellipsoid(one: Floats, other: Floats) -> Zone:
    """Return the smallest ellipsoid of the family (24) that contains the sum of two with half-axes H."""
    ratios = np.linalg.svd(np.linalg.solve(one, other), compute_uv=False)
    low, high = 1.0 / ratios[0], 1.0 / ratios[-1]
    for _ in range(HALVINGS):
        p = sqrt(low * high)
        if 3.0 * p / (1.0 + p) < (1.0 / (1.0 + p * ratios**2)).sum():  # theory (25)
            low = p
        else:
            high = p
    p = sqrt(low * high)
    # H H^T of both is never formed: a disc of relative thickness 1e-8 would lose its edge
    half_axes = np.concatenate([sqrt(1.0 + 1.0 / p) * one, sqrt(1.0 + p) * other], axis=1)
    upper = np.asarray(np.linalg.qr(half_axes.T, mode="r"))
    return Zone(BALL, np.linalg.inv(upper.T))


def _between_planes(one: Zone, other: Zone) -> Zone:
    """Return the half-spaces along the faces of either zone that bound their sum."""
    normals = np.concatenate([face_normals(one), face_normals(other)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ends = one.support(normals) + other.support(normals)
    if not np.isfinite(ends).any():
        raise ValueError("the sum of their zones is unbounded; give one of them a bounded zone")
    return HalfSpaces(normals[np.isfinite(ends)], ends[np.isfinite(ends)])
