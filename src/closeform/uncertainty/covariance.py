"""State covariances: validation, square roots, and conversion from other frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite
from closeform.motion.elements.frames import relative_from_inertial

# Relative to sqrt(P_ii P_jj): tolerance of symmetry, and of negative eigenvalues.
ROUNDING = 1e-9
# Of a covariance scaled by its diagonal: smaller eigenvalues are rounding and count as 0, so that errors
# along a line or in a plane stay there.
UNTOLD = 4e-15


def root_of(name: str, covariance: ArrayLike) -> Floats:
    """Return a square root (6, 6) of a covariance, which may be singular."""
    matrix = finite(name, covariance)
    if matrix.shape != (6, 6):
        raise ValueError(f"{name}: expected shape (6, 6), positions before velocities, got {matrix.shape}")
    deviations = np.sqrt(np.abs(np.diag(matrix)))
    # a covariance without variance gives an eigenvalue < 0
    sizes = np.where(deviations > 0.0, deviations, 1.0)
    scaled = matrix / np.outer(sizes, sizes)
    apart = np.abs(scaled - scaled.T)
    if apart.max() > ROUNDING:
        i, j = sorted(np.unravel_index(apart.argmax(), (6, 6)))
        one, other = matrix[i, j], matrix[j, i]
        raise ValueError(f"{name}: must be symmetric, got {one:g} at [{i}, {j}] and {other:g} at [{j}, {i}]")
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    if values[0] < -ROUNDING:
        raise ValueError(
            f"{name}: not a covariance, its smallest eigenvalue, scaled by its diagonal, is {values[0]:.3g}; "
            "check its digits and signs"
        )
    return np.asarray(deviations[:, None] * vectors * np.sqrt(np.where(values > UNTOLD, values, 0.0)))


def roots_of(covariances: Floats) -> Floats:
    """Return the roots (T, 6, 6) of covariances that are valid up to rounding."""
    sizes = np.sqrt(np.einsum("tii->ti", covariances))
    sizes[sizes == 0.0] = 1.0
    values, vectors = np.linalg.eigh(covariances / (sizes[:, :, None] * sizes[:, None, :]))
    return np.asarray(sizes[:, :, None] * vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :])


def into_frame(chief: Floats) -> Floats:
    """Return the matrix (6, 6) from errors of an inertial state to the rotating Hill frame of a chief."""
    sizes = np.repeat([np.linalg.norm(chief[:3]), np.linalg.norm(chief[3:])], 3)
    moved = relative_from_inertial(chief, chief + np.diag(sizes))  # affine in the state
    return np.asarray(moved.T / sizes)


def axes_of(state: Floats) -> Floats:
    """Return the radial, transverse and normal axes (3, 3) of an inertial state, as rows."""
    return into_frame(state)[:3, :3]
