"""The chief: orbit of the formation's origin, which makes Hill's frame inertial and seconds UTC."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, instance, numbers, shown
from closeform.exchange.common_frame import INERTIAL
from closeform.exchange.ephemerides.ephemeris import Ephemeris
from closeform.exchange.ephemerides.interpolation import states_of
from closeform.exchange.epochs import Epoch
from closeform.motion.elements.elements import elements_from_inertial, inertial_from_elements, inertial_later
from closeform.motion.elements.frames import AlongTrack, inertial_from_relative, relative_from_inertial
from closeform.motion.elements.mean_motion import EARTH_MU, checked

if TYPE_CHECKING:
    from closeform.motion.orbit import Orbit

ALMOST_CIRCULAR = 1e-3  # eccentricity above which Hill's equations have a larger error than oblateness causes
OFF_BY = 25.0  # m for each metre of separation, orbit and unit of eccentricity, at most: docs/models.md


@dataclass(frozen=True, eq=False)
class Chief:
    """Orbit of a formation's origin: an inertial state at an epoch, and Keplerian motion or an ephemeris.

    Parameters
    ----------
    epoch : str
        Instant from which times count: ISO, as "2026-11-22T12:00:00".
    state : array of shape (6,) [m, m/s]
        State at `epoch`, in `frame` about `center`; array_like.
    frame : str, default "EME2000"
        Inertial frame: EME2000, GCRF, ICRF, J2000, MCI, MOD, TEME or TOD.
    time_system : str, default "UTC"
        Time system of `epoch`: GPS, TAI, TCB, TCG, TDB, TT or UTC.
    center : str, default "EARTH"
        Body at the origin of the frame.
    mu : float [m^3/s^2], default that of the Earth
        Gravitational parameter of the body.
    ephemeris : Ephemeris, optional
        Ephemeris that the chief follows instead of Keplerian motion, set by `from_ephemeris`.

    Raises
    ------
    ValueError
        If `epoch` is invalid, a frame or time system is unknown, or the state is not on an ellipse.

    References
    ----------
    Kepler's laws; docs/epochs.md.
    """

    epoch: str
    state: Floats
    frame: str = "EME2000"
    time_system: str = "UTC"
    center: str = "EARTH"
    mu: float = EARTH_MU
    ephemeris: Ephemeris | None = None

    def __post_init__(self) -> None:
        for name in ("epoch", "frame", "time_system", "center"):
            instance(name, getattr(self, name), str)
        try:
            _ = self.instant
        except ValueError as error:
            raise ValueError(f"epoch: {error}") from None
        if self.frame.upper() not in INERTIAL:
            remedy = f"convert to one of {', '.join(INERTIAL)}"
            raise ValueError(f"frame: {shown(self.frame)} rotates or is unknown; {remedy}")
        state = numbers("state", self.state)
        if state.shape != (6,):
            raise ValueError(f"state: expected shape (6,), got {state.shape}")
        object.__setattr__(self, "state", state)
        elements_from_inertial(state, self.mu)
        instance("ephemeris", self.ephemeris, Ephemeris, type(None))

    @classmethod
    def from_elements(
        cls,
        epoch: str,
        elements: ArrayLike,
        frame: str = "EME2000",
        time_system: str = "UTC",
        center: str = "EARTH",
        mu: float = EARTH_MU,
    ) -> Self:
        """Return the chief with given orbital elements.

        Parameters
        ----------
        epoch : str
            Instant from which times count: ISO.
        elements : array_like of shape (6,) [m, rad, no unit, no unit, rad, rad]
            Elements [a, u, ex, ey, i, O] at `epoch`, as in `inertial_from_elements`.
        frame, time_system, center : str, default "EME2000", "UTC" and "EARTH"
            Arguments of `Chief`.
        mu : float [m^3/s^2], default that of the Earth
            Gravitational parameter of the body.

        Returns
        -------
        Chief
            Chief in Keplerian motion.

        Raises
        ------
        ValueError
            If the elements are not those of an ellipse, or an argument is invalid for `Chief`.

        References
        ----------
        docs/epochs.md.
        """
        return cls(epoch, inertial_from_elements(elements, mu), frame, time_system, center, mu)

    @classmethod
    def from_ephemeris(
        cls,
        ephemeris: Ephemeris,
        epoch: str | None = None,
        time_system: str | None = None,
        mu: float = EARTH_MU,
    ) -> Self:
        """Return the chief that follows an ephemeris, with interpolation between its states.

        Parameters
        ----------
        ephemeris : Ephemeris
            Ephemeris in an inertial frame.
        epoch, time_system : str, optional
            Instant from which times count, within the span of the ephemeris; by default its first epoch.
        mu : float [m^3/s^2], default that of the Earth
            Gravitational parameter of the central body.

        Returns
        -------
        Chief
            Chief that follows the ephemeris, from its first state to its last.

        Raises
        ------
        ValueError
            If the epoch is outside of the span, the frame rotates, or an argument is invalid for `Chief`.

        References
        ----------
        docs/epochs.md.
        """
        instance("ephemeris", ephemeris, Ephemeris)
        instance("epoch", epoch, str, type(None))
        instance("time_system", time_system, str, type(None))
        own = Epoch(ephemeris.epoch, ephemeris.time_system)
        start = own if epoch is None else Epoch(epoch, time_system or ephemeris.time_system)
        (state,), _ = states_of(ephemeris, start, [0.0])
        return cls(start.stamp, state, ephemeris.frame, start.system, ephemeris.center, mu, ephemeris)

    @cached_property
    def instant(self) -> Epoch:
        """Epoch in its time system, which counts seconds to others."""
        return Epoch(self.epoch, self.time_system)

    @property
    def elements(self) -> Floats:
        """Elements [a, u, ex, ey, i, O] (6,) [m, rad, no unit, no unit, rad, rad] at the epoch."""
        return elements_from_inertial(self.state, self.mu)

    @cached_property
    def semi_major_axis(self) -> float:
        """Semi-major axis of the orbit [m]; for an ephemeris the mean over its states."""
        states = self.state if self.ephemeris is None else self.ephemeris.states
        return float(np.mean(elements_from_inertial(states, self.mu)[..., 0]))

    @property
    def eccentricity(self) -> float:
        """Eccentricity of the orbit at the epoch (no unit)."""
        return float(np.hypot(*self.elements[2:4]))

    @property
    def orbit(self) -> Orbit:
        """Circular orbit of the same semi-major axis, for Hill's equations."""
        from closeform.motion.orbit import Orbit  # imported here: states alone need no kernels

        return Orbit.from_semi_major_axis(self.semi_major_axis, self.mu)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about deviations of the orbit from a circle."""
        e = self.eccentricity
        off = f"errors of up to {1e3 * OFF_BY * e:.3g} m for each km of separation and orbit"
        words = f"the chief's eccentricity is {e:.4f}, but Hill's equations assume a circle: {off}"
        return (words,) if e > ALMOST_CIRCULAR else ()

    def states(self, times: ArrayLike) -> Floats:
        """Return inertial states of the chief, by Keplerian motion or from its ephemeris.

        Parameters
        ----------
        times : array_like of shape (...) [s]
            Times since `epoch`, of any sign; for an ephemeris within its span.

        Returns
        -------
        array of shape (..., 6) [m, m/s]
            States in `frame`.

        Raises
        ------
        ValueError
            If a time is not finite, or outside of the ephemeris.

        References
        ----------
        Kepler's equation; docs/epochs.md.
        """
        return self._flown(times)[0]

    def interpolation_errors(self, times: ArrayLike) -> Any:
        """Return the estimated errors of `states` due to interpolation of an ephemeris.

        Parameters
        ----------
        times : array_like of shape (...) [s]
            Times since `epoch`.

        Returns
        -------
        float or array of shape (...) [m]
            Position errors; 0 at the epochs of the ephemeris, and without an ephemeris.

        Raises
        ------
        ValueError
            If a time is not finite, or outside of the ephemeris.

        References
        ----------
        docs/ephemerides.md.
        """
        return self._flown(times)[1][()]

    def inertial_from_relative(
        self, times: ArrayLike, relative: ArrayLike, along_track: AlongTrack = "arc"
    ) -> Floats:
        """Return inertial states of spacecraft from states in the chief's Hill frame.

        Parameters
        ----------
        times : array_like of shape (...) [s]
            Times since `epoch`; they broadcast with the states.
        relative : array_like of shape (..., 6) [m, m/s]
            States in the chief's Hill frame: radial, along-track, cross-track.
        along_track : "arc" or "straight", default "arc"
            Meaning of y and z: arcs on the circle of the chief's semi-major axis, as in `common_frame` and
            screenings, or Cartesian components.

        Returns
        -------
        array of shape (..., 6) [m, m/s]
            States in `frame`.

        Raises
        ------
        ValueError
            If shapes do not fit, a value is not finite, `along_track` is unknown, or a time is
            off the ephemeris.

        References
        ----------
        docs/models.md and docs/epochs.md.
        """
        return inertial_from_relative(*self._beside(times, "relative", relative, along_track))

    def relative_from_inertial(
        self, times: ArrayLike, inertial: ArrayLike, along_track: AlongTrack = "arc"
    ) -> Floats:
        """Return states in the chief's Hill frame: the inverse of `inertial_from_relative`.

        Parameters
        ----------
        times : array_like of shape (...) [s]
            Times since `epoch`; they broadcast with the states.
        inertial : array_like of shape (..., 6) [m, m/s]
            Inertial states in `frame`.
        along_track : "arc" or "straight", default "arc"
            Meaning of y and z, as in `inertial_from_relative`.

        Returns
        -------
        array of shape (..., 6) [m, m/s]
            States in the chief's Hill frame: x radial outward, y along the motion, z along the orbit normal.

        Raises
        ------
        ValueError
            If shapes do not fit, a value is not finite, `along_track` is unknown, or a time is
            off the ephemeris.

        References
        ----------
        docs/models.md and docs/epochs.md.
        """
        return relative_from_inertial(*self._beside(times, "inertial", inertial, along_track))

    def utc(self, times: ArrayLike) -> list[str]:
        """Return times in UTC, with leap seconds.

        Parameters
        ----------
        times : array_like of shape (T,) [s]
            Times since `epoch`.

        Returns
        -------
        list of str
            ISO epochs such as "2026-11-22T12:00:00.000000000Z", to a nanosecond.

        Raises
        ------
        ValueError
            If a time is not finite.

        References
        ----------
        docs/epochs.md.
        """
        return self.instant.utc(np.ravel(checked("times", times)))

    def _flown(self, times: ArrayLike) -> tuple[Floats, Floats]:
        """Return inertial states (..., 6) and their estimated errors (...) [m]."""
        given = np.asarray(checked("times", times))
        if self.ephemeris is None:
            return inertial_later(self.state, given, self.mu), np.zeros(given.shape)
        states, errors = states_of(self.ephemeris, self.instant, given.ravel())
        return states.reshape((*given.shape, 6)), errors.reshape(given.shape)

    def _beside(self, times: ArrayLike, name: str, states: ArrayLike, along_track: AlongTrack) -> Any:
        """Return the chief's states at times, matching states of spacecraft, and the arguments of arcs."""
        given = checked(name, states, last=6)
        broadcast(**{"times": np.shape(checked("times", times)), name: given.shape[:-1]})
        arcs = isinstance(along_track, str) and along_track == "arc"
        return self.states(times), given, along_track, self.semi_major_axis if arcs else None
