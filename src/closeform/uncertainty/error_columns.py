"""Error columns of a craft: the motion that one unit of each independent error adds, as paths."""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, START, STATE, THRUST, WIDTH
from closeform.motion.joining import linked, stack
from closeform.motion.path import Path, of_one_craft, path_of, runs_of
from closeform.uncertainty.covariance_propagation import BURN_ERRORS, ROW, burn_error_arc

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty

AXES = np.eye(3)


def columns_of(path: Path, errors: Uncertainty) -> Path:
    """Return the error columns (m,) of one craft along its path: of its state, impulses and burns.

    Zero errors and process noise have no columns.  # theory (50)
    """
    of_one_craft(path)
    errors._check_for(path)
    found = [*_of_state(path, errors), *_of_impulses(path, errors), *_of_burns(path, errors)]
    offsets = np.cumsum([0, *map(len, found)])
    arcs = np.concatenate([np.empty((0, WIDTH)), *found])
    return path_of(path.orbit, arcs, offsets, (len(found),))


def columns_of_pair(
    path: Path, other: Path, errors: Uncertainty | None, other_errors: Uncertainty | None
) -> Path:
    """Return the error columns (m,) of one craft relative to another, natural ones merged to six."""
    pairs = [(one, known) for one, known in ((path, errors), (other, other_errors)) if known is not None]
    columns = [columns_of(*pair) for pair in pairs]
    every = [each[k] for each in columns for k in range(len(each))]
    if not every:
        return path_of(path.orbit, np.empty((0, WIDTH)), np.zeros(1, dtype=np.int64), (0,))
    return merged(stack(every), max(path.start, other.start), min(path.end, other.end))


def merged(columns: Path, start: float, end: float) -> Path:
    """Return the same errors with fewer columns: all natural ones become the six of a state."""
    rows = columns.arcs
    forced = rows[:, IMPULSE : IMPULSE + 3].any(axis=1) | rows[:, THRUST:].any(axis=1)
    forced |= columns.orbit._interpolates(rows)
    natural = ~np.logical_or.reduceat(forced, columns.offsets[:-1])
    if not natural.any():
        return columns
    states = columns[natural]._evaluate_rows(np.array([[start]]))[:, 0]
    root = np.linalg.qr(states, mode="r")  # of the covariance states.T @ states
    coasts = columns.orbit.coast(root, end - start, start=start)
    rest = columns[~natural]
    every = [coasts[k] for k in range(len(coasts))] + [rest[k] for k in range(len(rest))]
    return stack(every) if every[len(coasts) :] else coasts


def executed_path(path: Path, columns: Path, sizes: Floats) -> Path:
    """Return a craft's path plus its columns (m,) multiplied by `sizes`: the executed path.

    The columns may belong to a longer path that contains this one, arc by arc.
    """
    arcs, starts = path.arcs.copy(), path.arcs[:, START]
    kicked = path.arcs[:, IMPULSE:STATE].any(axis=1)
    for first, last, size in zip(columns.offsets[:-1], columns.offsets[1:], sizes, strict=True):
        column = columns.arcs[first:last]
        picked = column[np.searchsorted(column[:, START], starts, side="right") - 1]
        begins = picked[:, START] == starts  # as do all arcs of a column with thrust or an impulse
        arcs[:, STATE : STATE + 6] += size * _states(path, picked, starts)
        arcs[begins, THRUST:] += size * picked[begins, THRUST:]
        arcs[begins & kicked, IMPULSE:STATE] += size * picked[begins & kicked, IMPULSE:STATE]
    return path_of(path.orbit, arcs, path.offsets, path.shape)


def has_errors(path: Path, errors: Uncertainty) -> bool:
    """Return True if one craft's errors move it off its path; burn errors require a burn."""
    if errors.noise or errors._root.any() or (any(errors.impulse) and path.impulses):
        return True
    return bool((errors.magnitude or errors.pointing) and len(burn_ranges(path)))


def burn_ranges(path: Path) -> Any:
    """Return the first arc and the one after the last (B, 2) of every burn: thrust without a pause."""
    return runs_of(np.abs(path.arcs[:, THRUST:]).sum(axis=1) > 0.0)


def impulse_errors(jump: Floats, errors: Uncertainty) -> Floats:
    """Return the velocity errors (3, 3) [m/s] of one impulse: along it, and two across.

    theory (50)
    """
    size = float(np.linalg.norm(jump))
    ahead = jump / size
    aside = np.cross(ahead, AXES[np.abs(ahead).argmin()])
    aside /= np.linalg.norm(aside)
    fixed, share, across, turned = errors.impulse
    wide = hypot(across, turned * size)
    return np.array([hypot(fixed, share * size) * ahead, wide * aside, wide * np.cross(ahead, aside)])


def _coasts(path: Path, start: float, state: Floats) -> Floats:
    """Return arcs at rest up to a start, then natural motion from a state."""
    arcs = np.zeros((2, WIDTH))
    arcs[:, MEAN_MOTION] = path.orbit._column
    arcs[:, START], arcs[:, END] = (path.start, start), (start, path.end)
    arcs[1, STATE : STATE + 6] = state
    return arcs if start > path.start else arcs[1:]


def _of_state(path: Path, errors: Uncertainty) -> Iterator[Floats]:
    """Yield the arcs of the columns of the state's error."""
    for column in errors._root.T:
        if column.any():
            yield _coasts(path, path.start, column)


def _of_impulses(path: Path, errors: Uncertainty) -> Iterator[Floats]:
    """Yield the arcs of the columns of impulse errors."""
    for time, jump in path.impulses if any(errors.impulse) else ():
        for velocity in impulse_errors(jump, errors):
            if velocity.any():
                arcs = _coasts(path, time, np.concatenate([np.zeros(3), velocity]))
                arcs[-1, IMPULSE : IMPULSE + 3] = velocity
                yield arcs


def _of_burns(path: Path, errors: Uncertainty) -> Iterator[Floats]:
    """Yield the arcs of the columns of burn errors: magnitude, and pointing about x, y, z."""
    burns = burn_ranges(path) if errors.magnitude or errors.pointing else []
    for first, last in burns:
        arcs = path.arcs[first:last]
        for forced in _forced(path.orbit._column, arcs, errors):
            over = linked(path.orbit, forced, np.zeros(6)).state(arcs[-1, END])
            before = _coasts(path, arcs[0, START], np.zeros(6))[:-1]
            after = _coasts(path, arcs[-1, END], over)[-1:]
            yield np.concatenate([before, forced, after if arcs[-1, END] < path.end else after[:0]])


def _forced(n: float, arcs: Floats, errors: Uncertainty) -> Iterator[Floats]:
    """Yield the thrust arcs of the columns of one burn; their states are set later."""
    for j in range(BURN_ERRORS):
        if errors.pointing if j > 0 else errors.magnitude:
            forced = np.zeros_like(arcs)
            for arc, out in zip(arcs, forced, strict=True):
                burn_error_arc(n, arc, np.zeros(ROW), errors._execution, j, out)
            yield forced


def _states(path: Path, arcs: Floats, times: Floats) -> Any:
    """Return the states (k, 6) at a time (k,) on each of the given arcs."""
    alone = path_of(path.orbit, np.ascontiguousarray(arcs), np.arange(len(arcs) + 1), (len(arcs),))
    return alone._evaluate_rows(np.ascontiguousarray(times[:, None]))[:, 0]
