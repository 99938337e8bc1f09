"""Thrust of each craft: impulses, pulses, continuous thrust and cumulative delta-v."""

from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import StageResult
from closeform.motion.arc import END, IMPULSE, START, THRUST
from closeform.motion.path import Path, runs_of
from closeform.viewer.numbers import Numbers
from closeform.viewer.shown import Shown

Record = dict[str, Any]
SAMPLES, ALL_SAMPLES, FEWEST = 240, 24_000, 40  # instants of a stage: most of one craft, of all; fewest
JOINTS = 400  # largest number of arc ends that become instants of a path
NOTHING = 1e-9  # of the maximum thrust: rounding error during coasts


class Pushes(NamedTuple):
    """Impulses or pulses of a craft in order of time: `rows` (K, 5) [s, s, m/s], as in a `Burn`."""

    kind: str
    rows: Floats


def instants(result: StageResult[Any, Any]) -> Floats:
    """Return equally spaced instants [s] of a stage."""
    count = int(np.clip(ALL_SAMPLES / len(result.after.names), FEWEST, SAMPLES))
    return np.linspace(result.start, result.end, count + 1)


def with_joints(path: Path, times: Floats) -> Floats:
    """Return times with both sides of each joint between two arcs of one craft's path, if these are few."""
    joints = path.arcs[1:, START]
    if len(joints) > JOINTS:
        return times
    return np.unique(np.concatenate([times, joints, np.nextafter(joints, -np.inf)]))


def is_pulsed(result: StageResult[Any, Any], craft: int) -> bool:
    """Return True if the craft has on-off thrusters in a stage."""
    return result.pulsed is not None and result.after.names[craft] in result.pulsed.names


def pushes(result: StageResult[Any, Any], craft: int) -> Pushes:
    """Return the pulses of a craft with on-off thrusters, or else its impulses."""
    if result.pulsed is not None and is_pulsed(result, craft):
        pulses = result.pulsed.firing.pulses
        own = pulses[pulses.craft == result.pulsed.names.index(result.after.names[craft])]
        order = np.argsort(own.start, kind="stable")
        given = own.direction * own.impulse[:, None]
        return Pushes("pulse", np.column_stack([own.start, own.duration, given])[order])
    arcs = arcs_of(result.after.paths, craft)
    kicked = arcs[np.abs(arcs[:, IMPULSE : IMPULSE + 3]).any(axis=1)]
    jumps = kicked[:, IMPULSE : IMPULSE + 3]
    return Pushes("impulse", np.column_stack([kicked[:, START], np.zeros(len(kicked)), jumps]))


def arcs_of(paths: Path, craft: int) -> Floats:
    """Return the arcs of one craft of a formation."""
    return paths.arcs[paths.offsets[craft] : paths.offsets[craft + 1]]


def thrusting(paths: Path) -> Any:
    """Return whether thrust is known to act in each arc (M,); it is unknown on a path through samples."""
    return paths.arcs[:, THRUST:].any(axis=1) & ~paths.orbit._interpolates(paths.arcs)


def stretches(result: StageResult[Any, Any], craft: int) -> Floats:
    """Return the start and end [s] of each interval (K, 2) of continuous thrust, without pulses."""
    if is_pulsed(result, craft):
        return np.empty((0, 2))
    paths = result.after.paths
    arcs, on = arcs_of(paths, craft), thrusting(paths)[paths.offsets[craft] : paths.offsets[craft + 1]]
    first, last = runs_of(on).T
    return np.column_stack([arcs[first, START], arcs[last - 1, END]])


def thrust_of(result: StageResult[Any, Any], craft: int) -> tuple[Floats, Floats] | None:
    """Return times (K,) [s] and thrust accelerations (K, 3) [m/s^2], linear between the times.

    Return None for a craft without continuous thrust.
    """
    if not len(stretches(result, craft)):
        return None
    path = result.after.paths[craft]
    times = with_joints(path, instants(result))
    return times, path.thrust(times)


def thrusts(shown: Shown, numbers: Numbers) -> list[Record]:
    """Return every `Thrust` of web/scene.d.ts."""
    found = []
    for result in shown.results:
        for craft in range(len(result.after.names)):
            if (thrust := thrust_of(result, craft)) is None:
                continue
            times, pushed = thrust
            peak = float(np.linalg.norm(pushed, axis=1).max())
            rows = numbers.block(np.column_stack([times - result.start, pushed]))
            found.append(
                {"craft": craft, "stage": result.number, "start": result.start, "peak": peak, "rows": rows}
            )
    return found


def burns(shown: Shown, numbers: Numbers) -> list[Record]:
    """Return every `Burn` of web/scene.d.ts."""
    found = []
    for result in shown.results:
        for craft in range(len(result.after.names)):
            kind, rows = pushes(result, craft)
            if len(rows):
                peak = float(np.linalg.norm(rows[:, 2:], axis=1).max())
                block = numbers.block(rows, "f8")
                found.append(
                    {"craft": craft, "stage": result.number, "kind": kind, "peak": peak, "rows": block}
                )
    return found


def spent(result: StageResult[Any, Any], craft: int) -> tuple[Floats, Floats] | None:
    """Return times (K,) [s] and cumulative delta-v (K,) [m/s] of a stage; None without any delta-v."""
    total = float(result.delta_v[craft])
    if total == 0.0:
        return None
    thrust, (_, rows) = thrust_of(result, craft), pushes(result, craft)
    times = instants(result) if thrust is None else thrust[0]
    so_far = np.zeros(len(times))
    if thrust is not None:
        size = np.linalg.norm(thrust[1], axis=1)
        so_far = np.concatenate([[0.0], np.cumsum(0.5 * (size[1:] + size[:-1]) * np.diff(times))])
        lasting = total - float(np.linalg.norm(rows[:, 2:], axis=1).sum())
        so_far *= lasting / so_far[-1] if so_far[-1] > 0.0 else 0.0  # scaled to the closed-form total
    if is_pulsed(result, craft):
        return pulsed(times, rows)
    return jumping(times, so_far, rows[:, 0], np.linalg.norm(rows[:, 2:], axis=1))


def pulsed(times: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Return the times and the cumulative delta-v [m/s] of pulses; an active pulse counts in part."""
    begun = np.clip((times[:, None] - rows[:, 0]) / np.maximum(rows[:, 1], 1e-12), 0.0, 1.0)
    return times, begun @ np.linalg.norm(rows[:, 2:], axis=1)


def jumping(times: Floats, so_far: Floats, moments: Floats, sizes: Floats) -> tuple[Floats, Floats]:
    """Return a curve with jumps of `sizes` (M,) at `moments` (M,); each jump has two rows."""
    every = np.concatenate([moments, times, moments])
    jumps = np.concatenate([np.zeros(len(moments) + len(times)), sizes])
    order = np.argsort(every, kind="stable")  # the row before a jump comes first
    return every[order], np.interp(every, times, so_far)[order] + np.cumsum(jumps[order])
