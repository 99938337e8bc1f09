"""Path past a moving ellipsoid by an artificial potential function, as SP11 discusses for its rivals.

A spacecraft follows its unconstrained path of minimum energy. Feedback w^2 e + 2 w e' pulls it back along a
parabolic potential of the deviation e. A Gaussian potential A exp((1 - s^2) / (2 b^2)) pushes it away from
the obstacle, with s the norm of the zone. Thrust is held between steps. No tuning suits every encounter, so
all of a grid are tried, and the one of least energy that stays clear and arrives is kept.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from peers.motion import Array, held, position, thrust

STEPS = 1000
PULLS = (8.0, 15.0, 30.0, 60.0)  # w times the duration
WIDTHS = (0.25, 0.5, 1.0)  # b, in zones
PUSHES = np.geomspace(1e-6, 1e-1, 41)  # A [m^2/s^2]
ARRIVED = 1.0  # m, deviation at the end


@dataclass(frozen=True)
class Pushed:
    """The best tuning."""

    energy: float  # m^2/s^3
    delta_v: float  # m/s
    thrust: Array  # (STEPS, 3) [m/s^2]
    share: float  # of the tunings that stay clear and arrive


def solve(path: Array, obstacle: Array, duration: float, n: float, half_axes: Array) -> Pushed | None:
    """Return the best path, or None if no tuning stays clear and arrives. Motions are coefficients (3, 8)."""
    dt = duration / STEPS
    times = np.arange(STEPS + 1) * dt
    along, there = position(path, times, n), position(obstacle, times, n)
    planned = thrust(path, times[:-1] + dt / 2, n)
    grid = np.array(list(product(PULLS, WIDTHS, PUSHES)))
    pull, width, push = grid[:, 0, None] / duration, grid[:, 1, None], grid[:, 2, None]
    phi, gamma = held(n, dt)
    error = np.zeros((len(grid), 6))
    used = np.empty((STEPS, len(grid), 3))
    least = np.full(len(grid), np.inf)
    for k in range(STEPS):
        q = (along[k] + error[:, :3] - there[k]) / half_axes
        norm = np.linalg.norm(q, axis=1)
        least = np.minimum(least, norm)
        slope = push / width**2 * np.exp((1.0 - norm[:, None] ** 2) / (2.0 * width**2)) * q / half_axes
        added = slope - pull**2 * error[:, :3] - 2.0 * pull * error[:, 3:]
        used[k] = planned[k] + added
        error = error @ phi.T + added @ gamma.T
    energies = 0.5 * dt * (used**2).sum(axis=(0, 2))
    good = (least > 1.0) & (np.linalg.norm(error[:, :3], axis=1) < ARRIVED)
    if not good.any():
        return None
    best = int(np.argmin(np.where(good, energies, np.inf)))
    chosen = used[:, best]
    delta_v = float(np.linalg.norm(chosen, axis=1).sum() * dt)
    return Pushed(float(energies[best]), delta_v, chosen, float(good.mean()))
