"""Share of a normal distribution within a ball: the probability to be inside a zone at one time.

In zone coordinates along the principal axes of the position, q = b + s d, the thinnest axis first. The ball
is cut into slices across the thinnest axis, and these into strips along the widest, whose share has a closed
form:

    P = integral over q0 of phi(d0) / s0 integral over q1 of phi(d1) / s1 (Phi(d2 high) - Phi(d2 low))

q0 = sin(angle), and in a slice of radius w q1 = w sin(angle), so that the integrand has no root at an end.
The integrand is log-concave (Prekopa), so that all but `TAIL` of it lies in one stretch about its maximum,
however thin or far away the distribution is.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import ndtr

from closeform.arrays import Floats
from closeform.uncertainty.quadrature import Integral, integral
from closeform.uncertainty.sampled_trajectories import SampledTrajectories
from closeform.uncertainty.whitened import THINNEST

REACH = 39.0  # standard deviations up to which densities do not underflow
TAIL = 40.0  # decrease of the logarithm from its maximum at which the integrand is negligible
NODES = 48  # quadrature nodes of a strip, accurate to 1e-9
PIECES = 24  # initial number of slices
ROUNDS = 50  # iterations of the search for a maximum or an edge
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
TOLERANCE = 1e-7


def inside(histories: SampledTrajectories, time: float) -> tuple[float, float]:
    """Return the probability to be within the zone at a time, and its error."""
    mean, factor = histories.states(np.array([time]))
    matrix = histories.zone.matrix
    axes, widths, _ = np.linalg.svd(matrix @ factor[0, :3])
    sizes = np.maximum(np.pad(widths, (0, 3 - len(widths))), THINNEST)
    found = ball_share((axes.T @ matrix @ mean[0, :3])[::-1], sizes[::-1])
    return min(found.value, 1.0), found.error


def ball_share(b: Floats, s: Floats) -> Integral:
    """Return the share of a normal distribution in the unit ball.

    `b` (3,): its mean; `s` (3,): its standard deviations, the smallest first.
    """
    low, high = np.arcsin(np.clip([b[0] - REACH * s[0], b[0] + REACH * s[0]], -1.0, 1.0))

    def slices(angles: Floats) -> Floats:
        d = (np.sin(angles) - b[0]) / s[0]
        share = _strips(np.cos(angles), b[1:], s[1:])
        return np.asarray(np.cos(angles) * np.exp(-0.5 * d * d) * share / (np.sqrt(2.0 * np.pi) * s[0]))

    return integral(slices, np.linspace(low, high, PIECES + 1), TOLERANCE)


def _strips(radii: Floats, b: Floats, s: Floats) -> Floats:
    """Return the shares of discs (K,) in a plane."""

    def height(angles: Floats) -> Floats:  # of the logarithm, without slowly varying terms
        d = (radii * np.sin(angles) - b[0]) / s[0]
        gap = np.maximum(abs(b[1]) - radii * np.cos(angles), 0.0) / s[1]
        return np.asarray(-0.5 * (d * d + gap * gap))

    edges = np.clip((b[0] + np.array([[-REACH], [REACH]]) * s[0]) / radii, -1.0, 1.0)
    first, last = np.arcsin(edges)
    top = _highest(height, first, last)
    least = height(top) - TAIL
    low, high = _edge(height, least, top, first), _edge(height, least, top, last)
    places, weights = np.polynomial.legendre.leggauss(NODES)
    angles = 0.5 * (low + high) + 0.5 * (high - low) * places[:, None]
    d = (radii * np.sin(angles) - b[0]) / s[0]
    half = radii * np.cos(angles)
    # from the smaller tail, to keep its digits
    strip = ndtr((half - abs(b[1])) / s[1]) - ndtr((-half - abs(b[1])) / s[1])
    sums = weights @ (half * np.exp(-0.5 * d * d) * strip)
    return np.asarray(0.5 * (high - low) * sums / (np.sqrt(2.0 * np.pi) * s[0]))


def _highest(height: Callable[[Floats], Floats], low: Floats, high: Floats) -> Floats:
    """Return the maximum of a unimodal function, by golden sections."""
    for _ in range(ROUNDS):
        step = GOLDEN * (high - low)
        right = height(low + step) > height(high - step)
        low, high = np.where(right, high - step, low), np.where(right, high, low + step)
    return np.asarray(0.5 * (low + high))


def _edge(height: Callable[[Floats], Floats], least: Floats, inner: Floats, outer: Floats) -> Floats:
    """Return the end of the range in which a function is above `least`, from its maximum towards `outer`."""
    for _ in range(ROUNDS):
        middle = 0.5 * (inner + outer)
        above = height(middle) > least
        inner, outer = np.where(above, middle, inner), np.where(above, outer, middle)
    return outer
