"""Controllable axes of thrusters: the part of a required thrust that they can produce."""

from __future__ import annotations

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.thrusters import Thrusters, turn

FLAT = 1e-9  # relative singular value below which directions span only a plane or a line


def reachable(thrusters: Thrusters, angles: Floats) -> Floats:
    """Return projections (T, 3, 3) onto the span of the thrusters, after rotations by `angles` (T,) [rad].

    Projections are along the orbit's axes. For thrusters that control all axes they are unit matrices.
    """
    sides, sizes, _ = np.linalg.svd(thrusters.directions.T, full_matrices=False)
    span = sides[:, sizes > FLAT * sizes[0]]
    turned = turn(angles if thrusters.frame == "inertial" else 0.0 * angles) @ span
    return np.asarray(turned @ turned.swapaxes(-1, -2))


def lacks(thrusters: Thrusters) -> bool:
    """Return True if there is an axis along which no thruster acts in either direction."""
    return bool(np.linalg.matrix_rank(thrusters.directions, tol=FLAT) < 3)
