"""An eccentric reference orbit: linearised natural motion relative to a chief on an ellipse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, finite, number
from closeform.motion.elements.elements import eccentric_latitude, ellipse
from closeform.motion.elements.mean_motion import EARTH_MU, checked, mean_motion_from_semi_major_axis
from closeform.motion.following import followed
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path


@dataclass(frozen=True)
class EccentricOrbit:
    """Elliptic orbit of a chief, in whose Hill frame (which turns at the true rate) spacecraft coast.

    The motion is of first order in the distance from the chief, about a point mass, for any eccentricity
    below 1.

    Parameters
    ----------
    mean_motion : float [rad/s]
        Above 0.
    eccentricity : float, no unit
        At least 0 and below 1.
    anomaly : float [rad], default 0
        The chief's true anomaly at time 0.

    Raises
    ------
    ValueError
        If a number is not finite or out of its range.

    Notes
    -----
    `EccentricOrbit` provides coasts as sampled paths, for planning in the `Orbit` of its mean motion, and
    transition matrices.  `Orbit.eccentric` makes transfers about an eccentric chief, and searches conflicts.

    References
    ----------
    Yamanaka and Ankersen, Journal of Guidance, Control, and Dynamics 25(1), 60-66, 2002; docs/theory.md (90).

    Examples
    --------
    >>> import closeform as cf
    >>> ellipse = cf.EccentricOrbit(1.1e-3, 0.02)
    >>> path = ellipse.coast([0, 200, 0, 0, 0, 0], ellipse.period)
    >>> bool(abs(path.position(ellipse.period)[1] - 200) < 30)
    True
    """

    mean_motion: float
    eccentricity: float
    anomaly: float = 0.0

    def __post_init__(self) -> None:
        motion = checked("mean_motion", number("mean_motion", self.mean_motion), positive=True)
        share = checked("eccentricity", number("eccentricity", self.eccentricity))
        if not 0.0 <= share < 1.0:
            raise ValueError(f"eccentricity: must be at least 0 and below 1, got {share:g}")
        for name, value in (("mean_motion", motion), ("eccentricity", share)):
            object.__setattr__(self, name, float(value))
        object.__setattr__(self, "anomaly", float(checked("anomaly", number("anomaly", self.anomaly))))

    @classmethod
    def from_elements(cls, elements: ArrayLike, mu: float = EARTH_MU) -> Self:
        """Return the orbit of a chief from its elements, such as `chief.elements`.

        Parameters
        ----------
        elements : array_like of shape (6,) [m, rad, no unit, no unit, rad, rad]
            Elements [a, u, ex, ey, i, O] at time 0, as in `inertial_from_elements`.
        mu : float [m^3/s^2], default that of the Earth
            Gravitational parameter of the body.

        Returns
        -------
        EccentricOrbit
            Orbit with the chief's shape and true anomaly.

        Raises
        ------
        ValueError
            If the elements are not six of an ellipse, or `mu` is not positive.

        References
        ----------
        docs/elements.md.
        """
        a, u, ex, ey, *_ = ellipse("elements", elements)
        if np.ndim(a):
            raise ValueError(f"elements: expected those of one chief, got shape {np.shape(elements)}")
        e = float(np.hypot(ex, ey))
        anomaly = _true_anomaly(float(u - np.arctan2(ey, ex)), e)
        return cls(float(mean_motion_from_semi_major_axis(float(a), number("mu", mu))), e, float(anomaly))

    @property
    def period(self) -> float:
        """Duration of one revolution [s]."""
        return 2.0 * np.pi / self.mean_motion

    def transition(self, duration: ArrayLike, start: ArrayLike = 0.0) -> Floats:
        """Return state transition matrices of natural motion.

        Parameters
        ----------
        duration : array_like of shape (...) [s]
            May be negative.
        start : array_like of shape (...) [s], default 0
            Start time; both broadcast.

        Returns
        -------
        array of shape (..., 6, 6) [no unit, s, 1/s]
            Matrices from states in the chief's frame to the states `duration` later.

        Raises
        ------
        ValueError
            If a number is not finite or shapes do not fit.

        References
        ----------
        docs/theory.md (90).
        """
        lengths, begins = finite("duration", duration), finite("start", start)
        broadcast(duration=lengths.shape, start=begins.shape)
        before, after = self._true_anomaly_at(begins), self._true_anomaly_at(begins + lengths)
        e, pace = self.eccentricity, self.mean_motion * (1.0 - self.eccentricity**2) ** -1.5
        # numbers of size 1, as rates and times are too: J = k^2 t
        moved = _scaled(e, after, pace * lengths) @ np.linalg.inv(_scaled(e, before, np.zeros_like(before)))
        return np.asarray(np.linalg.inv(_to_scaled(e, pace, after)) @ moved @ _to_scaled(e, pace, before))

    def coast(self, state: ArrayLike, duration: float, start: float = 0.0, within: float = 1e-3) -> Path:
        """Return natural motion from a state, as a path through samples.

        Parameters
        ----------
        state : array_like of shape (..., 6) [m, m/s]
            At the start, in the chief's frame.
        duration : float [s]
            Above 0.
        start : float [s], default 0
            Time of the state.
        within : float [m], default 1e-3
            Largest deviation of the path from this motion between samples; it determines their number.

        Returns
        -------
        Path
            Path of the states' leading shape in the `Orbit` of this mean motion, as `screen`,
            `find_conflicts` and `avoid` accept it.

        Raises
        ------
        ValueError
            If the duration is not positive or too long, `within` is below 1e-6 m or not reached, shapes do
            not fit, or a number is not finite.

        References
        ----------
        docs/theory.md (90).
        """
        given = finite("state", state, 6)

        def states_at(times: Floats) -> Floats:
            moved = self.transition(times - times[0], times[0])
            return np.asarray(np.einsum("tij,...j->...ti", moved, given))

        return followed(Orbit(self.mean_motion), states_at, duration, start, within)

    def _true_anomaly_at(self, times: Floats) -> Any:
        """Return the chief's true anomaly [rad] at times."""
        e, nu = self.eccentricity, self.anomaly
        # eccentric anomaly of the true one, with full revolutions kept
        eccentric = nu - 2.0 * np.arctan2(_leaning(e) * np.sin(nu), 1.0 + _leaning(e) * np.cos(nu))
        return _true_anomaly(eccentric - e * np.sin(eccentric) + self.mean_motion * times, e)


