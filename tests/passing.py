"""Slow encounters of two spacecraft with uncertain states and noise."""

import numpy as np
from scipy.linalg import expm

import closeform as cf
from bridge import hill

ORBIT, DEEP = cf.Orbit.circular(500e3), cf.Orbit(0.0)
N, PERIOD = ORBIT.mean_motion, ORBIT.period
ZONE = cf.Sphere(15.0)
AHEAD = [0, 120, 0, 0, 0, 0]
SLOW = np.diag([3.0, 6.0, 3.0, 2e-3, 2e-3, 2e-3]) ** 2  # 120 m ahead: 4 % enter twice in two orbits


def coasts(state, duration, orbit=ORBIT):
    return orbit.coast(state, duration), orbit.coast(np.zeros(6), duration)


def noise_of(density, n, step):
    """Return the covariance (6, 6) that white noise adds to a state in a step."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    pushed = np.array([expm(hill(n) * t)[:, 3:] for t in 0.5 * step * (nodes + 1.0)])
    return density * np.einsum("t,tik,tjk->ij", 0.5 * step * weights, pushed, pushed)
