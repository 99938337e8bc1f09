"""Ends: the states and times between which an arc leads, as they are asked for, checked."""

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import LARGEST, Floats, broadcast, numbers
from closeform.motion.arc import END, MEAN_MOTION, START, STATE, WIDTH
from closeform.motion.duration import flaw


def checked_below(name: str, value: ArrayLike, columns: int | None = None) -> Floats:
    """An argument as floats of a size whose squares do not overflow, in so many columns."""
    array = numbers(name, value)
    if columns is not None and (array.ndim == 0 or array.shape[-1] != columns):
        raise ValueError(f"{name}: expected shape (..., {columns}), got {array.shape}")
    greatest = np.abs(array).max(initial=0.0) if array.ndim else abs(float(array))
    if not greatest < LARGEST:  # nan neither
        raise ValueError(f"{name}: every number must be finite, and below {LARGEST:g} in SI units")
    return array


def arcs_from(
    mean_motion: float,
    duration: ArrayLike,
    start: ArrayLike,
    state: ArrayLike,
    like: tuple[int, ...] = (),
    called: str = "state",
) -> Floats:
    """Arcs (..., 30) of natural motion from a state, of the broadcast shape and of that `like` others."""
    states = checked_below(called, state, 6)
    lengths, starts = checked_below("duration", duration), checked_below("start", start)
    if wrong := flaw(lengths, mean_motion):
        raise ValueError(f"duration: {wrong}")
    shape = broadcast(**{called: states.shape[:-1]}, duration=lengths.shape, start=starts.shape, other=like)
    arcs = np.zeros((*shape, WIDTH))
    arcs[..., START] = starts
    arcs[..., END] = starts + lengths
    if not (arcs[..., END] > arcs[..., START]).all():
        raise ValueError(f"duration: {lengths.min():g} s vanishes beside a start of {starts.max():g} s")
    arcs[..., MEAN_MOTION] = mean_motion
    arcs[..., STATE : STATE + 6] = states
    return arcs


def arcs_between(
    mean_motion: float, initial: ArrayLike, final: ArrayLike, duration: ArrayLike, start: ArrayLike
) -> tuple[Floats, Floats]:
    """Arcs (..., 30) from an initial state, and their final states (P, 6)."""
    ends = checked_below("final", final, 6)
    arcs = arcs_from(mean_motion, duration, start, initial, like=ends.shape[:-1], called="initial")
    finals = np.empty((*arcs.shape[:-1], 6))
    finals[...] = ends
    return arcs, finals.reshape(-1, 6)