def _leaning(e: float) -> float:
    return float(e / (1.0 + np.sqrt(1.0 - e * e)))


def _true_anomaly(mean: Any, e: float) -> Any:
    """Return the true anomaly [rad] of a mean anomaly, with full revolutions kept."""
    eccentric = eccentric_latitude(mean, e, np.zeros_like(mean))
    lean = _leaning(e)
    return eccentric + 2.0 * np.arctan2(lean * np.sin(eccentric), 1.0 - lean * np.cos(eccentric))


def _to_scaled(e: float, pace: float, anomaly: Any) -> Floats:
    """Return the matrices (..., 6, 6) that scale states by rho = 1 + e cos nu.

    The scaled rates are derivatives by the true anomaly.
    """
    rho = np.asarray(1.0 + e * np.cos(anomaly))
    out = np.zeros((*rho.shape, 6, 6))
    for axis in range(3):
        out[..., axis, axis] = rho
        out[..., 3 + axis, axis] = -e * np.sin(anomaly)
        out[..., 3 + axis, 3 + axis] = 1.0 / (pace * rho)
    return out


def _scaled(e: float, anomaly: Any, passed: Any) -> Floats:
    """Return six motions at a true anomaly, as scaled states in columns (..., 6, 6), theory (90)."""
    rho = 1.0 + e * np.cos(anomaly)
    s, c = rho * np.sin(anomaly), rho * np.cos(anomaly)
    s_rate = np.cos(anomaly) + e * np.cos(2.0 * anomaly)
    c_rate = -np.sin(anomaly) - e * np.sin(2.0 * anomaly)
    out = np.zeros((*np.shape(rho), 6, 6))
    x, y, z, vx, vy, vz = range(6)
    out[..., y, 0] = 1.0
    out[..., x, 1], out[..., y, 1] = -s, -c * (1.0 + 1.0 / rho)
    out[..., vx, 1], out[..., vy, 1] = -s_rate, 2.0 * s
    out[..., x, 2], out[..., y, 2] = -c, s * (1.0 + 1.0 / rho)
    out[..., vx, 2], out[..., vy, 2] = -c_rate, 2.0 * c - e
    out[..., x, 3], out[..., y, 3] = 3.0 * e * s * passed - 2.0, 3.0 * rho**2 * passed
    out[..., vx, 3] = 3.0 * e * (s_rate * passed + s / rho**2)
    out[..., vy, 3] = 3.0 - 6.0 * e * s * passed
    out[..., z, 4], out[..., vz, 4] = np.cos(anomaly), -np.sin(anomaly)
    out[..., z, 5], out[..., vz, 5] = np.sin(anomaly), np.cos(anomaly)
    return out
