"""The two spacecraft of each pair in the form that the search uses, with their failures."""

from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, START, STATE, THRUST, WIDTH
from closeform.motion.path import Path, path_of
from closeform.safety.failure_cells import (
    ACCELERATION,
    HELD,
    INTACT,
    LOST,
    MEASURE,
    MISSED,
    SIDE,
    STUCK,
    WEAK,
    Side,
)
from closeform.safety.failure_family import GENERATORS, PairRoom
from closeform.safety.failures import DegradedThrust, Failure, MissedBurns, StuckOnThrust, ThrustLost

KINDS = {ThrustLost: LOST, MissedBurns: MISSED, DegradedThrust: WEAK, StuckOnThrust: STUCK}
CELLS = 512  # initial space for the cells of a pair; few paths have as many arcs under thrust
NO_BURNS = np.empty((0, 2, WIDTH))


def side_of(path: Path, failure: Failure | None, until: float, carry_on: bool = False) -> Side:
    """Return a path that fails, or continues if `failure` is None, as a side of the search."""
    kind = INTACT if failure is None else KINDS[type(failure)]
    numbers = np.array([0.0, -1.0, 0.0, 0.0, 0.0])
    if isinstance(failure, MissedBurns | DegradedThrust):
        numbers[MEASURE] = failure.least
    if isinstance(failure, StuckOnThrust):
        numbers[MEASURE] = failure.longest
        if failure.acceleration is not None:
            numbers[HELD] = np.linalg.norm(failure.acceleration)
            numbers[ACCELERATION:] = failure.acceleration
    arcs, offsets = path.arcs, path.offsets
    if kind in (WEAK, MISSED) or (kind == INTACT and carry_on):
        arcs, offsets = carried_on(path, until)
    burns, burn_offsets = NO_BURNS, np.zeros_like(offsets)
    if kind == MISSED:
        burns, burn_offsets = burns_of(path)
    now = np.array([kind, 0, 0, 0, 0], dtype=np.int64)
    return Side(arcs, offsets, burns, burn_offsets, now, numbers)


def carried_on(path: Path, until: float) -> tuple[Floats, Any]:
    """Return arcs and offsets of paths extended by coasts after their ends."""
    last = path.offsets[1:] - 1
    ends = path.arcs[last, END]
    coasts = np.zeros((len(last), WIDTH))
    coasts[:, START], coasts[:, END] = ends, np.maximum(ends, until)
    coasts[:, MEAN_MOTION] = path.orbit.mean_motion
    coasts[:, STATE : STATE + 6] = _ends(path)
    arcs = np.insert(path.arcs, path.offsets[1:], coasts, axis=0)
    return arcs, path.offsets + np.arange(len(path.offsets))


def carried(paths: Path, until: float) -> Path:
    """Return paths extended by coasts after their ends."""
    arcs, offsets = carried_on(paths, until)
    return path_of(paths.orbit, np.ascontiguousarray(arcs), offsets, paths.shape)


def burns_of(path: Path) -> tuple[Floats, Any]:
    """Return natural motions before and after each burn (B, 2, 30), and the first index of each spacecraft.

    A burn is an impulse, or consecutive arcs with thrust; an impulse between these is a separate burn.
    """
    n = path.orbit.mean_motion
    arcs = path.arcs
    thrusts: Any = arcs[:, THRUST:].any(axis=1) | (arcs[:, MEAN_MOTION] != n)
    jumps: Any = arcs[:, IMPULSE : IMPULSE + 3].any(axis=1)
    rows, counts = [], []
    for first, last, ended in zip(path.offsets[:-1], path.offsets[1:], _ends(path), strict=True):
        found: list[tuple[float, Floats, float, Floats]] = []
        for i in range(first, last):
            start, end = arcs[i, START], arcs[i, END]
            after = arcs[i, STATE : STATE + 6]
            if jumps[i]:
                found.append((start, _before(arcs[i]), start, after))
            if thrusts[i]:
                if i > first and thrusts[i - 1] and not jumps[i]:
                    start, after, *_ = found.pop()
                found.append((start, after, end, _before(arcs[i + 1]) if i + 1 < last else ended))
        counts.append(len(found))
        rows += [_coasts(n, *one) for one in found]
    burns = np.array(rows).reshape(-1, 2, WIDTH)
    return burns, np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _ends(path: Path) -> Floats:
    """Return the states (N, 6) of all spacecraft at their ends."""
    return path._evaluate_rows(path.arcs[path.offsets[1:] - 1, END][:, None])[:, 0]


def _before(arc: Floats) -> Floats:
    """Return the state at the start of an arc, before the impulse there."""
    state: Floats = arc[STATE : STATE + 6].copy()
    state[3:] -= arc[IMPULSE : IMPULSE + 3]
    return state


def _coasts(n: float, start: float, before: Floats, end: float, after: Floats) -> Floats:
    rows = np.zeros((2, WIDTH))
    rows[:, MEAN_MOTION] = n
    rows[:, START] = start, end
    rows[:, STATE : STATE + 6] = before, after
    return rows


def room_for(one: Side, two: Side, cells: int = CELLS) -> PairRoom:
    """Return work space for the search of one pair at a time."""
    burns = [int(np.diff(side.burn_offsets).max(initial=0)) if len(side.burns) else 0 for side in (one, two)]
    width = 1 + 2 * max(2, *burns)
    motions = GENERATORS + sum(burns)
    parameters = 2 * max(2, *burns)
    return PairRoom(
        np.zeros((cells, SIDE + 2 * width)),
        np.zeros((3, SIDE + 2 * width)),
        np.zeros((2, 12, WIDTH)),
        np.zeros((motions, 8, 3)),
        np.zeros((motions, 3)),
        np.zeros((motions, 6)),
        np.zeros((motions, 5)),
        np.zeros(motions),
        np.zeros((parameters, 4)),
        np.zeros(parameters),
    )
