"""The paths of a plan as they are to be flown in a field: which craft, when, in which frame."""

from typing import Any

import numpy as np

from closeform.arrays import Floats, instance
from closeform.dynamics.field import Field
from closeform.motion.joining import stack
from closeform.motion.path import Path, ends_of, path_of
from closeform.planning.plan import Avoidance, Plan

FITS = 5e-3  # of the mean motion, by which flattening makes an orbit's rate another than that of a circle


def paths_of(plan: Any) -> Path | None:
    """What a plan or an avoidance flies, None where it found nothing; paths as they are."""
    if isinstance(plan, Plan):
        return plan.paths
    return plan.path if isinstance(plan, Avoidance) else plan


def paths_to_fly(plan: Any, field: Field) -> Path:
    """The paths (N,) of a plan, an avoidance or themselves; ValueError where the field cannot have them."""
    instance("plan", plan, Plan, Avoidance, Path)
    instance("field", field, Field)
    path = paths_of(plan)
    if path is None:
        raise ValueError(f"plan: has no paths: {plan.reason}")
    n, own = path.orbit.mean_motion, field.chief.orbit.mean_motion
    if n == 0.0:
        raise ValueError(
            "plan: of deep space, where no chief has an orbit; plan in an orbit, such as chief.orbit"
        )
    if abs(n / own - 1.0) > FITS:
        raise ValueError(
            f"field: its chief turns once in {2.0 * np.pi / own:.1f} s, the plan's orbit in "
            f"{2.0 * np.pi / n:.1f} s; plan in chief.orbit, or give the chief of this orbit"
        )
    starts, ends = np.ravel(path.start), np.ravel(path.end)
    if np.ptp(starts) > 0.0 or np.ptp(ends) > 0.0:
        raise ValueError("plan: paths begin or end apart; carry them on by coasts to common times")
    return path_of(path.orbit, path.arcs, path.offsets, (len(starts),))


def following(before: Path, paths: Path) -> Path:
    """Thrust of paths (N,) after that of others `before`, from where that leads, with a coast between."""
    from closeform.fuel.pulses import linked  # whose kernels only burns need

    waits = spanning(before, np.array([np.min(before.start), np.min(paths.start)]))
    each = [np.concatenate([waits[k].arcs, paths[k].arcs]) for k in range(len(paths))]
    return stack([linked(paths.orbit, arcs, ends_of(waits[k])[0]) for k, arcs in enumerate(each)])


def spanning(paths: Path, times: Floats) -> Path:
    """Paths (N,), with coasts where times (T,) are before or after them."""
    from closeform.fuel.pulses import extended  # which only burns at the ends of plans need

    return stack([extended(paths[k], float(times[0]), float(times[-1])) for k in range(len(paths))])
