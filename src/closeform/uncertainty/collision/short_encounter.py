"""Probability to be inside a zone at one time, and to pass through it in a short encounter.

In zone coordinates along the principal axes of the position, q = b + s d, the thinnest axis first. The ball
is cut into slices across the thinnest axis, and these into strips along the widest, whose share has a closed
form:

    P = integral over q0 of phi(d0) / s0 integral over q1 of phi(d1) / s1 (Phi(d2 high) - Phi(d2 low))

q0 = sin(angle), and in a slice of radius w q1 = w sin(angle), so that the integrand has no root at an end.
The integrand is log-concave (Prekopa), so that all but `TAIL` of it lies in one stretch about its maximum,
however thin or far away the distribution is.

In a short encounter the relative motion is straight and the covariance that at closest approach, so that the
ball becomes a disc across the velocity, with two integrals left (Foster and Estes 1992).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import ndtr

from closeform.arrays import Floats
from closeform.conflicts.two_paths import closest_approach
from closeform.uncertainty.collision.entry_rate import THINNEST
from closeform.uncertainty.collision.expected_entries import Integral, integral
from closeform.uncertainty.collision.sampled_trajectories import SampledTrajectories

REACH = 39.0  # standard deviations up to which densities do not underflow
TAIL = 40.0  # decrease of the logarithm from its maximum at which the integrand is negligible
NODES, FINE = 48, 200  # quadrature nodes of a slice, accurate to 1e-9, and of a short encounter
PIECES = 24  # initial number of slices
ROUNDS = 50  # iterations of the search for a maximum or an edge
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
TOLERANCE = 1e-7
EDGE = 1e-6  # of the common time: a closest approach nearer to its ends is not a passage


class NotPassing(ValueError):
    """Two craft that are closest at the start or the end of their time, without passing each other."""


def passes_through(sampled: SampledTrajectories) -> tuple[float, float]:
    """Return the probability to pass through an ellipsoid, and its quadrature error: Foster's integral.

    In zone coordinates, over the disc of the unit ball seen along the velocity at closest approach.
    """
    approach = closest_approach(sampled.path, sampled.other, sampled.zone)
    start, end = sampled.edges[0], sampled.edges[-1]
    if not start + EDGE * (end - start) < approach.time < end - EDGE * (end - start):
        edge = "start" if approach.time < 0.5 * (start + end) else "end"
        raise NotPassing(
            f"path, other: closest approach is at the {edge} of the time span, so they do not pass each "
            'other in it; use method="entries"'
        )
    mean, factor = sampled.states(np.array([approach.time]))
    matrix = sampled.zone.matrix
    position, velocity = matrix @ mean[0, :3], matrix @ mean[0, 3:]
    across = np.linalg.svd(velocity[None])[2][1:]
    axes, widths, _ = np.linalg.svd(across @ matrix @ factor[0, :3])
    directions = axes.T @ across  # the largest deviation first
    (far, near), (wide, thin) = directions @ position, np.maximum(widths, THINNEST)
    place, sizes = np.array([near, far]), np.array([thin, wide])
    few, many = (float(disc_shares(np.ones(1), place, sizes, size)[0]) for size in (FINE // 2, FINE))
    return many, abs(many - few)


def probability_inside(sampled: SampledTrajectories, time: float) -> tuple[float, float]:
    """Return the probability to be within the zone at a time, and its error."""
    mean, factor = sampled.states(np.array([time]))
    matrix = sampled.zone.matrix
    axes, widths, _ = np.linalg.svd(matrix @ factor[0, :3])
    sizes = np.maximum(np.pad(widths, (0, 3 - len(widths))), THINNEST)
    found = ball_share((axes.T @ matrix @ mean[0, :3])[::-1], sizes[::-1])
    return min(found.value, 1.0), found.error


def ball_share(b: Floats, s: Floats) -> Integral:
    """Return the fraction of a normal distribution in the unit ball.

    `b` (3,): its mean; `s` (3,): its standard deviations, the smallest first.
    """
    low, high = np.arcsin(np.clip([b[0] - REACH * s[0], b[0] + REACH * s[0]], -1.0, 1.0))

    def slices(angles: Floats) -> Floats:
        d = (np.sin(angles) - b[0]) / s[0]
        share = disc_shares(np.cos(angles), b[1:], s[1:])
        return np.asarray(np.cos(angles) * np.exp(-0.5 * d * d) * share / (np.sqrt(2.0 * np.pi) * s[0]))

    return integral(slices, np.linspace(low, high, PIECES + 1), TOLERANCE)


def disc_shares(radii: Floats, b: Floats, s: Floats, nodes: int = NODES) -> Floats:
    """Return the shares of a normal distribution in discs (K,) of a plane, as `ball_share`."""

    def height(angles: Floats) -> Floats:  # of the logarithm, without slowly varying terms
        d = (radii * np.sin(angles) - b[0]) / s[0]
        gap = np.maximum(abs(b[1]) - radii * np.cos(angles), 0.0) / s[1]
        return np.asarray(-0.5 * (d * d + gap * gap))

    edges = np.clip((b[0] + np.array([[-REACH], [REACH]]) * s[0]) / radii, -1.0, 1.0)
    first, last = np.arcsin(edges)
    top = _highest(height, first, last)
    least = height(top) - TAIL
    low, high = _edge(height, least, top, first), _edge(height, least, top, last)
    places, weights = np.polynomial.legendre.leggauss(nodes)
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
