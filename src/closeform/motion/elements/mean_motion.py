"""Conversion between mean motion and altitude, period or semi-major axis.

Pure NumPy; every function broadcasts.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import SMALLEST, finite, number

EARTH_MU = 3.986004418e14
"""Earth's gravitational parameter [m^3/s^2], WGS 84 (also IERS Conventions 2010, table 1.1)."""

EARTH_RADIUS = 6378137.0
"""Earth's equatorial radius [m], WGS 84."""

EARTH_J2 = 1.082635854e-3
"""Earth's oblateness as the zonal coefficient J2, no unit, JGM-3 (Tapley et al. 1996)."""


LOWEST = 100e3  # m above the Earth: no orbit lasts below, so a lower altitude is probably in km


def low(altitude: float) -> str | None:
    """Return why an altitude [m] above the Earth is implausible, or None."""
    if not 0.0 <= number("altitude", altitude) < LOWEST:
        return None
    return (
        f"{altitude:g} m is below 100 km, where no orbit lasts; {altitude:g} km would be {1e3 * altitude:g} m"
    )


def checked(name: str, value: ArrayLike, *, positive: bool = False, last: int | None = None) -> Any:
    """Return `value` as finite floats; ValueError names the argument and the mistake."""
    array = finite(name, value, last)
    if positive and not (array >= SMALLEST).all():
        least = array.min()
        raise ValueError(
            f"{name}: must be {'positive' if least <= 0.0 else f'at least {SMALLEST:g}'}, got {least:g}"
        )
    return array if array.ndim else float(array)


def mean_motion_from_semi_major_axis(semi_major_axis: ArrayLike, mu: float = EARTH_MU) -> Any:
    """Return the mean motion of an orbit, by Kepler's third law.

    Parameters
    ----------
    semi_major_axis : array_like of shape (...) [m]
        Semi-major axis of the orbit.
    mu : float [m^3/s^2], default that of the Earth
        Gravitational parameter of the body.

    Returns
    -------
    float or array of shape (...) [rad/s]
        Mean motion of each orbit.

    Raises
    ------
    ValueError
        If a number is not positive and finite.

    References
    ----------
    Kepler's third law; docs/elements.md.
    """
    a = checked("semi_major_axis", semi_major_axis, positive=True)
    return np.sqrt(checked("mu", mu, positive=True) / a) / a


def mean_motion_from_altitude(altitude: ArrayLike, mu: float = EARTH_MU, radius: float = EARTH_RADIUS) -> Any:
    """Return the mean motion of a circular orbit at an altitude, by Kepler's third law.

    Parameters
    ----------
    altitude : array_like of shape (...) [m]
        Above the body's surface.
    mu : float [m^3/s^2], default that of the Earth
        Gravitational parameter of the body.
    radius : float [m], default the Earth's equatorial
        Radius of the body.

    Returns
    -------
    float or array of shape (...) [rad/s]
        Mean motion of each orbit.

    Raises
    ------
    ValueError
        If `mu`, `radius` or its sum with the altitude is not positive and finite.

    References
    ----------
    Kepler's third law; docs/elements.md.
    """
    a = checked("altitude", altitude) + checked("radius", radius, positive=True)
    return mean_motion_from_semi_major_axis(checked("altitude + radius", a, positive=True), mu)


def mean_motion_from_period(period: ArrayLike) -> Any:
    """Return the mean motion of an orbit from its period.

    Parameters
    ----------
    period : array_like of shape (...) [s]
        Duration of one revolution.

    Returns
    -------
    float or array of shape (...) [rad/s]
        Mean motion, 2 pi / period.

    Raises
    ------
    ValueError
        If `period` is not positive and finite.

    References
    ----------
    docs/elements.md.
    """
    return 2.0 * np.pi / checked("period", period, positive=True)


def semi_major_axis_from_mean_motion(mean_motion: ArrayLike, mu: float = EARTH_MU) -> Any:
    """Return the semi-major axis of an orbit, by Kepler's third law.

    Parameters
    ----------
    mean_motion : array_like of shape (...) [rad/s]
        Mean motion of the orbit.
    mu : float [m^3/s^2], default that of the Earth
        Gravitational parameter of the body.

    Returns
    -------
    float or array of shape (...) [m]
        Semi-major axis of each orbit.

    Raises
    ------
    ValueError
        If a number is not positive and finite.

    References
    ----------
    Kepler's third law; docs/elements.md.
    """
    n = checked("mean_motion", mean_motion, positive=True)
    return np.cbrt(checked("mu", mu, positive=True) / (n * n))


def altitude_from_mean_motion(
    mean_motion: ArrayLike, mu: float = EARTH_MU, radius: float = EARTH_RADIUS
) -> Any:
    """Return the altitude of a circular orbit, by Kepler's third law.

    Parameters
    ----------
    mean_motion : array_like of shape (...) [rad/s]
        Mean motion of the orbit.
    mu : float [m^3/s^2], default that of the Earth
        Gravitational parameter of the body.
    radius : float [m], default the Earth's equatorial
        Radius of the body.

    Returns
    -------
    float or array of shape (...) [m]
        Altitude above the body's surface; negative for an orbit inside the body.

    Raises
    ------
    ValueError
        If a number is not positive and finite.

    References
    ----------
    Kepler's third law; docs/elements.md.
    """
    return semi_major_axis_from_mean_motion(mean_motion, mu) - checked("radius", radius, positive=True)


def period_from_mean_motion(mean_motion: ArrayLike) -> Any:
    """Return the period of an orbit from its mean motion.

    Parameters
    ----------
    mean_motion : array_like of shape (...) [rad/s]
        Mean motion of the orbit.

    Returns
    -------
    float or array of shape (...) [s]
        Duration of one revolution.

    Raises
    ------
    ValueError
        If `mean_motion` is not positive and finite.

    References
    ----------
    docs/elements.md.
    """
    return 2.0 * np.pi / checked("mean_motion", mean_motion, positive=True)
