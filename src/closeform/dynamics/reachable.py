"""Reachable: what thrusters push of what a field asks of them, and what they leave alone."""

from __future__ import annotations

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.thrusters import Thrusters, turn

FLAT = 1e-9  # of the greatest: directions whose span is thinner lie in a plane, or along a line


def reachable(thrusters: Thrusters, angles: Floats) -> Floats:
    """What their directions span (T, 3, 3) where the orbit has turned by `angles` (T,) [rad].

    Projections of vectors in the orbit's axes: of thrusters that push to all sides the unit matrix.
    """
    sides, sizes, _ = np.linalg.svd(thrusters.directions.T, full_matrices=False)
    span = sides[:, sizes > FLAT * sizes[0]]
    turned = turn(angles if thrusters.frame == "inertial" else 0.0 * angles) @ span
    return np.asarray(turned @ turned.swapaxes(-1, -2))


def lacks(thrusters: Thrusters) -> bool:
    """Whether there is a direction along which none of them pushes, one way or the other."""
    return bool(np.linalg.matrix_rank(thrusters.directions, tol=FLAT) < 3)
