"""Paths of a plan for use in a force model: checks of frame and times, and extension by coasts."""

from typing import Any

import numpy as np

from closeform.arrays import Floats, instance
from closeform.dynamics.field import Field
from closeform.motion.joining import stack
from closeform.motion.path import Path, ends_of, path_of
from closeform.planning.plan import Plan

FITS = 5e-3  # relative difference of mean motion allowed, due to oblateness


def paths_of(plan: Any) -> Path | None:
    """Return the paths of a plan, None if it found none; paths are returned unchanged."""
    return plan.paths if isinstance(plan, Plan) else plan


def paths_to_fly(plan: Any, field: Field) -> Path:
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


def following(before: Path, paths: Path) -> Path:
    """Return paths (N,) that apply the thrust of `paths` after that of `before`, with a coast between."""
    from closeform.fuel.pulses import linked  # imported late: compiles kernels

    waits = spanning(before, np.array([np.min(before.start), np.min(paths.start)]))
    each = [np.concatenate([waits[k].arcs, paths[k].arcs]) for k in range(len(paths))]
    return stack([linked(paths.orbit, arcs, ends_of(waits[k])[0]) for k, arcs in enumerate(each)])


def spanning(paths: Path, times: Floats) -> Path:
    """Return paths (N,), extended by coasts to cover the times (T,)."""
    from closeform.fuel.pulses import extended  # imported late: compiles kernels

    return stack([extended(paths[k], float(times[0]), float(times[-1])) for k in range(len(paths))])
