"""Clock of a table: the angle s in which its windows are polynomials, and the time t [s] of an angle.

    n t + M0 = s - e sin s,   dt/ds = (1 - e cos s) / n

For a chief on an ellipse s is its eccentric anomaly, with full revolutions kept.  In s the motion beside an
ellipse has no singularity nearer than arccosh(1/e) from the real axis; in t it has one at about a third of
that distance (e = 0.6), so that polynomials in t need more windows.  Other motions use any clock that runs
slowly where they are fast; e = 0 is time itself.
"""

from math import cos, floor, pi, sin

import numpy as np
from numba import float64, void

from closeform._jit import kernel
from closeform.arrays import Floats

RATE, ECCENTRICITY, PHASE = 0, 1, 2  # n [rad/s], e and M0 [rad] of a clock (3,)
NEWTON_STEPS = 30  # at most 8 are needed up to e = 0.9; the limit only ends a step between two last digits


@kernel()
def angle_at(clock, t):
    """Return the angle s at time t, by Newton's method on Kepler's equation."""
    e = clock[ECCENTRICITY]
    mean = clock[RATE] * t + clock[PHASE]
    if e == 0.0:
        return mean
    turns = 2.0 * pi * floor(mean / (2.0 * pi) + 0.5)
    mean -= turns
    s = mean + (0.85 * e if mean > 0.0 else -0.85 * e)  # Danby's start
    for _ in range(NEWTON_STEPS):
        step = (s - e * sin(s) - mean) / (1.0 - e * cos(s))
        s -= step
        if abs(step) <= 1e-16 + 2.3e-16 * abs(s):
            break
    return s + turns


@kernel()
def time_at(clock, s):
    """Return the time [s] of an angle."""
    return (s - clock[ECCENTRICITY] * sin(s) - clock[PHASE]) / clock[RATE]


@kernel()
def pace(clock, s):
    """Return dt/ds in units of 1/n."""
    return 1.0 - clock[ECCENTRICITY] * cos(s)


@kernel(void(float64[::1], float64[::1], float64[::1]))
def fill_angles(clock, times, angles):
    """Fill `angles` with those of `times`."""
    for k in range(len(times)):
        angles[k] = angle_at(clock, times[k])


def times_at(clock: Floats, angles: Floats) -> Floats:
    """Return the times [s] of angles of any shape."""
    return np.asarray((angles - clock[ECCENTRICITY] * np.sin(angles) - clock[PHASE]) / clock[RATE])


def pace_at(clock: Floats, angle: float) -> float:
    """Return dt/ds at an angle, in units of 1/n."""
    return 1.0 - float(clock[ECCENTRICITY]) * cos(angle)


def angles_at(clock: Floats, times: Floats) -> Floats:
    """Return the angles of times of any shape."""
    out = np.empty(times.size)
    fill_angles(clock, np.ascontiguousarray(times, dtype=float).ravel(), out)
    return out.reshape(times.shape)
