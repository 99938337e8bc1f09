"""Covariances of a state: as messages hold them, and the axes that they are in."""

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
    """Covariances of an object's states at some epochs, as an OEM holds them.

    Parameters
    ----------
    times : array of shape (C,) [s]
        Since the epoch of the ephemeris, rising; may be before its first state.  Anything array_like will do.
    matrices : array of shape (C, 6, 6) [m^2, m^2/s, m^2/s^2]
        Of position and velocity, along the axes of its frame, symmetric and without negative eigenvalue;
        anything array_like will do.
    frames : tuple of str, of C
        Of each: "RTN" or "RSW" (radial, along-track, cross-track), "TNW" (along the velocity, in the plane,
        across), of the object itself, or the frame of the states.  Velocities are inertial in all of
        them, and only their components along these axes.  Any sequence will do.

    Raises
    ------
    ValueError
        If shapes do not fit, times do not rise, or a matrix is none; naming its least eigenvalue.

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
            raise ValueError("times: must be finite and rise; sort the covariances and remove doubles")
        for index, matrix in enumerate(matrices):
            check(f"matrices[{index}]", matrix)
        for name, value in (("times", times), ("matrices", matrices), ("frames", frames)):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.times)


def covariance_lines(matrices: Floats, stamps: Sequence[str], frames: Sequence[str], own: str) -> list[str]:
    """The block of an OEM, in km^2, km^2/s and km^2/s^2; frames are named that are not that of the states."""
    lines = ["", "COVARIANCE_START"]
    for stamp, matrix, given in zip(stamps, matrices / 1e6, frames, strict=True):
        lines.append(f"EPOCH = {stamp}")
        if given != own:
            lines.append(f"COV_REF_FRAME = {given}")
        lines += [" ".join(f"{value:.15e}" for value in matrix[row, : row + 1]) for row in range(6)]
    return [*lines, "COVARIANCE_STOP"]


def from_lower(values: Sequence[float]) -> Floats:
    """A symmetric matrix (6, 6) of its 21 values from upper left to lower right, row by row."""
    matrix = np.zeros((6, 6))
    matrix[LOWER] = values
    return matrix + np.tril(matrix, -1).T


def check(name: str, matrix: Floats) -> None:
    """Refuse a matrix (6, 6) that is no covariance, as `Uncertainty` does."""
    from closeform.uncertainty.covariance import (
        root_of,  # with kernels, which a file without blocks can spare
    )

    if not np.isfinite(matrix).all():
        raise ValueError(f"{name}: a value is not finite; remove or correct this covariance")
    root_of(name, matrix)


def canonical(frame: str) -> str:
    """A frame's name by which two are compared."""
    name = frame.strip().upper()
    return J2000.get(name, name)


def inertial(matrix: Floats, frame: str, state: Floats) -> Floats:
    """A covariance (6, 6) along inertial axes, where it is along those of an object of an inertial state."""
    if canonical(frame) not in LOCAL:
        return matrix
    turn = np.kron(np.eye(2), axes(frame, state))
    return np.asarray(turn.T @ matrix @ turn)


def axes(frame: str, state: Floats) -> Floats:
    """The axes of a local frame as rows (3, 3), of an object of an inertial `state` (6,)."""
    normal = np.cross(state[:3], state[3:])
    normal /= np.linalg.norm(normal)
    first = state[:3] if canonical(frame) in RADIAL else state[3:]
    first = first / np.linalg.norm(first)
    return np.array([first, np.cross(normal, first), normal])
