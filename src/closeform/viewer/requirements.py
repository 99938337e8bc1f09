"""Requirements on the paths of craft: regions that they must not leave, and speeds with their limits."""

from collections.abc import Iterator
from math import tan
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import AvoidResult, StageResult
from closeform.planning.requirements import ApproachCone, KeepIn, SpeedLimit
from closeform.viewer.fleet import Solids
from closeform.viewer.shown import Shown
from closeform.viewer.thrusts import instants, with_joints
from closeform.zones.solids import HalfSpaces

Record = dict[str, Any]
SIDES = 36  # of the pyramid that stands for a corridor; less than 0.4 % wider than the cone
SHORTEST = 1.0  # radii at the target: the least length of a corridor


def required(result: StageResult[Any, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the requirements on the path of the craft of a stage, each with its name."""
    if isinstance(result.result, AvoidResult):
        yield from result.result.required.items()


def regions(shown: Shown, solids: Solids) -> list[Record]:
    """Return every `Region` of web/scene.d.ts."""
    found = []
    for result in shown.results:
        for name, one in required(result):
            if isinstance(one, KeepIn):
                zone, middle = one.zone, one.centre
            elif isinstance(one, ApproachCone):
                zone, middle = frustum(one, result.after.path(result.result.craft).position(instants(result)))
            else:
                continue
            found.append(
                {
                    "name": name,
                    "craft": result.after.names.index(result.result.craft),
                    "stage": result.number,
                    "start": max(one.start, result.start),
                    "end": min(one.end, result.end),
                    "zone": solids.index(zone),
                    "middle": middle.tolist(),
                }
            )
    return found


def frustum(corridor: ApproachCone, places: Floats) -> tuple[HalfSpaces, Floats]:
    """Return a corridor from the target as far as `places` (K, 3) [m], and the middle of that part (3,)."""
    along = (places - corridor.target) @ corridor.axis
    half = 0.5 * max(float(along.max()), SHORTEST * corridor.radius)
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1) @ np.linalg.svd(corridor.axis[None])[2][1:]
    slope = tan(corridor.half_angle)
    normals = np.concatenate([around - slope * corridor.axis, [corridor.axis, -corridor.axis]])
    reach = (corridor.radius + half * slope) / np.linalg.norm(normals[0])
    offsets = np.append(np.full(SIDES, reach), [half, half])
    return HalfSpaces(normals, offsets), corridor.target + half * corridor.axis


def speeds(shown: Shown) -> Iterator[tuple[int, Floats, Floats, Floats]]:
    """Yield each craft with a speed limit, with times (K,) [s], its speeds and the limits (K,) [m/s].

    A limit is nan at times when it does not hold.
    """
    found: dict[int, list[Floats]] = {}
    for result in shown.results:
        for _, one in required(result):
            if isinstance(one, SpeedLimit):
                path = result.after.path(result.result.craft)
                times = with_joints(path, instants(result))
                states = path.state(times)
                speed = np.linalg.norm(states[:, 3:], axis=1)
                holds = (times >= one.start) & (times <= one.end)
                limit = np.where(holds, speed + one.margin(states), np.nan)
                craft = result.after.names.index(result.result.craft)
                found.setdefault(craft, []).append(np.stack([times, speed, limit]))
    for craft, parts in found.items():
        yield (craft, *np.concatenate(parts, axis=1))
