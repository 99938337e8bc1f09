"""A circular reference orbit, and the paths that spacecraft can take in its rotating frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite, instance, number, positive, shown, size
from closeform.motion.arc import END, MEAN_MOTION, PUSH, START, WIDTH
from closeform.motion.chief.ellipse import ellipse_of
from closeform.motion.chief.kepler import KeplerChief
from closeform.motion.chief.oblate_or_supplied import GivenChief, OblateChief
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.effort import totals
from closeform.motion.elements.circular import CircularOrbit
from closeform.motion.elements.elements import inertial_from_elements
from closeform.motion.elements.mean_motion import EARTH_J2, EARTH_MU, EARTH_RADIUS
from closeform.motion.ends import arcs_between, arcs_from
from closeform.motion.minimum_delta_v.within_limit import limited
from closeform.motion.path import Path, evaluate, path_of
from closeform.motion.sampling import arcs_through, fired_at_ends
from closeform.motion.steering import fix_inertially, steer
from closeform.motion.two_impulse import drifts

if TYPE_CHECKING:
    from closeform.fuel.thrusters import Thrusters

MOST_REVOLUTIONS = 1000.0  # of a span that is integrated: half a minute


@dataclass(frozen=True)
class Orbit(CircularOrbit):
    """A circular reference orbit, in whose rotating frame spacecraft move.

    States are positions and their rates: x radial outward, y along the velocity, z along the orbit
    normal.  In deep space the frame does not rotate.  A motion lasts at least 1e-12 s and at most 1e6
    orbits.  `Orbit.eccentric`, `Orbit.perturbed` and `Orbit.from_transition` return orbits of other chiefs.

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
            Angle from the ascending node to perigee; at eccentricity 0 to where anomalies begin.
        true_anomaly : float [rad], default 0
            The chief's true anomaly at time 0.
        span : float [s], default one day
            The chief is integrated from time 0 to this time, once; about 20 ms for each revolution.
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
        docs/theory.md (80); docs/models.md.

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
        docs/models.md.

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

    def coast(self, state: ArrayLike, duration: ArrayLike, start: ArrayLike = 0.0) -> Path:
        """Return natural motion from a state.

        Parameters
        ----------
        state : array_like of shape (..., 6) [m, m/s]
            State at the start, in the rotating frame.
        duration : array_like of shape (...) [s]
            Above 0.
        start : array_like of shape (...) [s], default 0
            Time of the state; all arguments broadcast.

        Returns
        -------
        Path
            Path of the broadcast shape.

        Raises
        ------
        ValueError
            If a duration is not positive or too long, shapes do not fit, or a number is not finite.

        References
        ----------
        docs/theory.md section 1.
        """
        return self._path(arcs_from(self.mean_motion, duration, start, state=state))

    def transfer(
        self,
        initial: ArrayLike,
        final: ArrayLike,
        duration: ArrayLike,
        start: ArrayLike = 0.0,
        max_acceleration: ArrayLike | None = None,
        cost: Literal["energy", "delta-v"] = "energy",
    ) -> Path:
        """Return the optimal path between two states: of minimum control energy, or of minimum delta-v.

        Parameters
        ----------
        initial : array_like of shape (..., 6) [m, m/s]
            State at the start, in the rotating frame.
        final : array_like of shape (..., 6) [m, m/s]
            State at the end, in the rotating frame.
        duration : array_like of shape (...) [s]
            Above 0.
        start : array_like of shape (...) [s], default 0
            Time of the initial state; all arguments broadcast, so that `transfer(a[:, None], b, T).energy` is
            the matrix of costs from every a to every b.
        max_acceleration : array_like of shape (...) [m/s^2], default None
            Limit of the thrust acceleration; None for no limit.
        cost : {"energy", "delta-v"}, default "energy"
            Quantity to minimise: control energy, or the integral of |thrust|.  Minimum delta-v consists of
            burns at the limit with coasts between them, and of impulses if there is no limit (`impulsive`).

        Returns
        -------
        Path
            Path of the broadcast shape.  It keeps the limit to 1e-9, and its cost exceeds a lower bound,
            which is computed with it, by at most a relative 1e-6.

        Raises
        ------
        ValueError
            If it is proven that no thrust within the limit achieves the transfer: the message names the
            spacecraft and a sufficient limit; if a limit or a duration is not positive, a duration is too
            long, shapes do not fit, or a number is not finite.

        References
        ----------
        docs/theory.md section 2, from docs/theory.md (7) and docs/theory.md (8); with limits docs/theory.md
        section 6, from docs/theory.md (31) on.

        Examples
        --------
        >>> orbit = cf.Orbit.circular(500e3)
        >>> path = orbit.transfer([0, -200, 0, 0, 0, 0], np.zeros(6), orbit.period / 2)
        >>> bool(np.allclose(path.position(path.end), 0.0))
        True
        """
        if not isinstance(cost, str) or cost not in ("energy", "delta-v"):
            raise ValueError(f'cost: expected "energy" or "delta-v", got {shown(cost)}')
        if cost == "delta-v" and max_acceleration is None:
            return self.impulsive(initial, final, duration, start)
        arcs, finals = arcs_between(self.mean_motion, initial, final, duration, start)
        steer(self.mean_motion, arcs.reshape(-1, WIDTH), finals)
        if max_acceleration is None:
            return self._path(arcs)
        ends = finals.reshape(*arcs.shape[:-1], 6)
        rows, offsets, shape, _ = limited(self.mean_motion, arcs, ends, max_acceleration, cost == "delta-v")
        return path_of(self, rows, offsets, shape)

    def two_impulse(
        self, initial: ArrayLike, final: ArrayLike, duration: ArrayLike, start: ArrayLike = 0.0
    ) -> Path:
        """Return the coast between two states, with an impulse at each end.

        Parameters
        ----------
        initial : array_like of shape (..., 6) [m, m/s]
            Before the first impulse, in the rotating frame.
        final : array_like of shape (..., 6) [m, m/s]
            After the last one, in the rotating frame.
        duration : array_like of shape (...) [s]
            Above 0.
        start : array_like of shape (...) [s], default 0
            Time of the first impulse; all arguments broadcast.

        Returns
        -------
        Path
            Path of the broadcast shape.

        Raises
        ------
        ValueError
            If no two impulses reach a final position in the duration (the message gives the miss distance), a
            duration is not positive or too long, shapes do not fit, or a number is not finite.

        Notes
        -----
        At times when an initial velocity has no effect along some direction, as after half an orbit, either
        many coasts reach a position or none does. Of many, the result minimises the sum of both impulses
        squared.

        References
        ----------
        Clohessy and Wiltshire, J. Aerospace Sciences 27(9), 653-658, 1960; docs/motion.md.
        """
        return drifts(self, *arcs_between(self.mean_motion, initial, final, duration, start))

    def impulsive(
        self,
        initial: ArrayLike,
        final: ArrayLike,
        duration: ArrayLike,
        start: ArrayLike = 0.0,
        thrusters: Thrusters | None = None,
    ) -> Path:
        """Return the minimum-delta-v impulses between two states in a given time: at most six.

        Parameters
        ----------
        initial : array_like of shape (..., 6) [m, m/s]
            Before the first impulse, in the rotating frame.
        final : array_like of shape (..., 6) [m, m/s]
            After the last one, in the rotating frame.
        duration : array_like of shape (...) [s]
            Above 0, at most 100 orbits.
        start : array_like of shape (...) [s], default 0
            Departure time; all arguments broadcast, and a batch is computed on all cores.
        thrusters : Thrusters, optional
            Use these thrusters only, and sum delta-v over them: several that fire at once are as many
            impulses.

        Returns
        -------
        Path
            Path of the broadcast shape; `impulses` lists times and velocity changes of one spacecraft.

        Raises
        ------
        ValueError
            If a duration is not positive or too long, shapes do not fit, a number is not finite, or the
            thrusters cannot achieve a transfer (the message states why).

        Notes
        -----
        `least_delta_v` reports the certified bound on the cost. If several plans have the same cost, the
        result is one of them. In deep space it equals `two_impulse`; between states of one natural motion
        there is no impulse.

        References
        ----------
        Lawden's primer, by its dual in six unknowns: docs/theory.md (29, 30, 36).

        Examples
        --------
        >>> orbit = cf.Orbit.circular(500e3)
        >>> path = orbit.impulsive([0, -200, 0, 0, 0, 0], np.zeros(6), orbit.period)
        >>> len(path.impulses), round(path.delta_v, 4)
        (4, 0.0235)
        """
        # Imported here so that a program without impulses neither compiles them nor loads linear
        # programming.
        from closeform.motion.minimum_delta_v.impulse_arcs import flown_arcs
        from closeform.motion.minimum_delta_v.impulses import answers

        arcs, finals = arcs_between(self.mean_motion, initial, final, duration, start)
        given = self.mean_motion, arcs.reshape(-1, WIDTH), finals
        if thrusters is None:
            found = answers(*given)
        else:
            from closeform.motion.minimum_delta_v.directed import answers_of

            found = answers_of(thrusters, *given)
        rows, offsets = flown_arcs(*given, found)
        return path_of(self, rows, offsets, arcs.shape[:-1])

    def burn(
        self,
        state: ArrayLike,
        acceleration: ArrayLike,
        duration: ArrayLike,
        start: ArrayLike = 0.0,
        frame: Literal["orbit", "inertial"] = "orbit",
    ) -> Path:
        """Return motion under constant thrust from a state.

        Parameters
        ----------
        state : array_like of shape (..., 6) [m, m/s]
            State at the start, in the rotating frame.
        acceleration : array_like of shape (..., 3) [m/s^2]
            Thrust acceleration in `frame`.
        duration : array_like of shape (...) [s]
            Above 0.
        start : array_like of shape (...) [s], default 0
            Time of the state; all arguments broadcast.
        frame : "orbit" or "inertial", default "orbit"
            Frame in which the thrust is constant: the rotating one, or inertial axes equal to the orbit's at
            time 0.

        Returns
        -------
        Path
            Path of the broadcast shape.

        Raises
        ------
        ValueError
            If a duration is not positive or too long, shapes do not fit, a number is not finite, or `frame`
            is unknown.

        References
        ----------
        docs/theory.md section 1; docs/motion.md.
        """
        if not isinstance(frame, str) or frame not in ("orbit", "inertial"):
            raise ValueError(f"frame: 'orbit' or 'inertial', not {shown(frame)}")
        push = finite("acceleration", acceleration, 3)
        arcs = arcs_from(self.mean_motion, duration, start, state=state, like=push.shape[:-1])
        arcs[..., PUSH : PUSH + 3] = push
        if frame == "inertial":
            fix_inertially(self.mean_motion, arcs)
        return self._path(arcs)

    def sampled(self, times: ArrayLike, states: ArrayLike) -> Path:
        """Return the path through states: natural motion where spacecraft coast, cubics elsewhere.

        Parameters
        ----------
        times : array_like of shape (T,) [s]
            Increasing, T >= 2.
        states : array_like of shape (..., T, 6) [m, m/s]
            States at these times, in the rotating frame; the path passes through all of them.

        Returns
        -------
        Path
            Path of the states' leading shape; see its `interpolation_error` and `cubic_share`.

        Raises
        ------
        ValueError
            If times do not increase, shapes do not fit, a number is not finite, or an interval between times
            is too long.

        Notes
        -----
        Between two samples the path is the optimal transfer in this orbit if that needs less than a tenth of
        the energy of a cubic: there the spacecraft nearly coasts.  Otherwise it is the cubic (Hermite), which
        is the transfer at n = 0: for samples h apart its position error is at most h^4/384 max|r''''|, its
        velocity error h^3/124 max|r''''|, per axis.

        References
        ----------
        docs/theory.md section 2; docs/ephemerides.md.
        """
        return self._through(times, states)

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

    def _flow(self, arcs: Floats) -> Floats:
        """Return the transition matrices (M, 6, 6) over arcs (M, 30)."""
        return self.transition(arcs[:, END] - arcs[:, START])

    def _path(self, arcs: Any) -> Path:
        rows = np.ascontiguousarray(arcs).reshape(-1, WIDTH)
        return path_of(self, rows, np.arange(len(rows) + 1), arcs.shape[:-1])


def circular_orbit(name: str, orbit: Any) -> Orbit:
    """Return an argument that is an orbit of Hill's equations; raise ValueError otherwise."""
    if isinstance(orbit, ChiefOrbit):
        orbit._refuse(f"a function with the argument `{name}`")
    return cast(Orbit, instance(name, orbit, Orbit))
