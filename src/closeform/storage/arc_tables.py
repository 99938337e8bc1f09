"""Conversion of paths and searches to table columns and back, without loss of precision."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.search.leg import Leg

AXES = "xyz"
# The columns of an arc in order, see `motion/arc.py`; u is the optimal thrust, p the additional one.
ARC = (
    ("start_s", "end_s", "mean_motion_rad_s")
    + tuple(f"jump_{axis}_m_s" for axis in AXES)
    + tuple(f"{axis}_m" for axis in AXES)
    + tuple(f"v{axis}_m_s" for axis in AXES)
    + tuple(f"u{axis}_m_s2" for axis in AXES)
    + tuple(f"u{axis}_rate_m_s3" for axis in AXES)
    + tuple(f"p{axis}_{order}_m_s{2 + order}" for order in range(4) for axis in AXES)
)
TURN = tuple(f"axis_{axis}" for axis in AXES)
ATTITUDE = tuple(f"body_{body}_{axis}" for axis in AXES for body in AXES)  # the rows of the attitude matrix


def of_paths(path: Path, names: Sequence[str], stage: int, when: str) -> dict[str, Any]:
    """Return the arcs of each craft of a path (N,) as columns, one row per arc in order of time."""
    counts = np.diff(path.offsets)
    return {
        "stage": np.full(len(path.arcs), stage),
        "when": np.full(len(path.arcs), when),
        "craft": np.repeat(np.array(names), counts),
        **dict(zip(ARC, path.arcs.T, strict=True)),
    }


def path_in(columns: Mapping[str, Any], orbit: Orbit, names: Sequence[str]) -> Path:
    """Return the path (N,) of the craft `names` from the columns of its arcs."""
    craft = np.asarray(columns["craft"])
    where = {name: k for k, name in enumerate(names)}
    whose = np.array([where[name] for name in craft.tolist()], dtype=np.int64)
    order = np.argsort(whose, kind="stable")
    arcs = np.stack([np.asarray(columns[key], dtype=float) for key in ARC], axis=1)[order]
    offsets = np.concatenate([[0], np.cumsum(np.bincount(whose, minlength=len(names)))])
    if (np.diff(offsets) == 0).any():
        raise ValueError("a craft has no arcs")
    return Path(orbit, arcs, offsets, (len(names),))


def of_legs(legs: Iterable[Leg], stage: int) -> dict[str, Any]:
    """Return the turns of a search as columns, one row per turn."""
    legs = list(legs)
    axes, attitudes = np.array([leg.axis for leg in legs]), np.array([leg.attitude for leg in legs])
    labels = {key: [getattr(leg, key) for leg in legs] for key in ("phase", "round", "about")}
    return {
        "stage": np.full(len(legs), stage),
        "start_s": [leg.start for leg in legs],
        "end_s": [leg.end for leg in legs],
        **labels,
        **dict(zip(TURN, axes.T, strict=True)),
        "angle_rad": [leg.angle for leg in legs],
        **dict(zip(ATTITUDE, attitudes.reshape(len(legs), 9).T, strict=True)),
    }


def legs_in(columns: Mapping[str, Any]) -> tuple[Leg, ...]:
    """Return the turns of a search from their columns."""
    axes, attitudes = (np.stack([columns[key] for key in keys], axis=1) for keys in (TURN, ATTITUDE))
    rows = zip(
        *(columns[key] for key in ("start_s", "end_s", "phase", "round", "about")),
        axes,
        columns["angle_rad"],
        attitudes.reshape(-1, 3, 3),
        strict=True,
    )
    return tuple(
        Leg(float(start), float(end), str(phase), int(number), str(about), axis, float(angle), attitude)
        for start, end, phase, number, about, axis, angle, attitude in rows
    )


def together(tables: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Concatenate tables that have the same columns."""
    return {key: np.concatenate([table[key] for table in tables]) for key in tables[0]} if tables else {}
