"""Conversion of relative orbital elements (ROE) [da, dl, dex, dey, dix, diy].

ROE of two sets of orbital elements are exact, those of a state in the Hill frame of first order; both
are invertible.  Pure NumPy; every function broadcasts over leading shapes.  ROE are those of D'Amico
(Autonomous Formation Flying in Low Earth Orbit, TU Delft 2010).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, number, numbers
from closeform.motion.elements.elements import ellipse
from closeform.motion.elements.mean_motion import EARTH_MU, checked, mean_motion_from_semi_major_axis
from closeform.motion.elements.palmer import palmer_from_state, state_from_palmer

LEAST_SIN_INCLINATION = 1e-6
"""Sine of the chief's inclination below which the node, and with it the ROE, is refused."""


def roe_from_elements(chief: ArrayLike, deputy: ArrayLike) -> Floats:
    """Return the relative orbital elements of two sets of orbital elements, exactly.

    Parameters
    ----------
    chief : array_like of shape (..., 6) [m, rad, no unit, no unit, rad, rad]
        Elements [a, u, ex, ey, i, O].
    deputy : array_like of shape (..., 6) [m, rad, no unit, no unit, rad, rad]
        Elements [a, u, ex, ey, i, O]; shapes broadcast.

    Returns
    -------
    array of shape (..., 6) [no unit, rad, no unit, no unit, rad, rad]
        Elements [da, dl, dex, dey, dix, diy]; times a they are lengths.

    Raises
    ------
    ValueError
        If sin i of the chief is below 1e-6, as the node is then noise (use Palmer's coordinates there),
        an orbit is not an ellipse, shapes do not fit, or a value is not finite.

    Notes
    -----
    With differences deputy minus chief and the chief's a and i

        da = Da / a   dl = Du + DO cos i   dex, dey = Dex, Dey   dix = Di   diy = DO sin i

    dix and diy are the tilt of the orbital plane only while it is small against i.

    References
    ----------
    D'Amico, Autonomous Formation Flying in Low Earth Orbit, TU Delft 2010, eq. 2.2.
    """
    c, d = ellipse("chief", chief), ellipse("deputy", deputy)
    sine = _sine("chief", c[4])
    node = _wrapped(d[5] - c[5])
    longitude = _wrapped(d[1] - c[1] + node * np.cos(c[4]))
    return np.stack(
        [(d[0] - c[0]) / c[0], longitude, d[2] - c[2], d[3] - c[3], d[4] - c[4], node * sine], axis=-1
    )


def elements_from_roe(chief: ArrayLike, roe: ArrayLike) -> Floats:
    """Return a deputy's orbital elements: the inverse of `roe_from_elements`.

    Parameters
    ----------
    chief : array_like of shape (..., 6) [m, rad, no unit, no unit, rad, rad]
        Elements [a, u, ex, ey, i, O].
    roe : array_like of shape (..., 6) [no unit, rad, no unit, no unit, rad, rad]
        Relative elements [da, dl, dex, dey, dix, diy]; shapes broadcast.

    Returns
    -------
    array of shape (..., 6) [m, rad, no unit, no unit, rad, rad]
        Elements [a, u, ex, ey, i, O].

    Raises
    ------
    ValueError
        If sin i of the chief is below 1e-6, an orbit is or becomes no ellipse, shapes do not fit, or a
        value is not finite.

    References
    ----------
    D'Amico, Autonomous Formation Flying in Low Earth Orbit, TU Delft 2010, eq. 2.2.
    """
    a, u, ex, ey, inclination, right_ascension = ellipse("chief", chief)
    da, dl, dex, dey, dix, diy = np.moveaxis(checked("roe", roe, last=6), -1, 0)
    node = diy / _sine("chief", inclination)
    longitude = u + dl - node * np.cos(inclination)
    tilted, turned = inclination + dix, right_ascension + node
    deputy = np.stack([a * (1.0 + da), longitude, ex + dex, ey + dey, tilted, turned], axis=-1)
    ellipse("roe", deputy)
    return deputy


def scaled_roe_from_state(state: ArrayLike, mean_motion: ArrayLike, latitude: ArrayLike = 0.0) -> Floats:
    """Return relative orbital elements, times a, of a state in the Hill frame, to first order.

    Parameters
    ----------
    state : array_like of shape (..., 6) [m, m/s]
        State in the Hill frame of a chief on a circular orbit.
    mean_motion : array_like of shape (...) [rad/s]
        Mean motion of the chief.
    latitude : array_like of shape (...) [rad], default 0
        The chief's argument of latitude at that time; shapes broadcast.

    Returns
    -------
    array of shape (..., 6) [m]
        Elements a [da, dl, dex, dey, dix, diy].

    Raises
    ------
    ValueError
        If `mean_motion` is not positive, shapes do not fit, or a value is not finite.

    Notes
    -----
    The map is linear, and regular at any inclination: Palmer's coordinates, rotated.  All are constant in
    natural motion except a dl, which drifts by -3/2 n a da.  The error falls with the square of the
    separation; for a chief on an eccentric orbit it is of the order of the eccentricity times the separation.

    References
    ----------
    D'Amico, Autonomous Formation Flying in Low Earth Orbit, TU Delft 2010, eqs. 2.2 and 2.17.
    """
    palmer, u = palmer_from_state(state, mean_motion), checked("latitude", latitude)
    broadcast(state=palmer.shape[:-1], latitude=np.shape(u))
    e1, e2, d, l, h1, h2 = np.moveaxis(palmer, -1, 0)  # noqa: E741
    cos, sin = np.cos(u), np.sin(u)
    turned = e1 * cos + e2 * sin, e1 * sin - e2 * cos, h1 * sin + h2 * cos, h2 * sin - h1 * cos
    return np.stack(np.broadcast_arrays(2.0 * d, l, *turned), axis=-1)


