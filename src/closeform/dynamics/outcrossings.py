"""Outcrossings: a bound on the probability that a random deviation leaves a sphere within a time."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
from scipy.special import erfc, ndtr

from closeform.arrays import Floats

# quadrature nodes of polar cosine and azimuth over a half sphere; four times as many agree to 1e-8
NODES = 12, 16
WIDEST = 40.0  # of the largest standard deviation: the probability beyond is negligible
HALVINGS = 60


class Outcrossings:
    """Random deviation with covariances (S, 6, 6) of position and velocity at S instants of an interval.

    Positions are A y, with y standard normal and A A^T their covariance. Directions of y are uniform, and its
    length has a chi distribution with three degrees of freedom. In the direction of A y the velocity is
    normal.
    """

    def __init__(self, covariances: Floats) -> None:
        places, across = covariances[:, :3, :3], covariances[:, 3:, :3]
        values, axes = np.linalg.eigh(places)  # the longest axis last: nodes are densest around it
        cosine, weights = np.polynomial.legendre.leggauss(NODES[0])
        cosine, azimuth = 0.5 + 0.5 * cosine[:, None], 2.0 * pi * np.arange(NODES[1]) / NODES[1]
        sine = np.sqrt(1.0 - cosine**2)
        y = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine + 0.0 * azimuth], axis=-1)
        points = np.einsum("sij,sj,abj->sabi", axes, np.sqrt(np.maximum(values, 0.0)), y)
        self.lengths = np.linalg.norm(points, axis=-1)  # (S, ...) of A y
        self.weights = 0.5 * weights[:, None] / NODES[1]
        n = points / self.lengths[..., None]
        slope = np.swapaxes(np.linalg.solve(places, np.swapaxes(across, 1, 2)), 1, 2)
        left = covariances[:, 3:, 3:] - slope @ np.swapaxes(across, 1, 2)
        self.growth = np.einsum("sabi,sij,sabj->sab", n, slope, n)  # [1/s] outward, of the radius
        spread = np.maximum(np.einsum("sabi,sij,sabj->sab", n, left, n), np.finfo(float).tiny)
        self.spread = np.sqrt(spread)  # [m/s] about that

    def chance(self, radius: float, duration: float) -> float:
        """Return an upper bound on the probability to begin outside, or to leave within a time.

        Rice's formula for vectors.  # theory (95)
        """
        q, mean = radius / self.lengths, radius * self.growth
        density, u = np.exp(-0.5 * q * q), mean / self.spread
        outward = self.spread * np.exp(-0.5 * u * u) / sqrt(2.0 * pi) + mean * ndtr(u)
        outside = erfc(q / sqrt(2.0)) + sqrt(2.0 / pi) * q * density
        rate = sqrt(2.0 / pi) * q * q * density * outward / self.lengths
        return float((self.weights * (outside + duration * rate)).sum(axis=(1, 2)).mean())

    def radius(self, duration: float, chance: float) -> float:
        """Return the radius of the sphere that is left within a time with at most that probability."""
        inside, outside = sqrt(2.0) * self.lengths.max(), WIDEST * self.lengths.max()
        for _ in range(HALVINGS):
            middle = 0.5 * (inside + outside)
            if self.chance(middle, duration) > chance:
                inside = middle
            else:
                outside = middle
        return float(outside)
