"""Combine paths: one after another in time, or side by side as a batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats, sequence
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, START, STATE, WIDTH
from closeform.motion.path import FORGIVEN, Path, ends_of, path_of

if TYPE_CHECKING:
    from closeform.motion.orbit import Orbit


def _single(paths: Any, verb: str) -> list[Path]:
    chosen = sequence("paths", paths, Path)
    if not chosen:
        raise ValueError(f"paths: nothing to {verb}; give at least one path")
    for path in chosen:
        if path.orbit != chosen[0].orbit:
            raise ValueError(f"paths: all must be in one orbit to {verb} them")
    return chosen


def join(paths: Sequence[Path]) -> Path:
    """Join paths that follow each other in time into one path.

    A velocity jump between two becomes an impulse.  Jumps below 1e-9 of the larger of |r| and |v| T
    are rounding; T is the duration of the path that ends, for velocities that of all paths.

    Parameters
    ----------
    paths : sequence of Path
        Paths in order of time, of one batch shape and in one orbit.

    Returns
    -------
    Path
        Path of that shape.

    Raises
    ------
    ValueError
        If there is no path, one is of another type, orbits or shapes differ, there is a gap in time, or
        the position jumps.
    """
    chosen = _single(paths, "join")
    if any(path.shape != chosen[0].shape for path in chosen):
        raise ValueError(f"paths: all must have one shape to join them, got {[p.shape for p in chosen]}")
    pieces = [chosen[0].arcs]
    whole = chosen[-1].arcs[chosen[-1].offsets[1:] - 1, END] - chosen[0].arcs[chosen[0].offsets[:-1], START]
    for before, after in zip(chosen, chosen[1:], strict=False):
        arcs = after.arcs.copy()
        first = after.offsets[:-1]
        last = before.offsets[1:] - 1
        length = before.arcs[last, END] - before.arcs[before.offsets[:-1], START]
        gap = arcs[first, START] - before.arcs[last, END]
        if np.any(np.abs(gap) > FORGIVEN * length):
            raise ValueError(
                f"paths: one ends and the next starts {np.abs(gap).max():g} s apart; close the gap"
            )
        ended = before._evaluate_rows(before.arcs[last, END : END + 1])[:, 0]
        jump = arcs[first, STATE : STATE + 6] - ended
        scale = FORGIVEN * np.maximum(_scale(before, length), _scale(after, length)) + 1e-300
        if np.any(np.abs(jump[:, :3]).max(axis=1) > scale):
            raise ValueError(f"paths: position jumps by {np.abs(jump[:, :3]).max():g} m between two of them")
        least = FORGIVEN * np.maximum(_scale(before, whole), _scale(after, whole)) + 1e-300
        kicked = np.abs(jump[:, 3:]).max(axis=1) * np.maximum(whole, 1e-300) > least
        arcs[first, IMPULSE : IMPULSE + 3] = np.where(kicked[:, None], jump[:, 3:], 0.0)
        pieces.append(arcs)
    return _interleaved(chosen, pieces)


def _scale(path: Path, duration: Floats) -> Floats:
    """Return the larger of |r| and |v| T over the arcs of each spacecraft (N,)."""
    sizes = np.abs(path.arcs[:, STATE : STATE + 6])
    sizes[:, 3:] *= np.repeat(duration, np.diff(path.offsets))[:, None]
    return np.maximum.reduceat(sizes.max(axis=1), path.offsets[:-1])


def _interleaved(paths: list[Path], pieces: list[Floats]) -> Path:
    """Return a path with the arcs of all pieces sorted by spacecraft."""
    owner = np.concatenate([np.repeat(np.arange(len(p.offsets) - 1), np.diff(p.offsets)) for p in paths])
    arcs = np.concatenate(pieces)[np.argsort(owner, kind="stable")]
    offsets = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=len(paths[0].offsets) - 1))])
    return path_of(paths[0].orbit, arcs, offsets, paths[0].shape)


def stack(paths: Sequence[Path]) -> Path:
    """Stack paths of single spacecraft into one batch; they may have different times.

    Parameters
    ----------
    paths : sequence of Path
        N paths of one spacecraft each, in one orbit.

    Returns
    -------
    Path
        Path of shape (N,).

    Raises
    ------
    ValueError
        If there is no path, one is of another type or a batch, or orbits differ.
    """
    chosen = _single(paths, "stack")
    if any(path.shape for path in chosen):
        raise ValueError("paths: stack takes paths of single spacecraft; index the batches first")
    if len(chosen) == 1:
        return path_of(chosen[0].orbit, chosen[0].arcs, chosen[0].offsets, (1,))
    offsets = np.concatenate([[0], np.cumsum([len(path.arcs) for path in chosen])])
    arcs = np.concatenate([path.arcs for path in chosen])
    return path_of(chosen[0].orbit, arcs, offsets, (len(chosen),))


def drifting(path: Path, time: float, state: Floats | None = None) -> Path:
    """Return one spacecraft's path until `time`, then natural motion.

    If `state` is given, the whole path is natural motion from that state.
    """
    if state is not None:
        return drift(path.orbit, path.start, path.end, state)
    arcs = path.arcs[path.arcs[:, START] < time].copy()
    if not len(arcs):
        return drift(path.orbit, path.start, path.end, ends_of(path)[0])
    arcs[-1, END] = min(arcs[-1, END], time)
    after = drift(path.orbit, time, path.end, path.state(time))
    return path_of(path.orbit, np.vstack([arcs, after.arcs]), np.array([0, len(arcs) + 1]), ())


def drift(orbit: Orbit, start: float, end: float, state: Floats) -> Path:
    """Return natural motion from a state."""
    arc = np.zeros((1, WIDTH))
    arc[0, [START, END, MEAN_MOTION]] = start, end, orbit._column
    arc[0, STATE : STATE + 6] = state
    return path_of(orbit, arc, np.array([0, 1]), ())


def linked(orbit: Orbit, arcs: Floats, state: Floats) -> Path:
    """Return one spacecraft's path by arcs (M, 30) from a `state` (6,) before impulses; fill their states."""
    arcs[:, STATE : STATE + 6] = 0.0
    alone = path_of(orbit, arcs, np.arange(len(arcs) + 1), (len(arcs),))
    gained = alone._evaluate_rows(arcs[:, END : END + 1])[:, 0]
    for arc, moved, pushed in zip(arcs, orbit._flow(arcs), gained, strict=True):
        arc[STATE : STATE + 6] = state
        arc[STATE + 3 : STATE + 6] += arc[IMPULSE : IMPULSE + 3]
        state = moved @ arc[STATE : STATE + 6] + pushed
    return path_of(orbit, arcs, np.array([0, len(arcs)]), ())
