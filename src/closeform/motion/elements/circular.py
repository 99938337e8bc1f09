"""A circular reference orbit: its mean motion, period and transition matrix."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, finite, number, size
from closeform.motion.elements.mean_motion import (
    EARTH_MU,
    EARTH_RADIUS,
    mean_motion_from_altitude,
    mean_motion_from_period,
    mean_motion_from_semi_major_axis,
)
from closeform.motion.steering import transition_matrices

LOWEST = 100e3  # m above the Earth: no orbit lasts below, so a lower altitude is probably in km


def low(altitude: float) -> str | None:
    """Return why an altitude [m] above the Earth is implausible, or None."""
    if not 0.0 <= number("altitude", altitude) < LOWEST:
        return None
    return (
        f"{altitude:g} m is below 100 km, where no orbit lasts; {altitude:g} km would be {1e3 * altitude:g} m"
    )


@dataclass(frozen=True)
class CircularOrbit:
    """Properties of an `Orbit` that do not involve paths."""

    mean_motion: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean_motion", size("mean_motion", self.mean_motion, " rad/s"))

    @classmethod
    def circular(cls, altitude: float, mu: float = EARTH_MU, radius: float = EARTH_RADIUS) -> Self:
        """Return the orbit at an altitude, by Kepler's third law.

        Parameters
        ----------
        altitude : float [m]
            Above the body's surface.
        mu : float [m^3/s^2], default that of the Earth
            Gravitational parameter of the body.
        radius : float [m], default the Earth's equatorial
            Radius of the body.

        Returns
        -------
        Orbit
            Orbit with that mean motion.

        Raises
        ------
        ValueError
            If `mu`, `radius` or its sum with the altitude is not positive and finite.

        Warns
        -----
        UserWarning
            If the altitude above the Earth is below 100 km, which suggests kilometres.
        """
        given = number("altitude", altitude), number("mu", mu), number("radius", radius)
        if given[2] == EARTH_RADIUS and (line := low(given[0])):
            warnings.warn(f"altitude: {line}", stacklevel=2)
        return cls(float(mean_motion_from_altitude(*given)))

    @classmethod
    def from_semi_major_axis(cls, semi_major_axis: float, mu: float = EARTH_MU) -> Self:
        """Return the orbit of a semi-major axis, by Kepler's third law.

        Parameters
        ----------
        semi_major_axis : float [m]
            Radius of the orbit.
        mu : float [m^3/s^2], default that of the Earth
            Gravitational parameter of the body.

        Returns
        -------
        Orbit
            Orbit with that mean motion.

        Raises
        ------
        ValueError
            If a number is not positive and finite.
        """
        given = number("semi_major_axis", semi_major_axis), number("mu", mu)
        return cls(float(mean_motion_from_semi_major_axis(*given)))

    @classmethod
    def from_period(cls, period: float) -> Self:
        """Return the orbit of a period.

        Parameters
        ----------
        period : float [s]
            Duration of one revolution.

        Returns
        -------
        Orbit
            Orbit of mean motion 2 pi / period.

        Raises
        ------
        ValueError
            If `period` is not positive and finite.
        """
        return cls(float(mean_motion_from_period(number("period", period))))

    @property
    def period(self) -> float:
        """Duration of one revolution [s]; inf in deep space."""
        return 2 * np.pi / self.mean_motion if self.mean_motion else np.inf

    def transition(self, duration: ArrayLike, start: ArrayLike = 0.0) -> Floats:
        """Return state transition matrices of natural motion.

        Parameters
        ----------
        duration : array_like of shape (...) [s]
            May be negative.
        start : array_like of shape (...) [s], default 0
            Start time, on which the matrices depend only about a chief that is not on a circle; both
            broadcast.

        Returns
        -------
        array of shape (..., 6, 6) [no unit, s, 1/s]
            Matrices from states in the rotating frame to the states `duration` later.

        Raises
        ------
        ValueError
            If a number is not finite, or shapes do not broadcast.

        References
        ----------
        docs/theory.md section 1.
        """
        lengths = finite("duration", duration)
        shape = broadcast(duration=lengths.shape, start=finite("start", start).shape)
        return transition_matrices(self.mean_motion, np.broadcast_to(lengths, shape))
