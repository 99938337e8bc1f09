"""Two spacecraft that change places around an obstacle."""

import numpy as np

import closeform as cf

N = 1.1e-3
ORBIT, SPACE = cf.Orbit(N), cf.Orbit(0.0)
PATH = ORBIT.transfer([0, -200, 10, 0, 0, 0], [40, 200, 60, 0, -0.09, 0], 3000.0)
OTHER = ORBIT.coast(ORBIT.transition(-1350.0) @ (PATH.state(1350.0) + [3, 4, -5, 0.02, 0, 0.01]), 3000.0)
TILT = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
CRAFT, RADIUS = 8, 18.0


def swapping():
    """Return spacecraft on a slightly warped ring that move to the opposite places."""
    angles = 2 * np.pi * np.arange(CRAFT) / CRAFT
    initial = np.zeros((CRAFT, 6))
    initial[:, 0], initial[:, 1] = 3 * np.cos(3 * angles + 1), 100 * np.cos(angles)
    initial[:, 2] = 80 * np.sin(angles)
    return initial
