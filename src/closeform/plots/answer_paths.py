"""What flies in an answer: its paths before and after, what they are called, and which zones they keep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from closeform.motion.joining import stack
from closeform.motion.path import Path, ends_of
from closeform.plots.inputs import crafts


@dataclass(frozen=True)
class Flown:
    """What flies: paths `before` avoidance and `after` it, with what the answer knows of names and zones."""

    before: Path
    after: Path
    names: Sequence[str] | None = None
    zone: Any = None


def _path(path: Any) -> Flown:
    batch = stack(crafts("result", path))
    return Flown(batch, batch)


def _avoidance(result: Any) -> Flown:
    if result.path is None:
        raise ValueError(f"result: a plan without a path, {result.reason}")
    after, orbit = result.path, result.path.orbit
    least = orbit.impulsive if result.cost == "delta-v" else orbit.transfer
    before = least(*ends_of(after), after.end - after.start, after.start)
    return Flown(stack([before]), stack([after]))


def _plan(result: Any) -> Flown:
    if result.paths is None:
        raise ValueError(f"result: a plan without paths, {result.reason}; plot its direct")
    return Flown(result.direct, result.paths)


def _most_clearance(result: Any) -> Flown:
    if result.plan is None:
        raise ValueError(f"result: without a plan, {result.reason}")
    return FLYING[type(result.plan).__name__](result.plan)


def _firing(result: Any) -> Flown:
    before, after = (stack(crafts("result", path)) for path in (result.planned, result.path))
    return Flown(before, after)


def _encounter(result: Any) -> Flown:
    both = stack([result.other, result.path])
    return Flown(both, both, ("primary", "secondary"))


def _conjunction(result: Any) -> Flown:
    met = _encounter(result.encounter())
    return Flown(met.before, met.after, [one.name for one in result.objects])


def _common_frame(result: Any) -> Flown:
    paths = result.paths  # made anew at each look
    return Flown(paths, paths, result.names)


def _mission(result: Any) -> Flown:
    paths = result.paths
    return Flown(paths, paths, result.scenario.names, result.scenario.zones)


def _stage(result: Any) -> Flown:
    return Flown(result.before.paths, result.after.paths, result.after.names)


def _formation(result: Any) -> Flown:
    return Flown(result.paths, result.paths, result.names)


def _worst(result: Any) -> Flown:
    """Of many flights in a field the one in which craft come nearest."""
    paths = result.path(result.worst)
    return Flown(paths, paths)


FLYING: dict[str, Callable[[Any], Flown]] = {
    "Path": _path,
    "Avoidance": _avoidance,
    "Plan": _plan,
    "MaxClearance": _most_clearance,
    "ThrusterFiring": _firing,
    "Encounter": _encounter,
    "Conjunction": _conjunction,
    "CommonFrame": _common_frame,
    "Mission": _mission,
    "LoadedRun": _mission,
    "StageResult": _stage,
    "LoadedStage": _stage,
    "WatchedFlight": _formation,
    "Simulation": _worst,
}
