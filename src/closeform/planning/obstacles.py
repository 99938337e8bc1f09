"""Obstacles: paths that do not give way, as one batch, with names, and ends that are inside their zones."""

from collections.abc import Iterable, Sequence

import numpy as np

from closeform.arrays import shown
from closeform.motion.joining import stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.planning.problem import Problem

ON = 1.0 + 1e-9  # of a zone: an end there counts as inside


def obstacle_batch(orbit: Orbit, obstacles: Path | Sequence[Path] | None) -> Path | None:
    """A Path of shape (M,) from one path, a batch or a sequence of paths; None of none.

    Raises ValueError for what is no path, for another shape, or another orbit.
    """
    some = [obstacles] if isinstance(obstacles, Path) else () if obstacles is None else obstacles
    some = list(some) if isinstance(some, Iterable) else [some]
    if not all(isinstance(one, Path) for one in some):
        raise ValueError(f"obstacles: expected paths, got {shown(obstacles)}")
    if any(one.orbit.mean_motion != orbit.mean_motion for one in some):
        raise ValueError("obstacles: must be in the orbit of paths that are planned")
    if len(some) == 1 and len(some[0].shape) == 1:
        return some[0] if len(some[0]) else None
    if wrong := next((one.shape for one in some if one.shape), None):
        raise ValueError(f"obstacles: expected a Path of shape (M,) or paths, got shape {wrong}")
    return stack(some) if some else None


def obstacle_names(names: Sequence[str] | None, count: int) -> tuple[str, ...]:
    """What each of `count` obstacles is called: "obstacle k" unless given.

    Raises ValueError for another number of names.
    """
    if names is None:
        return tuple(f"obstacle {k}" for k in range(count))
    if isinstance(names, str) or len(names) != count:
        raise ValueError(f"names: give one for each of {count} obstacles, got {shown(names)}")
    return tuple(names)


def end_inside(problem: Problem) -> tuple[str, float, int] | None:
    """An end of the one craft's path inside a zone: "start" or "end", its norm, which obstacle; else None."""
    start, end = problem.windows[1].T
    ends = np.array([[problem.first], [problem.last]])
    end_of, which = np.nonzero((start <= ends) & (ends <= end))
    ratios = problem.ratios(problem.direct, which, ends[end_of, 0])
    inside = np.flatnonzero(ratios <= ON)
    if not len(inside):
        return None
    k = inside[0]
    return ("start", "end")[end_of[k]], float(ratios[k]), int(problem.pairs[which[k], 1]) - 1
