"""Shaken: what white noise adds to the states of craft in flight, in the steps in which they are integrated.

A flight's noise is one motion from its start on, of changes of velocity each 8 s: whichever steps, legs or
measurements there are, all see the same one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from closeform.arrays import Floats
from closeform.motion.steering import transition_matrices
from closeform.uncertainty.white_noise import BLOCK, by_then, increments, kicks_of

HALVED = 9  # times that a block is: into steps of 8 s
STEP = BLOCK / 2.0**HALVED


def shaken(
    n: float, density: float, times: Floats, normal: Callable[[int, int], Floats]
) -> tuple[Floats, Floats]:
    """What noise does to a velocity at its start (3,), and adds to states in steps (K, 6).

    In the rotating frame; of a `density` [m^2/s^3] at a mean motion [rad/s], between times (K + 1,) [s] since
    that start; `normal` draws so many rows of six numbers of a level.
    """
    so_far = by_then(times, STEP)
    pushes = increments(n, HALVED, int(so_far[-1]), lambda level, rows: normal(level, rows)[None])
    kicks = np.sqrt(density) * kicks_of(n, STEP, pushes)[0]
    which = np.arange(max(so_far[0], 0), so_far[-1])
    steps = np.searchsorted(so_far, which, side="right") - 1
    moved = transition_matrices(n, times[steps + 1] - STEP * which)[:, :, 3:]
    added = np.zeros((len(times) - 1, 6))
    np.add.at(added, steps, np.einsum("kij,kj->ki", moved, kicks[which]))
    return kicks[0], added
