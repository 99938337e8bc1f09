"""Mean rate of entries of a random motion into a ball at given times, and sampling of entries from it."""

from math import erfc, exp, inf, pi, sqrt

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, stack_matrix
from closeform.uncertainty.ball_surface import NODE, ball_rate, inward, nearest_square
from closeform.uncertainty.whitened import MEAN, SIGMA, principal


@kernel(
    void(
        float64[:, ::1],
        float64[:, :, ::1],
        float64[:, ::1],
        float64[:, :, ::1],
        float64,
        float64,
        float64[:, ::1],
    )
)
def surface_integrals(means, factors, matrix, rules, fineness, farthest, out):
    """Write the rate of entries into the unit ball, and the mean's distance, for each time (T, 2).

    The inputs are states (T, 6) and factors (T, 6, M) of their covariance, in zone coordinates. The distance
    to the ball is in standard deviations, and 0 inside. With a fineness of 0 only the distance is computed.
    The rate is 0 beyond `farthest`.
    """
    means, factors, matrix, out = borrowed(means), borrowed(factors), borrowed(matrix), borrowed(out)
    rules = borrowed(rules)
    frame = stack_matrix(13, 3)
    rows = np.empty((6, factors.shape[2]))
    nodes = np.empty((0, NODE))
    for k in range(len(out)):
        principal(means[k], factors[k], matrix, frame, rows)
        b0, b1, b2 = frame[MEAN, 0], frame[MEAN, 1], frame[MEAN, 2]
        out[k, 0], out[k, 1] = 0.0, 0.0
        if b0 * b0 + b1 * b1 + b2 * b2 > 1.0:
            out[k, 1] = sqrt(nearest_square(frame))
        if fineness > 0.0 and out[k, 1] <= farthest:
            out[k, 0], _ = ball_rate(frame, rules, fineness, nodes)


@kernel()
def speed_of_entry(mu, sigma, share):
    """Return the inward speed that a share of entries exceeds: density ~ w N(w; mu, sigma), w > 0."""
    if sigma <= 1e-12 * abs(mu):
        return abs(mu)
    u = mu / sigma
    total = exp(-0.5 * u * u) / sqrt(2.0 * pi) + 0.5 * u * erfc(-u / sqrt(2.0))
    low, high = 0.0, max(u, 0.0) + 40.0
    w = 0.5 * (u + sqrt(u * u + 4.0))  # the mode
    for _ in range(60):
        y = w - u
        density = exp(-0.5 * y * y) / sqrt(2.0 * pi)
        excess = (density + 0.5 * u * erfc(y / sqrt(2.0))) / total - share
        if excess > 0.0:
            low = w
        else:
            high = w
        slope = w * density / total
        step = excess / slope if slope > 0.0 else inf
        if abs(step) <= 1e-12 * w:
            break
        w = w + step if low < w + step < high else 0.5 * (low + high)
    return sigma * w


@kernel(
    void(
        float64[:, ::1],
        float64[:, :, ::1],
        float64[:, ::1],
        float64[:, :, ::1],
        float64,
        int64[::1],
        float64[:, ::1],
        float64[:, ::1],
    )
)
def draw_entries(means, factors, matrix, rules, fineness, first, shares, errors):
    """Turn standard normals (N, M) in `errors` into the errors of trajectories that enter at given times.

    The errors of time k are rows `first[k]` to `first[k + 1]`. `shares` (N, 2) give the place on the surface,
    rising from 0 to 1 for each time, and the speed. Errors are moved only along the directions that determine
    position and inward speed; for given values of these, the rest keeps its distribution.  # theory (63)
    """
    means, factors, matrix, errors = borrowed(means), borrowed(factors), borrowed(matrix), borrowed(errors)
    rules = borrowed(rules)
    frame = stack_matrix(13, 3)
    size = factors.shape[2]
    rows = np.empty((6, size))
    along = np.empty(size)
    nodes = np.empty((24 * len(rules) ** 2, NODE))
    for k in range(len(means)):
        if first[k] == first[k + 1]:
            continue
        principal(means[k], factors[k], matrix, frame, rows)
        rate, count = ball_rate(frame, rules, fineness, nodes)
        node, reached = 0, nodes[0, 3]
        for p in range(first[k], first[k + 1]):
            while reached < shares[p, 0] * rate and node + 1 < count:
                node += 1
                reached += nodes[node, 3]
            x, y, z = nodes[node, 0], nodes[node, 1], nodes[node, 2]
            place_errors(frame, rows, errors[p], along, x, y, z, shares[p, 1])


@kernel()
def place_errors(frame, rows, xi, along, x, y, z, share):
    """Move errors to those of a trajectory that enters at q = (x, y, z)."""
    size = len(xi)
    for i in range(3):
        q = x if i == 0 else (y if i == 1 else z)
        move = (q - frame[MEAN, i]) / frame[SIGMA, i]
        for j in range(size):
            move -= rows[i, j] * xi[j]
        for j in range(size):
            xi[j] += move * rows[i, j]
    mu = inward(frame, x, y, z)
    here, square = mu, 0.0
    for j in range(size):
        along[j] = -(x * rows[3, j] + y * rows[4, j] + z * rows[5, j])
        here += along[j] * xi[j]
        square += along[j] * along[j]
    if square > 0.0:
        lift = (speed_of_entry(mu, sqrt(square), share) - here) / square
        for j in range(size):
            xi[j] += lift * along[j]
