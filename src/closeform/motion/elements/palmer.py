"""Conversion between states in the Hill frame and Palmer's coordinates [e1, e2, d, l, h1, h2].

Pure NumPy; both broadcast over leading shapes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast
from closeform.motion.elements.mean_motion import checked


def palmer_from_state(state: ArrayLike, mean_motion: ArrayLike) -> Floats:
    """Return Palmer's phase-space coordinates of a state in the Hill frame.

    Parameters
    ----------
    state : array_like of shape (..., 6) [m, m/s]
        State in the Hill frame of a circular orbit.
    mean_motion : array_like of shape (...) [rad/s]
        Mean motion of that orbit; shapes broadcast.

    Returns
    -------
    array of shape (..., 6) [m]
        Coordinates [e1, e2, d, l, h1, h2]: (e1, e2) is the eccentricity difference, d and l the
        difference of semi-major axis and of mean longitude, (h1, h2) that of inclination.  All are
        constant or rotate uniformly, except l, which drifts.

    Raises
    ------
    ValueError
        If `mean_motion` is not positive (in deep space the coordinates do not exist), shapes do not fit,
        or a value is not finite.

    References
    ----------
    Palmer, J. Guidance, Control, and Dynamics 29(3), 2006; docs/theory.md (2).
    """
    n, states = checked("mean_motion", mean_motion, positive=True), checked("state", state, last=6)
    broadcast(state=states.shape[:-1], mean_motion=np.shape(n))
    x, y, z, vx, vy, vz = np.moveaxis(states, -1, 0)
    e1, d = 3.0 * x + 2.0 * vy / n, 2.0 * x + vy / n
    return np.stack(np.broadcast_arrays(e1, vx / n, d, y - 2.0 * vx / n, z, vz / n), axis=-1)


def state_from_palmer(palmer: ArrayLike, mean_motion: ArrayLike) -> Floats:
    """Return the state in the Hill frame: the inverse of `palmer_from_state`.

    Parameters
    ----------
    palmer : array_like of shape (..., 6) [m]
        Coordinates [e1, e2, d, l, h1, h2].
    mean_motion : array_like of shape (...) [rad/s]
        Mean motion of the circular orbit; shapes broadcast.

    Returns
    -------
    array of shape (..., 6) [m, m/s]
        State in the Hill frame.

    Raises
    ------
    ValueError
        If `mean_motion` is not positive, shapes do not fit, or a value is not finite.

    References
    ----------
    Palmer, J. Guidance, Control, and Dynamics 29(3), 2006; docs/theory.md (3).
    """
    n, given = checked("mean_motion", mean_motion, positive=True), checked("palmer", palmer, last=6)
    broadcast(palmer=given.shape[:-1], mean_motion=np.shape(n))
    e1, e2, d, l, h1, h2 = np.moveaxis(given, -1, 0)  # noqa: E741
    vy = n * (2.0 * e1 - 3.0 * d)
    return np.stack(np.broadcast_arrays(2.0 * d - e1, l + 2.0 * e2, h1, n * e2, vy, n * h2), axis=-1)
