"""Widths: bounds on the displacement of each craft by its errors between common times, for quick rejection.

With E that maps the zone to the unit ball, one sigma moves a craft by at most the norm of E R(t), R its
columns. That norm is convex, so that over an interval of length h, with R'' bounded, it is below

    max(|E R(t)|, |E R(t + h)|) + h^2/8 max |E R''|                                      # theory (55)

and white noise since t adds the square of its own, which only grows. The widths of two craft add up.
"""

from math import sqrt

import numpy as np
from numba import float64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.conflicts.quick_rejection import OFF_CHORD
from closeform.conflicts.tracks import Tracks
from closeform.kernel_loans import lent, stack_matrix, stack_vector
from closeform.motion.arc import END, START, acceleration, derivatives_at, state_at
from closeform.motion.certified_march import bounds, store
from closeform.uncertainty.covariance_propagation import (
    ERRORS_TYPE,
    NOISE,
    PropagatedErrors,
    add_noise,
    add_settled,
    burn_error_arc,
    burn_errors,
    coast_columns,
)
from closeform.zones.zone import Zone, enclosing

ROUNDING = 1.0 + 1e-9


@kernel()
def add_square(matrix, x, y, z, s):
    """Add E r (E r)^T of one column to `s` (3, 3); return the square of its length."""
    r = stack_vector(3)
    square = 0.0
    for i in range(3):
        r[i] = matrix[i, 0] * x + matrix[i, 1] * y + matrix[i, 2] * z
        square += r[i] * r[i]
    for i in range(3):
        for j in range(3):
            s[i, j] += r[i] * r[j]
    return square


@kernel()
def largest_eigenvalue(s):
    """Return an upper bound on a covariance's largest eigenvalue: its largest sum of a row's magnitudes."""
    largest = 0.0
    for i in range(3):
        largest = max(largest, abs(s[i, 0]) + abs(s[i, 1]) + abs(s[i, 2]))
    return largest


@kernel()
def add_columns(matrix, a, width, s):
    """Add the positions of columns."""
    for j in range(width):
        add_square(matrix, a[0, j], a[1, j], a[2, j], s)


@kernel()
def settled_bend(n, h, matrix, a, width, s):
    """Return the square of a bound on the acceleration of all columns over [0, h]; overwrites `s`."""
    b = c = 0.0
    for j in range(width):
        x, z, vx, vy, vz = a[0, j], a[2, j], a[3, j], a[4, j], a[5, j]
        ax, ay, az = acceleration(n, x, z, vx, vy)
        b += add_square(matrix, ax, ay, az, s)
        ax, ay, az = acceleration(n, vx, vz, ax, ay)
        c += add_square(matrix, ax, ay, az, s)
    grown = sqrt(b) + sqrt(c) * h
    grown *= grown
    return min(grown, b + c / (n * n)) if n > 0.0 else grown


@kernel()
def width_along(n, arc, row, execution, t, h, matrix):
    """Return the largest displacement of a craft by one sigma, from time t on for h within one arc.

    theory (55)
    """
    a, q, out = stack_matrix(6, 16), stack_matrix(8, 3), stack_vector(30)
    s, first, last = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    first[:] = 0.0
    last[:] = 0.0
    width = add_settled(n, arc, row, execution, t, a, 0)
    add_columns(matrix, a, width, first)
    bend = settled_bend(n, h, matrix, a, width, s)
    coast_columns(n, h, a, 0, width)
    add_columns(matrix, a, width, last)
    for j in range(burn_errors(arc, execution)):
        burn_error_arc(n, arc, row, execution, j, out)
        x, y, z, _, _, _ = state_at(out, t + h)
        add_square(matrix, x, y, z, last)
        q[:] = 0.0
        derivatives_at(out, t, 8, q, 1.0)
        add_square(matrix, q[0, 0], q[0, 1], q[0, 2], first)
        for k in range(8):
            store(q, k, matrix, q[k, 0], q[k, 1], q[k, 2])
        most = bounds(q, 8, n, h)[3]
        bend += most * most
    wide = sqrt(max(largest_eigenvalue(first), largest_eigenvalue(last))) + 0.125 * h * h * sqrt(bend)
    if not (execution[NOISE] > 0.0 and h > 0.0):
        return wide
    add_noise(n, h, execution[NOISE], a, 0)
    s[:] = 0.0
    add_columns(matrix, a, 6, s)
    return sqrt(wide * wide + largest_eigenvalue(s))


@kernel(void(ERRORS_TYPE, float64, float64[:, ::1], float64[::1], float64[:, ::1]))
def fill_widths(one, n, matrix, times, widths):
    """Fill `widths` (N, K + 1) of one sigma from each time to the next, during each craft's path."""
    one = lent(one)
    for craft in range(len(one.offsets) - 1):
        for m in range(one.offsets[craft], one.offsets[craft + 1]):
            arc = one.arcs[m]
            for k in range(len(times) - 1):
                begin, end = max(times[k], arc[START]), min(times[k + 1], arc[END])
                if begin <= end:
                    wide = width_along(n, arc, one.rows[m], one.execution[craft], begin, end - begin, matrix)
                    widths[craft, k] = max(widths[craft, k], wide)


def widened(tracks: Tracks, one: PropagatedErrors, zone: Zone, mean_motion: float, sigmas: float) -> Tracks:
    """Return the tracks of a batch, with `sigmas` standard deviations added to their distance from chords."""
    if not len(tracks.times):
        return tracks
    widths = np.zeros((len(tracks.own), len(tracks.times)))
    fill_widths(one, mean_motion, enclosing(zone), tracks.times, widths)
    own: Floats = tracks.own.copy()
    own[:, OFF_CHORD] += sigmas * ROUNDING * widths
    return Tracks(tracks.times, own, own)
