"""Obstacles of a plan as one batch of paths, with their names and zones."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from closeform.arrays import sequence, shown
from closeform.motion.arc import STATE
from closeform.motion.joining import stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.zones.combined_zones import OwnZone, pair_zone
from closeform.zones.pair_zones import PairZones, pair_zones
from closeform.zones.zone import Zone

Zones = tuple[tuple[Zone, Any], ...]  # each with its pairs (M, 2)


def obstacle_batch(orbit: Orbit, obstacles: Path | Sequence[Path] | None) -> Path | None:
    """Return a Path of shape (M,) from one path, a batch or a sequence of paths; None without obstacles.

    Raises ValueError for other objects, another shape, or another orbit.
    """
    some = [obstacles] if isinstance(obstacles, Path) else () if obstacles is None else obstacles
    some = list(some) if isinstance(some, Iterable) else [some]
    if not all(isinstance(one, Path) for one in some):
        raise ValueError(f"obstacles: expected paths, got {shown(obstacles)}")
    if any(one.orbit != orbit for one in some):
        raise ValueError("obstacles: must be in the same orbit as the planned paths")
    if len(some) == 1 and len(some[0].shape) == 1:
        return some[0] if len(some[0]) else None
    if wrong := next((one.shape for one in some if one.shape), None):
        raise ValueError(f"obstacles: expected a Path of shape (M,) or paths, got shape {wrong}")
    return stack(some) if some else None


def obstacle_names(names: Sequence[str] | None, obstacles: Path | None) -> tuple[str, ...]:
    """Return the names of M obstacles: unless given, their number, which counts from 1, and their start.

    A single obstacle is "the obstacle".

    Raises ValueError for another number of names.
    """
    count = 0 if obstacles is None else len(obstacles)
    if names is None and count == 1:
        return ("the obstacle",)
    if names is None:
        starts: Any = [] if obstacles is None else obstacles.arcs[obstacles.offsets[:-1], STATE : STATE + 3]
        places = ("(" + " ".join(f"{number:.4g}" for number in place + 0.0) + " m)" for place in starts)
        return tuple(f"obstacle {k} of {count} at {place}" for k, place in enumerate(places, 1))
    given = tuple(sequence("names", names, str))
    if len(given) != count:
        raise ValueError(f"names: give one for each of {count} obstacles, got {shown(names)}")
    return given


def zones_around(zone: OwnZone | Sequence[OwnZone] | PairZones, count: int) -> Zones:
    """Return the zones between one craft and `count` obstacles, each with its pairs.

    The craft has no zone of its own unless `PairZones` are given.
    """
    if isinstance(zone, PairZones):
        return tuple(pair_zones("zone", zone, 1, count).groups())
    given = [zone] * count if isinstance(zone, OwnZone) else list(zone) if isinstance(zone, Sequence) else []
    if not given or not all(isinstance(one, OwnZone) for one in given):
        raise ValueError(f"zone: expected a zone, or one for each obstacle, got {shown(zone)}")
    if len(given) != count:
        raise ValueError(f"zone: give one zone, or one for each of {count} obstacles, got {len(given)}")
    alike: dict[int, list[int]] = {}
    for k, own in enumerate(given):
        alike.setdefault(id(own), []).append(k)
    return tuple(
        (pair_zone(given[those[0]], None)[0], np.array([[0, 1 + k] for k in those]))
        for those in alike.values()
    )
