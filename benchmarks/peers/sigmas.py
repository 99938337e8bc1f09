"""Clearance in sigmas of a coasting pair, from secular equations on a time grid and from sampled errors."""

import numpy as np

import closeform as cf
from peers.motion import Array

STEP = 10.0  # s


def on_grid(orbit: cf.Orbit, state: Array, deviations: Array, duration: float, radius: float) -> float:
    """Fewest sigmas from the mean to a sphere at any of the times.

    The nearest point q of the sphere in the metric of the covariance P is (I + m P)^-1 r with |q| = R; |q|
    falls with m >= 0, which is found by halving, in principal axes.
    """
    moved = orbit.transition(np.arange(0.0, duration, STEP))[:, :3]
    columns = moved * deviations
    values, axes = np.linalg.eigh(columns @ columns.transpose(0, 2, 1))
    mean = np.einsum("tji,tj->ti", axes, moved @ state)
    values = np.maximum(values, 1e-12 * values[:, -1:])
    if (np.linalg.norm(mean, axis=1) <= radius).any():
        return 0.0
    low, high = np.zeros(len(mean)), np.ones(len(mean))
    while True:
        short = np.linalg.norm(mean / (1.0 + high[:, None] * values), axis=1) > radius
        if not short.any():
            break
        low, high = np.where(short, high, low), np.where(short, 4.0 * high, high)
    for _ in range(60):
        middle = 0.5 * (low + high)
        short = np.linalg.norm(mean / (1.0 + middle[:, None] * values), axis=1) > radius
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    nearest = mean / (1.0 + high[:, None] * values)
    return float((high * np.sqrt(np.sum(values * nearest**2, axis=1))).min())


def drawn(
    orbit: cf.Orbit, state: Array, deviations: Array, duration: float, radius: float, samples: int
) -> float:
    """The least, in sigmas, of drawn errors that lead into the sphere at one of the times; inf for none."""
    random = np.random.default_rng(1)
    moved = orbit.transition(np.arange(0.0, duration, STEP))[:, :3]
    least = np.inf
    for _ in range(samples // 1000):
        errors = random.standard_normal((1000, 6))
        positions = np.einsum("tij,sj->sti", moved, state + errors * deviations)
        met = (np.einsum("sti,sti->st", positions, positions) <= radius**2).any(axis=1)
        least = min(least, np.linalg.norm(errors[met], axis=1).min(initial=np.inf))
    return float(least)
