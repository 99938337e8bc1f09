"""Process noise in simulations: increments of states in the integration steps.

The noise of a simulation is one random motion from its start on, made of velocity changes every 8 s. It does
not depend on steps, legs or measurements.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from closeform.arrays import Floats
from closeform.motion.steering import transition_matrices
from closeform.uncertainty.white_noise import BLOCK, increments, instants_until, velocity_changes

HALVED = 9  # halvings of a block down to steps of 8 s
STEP = BLOCK / 2.0**HALVED


def shaken(
    n: float, density: float, times: Floats, normal: Callable[[int, int], Floats]
) -> tuple[Floats, Floats]:
    """Return the noise on the initial velocity (3,), and the increments of states in steps (K, 6).

    In the rotating frame, for a `density` [m^2/s^3] and a mean motion [rad/s], between times (K + 1,) [s]
    since the start; `normal` draws rows of six numbers for a level.
    """
    so_far = instants_until(times, STEP)
    pushes = increments(n, HALVED, int(so_far[-1]), lambda level, rows: normal(level, rows)[None])
    kicks = np.sqrt(density) * velocity_changes(n, STEP, pushes)[0]
    which = np.arange(max(so_far[0], 0), so_far[-1])
    steps = np.searchsorted(so_far, which, side="right") - 1
    moved = transition_matrices(n, times[steps + 1] - STEP * which)[:, :, 3:]
    added = np.zeros((len(times) - 1, 6))
    np.add.at(added, steps, np.einsum("kij,kj->ki", moved, kicks[which]))
    return kicks[0], added
