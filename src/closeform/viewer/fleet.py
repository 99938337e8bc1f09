"""Fleet: who flies, what is drawn around everybody, and who keeps which zone with whom."""

from typing import Any

import numpy as np
from matplotlib.colors import to_hex

from closeform.mission_result import Mission
from closeform.motion.arc import IMPULSE, THRUST
from closeform.plots.tracks import colours
from closeform.viewer.solids import Solids
from closeform.zones.made_table import MadeTable
from closeform.zones.pair_zones import PairZones
from closeform.zones.solids import Sphere
from closeform.zones.zone import Zone

BODY = 0.25  # of the largest ball in a zone: the model of a craft whose size nobody gives
SMALL = 0.008  # of the scene, without a zone either


def fleet(mission: Mission, solids: Solids, size: float) -> list[dict[str, Any]]:
    """Every `Craft` of web/scene.d.ts; the scene is `size` [m] wide."""
    scenario, moving = mission.scenario, movers(mission)
    records = []
    for k, (craft, colour) in enumerate(zip(scenario.craft, colours(len(scenario.craft)), strict=True)):
        zone, body = around(mission, k), craft.hard_body
        model = body if body is not None else SMALL * size if zone is None else BODY * zone.inner_radius
        records.append(
            {
                "name": craft.name,
                "colour": to_hex(colour),
                "zone": solids.index(zone),
                "body": solids.index(None if body is None else Sphere(body)),
                "moves": bool(moving[k]),
                "size": float(model),
            }
        )
    return records


def movers(mission: Mission) -> Any:
    """Which craft (N,) thrust in any stage."""
    found = np.zeros(len(mission.scenario.craft), dtype=bool)
    for result in mission.results:
        paths = result.after.paths
        pushed = np.abs(paths.arcs[:, IMPULSE : IMPULSE + 3]).any(axis=1) | paths.arcs[:, THRUST:].any(axis=1)
        found |= np.logical_or.reduceat(pushed, paths.offsets[:-1])
    return found


def around(mission: Mission, k: int) -> Zone | None:
    """The zone that is drawn around a craft: its own region, else the largest that it keeps with anybody."""
    own = mission.scenario.keep_out[k]
    if own is None:
        return None
    if isinstance(own, Zone):
        return own
    kinds = mission.scenario.zones.kinds
    firsts = {int(kind): other for other, kind in enumerate(kinds) if other != k}
    kept = [mission.scenario.zones.between(other, k) for other in firsts.values()]
    return max(filter(None, kept), key=lambda zone: zone.radius, default=None)


def pairs(zones: PairZones, solids: Solids) -> dict[str, Any] | None:
    """The `Pairs` of web/scene.d.ts; None where craft are too many and too unlike for a table."""
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
