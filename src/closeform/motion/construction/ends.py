"""Arcs of natural motion from the states and times that users pass, validated."""

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, finite
from closeform.motion.arc import END, MEAN_MOTION, START, STATE, WIDTH
from closeform.motion.duration import flaw


def arcs_from(
    mean_motion: float,
    duration: ArrayLike,
    start: ArrayLike,
    state: ArrayLike,
    like: tuple[int, ...] = (),
    called: str = "state",
) -> Floats:
    """Return arcs (..., 30) of natural motion from a state, broadcast with the shape `like`."""
    states = finite(called, state, 6)
    lengths, starts = finite("duration", duration), finite("start", start)
    if wrong := flaw(lengths, mean_motion):
        raise ValueError(f"duration: {wrong}")
    shape = broadcast(**{called: states.shape[:-1]}, duration=lengths.shape, start=starts.shape, other=like)
    arcs = np.zeros((*shape, WIDTH))
    arcs[..., START] = starts
    arcs[..., END] = starts + lengths
    if not (arcs[..., END] > arcs[..., START]).all():
        raise ValueError(f"duration: {lengths.min():g} s is too short for a start at {starts.max():g} s")
    arcs[..., MEAN_MOTION] = mean_motion
    arcs[..., STATE : STATE + 6] = states
    return arcs


def arcs_between(
    mean_motion: float, initial: ArrayLike, final: ArrayLike, duration: ArrayLike, start: ArrayLike
) -> tuple[Floats, Floats]:
    """Return arcs (..., 30) from an initial state, and their final states (P, 6)."""
    ends = finite("final", final, 6)
    arcs = arcs_from(mean_motion, duration, start, initial, like=ends.shape[:-1], called="initial")
    finals = np.empty((*arcs.shape[:-1], 6))
    finals[...] = ends
    return arcs, finals.reshape(-1, 6)
