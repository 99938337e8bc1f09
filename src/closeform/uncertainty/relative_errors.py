"""Error columns of a relative motion, from both craft, reduced to as few as possible."""

from __future__ import annotations

import numpy as np

from closeform.arrays import instance
from closeform.conflicts.two_paths import check_comparable
from closeform.motion.arc import IMPULSE, MEAN_MOTION, THRUST
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.uncertainty.columns import columns_of
from closeform.uncertainty.errors import Uncertainty
from closeform.zones.zone import Zone


def relative_errors(
    path: Path, other: Path, zone: Zone, errors: Uncertainty, other_errors: Uncertainty | None
) -> tuple[Path, float]:
    """Return the columns (M,) of the relative motion, natural ones merged to six, and the noise [m^2/s^3].

    Raises ValueError if the two cannot be compared, or nothing is uncertain.
    """
    check_comparable(path, other, zone)
    if path.shape or other.shape:
        raise ValueError(
            f"path, other: expected one craft each, got shapes {path.shape} and {other.shape}; index them"
        )
    instance("errors", errors, Uncertainty)
    if path.start != other.start:
        raise ValueError(
            f"other: starts at {other.start:g} s, path at {path.start:g} s; errors hold at the start, "
            "so both must start at the same time"
        )
    columns, noise = [columns_of(path, errors)], errors.noise
    if other_errors is not None:
        instance("other_errors", other_errors, Uncertainty)
        columns.append(columns_of(other, other_errors))
        noise += other_errors.noise
    every = [each[k] for each in columns for k in range(len(each))]
    if every:
        return merged(stack(every), path.start, min(path.end, other.end)), noise
    if not noise:
        raise ValueError("errors: all are zero; give an uncertainty, or use find_conflicts")
    return columns[0], noise


def merged(columns: Path, start: float, end: float) -> Path:
    """Return the same errors with fewer columns: all natural ones become the six of a state."""
    rows = columns.arcs
    forced = rows[:, IMPULSE : IMPULSE + 3].any(axis=1) | rows[:, THRUST:].any(axis=1)
    forced |= rows[:, MEAN_MOTION] != columns.orbit.mean_motion
    natural = ~np.logical_or.reduceat(forced, columns.offsets[:-1])
    if not natural.any():
        return columns
    states = columns[natural]._evaluate_rows(np.array([[start]]))[:, 0]
    root = np.linalg.qr(states, mode="r")  # of the covariance states.T @ states
    coasts = columns.orbit.coast(root, end - start, start=start)
    rest = columns[~natural]
    every = [coasts[k] for k in range(len(coasts))] + [rest[k] for k in range(len(rest))]
    return stack(every) if every[len(coasts) :] else coasts
