"""Planned paths for use in a force model: checks, joining and extension by coasts, engines and impulses."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from closeform.arrays import Floats, instance, shown
from closeform.dynamics.force_model.field import Field
from closeform.motion.arc import IMPULSE, START
from closeform.motion.joining import drifting, stack
from closeform.motion.path import Path, ends_of, path_of
from closeform.planning.plan import Plan

FITS = 5e-3  # relative difference of mean motion allowed, due to oblateness
SAMPLED = 1.0  # m: tolerance between a sampled natural path and natural motion


def paths_of(plan: Any) -> Path | None:
    """Return the paths of a plan, None if it found none; paths are returned unchanged."""
    return plan.paths if isinstance(plan, Plan) else plan


def checked_paths(plan: Any, field: Field) -> Path:
    """Return the paths (N,) of a plan or themselves, after a check against the field.

    Raises ValueError for paths in deep space, in another orbit, or with different time spans.
    """
    instance("plan", plan, Plan, Path)
    instance("field", field, Field)
    path = paths_of(plan)
    if path is None:
        raise ValueError(f"plan: has no paths: {plan.reason}")
    n, own = path.orbit.mean_motion, field.chief.orbit.mean_motion
    if n == 0.0:
        raise ValueError(
            "plan: in deep space there is no chief with an orbit; plan in an orbit, such as chief.orbit"
        )
    if abs(n / own - 1.0) > FITS:
        raise ValueError(
            f"field: its chief has a period of {2.0 * np.pi / own:.1f} s, the plan's orbit "
            f"{2.0 * np.pi / n:.1f} s; plan in chief.orbit, or give the chief of this orbit"
        )
    starts, ends = np.ravel(path.start), np.ravel(path.end)
    if np.ptp(starts) > 0.0 or np.ptp(ends) > 0.0:
        raise ValueError(
            "plan: paths have different start or end times; extend them by coasts to common times"
        )
    return path_of(path.orbit, path.arcs, path.offsets, (len(starts),))


def appended_paths(before: Path, paths: Path) -> Path:
    """Return paths (N,) that apply the thrust of `paths` after that of `before`, with a coast between."""
    from closeform.motion.joining import linked

    waits = extended_paths(before, np.array([np.min(before.start), np.min(paths.start)]))
    each = [np.concatenate([waits[k].arcs, paths[k].arcs]) for k in range(len(paths))]
    return stack([linked(paths.orbit, arcs, ends_of(waits[k])[0]) for k, arcs in enumerate(each)])


def extended_paths(paths: Path, times: Floats) -> Path:
    """Return paths (N,), extended by coasts to cover the times (T,)."""
    from closeform.fuel.pulses import extended  # imported late: compiles kernels

    return stack([extended(paths[k], float(times[0]), float(times[-1])) for k in range(len(paths))])


def until_lost(paths: Path, lost: Floats) -> Path:
    """Return paths (N,) with natural motion from the loss of thrust (N,) [s] on."""
    ends = np.ravel(paths.end)
    if not (lost < ends).any():
        return paths
    return stack([drifting(paths[k], time) if time < ends[k] else paths[k] for k, time in enumerate(lost)])


def impulses_of(path: Path) -> tuple[Any, Floats, Floats]:
    """Return the spacecraft (M,), times (M,) [s] and sizes (M, 3) [m/s] of all impulses of paths (N,)."""
    jumps = path.arcs[:, IMPULSE : IMPULSE + 3]
    rows = np.flatnonzero(jumps.any(axis=1))
    craft = np.searchsorted(path.offsets, rows, side="right") - 1
    return craft, path.arcs[rows, START], jumps[rows]


def running_engines(engine: Any, paths: Path, field: Field, thrusters: Sequence[Any] = ()) -> Any:
    """Return the argument `engine` for each craft (N,); a planned path must not thrust without an engine.

    Except for a path sampled from natural motion in the known field.
    """
    count, given = len(paths), np.asarray(engine)
    if given.dtype != bool or given.shape not in ((), (count,)):
        raise ValueError(
            f"engine: expected True or False, or one for each of {count} craft, got {shown(engine)}"
        )
    running = np.broadcast_to(given, count).copy()
    for k in np.flatnonzero(~running).tolist():
        if paths[k].delta_v > 0.0 and not _is_natural(paths[k : k + 1], field._of([k])):
            raise ValueError(f"engine: craft {k} has none, but its path thrusts; give its coast instead")
        if thrusters and thrusters[k] is not None:
            raise ValueError(f"thrusters: craft {k} has no engine; give None for it")
    return running


def _is_natural(path: Path, field: Field) -> bool:
    """Return True if a path (1,) is natural motion in a field."""
    drift = field._drift(path)
    times = drift.arcs[:, START]
    return bool(np.abs(path.position(times) - drift.position(times)).max() < SAMPLED)
