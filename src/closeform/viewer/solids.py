"""Zones as the page draws them and as it measures clearance."""

from itertools import combinations
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.zones.combined_zones import key
from closeform.zones.outlines import drawn
from closeform.zones.shapes import BALL, CUBE, CYLINDER, FACES
from closeform.zones.zone import Zone

NAMES = {BALL: "ball", CUBE: "box", CYLINDER: "cylinder", FACES: "faces"}
ON = 1e-9  # of a face's offset: tolerance for a corner on the face


class Solids:
    """Zones of a scene, each stored once, in order of first use."""

    def __init__(self) -> None:
        self.records: list[dict[str, Any]] = []
        self._found: dict[Any, int] = {}

    def index(self, zone: Zone | None) -> int:
        """Return the index of a zone among the records; -1 for None."""
        if zone is None:
            return -1
        number = self._found.setdefault(key(zone), len(self.records))
        if number == len(self.records):
            self.records.append(record(zone))
        return number


def record(zone: Zone) -> dict[str, Any]:
    """Return the `Zone` of web/scene.d.ts."""
    shown = drawn(zone)
    return {
        "shape": NAMES[zone.shape],
        "norm": zone.matrix.ravel().tolist(),
        "axes": np.linalg.inv(zone.matrix).ravel().tolist(),
        "faces": zone.faces.tolist(),
        "mesh": mesh(shown) if zone.shape == FACES else None,
        "radius": shown.radius,
    }


def mesh(zone: Zone) -> dict[str, Any]:
    """Return the corners, outward triangles and edges of a bounded zone of half-spaces."""
    corners, ways = zone.vertices, zone.faces @ zone.matrix
    on = corners @ ways.T > 1.0 - ON
    triangles = [
        triangle for face, normal in zip(on.T, ways, strict=True) for triangle in fan(corners, face, normal)
    ]
    edges = [[a, b] for a, b in combinations(range(len(corners)), 2) if int((on[a] & on[b]).sum()) > 1]
    return {"corners": corners.tolist(), "triangles": triangles, "edges": edges}


def fan(corners: Floats, face: Any, normal: Floats) -> list[list[int]]:
    """Return the triangles of one face, whose normal is along `normal`, counterclockwise."""
    members = np.flatnonzero(face)
    if len(members) < 3:
        return []
    middle = corners[members].mean(axis=0)
    right = corners[members[0]] - middle
    up = np.cross(normal, right)
    spokes = corners[members] - middle
    around = np.arctan2(spokes @ up / np.linalg.norm(up), spokes @ right / np.linalg.norm(right))
    ordered = members[np.argsort(around)].tolist()
    return [[ordered[0], one, other] for one, other in zip(ordered[1:-1], ordered[2:], strict=True)]
