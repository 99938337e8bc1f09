"""Craft of a scene: their models, their zones, and the zone of each pair."""

from typing import Any

import numpy as np

from closeform.motion.arc import IMPULSE
from closeform.plots.drawing.palette import colours, written
from closeform.viewer.shown import Shown
from closeform.viewer.solids import Solids
from closeform.viewer.thrusts import thrusting
from closeform.zones.made_table import MadeTable
from closeform.zones.pair_zones import PairZones
from closeform.zones.solids import Sphere

BODY = 0.25  # of the largest ball in a zone: size of the model of a craft without a hard body
SMALL = 0.008  # of the scene: size of the model without a zone either


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
