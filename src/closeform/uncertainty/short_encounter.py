"""Short encounter: straight relative motion with the position covariance at closest approach."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from closeform.conflicts.two_paths import closest_approach
from closeform.uncertainty.sampled_trajectories import SampledTrajectories
from closeform.uncertainty.whitened import THINNEST

REACH = 39.0  # standard deviations up to which densities do not underflow
NODES = 200
EDGE = 1e-6  # of the common time: a closest approach nearer to its ends is not a passage


class NotPassing(ValueError):
    """Two craft that are closest at the start or the end of their time, without passing each other."""


def passes_through(histories: SampledTrajectories) -> tuple[float, float]:
    """Return the probability to pass through an ellipsoid, and its quadrature error: Foster's integral.

    The integral is in zone coordinates, over the disc that the unit ball projects along the velocity at
    closest approach.
    """
    approach = closest_approach(histories.path, histories.other, histories.zone)
    start, end = histories.edges[0], histories.edges[-1]
    if not start + EDGE * (end - start) < approach.time < end - EDGE * (end - start):
        edge = "start" if approach.time < 0.5 * (start + end) else "end"
        raise NotPassing(
            f"path, other: closest approach is at the {edge} of the time span, so they do not pass each "
            'other in it; use method="entries"'
        )
    mean, factor = histories.states(np.array([approach.time]))
    matrix = histories.zone.matrix
    position, velocity = matrix @ mean[0, :3], matrix @ mean[0, 3:]
    across = np.linalg.svd(velocity[None])[2][1:]
    axes, widths, _ = np.linalg.svd(across @ matrix @ factor[0, :3])
    ways = axes.T @ across  # the largest deviation first
    (far, near), (wide, thin) = ways @ position, np.maximum(widths, THINNEST)
    few, many = (_disc(near, thin, far, wide, nodes) for nodes in (NODES // 2, NODES))
    return many, abs(many - few)


def _disc(near: float, thin: float, far: float, wide: float, nodes: int) -> float:
    """Return the share of a normal distribution in the unit disc, by strips across the thinner direction."""
    low, high = np.arcsin(np.clip([near - REACH * thin, near + REACH * thin], -1.0, 1.0))
    if not low < high:
        return 0.0
    edges = np.linspace(low, high, 9)
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    places, weights = np.polynomial.legendre.leggauss(nodes)
    angle = (middle[:, None] + half[:, None] * places).ravel()
    weight = (half[:, None] * weights).ravel() * np.cos(angle)
    d = (np.sin(angle) - near) / thin
    reach = np.cos(angle)
    side = -1.0 if far > 0.0 else 1.0  # the smaller tail keeps its digits
    strip = ndtr((reach + side * far) / wide) - ndtr((-reach + side * far) / wide)
    return float((weight * np.exp(-0.5 * d * d) * strip).sum() / (np.sqrt(2.0 * np.pi) * thin))
