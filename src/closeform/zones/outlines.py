"""Outlines of zones: projections and sections in a plane, and edges in space."""

import numpy as np

from closeform.arrays import Floats
from closeform.zones.shapes import CUBE, CYLINDER, FACES
from closeform.zones.solids import HalfSpaces
from closeform.zones.zone import LEADING, Zone, face_normals

PLANES = ((1, 0), (1, 2), (2, 0))  # horizontal and vertical axis; radial is up
AROUND = np.linspace(0, 2 * np.pi, 145)
OPEN = 3.0  # offset, in farthest face offsets, at which an unbounded zone is cut off
CIRCLE: Floats = np.stack([np.cos(AROUND), np.sin(AROUND)], axis=-1)


def drawn(zone: Zone) -> Zone:
    """Return a bounded zone, or an unbounded one cut off at three times its farthest face offset."""
    if zone.bounded:
        return zone
    ways = face_normals(zone)
    offsets = 1.0 / np.linalg.norm(ways, axis=1)
    ends = np.concatenate([np.eye(3), -np.eye(3)])
    return HalfSpaces(np.concatenate([ways, ends]), np.append(offsets, np.full(6, OPEN * offsets.max())))


def touched(zone: Zone, ways: Floats) -> Floats:
    """Return the points (K, 3) of a zone that are farthest along directions (K, 3)."""
    if zone.shape == FACES:
        corners = zone.vertices
        return np.asarray(corners[(ways @ corners.T).argmax(axis=1)])
    half_axes = np.linalg.inv(zone.matrix)
    q = ways @ half_axes
    leading = LEADING.get(zone.shape, 0)
    sizes = np.linalg.norm(q[:, :leading], axis=1, keepdims=True)
    q[:, :leading] /= np.where(sizes > 0.0, sizes, 1.0)
    q[:, leading:] = np.sign(q[:, leading:])
    return np.asarray(q @ half_axes.T)


def shadow(zone: Zone, basis: Floats) -> Floats:
    """Return the outline (K, 2) of a zone projected on a plane with unit vectors `basis` (2, 3)."""
    outline: Floats = touched(drawn(zone), CIRCLE @ basis) @ basis.T
    return outline


def section(zone: Zone, basis: Floats) -> Floats:
    """Return the outline (K, 2) of the section through a zone's centre, by a plane with `basis` (2, 3)."""
    outline: Floats = CIRCLE / drawn(zone).norm(CIRCLE @ basis)[:, None]
    return outline


def shell(zone: Zone) -> list[Floats]:
    """Return lines (K, 3) that outline a zone in space: edges of flat faces, circles on round ones."""
    zone = drawn(zone)
    if zone.shape in (CUBE, FACES):
        corners = zone.vertices
        on = corners @ face_normals(zone).T > 1.0 - 1e-9
        shared = on.astype(int) @ on.T.astype(int)  # number of faces that two corners share
        return [corners[[a, b]] for a, b in np.argwhere(np.triu(shared >= 2, 1))]
    half_axes = np.linalg.inv(zone.matrix)
    if zone.shape == CYLINDER:
        lines = [np.insert(CIRCLE, 2, height, axis=1) for height in (-1.0, -0.5, 0.0, 0.5, 1.0)]
        lines += [np.array([[x, y, -1.0], [x, y, 1.0]]) for x, y in CIRCLE[:-1:18]]
    else:
        lines = [
            np.insert(CIRCLE * np.sqrt(1 - height**2), axis, height, axis=1)
            for axis in range(3)
            for height in (-0.6, 0.0, 0.6)
        ]
    return [line @ half_axes.T for line in lines]
