"""Covariances of a state: which are accepted, their square roots, and those given in other frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite
from closeform.motion.frames import relative_from_inertial

# Of sqrt(P_ii P_jj): what differs by less is symmetric; an eigenvalue as far below 0 is rounding.
ROUNDING = 1e-9
# Of a covariance scaled by its diagonal: an eigenvalue that 16 digits cannot tell from 0 is 0, so that errors
# along a line or in a plane are.
UNTOLD = 4e-15


def root_of(name: str, covariance: ArrayLike) -> Floats:
    """Columns (6, 6) whose products with themselves sum to a covariance, which may be singular."""
    matrix = finite(name, covariance)
    if matrix.shape != (6, 6):
        raise ValueError(f"{name}: expected shape (6, 6), positions before velocities, got {matrix.shape}")
    deviations = np.sqrt(np.abs(np.diag(matrix)))
    sizes = np.where(deviations > 0.0, deviations, 1.0)  # covariances beside no variance have eigenvalues < 0
    scaled = matrix / np.outer(sizes, sizes)
    apart = np.abs(scaled - scaled.T)
    if apart.max() > ROUNDING:
        i, j = sorted(np.unravel_index(apart.argmax(), (6, 6)))
        one, other = matrix[i, j], matrix[j, i]
        raise ValueError(f"{name}: must be symmetric, got {one:g} at [{i}, {j}] and {other:g} at [{j}, {i}]")
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    if values[0] < -ROUNDING:
        raise ValueError(
            f"{name}: no covariance, its least eigenvalue, scaled by its diagonal, is {values[0]:.3g}; "
            "none may be below 0; were digits or signs lost?"
        )
    return np.asarray(deviations[:, None] * vectors * np.sqrt(np.where(values > UNTOLD, values, 0.0)))


def roots_of(covariances: Floats) -> Floats:
    """Roots (T, 6, 6) of covariances that are sound but for rounding; nil where they are nil."""
    sizes = np.sqrt(np.einsum("tii->ti", covariances))
    sizes[sizes == 0.0] = 1.0
    values, vectors = np.linalg.eigh(covariances / (sizes[:, :, None] * sizes[:, None, :]))
    return np.asarray(sizes[:, :, None] * vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :])


def into_frame(chief: Floats) -> Floats:
    """What takes errors of an inertial state (6,) into the Hill frame of a chief, which turns: (6, 6)."""
    sizes = np.repeat([np.linalg.norm(chief[:3]), np.linalg.norm(chief[3:])], 3)
    moved = relative_from_inertial(chief, chief + np.diag(sizes))  # affine in the state
    return np.asarray(moved.T / sizes)


def axes_of(state: Floats) -> Floats:
    """Radial, transverse and normal axes (3, 3) of an inertial state, as rows."""
    return into_frame(state)[:3, :3]
