"""Random state at one time, in zone coordinates along the principal axes of its position.

`principal` fills the frame (13, 3): deviations, mean position and mean velocity, the axes (rows), the
regression of the velocity on the position's standard normals (GAIN), and its residual covariance (SPREAD). It
also fills rows (6, M), orthonormal: the errors that form each standard normal, and the residual errors of
each component of the velocity.
"""

from math import sqrt

from closeform._jit import kernel

SIGMA, MEAN, VELOCITY, AXES, GAIN, SPREAD = 0, 1, 2, 3, 6, 9
NEAREST = 12  # set by `entry_rate`: the nearest point, in standard normals
THINNEST = 1e-9  # of the zone: smallest deviation, for errors in one plane

RESIDUAL = 1e-12  # relative deviation below which it is rounding


@kernel()
def principal(mean, factor, matrix, frame, rows):
    """Transform a state (6,) and a factor (6, M) of its covariance to the principal axes of its position."""
    size = factor.shape[1]
    for i in range(3):
        frame[SPREAD, i], frame[SPREAD + 1, i] = 0.0, 0.0
        for k in range(3):
            frame[SPREAD, i] += matrix[i, k] * mean[k]
            frame[SPREAD + 1, i] += matrix[i, k] * mean[3 + k]
            frame[AXES + i, k] = 1.0 if i == k else 0.0
        for j in range(size):
            rows[i, j], rows[3 + i, j] = 0.0, 0.0
            for k in range(3):
                rows[i, j] += matrix[i, k] * factor[k, j]
                rows[3 + i, j] += matrix[i, k] * factor[3 + k, j]
    make_orthogonal(frame, rows, size)
    for p in range(2):  # smallest deviation first
        for r in range(p + 1, 3):
            if frame[SIGMA, r] < frame[SIGMA, p]:
                frame[SIGMA, p], frame[SIGMA, r] = frame[SIGMA, r], frame[SIGMA, p]
                for k in range(3):
                    frame[AXES + p, k], frame[AXES + r, k] = frame[AXES + r, k], frame[AXES + p, k]
                for j in range(size):
                    rows[p, j], rows[r, j] = rows[r, j], rows[p, j]
    for i in range(3):
        frame[MEAN, i], frame[VELOCITY, i] = 0.0, 0.0
        for k in range(3):
            frame[MEAN, i] += frame[AXES + i, k] * frame[SPREAD, k]
            frame[VELOCITY, i] += frame[AXES + i, k] * frame[SPREAD + 1, k]
        known = frame[SIGMA, i] > RESIDUAL * frame[SIGMA, 2]
        for j in range(size):
            rows[i, j] = rows[i, j] / frame[SIGMA, i] if known else 0.0
        frame[SIGMA, i] = max(frame[SIGMA, i], THINNEST)
    for j in range(size):
        x, y, z = rows[3, j], rows[4, j], rows[5, j]
        for i in range(3):
            rows[3 + i, j] = frame[AXES + i, 0] * x + frame[AXES + i, 1] * y + frame[AXES + i, 2] * z
    part_velocity(frame, rows, size)


@kernel()
def make_orthogonal(frame, rows, size):
    """Rotate axes until the three rows of positions are orthogonal; their lengths are the deviations.

    Jacobi rotations of the factor's rows: the smallest deviation keeps its digits, which it would lose in the
    covariance.
    """
    for _ in range(30):
        turned = False
        for p in range(2):
            for r in range(p + 1, 3):
                a, b, g = 0.0, 0.0, 0.0
                for j in range(size):
                    a += rows[p, j] * rows[p, j]
                    b += rows[r, j] * rows[r, j]
                    g += rows[p, j] * rows[r, j]
                if abs(g) <= 1e-15 * sqrt(a * b):
                    continue
                turned = True
                zeta = (b - a) / (2.0 * g)
                t = (1.0 if zeta >= 0.0 else -1.0) / (abs(zeta) + sqrt(1.0 + zeta * zeta))
                c = 1.0 / sqrt(1.0 + t * t)
                s = c * t
                for j in range(size):
                    x, y = rows[p, j], rows[r, j]
                    rows[p, j], rows[r, j] = c * x - s * y, s * x + c * y
                for k in range(3):
                    x, y = frame[AXES + p, k], frame[AXES + r, k]
                    frame[AXES + p, k], frame[AXES + r, k] = c * x - s * y, s * x + c * y
        if not turned:
            break
    for i in range(3):
        square = 0.0
        for j in range(size):
            square += rows[i, j] * rows[i, j]
        frame[SIGMA, i] = sqrt(square)


@kernel()
def part_velocity(frame, rows, size):
    """Split the velocity's rows into the regression on the position and the residual.

    A residual that is only rounding is set to 0: with at most three errors, positions usually determine the
    velocity.
    """
    for i in range(3):
        whole, left = 0.0, 0.0
        for j in range(size):
            whole += rows[3 + i, j] * rows[3 + i, j]
        for k in range(3):
            share = 0.0
            for j in range(size):
                share += rows[3 + i, j] * rows[k, j]
            for j in range(size):
                rows[3 + i, j] -= share * rows[k, j]
            frame[GAIN + i, k] = share
        for j in range(size):
            left += rows[3 + i, j] * rows[3 + i, j]
        if left <= RESIDUAL * RESIDUAL * whole:
            for j in range(size):
                rows[3 + i, j] = 0.0
    for i in range(3):
        for k in range(3):
            frame[SPREAD + i, k] = 0.0
            for j in range(size):
                frame[SPREAD + i, k] += rows[3 + i, j] * rows[3 + k, j]
