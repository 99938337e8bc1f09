"""A circular reference orbit, and the paths that spacecraft can take in its rotating frame."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, finite, instance, number, positive, shown, size
from closeform.motion.arc import END, MEAN_MOTION, PUSH, START, STATE, THRUST, WIDTH, acceleration
from closeform.motion.chief.ellipse import ellipse_of
from closeform.motion.chief.oblate_or_supplied import GivenChief, OblateChief
from closeform.motion.chief.yamanaka_ankersen import KeplerChief
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.construction.ends import arcs_between
from closeform.motion.construction.sampling import arcs_through, fired_at_ends
from closeform.motion.effort import totals
from closeform.motion.elements.elements import ellipse, inertial_from_elements
from closeform.motion.elements.mean_motion import (
    EARTH_J2,
    EARTH_MU,
    EARTH_RADIUS,
    low,
    mean_motion_from_altitude,
    mean_motion_from_period,
    mean_motion_from_semi_major_axis,
)
from closeform.motion.minimum_delta_v.within_limit import limited
from closeform.motion.path import Path, evaluate, path_of
from closeform.motion.reference_orbit import ReferenceOrbit
from closeform.motion.steering import fix_inertially, steer, transition_matrices

if TYPE_CHECKING:
    from closeform.fuel.thrusters import Thrusters

MOST_REVOLUTIONS = 1000.0  # of a span that is integrated: half a minute


@dataclass(frozen=True)
class Orbit(ReferenceOrbit):
    """A circular reference orbit, in whose rotating frame spacecraft move.

    States are positions and their rates: x radial outward, y along the velocity, z along the orbit
    normal.  In deep space the frame does not rotate.  A motion lasts at least 1e-12 s and at most 1e6
    orbits.  `Orbit.eccentric`, `Orbit.from_elements`, `Orbit.perturbed` and
    `Orbit.from_transition` return orbits of other chiefs.

    Parameters
    ----------
    mean_motion : float [rad/s]
        At least 0; 0 is deep space.

    Raises
    ------
    ValueError
        If `mean_motion` is negative, not finite, or not one number.

    References
    ----------
    Hill's equations: docs/theory.md section 1.

    Examples
    --------
    >>> orbit = cf.Orbit.circular(500e3)
    >>> round(orbit.period, 1)
    5677.0
    """

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

    @staticmethod
    def eccentric(
        eccentricity: float,
        semi_major_axis: float | None = None,
        perigee_altitude: float | None = None,
        true_anomaly: float = 0.0,
        mu: float = EARTH_MU,
        radius: float = EARTH_RADIUS,
    ) -> ChiefOrbit:
        """Return the orbit of a chief on an ellipse about a point mass.

        Parameters
        ----------
        eccentricity : float, no unit
            At least 0 and at most 0.9.
        semi_major_axis : float [m], optional
            Semi-major axis of the ellipse; give this or `perigee_altitude`.
        perigee_altitude : float [m], optional
            Altitude of perigee above the body's surface.
        true_anomaly : float [rad], default 0
            The chief's true anomaly at time 0.
        mu : float [m^3/s^2], default that of the Earth
            Gravitational parameter of the body.
        radius : float [m], default the Earth's equatorial
            Radius of the body.

        Returns
        -------
        ChiefOrbit
            Orbit with the methods of `Orbit`, to first order in the distance from the chief.  Times are
            absolute: time 0 is that of `true_anomaly`, and `start` matters.

        Raises
        ------
        ValueError
            If the eccentricity is out of its range, perigee is below the surface, not exactly one of
            `semi_major_axis` and `perigee_altitude` is given, or a number is not finite.

        References
        ----------
        Yamanaka and Ankersen, Journal of Guidance, Control, and Dynamics 25(1), 60-66, 2002; docs/theory.md
        (90).

        Examples
        --------
        >>> orbit = cf.Orbit.eccentric(0.3, perigee_altitude=500e3)
        >>> path = orbit.two_impulse([0, -400, 0, 0, 0, 0], [0, -100, 0, 0, 0, 0], 3000.0, start=600.0)
        >>> chief = orbit.coast(np.zeros(6), 3000.0, start=600.0)
        >>> bool(cf.closest_approach(path, chief, cf.Sphere(90.0)).ratio > 1.0)
        True
        """
        size_and_shape = ellipse_of(eccentricity, semi_major_axis, perigee_altitude, mu, radius)
        anomaly = float(finite("true_anomaly", number("true_anomaly", true_anomaly)))
        return ChiefOrbit(KeplerChief.at(*size_and_shape, anomaly, mu))

    @staticmethod
    def from_elements(elements: ArrayLike, mu: float = EARTH_MU) -> ChiefOrbit:
        """Return the orbit of a chief on an ellipse from its elements, such as `chief.elements`.

        Parameters
        ----------
        elements : array_like of shape (6,) [m, rad, no unit, no unit, rad, rad]
            Elements [a, u, ex, ey, i, O] at time 0, as in `inertial_from_elements`.
        mu : float [m^3/s^2], default that of the Earth
            Gravitational parameter of the body.

        Returns
        -------
        ChiefOrbit
            Orbit as by `eccentric`, with the chief's shape and anomaly.

        Raises
        ------
        ValueError
            If the elements are not six of an ellipse with an eccentricity up to 0.9, or `mu` is not positive.

        References
        ----------
        docs/elements.md.
        """
        a, u, ex, ey, *_ = ellipse("elements", elements)
        if np.ndim(a):
            raise ValueError(f"elements: expected those of one chief, got shape {np.shape(elements)}")
        size, e = ellipse_of(float(np.hypot(ex, ey)), float(a), None, mu, 0.0)
        rate = float(mean_motion_from_semi_major_axis(size, number("mu", mu)))
        return ChiefOrbit(KeplerChief(rate, e, float(u - np.arctan2(ey, ex))))

    @staticmethod
    def perturbed(
        eccentricity: float,
        inclination: float,
        semi_major_axis: float | None = None,
        perigee_altitude: float | None = None,
        argument_of_perigee: float = 0.0,
        true_anomaly: float = 0.0,
        span: float = 86400.0,
        j2: float = EARTH_J2,
        mu: float = EARTH_MU,
        radius: float = EARTH_RADIUS,
    ) -> ChiefOrbit:
        """Return the orbit of a chief about an oblate body: gravity with J2.

        The elements are those of the ellipse that osculates at time 0.

        Parameters
        ----------
        eccentricity : float, no unit
            At least 0 and at most 0.9.
        inclination : float [rad]
            Inclination to the body's equator.
        semi_major_axis : float [m], optional
            Semi-major axis of the ellipse; give this or `perigee_altitude`.
        perigee_altitude : float [m], optional
            Altitude of perigee above the body's surface.
        argument_of_perigee : float [rad], default 0
            Angle from the ascending node to perigee; at eccentricity 0, to the origin of anomalies.
        true_anomaly : float [rad], default 0
            The chief's true anomaly at time 0.
        span : float [s], default one day
            The chief is integrated from time 0 to this time, once; about 10 ms for each revolution.
        j2 : float, no unit, default that of the Earth
            Oblateness of the body.
        mu : float [m^3/s^2], default that of the Earth
            Gravitational parameter of the body.
        radius : float [m], default the Earth's equatorial
            Radius of the body, to which `j2` refers.

        Returns
        -------
        ChiefOrbit
            Orbit with the methods of `Orbit`, to first order in the distance from the chief, in the frame
            that turns with the chief.  Times are absolute, from 0 to `span`.

        Raises
        ------
        ValueError
            If the eccentricity is out of its range, perigee is below the surface, not exactly one of
            `semi_major_axis` and `perigee_altitude` is given, `span` is not positive or above 1000
            revolutions, or a number is not finite.

        References
        ----------
        docs/theory.md (80); docs/eccentric_chief.md.

        Examples
        --------
        >>> orbit = cf.Orbit.perturbed(0.001, 1.7, perigee_altitude=500e3, span=12000.0)
        >>> path = orbit.coast([0, -200, 0, 0, 0, 0], 12000.0)
        >>> bool(abs(path.position(12000.0)[1] + 200.0) < 10.0)
        True
        """
        a, e = ellipse_of(eccentricity, semi_major_axis, perigee_altitude, mu, radius)
        given = (inclination, argument_of_perigee, true_anomaly, j2)
        names = ("inclination", "argument_of_perigee", "true_anomaly", "j2")
        tilt, perigee, anomaly, oblate = (
            float(finite(name, number(name, value))) for name, value in zip(names, given, strict=True)
        )
        last = positive("span", span, " s")
        chief = KeplerChief.at(a, e, anomaly, mu)
        if last > MOST_REVOLUTIONS * chief.period:
            raise ValueError(
                f"span: must be at most {MOST_REVOLUTIONS:g} revolutions, "
                f"{MOST_REVOLUTIONS * chief.period:.6g} s, got {last:g} s"
            )
        u = perigee + chief.mean_anomaly
        elements = [a, u, e * np.cos(perigee), e * np.sin(perigee), tilt, 0.0]
        state = tuple(inertial_from_elements(elements, mu).tolist())
        return ChiefOrbit(OblateChief(state, float(mu), oblate, float(radius), (0.0, last), chief))

    @staticmethod
    def from_transition(
        transition: Callable[[float, Floats], Floats], period: float, span: ArrayLike, error: float = 1e-12
    ) -> ChiefOrbit:
        """Return the orbit of a chief whose state transition matrix is supplied: any other gravity field.

        Parameters
        ----------
        transition : callable
            `transition(start, times)` with a time [s] and later times (T,) [s] returns the matrices (T, 6, 6)
            from states `[r, v]` at `start` to those at `times`, in any frame in which both are given.
        period : float [s]
            Time scale of the motion, such as a revolution.
        span : array_like of shape (2,) [s]
            First and last time.
        error : float, no unit, default 1e-12
            Error of the matrices relative to their largest entry; it enters every certified decision.

        Returns
        -------
        ChiefOrbit
            Orbit with the methods of `Orbit`.  Times are absolute, within `span`.

        Raises
        ------
        ValueError
            If the matrices are not symplectic or not smooth to `error`, so that the thrust of minimum energy
            does not follow from them; if `span` is not two times in order, or a number is out of its range.

        References
        ----------
        docs/eccentric_chief.md.

        Examples
        --------
        >>> known = cf.Orbit.circular(500e3)
        >>> def matrices(start, times):
        ...     return known.transition(times - start)
        >>> orbit = cf.Orbit.from_transition(matrices, known.period, [0.0, 6000.0])
        >>> path = orbit.transfer([0, -200, 0, 0, 0, 0], np.zeros(6), 3000.0)
        >>> bool(np.isclose(path.energy, known.transfer([0, -200, 0, 0, 0, 0], np.zeros(6), 3000.0).energy))
        True
        """
        if not callable(transition):
            raise ValueError(f"transition: expected a function of a time and times, got {shown(transition)}")
        times, scale = finite("span", span), positive("period", period, " s")
        if times.shape != (2,) or not times[0] < times[1] <= times[0] + MOST_REVOLUTIONS * scale:
            raise ValueError(
                f"span: expected two times in s, the first before the second, at most "
                f"{MOST_REVOLUTIONS:g} periods apart, got {shown(span)}"
            )
        chief = GivenChief(transition, scale, (float(times[0]), float(times[1])), size("error", error))
        _ = chief.table  # to refuse a matrix that does not fit here, not later
        return ChiefOrbit(chief)

    @property
    def _rate(self) -> float:
        return self.mean_motion

    def _arcs(self, arcs: Floats) -> Floats:
        return arcs

    def _steer(self, arcs: Floats, finals: Floats) -> None:
        steer(self.mean_motion, arcs, finals)

    def _within_limit(
        self,
        initial: ArrayLike,
        final: ArrayLike,
        duration: ArrayLike,
        start: ArrayLike,
        limit: ArrayLike,
        delta_v: bool,
    ) -> Path:
        arcs, finals = arcs_between(self.mean_motion, initial, final, duration, start)
        self._steer(arcs.reshape(-1, WIDTH), finals)
        ends = finals.reshape(*arcs.shape[:-1], 6)
        rows, offsets, shape, _ = limited(self.mean_motion, arcs, ends, limit, delta_v)
        return path_of(self, rows, offsets, shape)

    def _least_impulses(self, arcs: Floats, finals: Floats, thrusters: Thrusters | None) -> Path:
        # Imported here so that a program without impulses neither compiles them nor loads linear
        # programming.
        from closeform.motion.minimum_delta_v.impulse_arcs import impulse_trajectories
        from closeform.motion.minimum_delta_v.impulses import answers

        given = self.mean_motion, arcs.reshape(-1, WIDTH), finals
        if thrusters is None:
            found = answers(*given)
        else:
            from closeform.motion.minimum_delta_v.directed import answers_of

            found = answers_of(thrusters, *given)
        rows, offsets = impulse_trajectories(*given, found)
        return path_of(self, rows, offsets, arcs.shape[:-1])

    def _fixed_inertially(self, arcs: Floats) -> Floats:
        fix_inertially(self.mean_motion, arcs)
        return arcs

    def _through(self, times: ArrayLike, states: ArrayLike, arrivals: Floats | None = None) -> Path:
        """Return the path that interpolates samples.

        Where `arrivals` differ from `states` the path has impulses, also at its ends.
        """
        arcs = arcs_through(self.mean_motion, times, states, arrivals)
        *batch, each, _ = arcs.shape
        offsets = each * np.arange(int(np.prod(batch, dtype=int)) + 1)
        path = Path(self, arcs.reshape(-1, WIDTH), offsets, tuple(batch))
        if arrivals is None:
            return path
        return fired_at_ends(path, (np.asarray(states) - arrivals)[..., [0, -1], 3:])

    @property
    def _model(self) -> str:
        """Name of the equations of relative motion; empty in deep space, where there are none."""
        return "Hill's equations" if self.mean_motion else ""

    @property
    def _column(self) -> float:
        """Value of the column MEAN_MOTION of arcs in this orbit."""
        return self.mean_motion

    def _bends(self, arcs: Floats) -> tuple[Floats, Floats]:
        """Return bounds (A,) on acceleration [m/s^2] and jerk [m/s^3] of coasts, burns and optimal arcs.

        Velocity and acceleration of an arc with constant push are themselves a natural motion.  Optimal
        thrust is one too, and its rate pushes them: a unit change of the acceleration grows to less than 8,
        and changes the jerk by less than 5 n.
        """
        n = self.mean_motion
        x, z, speeds = arcs[:, STATE], arcs[:, STATE + 2], arcs[:, STATE + 3 : STATE + 6]
        natural = np.stack(acceleration(n, x, z, speeds[:, 0], speeds[:, 1]), axis=1)
        accelerations = natural + arcs[:, PUSH : PUSH + 3] + arcs[:, THRUST : THRUST + 3]
        bend, jerk = self._largest_rates(speeds, accelerations)
        pushed = self._largest_rates(arcs[:, THRUST : THRUST + 3], arcs[:, THRUST + 3 : THRUST + 6])[0]
        grown = pushed * (arcs[:, END] - arcs[:, START])
        return bend + 8.0 * grown, jerk + pushed + 5.0 * n * grown

    def _largest_rates(self, places: Floats, speeds: Floats) -> tuple[Floats, Floats]:
        """Return bounds (A,) on speeds and accelerations of natural motions from places and speeds (A, 3)."""
        n = self.mean_motion
        if n == 0.0:
            return np.linalg.norm(speeds, axis=1), np.zeros(len(speeds))
        radial = np.hypot(3.0 * places[:, 0] + 2.0 * speeds[:, 1] / n, speeds[:, 0] / n)
        across = np.hypot(places[:, 2], speeds[:, 2] / n)
        swing = np.sqrt(4.0 * radial**2 + across**2)
        drift = np.abs(6.0 * n * places[:, 0] + 3.0 * speeds[:, 1])
        return drift + n * swing, n * n * swing

    def _interpolates(self, arcs: Floats) -> Any:
        """Return True for arcs (M, 30) that are cubics through samples."""
        return arcs[:, MEAN_MOTION] != self.mean_motion

    def _fill_states(self, path: Path, times: Floats, out: Floats) -> None:
        """Fill `out` with states of a path, or with thrusts if it has three columns."""
        evaluate(path.arcs, path.offsets, self.mean_motion, times, out)

    def _totals(self, path: Path, what: int) -> Floats:
        """Return a quantity of `effort.totals` for each spacecraft of a path."""
        out = np.empty(len(path.offsets) - 1)
        totals(path.arcs, path.offsets, self.mean_motion, what, out)
        return out

    def _spaced(self, begin: Any, end: Any, count: int) -> Floats:
        """Return equally spaced times (..., count) from `begin` to `end`."""
        return np.linspace(begin, end, count, axis=-1)

    def _answers(self, arcs: Floats, finals: Floats) -> Floats:
        """Return the answers (P, 34) of `impulses.answers` for arcs (P, 30) and final states (P, 6)."""
        from closeform.motion.minimum_delta_v.impulses import answers  # only what needs impulses compiles it

        return answers(self.mean_motion, arcs, finals)

    def _skew(self, time: float) -> Floats:
        """Return W (3, 3) in units of the mean motion, as `Table.skew`."""
        return np.array([[0.0, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]])

    def _flow(self, arcs: Floats) -> Floats:
        """Return the transition matrices (M, 6, 6) over arcs (M, 30)."""
        return self.transition(arcs[:, END] - arcs[:, START])


def circular_orbit(name: str, orbit: Any) -> Orbit:
    """Return an argument that is an orbit of Hill's equations; raise ValueError otherwise."""
    if isinstance(orbit, ChiefOrbit):
        orbit._refuse(f"a function with the argument `{name}`")
    return cast(Orbit, instance(name, orbit, Orbit))
