"""Encounter of a conjunction message: two inertial states at closest approach, in the frame of the first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, positive, shown
from closeform.motion.chief.ellipse import LARGEST
from closeform.motion.chief.yamanaka_ankersen import KeplerChief
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.elements.frames import relative_from_inertial
from closeform.motion.elements.mean_motion import EARTH_MU
from closeform.motion.path import Path
from closeform.result import Result
from closeform.uncertainty.covariance import root_of
from closeform.uncertainty.errors import Uncertainty, one_state

FAR = 0.01  # of the orbit's radius: largest separation for linear relative motion


@dataclass(frozen=True, eq=False, repr=False)
class Encounter(Result):
    """Two objects near closest approach, in the turning frame of the primary; created by `Encounter.of`.

    `path`, `other`, `errors` and `other_errors` are arguments of `collision_probability`.

    Attributes
    ----------
    path : Path
        Path of the secondary; time 0 is that of the given states.
    other : Path
        Path of the primary: at rest at the origin.
    errors : Uncertainty
        Uncertainty of the secondary, at the path's start.
    other_errors : Uncertainty
        Uncertainty of the primary, at the path's start.
    distance : float [m]
        Distance at time 0.
    speed : float [m/s]
        Relative speed at time 0, in inertial axes.
    eccentricity : float, no unit
        Eccentricity of the primary's orbit.
    warnings : tuple of str
        Reasons for inaccurate results; empty where linear relative motion holds.
    """

    path: Path
    other: Path
    errors: Uncertainty
    other_errors: Uncertainty
    distance: float
    speed: float
    eccentricity: float
    warnings: tuple[str, ...]

    @classmethod
    def of(
        cls,
        primary: ArrayLike,
        secondary: ArrayLike,
        covariance: ArrayLike,
        secondary_covariance: ArrayLike,
        axes: Literal["rtn", "inertial"] = "rtn",
        half_window: float | None = None,
        mu: float = EARTH_MU,
    ) -> Self:
        """Create an encounter from two inertial states and covariances at closest approach.

        Parameters
        ----------
        primary : array_like of shape (6,) [m, m/s]
            Inertial state, in a frame centred on the body that both orbit.
        secondary : array_like of shape (6,) [m, m/s]
            Inertial state in the same frame, at the same instant.
        covariance : array_like of shape (6, 6) [m^2, m^2/s, m^2/s^2]
            Covariance of the primary's inertial position and velocity, in `axes`.
        secondary_covariance : array_like of shape (6, 6) [m^2, m^2/s, m^2/s^2]
            Covariance of the secondary, in `axes`; independent of the primary's.
        axes : "rtn" or "inertial", default "rtn"
            Axes of the covariances: each object's own radial, transverse and normal, as in a CDM
            (CCSDS 508.0), or those of the states.
        half_window : float [s], optional
            Duration of the paths before and after that instant. Default: a quarter of the primary's period,
            or, if shorter, the time in which the distance stays within a hundredth of the orbit's radius.
        mu : float [m^3/s^2], default that of the Earth
            Gravitational parameter of the body.

        Returns
        -------
        Encounter
            Paths and uncertainties in the primary's frame, which rotates at its true rate: relative motion
            of first order about the primary's ellipse.

        Raises
        ------
        ValueError
            If the primary's orbit is open or has an eccentricity above 0.9, the distance exceeds a hundredth
            of its radius, a covariance is invalid, or another argument is.

        References
        ----------
        docs/uncertainty.md; Alfano, AAS 09-233, 2009; CCSDS 508.0-B-1.
        """
        chief, deputy = one_state("primary", primary), one_state("secondary", secondary)
        if not isinstance(axes, str) or axes not in ("rtn", "inertial"):
            raise ValueError(f'axes: expected "rtn" or "inertial", got {shown(axes)}')
        root_of("covariance", covariance)
        root_of("secondary_covariance", secondary_covariance)
        orbit, eccentricity = _orbit_of(chief, positive("mu", mu, " m^3/s^2"))
        relative = relative_from_inertial(chief, deputy)
        radius, distance = float(np.linalg.norm(chief[:3])), float(np.linalg.norm(relative[:3]))
        if distance > FAR * radius:
            raise ValueError(
                f"secondary: {distance:.4g} m from the primary, but linear relative motion holds up "
                f"to {FAR * radius:.4g} m; give states at closest approach"
            )
        speed = float(np.linalg.norm(deputy[3:] - chief[3:]))
        half = _half_window(half_window, orbit, FAR * radius, speed)
        start = orbit.transition(-half, 0.0) @ relative
        path = orbit.coast(start, 2 * half, start=-half)
        other = orbit.coast(np.zeros(6), 2 * half, start=-half)
        if axes == "rtn":
            errors = Uncertainty.from_rtn(secondary_covariance, path, 0.0, chief, deputy)
            other_errors = Uncertainty.from_rtn(covariance, other, 0.0, chief)
        else:
            errors = Uncertainty.from_inertial(secondary_covariance, path, 0.0, chief)
            other_errors = Uncertainty.from_inertial(covariance, other, 0.0, chief)
        return cls(
            path,
            other,
            errors,
            other_errors,
            distance,
            speed,
            eccentricity,
            tuple(_warnings(distance, radius, errors, other_errors)),
        )


def _orbit_of(chief: Floats, mu: float) -> tuple[ChiefOrbit, float]:
    """Return the primary's orbit, with its true anomaly at time 0, and its eccentricity."""
    position, velocity = chief[:3], chief[3:]
    radius = float(np.linalg.norm(position))
    inverse = 2.0 / radius - float(velocity @ velocity) / mu
    if not inverse > 0.0:
        raise ValueError(f"primary: not on a closed orbit with mu = {mu:g} m^3/s^2; are states in m and m/s?")
    momentum = float(np.linalg.norm(np.cross(position, velocity)))
    ahead, outward = momentum**2 / (mu * radius) - 1.0, momentum * float(position @ velocity) / (mu * radius)
    eccentricity = float(np.hypot(ahead, outward))  # of which these are the parts along the radius and across
    if eccentricity > LARGEST:
        raise ValueError(
            f"primary: eccentricity {eccentricity:.3f} with states in m and m/s; tables of relative motion "
            f"are limited to {LARGEST:g}"
        )
    anomaly = float(np.arctan2(outward, ahead))
    return ChiefOrbit(KeplerChief.at(1.0 / inverse, eccentricity, anomaly, mu)), eccentricity


def _half_window(given: float | None, orbit: ChiefOrbit, far: float, speed: float) -> float:
    """Return a quarter of the period, or the time for which the two are near each other."""
    if given is None:
        quarter = 0.25 * orbit.period
        return min(quarter, far / speed) if speed > 0.0 else quarter
    return positive("half_window", given, " s")


def _warnings(distance: float, radius: float, *errors: Uncertainty) -> list[str]:
    """Return warnings on model errors of linear relative motion that matter here."""
    found = []
    curved = distance**2 / (2.0 * radius)
    least = float(np.sqrt(np.linalg.eigvalsh(sum(one.state[:3, :3] for one in errors))[0].clip(0.0)))
    if curved > 0.1 * least and curved > 1.0:
        found.append(
            f"at {distance:.4g} m the curvature of the orbit is {curved:.2g} m, compared with a "
            f"smallest standard deviation of {least:.2g} m"
        )
    return found