def state_from_scaled_roe(scaled: ArrayLike, mean_motion: ArrayLike, latitude: ArrayLike = 0.0) -> Floats:
    """Return the state in the Hill frame: the inverse of `scaled_roe_from_state`.

    Parameters
    ----------
    scaled : array_like of shape (..., 6) [m]
        Elements a [da, dl, dex, dey, dix, diy].
    mean_motion : array_like of shape (...) [rad/s]
        Mean motion of the chief, on a circular orbit.
    latitude : array_like of shape (...) [rad], default 0
        The chief's argument of latitude at that time; shapes broadcast.

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
    D'Amico, Autonomous Formation Flying in Low Earth Orbit, TU Delft 2010, eqs. 2.2 and 2.17.
    """
    given, u = checked("scaled", scaled, last=6), checked("latitude", latitude)
    n = checked("mean_motion", mean_motion, positive=True)
    broadcast(scaled=given.shape[:-1], mean_motion=np.shape(n), latitude=np.shape(u))
    da, dl, dex, dey, dix, diy = np.moveaxis(given, -1, 0)
    cos, sin = np.cos(u), np.sin(u)
    eccentricity = dex * cos + dey * sin, dex * sin - dey * cos
    inclination = dix * sin - diy * cos, dix * cos + diy * sin
    palmer = np.stack(np.broadcast_arrays(*eccentricity, 0.5 * da, dl, *inclination), axis=-1)
    return state_from_palmer(palmer, n)


def roe_from_state(
    state: ArrayLike, semi_major_axis: ArrayLike, latitude: ArrayLike, mu: float = EARTH_MU
) -> Floats:
    """Return relative orbital elements of a state in the Hill frame, to first order.

    Parameters
    ----------
    state : array_like of shape (..., 6) [m, m/s]
        State in the Hill frame of a chief on a circular orbit.
    semi_major_axis : array_like of shape (...) [m]
        Semi-major axis of the chief.
    latitude : array_like of shape (...) [rad]
        The chief's argument of latitude at that time; shapes broadcast.
    mu : float [m^3/s^2], default that of the Earth
        Gravitational parameter of the body.

    Returns
    -------
    array of shape (..., 6) [no unit, rad, no unit, no unit, rad, rad]
        Elements [da, dl, dex, dey, dix, diy].

    Raises
    ------
    ValueError
        If `semi_major_axis` or `mu` is not positive, shapes do not fit, or a value is not finite.

    References
    ----------
    D'Amico, Autonomous Formation Flying in Low Earth Orbit, TU Delft 2010, eqs. 2.2 and 2.17.
    """
    a = checked("semi_major_axis", semi_major_axis, positive=True)
    _agree(checked("state", state, last=6), a, latitude, mu)
    scaled = scaled_roe_from_state(state, mean_motion_from_semi_major_axis(a, mu), latitude)
    return np.asarray(scaled / np.asarray(a)[..., None])


def state_from_roe(
    roe: ArrayLike, semi_major_axis: ArrayLike, latitude: ArrayLike, mu: float = EARTH_MU
) -> Floats:
    """Return the state in the Hill frame: the inverse of `roe_from_state`.

    Parameters
    ----------
    roe : array_like of shape (..., 6) [no unit, rad, no unit, no unit, rad, rad]
        Elements [da, dl, dex, dey, dix, diy].
    semi_major_axis : array_like of shape (...) [m]
        Semi-major axis of the chief, on a circular orbit.
    latitude : array_like of shape (...) [rad]
        The chief's argument of latitude at that time; shapes broadcast.
    mu : float [m^3/s^2], default that of the Earth
        Gravitational parameter of the body.

    Returns
    -------
    array of shape (..., 6) [m, m/s]
        State in the Hill frame.

    Raises
    ------
    ValueError
        If `semi_major_axis` or `mu` is not positive, shapes do not fit, or a value is not finite.

    References
    ----------
    D'Amico, Autonomous Formation Flying in Low Earth Orbit, TU Delft 2010, eqs. 2.2 and 2.17.
    """
    a = checked("semi_major_axis", semi_major_axis, positive=True)
    _agree(checked("roe", roe, last=6), a, latitude, mu)
    scaled = checked("roe", roe, last=6) * np.asarray(a)[..., None]
    return state_from_scaled_roe(scaled, mean_motion_from_semi_major_axis(a, mu), latitude)


def _agree(rows: Floats, semi_major_axis: Any, latitude: ArrayLike, mu: float) -> None:
    """Raise ValueError unless the arguments of `roe_from_state` broadcast."""
    number("mu", mu)
    shapes = {"semi_major_axis": np.shape(semi_major_axis), "latitude": numbers("latitude", latitude).shape}
    broadcast(rows=rows.shape[:-1], **shapes)


def _wrapped(angle: Any) -> Any:
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def _sine(name: str, inclination: Floats) -> Any:
    sine = np.sin(inclination)
    if not (sine > LEAST_SIN_INCLINATION).all():
        raise ValueError(f"{name}: orbits of inclination 0 or pi have no node; use palmer_from_state")
    return sine
