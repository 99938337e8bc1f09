"""Validation of the arguments of plot functions."""

from os import PathLike
from typing import Any

import numpy as np

from closeform.arrays import instance, sequence, shown, whole
from closeform.motion.path import Path

LOOKS = 201  # instants at which two paths are compared
UNSEEN = 1e-4  # of the extent of a path: a smaller difference is below one pixel


def one_path(name: str, given: Any) -> Path:
    """Return an argument as a Path of any shape, or raise ValueError; None usually means a failed plan."""
    if given is None:
        raise ValueError(f"{name}: expected a Path, got None; a plan that is not ok has none")
    path: Path = instance(name, given, Path)
    return path


def one_craft(name: str, given: Any) -> Path:
    """Return an argument as a Path of one spacecraft, or raise ValueError."""
    path = one_path(name, given)
    if path.shape:
        raise ValueError(f"{name}: pictures show one craft at a time, got shape {path.shape}; index it")
    return path


def crafts(name: str, given: Any) -> list[Path]:
    """Return the single paths in a Path of any shape, or in a sequence of such paths."""
    if given is None or isinstance(given, Path):
        path = one_path(name, given)
        return [path] if not path.shape else [path[k] for k in np.ndindex(path.shape)]
    return [craft for path in sequence(name, given, Path) for craft in crafts(name, path)]


def same(before: Path, after: Path) -> bool:
    """Return True if two paths of one shape look the same in a figure."""
    if after is before:
        return True
    for one, other in zip(crafts("before", before), crafts("after", after), strict=True):
        if (one.start, one.end) != (other.start, other.end):
            return False
        times = np.linspace(one.start, one.end, LOOKS)
        where, there = one.position(times), other.position(times)
        if np.abs(where - there).max() > UNSEEN * np.ptp(where, axis=0).max():
            return False
    return True


def texts(name: str, given: Any, count: int, what: str) -> list[str]:
    """Return an argument as `count` strings, or raise ValueError."""
    words = sequence(name, given, str)
    if len(words) != count:
        raise ValueError(f"{name}: {len(words)} {name} for {count} {what}")
    return words


def filmed(file: Any, frames: Any, progress: Any) -> None:
    """Raise ValueError if an animation cannot be written with these arguments."""
    if not isinstance(file, str | PathLike) and not hasattr(file, "write"):
        raise ValueError(f"file: expected a path or an open file, got {shown(file)}")
    whole("frames", frames, 2)
    if progress is not None and not callable(progress):
        raise ValueError(f"progress: expected a function, got {shown(progress)}")
