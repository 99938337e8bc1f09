"""Covariances of states in messages, and their axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closeform.arrays import Floats, numbers, sequence
from closeform.result import Result

LOWER = np.tril_indices(6)  # row by row, as messages list them
RADIAL = ("RTN", "RSW")
LOCAL = (*RADIAL, "TNW")  # CCSDS 502.0-B-3 3.2.4.11
J2000 = {"J2000": "EME2000"}


@dataclass(frozen=True, eq=False, repr=False)
class Covariances(Result):
    """Covariances of an object's states at epochs, as in an OEM.

    Parameters
    ----------
    times : array of shape (C,) [s]
        Times since the epoch of the ephemeris, increasing; may precede its first state.  array_like.
    matrices : array of shape (C, 6, 6) [m^2, m^2/s, m^2/s^2]
        Covariances of position and velocity, along the axes of `frames`, symmetric and without negative
        eigenvalues; array_like.
    frames : tuple of str, of C
        Frame of each: "RTN" or "RSW" (radial, along-track, cross-track), "TNW" (along the velocity, in plane,
        cross-track), of the object itself, or the frame of the states.  Velocities are inertial in all
        frames; only their components are along these axes.  Any sequence.

    Raises
    ------
    ValueError
        If shapes do not fit, times do not increase, or a matrix is invalid (the message gives its
        eigenvalue).

    References
    ----------
    CCSDS 502.0-B, Orbit Data Messages, 5.2.5 and 3.2.4.11; docs/ephemerides.md.
    """

    times: Floats
    matrices: Floats
    frames: tuple[str, ...]

    def __post_init__(self) -> None:
        times, matrices = numbers("times", self.times), numbers("matrices", self.matrices)
        frames = tuple(sequence("frames", self.frames, str))
        if times.ndim != 1 or matrices.shape != (len(times), 6, 6) or len(frames) != len(times):
            got = f"got {times.shape}, {matrices.shape} and {len(frames)}"
            raise ValueError(f"times, matrices, frames: expected (C,), (C, 6, 6) and C of them, {got}")
        if not (np.isfinite(times).all() and (np.diff(times) > 0.0).all()):
            raise ValueError("times: must be finite and increase; sort the covariances and remove duplicates")
        for index, matrix in enumerate(matrices):
            check(f"matrices[{index}]", matrix)
        for name, value in (("times", times), ("matrices", matrices), ("frames", frames)):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.times)


def from_lower(values: Sequence[float]) -> Floats:
    """Return a symmetric matrix (6, 6) from its 21 lower values, row by row."""
    matrix = np.zeros((6, 6))
    matrix[LOWER] = values
    return matrix + np.tril(matrix, -1).T


def check(name: str, matrix: Floats) -> None:
    """Raise ValueError for a matrix (6, 6) that is not a covariance, as `Uncertainty` does."""
    from closeform.uncertainty.covariance import (
        root_of,  # with kernels, which a file without blocks can spare
    )

    if not np.isfinite(matrix).all():
        raise ValueError(f"{name}: a value is not finite; remove or correct this covariance")
    root_of(name, matrix)


def canonical(frame: str) -> str:
    """Return the normalised name of a frame, for comparison."""
    name = frame.strip().upper()
    return J2000.get(name, name)


def inertial(matrix: Floats, frame: str, state: Floats) -> Floats:
    """Return a covariance (6, 6) along inertial axes, from that along local axes of an object."""
    if canonical(frame) not in LOCAL:
        return matrix
    turn = np.kron(np.eye(2), axes(frame, state))
    return np.asarray(turn.T @ matrix @ turn)


def axes(frame: str, state: Floats) -> Floats:
    """Return the axes of a local frame as rows (3, 3), for an object with an inertial `state` (6,)."""
    normal = np.cross(state[:3], state[3:])
    normal /= np.linalg.norm(normal)
    first = state[:3] if canonical(frame) in RADIAL else state[3:]
    first = first / np.linalg.norm(first)
    return np.array([first, np.cross(normal, first), normal])
