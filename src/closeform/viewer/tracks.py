"""Tracks of all craft in all stages: as executed, before avoidance and as planned."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import StageResult
from closeform.motion.path import Path
from closeform.viewer.nodes import nodes_of
from closeform.viewer.numbers import Numbers
from closeform.viewer.shown import Shown

Record = dict[str, Any]
DETAIL = 1e-4  # of the scene's size: tolerance of a track
ZONE_DETAIL = 0.01  # of the smallest zone, which can fill the page in a close view
ROUNDING = 2.0**-22  # of the largest coordinate: two roundings to Float32


def error_for(corners: Floats, smallest: float | None) -> float:
    """Return the tolerance [m] of tracks within two `corners`; `smallest`: radius of the smallest zone."""
    wide = float(np.linalg.norm(corners[1] - corners[0]))
    wanted = DETAIL * wide if smallest is None else min(DETAIL * wide, ZONE_DETAIL * smallest)
    return max(wanted, ROUNDING * float(np.abs(corners).max()), 1e-6)


def track(numbers: Numbers, path: Path, craft: int, stage: int, kind: str, error: float) -> Record:
    """Return one `Track` of web/scene.d.ts for one craft's path."""
    nodes = nodes_of(path, 0.5 * error)  # Float32 rounding takes the other half
    return {
        "craft": craft,
        "stage": stage,
        "kind": kind,
        "start": float(path.start),
        "end": float(path.end),
        "times": numbers.block(nodes.times, "f8"),
        "states": numbers.block(nodes.states),
    }


def tracks(shown: Shown, numbers: Numbers, error: float) -> list[Record]:
    """Return every track except drifts after a failure; executed paths ("flown") come first."""
    return [
        track(numbers, path, craft, result.number, kind, error)
        for kind, ways in (("flown", executed), ("before", before), ("planned", planned))
        for result in shown.results
        for craft, path in ways(result)
    ]


def executed(result: StageResult[Any, Any]) -> Iterator[tuple[int, Path]]:
    """Yield the index and the executed path of every craft."""
    paths = result.after.paths
    yield from ((k, paths[k]) for k in range(len(paths)))


def before(result: StageResult[Any, Any]) -> Iterator[tuple[int, Path]]:
    """Yield the paths before avoidance of craft whose planned paths differ."""
    yield from differing(result.before.paths, result.planned.paths)


def planned(result: StageResult[Any, Any]) -> Iterator[tuple[int, Path]]:
    """Yield the planned paths of craft that fire pulses instead."""
    yield from differing(result.planned.paths, result.after.paths)


def differing(paths: Path, others: Path) -> Iterator[tuple[int, Path]]:
    """Yield the index and path of each craft whose path differs from that in `others`."""
    if paths is others:
        return
    for k in range(len(paths)):
        one, other = paths[k], others[k]
        if one.arcs.shape != other.arcs.shape or (one.arcs != other.arcs).any():
            yield k, one
