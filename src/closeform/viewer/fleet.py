"""Craft of a scene with their models and zones, and the zone of each pair."""

from typing import Any

import numpy as np

from closeform.motion.arc import IMPULSE
from closeform.plots.drawing.palette import colours, written
from closeform.viewer.shown import Shown
from closeform.viewer.thrusts import thrusting
from closeform.zones.combined_zones import key
from closeform.zones.made_table import MadeTable
from closeform.zones.outlines import drawn
from closeform.zones.pair_zones import PairZones
from closeform.zones.shapes import BALL, CUBE, CYLINDER, FACES
from closeform.zones.solids import Sphere
from closeform.zones.zone import Zone

BODY = 0.25  # of the largest ball in a zone: size of the model of a craft without a hard body
SMALL = 0.008  # of the scene: size of the model without a zone either
NAMES = {BALL: "ball", CUBE: "box", CYLINDER: "cylinder", FACES: "faces"}


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
        "axes": np.linalg.inv(zone.matrix).ravel().tolist(),
        "corners": shown.vertices.tolist() if zone.shape == FACES else [],
        "radius": shown.radius,
    }


def fleet(shown: Shown, solids: Solids, size: float) -> list[dict[str, Any]]:
    """Return every `Craft` of web/scene.d.ts; the scene is `size` [m] wide."""
    columns = shown.names, colours(len(shown.names)), shown.around, shown.bodies, movers(shown).tolist()
    records = []
    for name, colour, zone, body, moves in zip(*columns, strict=True):
        model = body if body is not None else SMALL * size if zone is None else BODY * zone.inner_radius
        records.append(
            {
                "name": name,
                "colour": written(colour),
                "zone": solids.index(zone),
                "body": solids.index(None if body is None else Sphere(body)),
                "moves": moves,
                "size": float(model),
            }
        )
    return records


def movers(shown: Shown) -> Any:
    """Return whether each craft (N,) is known to thrust in any stage."""
    found = np.zeros(len(shown.names), dtype=bool)
    for result in shown.results:
        paths = result.after.paths
        pushed = np.abs(paths.arcs[:, IMPULSE : IMPULSE + 3]).any(axis=1) | thrusting(paths)
        found |= np.logical_or.reduceat(pushed, paths.offsets[:-1])
    return found


def pairs(zones: PairZones, solids: Solids) -> dict[str, Any] | None:
    """Return the `Pairs` of web/scene.d.ts; None if the zones are too many for a table."""
    if isinstance(zones.table, MadeTable):
        return None
    index = [*(solids.index(zone) for zone in zones.zones), -1]
    table = [[index[zone] for zone in row] for row in zones.table.tolist()]
    last = len(table) - 1
    return {
        "kind": [last if kind < 0 else kind for kind in zones.kinds.tolist()],
        "table": table,
        "moves": zones.moves.tolist(),
    }
