"""Force model of a formation and its chief: gravity with zonals, atmospheric drag, or a user function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, instance, number, numbers, of_each, shown
from closeform.dynamics.force_model.forces import DEGREES, accelerate, propagate_states
from closeform.exchange.chief import Chief
from closeform.motion.construction.following import followed
from closeform.motion.elements.frames import inertial_from_relative, relative_from_inertial
from closeform.motion.elements.mean_motion import EARTH_J2, EARTH_RADIUS, checked
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path

# J2 to J6 of JGM-3 (Tapley et al. 1996), about a radius of 6378136.3 m.
EARTH_ZONALS = (EARTH_J2, -2.532435346e-6, -1.619331205e-6, -2.277161016e-7, 5.396484906e-7)
GRAVITY_RADIUS = 6378136.3
EARTH_SPIN = 7.292115e-5  # rad/s: GRS 80
LONGEST = 40.0  # s: step of the chief's motion; in low orbit its error is below rounding, about 1e-9 m
DAY = 86400.0  # s
TIGHT = 1e-12  # relative tolerance of the integrator for user functions
# Steps of central differences about the chief: second-order terms cancel, those of third order are 1e-11
# of the first in an orbit, and rounding is 1e-9.
BESIDE = np.repeat([10.0, 0.01], 3)  # m, m/s

Acceleration = Callable[[Floats, Floats], ArrayLike]


@dataclass(frozen=True, eq=False)
class Drag:
    """Exponential atmosphere, and the ballistic coefficients of a formation.

    Parameters
    ----------
    density : float [kg/m^3]
        Density at `altitude`.
    altitude : float [m]
        Reference altitude above the Earth's equatorial radius.
    scale_height : float [m]
        Height over which the density falls by a factor of e.
    ballistic : array of shape (N,) [m^2/kg]
        Drag coefficient times area over mass of each spacecraft, in the order of the paths; one number for
        all. Any array_like is accepted.
    chief : float [m^2/kg]
        Coefficient of the chief; 0 for a reference orbit without drag.
    spin : float [rad/s], default that of the Earth
        Rotation rate of the atmosphere; 0 for an atmosphere at rest.

    Raises
    ------
    ValueError
        If a number is negative or not finite, or a density or scale height is not positive.

    References
    ----------
    docs/theory.md (81).

    Examples
    --------
    >>> import closeform as cf
    >>> air = cf.Drag(5.2e-13, 500e3, 60e3, ballistic=[0.02, 0.022], chief=0.02)
    """

    density: float
    altitude: float
    scale_height: float
    ballistic: Floats
    chief: float
    spin: float = EARTH_SPIN

    def __post_init__(self) -> None:
        for name in ("density", "scale_height"):
            object.__setattr__(self, name, checked(name, number(name, getattr(self, name)), positive=True))
        for name in ("altitude", "chief", "spin"):
            object.__setattr__(self, name, checked(name, number(name, getattr(self, name))))
        ballistic = numbers("ballistic", self.ballistic)
        if ballistic.ndim > 1 or not (np.isfinite(ballistic) & (ballistic >= 0.0)).all():
            got = shown(self.ballistic)
            raise ValueError(f"ballistic: expected m^2/kg of each craft, 0 or more, got {got}")
        object.__setattr__(self, "ballistic", ballistic)
        if self.chief < 0.0:
            raise ValueError(f"chief: expected m^2/kg, 0 or more, got {self.chief:g}")


@dataclass(frozen=True, eq=False)
class Field:
    """Force model of a formation and its chief: an oblate body with an atmosphere, or any function.

    Parameters
    ----------
    chief : Chief
        State of the formation's origin at its epoch, propagated in this field. A chief with an ephemeris
        follows that instead.
    zonals : int or sequence of float, no unit, default 2
        Maximum degree of the Earth's zonals: 0 for a point mass, 2 to 6 for J2 to J6. Or the zonals of
        another body, from J2 onward.
    drag : Drag, optional
        Atmosphere and ballistic coefficients. Default: no drag.
    radius : float [m], default 6378136.3
        Reference radius of the body for `zonals`.
    acceleration : callable, optional
        Replacement for zonals and drag: a function of times (M,) [s] since the chief's epoch and inertial
        states (M, 6) [m, m/s] that returns accelerations (M, 3) [m/s^2], the same for the chief and all
        spacecraft. Simulations use `zonals` as a first approximation of it.

    Raises
    ------
    ValueError
        If a degree is not one of these, a number is not finite, the chief is below the surface, or
        `acceleration` is combined with `drag`.

    Notes
    -----
    The body's pole is the z axis of the chief's frame. This holds exactly for TOD, and to about 0.1 degrees
    for EME2000 in this century. The Moon, the Sun, radiation pressure and terms that depend on longitude are
    not modelled; an `acceleration` can include them.

    References
    ----------
    docs/theory.md section 10; zonals of JGM-3 (Tapley et al. 1996).

    Examples
    --------
    >>> import closeform as cf
    >>> chief = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, 0.9, 0.0])
    >>> field = cf.Field(chief)
    """

    chief: Chief
    zonals: Any = 2
    drag: Drag | None = None
    radius: float = GRAVITY_RADIUS
    acceleration: Acceleration | None = None

    def __post_init__(self) -> None:
        instance("chief", self.chief, Chief)
        instance("drag", self.drag, Drag, type(None))
        object.__setattr__(self, "radius", checked("radius", number("radius", self.radius), positive=True))
        if self.acceleration is not None and (self.drag is not None or not callable(self.acceleration)):
            raise ValueError(
                "acceleration: expected a function of times and states, which replaces zonals and drag"
            )
        object.__setattr__(self, "zonals", zonals_of(self.zonals))
        low = self.chief.semi_major_axis * (1.0 - self.chief.eccentricity)
        if low < self.radius:
            raise ValueError(
                f"chief: perigee is {low - self.radius:.0f} m above a body of {self.radius:.0f} m; "
                "give another orbit"
            )

    def _of(self, which: Any) -> Field:
        """Return the field with the ballistic coefficients of the selected spacecraft."""
        if self.drag is None or not np.ndim(self.drag.ballistic):
            return self
        return replace(self, drag=replace(self.drag, ballistic=np.asarray(self.drag.ballistic)[which]))

    @cached_property
    def _constants(self) -> Floats:
        """Constants of the field for kernels."""
        air = 0.0, 0.0, 1.0, 0.0
        if (own := self.drag) is not None:
            air = own.density, EARTH_RADIUS + own.altitude, own.scale_height, own.spin
        return np.array([self.chief.mu, self.radius, *self.zonals, *air])

    @cached_property
    def orbit(self) -> Orbit:
        """Circular orbit whose frame rotates at the mean rate of the chief's in this field, over a day.

        Relative orbits that are planned in it stay in phase with the chief for a long time. Those planned in
        `Chief.orbit`, which is Keplerian, drift, because its mean motion is wrong by about one part in a
        thousand.
        """
        end = DAY
        if self.chief.ephemeris is not None:
            end = min(end, float(np.max(self.chief.ephemeris.times)))
        times = np.linspace(0.0, end, int(end / LONGEST) + 2)
        states = self.chief_states(times)
        momentum = np.linalg.norm(np.cross(states[:, :3], states[:, 3:]), axis=1)
        spin = momentum / (states[:, :3] ** 2).sum(axis=1)
        return Orbit(float(np.trapezoid(spin, times) / times[-1]))

    @property
    def _chief_ballistic(self) -> float:
        return 0.0 if self.drag is None else self.drag.chief

    def _ballistics(self, count: int) -> Floats:
        """Return the ballistic coefficients (N,) [m^2/kg] of `count` spacecraft; 0 without drag."""
        return of_each("ballistic", 0.0 if self.drag is None else self.drag.ballistic, count)

    def accelerations(self, times: ArrayLike, states: ArrayLike, ballistics: ArrayLike = 0.0) -> Floats:
        """Return the accelerations of spacecraft.

        Parameters
        ----------
        times : array_like of shape (...) [s]
            Times since the chief's epoch; broadcast with the states.
        states : array_like of shape (..., 6) [m, m/s]
            Inertial states, in the chief's frame.
        ballistics : array_like of shape (...) [m^2/kg], default 0
            Ballistic coefficients.

        Returns
        -------
        array of shape (..., 3) [m/s^2]
            Accelerations in the chief's inertial frame.

        Raises
        ------
        ValueError
            If shapes do not match, a number is not finite, or `acceleration` raises an error, returns another
            shape, or returns numbers that are not finite.

        References
        ----------
        docs/theory.md (80) and (81).
        """
        given = np.asarray(checked("states", states, last=6))
        when, own = np.asarray(checked("times", times)), np.asarray(checked("ballistics", ballistics))
        shape = broadcast(times=when.shape, states=given.shape[:-1], ballistics=own.shape)
        rows = np.ascontiguousarray(np.broadcast_to(given, (*shape, 6)).reshape(-1, 6))
        if self.acceleration is None:
            acceleration = np.empty((len(rows), 3))
            accelerate(self._constants, np.broadcast_to(own, shape).ravel(), rows, acceleration)
            return acceleration.reshape((*shape, 3))
        when = np.broadcast_to(when, shape).ravel()
        try:
            acceleration = np.asarray(self.acceleration(when, rows), dtype=float)
        except Exception as error:  # any error of the user's function
            raise ValueError(
                f"acceleration: the function raises {type(error).__name__}: {error}; it receives times (M,) "
                "and states (M, 6)"
            ) from error
        if acceleration.shape != (len(rows), 3) or not np.isfinite(acceleration).all():
            raise ValueError(
                f"acceleration: expected finite numbers of shape ({len(rows)}, 3), got {shown(acceleration)}"
            )
        return acceleration.reshape((*shape, 3))

    def chief_states(self, times: ArrayLike) -> Floats:
        """Return the chief's inertial states in this field, or from its ephemeris.

        Parameters
        ----------
        times : array_like of shape (T,) [s]
            Times since the chief's epoch, of any sign.

        Returns
        -------
        array of shape (T, 6) [m, m/s]
            States in the chief's frame.

        Raises
        ------
        ValueError
            If a time is not finite, or outside the ephemeris.

        References
        ----------
        Extrapolation of the midpoint rule, to eighth order (Hairer, Norsett and Wanner 1993, II.9).
        """
        given = np.ravel(checked("times", times))
        if self.chief.ephemeris is not None:
            return self.chief.states(given)
        return np.asarray(self._propagate(self.chief.state[None], self._chief_ballistic, 0.0, given)[0])

    def coast(
        self,
        states: ArrayLike,
        duration: float,
        start: float = 0.0,
        within: float = 1e-3,
        orbit: Orbit | None = None,
    ) -> Path:
        """Propagate the natural motion of spacecraft, without thrust.

        Parameters
        ----------
        states : array_like of shape (..., 6) [m, m/s]
            Initial states in the chief's Hill frame with straight axes; as many as the drag has ballistic
            coefficients.
        duration : float [s]
            Duration, above 0.
        start : float [s], default 0
            Time of the states, since the chief's epoch.
        within : float [m], default 1e-3
            Largest error of the path between samples, whose density is chosen accordingly.
        orbit : Orbit, optional
            Orbit of the paths with which the result is to be screened. Default: that of the chief. The motion
            does not depend on it.

        Returns
        -------
        Path
            Path with the leading shape of the states, in that orbit, for `screen`, `find_conflicts` and
            `avoid`.

        Raises
        ------
        ValueError
            If the duration is not positive or too long, `within` is below 1e-6 m or not reached, shapes
            do not match, a number is not finite, or a time is outside the chief's ephemeris.

        Notes
        -----
        Nothing is linearised: the motion includes the chief's eccentricity, curvature and all forces.

        References
        ----------
        docs/field.md; docs/theory.md section 10.

        Examples
        --------
        >>> import closeform as cf
        >>> chief = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-2, 0.0, 0.9, 0.0])
        >>> path = cf.Field(chief).coast([0, 200, 0, 0, 0, 0], 3000.0)
        >>> hill = chief.orbit.coast([0, 200, 0, 0, 0, 0], 3000.0)
        >>> bool(abs(path.position(3000.0) - hill.position(3000.0)).max() > 1.0)
        True
        """
        instance("orbit", orbit, Orbit, type(None))
        given, begin = checked("states", states, last=6), float(checked("start", number("start", start)))
        rows = np.ascontiguousarray(given.reshape(-1, 6))
        ballistics = self._ballistics(len(rows))

        def states_at(times: Floats) -> Floats:
            states = self._drift_from(rows, ballistics, np.append(begin, times))[:, 1:]
            return states.reshape((*given.shape[:-1], len(times), 6))

        return followed(orbit or self.chief.orbit, states_at, duration, begin, within)

    def transition(self, duration: ArrayLike, start: float = 0.0) -> Floats:
        """Return state transition matrices of natural motion near the chief, with its ballistic coefficient.

        Parameters
        ----------
        duration : array_like of shape (...) [s]
            Durations of any sign.
        start : float [s], default 0
            Start time since the chief's epoch.

        Returns
        -------
        array of shape (..., 6, 6) [no unit, s, 1/s]
            Matrices that propagate small states in the chief's frame, accurate to 1e-7 within ten orbits.

        Raises
        ------
        ValueError
            If a number is not finite, or a time is outside the chief's ephemeris.

        Notes
        -----
        For a point mass these are the matrices of Yamanaka and Ankersen (`Orbit.eccentric`). For J2 those of
        Gim and Alfriend are first order in J2, in mean elements; here all orders are included, for any field.

        References
        ----------
        Gim and Alfriend, Journal of Guidance, Control, and Dynamics 26(6), 956-971, 2003, for the problem;
        docs/field.md for the method of finite differences.
        """
        lengths = np.asarray(checked("duration", duration))
        begin = float(checked("start", number("start", start)))
        beside = np.concatenate([np.diag(BESIDE), -np.diag(BESIDE)])
        times = np.append(begin, begin + lengths.ravel())
        states = self._drift_from(beside, self._chief_ballistic, times)[:, 1:]
        ahead, behind = states.reshape(2, 6, -1, 6)
        columns = (ahead - behind) / (2.0 * BESIDE[:, None, None])
        return np.ascontiguousarray(np.moveaxis(columns, 0, -1)).reshape((*lengths.shape, 6, 6))

    def _drift(self, paths: Path) -> Path:
        """Return the natural motion from the start of paths (N,), for their duration."""
        begin, over = float(paths.start[0]), float(paths.end[0])
        return self.coast(paths.state(begin), over - begin, begin, orbit=paths.orbit)

    def _drift_from(
        self,
        states: Floats,
        ballistics: ArrayLike,
        times: Floats,
        chiefs: tuple[Floats, Floats] | None = None,
    ) -> Floats:
        """Return the states (M, T, 6) of spacecraft that are in states (M, 6) at the first of times (T,).

        All are in the chief's Hill frame. `chiefs`: its inertial states (T, 6) and accelerations (T, 3), if
        they are known.
        """
        chief, acceleration = chiefs or self._chief_at(times)
        craft = inertial_from_relative(chief[0], states, acceleration=acceleration[0])
        moved = self._propagate(craft, ballistics, float(times[0]), times)
        return np.asarray(relative_from_inertial(chief, moved, acceleration=acceleration))

    def _chief_at(self, times: Floats) -> tuple[Floats, Floats]:
        """Return the chief's inertial states (T, 6) at times, and its acceleration (T, 3) [m/s^2]."""
        states = self.chief_states(times)
        return states, self.accelerations(times, states, self._chief_ballistic)

    def _propagate(self, starts: Floats, ballistics: ArrayLike, begin: float, times: Floats) -> Floats:
        """Return inertial states (M, T, 6) at times (T,) [s] of spacecraft in states (M, 6) at `begin`."""
        order = np.argsort(times, kind="stable")
        since, out = times[order] - begin, np.empty((len(starts), len(times), 6))
        own = np.broadcast_to(np.asarray(ballistics, dtype=float), len(starts)).copy()
        if self.acceleration is None:
            propagate_states(self._constants, own, np.ascontiguousarray(starts), since, LONGEST, out)
        else:
            for row, start in zip(out, starts, strict=True):
                row[since >= 0.0] = self._solve(start, begin, since[since >= 0.0])
                row[since < 0.0] = self._solve(start, begin, since[since < 0.0][::-1])[::-1]
        states = np.empty_like(out)
        states[:, order] = out
        return states

    def _solve(self, start: Floats, begin: float, since: Floats) -> Floats:
        """Return states (T, 6) in the user's field at intervals `since` (T,) [s], sorted by size."""
        if not since.any():
            return np.tile(start, (len(since), 1))
        from scipy.integrate import solve_ivp  # imported late: slow to import

        def rates(t: float, s: Floats) -> Floats:
            return np.concatenate([s[3:], self.accelerations(np.array(begin + t), s)])

        span, (apart, which) = (0.0, float(since[-1])), np.unique(np.abs(since), return_inverse=True)
        apart, atol = np.copysign(apart, span[1]), TIGHT * np.abs(start).max()
        found = solve_ivp(rates, span, start, "DOP853", apart, rtol=TIGHT, atol=atol)
        return np.asarray(found.y.T[which])


def described(field: Field) -> str:
    """Return a short description of a field."""
    if field.acceleration is not None:
        return "a function"
    degree = max((k + 2 for k, one in enumerate(field.zonals) if one != 0.0), default=0)
    pull = f"J2 to J{degree}" if degree > 2 else ("J2" if degree else "a point mass")
    return pull if field.drag is None else f"{pull} and drag"


def zonals_of(given: Any) -> tuple[float, ...]:
    """Return J2 to J6 of a degree, or as given."""
    none = (0.0,) * DEGREES
    if isinstance(given, int) and not isinstance(given, bool):
        if given not in (0, *range(2, DEGREES + 2)):
            raise ValueError(f"zonals: expected 0, or a degree from 2 to {DEGREES + 1}, got {given}")
        return (EARTH_ZONALS[: max(given - 1, 0)] + none)[:DEGREES]
    if isinstance(given, (str, bytes)) or not np.iterable(given):
        raise ValueError(f"zonals: expected a degree, or a sequence that starts with J2, got {shown(given)}")
    own = tuple(number("zonals", one) for one in given)
    if len(own) > DEGREES or not np.isfinite(own).all():
        raise ValueError(
            f"zonals: expected up to {DEGREES} finite numbers, J2 to J{DEGREES + 1}, got {shown(given)}"
        )
    return (own + none)[:DEGREES]
